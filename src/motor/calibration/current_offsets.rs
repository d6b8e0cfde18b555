//! Current-sensor offsets: shunt codes with the bridge off, so without current.
//!
//! Mean of 4,096 samples after 256 to settle (0.18 s). Reasons to refuse: an offset more than 150 codes (6 A)
//! from the middle, a spread of more than 80 codes, a rotor that turns. Noise of one code leaves 0.016 codes:
//! 0.6 mA.

use super::{Phase, Refusal};
use crate::hal::AxisSample;
use crate::motor::configuration::ZERO_SPREAD_CODES;

const SETTLE_TICKS: u32 = 256;
const MEAN_TICKS: u32 = 4096;
const MIDDLE: u32 = 2048;
const GREATEST_SPREAD: u16 = 80;
/// Encoder counts that vibration may cause.
const GREATEST_TRAVEL: u16 = 3;

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct CurrentOffsets {
    ticks: u32,
    sums: [u32; 2],
    least: [u16; 2],
    most: [u16; 2],
    counter: u16,
}

impl CurrentOffsets {
    pub(super) fn tick(&mut self, sample: &AxisSample) -> Result<Option<[f32; 2]>, Refusal> {
        self.ticks += 1;
        if self.ticks <= SETTLE_TICKS {
            (self.least, self.most) = (sample.shunt_codes, sample.shunt_codes);
            self.counter = sample.encoder_count;
            return Ok(None);
        }
        let travel = sample.encoder_count.wrapping_sub(self.counter).cast_signed();
        if travel.unsigned_abs() > GREATEST_TRAVEL {
            return Err(Refusal::Turning);
        }
        for (shunt, &code) in sample.shunt_codes.iter().enumerate() {
            self.sums[shunt] += u32::from(code);
            self.least[shunt] = self.least[shunt].min(code);
            self.most[shunt] = self.most[shunt].max(code);
        }
        if self.ticks < SETTLE_TICKS + MEAN_TICKS {
            return Ok(None);
        }
        for (shunt, phase) in [Phase::B, Phase::C].into_iter().enumerate() {
            let off = (self.sums[shunt] / MEAN_TICKS).abs_diff(MIDDLE);
            if off > u32::from(ZERO_SPREAD_CODES) || self.most[shunt] - self.least[shunt] > GREATEST_SPREAD {
                return Err(Refusal::ShuntOffset(phase));
            }
        }
        Ok(Some(self.sums.map(|sum| sum as f32 / MEAN_TICKS as f32)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offsets_are_the_mean_of_exactly_4096_samples() {
        let mut current_offsets = CurrentOffsets::default();
        for tick in 1..SETTLE_TICKS + MEAN_TICKS {
            // Samples before the last of those to settle are in no mean and in no spread.
            let code = if tick < SETTLE_TICKS { 3000 } else { 2050 };
            let sample = AxisSample { shunt_codes: [code, 2040], ..AxisSample::default() };
            assert_eq!(current_offsets.tick(&sample), Ok(None), "{tick}");
        }
        let sample = AxisSample { shunt_codes: [2050, 2040], ..AxisSample::default() };
        assert_eq!(current_offsets.tick(&sample), Ok(Some([2050.0, 2040.0])));
    }

    #[test]
    fn a_rotor_that_moves_by_more_than_three_counts_is_refused() {
        for (travel, refused) in [(3_u16, false), (4, true), (5, true), (0_u16.wrapping_sub(4), true)] {
            let mut current_offsets = CurrentOffsets::default();
            let at =
                |encoder_count| AxisSample { shunt_codes: [2048; 2], encoder_count, ..AxisSample::default() };
            (0..SETTLE_TICKS).for_each(|_| assert_eq!(current_offsets.tick(&at(7)), Ok(None)));
            let expected = if refused { Err(Refusal::Turning) } else { Ok(None) };
            assert_eq!(current_offsets.tick(&at(travel.wrapping_add(7))), expected, "{travel}");
        }
    }
}
