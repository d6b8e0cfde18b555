//! Base parameters: the combinations of parameters that torque determines, and no others.
//!
//! Most parameters of a leg act only together: at the hip a thigh's inertia looks like a shank's mass at the
//! knee. Least squares needs the independent combinations. A report needs to say which parameter is part of
//! which combination.
//!
//! | file | content |
//! | --- | --- |
//! | [`regrouping`] | Gautier's closed form: moves shared terms of a link to the one before it; exact |
//! | [`analysis`] | numerical rank and null space: any chain, gravity, columns, parallel axes |

pub(crate) mod analysis;
mod echelon;
pub(crate) mod regrouping;

pub use analysis::{BaseError, BaseParameters, ColumnMask, Separation, Standing};
pub use regrouping::regroup;
