//! Reads states of motion from a CSV file, for `predict` and `regressor`, in the model's angles.
//!
//! Why in one place: `replay` reads anatomical angles from columns of the same names. All user data are
//! therefore anatomical unless `--dh` is given.
//!
//! ```text
//! D-H angle = direction * anatomical angle + zero offset     speed, acceleration, torque: direction only
//! ```
//!
//! Columns are found by name, others are ignored: `q1..` (or `q1_rad`) rad, `qd1..` (`qd1_radps`)
//! rad/s, `qdd1..` (`qdd1_radps2`) rad/s2; `t_s` is optional.

use std::path::{Path, PathBuf};

use csv::StringRecord;
use scarab::model::{AnatomicalJoint, JointState};
use scarab_base::error::FileError;

use crate::formats::leg_file::LegFile;
use crate::formats::leg_file::geometry::anatomy;
use crate::formats::recording::columns::{Column, LineNumbers, for_each_row, refuse};
use crate::formats::recording::{Fault, source};

/// Convention of the angles in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Angles {
    /// Convention of recordings: flexion positive, zero as in the leg file.
    Anatomical,
    /// D-H frames of the leg file.
    DenavitHartenberg,
}

impl Angles {
    /// Conversion from these angles to the D-H angles of every joint.
    ///
    /// # Errors
    /// Direction or zero offset of a joint is invalid.
    pub fn to_chain<const N: usize>(self, leg: &LegFile) -> Result<[AnatomicalJoint<f64>; N], FileError> {
        match self {
            Self::Anatomical => anatomy(leg),
            Self::DenavitHartenberg => Ok([AnatomicalJoint::identity(); N]),
        }
    }
}

/// All states of a file.
pub(crate) struct States<const N: usize> {
    file: PathBuf,
    /// States in the order of the file.
    pub(crate) rows: Vec<State<N>>,
    /// Line of each state.
    lines: LineNumbers,
}

/// One row of the file.
pub(crate) struct State<const N: usize> {
    /// Time as written in the file.
    pub(crate) time: Option<String>,
    /// State in D-H angles.
    pub(crate) motion: JointState<f64, N>,
}

/// Columns of angles, speeds, accelerations, and of the time.
type Columns = ([Vec<Column>; 3], Option<Column>);

impl<const N: usize> States<N> {
    /// Reads a file; `to_chain` converts its angles to D-H angles.
    ///
    /// # Errors
    /// Names file, line and reason.
    pub fn read(file: &Path, to_chain: &[AnatomicalJoint<f64>; N]) -> Result<Self, FileError> {
        let mut source = source::open(file)?;
        let mut rows = Vec::new();
        let lines = for_each_row(file, &mut source.text, find_columns::<N>, |(columns, time), row| {
            let mut numbers = [[0.0; N]; 3];
            for (group, columns) in numbers.iter_mut().zip(columns) {
                for (number, column) in group.iter_mut().zip(columns) {
                    *number = column.number(row)?;
                }
            }
            let time = time.as_ref().map(|column| column.number(row)).transpose()?;
            let [q, qd, qdd] = numbers;
            let motion = JointState {
                q: core::array::from_fn(|joint| to_chain[joint].angle_to_chain(q[joint])),
                qd: core::array::from_fn(|joint| to_chain[joint].to_chain(qd[joint])),
                qdd: core::array::from_fn(|joint| to_chain[joint].to_chain(qdd[joint])),
            };
            rows.push(State { time: time.map(|time| time.to_string()), motion });
            Ok(())
        })?;
        Ok(Self { file: file.to_owned(), rows, lines })
    }

    /// Error of a row whose torque exceeds the range of the number format.
    pub(crate) fn out_of_range(&self, row: usize) -> FileError {
        refuse(&self.file, self.lines.line_of(row), Fault::OutOfRange)
    }
}

fn find_columns<const N: usize>(header: &StringRecord) -> Result<Columns, Fault> {
    let symbols = ["q", "qd", "qdd"];
    let needed: Vec<String> =
        symbols.iter().flat_map(|symbol| (1..=N).map(move |joint| format!("{symbol}{joint}"))).collect();
    let group = |symbol: &str, unit: &str| -> Result<Vec<Column>, Fault> {
        (1..=N).map(|joint| find(header, &format!("{symbol}{joint}"), unit, &needed)).collect()
    };
    let columns = [group("q", "rad")?, group("qd", "radps")?, group("qdd", "radps2")?];
    let is_timed = header.iter().any(|name| name == "t_s");
    Ok((columns, is_timed.then(|| Column::find(header, "t_s", &needed)).transpose()?))
}

/// Column of this name, with or without the unit appended.
fn find(header: &StringRecord, name: &str, unit: &str, needed: &[String]) -> Result<Column, Fault> {
    let with_unit = format!("{name}_{unit}");
    let is_with_unit = header.iter().any(|present| present == with_unit);
    Column::find(header, if is_with_unit { &with_unit } else { name }, needed)
}
