//! Instants of both bridges and both converters' samples, by replaying the start on simulated timers.

use core::f64::consts::TAU;

use hal_sim::drive::description::SHIFT_QUARTERS;
use hal_sim::drive::description::ShuntDescription;
use scarab::board::odrive_v3_6::settings::drives::DEAD_TIME_BAND;
use scarab::board::odrive_v3_6::settings::{FAST_TIMER_HZ, SLOW_TIMER_HZ, converters, prepare, timers};
use scarab::hal::SHUNT_TRIGGER_CLOCKS;
use scarab::motor::{BridgeTiming, DeadTime, Modulator, Stationary};
use scarab::real::sin_cos;
use scarab::units::{Ampere, Volt};

use super::timer::Bridges;
use super::{ADC, TIM1, TIM8, started};

/// Clocks of a PWM period.
const PERIOD: i64 = 7000;
/// Bus voltage, V.
const BUS: f64 = 48.0;
/// Time before the hold in which an edge affects the sample, clocks: 1.2 us, in which an amplifier settles to
/// 1 %.
const WINDOW: i64 = 202;
/// Delay from a timer's edge to the turning-on switch, clocks: the dead time.
const DEAD: i64 = 20;

/// Instants of each bridge in two PWM periods, in clocks.
#[derive(Default)]
struct Instants {
    /// Counter at zero: the middle of the lower zero vector.
    middles: [Vec<i64>; 2],
    /// Triggers of the converters.
    triggers: [Vec<i64>; 2],
    /// Edges of the reference of output A's high side.
    switchings: [Vec<i64>; 2],
}

/// Replays the start.
fn instants() -> Instants {
    let mut bridges = Bridges::new([TIM1, TIM8]);
    prepare(|writes| bridges.apply(writes));
    bridges.apply(&timers::LOCK_AND_START);
    (0..50).for_each(|_| bridges.clock());
    bridges.apply(&timers::TRIGGERS);
    for axis in 0..2 {
        while !(bridges.timers[axis].falling && (875..2625).contains(&bridges.timers[axis].counter)) {
            bridges.clock();
        }
        bridges.apply(&[timers::repetition(axis)]);
    }
    (0..2 * PERIOD).for_each(|_| bridges.clock());
    // Edge of the trigger: bits 20 and 21 of CR2 for TIM1's injected conversions, 28 and 29 for TIM8's
    // regular ones.
    let registers = started();
    let edges = [registers.bits(ADC[2] + 0x08, 20, 2), registers.bits(ADC[2] + 0x08, 28, 2)];
    let mut found = Instants::default();
    let mut before = levels(&bridges);
    for _ in 0..2 * PERIOD {
        bridges.clock();
        let (now, after) = (bridges.now as i64, levels(&bridges));
        for axis in 0..2 {
            if bridges.timers[axis].counter == 0 {
                found.middles[axis].push(now);
            }
            let ([trigger, high], [triggered, switched]) = (before[axis], after[axis]);
            let (rose, fell) = (!trigger && triggered, trigger && !triggered);
            if rose && edges[axis] & 0b01 != 0 || fell && edges[axis] & 0b10 != 0 {
                found.triggers[axis].push(now);
            }
            if high != switched {
                found.switchings[axis].push(now);
            }
        }
        before = after;
    }
    found
}

/// Trigger output (reference of channel 4) and high side of A of each bridge.
fn levels(bridges: &Bridges) -> [[bool; 2]; 2] {
    [0, 1].map(|axis| [bridges.timers[axis].reference(3), bridges.timers[axis].reference(0)])
}

/// Clocks from `middle` to `instant`, modulo the period, from minus to plus half a period.
fn after(instant: i64, middle: i64) -> i64 {
    (instant - middle + PERIOD / 2).rem_euclid(PERIOD) - PERIOD / 2
}

/// Clocks from the middle of an axis' lower zero vector to the trigger, signed; one trigger a period.
fn trigger_of(instants: &Instants, axis: usize) -> i64 {
    let [first, second] = instants.triggers[axis][..] else {
        panic!("axis {axis}: {} triggers in two periods", instants.triggers[axis].len());
    };
    assert_eq!(second - first, PERIOD);
    after(first, instants.middles[axis][0])
}

/// Clocks from the trigger to the hold: the sampling time of the converters.
fn sampling() -> i64 {
    let registers = started();
    assert_eq!([0x0C, 0x10].map(|sample_time| registers.at(ADC[2] + sample_time)), [0, 0], "3 cycles");
    let divider = 2 * (registers.bits(0x4001_2304, 16, 2) + 1);
    let clocks_a_cycle = FAST_TIMER_HZ / (SLOW_TIMER_HZ / divider);
    assert_eq!(SLOW_TIMER_HZ / divider, converters::CLOCK_HZ);
    3 * i64::from(clocks_a_cycle)
}

#[test]
fn converters_start_119_ns_after_the_middle_of_the_lower_zero_vector() {
    let instants = instants();
    let clock = f64::from(FAST_TIMER_HZ);
    for axis in 0..2 {
        let trigger = trigger_of(&instants, axis);
        assert_eq!(trigger, i64::from(SHUNT_TRIGGER_CLOCKS), "axis {axis}");
        assert!((trigger as f64 / clock - 119e-9).abs() < 1e-10, "axis {axis}: {trigger} clocks");
        // Plant and modulator use the same instant.
        let hold = (trigger + sampling()) as f64 / clock;
        assert!((hold - ShuntDescription::default().delay).abs() < 1e-12, "axis {axis}: hold after {hold} s");
        let converted = trigger as f64 / clock + 15.0 / f64::from(converters::CLOCK_HZ);
        assert!((converted - f64::from(BridgeTiming::ODRIVE_3_6.conversion.0)).abs() < 1e-12);
    }
}

/// Clocks from the middles of the first bridge to those of the second.
fn shift(instants: &Instants) -> i64 {
    (instants.middles[1][0] - instants.middles[0][0]).rem_euclid(PERIOD)
}

#[test]
fn the_bridges_run_half_a_period_apart() {
    let instants = instants();
    assert_eq!(shift(&instants), PERIOD / 2);
    assert_eq!(PERIOD * i64::from(SHIFT_QUARTERS) / 4, PERIOD / 2, "the simulated drives");
    for axis in 0..2 {
        assert_eq!(instants.middles[axis].len(), 2, "one lower zero vector a period");
        // Duties of one half: up at a quarter, down at three quarters of the period, which begins
        // at the middle.
        let middle = instants.middles[axis][0];
        let mut switchings: Vec<i64> =
            instants.switchings[axis].iter().map(|instant| after(*instant, middle)).collect();
        switchings.sort_unstable();
        assert_eq!(switchings, [-1750, -1750, 1750, 1750]);
    }
    // The start's own check, three loads some 20 clocks apart, and a shift of a quarter.
    assert!(timers::half_a_period_apart([2000, 1520, 1960]));
    assert!(timers::half_a_period_apart([2000, 1500 + 31, 2000]));
    assert!(!timers::half_a_period_apart([2000, 1500 + 33, 2000]));
    assert!(!timers::half_a_period_apart([2000, 250, 1960]));
}

/// Conditions for counting edges of the other bridge.
#[derive(Clone, Copy)]
struct Count {
    /// Clocks between the middles of both bridges.
    shift: i64,
    /// Clocks from the middle to the hold.
    hold: i64,
    dead_time: DeadTime,
    /// Delays from a timer's edge to the counted output edges, clocks.
    switching: &'static [i64],
}

impl Count {
    /// The board: dead time compensated, both instants at which a half bridge may switch.
    fn of_the_board() -> Self {
        let instants = instants();
        Self {
            shift: shift(&instants),
            hold: trigger_of(&instants, 0) + sampling(),
            dead_time: DeadTime::Compensated { band: DEAD_TIME_BAND },
            switching: &[0, DEAD],
        }
    }

    fn modulator(&self) -> Modulator {
        Modulator::new(BridgeTiming::ODRIVE_3_6, self.dead_time).expect("usual")
    }

    fn limit(&self) -> f64 {
        f64::from(self.modulator().voltage_limit(Volt(BUS as f32)).0)
    }

    /// Compare values for a voltage and a current of 60 A, by their directions; `None` is no current.
    fn compare(&self, modulator: &Modulator, volt: f64, angle: f64, current: Option<f64>) -> [i64; 3] {
        let at = |length: f64, angle: f64| {
            let (sine, cosine) = sin_cos(angle);
            [(length * cosine) as f32, (length * sine) as f32]
        };
        let [alpha, beta] = at(volt, angle).map(Volt);
        let target = current.map_or([0.0; 2], |current| at(60.0, current)).map(Ampere);
        let target = Stationary { alpha: target[0], beta: target[1] };
        let duties = modulator.duties(Stationary { alpha, beta }, 1.0 / BUS as f32, target);
        duties.map(|duty| i64::from(timers::compare(duty)))
    }

    /// Whether an edge of a bridge with these compare values lies in the other bridge's window before its
    /// hold. The other's middles come `shift` clocks before its own.
    fn disturbs(&self, compare: [i64; 3], shift: i64) -> bool {
        let edges = compare.into_iter().filter(|value| (1..3500).contains(value));
        edges.flat_map(|value| [value, PERIOD - value]).any(|edge| {
            let before_hold = |later: i64| self.hold - after(edge + later, -shift);
            self.switching.iter().any(|later| (0..=WINDOW).contains(&before_hold(*later)))
        })
    }

    /// Share of periods in which the other bridge disturbs: greatest of both axes, without current and with
    /// currents of all directions.
    fn share(&self, volt: f64) -> f64 {
        const ANGLES: u32 = 720;
        let modulator = self.modulator();
        let share = |shift: i64, current: Option<f64>| {
            let angles = (0..ANGLES).map(|number| TAU / f64::from(ANGLES) * f64::from(number));
            let disturbed = angles.filter(|angle| {
                let current = current.map(|current| angle + current);
                self.disturbs(self.compare(&modulator, volt, *angle, current), shift)
            });
            disturbed.count() as f64 / f64::from(ANGLES)
        };
        let directions = (0..12).map(|direction| Some(TAU / 12.0 * f64::from(direction))).chain([None]);
        let shares =
            directions.flat_map(|current| [self.shift, -self.shift].map(|shift| share(shift, current)));
        shares.fold(0.0, f64::max)
    }

    /// Highest voltage (in steps of 0.1 V) up to which no period is disturbed, and the greatest
    /// share above it.
    fn quiet_up_to(&self) -> (f64, f64) {
        let steps = (10.0 * self.limit()) as u32;
        let shares: Vec<f64> = (0..=steps).map(|step| self.share(0.1 * f64::from(step))).collect();
        let quiet = shares.iter().take_while(|share| **share == 0.0).count();
        assert!(quiet > 0, "disturbed even at zero voltage");
        let most = shares[quiet..].iter().fold(self.share(self.limit()), |most, share| most.max(*share));
        (0.1 * (quiet - 1) as f64, most)
    }
}

#[test]
fn the_other_bridge_s_edges_miss_the_sample_up_to_24_volts() {
    let board = Count::of_the_board();
    let (quiet, most) = board.quiet_up_to();
    let (limit, percent) = (board.limit(), 1e2 * most);
    println!(
        "board: no edge up to {quiet:.1} V of {limit:.2} V; above in up to {percent:.1} % of the periods"
    );
    // Edges of the timers alone, with the duties of a bridge without dead-time compensation.
    let plain = Count { dead_time: DeadTime::Uncompensated, switching: &[0], ..board };
    let (timers_alone, most_alone) = plain.quiet_up_to();
    println!("timers' edges alone: {timers_alone:.1} V of {:.2} V, {:.1} %", plain.limit(), 1e2 * most_alone);
    assert!((24.25..24.35).contains(&quiet), "{quiet}");
    assert!((24.65..24.75).contains(&timers_alone), "{timers_alone}");
    assert!((0.5..0.7).contains(&most) && (0.5..0.7).contains(&most_alone), "{most} {most_alone}");
}
