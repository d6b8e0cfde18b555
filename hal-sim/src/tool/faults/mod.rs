//! `cargo sim faults`: every fault of the catalogue injected into the whole firmware while it identifies a leg.
//!
//! | part | what it is |
//! | --- | --- |
//! | [`rig`] | firmware and plant, one PWM period at a time, faults on the ports between |
//! | [`catalogue`], [`draw`], [`bounds`] | what is done to the machine, and what has to follow; rows by group |
//! | [`run`], [`outcome`], [`invariants`] | one run, what came of it, and what holds in each of its periods |
//! | [`aftermath`] | what may follow: the safe state of each code, an operator who resets and enables again |
//! | [`campaign`] | many runs, forked from identifications |
//! | [`detectors`] | each code of the firmware switched off by itself |
//! | [`mod@bench`] | rows that are no forks: parts, calibrations, identifications of ideal drives |
//! | [`emulated`] | rows that only a processor can show, on the emulated one |
//! | [`trial`] | every channel spoilt in every way, and two faults at once: nothing may be broken |
//! | [`hours`] | normal motion, in which nothing may be raised |
//! | [`recording`] | a run's curves |
//! | [`report`] | table, JSON, document |
//!
//! Everything follows from seeds: a run is repeated to the bit by its row and its seed.

pub mod aftermath;
pub mod bench;
pub mod bounds;
pub mod campaign;
pub mod catalogue;
pub mod detectors;
pub mod dice;
pub mod draw;
pub mod emulated;
pub mod entry;
pub mod event;
pub mod hours;
pub mod invariants;
pub mod outcome;
pub mod recording;
pub mod report;
pub mod rig;
pub mod run;
pub mod trial;
