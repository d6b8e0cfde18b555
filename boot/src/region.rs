//! Regions of the flash: the only place that knows a sector. The module documentation of the crate shows
//! them.

/// First address of the flash.
pub const FLASH: u32 = 0x0800_0000;
/// Size of the flash in bytes.
pub const FLASH_BYTES: u32 = 1 << 20;

/// Level of the voltage detector (PLS in PWR_CR, RM0090 5.4.1) below which the flash is not changed: 2.92 V
/// falling, typical (DS8626 table 22). Words of 32 bits need 2.7 V, and brown-out reset level 3 acts at 2.83
/// V.
pub const SUPPLY_LEVEL: u8 = 6;

/// Sectors of the flash with one purpose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Region {
    /// Address of the first byte.
    pub address: u32,
    /// Number of the first sector.
    pub sector: u32,
    /// Number of sectors.
    pub sectors: u32,
    /// Bytes of each sector.
    pub sector_bytes: u32,
}

impl Region {
    /// Bootloader.
    pub const BOOTLOADER: Self = Self { address: FLASH, sector: 0, sectors: 1, sector_bytes: 16 << 10 };
    /// State of an update.
    pub const STATE: Self = Self { address: 0x0800_4000, sector: 1, sectors: 1, sector_bytes: 16 << 10 };
    /// Stored parameters.
    pub const PARAMETERS: Self = Self { address: 0x0800_8000, sector: 2, sectors: 2, sector_bytes: 16 << 10 };
    /// Event log; reserved, nothing writes it.
    pub const LOG: Self = Self { address: 0x0801_0000, sector: 4, sectors: 1, sector_bytes: 64 << 10 };
    /// Image that runs.
    pub const IMAGE: Self = Self { address: 0x0802_0000, sector: 5, sectors: 3, sector_bytes: 128 << 10 };
    /// New image, or the one before.
    pub const NEW_IMAGE: Self = Self { address: 0x0808_0000, sector: 8, sectors: 4, sector_bytes: 128 << 10 };

    /// All regions, in the order of their addresses; they fill the flash.
    pub const ALL: [Self; 6] =
        [Self::BOOTLOADER, Self::STATE, Self::PARAMETERS, Self::LOG, Self::IMAGE, Self::NEW_IMAGE];

    /// Size in bytes.
    pub const fn bytes(&self) -> u32 {
        self.sectors * self.sector_bytes
    }
}
