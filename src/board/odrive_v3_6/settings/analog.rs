//! Conversion of ADC codes to currents, volts and degrees.
//!
//! ```text
//! V_bus = code * 3.3 / 4096 * ratio           ratio 19 on 56 V boards, 11 on 24 V boards (board.h:120-126)
//! T = ((a x + b) x + c) x + d, x = code / 4096    thermistor and divider, 0..120 degrees C (board.cpp:53-54)
//! ```

use crate::motor::SenseScale;
use crate::units::Volt;

/// Address of the factory version in one-time programmable memory: major, minor, voltage (board.cpp:266-290).
pub const VERSION_ADDRESS: u32 = 0x1FFF_7803;
/// Value of memory that was never written.
pub const BLANK: u8 = 0xFF;

/// Coefficients a, b, c, d of the thermistor's polynomial.
pub const THERMISTOR: [f32; 4] = [363.939_1, -462.153_7, 307.551_3, -27.725_695];
/// Bridge temperature above which outputs go off, degrees Celsius; ODrive begins to reduce the current here.
pub const HOTTEST_C: f32 = 100.0;
/// Code range of a thermistor that is neither open nor shorted: some -20 to 150 degrees.
pub const THERMISTOR_CODES: [u16; 2] = [100, 3700];

/// Divider ratio of the bus voltage on a board of this version; `None` for versions of other boards.
pub const fn divider(version: [u8; 3]) -> Option<f32> {
    match version {
        [3, 5 | 6, 56 | 48] => Some(SenseScale::DIVIDER),
        [3, 5 | 6, 24] => Some(11.0),
        _ => None,
    }
}

/// Version of a board without a factory entry that the user states to be one of 24 or 56 V.
pub const fn stated(volts: Option<&str>) -> [u8; 3] {
    match volts {
        Some(text) => match text.as_bytes() {
            b"24" => [3, 6, 24],
            b"56" => [3, 6, 56],
            _ => [BLANK; 3],
        },
        None => [BLANK; 3],
    }
}

/// Scales of amplifiers, converter and divider for the current loop.
pub const fn sense(divider: f32) -> SenseScale {
    SenseScale { volt_per_code: Volt(3.3 / 4096.0 * divider), ..SenseScale::ODRIVE_3_6 }
}

/// Temperature of a thermistor's code, degrees Celsius; `None` where it is open or shorted.
pub fn temperature_c(code: u16) -> Option<f32> {
    let [low, high] = THERMISTOR_CODES;
    let [a, b, c, d] = THERMISTOR;
    let x = f32::from(code) / 4096.0;
    (low..=high).contains(&code).then_some(((a * x + b) * x + c) * x + d)
}
