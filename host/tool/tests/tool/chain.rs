//! A chain of three joints without a prior.

use crate::command::{Folder, scarab};

#[test]
fn three_joints_without_a_prior_agree_with_least_squares() {
    let folder = Folder::new();
    scarab("identify --leg paper-chain --prior none --seeds 1..3 --json", &[&folder.path("runs.json")])
        .ends_with(0);
    let runs = folder.json("runs.json");
    let runs = runs["runs"].as_array().expect("a list");
    assert_eq!(runs.len(), 3);
    for run in runs {
        let number = |value: &serde_json::Value| value.as_f64().expect("known");
        for base in run["base_parameters"].as_array().expect("a list") {
            let error = (number(&base["value"]) - number(&base["truth"])) / number(&base["sigma"]);
            // 25 values of 3 runs: by chance one beyond 3.5 sigma in 30 such tests; the seeds are fixed.
            assert!(error.abs() < 3.5, "{}: {error} sigma", base["name"]);
        }
        assert!(number(&run["bso"]["excess_chi2"]) < 0.5, "{}", run["bso"]);
        assert!(number(&run["consistent"]["base"]["excess_chi2"]) < 0.5, "{}", run["consistent"]["base"]);
    }
}
