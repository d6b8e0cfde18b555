//! Flash layout of the joint drive board, and the header and check of an image: shared by bootloader, image
//! and host.
//!
//! ```text
//! sector    address     size
//! 0         0800 0000   16 KB    bootloader
//! 1         0800 4000   16 KB    state of an update (embassy-boot)
//! 2, 3      0800 8000   32 KB    stored parameters; no update touches them
//! 4         0801 0000   64 KB    event log (reserved)
//! 5 to 7    0802 0000   384 KB   image that runs
//! 8 to 11   0808 0000   512 KB   new image; after an update the one before
//! ```
//!
//! embassy-boot needs one sector more for the new image than for the running one, all of equal size: 3 + 4
//! sectors of 128 KB are the largest pair of an STM32F405.
//!
//! A header of 16 bytes follows the image's vector table. The build of an image writes it ([`seal`]); the
//! image checks a new one before it is swapped in, the bootloader every image before it runs.
//!
//! Why no signature: who reaches the bus can move the leg. The check finds damage and images of other boards,
//! not attackers.
#![no_std]
#![forbid(unsafe_code)]

mod region;

pub use region::{FLASH, FLASH_BYTES, Region, SUPPLY_LEVEL};

use crc::{CRC_32_MPEG_2, Crc};

#[cfg(not(feature = "bootloader"))]
type Lookup = crc::NoTable;
#[cfg(feature = "bootloader")]
type Lookup = crc::Table<1>;

/// Check sum: CRC-32/MPEG-2, which continues from its own result.
const CODE: Crc<u32, Lookup> = Crc::<u32, Lookup>::new(&CRC_32_MPEG_2);
const START: u32 = u32::MAX;

/// Offset of the header in an image: after 16 exceptions and 82 interrupts.
pub const HEADER_AT: u32 = (16 + 82) * 4;
/// Bytes of the header.
pub const HEADER_BYTES: usize = 16;
/// Offset of the check sum in an image.
const CHECKSUM_AT: u32 = HEADER_AT + 12;
/// First word of a header: "SCRB".
const MAGIC: u32 = u32::from_le_bytes(*b"SCRB");
/// Board of the images: "OD36", ODrive v3.6.
const BOARD: u32 = u32::from_le_bytes(*b"OD36");
/// Bytes that are read and summed at once.
pub const CHUNK: usize = 256;

/// Reason why an image must not run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageError {
    /// No header: no image, or not one of Scarab.
    NoHeader,
    /// Image of another board.
    OtherBoard,
    /// Length in the header that no image has.
    Length,
    /// Content and check sum differ.
    Checksum,
    /// The flash cannot be read.
    Unreadable,
}

/// Header of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Bytes of the image, whole words.
    pub length: u32,
    /// Check sum over the image; its own word counts as erased.
    pub checksum: u32,
}

impl Header {
    /// Header before [`seal`].
    pub const UNSEALED: [u32; HEADER_BYTES / 4] = [MAGIC, BOARD, u32::MAX, u32::MAX];

    /// Decodes a header.
    ///
    /// # Errors
    /// The header is missing, of another board, or states an impossible length.
    pub fn decode(bytes: &[u8; HEADER_BYTES]) -> Result<Self, ImageError> {
        let (words, _) = bytes.as_chunks::<4>();
        let [magic, board, length, checksum] = match words {
            &[a, b, c, d] => [a, b, c, d].map(u32::from_le_bytes),
            _ => return Err(ImageError::NoHeader),
        };
        let longest = Region::IMAGE.bytes();
        match (magic, board) {
            (MAGIC, BOARD) if length > longest || length <= CHECKSUM_AT || !length.is_multiple_of(4) => {
                Err(ImageError::Length)
            }
            (MAGIC, BOARD) => Ok(Self { length, checksum }),
            (MAGIC, _) => Err(ImageError::OtherBoard),
            _ => Err(ImageError::NoHeader),
        }
    }
}

/// Check of an image, chunk by chunk, so that other work goes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Check {
    header: Header,
    offset: u32,
    sum: u32,
}

impl Check {
    /// Begins with the header; `read` copies bytes of the image from an offset on.
    ///
    /// # Errors
    /// See [`Header::decode`].
    pub fn begin(mut read: impl FnMut(u32, &mut [u8]) -> bool) -> Result<Self, ImageError> {
        let mut bytes = [0; HEADER_BYTES];
        if !read(HEADER_AT, &mut bytes) {
            return Err(ImageError::Unreadable);
        }
        Ok(Self { header: Header::decode(&bytes)?, offset: 0, sum: START })
    }

    /// Sums the next chunk; returns the result after the last one.
    pub fn step(
        &mut self,
        mut read: impl FnMut(u32, &mut [u8]) -> bool,
    ) -> Option<Result<Header, ImageError>> {
        let mut bytes = [0; CHUNK];
        let left = (self.header.length - self.offset).min(CHUNK as u32);
        let chunk = bytes.get_mut(..left as usize).unwrap_or_default();
        if !read(self.offset, chunk) {
            return Some(Err(ImageError::Unreadable));
        }
        self.sum = sum(self.sum, self.offset, chunk);
        self.offset += left;
        if self.offset < self.header.length {
            return None;
        }
        let is_equal = self.sum == self.header.checksum;
        Some(if is_equal { Ok(self.header) } else { Err(ImageError::Checksum) })
    }

    /// Checks a whole image.
    ///
    /// # Errors
    /// See [`ImageError`].
    pub fn whole(mut read: impl FnMut(u32, &mut [u8]) -> bool) -> Result<Header, ImageError> {
        let mut check = Self::begin(&mut read)?;
        loop {
            if let Some(result) = check.step(&mut read) {
                return result;
            }
        }
    }
}

/// Continues a check sum over the bytes of an image from `offset` on; the stored check sum counts as erased.
fn sum(before: u32, offset: u32, bytes: &mut [u8]) -> u32 {
    for (position, byte) in (offset..).zip(bytes.iter_mut()) {
        if position.wrapping_sub(CHECKSUM_AT) < 4 {
            *byte = 0xFF;
        }
    }
    let mut digest = CODE.digest_with_initial(before);
    digest.update(bytes);
    digest.finalize()
}

/// Writes length and check sum into the header of an image, as its last step after linking.
///
/// # Errors
/// The image has no header, or an impossible length.
pub fn seal(image: &mut [u8]) -> Result<Header, ImageError> {
    let length = image.len() as u32;
    let at = HEADER_AT as usize;
    let slot = image.get_mut(at..at + HEADER_BYTES).ok_or(ImageError::NoHeader)?;
    if let Some(word) = slot.get_mut(8..12) {
        word.copy_from_slice(&length.to_le_bytes());
    }
    let mut header = [0; HEADER_BYTES];
    header.copy_from_slice(slot);
    let checksum = {
        let _ = Header::decode(&header)?;
        let mut before = START;
        for (index, chunk) in image.chunks(CHUNK).enumerate() {
            let mut copy = [0; CHUNK];
            let copy = copy.get_mut(..chunk.len()).unwrap_or_default();
            copy.copy_from_slice(chunk);
            before = sum(before, (index * CHUNK) as u32, copy);
        }
        before
    };
    if let Some(word) = image.get_mut(at + 12..at + HEADER_BYTES) {
        word.copy_from_slice(&checksum.to_le_bytes());
    }
    Ok(Header { length, checksum })
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use std::vec::Vec;

    fn sealed(length: usize) -> Vec<u8> {
        let mut image: Vec<u8> = (0..length).map(|index| (index * 7) as u8).collect();
        for (index, word) in Header::UNSEALED.into_iter().enumerate() {
            let at = HEADER_AT as usize + 4 * index;
            image[at..at + 4].copy_from_slice(&word.to_le_bytes());
        }
        seal(&mut image).expect("an image");
        image
    }

    fn check(image: &[u8]) -> Result<Header, ImageError> {
        Check::whole(|offset, into| {
            let from = image.get(offset as usize..offset as usize + into.len());
            from.is_some_and(|from| {
                into.copy_from_slice(from);
                true
            })
        })
    }

    #[test]
    fn regions_follow_each_other_and_fill_the_flash() {
        let [first, .., last] = Region::ALL;
        assert_eq!((first.address, first.sector), (FLASH, 0));
        for pair in Region::ALL.windows(2) {
            assert_eq!(pair[0].address + pair[0].bytes(), pair[1].address);
            assert_eq!(pair[0].sector + pair[0].sectors, pair[1].sector);
        }
        assert_eq!(last.address + last.bytes(), FLASH + FLASH_BYTES);
        // embassy-boot swaps sector by sector and needs one more for the new image.
        assert_eq!(Region::NEW_IMAGE.bytes(), Region::IMAGE.bytes() + Region::IMAGE.sector_bytes);
    }

    #[test]
    fn a_sealed_image_is_accepted_and_every_changed_bit_refused() {
        let image = sealed(3000);
        let header = check(&image).expect("sealed");
        assert_eq!(header.length, 3000);
        for bit in 0..8 * image.len() {
            let mut changed = image.clone();
            changed[bit / 8] ^= 1 << (bit % 8);
            assert!(check(&changed).is_err(), "bit {bit}");
        }
    }

    #[test]
    fn the_check_sum_is_the_catalogues() {
        assert_eq!(CODE.checksum(b"123456789"), 0x0376_E6E7);
        let image = sealed(1000);
        let mut erased = image.clone();
        erased[CHECKSUM_AT as usize..][..4].fill(0xFF);
        assert_eq!(check(&image).map(|header| header.checksum), Ok(CODE.checksum(&erased)));
    }

    #[test]
    fn what_is_wrong_is_named() {
        assert_eq!(check(&[0xFF; 1000]), Err(ImageError::NoHeader));
        assert_eq!(check(&[]), Err(ImageError::Unreadable));
        let mut image = sealed(1000);
        assert_eq!(check(&image[..900]), Err(ImageError::Unreadable));
        image[500] ^= 1;
        assert_eq!(check(&image), Err(ImageError::Checksum));
        image[HEADER_AT as usize + 4] ^= 1;
        assert_eq!(check(&image), Err(ImageError::OtherBoard));
        let mut unsealed = sealed(1000);
        unsealed[HEADER_AT as usize + 8..][..8].fill(0xFF);
        assert_eq!(check(&unsealed), Err(ImageError::Length));
        assert_eq!(seal(&mut [0; 100]), Err(ImageError::NoHeader));
        assert_eq!(seal(&mut [0; 1000]), Err(ImageError::NoHeader));
        for length in [1001, Region::IMAGE.bytes() as usize + 4] {
            let mut image = sealed(1000);
            image.resize(length, 0);
            assert_eq!(seal(&mut image), Err(ImageError::Length), "{length}");
        }
    }
}
