//! Regressor of a leg of any size: what is compiled for each size ends here.

use std::sync::Arc;

use nalgebra::Vector3;
use scarab::ident::record::recorder::STILL_SPEED;
use scarab::ident::{
    DriveChoice, Ends, FilteredRows, LARGEST_STILL_SHARE, LowPass, RowFilter, RowModel, Smoothed, no_stribeck,
};
use scarab::model::Parameter;

use crate::run::logging_errors::table::Table;
use crate::run::resample::{PENDING, TAPS};

/// Largest number of joints of a leg.
const MOST_JOINTS: usize = 3;

/// Smoothed motion of all joints at one instant; zero beyond the leg's joints.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Instant {
    /// Chain angles, rad.
    pub(crate) position: [f64; MOST_JOINTS],
    /// Speeds, rad/s.
    pub(crate) velocity: [f64; MOST_JOINTS],
    /// Accelerations, rad/s^2.
    pub(crate) acceleration: [f64; MOST_JOINTS],
    /// Measured torques, N m.
    pub(crate) torque: [f64; MOST_JOINTS],
}

impl Instant {
    fn sized<const N: usize>(&self) -> Smoothed<f64, N> {
        let array = |values: &[f64]| core::array::from_fn(|joint| values[joint]);
        Smoothed {
            position: array(&self.position),
            velocity: array(&self.velocity),
            acceleration: array(&self.acceleration),
            torque: array(&self.torque),
        }
    }
}

/// Low-passed rows of one motion, at 50 Hz. The row of a joint has the index `row * joints + joint`.
#[derive(Clone, Debug)]
pub(crate) struct Filtered {
    /// Regressor.
    pub(crate) regressor: Table,
    /// Torque, N m.
    pub(crate) torque: Vec<f64>,
    /// Whether the joint moves and every element is finite.
    pub(crate) is_usable: Vec<bool>,
}

/// Regressor of a leg in double precision.
pub(crate) trait Regressor: Send + Sync {
    /// Number of joints.
    fn joints(&self) -> usize;
    /// Number of base parameters: width of the rows.
    fn rank(&self) -> usize;
    /// Joint and kind of the parameter that carries a base parameter.
    fn carrier(&self, base: usize) -> Option<(usize, Parameter)>;
    /// One over the variance by which each base parameter is known to be zero; zero where unknown.
    fn known(&self) -> Vec<f64>;
    /// Rows of all joints at one instant.
    fn rows(&self, instant: &Instant) -> Table;
    /// Low-passed rows of a motion, whose instants are changed before.
    fn filtered(
        &self,
        low_pass: &LowPass<f64, TAPS>,
        instants: &[Instant],
        change: &dyn Fn(&mut Instant),
    ) -> Filtered;
    /// Regressor with gravity mapped to another vector, m/s^2 in the base frame.
    fn with_gravity(&self, map: &dyn Fn(Vector3<f64>) -> Vector3<f64>) -> Arc<dyn Regressor>;
    /// Regressor with the link before a joint longer by this factor; `None` where it has no length.
    fn with_length(&self, joint: usize, factor: f64) -> Option<Arc<dyn Regressor>>;
    /// Regressor for rows of this share of its bandwidth.
    fn with_bandwidth(&self, share: f64) -> Arc<dyn Regressor>;
    /// Regressor without Stribeck friction and without knowledge of offsets; `None` if it has none.
    fn without_knowledge(&self) -> Option<Arc<dyn Regressor>>;
}

impl<const N: usize, const B: usize> Regressor for RowModel<f64, N, B> {
    fn joints(&self) -> usize {
        N
    }

    fn rank(&self) -> usize {
        self.base.rank()
    }

    fn carrier(&self, base: usize) -> Option<(usize, Parameter)> {
        self.base.independent(base)
    }

    fn known(&self) -> Vec<f64> {
        let mut known = vec![0.0; self.rank()];
        for (base, within) in self.known_to_be_zero() {
            known[base] = 1.0 / (within * within);
        }
        known
    }

    fn rows(&self, instant: &Instant) -> Table {
        Table::of_rows(self.rank(), self.rows(&instant.sized()).regressor)
    }

    fn filtered(
        &self,
        low_pass: &LowPass<f64, TAPS>,
        instants: &[Instant],
        change: &dyn Fn(&mut Instant),
    ) -> Filtered {
        let mut filter = Box::new(RowFilter::<f64, N, B, PENDING>::new(Ends::Whole));
        let mut rows =
            Filtered { regressor: Table::new(self.rank()), torque: Vec::new(), is_usable: Vec::new() };
        for instant in instants {
            let mut changed = *instant;
            change(&mut changed);
            let filtered: Option<FilteredRows<f64, N, B>> =
                filter.push(low_pass, &RowModel::rows(self, &changed.sized()));
            let Some(filtered) = filtered else { continue };
            let is_finite = filtered.is_finite();
            filtered.regressor.iter().for_each(|row| rows.regressor.push(row));
            rows.torque.extend(filtered.torque);
            rows.is_usable.extend(filtered.still.map(|still| is_finite && still <= LARGEST_STILL_SHARE));
        }
        rows
    }

    fn with_gravity(&self, map: &dyn Fn(Vector3<f64>) -> Vector3<f64>) -> Arc<dyn Regressor> {
        Arc::new(Self { gravity: map(self.gravity), ..self.clone() })
    }

    fn with_length(&self, joint: usize, factor: f64) -> Option<Arc<dyn Regressor>> {
        let chain = self.chain.with_length(joint, factor);
        self.chain.has_length(joint).then(|| Arc::new(Self { chain, ..self.clone() }) as Arc<dyn Regressor>)
    }

    fn with_bandwidth(&self, share: f64) -> Arc<dyn Regressor> {
        let still_speed = self.still_speed.map(|speed| (share * speed).max(STILL_SPEED));
        Arc::new(Self { still_speed, pulse: self.pulse.map(|pulse| share * pulse), ..self.clone() })
    }

    fn without_knowledge(&self) -> Option<Arc<dyn Regressor>> {
        let has_stribeck = self.stribeck.iter().any(|curve| curve.excess != 0.0);
        let has_known = self.known_to_be_zero().next().is_some();
        let drive_choice = self.drive_choice.map(|choice| DriveChoice { within_nm: None, ..choice });
        let without = || Self { stribeck: no_stribeck(), drive_choice, ..self.clone() };
        (has_stribeck || has_known).then(|| Arc::new(without()) as Arc<dyn Regressor>)
    }
}
