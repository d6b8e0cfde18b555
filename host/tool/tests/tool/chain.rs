//! A chain of three joints without a prior.

use crate::command::{Folder, list, number};

#[test]
fn three_joints_without_a_prior_agree_with_least_squares() {
    let folder = Folder::new();
    let (_, report) = folder.reported("identify --leg paper-chain --prior none --seeds 1..3", 0);
    let runs = list(&report, "runs");
    assert_eq!(runs.len(), 3);
    for run in runs {
        for base in list(run, "base_parameters") {
            let error = (number(base, "value") - number(base, "truth")) / number(base, "sigma");
            // 25 values of 3 runs: by chance one beyond 3.5 sigma in 30 such tests; the seeds are fixed.
            assert!(error.abs() < 3.5, "{}: {error} sigma", base["name"]);
        }
        for search in [&run["bso"], &run["consistent"]["base"]] {
            assert!(number(search, "excess_chi2") < 0.5, "{search}");
        }
    }
}
