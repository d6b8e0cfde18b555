//! `scarab fw` and `flash-leg`: legs for which no image is built. A step of `.ci/run` builds images.

use crate::command::{Folder, assert_contains, scarab};

#[test]
fn no_image_is_built_without_a_described_motor() {
    let folder = Folder::new();
    for leg in ["mujoco-leg", "dp-a0"] {
        let message = folder.scarab(&format!("fw --leg {leg} --side right --source @leg.rs")).refusal();
        assert_contains(&message, "`motor`");
        assert_contains(&message, "missing");
        assert!(message.starts_with(&format!("error: {leg} (shipped):")), "{leg}: {message}");
    }
    folder.scarab("fw --leg mujoco-leg --side right --source @leg.rs").refuses("`encoder.side` is \"joint\"");
    folder.scarab("fw --leg mujoco-leg --source @leg.rs").refuses("`side` is missing");
    scarab("flash-leg --leg mujoco-leg --side right").refuses("`motor`");
    assert!(!folder.path("leg.rs").exists());
    folder.scarab("fw --source @leg.rs").ends_with(0);
    assert!(folder.path("leg.rs").exists());
}

#[test]
fn flashing_requires_a_named_leg() {
    let message = scarab("flash-leg").refusal();
    assert_contains(&message, "--leg is missing");
    assert_contains(&message, "cargo flash-leg --leg my-leg.toml");
}
