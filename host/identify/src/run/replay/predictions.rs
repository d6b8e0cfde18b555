//! Table of predicted torques for `--csv`.

use std::io::{self, Write};
use std::path::Path;

use scarab::model::AnatomicalJoint;

use scarab_base::error::ToolError;
use scarab_base::files::NewFile;

/// Measured and predicted torque of one instant, D-H.
pub(super) struct Prediction<const N: usize> {
    pub(crate) file: usize,
    pub(crate) time_s: f64,
    pub(crate) measured: [f32; N],
    pub(crate) predicted: [f32; N],
}

/// Writes a table of anatomical torques.
pub(super) fn write_predictions<const N: usize>(
    path: &Path,
    predictions: &[Prediction<N>],
    anatomy: &[AnatomicalJoint<f64>; N],
) -> Result<(), ToolError> {
    let mut out = NewFile::create(path)?;
    write_table(&mut out, predictions, anatomy).map_err(|error| ToolError::cannot_write(path, &error))?;
    out.finish()
}

fn write_table<const N: usize>(
    out: &mut impl Write,
    predictions: &[Prediction<N>],
    anatomy: &[AnatomicalJoint<f64>; N],
) -> io::Result<()> {
    write!(out, "t_s")?;
    for joint in 1..=N {
        write!(out, ",tau{joint}_measured_Nm,tau{joint}_predicted_Nm")?;
    }
    writeln!(out, ",file")?;
    for prediction in predictions {
        write!(out, "{:.6}", prediction.time_s)?;
        for joint in 0..N {
            let anatomical = |torque: f32| anatomy[joint].from_chain(f64::from(torque));
            let (measured, predicted) =
                (anatomical(prediction.measured[joint]), anatomical(prediction.predicted[joint]));
            write!(out, ",{measured:.7},{predicted:.7}")?;
        }
        writeln!(out, ",{}", prediction.file)?;
    }
    Ok(())
}
