//! Holds a source at the speed of the clock.

use std::thread;
use std::time::{Duration, Instant};

use scarab::servo::SERVO_RATE_HZ;
use scarab_base::number::Number;
use scarab_rig::bus::board::TICK_NS;
use scarab_rig::bus::pace::Pace;

use crate::live::report::RATE_HZ;

/// Servo ticks between two looks at the clock: one period of the picture.
pub(crate) const PERIOD_TICKS: u64 = (SERVO_RATE_HZ / RATE_HZ) as u64;
/// Longest sleep between two looks.
const NAP: Duration = Duration::from_millis(2);

/// Clock of a source.
pub(crate) struct Clock {
    pace: Pace,
    nap: Duration,
    /// Seconds of the source per second, over the last second.
    pub(crate) measured: Number,
}

impl Clock {
    /// Starts a clock with this many seconds of the source per second.
    pub fn new(speed: f64) -> Self {
        let period = Duration::from_nanos(PERIOD_TICKS * TICK_NS).div_f64(4.0 * speed);
        let pace = Pace::new(speed, Instant::now(), 0);
        Self { pace, nap: period.min(NAP), measured: Number::UNKNOWN }
    }

    /// Waits until the clock has reached this time of the source. A source that is late does not catch up.
    pub(crate) fn wait(&mut self, ticks: u64) {
        let now_ns = ticks * TICK_NS;
        loop {
            let now = Instant::now();
            if let Some(second) = self.pace.second(now, now_ns) {
                self.measured = second.speed.into();
            }
            if self.pace.due(now, now_ns) > 0 {
                return;
            }
            thread::sleep(self.nap);
        }
    }
}
