//! `scarab fw` and `flash-leg`: legs for which no image is built. A step of `.ci/run` builds images.

use crate::command::{Folder, scarab};

#[test]
fn no_image_is_built_for_a_motor_that_the_leg_file_does_not_describe() {
    let folder = Folder::new();
    let source = folder.path("leg.rs");
    for leg in ["mujoco-leg", "dp-a0"] {
        let message = scarab(&format!("fw --leg {leg} --side right --source"), &[&source]).refusal();
        assert!(message.contains("`motor`") && message.contains("missing"), "{leg}: {message}");
        assert!(message.starts_with(&format!("error: {leg} (shipped):")), "{leg}: {message}");
    }
    let message = scarab("fw --leg mujoco-leg --side right --source", &[&source]).refusal();
    assert!(message.contains("`encoder.side` is \"joint\""), "{message}");
    let message = scarab("fw --leg mujoco-leg --source", &[&source]).refusal();
    assert!(message.contains("`side` is missing"), "{message}");
    let message = scarab("flash-leg --leg mujoco-leg --side right", &[]).refusal();
    assert!(message.contains("`motor`"), "{message}");
    assert!(!source.exists());
    scarab("fw --source", &[&source]).ends_with(0);
    assert!(source.exists());
}

#[test]
fn a_board_is_not_flashed_for_a_leg_that_is_not_named() {
    let message = scarab("flash-leg", &[]).refusal();
    assert!(message.contains("--leg is missing"), "{message}");
    assert!(message.contains("cargo flash-leg --leg my-leg.toml"), "{message}");
}
