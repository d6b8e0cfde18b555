//! Accumulates one motion: from smoothed instants to rows, and from rows to the record of the motion.
//!
//! | file | content | source |
//! | --- | --- | --- |
//! | `choice` | what to estimate: always, never, or as the data decide | |
//! | `row_model` | geometry, gravity, columns and friction curves: an instant becomes a row | |
//! | `rows` | second filter step: rows and torque through one low-pass, then 50 Hz | |
//! | `recorder` | from logged samples to a record, in constant memory | |
//! | `window` | the motion as blocks of rows | |
//! | `packed` | factors of a few columns, without zeros | |
//! | `factor` | square-root information factor | Golub and Van Loan, 5.1.8 |
//! | `reweighting` | weights of the blocks | Huber and Ronchetti 2009 |
//! | `stribeck` | Stribeck friction from one record | Armstrong-Helouvry 1994; Golub and Pereyra 1973 |
//! | `assembly` | window to record: weights, Stribeck friction, one factor per joint | |
//! | `motion_record` | the record of one motion, its excluded data and the columns held at zero | |
//! | `stretch` | durations of disturbances, by a second pass over the rows | |

mod assembly;
pub(crate) mod choice;
pub mod factor;
pub(crate) mod motion_record;
pub mod packed;
pub mod recorder;
pub(crate) mod reweighting;
pub(crate) mod row_model;
pub(crate) mod rows;
pub(crate) mod stretch;
pub mod stribeck;
pub mod window;
