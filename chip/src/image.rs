//! The flash image: bytes of its sections, names of its functions, lengths of its blocks.

use std::path::Path;
use std::rc::Rc;

use object::elf::PT_LOAD;
use object::read::elf::{ElfFile32, ProgramHeader};
use object::{Endianness, Object, ObjectSymbol, SymbolKind};
use scarab_base::error::{FileError, ToolError};
use scarab_boot::{FLASH, FLASH_BYTES, Region};
use scarab_identify::formats::leg_file::LegFile;
use scarab_rig::image::build;

/// Name of the bootloader's file.
const BOOTLOADER: &str = "scarab-boot";

/// Symbol of the image.
#[derive(Clone, Debug)]
struct Symbol {
    address: u32,
    size: u32,
    name: String,
}

impl Symbol {
    /// Name as in the source, without the crate's hash.
    fn path(&self) -> String {
        format!("{:#}", rustc_demangle::demangle(&self.name))
    }
}

/// A flash image, as the linker wrote it.
#[derive(Clone, Debug)]
pub struct Image {
    /// Whole file, for the decoder of records.
    pub elf: Vec<u8>,
    pub flash: Vec<u8>,
    functions: Vec<Symbol>,
    objects: Vec<Symbol>,
}

impl Image {
    /// Reads an image, and the bootloader beside it where it has none of its own.
    ///
    /// # Errors
    /// A file cannot be read, or is not an image of the board.
    pub fn load(path: &Path) -> Result<Rc<Self>, ToolError> {
        let read = |path: &Path| {
            let elf = std::fs::read(path).map_err(|error| FileError::unreadable(path, &error))?;
            Self::parse(elf).map_err(|reason| {
                ToolError::input(format!("{}: not an image of the board: {reason}", path.display()))
            })
        };
        let mut image = read(path)?;
        if image.word(FLASH) == Some(u32::MAX) {
            image.add(read(&path.with_file_name(BOOTLOADER))?);
        }
        Ok(Rc::new(image))
    }

    /// Builds the image of a leg.
    ///
    /// # Errors
    /// The compiler is missing or fails.
    pub fn build(leg: &LegFile) -> Result<Rc<Self>, ToolError> {
        let options = build::Options {
            leg: leg.clone(),
            log: false,
            brake_resistor: true,
            status_light: leg.brake.is_none(),
            board_volts: None,
        };
        Self::load(&build::build(&options)?.image)
    }

    /// Adds the bytes and names of a bootloader.
    fn add(&mut self, bootloader: Self) {
        let end = (Region::IMAGE.address - FLASH) as usize;
        self.flash[..end].copy_from_slice(&bootloader.flash[..end]);
        self.functions.extend(bootloader.functions);
        self.functions.sort_by_key(|symbol| symbol.address);
    }

    /// Parses an ELF file.
    ///
    /// # Errors
    /// Names the missing part.
    pub fn parse(elf: Vec<u8>) -> Result<Self, String> {
        let mut flash = vec![0xFF; FLASH_BYTES as usize];
        let (mut functions, mut objects) = (Vec::new(), Vec::new());
        {
            let file = ElfFile32::<Endianness>::parse(&*elf).map_err(|error| error.to_string())?;
            let endian = file.endian();
            for segment in
                file.elf_program_headers().iter().filter(|segment| segment.p_type(endian) == PT_LOAD)
            {
                let bytes = segment.data(endian, &*elf).map_err(|()| "damaged segment")?;
                let at = segment.p_paddr(endian).wrapping_sub(FLASH) as usize;
                if bytes.is_empty() {
                    continue;
                }
                let slot = flash.get_mut(at..at + bytes.len()).ok_or("a segment lies outside the flash")?;
                slot.copy_from_slice(bytes);
            }
            for symbol in file.symbols() {
                let Ok(name) = symbol.name() else { continue };
                let entry = |address: u64| Symbol {
                    address: address as u32,
                    size: symbol.size() as u32,
                    name: name.to_owned(),
                };
                match symbol.kind() {
                    SymbolKind::Text => functions.push(entry(symbol.address() & !1)),
                    SymbolKind::Data => objects.push(entry(symbol.address())),
                    _ => {}
                }
            }
        }
        functions.sort_by_key(|symbol| symbol.address);
        Ok(Self { elf, flash, functions, objects })
    }

    /// An image without names, from its first bytes.
    pub fn from_bytes(bytes: &[u8]) -> Self {
        let mut flash = vec![0xFF; FLASH_BYTES as usize];
        flash[..bytes.len()].copy_from_slice(bytes);
        Self { elf: Vec::new(), flash, functions: Vec::new(), objects: Vec::new() }
    }

    pub fn word(&self, address: u32) -> Option<u32> {
        let at = address.checked_sub(FLASH)? as usize;
        self.flash.get(at..at + 4).map(|bytes| u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
    }

    /// Name of the function at an address, or the address.
    pub fn function(&self, address: u32) -> String {
        let after = self.functions.partition_point(|symbol| symbol.address <= address);
        match after.checked_sub(1).and_then(|index| self.functions.get(index)) {
            Some(symbol) if address < symbol.address + symbol.size.max(2) => symbol.path(),
            _ => format!("{address:#010x}"),
        }
    }

    /// Address of a symbol by its exact name.
    pub fn address(&self, name: &str) -> Option<u32> {
        let mut all = self.objects.iter().chain(&self.functions);
        all.find(|symbol| symbol.name == name).map(|symbol| symbol.address)
    }

    /// Address of the function whose name contains `within` and ends with `name`.
    pub fn function_in(&self, within: &str, name: &str) -> Option<u32> {
        let is_meant = |symbol: &&Symbol| symbol.path().contains(within) && symbol.path().ends_with(name);
        self.functions.iter().find(is_meant).map(|symbol| symbol.address)
    }

    /// Address and size of the variable whose name ends so, without the crate's hash.
    ///
    /// # Errors
    /// There is none.
    pub fn variable(&self, path: &str) -> Result<(u32, u32), ToolError> {
        let found = self.objects.iter().find(|symbol| symbol.path().ends_with(path));
        let missing = || ToolError::input(format!("the image has no variable {path}"));
        found.map(|symbol| (symbol.address, symbol.size)).ok_or_else(missing)
    }

    /// Addresses of all halfwords with a value, which may be instructions.
    pub fn find(&self, halfword: u16) -> Vec<u32> {
        let bytes = halfword.to_le_bytes();
        let halves = self.flash.chunks_exact(2).enumerate();
        halves.filter(|(_, half)| *half == bytes).map(|(index, _)| FLASH + 2 * index as u32).collect()
    }

    /// Number of instructions in a block of code.
    pub fn instructions(&self, address: u32, size: u32) -> u32 {
        let at = address.wrapping_sub(FLASH) as usize;
        let (mut offset, mut count) = (0, 0);
        while offset < size as usize {
            // The upper five bits of the first halfword tell the length (ARMv7-M, A5.1).
            let upper = self.flash.get(at + offset + 1).copied().unwrap_or(0) >> 3;
            offset += if upper >= 0b11101 { 4 } else { 2 };
            count += 1;
        }
        count
    }
}
