//! Tests of the motion itself: usable data, and enough excitation.

use super::{Reason, Test, Thresholds, VerdictBuilder};
use crate::ident::record::motion_record::Record;
use crate::ident::record::row_model::RowModel;
use crate::ident::solve::estimate::Stage;
use crate::real::Real;

impl<T: Real> Thresholds<T> {
    /// Judges the data: enough rows, finite samples, nonzero torque, joints that move by many counts.
    pub fn judge_input<const N: usize, const B: usize>(
        &self,
        model: &RowModel<T, N, B>,
        record: &Record<T, N, B>,
        builder: &mut VerdictBuilder<'_, T>,
    ) {
        let needed = (model.base.rank() as u32).saturating_mul(self.rows_per_parameter);
        let count = |rows: u32| T::from_double(f64::from(rows));
        // Without samples no joint has a speed.
        let seen = record.rows.iter().any(|&rows| rows > 0)
            || record.torque.iter().any(|size| size.speed > T::zero());
        for (joint, (size, &rows)) in record.torque.iter().zip(&record.rows).enumerate() {
            let at = Some(joint);
            // Rows missing because the joint stood still are a fault of the motion, not of the data.
            let still = seen && !(size.speed >= self.smallest_speed);
            let reason = if still { Reason::Unexcited } else { Reason::Input };
            builder.at_least(reason, Test::Rows, at, count(rows), count(needed));
            if rows > 0 {
                builder.at_least(
                    Reason::Input,
                    Test::Torque,
                    at,
                    size.root_mean_square,
                    T::from_double(1e-9),
                );
            }
            if seen {
                builder.at_least(Reason::Unexcited, Test::Speed, at, size.speed, self.smallest_speed);
            }
            if seen && !still {
                let limit = self.largest_pulse_share * size.speed;
                builder.at_most(Reason::Input, Test::EncoderPulse, at, None, model.pulse[joint], limit);
            }
        }
        builder.at_most(Reason::Input, Test::NotFinite, None, None, count(record.rejected), T::zero());
    }

    /// Judges whether the motion determines all base parameters that are not held at zero. This applies to
    /// all rows together (`stage`) and to the plan used, which found `determined` of them.
    pub fn judge_excitation<const B: usize>(
        &self,
        stage: &Stage<T, B>,
        determined: usize,
        builder: &mut VerdictBuilder<'_, T>,
    ) {
        let rank = T::from_double(stage.requested() as f64);
        let determined = T::from_double(stage.columns().len().min(determined) as f64);
        builder.at_least(Reason::Unexcited, Test::Determined, None, determined, rank);
        let condition = stage.condition().unwrap_or(T::LARGEST);
        builder.at_most(Reason::Unexcited, Test::Condition, None, None, condition, self.largest_condition);
    }
}
