//! Statistics of loops, stack and supply over a whole trace.

use scarab_identify::report::trace::LoopReport;

use crate::trace::records::{Loops, Supply};

/// Range of the supply, and highest temperatures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SupplySeen {
    /// Lowest bus voltage, V.
    pub(crate) low_v: f32,
    /// Highest bus voltage, V.
    pub(crate) high_v: f32,
    /// Hottest bridge, degrees Celsius.
    pub(crate) bridge_c: f32,
    /// Temperature of the brake chopper, degrees Celsius.
    pub(crate) chopper_c: f32,
    /// Hottest winding by its model, degrees Celsius.
    pub(crate) winding_c: f32,
}

/// Collects the records of loops and supply.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Statistics {
    /// Sums over earlier starts.
    before: LoopReport,
    now: Option<LoopReport>,
    seen: bool,
    supply: Option<SupplySeen>,
}

impl Statistics {
    /// Takes a record of the loops.
    pub fn take(&mut self, loops: &Loops) {
        let now = self.now.unwrap_or_default();
        self.seen = true;
        self.now = Some(LoopReport {
            current_worst: now.current_worst.max(loops.current_worst),
            servo_worst: now.servo_worst.max(loops.servo_worst),
            current_missed: loops.current_missed,
            servo_missed: loops.servo_missed,
            cycles_per_tick: loops.cycles_per_tick,
            stack_used: now.stack_used.max(loops.stack_used),
            stack_bytes: loops.stack_bytes,
            samples_lost: loops.samples_lost,
            records_lost: loops.records_lost,
        });
    }

    /// Takes a record of the supply; values that are not numbers are ignored.
    pub(crate) fn take_supply(&mut self, supply: &Supply) {
        let before = self.supply.unwrap_or(SupplySeen {
            low_v: f32::NAN,
            high_v: f32::NAN,
            bridge_c: f32::NAN,
            chopper_c: f32::NAN,
            winding_c: f32::NAN,
        });
        let windings = supply.winding_c.as_deref().unwrap_or_default();
        self.supply = Some(SupplySeen {
            low_v: before.low_v.min(supply.bus_low_v),
            high_v: before.high_v.max(supply.bus_high_v),
            bridge_c: supply.bridge_c.iter().copied().fold(before.bridge_c, f32::max),
            chopper_c: before.chopper_c.max(supply.chopper_c),
            winding_c: windings.iter().copied().fold(before.winding_c, f32::max),
        });
    }

    /// Starts a new count: the board restarted and its counts begin at zero.
    pub(crate) fn restart(&mut self) {
        if let Some(all) = self.loops() {
            self.before = all;
        }
        self.now = None;
    }

    /// Statistics over all starts; `None` without a record.
    pub fn loops(&self) -> Option<LoopReport> {
        if !self.seen {
            return None;
        }
        let before = self.before;
        let now = self.now.unwrap_or(LoopReport {
            current_missed: 0,
            servo_missed: 0,
            samples_lost: 0,
            records_lost: 0,
            ..before
        });
        Some(LoopReport {
            current_worst: before.current_worst.max(now.current_worst),
            servo_worst: before.servo_worst.max(now.servo_worst),
            current_missed: before.current_missed.saturating_add(now.current_missed),
            servo_missed: before.servo_missed.saturating_add(now.servo_missed),
            cycles_per_tick: now.cycles_per_tick,
            stack_used: before.stack_used.max(now.stack_used),
            stack_bytes: now.stack_bytes,
            samples_lost: before.samples_lost.saturating_add(now.samples_lost),
            records_lost: before.records_lost.saturating_add(now.records_lost),
        })
    }

    /// Description, a line each.
    pub fn lines(&self) -> Vec<String> {
        let mut lines = Vec::new();
        if let Some(loops) = self.loops() {
            let share = |worst: u32, periods: f64| {
                if loops.cycles_per_tick == 0 {
                    return String::new();
                }
                format!(" ({:.1} %)", 100.0 * periods * f64::from(worst) / f64::from(loops.cycles_per_tick))
            };
            lines.push(format!(
                "loops: worst servo tick {} of {} cycles{}, worst current tick {}; missed: servo {}, current {}",
                loops.servo_worst,
                loops.cycles_per_tick,
                share(loops.servo_worst, 1.0),
                loops.current_worst,
                loops.servo_missed,
                loops.current_missed
            ));
            lines.push(format!(
                "stack: {} of {} bytes; not taken in time: samples {}, records {}",
                loops.stack_used, loops.stack_bytes, loops.samples_lost, loops.records_lost
            ));
        }
        if let Some(supply) = self.supply {
            // A board without a thermistor sends NaN, and an older image no windings.
            let celsius = |value: f32| if value.is_nan() { "-".into() } else { format!("{value:.0}") };
            lines.push(format!(
                "supply: {:.1} to {:.1} V; hottest: bridges {}, chopper {}, windings {} degrees Celsius",
                supply.low_v,
                supply.high_v,
                celsius(supply.bridge_c),
                celsius(supply.chopper_c),
                celsius(supply.winding_c)
            ));
        }
        lines
    }

    /// Warnings: missed ticks, lost samples and records.
    pub fn complaints(&self) -> Vec<String> {
        let Some(loops) = self.loops() else { return Vec::new() };
        let missed = [("servo", loops.servo_missed), ("current", loops.current_missed)];
        let missed = missed.into_iter().filter(|(_, count)| *count > 0);
        let mut words: Vec<String> =
            missed.map(|(name, count)| format!("{count} {name} ticks were MISSED")).collect();
        if loops.samples_lost > 0 {
            words.push(format!("identification LOST {} samples of the log", loops.samples_lost));
        }
        if loops.records_lost > 0 {
            words.push(format!("the board dropped {} records because no host read them", loops.records_lost));
        }
        words
    }
}
