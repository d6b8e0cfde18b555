//! What becomes of an accepted model while the leg moves: watched, and brought up to date after a change.
//!
//! ```text
//!   Watching --alarm--> Collecting --enough rows--> Solving --a change--> Offered --enough rows--> Solving
//!      ^                    ^                          |  |                  |
//!      |                    +------- unexplained ------+  |                  |
//!      +--------------- nothing changed ------------------+                  |
//!      +---------------------- the operator takes the update ---------------+
//! ```
//!
//! Only a motion that is tracked is watched, and only a model that was accepted. Rows from before the alarm are not used
//! for the update: some are from before the change. Nothing here touches the servo: an update is offered, and taken into
//! use by a request of the operator. Where nothing explains the rows, something may have happened meanwhile: the next ones
//! are tried, as long as the motion lasts. An offer is made anew from every further 600 rows, and withdrawn where they no longer
//! show the change: a bag may be taken off again.

use crate::ident::{
    Baseline, Cause, Change, FilteredRows, LowPass, Monitor, MonitorSettings, Record, RowModel, Thresholds,
    Update,
};

/// Moving rows of every joint that an update is made from: 12 s at 50 Hz, some 15 s of gait with a 3 s cycle. A payload
/// of 3 kg is then known to 0.6 % (one standard deviation, default leg).
pub const UPDATE_ROWS: u32 = 600;

/// Where the watch stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Watching,
    Collecting,
    Solving,
    Offered,
}

/// Monitor, quick pass and the model they refer to.
#[derive(Clone, Debug, PartialEq)]
pub struct Upkeep<const N: usize, const B: usize> {
    baseline: Option<Baseline<f32, N, B>>,
    monitor: Monitor<f32, N>,
    settings: MonitorSettings<f32>,
    phase: Phase,
    change: Option<Change<f32, N>>,
    update: Option<Update<f32, N, B>>,
}

impl<const N: usize, const B: usize> Upkeep<N, B> {
    /// No model yet.
    #[must_use]
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

    /// A model was accepted.
    pub fn accept(&mut self, baseline: Baseline<f32, N, B>) {
        self.baseline = Some(baseline);
        self.begin();
    }

    /// The accepted model is no longer the one in use.
    pub fn forget(&mut self) {
        self.baseline = None;
        self.begin();
    }

    /// A motion begins: what was found in an earlier one is forgotten.
    pub fn begin(&mut self) {
        self.monitor.clear();
        self.phase = Phase::Watching;
        (self.change, self.update) = (None, None);
    }

    /// Takes the rows of one instant. An alarm wants the record begun anew.
    pub fn watch(&mut self, rows: &FilteredRows<f32, N, B>) -> Option<Change<f32, N>> {
        if self.phase != Phase::Watching {
            return None;
        }
        self.change = self.monitor.push(self.baseline.as_ref()?, rows);
        if self.change.is_some() {
            self.phase = Phase::Collecting;
        }
        self.change
    }

    /// Whether these many rows of each joint, recorded since the alarm, are enough for the update.
    pub fn is_ready(&mut self, rows: &[u32; N]) -> bool {
        if matches!(self.phase, Phase::Collecting | Phase::Offered)
            && rows.iter().all(|&rows| rows >= UPDATE_ROWS)
        {
            self.phase = Phase::Solving;
        }
        self.phase == Phase::Solving
    }

    /// The quick pass on what was recorded since the alarm.
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

    /// The operator takes the update into use: from now on it is what is watched.
    pub fn take(&mut self) {
        let updated = match (&self.update, &self.baseline) {
            (Some(update), Some(before)) => update.baseline(before),
            _ => None,
        };
        if let Some(baseline) = updated {
            self.accept(baseline);
        }
    }

    /// The accepted model that is watched, if there is one.
    #[must_use]
    pub fn baseline(&self) -> Option<&Baseline<f32, N, B>> {
        self.baseline.as_ref()
    }

    /// The sums and their limit.
    #[must_use]
    pub fn monitor(&self) -> &Monitor<f32, N> {
        &self.monitor
    }

    /// The alarm of this motion.
    #[must_use]
    pub fn change(&self) -> Option<&Change<f32, N>> {
        self.change.as_ref()
    }

    /// What the quick pass found last in this motion.
    #[must_use]
    pub fn update(&self) -> Option<&Update<f32, N, B>> {
        self.update.as_ref()
    }
}
