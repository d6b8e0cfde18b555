//! States of motion and the convention of their angles.

use clap::Args;
use scarab_identify::leg::states::Angles;

use crate::cli::arguments::Input;

/// States for `predict` and `regressor`.
#[derive(Args, Debug)]
pub(crate) struct StatesOptions {
    /// States of motion, CSV: columns q1.. (or q1_rad..), qd1.., qdd1.. in rad and s, anatomical; predict
    /// copies t_s.
    #[arg(long)]
    pub(crate) states: Input,
    /// Read angles and write torques of the D-H frames instead of anatomical ones.
    #[arg(long)]
    dh: bool,
}

impl StatesOptions {
    /// Convention of angles and torques.
    pub(crate) fn angles(&self) -> Angles {
        if self.dh { Angles::DenavitHartenberg } else { Angles::Anatomical }
    }
}
