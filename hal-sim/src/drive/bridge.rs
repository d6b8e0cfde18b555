//! Three half bridges: conduction of each switch, to the nanosecond.
//!
//! ```text
//!  one PWM period of length T, from one middle of the lower zero vector (all low sides conduct) to the next
//!
//!  reference  ____________|^^^^^^^^^^^^^^^|____________      up at T (1 - duty)/2, down at T (1 + duty)/2
//!  high side  _______________|^^^^^^^^^^^^|____________      on one dead time after the reference's rise
//!  low side   ^^^^^^^^^^^^|__________________|^^^^^^^^^      on one dead time after its fall
//!             ^ sample, new duty                        ^
//! ```
//!
//! While both switches of a leg are off, its diodes conduct. A positive current then sees a pulse shorter by
//! the dead time, a negative one a longer pulse. Nothing is averaged: [`Bridge::next_edge`] returns the next
//! change, and between edges everything is constant. The duty is rounded to the timer's steps.
//! Source: centre-aligned PWM with preload and dead time, as in the advanced timers of the STM32F405
//! (reference manual RM0090, chapter 17).
//! Cost: the edges are sorted once a period, 12 of them; then some five operations per edge.
//! Known limits: switches change instantly.

use super::description::BridgeDescription;
use super::motor::Terminal;
use crate::maths::nearest;
use scarab::hal::AxisCommand;

/// One half bridge within a period; times from the beginning of the period, s.
#[derive(Clone, Copy, Debug, PartialEq)]
struct HalfBridge {
    /// State of the reference: high side requested.
    high: bool,
    /// Whether the requested switch conducts.
    conducting: bool,
    /// Time from which the requested switch conducts; negative if it conducts since an earlier period.
    conducts_from: f64,
    /// Both edges of the period, past ones too: rise and fall.
    edges: [f64; 2],
}

/// Change of a half bridge.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Change {
    /// The reference rises or falls: both switches are off from now on.
    Edge { high: bool },
    /// The dead time ends: the requested switch conducts.
    Conduction,
}

/// Change of one output at a time of the period, s.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Event {
    time: f64,
    output: usize,
    change: Change,
}

/// Most events in a period: a dead time that the last period began, two edges and two ends of dead time for
/// each output.
const MOST_EVENTS: usize = 15;

/// Events of a period in the order of their times.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Schedule {
    events: [Event; MOST_EVENTS],
    count: usize,
    next: usize,
}

impl Schedule {
    const EMPTY: Self = Self {
        events: [Event { time: 0.0, output: 0, change: Change::Conduction }; MOST_EVENTS],
        count: 0,
        next: 0,
    };

    fn insert(&mut self, event: Event) {
        let mut at = self.count.min(MOST_EVENTS - 1);
        while at > 0 && self.events[at - 1].time > event.time {
            self.events[at] = self.events[at - 1];
            at -= 1;
        }
        self.events[at] = event;
        self.count = (self.count + 1).min(MOST_EVENTS);
    }

    /// First event that has not been processed.
    fn first(&self) -> Option<&Event> {
        self.events[..self.count].get(self.next)
    }
}

/// Three half bridges and their state within the period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bridge {
    description: BridgeDescription,
    period: f64,
    enabled: bool,
    legs: [HalfBridge; 3],
    schedule: Schedule,
}

/// Time that is sufficient for amplifiers to settle, s.
const LONG: f64 = 1.0;

impl Bridge {
    /// A bridge with outputs off, for a period of this length, s.
    pub fn new(description: &BridgeDescription, period: f64) -> Self {
        let leg =
            HalfBridge { high: false, conducting: true, conducts_from: -LONG, edges: [f64::INFINITY; 2] };
        Self { description: *description, period, enabled: false, legs: [leg; 3], schedule: Schedule::EMPTY }
    }

    /// Starts a period and applies a command; a duty of NaN counts as 0.
    pub fn begin(&mut self, command: &AxisCommand) {
        let dead_time = self.description.dead_time;
        let enabling = command.enabled && !self.enabled;
        self.enabled = command.enabled;
        self.schedule = Schedule { count: 0, next: 0, ..self.schedule };
        for (output, (leg, duty)) in self.legs.iter_mut().zip(command.duty).enumerate() {
            let steps = self.description.duty_steps;
            let duty = nearest(f64::from(duty).clamp(0.0, 1.0) * steps) as f64 / steps;
            leg.conducts_from = (leg.conducts_from - self.period).max(-LONG);
            let high = duty >= 1.0;
            if enabling || leg.high != high {
                leg.conducts_from = dead_time;
            }
            leg.high = high;
            leg.conducting = leg.conducts_from <= 0.0;
            let [rise, fall] = if duty > 0.0 && !high {
                [0.5 * (1.0 - duty) * self.period, 0.5 * (1.0 + duty) * self.period]
            } else {
                [f64::INFINITY; 2]
            };
            leg.edges = [rise, fall];
            let mut insert = |time, change| self.schedule.insert(Event { time, output, change });
            if !leg.conducting && leg.conducts_from < rise {
                insert(leg.conducts_from, Change::Conduction);
            }
            if rise < fall {
                insert(rise, Change::Edge { high: true });
                // A pulse shorter than the dead time never conducts.
                if rise + dead_time < fall {
                    insert(rise + dead_time, Change::Conduction);
                }
                insert(fall, Change::Edge { high: false });
                insert(fall + dead_time, Change::Conduction);
            }
        }
    }

    /// Processes edges up to `now`.
    pub fn pass(&mut self, now: f64) {
        while let Some(&Event { time, output, change }) =
            self.schedule.first().filter(|event| event.time <= now)
        {
            let leg = &mut self.legs[output];
            match change {
                Change::Edge { high } => {
                    (leg.high, leg.conducting, leg.conducts_from) =
                        (high, false, time + self.description.dead_time);
                }
                Change::Conduction => leg.conducting = true,
            }
            self.schedule.next += 1;
        }
    }

    /// Time of the next change, at most `end`.
    pub fn next_edge(&self, end: f64) -> f64 {
        match self.schedule.first() {
            Some(event) if self.enabled => event.time.min(end),
            _ => end,
        }
    }

    /// Connection of an output since the last change, at this bus voltage.
    pub fn output(&self, output: usize, bus: f64) -> Terminal {
        let Some(leg) = self.legs.get(output) else { return Terminal::Held(0.0) };
        if !self.enabled || !leg.conducting {
            return Terminal::Off(-self.description.diode_drop, bus + self.description.diode_drop);
        }
        Terminal::Held(if leg.high { bus } else { 0.0 })
    }

    /// Time for which an output's low side has been conducting at `now`, s; `None` if it does not.
    pub(crate) fn low_side_time(&self, output: usize, now: f64) -> Option<f64> {
        let leg = self.legs.get(output)?;
        (self.enabled && !leg.high && leg.conducts_from <= now).then_some(now - leg.conducts_from)
    }

    /// Rising less falling edges between two instants of the period, s. An edge takes as long as the dead
    /// time: the current decides at which end of it the output switches.
    pub fn edges(&self, from: f64, to: f64) -> i32 {
        let within = |edge: f64| i32::from(edge <= to && edge + self.description.dead_time >= from);
        let of_leg = |leg: &HalfBridge| within(leg.edges[0]) - within(leg.edges[1]);
        if self.enabled { self.legs.iter().map(of_leg).sum() } else { 0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: f64 = 1.0 / 24e3;
    const BUS: f64 = 48.0;

    /// Time for which each output was high, low and off in one period.
    fn shares(bridge: &mut Bridge, duty: [f32; 3]) -> [[f64; 3]; 3] {
        bridge.begin(&AxisCommand { enabled: true, duty });
        let (mut now, mut times) = (0.0, [[0.0; 3]; 3]);
        while now < PERIOD {
            bridge.pass(now);
            let next = bridge.next_edge(PERIOD);
            for (output, times) in times.iter_mut().enumerate() {
                let state = match bridge.output(output, BUS) {
                    Terminal::Held(voltage) if voltage > 0.0 => 0,
                    Terminal::Held(_) => 1,
                    Terminal::Off(..) => 2,
                };
                times[state] += next - now;
            }
            now = next;
        }
        times
    }

    #[test]
    fn the_high_side_conducts_for_the_duty_minus_the_dead_time() {
        let description = BridgeDescription::default();
        let mut bridge = Bridge::new(&description, PERIOD);
        shares(&mut bridge, [0.5; 3]);
        let times = shares(&mut bridge, [0.25, 0.5, 0.8]);
        for (times, duty) in times.iter().zip([0.25, 0.5, 0.8]) {
            // Both edges cost a dead time, one on the high and one on the low side.
            let expected =
                [duty * PERIOD - description.dead_time, (1.0 - duty) * PERIOD - description.dead_time];
            assert!((times[0] - expected[0]).abs() < 1e-15, "{times:?}");
            assert!((times[1] - expected[1]).abs() < 1e-15, "{times:?}");
        }
    }

    #[test]
    fn extreme_duties_never_switch_and_short_pulses_vanish() {
        let mut bridge = Bridge::new(&BridgeDescription::default(), PERIOD);
        let changes = shares(&mut bridge, [1.0, 0.0, f32::NAN]);
        let steady = shares(&mut bridge, [1.0, 0.0, f32::NAN]);
        assert!(
            (changes[0][2] - 20.0 / 168e6).abs() < 1e-15,
            "not turned on after the dead time: {changes:?}"
        );
        assert_eq!(steady, [[PERIOD, 0.0, 0.0], [0.0, PERIOD, 0.0], [0.0, PERIOD, 0.0]]);
        // 5 of 3500 steps are 60 ns, half of the dead time.
        shares(&mut bridge, [5.0 / 3500.0, 1.0 - 5.0 / 3500.0, 0.5]);
        let swallowed = shares(&mut bridge, [5.0 / 3500.0, 1.0 - 5.0 / 3500.0, 0.5]);
        assert_eq!(swallowed[0][0], 0.0);
        // The low side conducts again one dead time after the pulse.
        let off = 5.0 / 3500.0 * PERIOD + 20.0 / 168e6;
        assert!((swallowed[0][2] - off).abs() < 1e-15, "{swallowed:?}");
        assert!(swallowed[1][1] < 1e-15, "{swallowed:?}");
    }

    #[test]
    fn a_disabled_bridge_is_off_in_all_outputs() {
        let mut bridge = Bridge::new(&BridgeDescription::default(), PERIOD);
        bridge.begin(&AxisCommand::OFF);
        assert_eq!(bridge.next_edge(PERIOD), PERIOD);
        assert!((0..3).all(|output| bridge.output(output, BUS) == Terminal::Off(-0.8, 48.8)));
        assert_eq!(bridge.low_side_time(1, 0.0), None);
    }
}
