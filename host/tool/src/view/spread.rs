//! Distribution of every base parameter about its truth over many runs of one leg.

use scarab_base::stats::rms;

use scarab_identify::report::RunReport;

/// One base parameter over all runs that determine it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Spread {
    /// Name in reports.
    pub(crate) name: String,
    /// SI unit.
    pub(crate) unit: &'static str,
    /// True value of the simulated leg.
    pub(crate) truth: f64,
    /// Value minus truth, over the sigma of its run.
    pub(crate) errors: Vec<f64>,
    /// Root mean square of the reported sigma.
    pub(crate) sigma: f64,
    /// Root mean square error over the Cramér-Rao bound; `None` if no run has one.
    pub(crate) over_bound: Option<f64>,
}

impl Spread {
    /// Spread of every base parameter with a truth, in the order of first appearance.
    pub(crate) fn from_runs(runs: &[RunReport]) -> Vec<Self> {
        let mut names: Vec<&str> = Vec::new();
        for base in runs.iter().flat_map(|run| &run.base_parameters) {
            if !names.contains(&base.name.as_str()) {
                names.push(&base.name);
            }
        }
        names.into_iter().filter_map(|name| Self::named(runs, name)).collect()
    }

    fn named(runs: &[RunReport], name: &str) -> Option<Self> {
        let (mut unit, mut truths) = ("", Vec::new());
        let (mut errors, mut absolute, mut sigmas, mut bounds) = (vec![], vec![], vec![], vec![]);
        for base in runs.iter().flat_map(|run| &run.base_parameters).filter(|base| base.name == name) {
            let sigma = base.sigma.known().filter(|sigma| *sigma > 0.0);
            let (Some(value), Some(truth), Some(sigma)) = (base.value.known(), base.truth.known(), sigma)
            else {
                continue;
            };
            unit = base.unit;
            truths.push(truth);
            errors.push((value - truth) / sigma);
            absolute.push(value - truth);
            sigmas.push(sigma);
            bounds.extend(base.cramer_rao.known().filter(|bound| *bound > 0.0));
        }
        let over_bound = (!bounds.is_empty()).then(|| rms(absolute) / rms(bounds.iter().copied()));
        let truth = *truths.first()?;
        Some(Self { name: name.to_owned(), unit, truth, errors, sigma: rms(sigmas), over_bound })
    }

    /// Mean error in sigma.
    pub(crate) fn mean(&self) -> f64 {
        self.errors.iter().sum::<f64>() / self.errors.len().max(1) as f64
    }

    /// Standard deviation of the errors about their mean, in sigma; 1 if the reported sigma is right.
    pub(crate) fn deviation(&self) -> f64 {
        let mean = self.mean();
        rms(self.errors.iter().map(|error| error - mean))
    }

    /// Share of the errors within a number of sigma.
    pub(crate) fn within(&self, sigmas: f64) -> f64 {
        let inside = self.errors.iter().filter(|error| error.abs() <= sigmas).count();
        inside as f64 / self.errors.len().max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use scarab::real::sqrt;

    #[test]
    fn errors_are_counted_about_truth_and_spread_about_their_mean() {
        let spread = Spread {
            name: "FC1".into(),
            unit: "N m",
            truth: 4.0,
            errors: vec![-1.0, 0.5, 3.5, 1.0],
            sigma: 0.1,
            over_bound: None,
        };
        assert_eq!(spread.mean(), 1.0);
        // Squares about the mean: 4, 0.25, 6.25, 0.
        assert!((spread.deviation() - sqrt(10.5 / 4.0)).abs() < 1e-12);
        assert_eq!((spread.within(1.0), spread.within(3.0)), (0.75, 0.75));
    }
}
