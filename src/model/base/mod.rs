//! Base parameters: the combinations of parameters that torque can tell, and no others.
//!
//! Most parameters of a leg act only together: a thigh's inertia and a shank's mass at the knee cannot be told
//! apart at the hip. Least squares needs the independent combinations, a report needs to say which parameter stands
//! in which.
//!
//! | file | what |
//! | --- | --- |
//! | [`regrouping`] | Gautier's closed form: moves what a link shares with the one before it; exact, for any chain |
//! | [`analysis`] | rank and null space by numbers: any chain, gravity and choice of columns, parallel axes included |

pub mod analysis;
mod echelon;
pub mod regrouping;

pub use analysis::{BaseError, BaseParameters, ColumnMask, Separation, Standing};
pub use regrouping::regroup;
