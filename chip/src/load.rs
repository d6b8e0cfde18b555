//! Use of the processor: time and instructions of every exception level, latencies, sleep.
//!
//! The time of an interrupt is its own: without the interrupts that preempt it, from its entry to its return.

use crate::nvic::EXCEPTIONS;
use crate::time::Ticks;

/// Exception of the current loops.
pub const CURRENT_INTERRUPT: u8 = 16 + 18;
/// Name of the current loops' interrupt in [`LEVELS`].
pub const CURRENT: &str = "current_interrupt";
/// Exception of the servo.
pub const SERVO: u8 = 16 + 77;

/// Name of the servo's interrupt in [`LEVELS`].
pub const SERVO_NAME: &str = "servo";

/// Interrupts of the image: name, exception number.
pub const LEVELS: [(&str, u8); 10] = [
    ("stop", 16 + 10),
    (CURRENT, CURRENT_INTERRUPT),
    ("index_0", 16 + 23),
    ("index_1", 16 + 40),
    (SERVO_NAME, SERVO),
    ("clock", 16 + 50),
    ("bus_receive", 16 + 20),
    ("bus", 16 + 19),
    ("assist", 16 + 67),
    ("housekeeping", 16 + 72),
];

/// Use by one exception; 0 is the thread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Use {
    pub entries: u64,
    /// Own time.
    pub ticks: Ticks,
    /// Own instructions in all.
    pub instructions: u64,
    /// Most instructions of one entry.
    pub worst: u64,
    /// Longest time from pending to entry.
    pub latency: Ticks,
    /// Longest time from entry to return, preemption included.
    pub longest: Ticks,
}

/// An exception in progress.
#[derive(Clone, Copy, Debug)]
struct Frame {
    exception: usize,
    begun: Ticks,
    instructions: u64,
}

/// Use of the processor since the last [`Load::clear`].
#[derive(Clone, Debug, Default)]
pub struct Load {
    pub instructions: u64,
    pub asleep: Ticks,
    uses: Vec<Use>,
    frames: Vec<Frame>,
    since: Ticks,
    counted: u64,
    cleared: Ticks,
}

impl Load {
    pub fn new() -> Self {
        Self { uses: vec![Use::default(); EXCEPTIONS], ..Self::default() }
    }

    /// Starts a new measurement; exceptions in progress continue.
    pub fn clear(&mut self, now: Ticks) {
        self.settle(now);
        self.uses.fill(Use::default());
        (self.asleep, self.cleared) = (0, now);
    }

    /// Discards exceptions in progress, as a reset does.
    pub fn reset(&mut self, now: Ticks) {
        self.settle(now);
        self.frames.clear();
    }

    fn settle(&mut self, now: Ticks) {
        let exception = self.frames.last().map_or(0, |frame| frame.exception);
        let instructions = self.instructions - self.counted;
        let used = &mut self.uses[exception];
        used.ticks += now - self.since;
        used.instructions += instructions;
        if let Some(frame) = self.frames.last_mut() {
            frame.instructions += instructions;
        }
        (self.since, self.counted) = (now, self.instructions);
    }

    /// Enters an exception that was pending since an instant.
    pub fn enter(&mut self, exception: u8, pended: Ticks, now: Ticks) {
        self.settle(now);
        let exception = usize::from(exception);
        let used = &mut self.uses[exception];
        used.entries += 1;
        used.latency = used.latency.max(now.saturating_sub(pended));
        self.frames.push(Frame { exception, begun: now, instructions: 0 });
    }

    /// Leaves the newest exception.
    pub fn leave(&mut self, now: Ticks) {
        self.settle(now);
        let Some(frame) = self.frames.pop() else { return };
        let used = &mut self.uses[frame.exception];
        used.worst = used.worst.max(frame.instructions);
        used.longest = used.longest.max(now - frame.begun);
    }

    pub fn sleep(&mut self, duration: Ticks) {
        self.asleep += duration;
        // The thread sleeps; its own time does not include it.
        self.since += duration;
    }

    /// Use by an exception since the last [`Load::clear`].
    pub fn usage(&self, exception: u8) -> Use {
        self.uses[usize::from(exception)]
    }

    /// Share of the time since the last [`Load::clear`] that an exception used.
    pub fn share(&self, exception: u8, now: Ticks) -> f64 {
        self.usage(exception).ticks as f64 / (now - self.cleared).max(1) as f64
    }

    /// Time since the last [`Load::clear`].
    pub fn measured(&self, now: Ticks) -> Ticks {
        (now - self.cleared).max(1)
    }

    /// Share of the time since the last [`Load::clear`] in which the processor was awake.
    pub fn awake(&self, now: Ticks) -> f64 {
        1.0 - self.asleep as f64 / (now - self.cleared).max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_of_an_interrupt_excludes_preempting_ones() {
        let mut load = Load::new();
        load.enter(77, 90, 100);
        load.instructions = 10;
        load.enter(34, 110, 120);
        load.instructions = 15;
        load.leave(125);
        load.instructions = 22;
        load.leave(150);
        load.sleep(50);
        load.settle(200);
        let servo = load.usage(77);
        assert_eq!((servo.ticks, servo.worst, servo.latency, servo.longest), (45, 17, 10, 50));
        assert_eq!((load.usage(34).ticks, load.usage(34).worst), (5, 5));
        assert_eq!((load.asleep, load.usage(0).ticks), (50, 100));
    }
}
