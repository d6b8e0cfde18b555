//! Size of an image in flash and memory, and its largest parts.

use std::path::Path;

use object::{Object, ObjectSection, ObjectSymbol, SectionFlags, SymbolKind};
use serde::Serialize;

use scarab_boot::Region;

use scarab_base::error::{FileError, ToolError};
use scarab_base::table::{Table, cells};

/// Flash limit of an image, bytes.
pub(crate) const FLASH_LIMIT: u64 = Region::IMAGE.bytes() as u64;
/// Share of the limit above which `cargo fw` warns, so that the next change still fits.
const WARNING: f64 = 0.9;
/// Memory limit of its variables, bytes: what the stack leaves of 128 KB.
pub const MEMORY_GOAL: u64 = (128 - 56) * 1024;
/// Size of the core-coupled memory, bytes.
pub(crate) const CORE_COUPLED: u64 = 64 * 1024;
/// Number of listed symbols.
const LARGEST: usize = 20;

/// Base addresses of flash and core-coupled memory.
const FLASH_BASE: u64 = 0x0800_0000;
const CORE_COUPLED_BASE: u64 = 0x1000_0000;
const MEMORY_BASE: u64 = 0x2000_0000;
/// Flag of a section that is loaded or cleared (ELF, SHF_ALLOC).
const ALLOCATED: u64 = 2;

/// One section.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Section {
    /// Name, for example `.text`.
    pub name: String,
    /// Bytes.
    pub bytes: u64,
    /// Bytes in flash.
    pub flash: u64,
    /// Bytes in memory.
    pub memory: u64,
    /// Bytes in core-coupled memory.
    pub core_coupled: u64,
}

/// One symbol.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Symbol {
    /// Name as in the source.
    pub(crate) name: String,
    /// Bytes.
    pub(crate) bytes: u64,
}

/// Size of an image.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ImageSize {
    /// Sections in the order of their addresses.
    pub sections: Vec<Section>,
    /// Largest functions and constants.
    pub code: Vec<Symbol>,
    /// Largest variables.
    pub variables: Vec<Symbol>,
    /// Stack reserved by the image, bytes.
    pub stack: u64,
}

impl ImageSize {
    /// Reads the size of an image.
    pub fn read(image: &Path) -> Result<Self, ToolError> {
        let wrong = |error: &dyn std::fmt::Display| FileError::new(image.display(), error);
        let bytes = std::fs::read(image).map_err(|error| wrong(&error))?;
        let file = object::File::parse(&*bytes).map_err(|error| wrong(&error))?;
        let mut sections: Vec<(u64, Section)> = file.sections().filter_map(|found| section(&found)).collect();
        sections.sort_by_key(|(address, _)| *address);
        let mut code = Vec::new();
        let mut variables = Vec::new();
        for symbol in file.symbols().filter(|symbol| symbol.size() > 0) {
            let name = format!("{:#}", rustc_demangle::demangle(symbol.name().unwrap_or("?")));
            let entry = Symbol { name, bytes: symbol.size() };
            match (symbol.kind(), symbol.address()) {
                (SymbolKind::Text, _) => code.push(entry),
                (SymbolKind::Data, FLASH_BASE..CORE_COUPLED_BASE) => code.push(entry),
                (SymbolKind::Data, _) => variables.push(entry),
                _ => {}
            }
        }
        for list in [&mut code, &mut variables] {
            list.sort_by(|one, other| other.bytes.cmp(&one.bytes).then_with(|| one.name.cmp(&other.name)));
            list.truncate(LARGEST);
        }
        let address =
            |name: &str| file.symbols().find(|symbol| symbol.name() == Ok(name)).map(|s| s.address());
        let stack = match (address("_stack_start"), address("_stack_end")) {
            (Some(top), Some(bottom)) => top.saturating_sub(bottom),
            _ => 0,
        };
        Ok(Self {
            sections: sections.into_iter().map(|(_, section)| section).collect(),
            code,
            variables,
            stack,
        })
    }

    /// Bytes in flash.
    pub fn flash(&self) -> u64 {
        self.sections.iter().map(|section| section.flash).sum()
    }

    /// Bytes in memory without the stack.
    pub fn memory(&self) -> u64 {
        self.sections.iter().map(|section| section.memory).sum()
    }

    /// Bytes in core-coupled memory.
    pub(crate) fn core_coupled(&self) -> u64 {
        self.sections.iter().map(|section| section.core_coupled).sum()
    }

    /// Missed goals, in words.
    pub fn missed(&self) -> Vec<String> {
        let goals = [
            ("flash", self.flash(), FLASH_LIMIT),
            ("memory", self.memory(), MEMORY_GOAL),
            ("core-coupled memory", self.core_coupled(), CORE_COUPLED),
        ];
        let missed = goals.into_iter().filter(|(_, bytes, goal)| bytes > goal);
        missed.map(|(name, bytes, goal)| format!("{name}: {bytes} bytes, limit {goal}")).collect()
    }

    /// Warning about little free flash.
    pub fn warning(&self) -> Option<String> {
        let share = self.flash() as f64 / FLASH_LIMIT as f64;
        let free = FLASH_LIMIT.saturating_sub(self.flash());
        (share > WARNING)
            .then(|| format!("the image fills {:.0} % of its flash: {free} bytes are free", 100.0 * share))
    }

    /// Formats the size as tables.
    pub fn text(&self) -> String {
        let mut sections = Table::default().label("section").numbers(["flash", "memory", "core-coupled"]);
        let cell = |bytes: u64| if bytes == 0 { String::new() } else { bytes.to_string() };
        for section in &self.sections {
            sections.row(cells![
                &section.name,
                cell(section.flash),
                cell(section.memory),
                cell(section.core_coupled),
            ]);
        }
        sections.row(cells!["in all", self.flash(), self.memory(), self.core_coupled()]);
        sections.row(cells!["at most", FLASH_LIMIT, MEMORY_GOAL, CORE_COUPLED]);
        let list = |title: &str, symbols: &[Symbol]| {
            let mut table = Table::default().numbers(["bytes"]).text([title]);
            for symbol in symbols {
                table.row(cells![symbol.bytes, &symbol.name]);
            }
            table.to_text()
        };
        format!(
            "{}\n\nreserved stack: {} bytes\n\n{}\n\n{}\n",
            sections.to_text(),
            self.stack,
            list("largest functions and constants", &self.code),
            list("largest variables", &self.variables)
        )
    }
}

/// Section that occupies the device; data loaded into memory also occupy flash.
fn section<'data>(found: &impl ObjectSection<'data>) -> Option<(u64, Section)> {
    let allocated = match found.flags() {
        SectionFlags::Elf { sh_flags } => sh_flags & ALLOCATED != 0,
        _ => false,
    };
    let (address, bytes) = (found.address(), found.size());
    if !allocated || bytes == 0 {
        return None;
    }
    let loaded = found.file_range().is_some_and(|(_, length)| length > 0);
    let (flash, memory, core_coupled) = match address {
        FLASH_BASE..CORE_COUPLED_BASE => (bytes, 0, 0),
        CORE_COUPLED_BASE..MEMORY_BASE => (0, 0, bytes),
        MEMORY_BASE.. => (if loaded { bytes } else { 0 }, bytes, 0),
        _ => return None,
    };
    let name = found.name().unwrap_or("?").to_owned();
    Some((address, Section { name, bytes, flash, memory, core_coupled }))
}
