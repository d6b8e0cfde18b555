//! The host tool: everything that needs `std`.
//!
//! | module | what lives there |
//! | --- | --- |
//! | [`cli`] | the command line |
//! | [`leg_file`], [`x2`] | leg files and the derivation of the default leg |
//! | [`size`], [`anthropometry`], [`posture`] | a leg file for other lengths, another wearer, side or trunk |
//! | [`setup`] | from a leg file to what the firmware is built from |
//! | [`recording`], [`resample`], [`replay`] | identification on recordings |
//! | [`trace`] | what a board told, read back and reported |
//! | [`board`] | the firmware's current loops against complete drives |
//! | [`pair`], [`simulate`], [`watch`], [`identify`] | a leg and its plant run together, and what is seen of them |
//! | [`excite`] | an exciting motion designed, and what it will tell |
//! | [`faults`] | the fault catalogue injected into the whole firmware |
//! | [`motor`] | the current loop measured on a test stand |
//! | [`paper`] | the paper's experiments, run again |
//! | [`monitor`] | an accepted model watched while the leg walks and something changes |
//! | [`series`], [`figures`], [`html`] | a run as curves, drawn, and on one page |
//! | [`model_choice`], [`temperature`] | what of the model was left to the data; when a model is another day's |
//! | [`findings`] | what the verdict saw, in words |
//! | [`perturb`] | what can be made wrong on purpose |
//! | [`placed_mass`], [`scale`] | known masses: torque constants and loads |
//! | [`eds`] | the electronic data sheet of a node of the bus |
//! | [`model_file`], [`predict`], [`urdf`] | what was found, kept; its torque; the same for other programs |
//! | [`states`], [`regressor`] | given states of motion; their torques and regressor |
//! | [`consistent`], [`consistent_runs`] | legs that can exist: both searches and their optimum |
//! | [`analysis`], [`report`], [`tables`] | what a run found: as data, JSON and tables |
//! | [`bus`] | legs on a CANopen bus, for host software that exists |
//! | [`kept_file`] | what a board remembers over the power, as TOML and back |
//! | [`image`] | the flash image: its leg, its build, its size |
//! | [`files`] | files of a command: checked before it computes, written whole |
//! | [`precision`] | digits of reported numbers |
//! | [`error`], [`words`] | bad input, exit codes, and the firmware's codes in words |

#![expect(
    clippy::disallowed_methods,
    reason = "the tool runs on the host only and may use std's mathematics"
)]

pub mod analysis;
pub mod anthropometry;
pub mod board;
pub mod bus;
pub mod cli;
pub mod consistent;
pub mod consistent_runs;
pub mod disturbances;
pub mod eds;
pub mod emulate;
pub mod error;
pub mod excite;
pub mod faults;
pub mod figures;
pub mod files;
pub mod findings;
pub mod html;
pub mod identify;
pub mod image;
pub mod information;
pub mod kept_file;
pub mod leg_file;
pub mod model_choice;
pub mod model_file;
pub mod monitor;
pub mod motions;
pub mod motor;
pub mod pair;
pub mod paper;
pub mod perturb;
pub mod placed_mass;
pub mod posture;
pub mod precision;
pub mod predict;
pub mod recording;
pub mod regressor;
pub mod replay;
pub mod report;
pub mod resample;
pub mod scale;
pub mod series;
pub mod setup;
pub mod simulate;
pub mod size;
pub mod spread;
pub mod states;
pub mod tables;
pub mod temperature;
pub mod trace;
pub mod urdf;
pub mod watch;
pub mod words;
pub mod x2;
