//! Results printed in the paper: Tables V and VI, and the torque errors.

/// One line of Table V or VI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Printed {
    /// Name in the reports of this project.
    pub name: &'static str,
    /// Column "X_rea".
    pub real: f64,
    /// Column "X_ide".
    pub identified: f64,
    /// Column "e", percent; `None` where a dash is printed.
    pub error_percent: Option<f64>,
}

impl Printed {
    /// Equation (30) with the sign corrected, percent; `None` for a real value of zero.
    pub fn error(&self) -> Option<f64> {
        (self.real != 0.0).then(|| 100.0 * (self.real - self.identified).abs() / self.real.abs())
    }
}

const fn line(name: &'static str, real: f64, identified: f64, error: f64) -> Printed {
    Printed { name, real, identified, error_percent: Some(error) }
}

const fn dash(name: &'static str, real: f64, identified: f64) -> Printed {
    Printed { name, real, identified, error_percent: None }
}

/// Table V: sequential method, by the paper's swarm.
pub const TABLE_FIVE: [Printed; 20] = [
    line("ZZ1", 3.825, 4.128, 7.92),
    line("XX2", 0.123, 0.063, 48.78),
    dash("XY2", 0.0, 6.32e-7),
    line("XZ2", -0.125, -0.047, 62.4),
    line("YY2", 4.148, 4.273, -3.01),
    dash("YZ2", 0.0, 3.81e-8),
    line("ZZ2", 4.26, 4.296, 0.84),
    line("HX2", 8.333, 8.655, 3.86),
    dash("HY2", 0.0, -1.43e-8),
    line("HZ2", 0.372, 0.335, 9.94),
    line("XX3", 5.853, 5.922, 1.18),
    line("XY3", -0.151, -0.149, 1.32),
    line("XZ3", -0.08, -0.037, 53.75),
    line("YY3", 0.548, 0.512, 6.57),
    dash("YZ3", 0.007, 0.028),
    line("ZZ3", 6.175, 6.647, 7.64),
    line("HX3", -1.532, -1.587, 3.59),
    line("HY3", 10.636, 11.079, 4.16),
    dash("HZ3", 0.0, 3.12e-6),
    line("M3", 48.537, 50.705, 4.47),
];

/// Table VI: one-time method.
pub const TABLE_SIX: [Printed; 15] = [
    line("ZZ1", 26.486, 19.35, 26.94),
    line("XX2", -22.27, -24.22, 8.76),
    dash("XY2", 0.0, -0.108),
    dash("XZ2", 0.007, -1.58),
    dash("YZ2", 0.008, -1.76),
    line("ZZ2", 22.63, 24.73, 9.28),
    line("HX2", 34.78, 36.47, 4.86),
    dash("HY2", 0.0, 0.389),
    line("XX3", 5.443, 5.611, 3.09),
    line("XY3", -0.165, -0.176, 6.67),
    dash("XZ3", -0.008, -0.026),
    dash("YZ3", 0.00693, 0.295),
    line("ZZ3", 6.158, 6.319, 2.61),
    line("HX3", -1.511, -1.767, 16.94),
    line("HY3", 11.447, 12.358, 7.96),
];

/// Root mean square torque error of each joint on the verification motion, N m, and percent of mean
/// absolute torque.
pub const FIGURE_SEVEN: [(f64, f64); 3] = [(23.85, 7.42), (20.39, 6.5), (9.26, 4.91)];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn printed_errors_follow_from_printed_values_except_dashes_and_negatives() {
        let mut dashes = Vec::new();
        for line in TABLE_FIVE.iter().chain(&TABLE_SIX) {
            match (line.error(), line.error_percent) {
                // Values and errors are printed with two or three digits.
                (Some(own), Some(printed)) => assert!((own - printed.abs()).abs() < 0.02, "{line:?}: {own}"),
                (Some(own), None) => dashes.push((line.name, own.round())),
                (None, printed) => assert_eq!(printed, None, "{line:?}"),
            }
        }
        assert_eq!(
            dashes,
            [("YZ3", 300.0), ("XZ2", 22671.0), ("YZ2", 22100.0), ("XZ3", 225.0), ("YZ3", 4157.0)]
        );
        assert!(TABLE_FIVE.iter().any(|line| line.error_percent.is_some_and(|error| error < 0.0)));
    }
}
