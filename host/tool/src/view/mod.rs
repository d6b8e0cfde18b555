//! Results as tables, figures and pages. Runs nothing.

pub mod assist;
pub mod document;
pub mod excite;
pub mod figures;
pub mod html;
pub mod live;
pub mod monitor;
pub mod motor;
pub mod runs;
pub mod spread;
pub mod tables;
