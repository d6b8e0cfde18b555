//! Findings: accesses that silicon refuses or leaves undefined.
//!
//! A peripheral reports the violated rule; the program counter of the basic block is added here. Equal
//! findings at one location are counted. Known harmless findings are listed in [`KNOWN`] with their reason,
//! and reported separately.

use std::collections::BTreeMap;

use serde::Serialize;

/// Harmless findings: violated rule, register, part of the function's name, and the reason.
const KNOWN: [(&str, &str, &str, &str); 3] = [
    (
        NO_REGISTER,
        "RCC+0x8c",
        "",
        "embassy_stm32::init writes RCC_DCKCFGR of larger parts of the family; an F405 ignores the write",
    ),
    (
        RESERVED,
        "PWR_CR",
        "",
        "embassy_stm32::init writes a voltage scale of two bits; an F405 has the lower one, which is right",
    ),
    (
        NOT_MODELLED,
        "0xe000ef50",
        "embassy_boot_stm32::BootLoader",
        "embassy_boot_stm32 invalidates the instruction cache of larger processors; a Cortex-M4 has none (ICIALLU)",
    ),
];

/// Finding with its location in the image.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// Violated rule.
    pub what: &'static str,
    /// Register, or part of the chip.
    pub register: String,
    /// Start of the basic block.
    pub pc: u32,
    pub function: String,
    pub count: u64,
}

impl Finding {
    /// Reason why a finding is harmless, if known.
    pub fn known(&self) -> Option<&'static str> {
        let is_same = |(what, register, function, _): &(&str, &str, &str, &str)| {
            (*what, *register) == (self.what, self.register.as_str()) && self.function.contains(function)
        };
        KNOWN.into_iter().find(is_same).map(|(.., reason)| reason)
    }
}

/// Findings of a run.
#[derive(Clone, Debug, Default)]
pub struct Findings {
    /// Start of the basic block that the processor executes.
    pub pc: u32,
    found: BTreeMap<(u32, &'static str, String), u64>,
}

impl Findings {
    /// Adds a finding at the present location.
    pub fn add(&mut self, what: &'static str, register: impl Into<String>) {
        *self.found.entry((self.pc, what, register.into())).or_default() += 1;
    }

    /// All findings, with names of functions by program counter.
    pub fn list(&self, name: impl Fn(u32) -> String) -> Vec<Finding> {
        let entry = |((pc, what, register), count): (&(u32, &'static str, String), &u64)| Finding {
            what,
            register: register.clone(),
            pc: *pc,
            function: name(*pc),
            count: *count,
        };
        self.found.iter().map(entry).collect()
    }

    /// Whether a rule was violated so far.
    pub fn has(&self, what: &str) -> bool {
        self.found.keys().any(|(_, found, _)| *found == what)
    }

    /// Number of distinct findings.
    pub fn len(&self) -> usize {
        self.found.len()
    }

    pub fn is_empty(&self) -> bool {
        self.found.is_empty()
    }
}

/// Access to a register: its time, and the list of findings.
#[derive(Debug)]
pub struct Access<'a> {
    pub now: crate::time::Ticks,
    pub findings: &'a mut Findings,
}

impl Access<'_> {
    /// Reports a violated rule.
    pub fn refuse(&mut self, what: &'static str, register: impl Into<String>) {
        self.findings.add(what, register);
    }

    /// Reports a read of a register that the chip lacks; the value is 0.
    pub fn no_register(&mut self, register: impl Into<String>) -> u32 {
        self.refuse(NO_REGISTER, register);
        0
    }

    /// Reports reserved bits that a write sets, and returns the value without them.
    pub fn implemented(&mut self, value: u32, mask: u32, register: &str) -> u32 {
        if value & !mask != 0 {
            self.refuse(RESERVED, register);
        }
        value & mask
    }
}

pub const NO_REGISTER: &str = "register does not exist on an STM32F405";
pub const NOT_MODELLED: &str = "not modelled";
const RESERVED: &str = "reserved bit set";
