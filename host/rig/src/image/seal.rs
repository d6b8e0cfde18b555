//! Last step after linking: length and check sum in the image's header, and the program as a host sends it.

use std::path::{Path, PathBuf};

use object::elf::{FileHeader32, PT_LOAD};
use object::read::elf::{ElfFile32, FileHeader, ProgramHeader};
use object::{Endianness, Object, ObjectSection};
use scarab_boot::{HEADER_AT, HEADER_BYTES, Region};

use scarab_base::error::{FileError, ToolError};
use scarab_base::files;

/// Section of the header.
const SECTION: &str = ".image_header";
/// Bytes of an erased flash.
const ERASED: u8 = 0xFF;

/// Bytes of an image from its first address on, whole words.
fn program(elf: &[u8]) -> Result<Vec<u8>, String> {
    let header = FileHeader32::<Endianness>::parse(elf).map_err(|error| error.to_string())?;
    let endian = header.endian().map_err(|error| error.to_string())?;
    let mut program = Vec::new();
    for segment in header.program_headers(endian, elf).map_err(|error| error.to_string())? {
        let bytes = segment.data(endian, elf).map_err(|()| "damaged segment")?;
        if segment.p_type(endian) != PT_LOAD || bytes.is_empty() {
            continue;
        }
        let address = segment.p_paddr(endian);
        let at = address.wrapping_sub(Region::IMAGE.address) as usize;
        if at + bytes.len() > Region::IMAGE.bytes() as usize {
            return Err(format!("a segment at {address:#x} lies outside the image's sectors"));
        }
        program.resize(program.len().max(at + bytes.len()).next_multiple_of(4), ERASED);
        program[at..at + bytes.len()].copy_from_slice(bytes);
    }
    Ok(program)
}

/// Completes the header of an image and writes its program beside it; returns the program's path.
///
/// # Errors
/// The file is no image of the board, or cannot be written.
pub(crate) fn seal(image: &Path) -> Result<PathBuf, ToolError> {
    let mut elf = std::fs::read(image).map_err(|error| FileError::unreadable(image, &error))?;
    let refused = |reason: String| {
        ToolError::input(format!("{}: not an image of the board: {reason}", image.display()))
    };
    let mut program = program(&elf).map_err(refused)?;
    scarab_boot::seal(&mut program).map_err(|error| refused(format!("{error:?}")))?;
    let start = {
        let file = ElfFile32::<Endianness>::parse(&*elf).map_err(|error| refused(error.to_string()))?;
        let section = file.section_by_name(SECTION);
        section.and_then(|section| section.file_range()).ok_or_else(|| refused(format!("no {SECTION}")))?.0
    } as usize;
    let at = HEADER_AT as usize;
    elf[start..start + HEADER_BYTES].copy_from_slice(&program[at..at + HEADER_BYTES]);
    files::write(image, &elf)?;
    let path = image.with_extension("bin");
    files::write(&path, &program)?;
    Ok(path)
}
