//! `cargo sim faults`: injects every fault of the catalogue into the whole firmware while it identifies a
//! leg.
//!
//! | part | content |
//! | --- | --- |
//! | [`catalogue`] | all faults: detector, safe state, deadline, codes |
//! | `scenario` | a run: injection, onset, required reaction |
//! | `forks`, [`draw`], `bounds` | how the faults of forks are drawn |
//! | [`run`], `outcome`, `invariants` | one run, its outcome, and conditions that hold in every period |
//! | `aftermath` | allowed safe states of each code; an operator who resets and enables again |
//! | [`campaign`] | many runs, forked from identifications |
//! | `detectors` | each fault code of the firmware disabled separately |
//! | [`mod@bench`] | rows that are not forks: components, calibrations, identifications with ideal drives |
//! | [`random_hosts`] | random sessions of hosts, and what must hold in them |
//! | [`trial`] | every channel faulted in every form, and two faults at once: no invariant may break |
//! | [`hours`] | normal motion, in which no fault may be reported |
//! | [`recording`] | a run's curves |
//! | [`results`] | results of all runs, joined from the shards of a divided campaign |
//! | [`report`] | table, JSON, document |
//!
//! All random choices follow from seeds: row and seed repeat a run bit for bit.

pub(crate) mod aftermath;
pub mod bench;
pub(crate) mod bounds;
pub mod campaign;
pub mod catalogue;
pub(crate) mod detectors;
pub mod draw;
pub mod entry;
pub(crate) mod event;
pub(crate) mod forks;
pub mod hours;
pub(crate) mod invariants;
pub(crate) mod outcome;
pub mod random_hosts;
pub mod recording;
pub mod report;
pub mod results;
pub mod run;
pub(crate) mod scenario;
pub mod trial;
