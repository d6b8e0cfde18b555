//! Results as tables, figures and pages. Runs nothing.

pub(crate) mod assist;
pub(crate) mod commission;
pub mod document;
pub(crate) mod excite;
pub mod figures;
pub mod html;
pub mod live;
pub(crate) mod monitor;
pub(crate) mod motor;
pub(crate) mod runs;
pub(crate) mod sections;
pub(crate) mod spread;
pub mod tables;
