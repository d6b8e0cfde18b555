//! Number of combinations of the chain's parameters that torque determines, for joint motion
//! together and one by one.
//!
//! The rank is that of the regressor over random motions, in double precision. The paper's method is *joint
//! by joint*: one joint moves at a time while the others rest in some posture. Only the moving joint's torque
//! is measured.

use nalgebra::Vector3;
use rand_core::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use scarab::ident::{Factor, RowModel, Smoothed};
use scarab::model::{BaseParameters, ColumnMask, INERTIAL_PARAMETERS, Parameter};
use scarab_base::error::ToolError;
use scarab_base::names::parameter_name;
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::formats::leg_file::geometry::chain;
use scarab_identify::report::RunReport;
use serde::Serialize;

use super::chain::{JOINTS, ROOM};
use super::printed::TABLE_FIVE;

/// Postures and motions of each joint.
const STATES: u32 = 200;
const SEED: u64 = 20;
/// Columns whose independent part is smaller are not determined.
const DETERMINED: f64 = 1e-9;

/// Number of combinations that torque determines.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Ranks {
    /// Rank of the 20 parameters of Table V.
    pub of_table_v: usize,
    /// Rank of all 30 inertial parameters of three links.
    pub of_all_inertial: usize,
    /// Rank of the inertial parameters if one joint moves at a time and its own torque is measured.
    pub joint_by_joint: usize,
    /// Rank of all estimated parameters, including rotors, friction and offsets.
    pub of_the_leg: usize,
    /// Number of estimated parameters.
    pub columns: usize,
}

impl Ranks {
    /// Ranks of the chain, and of one run on it.
    pub fn new(leg: &LegFile, run: Option<&RunReport>) -> Result<Self, ToolError> {
        let listed = |joint: usize, parameter: Parameter| {
            TABLE_FIVE.iter().any(|line| line.name == parameter_name(joint, parameter))
        };
        let inertial = model(leg, &|_, parameter| parameter.index() < INERTIAL_PARAMETERS)?;
        Ok(Self {
            of_table_v: model(leg, &listed)?.base.rank(),
            of_all_inertial: inertial.base.rank(),
            joint_by_joint: joint_by_joint(&inertial),
            of_the_leg: run.map_or(0, |run| run.rank),
            columns: run.map_or(0, |run| run.columns),
        })
    }
}

fn model(
    leg: &LegFile,
    of: &dyn Fn(usize, Parameter) -> bool,
) -> Result<RowModel<f64, JOINTS, ROOM>, ToolError> {
    let columns: ColumnMask<JOINTS> =
        core::array::from_fn(|joint| Parameter::ALL.map(|parameter| of(joint, parameter)));
    let (chain, gravity) = (chain::<JOINTS>(leg)?, Vector3::from(leg.gravity));
    let base = BaseParameters::analyse(&chain, &gravity, &columns)
        .map_err(|error| ToolError::input(format!("{}: {error:?}", leg.name)))?;
    Ok(RowModel::new(chain, gravity, base))
}

/// Rank of the rows of each joint's own torque while it alone moves.
fn joint_by_joint(model: &RowModel<f64, JOINTS, ROOM>) -> usize {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(SEED);
    let mut within = |bound: f64| (random.next_u64() as f64 / u64::MAX as f64 * 2.0 - 1.0) * bound;
    let mut factor = Factor::<f64, ROOM>::new();
    for state in 0..STATES * JOINTS as u32 {
        let moving = state as usize % JOINTS;
        let position = core::array::from_fn(|_| within(core::f64::consts::PI));
        let mut only = |bound: f64| {
            let mut of = [0.0; JOINTS];
            of[moving] = within(bound);
            of
        };
        let (velocity, acceleration) = (only(3.0), only(10.0));
        let rows = model.rows(&Smoothed { position, velocity, acceleration, torque: [0.0; JOINTS] });
        factor.insert(&rows.regressor[moving], 0.0);
    }
    let is_determined =
        |&base: &usize| factor.triangle()[base][base].abs() > DETERMINED * factor.column_length(base);
    (0..model.base.rank()).filter(is_determined).count()
}
