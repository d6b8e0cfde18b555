//! Monitors an accepted model while the leg moves, and offers an update after a change.
//!
//! ```text
//!   Watching --alarm--> Collecting --enough rows--> Solving --change--> Offered --enough rows--> Solving
//!   Solving: unexplained -> Collecting          Solving: nothing changed -> Watching
//!   Offered: the operator takes the update -> Watching
//! ```
//!
//! Only a tracked motion and only an accepted model are monitored. Rows recorded before the alarm are not
//! used for the update, since some precede the change. The servo is not affected: an update is only offered,
//! and used on request of the operator. If nothing explains the rows, the next ones are tried while the
//! motion lasts. The offer is renewed every 600 rows. The offer is withdrawn if the rows no longer show the
//! change, because a load may be removed again.

use crate::ident::{
    Baseline, Cause, Change, FilteredRows, LowPass, Monitor, MonitorSettings, Record, RowModel, Thresholds,
    Update,
};

/// Moving rows of every joint used for an update: 12 s at 50 Hz, about 15 s of gait with a 3 s cycle. They
/// determine a payload of 3 kg to 0.6 % (one standard deviation, default leg).
pub const UPDATE_ROWS: u32 = 600;

/// Phase of the monitoring.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Watching,
    Collecting,
    Solving,
    Offered,
}

/// Monitor, quick pass and the model they refer to.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelMonitor<const N: usize, const B: usize> {
    baseline: Option<Baseline<f32, N, B>>,
    monitor: Monitor<f32, N>,
    settings: MonitorSettings<f32>,
    phase: Phase,
    change: Option<Change<f32, N>>,
    update: Option<Update<f32, N, B>>,
}

impl<const N: usize, const B: usize> ModelMonitor<N, B> {
    /// Creates the state without a model.
    pub fn new<const TAPS: usize>(low_pass: &LowPass<f32, TAPS>, settings: MonitorSettings<f32>) -> Self {
        Self {
            baseline: None,
            monitor: Monitor::new(low_pass, &settings),
            settings,
            phase: Phase::Watching,
            change: None,
            update: None,
        }
    }

    /// Sets an accepted model.
    pub fn accept(&mut self, baseline: Baseline<f32, N, B>) {
        self.baseline = Some(baseline);
        self.begin();
    }

    /// Discards the accepted model, because another one is in use.
    pub fn forget(&mut self) {
        self.baseline = None;
        self.begin();
    }

    /// Starts a motion; the findings of earlier ones are discarded.
    pub(crate) fn begin(&mut self) {
        self.monitor.clear();
        self.phase = Phase::Watching;
        (self.change, self.update) = (None, None);
    }

    /// Processes the rows of one instant. After an alarm the caller must restart the record.
    pub(crate) fn watch(&mut self, rows: &FilteredRows<f32, N, B>) -> Option<Change<f32, N>> {
        if self.phase != Phase::Watching {
            return None;
        }
        self.change = self.monitor.push(self.baseline.as_ref()?, rows);
        if self.change.is_some() {
            self.phase = Phase::Collecting;
        }
        self.change
    }

    /// Whether each joint has enough rows, recorded since the alarm, for the update.
    pub(crate) fn is_ready(&mut self, rows: &[u32; N]) -> bool {
        if matches!(self.phase, Phase::Collecting | Phase::Offered)
            && rows.iter().all(|&rows| rows >= UPDATE_ROWS)
        {
            self.phase = Phase::Solving;
        }
        self.phase == Phase::Solving
    }

    /// Runs the quick pass on the record since the alarm.
    pub fn solve(
        &mut self,
        model: &RowModel<f32, N, B>,
        record: &Record<f32, N, B>,
        thresholds: &Thresholds<f32>,
    ) -> Option<&Update<f32, N, B>> {
        let baseline = self.baseline.as_ref()?;
        let silent = self.settings.silent_energy();
        let update = Update::new(model, baseline, record, thresholds, silent);
        self.phase = match update.cause {
            Cause::Payload { .. } | Cause::Friction => Phase::Offered,
            Cause::Unexplained => Phase::Collecting,
            Cause::Nothing => {
                self.monitor.clear();
                self.change = None;
                Phase::Watching
            }
        };
        self.update = Some(update);
        self.update.as_ref()
    }

    /// Uses the update; from now on it is the monitored model.
    pub(crate) fn take(&mut self) {
        let updated = match (&self.update, &self.baseline) {
            (Some(update), Some(before)) => update.baseline(before),
            _ => None,
        };
        if let Some(baseline) = updated {
            self.accept(baseline);
        }
    }

    /// Returns the monitored model, if there is one.
    pub fn baseline(&self) -> Option<&Baseline<f32, N, B>> {
        self.baseline.as_ref()
    }

    /// Returns the monitor, with its sums and their limit.
    pub fn monitor(&self) -> &Monitor<f32, N> {
        &self.monitor
    }

    /// Returns the alarm of this motion.
    pub fn change(&self) -> Option<&Change<f32, N>> {
        self.change.as_ref()
    }

    /// Returns the last result of the quick pass in this motion.
    pub fn update(&self) -> Option<&Update<f32, N, B>> {
        self.update.as_ref()
    }
}
