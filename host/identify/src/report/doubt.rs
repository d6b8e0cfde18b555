//! Errors of the logging chain of a recording, as data and in words.

use scarab_base::number::Number;
use serde::Serialize;

use crate::report::findings::FindingReport;

/// Estimated errors of the logging chain of a recording.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct DoubtReport {
    /// Most likely reason of a refusal, or of an accepted misfit; `null` where there is none.
    pub likely_cause: Option<CauseReport>,
    /// Every direction, whatever its value.
    pub(crate) directions: Vec<DirectionReport>,
    /// Root mean square misfit of the filtered torque over its noise, for each joint.
    pub(crate) misfit_over_noise: Vec<Number>,
    /// Error accepted beside noise, percent of the rms torque.
    pub(crate) accept_error_percent: f64,
    /// Parameters that end at a limit of the prior.
    pub(crate) at_prior_limit: Vec<String>,
    /// Springs that could replace weight unseen.
    pub(crate) unseen_springs: Vec<UnseenSpring>,
    /// Scatter between the recordings identified from.
    pub(crate) recordings: RecordingsReport,
    /// Bandwidth of the rows.
    #[serde(flatten)]
    pub(crate) bandwidth: Option<BandwidthReport>,
}

/// Spring beside a drive that the motion does not distinguish from weight.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct UnseenSpring {
    /// Joint, from 1.
    pub(crate) joint: usize,
    /// Two standard deviations of its stiffness, N m/rad.
    pub(crate) stiffness: f64,
    /// Base parameter that it would change.
    pub(crate) parameter: String,
    /// Share of the parameter by which it would.
    pub(crate) change: f64,
}

impl UnseenSpring {
    /// Sentence for the verdict.
    pub(crate) fn words(&self) -> String {
        let Self { joint, stiffness, parameter, change } = self;
        format!(
            "spring at joint {joint}: this motion does not show one below {stiffness:.2} N m/rad, which would change {parameter} by \
             {:.0} %; move the joint further, or, if there can be one, state `spring = \"on\"` in the leg file",
            100.0 * change
        )
    }
}

/// Bandwidth of a replay.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct BandwidthReport {
    /// Frequency at which the low-pass is 3 dB down, Hz.
    pub(crate) bandwidth_hz: f64,
    /// Whether it was chosen by the encoders' steps.
    #[serde(rename = "bandwidth_chosen")]
    pub(crate) is_chosen: bool,
    /// Larger bandwidth that the encoders allow, where the noise explains the misfit.
    #[serde(rename = "bandwidth_proposed_hz")]
    pub(crate) proposed_hz: Option<f64>,
    /// Largest bandwidth at which Stribeck friction is searched for, where the encoders are too coarse here.
    #[serde(rename = "bandwidth_for_stribeck_hz")]
    pub(crate) stribeck_hz: Option<f64>,
}

impl BandwidthReport {
    /// Line of the report.
    fn line(&self) -> String {
        let hz = self.bandwidth_hz;
        let stribeck = self.stribeck_hz.map_or(String::new(), |lower| {
            format!(
                "; an encoder (by the leg file's `encoder` or the recording) is too coarse to search for Stribeck friction, \
                 which would bias friction unseen: `--bandwidth {lower}` searches for it"
            )
        });
        if self.is_chosen {
            format!(
                "bandwidth: {hz} Hz, chosen from 3.2 to 16 Hz: the largest that the recording's rate allows and at which the \
                 encoders' steps shift no parameter by more than its sigma, or the smallest if none qualifies{stribeck}"
            )
        } else if let Some(larger) = self.proposed_hz {
            format!(
                "bandwidth: {hz} Hz; the encoders allow {larger} Hz, at which sticking biases friction less: `--bandwidth {larger}`"
            )
        } else {
            format!("bandwidth: {hz} Hz{stribeck}")
        }
    }
}

/// Scatter of the parameters between recordings, by excluding one at a time.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(crate) struct RecordingsReport {
    /// Number of recordings identified from.
    pub(crate) count: usize,
    /// Standard deviation of each base parameter, in their order; empty where it is unknown.
    pub(crate) sigma: Vec<Number>,
}

impl RecordingsReport {
    /// Line of the report: whether sigma contains the scatter.
    pub fn line(&self) -> String {
        match (self.count, self.sigma.is_empty()) {
            (0, _) => "sigma does not contain the scatter between recordings: too few rows".into(),
            (1, _) => {
                "sigma does not contain the scatter between recordings: only one recording was given".into()
            }
            (count, true) => format!(
                "sigma does not contain the scatter between the {count} recordings: without one of them the others do not \
                 determine every parameter"
            ),
            (count, false) => {
                format!("sigma contains the scatter between {count} recordings (each excluded once)")
            }
        }
    }
}

/// Most likely reason of a refusal, or of a misfit.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct CauseReport {
    /// A word of the closed list.
    pub name: &'static str,
    /// Joint, from 1; `null` for all or unknown.
    pub(crate) joint: Option<usize>,
    /// Size in the direction's unit; `null` if it has none.
    pub(crate) value: Number,
    /// Standard deviation of the size.
    pub(crate) sigma: Number,
    /// Share of the misfit beyond the noise that it explains, 0..1; `null` where it is no correction.
    pub(crate) explained: Number,
    /// Sentence with the evidence.
    pub words: String,
    /// Corrections that explain part of the misfit of an unknown cause, or are not distinguished from a named
    /// one.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) possible: Vec<CauseReport>,
    /// Units in which the cause reads the columns.
    #[serde(skip)]
    pub(crate) reads: Vec<ReadAs>,
}

/// Reading of the columns in another unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ReadAs {
    /// Joint angles in degrees.
    Degrees,
    /// Joint angles in turns.
    Turns,
    /// Angles of the motor in rad.
    MotorRadians,
    /// Angles of the motor in degrees.
    MotorDegrees,
    /// Angles of the motor in turns.
    MotorTurns,
    /// Torques in mN m.
    MillinewtonMetres,
}

/// One direction: an error of the logging chain with its estimate.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct DirectionReport {
    /// `delay`, `encoder_scale`, `torque_scale`, `gravity`, `spring`, `offset_drift`, `torque_drift`,
    /// `friction_drift`.
    pub(crate) name: &'static str,
    /// Joint, from 1; `null` for gravity.
    pub(crate) joint: Option<usize>,
    /// Estimate; `null` where the motion does not determine it, and where the search ended at its limit.
    pub(crate) value: Number,
    /// Whether the search ended at its limit.
    pub(crate) at_limit: bool,
    /// Standard deviation: the larger of noise and scatter over segments.
    pub(crate) sigma: Number,
    /// Source of the standard deviation: `noise` or `segments`.
    pub(crate) sigma_from: &'static str,
    /// `ms`, `%`, `deg`, `N m/rad` or `N m`.
    pub(crate) unit: &'static str,
    /// Largest magnitude that chance explains.
    pub(crate) limit: Number,
    /// Share of the misfit that the direction explains, 0..1.
    pub(crate) explained: Number,
    /// Share of the misfit from which the direction refuses.
    pub(crate) explained_limit: Number,
    /// Largest shift of a parameter, in its sigma, when the direction is fitted.
    pub(crate) largest_shift: Number,
    /// Torque of a spring that the parameters leave, or of a drift at the ends of a recording, over the rms
    /// torque; `null` for other directions.
    pub(crate) torque_share: Number,
    /// Share from which a drift refuses; `null` for other directions.
    pub(crate) accepted_share: Number,
    /// False where the recording is refused for this direction.
    pub(crate) passed: bool,
    /// Directions and parameters that cannot be distinguished from this one.
    pub(crate) alike: Vec<String>,
}

/// A fault in a recording's columns.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SampleFinding {
    /// `saturation`, `held_samples`, `zero_rows`, `quantised` or `time_stamps`.
    pub(crate) name: &'static str,
    /// File, as named.
    pub(crate) file: String,
    /// Joint, from 1; `null` for a fault of all columns.
    pub(crate) joint: Option<usize>,
    /// Limit of the torque in N m, holding time in s, step in rad or N m, error of the stamps in s.
    pub(crate) value: f64,
    /// Unit of the value.
    pub(crate) unit: &'static str,
    /// Standard deviation of the value, if it is an estimate.
    pub(crate) sigma: Option<f64>,
    /// Share of the samples, 0..1.
    pub(crate) share: f64,
    /// Whether the recording must not be identified from.
    pub(crate) refuses: bool,
    /// The finding in a sentence.
    pub(crate) text: String,
}

impl DirectionReport {
    /// Estimate in words: "torque of joint 1: 9.8 +- 0.4 ms late".
    pub fn words(&self) -> String {
        let joint = self.joint.unwrap_or(0);
        let (Some(value), Some(sigma)) = (self.value.known(), self.sigma.known()) else {
            return if self.at_limit {
                format!("{}: not determined, the search ended at its limit", self.subject())
            } else {
                format!("{}: not shown by this motion", self.subject())
            };
        };
        let size = format!("{:.*} +- {:.*}", digits(sigma), value.abs(), digits(sigma), sigma);
        let negative = value < 0.0;
        match self.name {
            "delay" => {
                format!("torque of joint {joint}: {size} ms {}", if negative { "early" } else { "late" })
            }
            "encoder_scale" => {
                format!("angle of joint {joint}: {size} % too {}", if negative { "small" } else { "large" })
            }
            "torque_scale" => format!(
                "torque of joint {joint}: {size} % too {} against the others",
                if negative { "small" } else { "large" }
            ),
            "spring" => format!(
                "torque of joint {joint} {} with its angle by {size} N m/rad, as of a spring beside the drive",
                if negative { "falls" } else { "grows" }
            ),
            "offset_drift" | "torque_drift" | "friction_drift" => format!(
                "{} of joint {joint} {} by {size} {} over each recording",
                self.name.trim_end_matches("_drift"),
                if negative { "falls" } else { "grows" },
                self.unit
            ),
            _ => format!("gravity: turned by {}{size} degrees", if negative { "-" } else { "" }),
        }
    }

    fn subject(&self) -> String {
        match self.joint {
            Some(joint) => format!("{} of joint {joint}", self.name.replace('_', " ")),
            None => self.name.into(),
        }
    }

    /// Line of the report.
    pub fn line(&self) -> String {
        let alike = match self.alike.as_slice() {
            [] => String::new(),
            names => format!(" (not distinguished from {})", names.join(", ").replace('_', " ")),
        };
        format!("{}{alike}", self.words())
    }

    /// Whether the report has a line about it: springs and drifts only where they are more than chance.
    fn is_shown(&self) -> bool {
        let is_rare = self.name == "spring" || self.name.ends_with("_drift");
        let beyond = |value: f64| self.limit.known().is_some_and(|limit| value.abs() > limit);
        !is_rare || !self.passed || self.value.known().is_some_and(beyond)
    }

    /// Test of the verdict.
    pub(crate) fn finding(&self) -> FindingReport {
        let failure = (!self.passed).then(|| {
            let limit =
                self.limit.known().map_or(String::new(), |limit| format!(", limit {limit:.3} {}", self.unit));
            let effect = match [self.torque_share, self.accepted_share].map(|share| share.known()) {
                [Some(share), Some(accepted)] => format!(
                    "makes {:.1} % of the rms torque at the ends, accepted {:.1} %",
                    100.0 * share,
                    100.0 * accepted
                ),
                _ => format!(
                    "moves a parameter by {:.1} sigma",
                    self.largest_shift.known().unwrap_or(f64::NAN)
                ),
            };
            format!(
                "{}{limit}; it explains {:.0} % of the misfit and {effect}",
                self.words(),
                100.0 * self.explained.known().unwrap_or(f64::NAN),
            )
        });
        FindingReport::judged("residual", self.name, self.joint, [self.value, self.limit], failure)
    }
}

/// Decimals that show two digits of a standard deviation.
fn digits(sigma: f64) -> usize {
    (1.0 - sigma.abs().max(1e-9).log10().floor()).clamp(0.0, 6.0) as usize
}

impl CauseReport {
    /// Printed line.
    pub fn line(&self) -> String {
        format!("likely cause: {}", self.named())
    }

    /// Name and sentence.
    pub fn named(&self) -> String {
        let name = format!("{}: ", self.name.replace('_', " "));
        format!("{name}{}", self.words.strip_prefix(&name).unwrap_or(&self.words))
    }

    /// Whether the line contains what a finding says, so that it suffices.
    pub fn says(&self, finding: &FindingReport) -> bool {
        !finding.words.is_empty() && self.words.starts_with(&finding.words)
    }
}

impl DoubtReport {
    /// Lines below the tables.
    pub fn lines(&self) -> Vec<String> {
        let mut lines: Vec<String> = self.bandwidth.iter().map(BandwidthReport::line).collect();
        let ratios: Vec<String> = self
            .misfit_over_noise
            .iter()
            .enumerate()
            .filter_map(|(joint, ratio)| Some(format!("joint {}: {:.2}", joint + 1, ratio.known()?)))
            .collect();
        if !ratios.is_empty() {
            lines.push(format!(
                "misfit over noise: {}; beside noise, an error of {} % of the rms torque is accepted (--accept-error)",
                ratios.join("; "),
                self.accept_error_percent
            ));
        }
        lines.extend(self.directions.iter().filter(|found| found.is_shown()).map(DirectionReport::line));
        lines.push(self.recordings.line());
        if !self.at_prior_limit.is_empty() {
            lines.push(format!("at a limit of the prior: {}", self.at_prior_limit.join(", ")));
        }
        lines
    }
}
