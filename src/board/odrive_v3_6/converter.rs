//! Results of the converters, read in the interrupt at the end of conversion.

use super::registers::{load, store};
use super::settings::converters::{BASES, DR, EOC, JDR1, JEOC, SR, cleared};

const ADC1: u32 = BASES[0];
const ADC2: u32 = BASES[1];
const ADC3: u32 = BASES[2];

/// Axes with conversions finished since the last call; `Some(true)` where both shunts are. Clears the flags
/// it returns.
#[inline(always)]
pub fn finished() -> [Option<bool>; 2] {
    // ADC3, whose interrupt is awaited, is read first: a conversion that ends between both loads is then seen
    // whole at the next call.
    let status = load(ADC3 + SR);
    let other = load(ADC2 + SR);
    let seen = status & (JEOC | EOC);
    store(ADC3 + SR, cleared(seen));
    store(ADC2 + SR, cleared(seen));
    [JEOC, EOC].map(|flag| (status & flag != 0).then_some(other & flag != 0))
}

/// Whether bus voltage and thermistors were converted since the last call. Their scan ends after the shunts'
/// of axis 0, so in that axis' interrupt this is the preceding scan.
#[inline(always)]
pub fn supply_finished() -> bool {
    let seen = load(ADC1 + SR) & JEOC;
    store(ADC1 + SR, cleared(seen));
    seen != 0
}

/// Shunt codes of B and C of an axis.
#[inline(always)]
pub fn shunts(axis: usize) -> [u16; 2] {
    let result = if axis == 0 { JDR1 } else { DR };
    [load(ADC2 + result) as u16, load(ADC3 + result) as u16]
}

/// Code of the bus voltage.
#[inline(always)]
pub fn bus() -> u16 {
    load(ADC1 + JDR1) as u16
}

/// Codes of the thermistors of bridge 0, bridge 1 and chopper.
pub fn thermistors() -> [u16; 3] {
    [JDR1 + 4, JDR1 + 8, JDR1 + 12].map(|result| load(ADC1 + result) as u16)
}
