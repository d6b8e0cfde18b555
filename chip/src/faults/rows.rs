//! The rows: those of one injection as data, the others by their own runs.

use rand_core::Rng;
use rand_xoshiro::Xoshiro256PlusPlus;
use scarab::bus::Frame;

use crate::chip::{GATE_FAULT, LostTriggers, STOP};
use crate::faults::{Expected, Inject, Injected, JITTER_S, Later, OwnRun, PERIOD_S, Row, Run, Situation};
use crate::faults::{bus, memory, random_sessions, search, stored, wiring};
use crate::plant::{JOINTS, STEP, ShuntFault};
use crate::time::ticks;

/// Exceptions of the current loops and of the servo.
pub(super) const CURRENT: u8 = 16 + 18;
const SERVO: u8 = 16 + 77;
/// Period of the servo, s.
const SERVO_S: f64 = 250e-6;

fn axis(random: &mut Xoshiro256PlusPlus) -> usize {
    random.next_u32() as usize % JOINTS
}

fn shunt(random: &mut Xoshiro256PlusPlus) -> (usize, usize) {
    (axis(random), random.next_u32() as usize % 2)
}

/// A row of one injection, whose reaction is awaited for this time, s.
const fn injected(
    id: &'static str,
    fault: &'static str,
    deadline_s: f64,
    situation: Situation,
    expected: Expected,
    inject: Inject,
) -> Row {
    let injected = Injected { situation, expected, inject, later: None };
    Row { id, fault, deadline_s, run: Run::Injected(injected) }
}

impl Row {
    /// Adds changes after the injection.
    const fn changing(mut self, later: Later) -> Self {
        if let Run::Injected(injected) = &mut self.run {
            injected.later = Some(later);
        }
        self
    }
}

/// A row with a run of its own.
const fn own(id: &'static str, fault: &'static str, deadline_s: f64, run: OwnRun) -> Row {
    Row { id, fault, deadline_s, run: Run::Own(run) }
}

/// All rows.
pub(super) const ROWS: &[Row] = &[
    injected(
        "E1",
        "encoder frozen in motion",
        20e-3,
        Situation::Motion,
        Expected::Shorted,
        |chip, random| {
            let (axis, now) = (axis(random), chip.now);
            let position = chip.plant.encoder(axis, now);
            chip.plant.axes[axis].encoder_fault.frozen = Some(position);
        },
    ),
    injected(
        "E2",
        "single jump of the counter",
        0.0,
        Situation::Motion,
        Expected::Nothing,
        |chip, random| chip.plant.axes[axis(random)].encoder_fault.added = 3000,
    )
    .changing(|session, since, _| {
        if since >= STEP {
            let axes = &mut session.machine.chip_mut().plant.axes;
            axes.iter_mut().for_each(|axis| axis.encoder_fault.added = 0);
        }
        since < STEP
    }),
    own("E3", "16-bit counters wrap in calibration and motion", 0.0, wiring::wraps),
    injected("E4", "counts lost in motion", 0.5, Situation::Motion, Expected::Shorted, |chip, random| {
        chip.plant.axes[axis(random)].encoder_fault.added = 150
    }),
    own("E5", "phases, encoder or shunts connected wrongly", 0.0, wiring::wrong),
    injected(
        "C1",
        "current offset jumps by 20 A",
        50e-3,
        Situation::Motion,
        Expected::Released,
        |chip, random| {
            let (axis, channel) = shunt(random);
            chip.plant.axes[axis].shunt_faults[channel] = Some(ShuntFault::Offset(500.0));
        },
    ),
    injected(
        "C2",
        "current sensor at its rail",
        3.0 * PERIOD_S,
        Situation::Rest,
        Expected::Released,
        |chip, random| {
            let (axis, channel) = shunt(random);
            let code = if random.next_u32() & 1 == 0 { 4095 } else { 0 };
            chip.plant.axes[axis].shunt_faults[channel] = Some(ShuntFault::Stuck(code));
        },
    ),
    injected(
        "C3",
        "converter silent",
        4.0 * PERIOD_S,
        Situation::Rest,
        Expected::Released,
        |chip, random| chip.silent_adc[1 + random.next_u32() as usize % 2] = true,
    ),
    injected(
        "C4",
        "gate drivers' fault line",
        1.5 * PERIOD_S,
        Situation::Rest,
        Expected::Released,
        |chip, _| chip.set_pin(GATE_FAULT, false),
    ),
    injected(
        "P1",
        "wire of a phase broken in motion",
        0.4,
        Situation::Motion,
        Expected::Released,
        |chip, random| chip.plant.axes[axis(random)].open[random.next_u32() as usize % 3] = true,
    ),
    injected(
        "P2",
        "gate driver lost its configuration",
        10e-3,
        Situation::Rest,
        Expected::Released,
        |chip, random| chip.drivers.lose_configuration(axis(random)),
    ),
    injected("V1", "bus voltage of 63 V", 1e-3, Situation::Rest, Expected::Released, |chip, _| {
        chip.plant.set_bus(63.0)
    }),
    injected("V2", "bus voltage of 15 V", 1e-3, Situation::Rest, Expected::Released, |chip, _| {
        chip.plant.set_bus(15.0)
    }),
    injected(
        "T1",
        "thermistor open or shorted",
        100e-3,
        Situation::Rest,
        Expected::Damped,
        |chip, random| {
            chip.plant.thermistors[axis(random)] = if random.next_u32() & 1 == 0 { 4095 } else { 0 };
        },
    ),
    injected("X1", "emergency stop", PERIOD_S, Situation::Motion, Expected::Released, |chip, _| {
        chip.set_pin(STOP, false)
    }),
    injected(
        "X2",
        "emergency stop that bounces for 20 ms and closes",
        PERIOD_S,
        Situation::Rest,
        Expected::Released,
        |chip, _| chip.set_pin(STOP, false),
    )
    .changing(|session, since, count| {
        let bounces = since < ticks(20e-3);
        session.machine.chip_mut().set_pin(STOP, !bounces || count % 7 < 3);
        bounces
    }),
    injected(
        "X3",
        "supply cut in motion, then back: starts off",
        2.0 * PERIOD_S,
        Situation::Motion,
        Expected::Released,
        // The cut itself comes a period after the beginning.
        |_, _| {},
    )
    .changing(|session, _, _| {
        session.machine.power_cycle();
        false
    }),
    injected(
        "K1",
        "3 to 12 current ticks of an axis missing in a row",
        1e-3,
        Situation::Motion,
        Expected::Released,
        |chip, random| {
            let left = 3 + random.next_u32() % 10;
            chip.lost_triggers[axis(random)] = LostTriggers::new(left, 0, left);
        },
    ),
    injected(
        "K1",
        "every other current tick of an axis missing, six times",
        1e-3,
        Situation::Motion,
        Expected::Damped,
        |chip, random| {
            // At 24 such ticks the damping ends too.
            let lost = LostTriggers::new(1, 1, 6);
            chip.lost_triggers[axis(random)] = lost;
        },
    ),
    injected(
        "K1",
        "all current ticks held up for 8 periods",
        1e-3,
        Situation::Motion,
        Expected::Released,
        |_, _| {},
    )
    .changing(|session, since, _| {
        let held_up = since < 9 * STEP;
        session.machine.hang(held_up.then_some(CURRENT));
        held_up
    }),
    own("K1", "one current tick missing: counted, no reaction", 0.0, search::counted),
    own("K2", "search without end, unread records, full wire", JITTER_S, search::starves),
    injected("K3", "servo hangs", 4e-3 + 512.0 / 32e3, Situation::Motion, Expected::Released, |_, _| {})
        .changing(|session, _, _| {
            session.machine.hang(Some(SERVO));
            false
        }),
    own("B1", "host's heartbeat or targets end", 3.0 * SERVO_S + PERIOD_S, bus::lost),
    injected(
        "B2",
        "controller goes bus-off while the operator has control",
        0.0,
        Situation::Motion,
        Expected::Nothing,
        |chip, _| {
            let now = chip.now;
            chip.can.go_bus_off(now);
        },
    ),
    own("K4", "panic, hard fault, unhandled interrupt in motion", 10e-6, memory::crash),
    injected("K5", "crystal stops", 50e-6, Situation::Motion, Expected::Released, |chip, _| {
        chip.stop_crystal()
    }),
    own("B6", "a host takes over an enabled leg, in each mode", 0.0, bus::taken_over),
    own("B7", "random host sessions", 0.0, random_sessions::played),
    own("B3", "malformed and hostile frames", JITTER_S, bus::hostile),
    injected(
        "B4",
        "bus with full load of foreign and hostile frames",
        0.0,
        Situation::Motion,
        Expected::Nothing,
        |chip, random| {
            for _ in 0..5000 {
                let bytes = random.next_u64().to_le_bytes();
                // No node control, no synchronisation, no frames of the device itself.
                let id = 0x190 + (random.next_u32() % 0x370) as u16;
                chip.send_frame(Frame::new(id, &bytes[..random.next_u32() as usize % 9]));
            }
        },
    ),
    own("F2", "stored data corrupt, older or of another leg", 0.0, stored::rotten),
    own("F3", "change of the flash requested for, drive on or off", 0.0, stored::requested),
    own("M1", "stack overflow in motion", 10e-6, memory::overflow),
    own("M2", "bit of a gain or limit flips in motion", 100e-3, memory::upset),
];
