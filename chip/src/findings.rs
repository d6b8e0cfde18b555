//! Findings: accesses that silicon refuses or leaves undefined.
//!
//! A peripheral reports the violated rule; the program counter of the basic block is added here. Equal
//! findings at one location are counted. Known harmless findings are listed in [`KNOWN`] with their reason,
//! and reported separately.

use std::collections::BTreeMap;

use serde::Serialize;

/// One kind of harmless finding.
#[derive(Clone, Copy, Debug)]
pub struct Known {
    pub what: &'static str,
    pub register: &'static str,
    /// Part of the function's name.
    pub function: &'static str,
    pub reason: &'static str,
}

/// Findings that are known and harmless.
pub const KNOWN: [Known; 3] = [
    Known {
        what: "register does not exist on an STM32F405",
        register: "RCC+0x8c",
        function: "",
        reason: "embassy_stm32::init writes RCC_DCKCFGR of larger parts of the family; an F405 ignores the write",
    },
    Known {
        what: "reserved bit set",
        register: "PWR_CR",
        function: "",
        reason: "embassy_stm32::init writes a voltage scale of two bits; an F405 has the lower one, which is right",
    },
    Known {
        what: "not modelled",
        register: "0xe000ef50",
        function: "embassy_boot_stm32::BootLoader",
        reason: "embassy_boot_stm32 invalidates the instruction cache of larger processors; a Cortex-M4 has none (ICIALLU)",
    },
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
    #[must_use]
    pub fn known(&self) -> Option<&'static str> {
        let same = |known: &&Known| {
            known.what == self.what
                && known.register == self.register
                && self.function.contains(known.function)
        };
        KNOWN.iter().find(same).map(|known| known.reason)
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
    #[must_use]
    pub fn has(&self, what: &str) -> bool {
        self.found.keys().any(|(_, found, _)| *found == what)
    }

    /// Number of distinct findings.
    #[must_use]
    pub fn len(&self) -> usize {
        self.found.len()
    }

    #[must_use]
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

    /// Reports reserved bits that a write sets, and returns the value without them.
    pub fn implemented(&mut self, value: u32, mask: u32, register: &str) -> u32 {
        if value & !mask != 0 {
            self.refuse("reserved bit set", register);
        }
        value & mask
    }
}

pub const NO_REGISTER: &str = "register does not exist on an STM32F405";
pub const NOT_MODELLED: &str = "not modelled";
