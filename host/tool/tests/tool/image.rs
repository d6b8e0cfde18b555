//! `scarab fw` and `flash-leg`: legs for which no image is built. A step of `.ci/run` builds images.

use crate::command::{Folder, scarab};

#[test]
fn no_image_is_built_without_a_described_motor() {
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
fn flashing_requires_a_named_leg() {
    let message = scarab("flash-leg", &[]).refusal();
    assert!(message.contains("--leg is missing"), "{message}");
    assert!(message.contains("cargo flash-leg --leg my-leg.toml"), "{message}");
}
