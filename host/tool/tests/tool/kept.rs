//! Identification of the default leg, shared by the tests of stored models.

use std::path::PathBuf;
use std::sync::OnceLock;

use scarab_identify::formats::model_file::ModelFile;
use serde_json::Value;

use crate::command::{Folder, Run};

/// Identification of the default leg: its report and its model.
pub struct Kept {
    pub folder: Folder,
    pub report: Value,
    pub model: PathBuf,
}

pub fn kept() -> &'static Kept {
    static KEPT: OnceLock<Kept> = OnceLock::new();
    KEPT.get_or_init(|| {
        let folder = Folder::new();
        let model = folder.path("model.toml");
        let (run, report) = folder.reported("identify --save-model @model.toml", 0);
        assert!(run.printed.ends_with(&format!("model: {}\n", model.display())), "{}", run.printed);
        Kept { folder, report, model }
    })
}

pub fn model() -> ModelFile {
    ModelFile::load(&kept().model).expect("just written")
}

pub fn text() -> String {
    kept().folder.read("model.toml")
}

pub const STATES: &str =
    "t_s,q1,q2,qd1,qd2,qdd1,qdd2\n0.0,0.3,-0.9,0.7,-1.1,4.0,-6.0\n0.5,0.8,-0.2,-1.3,0.4,-2.0,9.0\n";

/// Predicts the torque of [`STATES`], in D-H angles, from a model.
pub fn predict(folder: &Folder, model: &str, more: &str) -> Run {
    folder.write("model.toml", model);
    folder.write("states.csv", STATES);
    folder.scarab(&format!("predict --dh {more} --model @model.toml --states @states.csv"))
}
