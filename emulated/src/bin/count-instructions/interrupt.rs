//! The whole current interrupt, from its vector to its return.
//!
//! Counted work: read converters, contacts and counters, decide, run both axes' current loops, update queues
//! and counters of the levels, write compare values and outputs.
//!
//! One axis' tick alone is little more than half of it. The handler is the flash image's own, with memory
//! words instead of registers ([`crate::machine`]). This machine lacks such converters, so the handler serves
//! an exception that the program raises.

use cortex_m::asm::isb;
use cortex_m::peripheral::SCB;
use cortex_m_rt::exception;
use cortex_m_semihosting::hprintln;
use heapless::spsc::{Consumer, Producer, Queue};
use scarab::board::odrive_v3_6::settings::converters::{EOC, JEOC, cleared};
use scarab::board::odrive_v3_6::settings::timers::TOP;
use scarab::hal::{AxisSample, CURRENT_RATE_HZ, DriveCommand, JointSample};
use scarab::motor::{Axis, Calibration};
use scarab::operation::{AxisState, CurrentEnds, CurrentLoops, Order, Outcome, Signals, Tick};
use scarab::units::Ampere;
use spin::Mutex;
use static_cell::StaticCell;

use crate::account::{Account, percent};
use crate::axis_tick::{SPEEDS, calibrated};
use crate::counter::{Tally, count, heading};
use crate::machine::{self, Machine, REGISTERS};
use crate::motor::{CONFIGURATION, Motor};

/// Goals: instructions of one interrupt with both axes on; both axes' share of the processor, per cent.
const MOST_MEAN: u32 = 850;
const MOST_WORST: u32 = 1250;
const MOST_PERCENT: f32 = 35.0;
const AXES: usize = 2;
/// Periods at each speed: more than two checksums of the axes' constants, one in 64 ms.
const PERIODS: u32 = 3200;
/// Periods with the bridges off before, which measure the current-sensor offsets.
const REST: u32 = 240;
/// Flag above a count that was captured at an index pulse.
const SEEN: u32 = 1 << 16;

const CYCLES: core::num::NonZeroU32 = core::num::NonZeroU32::new(2 * TOP as u32).expect("not zero");

/// Queues of level 0, as the board has them.
#[derive(Default)]
struct Queues {
    orders: [Queue<Order, 3>; AXES],
    outcomes: [Queue<Outcome, 4>; AXES],
    samples: [Queue<JointSample, 4>; AXES],
}

/// State of level 0, as on the board.
struct Current {
    loops: CurrentLoops<AXES>,
    ends: CurrentEnds<'static, AXES>,
}

static LOOPS: Mutex<Option<&'static mut Current>> = Mutex::new(None);
static SIGNALS: Signals<AXES> = Signals::new();

impl Current {
    #[inline(never)]
    fn tick(&mut self, axis: usize, complete: bool) {
        let begun = REGISTERS.cycles.get();
        let [supply, b, c] = &REGISTERS.converters;
        let tick = Tick {
            now: begun,
            emergency_stop: REGISTERS.ports[0].get() >> 4 & 1 == 0,
            gate_fault: REGISTERS.ports[1].get() >> 2 & 1 == 0,
            complete,
            supply: axis != 0 || supply_finished(),
            sample: AxisSample {
                shunt_codes: [b, c].map(|one| one.results[usize::from(axis != 0)].get() as u16),
                bus_code: supply.results[0].get() as u16,
                encoder_count: REGISTERS.counters.get(axis).map_or(0, |counter| counter.get() as u16),
                index_count: index(axis),
            },
        };
        self.loops.tick(axis, &tick, &mut self.ends, &SIGNALS, &mut Machine::default());
        SIGNALS.statistics.current_worst.raise(REGISTERS.cycles.get().wrapping_sub(begun));
    }
}

#[inline(always)]
fn supply_finished() -> bool {
    let status = &REGISTERS.converters[0].status;
    let seen = status.get() & JEOC;
    status.set(cleared(seen));
    seen != 0
}

#[inline(always)]
fn index(axis: usize) -> Option<u16> {
    let slot = REGISTERS.indices.get(axis)?;
    if slot.get() == 0 {
        return None;
    }
    let taken = slot.swap(0);
    (taken & SEEN != 0).then_some(taken as u16)
}

#[inline(always)]
fn finished() -> [Option<bool>; AXES] {
    let [_, b, c] = &REGISTERS.converters;
    let status = c.status.get();
    let other = b.status.get();
    let seen = status & (JEOC | EOC);
    c.status.set(cleared(seen));
    b.status.set(cleared(seen));
    [JEOC, EOC].map(|flag| (status & flag != 0).then_some(other & flag != 0))
}

/// Interrupt of the converters.
#[exception]
fn PendSV() {
    let finished = finished();
    if let Some(mut current) = LOOPS.try_lock()
        && let Some(current) = current.as_mut()
    {
        for (axis, done) in finished.into_iter().enumerate() {
            if let Some(complete) = done {
                current.tick(axis, complete);
            }
        }
    }
}

/// Instructions of the handler alone: with the exception raised, minus the same instructions without it.
fn interrupt() -> u32 {
    let (with, ()) = count(|| {
        SCB::set_pendsv();
        isb();
    });
    let (without, ()) = count(|| {
        SCB::clear_pendsv();
        isb();
    });
    with.saturating_sub(without)
}

/// Opposite ends of level 0's queues.
struct Ends {
    orders: [Producer<'static, Order>; AXES],
    samples: [Consumer<'static, JointSample>; AXES],
}

/// Level 0 between two motors; the surrounding levels are not counted.
struct Bench {
    motors: [Motor; AXES],
    samples: [AxisSample; AXES],
    ends: Ends,
    tally: Tally,
}

impl Bench {
    /// A bench with both axes off.
    fn new(motors: [Motor; AXES]) -> Self {
        static QUEUES: StaticCell<Queues> = StaticCell::new();
        static CURRENT: StaticCell<Current> = StaticCell::new();
        let Queues { orders, outcomes, samples } = QUEUES.init(Queues::default());
        let [(order, take_order), (other_order, take_other_order)] = orders.each_mut().map(Queue::split);
        let [(sample, take_sample), (other_sample, take_other_sample)] = samples.each_mut().map(Queue::split);
        let ends = CurrentEnds {
            orders: [take_order, take_other_order],
            outcomes: outcomes.each_mut().map(|queue| queue.split().0),
            samples: [sample, other_sample],
        };
        let volt_per_code = CONFIGURATION.sense.volt_per_code;
        let loops = CurrentLoops::new([AxisState::OFF; AXES], CYCLES, None, volt_per_code);
        *LOOPS.lock() = Some(CURRENT.init(Current { loops, ends }));
        let ends = Ends { orders: [order, other_order], samples: [take_sample, take_other_sample] };
        Self { motors, samples: [AxisSample::default(); AXES], ends, tally: Tally::default() }
    }

    /// Sets the motors' speed and starts the axes with bridges off. Returns the most expensive interrupt with
    /// an order.
    fn begin(&mut self, calibrations: &[Calibration; AXES], speed_rad_per_s: f32) -> Option<u32> {
        SIGNALS.set_targets(&DriveCommand::OFF);
        self.tally = Tally::default();
        for axis in 0..AXES {
            let (motor, sample) = (self.motors.get_mut(axis)?, self.samples.get_mut(axis)?);
            (motor.driven, motor.speed_rad_per_s) = (true, speed_rad_per_s);
            *sample = motor.sample(None);
            let axis_value = Axis::new(&CONFIGURATION, calibrations.get(axis)?, sample).ok()?;
            self.ends.orders.get_mut(axis)?.enqueue(Order::Run(axis_value)).ok()?;
        }
        self.period();
        let most = self.tally.most();
        (0..REST).for_each(|_| self.period());
        self.tally = Tally::default();
        Some(most)
    }

    /// Runs one period: conversion, interrupt and new bridge command for each axis; then the servo.
    fn period(&mut self) {
        for axis in 0..AXES {
            self.show(axis);
            self.tally.push(interrupt());
            if let (Some(motor), Some(sample)) = (self.motors.get_mut(axis), self.samples.get_mut(axis)) {
                *sample = motor.period(machine::command(axis));
            }
        }
        if REGISTERS.requests[0].swap(0) != 0 {
            for samples in &mut self.ends.samples {
                while samples.dequeue().is_some() {}
            }
            SIGNALS.statistics.servo_ticks.add();
        }
    }

    /// Writes an axis' sensor values into the registers.
    fn show(&self, axis: usize) {
        let Some(sample) = self.samples.get(axis) else { return };
        REGISTERS.cycles.set(REGISTERS.cycles.get().wrapping_add(u32::from(TOP)));
        let [supply, b, c] = &REGISTERS.converters;
        let (done, result) = if axis == 0 { (JEOC, 0) } else { (EOC, 1) };
        for (one, code) in [b, c].into_iter().zip(sample.shunt_codes) {
            one.results[result].set(code.into());
            one.status.set(done);
        }
        supply.results[0].set(sample.bus_code.into());
        supply.status.set(JEOC);
        REGISTERS.counters[axis & 1].set(sample.encoder_count.into());
        REGISTERS.indices[axis & 1].set(sample.index_count.map_or(0, |count| SEEN | u32::from(count)));
    }

    /// Whether an axis has stopped; prints the reason.
    fn stopped(&self) -> bool {
        let fault = LOOPS.lock().as_ref().is_none_or(|current| {
            (0..AXES).any(|axis| current.loops.axis_state(axis).is_none_or(|stage| stage.fault().is_some()))
        });
        let off = (0..AXES).any(|axis| !machine::command(axis).enabled);
        let (causes, missed) = (SIGNALS.inhibit.causes(), SIGNALS.statistics.current_missed.get());
        if fault || off || causes != 0 || missed != 0 {
            hprintln!("an axis stopped: causes {:#x}, ticks missed {}, fault {}", causes, missed, fault);
        }
        fault || off || causes != 0 || missed != 0
    }
}

/// Prints the table; returns whether the goals are met.
#[inline(never)]
pub fn report(account: &mut Account) -> bool {
    let mut motors = [Motor::at_rest(); AXES];
    let mut calibrations = [None; AXES];
    for (motor, slot) in motors.iter_mut().zip(&mut calibrations) {
        *slot = calibrated(motor, &CONFIGURATION, &mut Tally::default());
    }
    let [Some(one), Some(other)] = calibrations else { return false };
    let mut bench = Bench::new(motors);
    heading("the whole current interrupt, both axes on");
    let (mut all, mut orders) = (Tally::default(), 0);
    for (speed, current) in SPEEDS {
        let Some(most) = bench.begin(&[one, other], speed) else { return false };
        orders = orders.max(most);
        for step in 0..PERIODS {
            let current = Ampere(if step % 400 < 200 { current } else { -current });
            SIGNALS.set_targets(&DriveCommand { enabled: true, currents: [current; AXES] });
            bench.period();
        }
        if bench.stopped() {
            return false;
        }
        let (mean, most) = (bench.tally.mean(), bench.tally.most());
        hprintln!("{:<41} {:>6} {:>8} {:>8}", "at rad/s", speed as i32, mean, most);
        all.add(&bench.tally);
    }
    hprintln!("{:<48} {:>8} {:>8}", "with an order to run, bridges off", "", orders);
    let worst = all.print_against("of all", MOST_WORST);
    let is_met = |met| if met { "kept" } else { "MISSED" };
    let mean = all.mean() <= MOST_MEAN;
    hprintln!("{:<48} {:>8} {:>8}   goal {}: {}", "mean of all", all.mean(), "", MOST_MEAN, is_met(mean));
    let rate = AXES as u32 * CURRENT_RATE_HZ;
    let share = percent(all.mean(), rate);
    let little = share <= MOST_PERCENT;
    hprintln!(
        "{:<48} {:>8.1} {:>8}   goal {:.0}: {}",
        "both axes, % of the processor",
        share,
        "",
        MOST_PERCENT,
        is_met(little)
    );
    account.add("current interrupt, both axes", all, MOST_WORST, rate);
    worst && mean && little
}
