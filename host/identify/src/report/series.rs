//! Curves of a run over time, for figures: anatomical angles and torques.
//!
//! Every motion passes the filter chain of the identification once more, complete windows only, and its rows
//! are multiplied by the result. The figures thus show the data of least squares.

use scarab::ident::{
    DECIMATION, Ends, KernelError, LARGEST_STILL_SHARE, LowPass, Recorder, RowModel, SAMPLE_RATE_HZ, Solver,
    noise,
};
use scarab::model::AnatomicalJoint;
use scarab::real::dot;

/// Longest lag of the autocorrelation, s.
const LONGEST_LAG_S: f64 = 0.6;

/// Curves of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// Motions, those identified from first.
    pub motions: Vec<MotionSeries>,
    /// Cost of the swarm's best above the optimum in its box, chi-square units, after each iteration.
    pub excess: Vec<(u32, f64)>,
    /// J_C - J_LS: optimum in the box above least squares, chi-square units.
    pub floor_chi2: Option<f64>,
    /// Noise of each joint's filtered torque as the identification estimates it: standard deviation, N m.
    pub noise_nm: Vec<f64>,
    /// Autocorrelation of filtered white torque noise, by lag in rows.
    pub white_correlation: Vec<f64>,
}

/// Use of a motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Used for the estimate.
    Training,
    /// Predicted only.
    Validation,
}

impl Role {
    /// Name in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Training => "identified from",
            Self::Validation => "unused, predicted",
        }
    }
}

/// One motion, a point for each filtered row.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionSeries {
    /// Name in the tables.
    pub name: String,
    /// Use of the motion.
    pub role: Role,
    /// Time since the start of the motion, or on the recording's clock, s.
    pub time_s: Vec<f64>,
    /// Joints, proximal first.
    pub joints: Vec<JointCurves>,
}

/// Curves of one joint on one motion: as long as the times, or empty if unknown.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JointCurves {
    /// Logged angle, degrees.
    pub measured_deg: Vec<f64>,
    /// Commanded angle, degrees.
    pub commanded_deg: Vec<f64>,
    /// Torque from the noisy current, filtered, N m.
    pub measured_nm: Vec<f64>,
    /// Torque predicted by the result, filtered, N m.
    pub predicted_nm: Vec<f64>,
    /// Torque of the plant's motor, filtered, N m.
    pub noise_free_nm: Vec<f64>,
    /// Whether the joint is at rest; such rows are excluded.
    pub still: Vec<bool>,
}

impl JointCurves {
    /// Measured minus predicted torque; `None` while the joint is at rest.
    pub fn residual_nm(&self) -> impl Iterator<Item = Option<f64>> + '_ {
        let errors = self.measured_nm.iter().zip(&self.predicted_nm).map(|(measured, own)| measured - own);
        errors.zip(&self.still).map(|(error, still)| (!still).then_some(error))
    }
}

/// Passes motions through the filter chain and multiplies their rows by a result.
pub struct Reader<'a, const N: usize, const B: usize, const TAPS: usize, const PENDING: usize> {
    recorder: Box<Recorder<f32, N, B, TAPS, PENDING>>,
    model: &'a RowModel<f32, N, B>,
    anatomy: [AnatomicalJoint<f64>; N],
    values: [f32; B],
    /// Samples between the newest one and the centre of the rows it finishes.
    lag: usize,
    white_correlation: Vec<f64>,
}

impl<'a, const N: usize, const B: usize, const TAPS: usize, const PENDING: usize>
    Reader<'a, N, B, TAPS, PENDING>
{
    /// Creates a reader with the filter chain of a bandwidth.
    pub fn new(
        model: &'a RowModel<f32, N, B>,
        anatomy: [AnatomicalJoint<f64>; N],
        values: [f32; B],
        bandwidth_hz: f32,
    ) -> Result<Self, KernelError> {
        let recorder = Box::new(Recorder::new(bandwidth_hz)?);
        let low_pass = LowPass::<f32, TAPS>::new(bandwidth_hz, SAMPLE_RATE_HZ as f32)?;
        let lag = recorder.delay() + low_pass.reach();
        Ok(Self {
            recorder,
            model,
            anatomy,
            values,
            lag,
            white_correlation: white_correlation(low_pass.weights()),
        })
    }

    /// Curves of one motion: `samples` are model angles, rad, and torques, N m, at 500 Hz from
    /// `start_s` on.
    pub fn motion(
        &mut self,
        name: impl Into<String>,
        role: Role,
        start_s: f64,
        samples: impl Iterator<Item = ([f32; N], [f32; N])>,
    ) -> MotionSeries {
        self.recorder.clear(Ends::Whole);
        let mut positions = Vec::new();
        let mut motion = MotionSeries {
            name: name.into(),
            role,
            time_s: Vec::new(),
            joints: vec![JointCurves::default(); N],
        };
        for (index, (position, torque)) in samples.enumerate() {
            positions.push(position);
            let rows = self.recorder.push(self.model, &position, &torque).and_then(|progress| progress.rows);
            let centre = index.checked_sub(self.lag);
            let (Some(rows), Some(centre)) = (rows, centre) else { continue };
            motion.time_s.push(start_s + centre as f64 / SAMPLE_RATE_HZ);
            for (joint, curves) in motion.joints.iter_mut().enumerate() {
                let predicted = dot(&rows.regressor[joint], &self.values);
                let anatomy = &self.anatomy[joint];
                let angle = anatomy.angle_from_chain(f64::from(positions[centre][joint]));
                curves.measured_deg.push(angle.to_degrees());
                curves.measured_nm.push(anatomy.from_chain(f64::from(rows.torque[joint])));
                curves.predicted_nm.push(anatomy.from_chain(f64::from(predicted)));
                curves.still.push(f64::from(rows.still[joint]) > LARGEST_STILL_SHARE);
            }
        }
        motion
    }

    /// The curves of a run.
    pub fn series(self, solver: &Solver<f32, N, B>, motions: Vec<MotionSeries>) -> Series {
        let record = solver.record();
        let overlap = f64::from(record.row_information).sqrt();
        let noise_nm = noise(record).iter().map(|independent| f64::from(*independent) * overlap).collect();
        Series { noise_nm, ..self.of_motions(motions) }
    }

    /// Curves of a run without a solver.
    pub fn of_motions(self, motions: Vec<MotionSeries>) -> Series {
        Series { motions, white_correlation: self.white_correlation, ..Series::default() }
    }
}

/// Sum of h_k h_(k + lag), normalised to lag 0, at the rate of the rows.
fn white_correlation(weights: &[f32]) -> Vec<f64> {
    let sum = |lag: usize| -> f64 {
        let later = weights.iter().skip(lag);
        weights.iter().zip(later).map(|(early, late)| f64::from(*early) * f64::from(*late)).sum()
    };
    let lags = (LONGEST_LAG_S * SAMPLE_RATE_HZ) as usize / DECIMATION;
    (0..=lags).map(|lag| sum(lag * DECIMATION) / sum(0)).collect()
}

/// Autocorrelation of a joint's residuals over its motions, by lag in rows; pairs with a joint at
/// rest are excluded.
pub fn autocorrelation(residuals: &[Vec<Option<f64>>], lags: usize) -> Vec<f64> {
    let mean_product = |lag: usize| -> f64 {
        let pairs = residuals.iter().flat_map(|motion| motion.iter().zip(motion.iter().skip(lag)));
        let (sum, count) = pairs
            .filter_map(|(early, late)| Some((*early)? * (*late)?))
            .fold((0.0, 0_u32), |(sum, count), product| (sum + product, count + 1));
        sum / f64::from(count.max(1))
    };
    let variance = mean_product(0);
    if !(variance > 0.0) {
        return Vec::new();
    }
    (0..lags).map(|lag| mean_product(lag) / variance).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_at_rest_only_exclude_pairs_from_the_autocorrelation() {
        // Alternating signs: -1 at odd lags, 1 at even ones, whatever is excluded.
        let mut alternating: Vec<Option<f64>> =
            (0..40).map(|index| Some(if index % 2 == 0 { 2.0 } else { -2.0 })).collect();
        alternating[7] = None;
        let found = autocorrelation(&[alternating, vec![None; 3]], 4);
        assert_eq!(found, [1.0, -1.0, 1.0, -1.0]);
        assert!(autocorrelation(&[vec![Some(0.0); 9]], 3).is_empty(), "no residual has no correlation");
    }

    #[test]
    fn white_noise_is_correlated_over_the_length_of_the_filter() {
        let correlation = white_correlation(&[1.0; 20]);
        assert_eq!(&correlation[..3], [1.0, 0.5, 0.0]);
    }
}
