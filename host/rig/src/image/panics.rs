//! Finds the locations at which an image can panic, and those that its interrupts reach.
//!
//! Why: a panic of the current loops or the servo would stop the leg, so none may exist, and no compiler
//! guarantees it. The image shows it: every branch to one of the language's panic functions is a location.
//! Functions that the vectors reach by branches belong to the interrupts.
//!
//! ```text
//! BL      11110 S imm10 | 11 J1 1 J2 imm11     target = pc + 4 + imm25, I = not(J xor S)   call
//! B.W     11110 S imm10 | 10 J1 1 J2 imm11     as BL                                       tail call
//! Bc.W    11110 S c imm6 | 10 J1 0 J2 imm11    target = pc + 4 + imm21                     to a cold end
//! B, Bc   11100 imm11, 1101 c imm8             target = pc + 4 + imm12, imm9               to a neighbour
//! ```
//!
//! Source: Armv7-M Architecture Reference Manual (DDI 0403), A7.7.12, A7.7.18. Mapping symbols `$t`
//! and `$d` mark words between code (Arm ELF, IHI 0044, 4.5.5).
//!
//! The name of a panic does not identify it: the image's handler ignores messages, so the compiler
//! merges all panics without arguments into one function. Their argument distinguishes them: the
//! source location, loaded by the two instructions before the branch:
//!
//! ```text
//! MOVW r0, MOVT r0   11110 i 10 s100 imm4 | 0 imm3 0000 imm8   r0 = address of name, length, line, column
//! ```
//!
//! Known limits: calls by a pointer are counted but not followed; remainders by the capacity of a
//! queue (`QUEUE`) are reported but accepted.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use object::{Object, ObjectSection, ObjectSymbol, SymbolKind};

use scarab_base::error::{FileError, ToolError};

/// Vectors of levels 0 and 1: converters, index pulses, servo.
const VECTORS: [&str; 4] = ["ADC", "EXTI9_5", "EXTI15_10", "OTG_HS"];
/// Prefixes of the panic functions of the language and of `defmt`.
const PANICS: [&str; 8] = [
    "core::panicking::",
    "core::option::unwrap_failed",
    "core::option::expect_failed",
    "core::result::unwrap_failed",
    "core::cell::panic_",
    "core::slice::index::slice_index_fail",
    "_defmt_panic",
    "__defmt_default_panic",
];
/// File with tolerated panics in interrupts. A queue of `heapless` stores its capacity as a value and takes
/// the remainder of an index by it. The compiler does not see that every capacity is a constant above zero.
const QUEUE: [&str; 2] = ["heapless-", "/src/spsc.rs"];

/// A branch to a panic.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct PanicSite {
    /// Function that contains the branch.
    pub(crate) within: String,
    /// Name of the panic.
    pub(crate) panic: String,
    /// Source file; empty if the image does not contain it.
    pub file: String,
    /// Line in it.
    pub line: u32,
    /// Address of the two instructions before the branch, which load the source location.
    pub address: u32,
}

impl PanicSite {
    /// Whether the panic is the remainder of a queue's index by its capacity.
    fn is_of_a_queue(&self) -> bool {
        let [begin, end] = QUEUE;
        self.file.starts_with(begin) && self.file.ends_with(end)
    }
}

/// Panic locations of an image.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Panics {
    /// All locations.
    pub all: Vec<PanicSite>,
    /// Locations that levels 0 and 1 reach.
    pub(crate) interrupts: Vec<PanicSite>,
    /// Functions that levels 0 and 1 reach.
    pub(crate) reached: usize,
    /// Calls by a pointer in those functions.
    pub(crate) by_pointer: usize,
}

/// One function.
struct Function {
    name: String,
    end: u32,
    branches: Vec<Branch>,
    by_pointer: usize,
}

/// One branch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Branch {
    at: u32,
    to: u32,
    /// Value of the first register, loaded by the two instructions before the branch.
    argument: Option<u32>,
}

impl Panics {
    /// Finds the locations of an image.
    pub fn read(image: &Path) -> Result<Self, ToolError> {
        let bytes = std::fs::read(image).map_err(|error| FileError::new(image.display(), error))?;
        Self::parse(&bytes, &image.display())
    }

    /// Finds the locations of an image in memory; `name` is its name in errors.
    pub fn parse(bytes: &[u8], name: &dyn std::fmt::Display) -> Result<Self, ToolError> {
        let wrong = |error: &dyn std::fmt::Display| FileError::new(name, error);
        let file = object::File::parse(bytes).map_err(|error| wrong(&error))?;
        let text = file.section_by_name(".text").ok_or_else(|| wrong(&"no section .text"))?;
        let code = text.data().map_err(|error| wrong(&error))?;
        let words = Code { base: text.address() as u32, bytes: code, data: data_ranges(&file) };
        let mut functions = BTreeMap::new();
        for symbol in file.symbols().filter(|symbol| symbol.kind() == SymbolKind::Text && symbol.size() > 0) {
            let begin = symbol.address() as u32 & !1;
            let end = begin + symbol.size() as u32;
            let name = format!("{:#}", rustc_demangle::demangle(symbol.name().unwrap_or("?")));
            let (branches, by_pointer) = words.branches(begin, end);
            // If an address has several names, a vector's name has priority.
            let known = functions.get(&begin).is_some_and(|known: &Function| VECTORS.contains(&&*known.name));
            if !known {
                functions.insert(begin, Function { name, end, branches, by_pointer });
            }
        }
        if VECTORS.iter().any(|vector| functions.values().all(|function| function.name != *vector)) {
            return Err(wrong(&format!("lacks one of the vectors {}", VECTORS.join(", "))).into());
        }
        Ok(Self::within(&functions, |location| source(&file, location)))
    }

    /// Finds the locations among functions; `source` returns file and line of a source location.
    fn within(functions: &BTreeMap<u32, Function>, source: impl Fn(u32) -> Option<(String, u32)>) -> Self {
        let mut reached: BTreeSet<u32> = BTreeSet::new();
        let mut open: Vec<u32> = functions
            .iter()
            .filter(|(_, function)| VECTORS.contains(&&*function.name))
            .map(|(begin, _)| *begin)
            .collect();
        while let Some(begin) = open.pop() {
            if reached.insert(begin) {
                let callees = callees(functions, begin).map(|(callee, _)| callee);
                open.extend(callees.filter(|callee| !is_panic(functions, *callee)));
            }
        }
        let mut panics = Self { reached: reached.len(), ..Self::default() };
        for (begin, function) in functions.iter().filter(|(begin, _)| !is_panic(functions, **begin)) {
            let sites = callees(functions, *begin).filter(|(callee, _)| is_panic(functions, *callee));
            let sites = sites.map(|(callee, branch)| {
                let (file, line) = branch.argument.and_then(&source).unwrap_or_default();
                let panic = functions.get(&callee).map_or_else(String::new, |callee| callee.name.clone());
                PanicSite {
                    within: function.name.clone(),
                    panic,
                    file,
                    line,
                    address: branch.at.wrapping_sub(8),
                }
            });
            let sites: Vec<PanicSite> = sites.collect();
            if reached.contains(begin) {
                panics.by_pointer += function.by_pointer;
                panics.interrupts.extend(sites.iter().cloned());
            }
            panics.all.extend(sites);
        }
        panics
    }

    /// Violations in interrupts, in words.
    pub fn missed(&self) -> Vec<String> {
        let others = self.interrupts.iter().filter(|site| !site.is_of_a_queue());
        let text = |site: &PanicSite| {
            format!("an interrupt can panic: {} in {} ({})", site.panic, site.within, site.file)
        };
        others.map(text).collect()
    }

    /// Summary.
    pub fn text(&self) -> String {
        let functions: BTreeSet<&str> = self.all.iter().map(|site| &*site.within).collect();
        let mut text = format!(
            "panics: {} places in {} functions; {} of them in the {} functions that the current loops and the servo reach ({} calls by a \
             pointer in these are not followed)\n",
            self.all.len(),
            functions.len(),
            self.interrupts.len(),
            self.reached,
            self.by_pointer
        );
        for site in &self.interrupts {
            text += &format!("  {} in {} ({})\n", site.panic, site.within, site.file);
        }
        text
    }
}

/// Targets of a function's branches except itself; one entry per branch.
fn callees(functions: &BTreeMap<u32, Function>, begin: u32) -> impl Iterator<Item = (u32, Branch)> {
    let function = functions.get(&begin);
    let branches = function.map_or(&[][..], |function| &function.branches);
    let end = function.map_or(begin, |function| function.end);
    branches.iter().filter(move |branch| !(begin..end).contains(&branch.to)).filter_map(|branch| {
        let (callee, function) = functions.range(..=branch.to).next_back()?;
        (branch.to < function.end).then_some((*callee, *branch))
    })
}

/// File name and line of a `core::panic::Location`: the name's address and length, then the line.
fn source(file: &object::File<'_>, location: u32) -> Option<(String, u32)> {
    let bytes = |address: u32, length: u32| {
        file.sections().find_map(|section| {
            section.data_range(address.into(), length.into()).ok().flatten().map(<[u8]>::to_vec)
        })
    };
    let word = |address| Some(u32::from_le_bytes(bytes(address, 4)?.try_into().ok()?));
    let name = bytes(word(location)?, word(location.checked_add(4)?)?)?;
    Some((String::from_utf8(name).ok()?, word(location.checked_add(8)?)?))
}

fn is_panic(functions: &BTreeMap<u32, Function>, begin: u32) -> bool {
    functions.get(&begin).is_some_and(|function| PANICS.iter().any(|panic| function.name.starts_with(panic)))
}

/// Address ranges between `$d` and the next `$t`.
fn data_ranges(file: &object::File<'_>) -> Vec<(u32, u32)> {
    let mut marks: Vec<(u32, bool)> = file
        .symbols()
        .filter_map(|symbol| {
            let name = symbol.name().ok()?;
            let is = |mark: &str| {
                name == mark || name.strip_prefix(mark).is_some_and(|rest| rest.starts_with('.'))
            };
            (is("$d") || is("$t")).then_some((symbol.address() as u32, is("$d")))
        })
        .collect();
    marks.sort_unstable();
    let pairs = marks.windows(2).filter(|pair| pair[0].1);
    pairs.map(|pair| (pair[0].0, pair[1].0)).collect()
}

/// Instructions of an image.
struct Code<'a> {
    base: u32,
    bytes: &'a [u8],
    data: Vec<(u32, u32)>,
}

impl Code<'_> {
    fn half(&self, address: u32) -> Option<u32> {
        let offset = address.checked_sub(self.base)? as usize;
        let pair = self.bytes.get(offset..offset + 2)?;
        Some(u32::from(u16::from_le_bytes([pair[0], pair[1]])))
    }

    /// Branches of a function, and the number of its calls by a pointer.
    fn branches(&self, begin: u32, end: u32) -> (Vec<Branch>, usize) {
        let (mut branches, mut by_pointer, mut address) = (Vec::new(), 0, begin);
        let mut add = |address: u32, way: Option<i32>| {
            let branch = |way: i32| Branch {
                at: address,
                to: address.wrapping_add_signed(4 + way),
                argument: self.argument(address),
            };
            branches.extend(way.map(branch));
        };
        while address < end {
            let after = self.data.partition_point(|(first, _)| *first <= address);
            if let Some((_, last)) = after.checked_sub(1).and_then(|range| self.data.get(range))
                && *last > address
            {
                address = *last;
                continue;
            }
            let Some(first) = self.half(address) else { break };
            if first >> 11 >= 0b11101 {
                if let Some(second) = self.half(address + 2) {
                    add(address, wide(first, second));
                }
                address += 4;
            } else {
                add(address, narrow(first));
                // BLX to a register.
                by_pointer += usize::from(first & 0xFF87 == 0x4780);
                address += 2;
            }
        }
        (branches, by_pointer)
    }

    /// Value loaded into the first register by MOVW and MOVT just before an address.
    fn argument(&self, address: u32) -> Option<u32> {
        let half = |before: u32| self.half(address.checked_sub(before)?);
        let low = immediate(half(8)?, half(6)?, 0xF240)?;
        let high = immediate(half(4)?, half(2)?, 0xF2C0)?;
        Some(high << 16 | low)
    }
}

/// Constant of a MOVW (0xF240) or MOVT (0xF2C0) to the first register.
fn immediate(first: u32, second: u32, code: u32) -> Option<u32> {
    let part = first >> 10 & 1;
    let is_one = first & 0xFBF0 == code && second & 0x8F00 == 0;
    is_one.then_some((first & 0xF) << 12 | part << 11 | (second >> 12 & 7) << 8 | second & 0xFF)
}

/// Sign-extends a field of `bits` bits.
fn signed(field: u32, bits: u32) -> i32 {
    (field << (32 - bits)).cast_signed() >> (32 - bits)
}

/// Offset of a 16-bit branch.
fn narrow(code: u32) -> Option<i32> {
    match (code >> 11, code >> 12, code >> 8 & 0xF) {
        (0b11100, ..) => Some(signed((code & 0x7FF) << 1, 12)),
        (_, 0b1101, 0..=13) => Some(signed((code & 0xFF) << 1, 9)),
        _ => None,
    }
}

/// Offset of a 32-bit branch.
fn wide(first: u32, second: u32) -> Option<i32> {
    if first >> 11 != 0b11110 || second >> 15 == 0 {
        return None;
    }
    let (sign, j1, j2, low) = (first >> 10 & 1, second >> 13 & 1, second >> 11 & 1, (second & 0x7FF) << 1);
    if second >> 12 & 1 == 1 {
        // The core has no BLX with an offset: bits 14 and 12 set are BL, 12 alone is B.
        let (i1, i2) = (!(j1 ^ sign) & 1, !(j2 ^ sign) & 1);
        return Some(signed(sign << 24 | i1 << 23 | i2 << 22 | (first & 0x3FF) << 12 | low, 25));
    }
    let condition = first >> 6 & 0xF;
    (second >> 14 & 1 == 0 && condition < 14)
        .then(|| signed(sign << 20 | j2 << 19 | j1 << 18 | (first & 0x3F) << 12 | low, 21))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From the disassembly of an image by `llvm-objdump`.
    #[test]
    fn branch_targets_equal_those_of_the_disassembler() {
        // 800022c: f000 f80b   bl 0x8000246
        assert_eq!(wide(0xF000, 0xF80B), Some(0x8000246 - 0x800022C - 4));
        // 8000254: f7ff fff7   bl 0x8000246
        assert_eq!(wide(0xF7FF, 0xFFF7), Some(0x8000246 - 0x8000254 - 4));
        // 8000194: d001        beq 0x800019a
        assert_eq!(narrow(0xD001), Some(0x800019A - 0x8000194 - 4));
        // 8000198: e7fb        b 0x8000192
        assert_eq!(narrow(0xE7FB), Some(0x8000192 - 0x8000198 - 4));
        // UDF and SVC are not branches, nor are MOVW and a load.
        assert_eq!(
            (narrow(0xDE00), narrow(0xDF00), wide(0xF240, 0x0300), wide(0xF8D0, 0x8000)),
            (None, None, None, None)
        );
    }

    #[test]
    fn a_loaded_location_equals_that_of_the_disassembler() {
        // 80042c2: f24c 4028   movw r0, #50216
        // 80042c6: f6c0 0003   movt r0, #2051
        let halves: [u16; 6] = [0xF24C, 0x4028, 0xF6C0, 0x0003, 0xF7FC, 0xF839];
        let bytes = halves.map(u16::to_le_bytes);
        let code = Code { base: 100, bytes: bytes.as_flattened(), data: Vec::new() };
        assert_eq!(code.argument(108), Some(50_216 | 2051 << 16));
        assert_eq!((code.argument(104), code.argument(100)), (None, None));
        // MOVW to another register: movw r1, #50216.
        assert_eq!(immediate(0xF24C, 0x4128, 0xF240), None);
    }

    const IN_A_QUEUE: u32 = 1;
    const ELSEWHERE: u32 = 2;

    fn function(name: &str, begin: u32, branches: &[(u32, u32)]) -> (u32, Function) {
        let branches =
            branches.iter().map(|(to, location)| Branch { at: begin, to: *to, argument: Some(*location) });
        let branches = branches.collect();
        (begin, Function { name: name.into(), end: begin + 10, branches, by_pointer: 0 })
    }

    #[test]
    fn an_interrupt_may_reach_no_panic_but_those_of_queues() {
        let functions = |location: u32| {
            BTreeMap::from([
                function("ADC", 100, &[(200, 0)]),
                function("loops", 200, &[(105, 0), (400, location)]),
                function("thread", 300, &[(400, ELSEWHERE)]),
                function("core::cell::panic_already_borrowed", 400, &[(600, 0)]),
                function("core::panicking::panic_fmt", 600, &[]),
            ])
        };
        let source = |location: u32| match location {
            IN_A_QUEUE => Some(("heapless-0.9.3/src/spsc.rs".to_owned(), 7)),
            ELSEWHERE => Some(("src/motor/axis.rs".to_owned(), 7)),
            _ => None,
        };
        let accepted = Panics::within(&functions(IN_A_QUEUE), source);
        assert_eq!((accepted.all.len(), accepted.interrupts.len(), accepted.reached), (2, 1, 2));
        assert!(accepted.missed().is_empty());
        let missed = |location| Panics::within(&functions(location), source).missed();
        let panic = "an interrupt can panic: core::cell::panic_already_borrowed in loops";
        assert_eq!(missed(ELSEWHERE), [format!("{panic} (src/motor/axis.rs)")]);
        assert_eq!(missed(3), [format!("{panic} ()")]);
    }
}
