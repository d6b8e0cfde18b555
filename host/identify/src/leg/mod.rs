//! A leg file becomes the firmware's configuration, its prior and its plant.

pub(crate) mod additional_torque;
pub(crate) mod axes;
pub mod background;
pub mod board_words;
pub mod exercise;
pub mod from_robot;
mod link_body;
pub mod matching;
pub mod model_choice;
pub mod motions;
pub mod placed_mass;
pub mod posture;
pub(crate) mod robot_chain;
pub mod setup;
pub mod size;
pub mod states;
pub mod stick;
pub mod two_bodies;
pub mod words;
pub mod x2;
