//! Host tool: everything that needs `std`.
//!
//! | module | contents |
//! | --- | --- |
//! | [`cli`] | the command line |
//! | [`leg_file`], [`x2`] | leg files and the derivation of the default leg |
//! | [`size`], [`anthropometry`], [`posture`] | leg files for other lengths, wearer, side or trunk |
//! | [`setup`] | leg file to the firmware's configuration |
//! | [`recording`], [`resample`], [`replay`] | identification from recordings |
//! | [`trace`] | records of a board, read back and reported |
//! | [`board`] | the firmware's current loops against complete drives |
//! | [`pair`], [`simulate`], [`watch`], [`identify`] | a leg run with its plant, and observed |
//! | [`excite`] | design of an exciting motion, and its expected result |
//! | [`faults`] | the fault catalogue injected into the whole firmware |
//! | [`motor`] | the current loop measured on a test stand |
//! | [`paper`] | the paper's experiments, reproduced |
//! | [`monitor`] | an accepted model monitored while the leg walks and something changes |
//! | [`series`], [`figures`], [`html`] | a run as curves, as figures, and as a page |
//! | [`model_choice`], [`temperature`] | model terms left to the data; models of another day |
//! | [`findings`] | evidence of the verdict in words |
//! | [`perturb`] | deliberate errors |
//! | [`placed_mass`], [`scale`] | known masses: torque constants and loads |
//! | [`eds`] | electronic data sheet of a bus node |
//! | [`model_file`], [`predict`], [`urdf`] | stored models, their torque, and their export |
//! | [`states`], [`regressor`] | given states of motion; their torques and regressor |
//! | [`consistent`], [`consistent_runs`] | physically consistent legs: both searches and their optimum |
//! | [`analysis`], [`report`], [`tables`] | results of a run: as data, JSON and tables |
//! | [`bus`] | legs on a CANopen bus, for existing host software |
//! | [`kept_file`] | persistent data of a board, as TOML and back |
//! | [`image`] | the flash image: its leg, its build, its size |
//! | [`files`] | files of a command: checked before the computation, written atomically |
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
