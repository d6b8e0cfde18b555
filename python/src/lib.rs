//! `scarab_ident._native`: Scarab's model and identification for Python.
//!
//! The module converts arrays, calls the functions of the host crates and converts the results. Shapes, units
//! and errors of every function are in `scarab_ident/_native.pyi`; `build.rs` takes docstrings from there.
//!
//! | Python | Rust |
//! | --- | --- |
//! | `Leg` | [`scarab_identify::formats::leg_file::LegFile`] |
//! | `Leg.identify` | [`scarab_identify::run::replay`], as `cargo sim replay` |
//! | `Leg.simulate` | [`scarab_rig::simulate`], as `cargo sim identify` |
//! | `Leg.excite` | [`scarab_rig::excite`], as `cargo sim excite` |
//! | `beetle_swarm` | [`scarab::swarm::Bso`] |

#![expect(clippy::too_many_arguments, reason = "functions have the keyword arguments of Python")]

mod arrays;
mod dynamics;
mod error;
mod identification;
mod leg;
mod motion;
mod pool;
mod recording;
mod swarm;

use pyo3::prelude::*;

#[pymodule]
mod _native {
    #[pymodule_export]
    use super::error::{InputError, RefusedError};
    #[pymodule_export]
    use super::identification::Identification;
    #[pymodule_export]
    use super::leg::Leg;
    #[pymodule_export]
    use super::motion::Motion;
    #[pymodule_export]
    use super::recording::read_recording;
    #[pymodule_export]
    use super::swarm::beetle_swarm;
}
