//! Figures of the paper, drawn with the means of [`scarab_tool::view::figures`].

pub mod chain;
pub mod swarm;
