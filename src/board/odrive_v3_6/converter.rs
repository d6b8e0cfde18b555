//! Results of the converters, read in the interrupt at the end of conversion.

use super::registers::{apply, load, store};
use super::settings::converters::{
    BASES, CR2, DR, ENDS, EOC, JDR1, JEOC, MOTORS, SQR3, SR, START, cleared, finished_axes, is_idle,
};
use super::settings::pins::MOTOR_THERMISTORS;
use super::settings::timers;

const ADC1: u32 = BASES[0];
const ADC2: u32 = BASES[1];
const ADC3: u32 = BASES[2];
const TIM1: u32 = timers::BASES[0];
/// Looks at the timer, of ten cycles or more each: a PWM period and more.
const MOST_READS: u32 = 800;

/// Axes with conversions finished since the last call; `Some(true)` where both shunts are. Clears the flags
/// it returns.
#[inline(always)]
pub fn finished() -> [Option<bool>; 2] {
    let seen = ends();
    // Both converters end in the same cycle. If it lies between the two loads, a second look shows both.
    let seen = if seen[0] == seen[1] { [seen[0]; 2] } else { ends_again() };
    let any = seen[0] | seen[1];
    store(ADC2 + SR, cleared(any));
    store(ADC3 + SR, cleared(any));
    finished_axes(seen)
}

/// Ends of ADC2 and of ADC3.
#[inline(always)]
fn ends() -> [u32; 2] {
    [load(ADC2 + SR) & ENDS, load(ADC3 + SR) & ENDS]
}

/// Reads the ends again. They still differ only if a converter is silent.
#[cold]
#[inline(never)]
fn ends_again() -> [u32; 2] {
    ends()
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

/// Makes the pins of these motors' thermistors analog inputs.
pub fn prepare_thermistors(fitted: [bool; 2]) {
    for (pin, _) in MOTOR_THERMISTORS.iter().zip(fitted).filter(|(_, fitted)| *fitted) {
        apply(&pin.writes());
    }
}

/// Starts a conversion of the thermistor in a motor. Injected conversions interrupt it; then it starts again.
///
/// Another channel during the scan of the bus voltage would restart that scan (RM0090 13.3.5), so this waits
/// for the half period without one, 22 us at most. Without running timers it starts nothing.
pub fn convert_thermistor(axis: usize) {
    let Some(channel) = MOTORS.get(axis) else { return };
    for _ in 0..MOST_READS {
        let started = cortex_m::interrupt::free(|_| {
            let idle = is_idle(load(TIM1 + timers::CR1), load(TIM1 + timers::CNT));
            if idle {
                store(ADC1 + SQR3, *channel);
                store(ADC1 + SR, cleared(EOC));
                store(ADC1 + CR2, START);
            }
            idle
        });
        if started {
            return;
        }
    }
}

/// Code of the last conversion of a motor's thermistor; `None` if it has not ended.
pub fn thermistor_code() -> Option<u16> {
    (load(ADC1 + SR) & EOC != 0).then(|| load(ADC1 + DR) as u16)
}
