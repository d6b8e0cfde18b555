//! Identification of the default leg, shared by the tests of stored models.

use std::fs;
use std::path::PathBuf;
use std::sync::OnceLock;

use scarab_identify::formats::model_file::ModelFile;
use serde_json::Value;

use crate::command::{Folder, Run, scarab};

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
        let (report, model) = (folder.path("run.json"), folder.path("model.toml"));
        let arguments = format!("identify --json {} --save-model", report.display());
        let run = scarab(&arguments, &[&model]).ends_with(0);
        assert!(run.printed.ends_with(&format!("model: {}\n", model.display())), "{}", run.printed);
        let report = folder.json("run.json");
        Kept { folder, report, model }
    })
}

pub fn model() -> ModelFile {
    ModelFile::load(&kept().model).expect("just written")
}

pub fn text() -> String {
    fs::read_to_string(&kept().model).expect("just written")
}

pub const STATES: &str =
    "t_s,q1,q2,qd1,qd2,qdd1,qdd2\n0.0,0.3,-0.9,0.7,-1.1,4.0,-6.0\n0.5,0.8,-0.2,-1.3,0.4,-2.0,9.0\n";

/// Predicts the torque of [`STATES`], in D-H angles, from a model.
pub fn predict(folder: &Folder, model: &str, more: &str) -> Run {
    let (model, states) = (folder.write("model.toml", model), folder.write("states.csv", STATES));
    scarab(&format!("predict --dh {more} --model"), &[&model, "--states".as_ref(), &states])
}
