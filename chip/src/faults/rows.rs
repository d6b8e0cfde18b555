//! The rows: those of one injection as data, the others by their own runs.

use rand_core::Rng;
use rand_xoshiro::Xoshiro256PlusPlus;
use scarab::bus::Frame;

use crate::chip::{GATE_FAULT, LostTriggers, STOP};
use crate::faults::{Expected, Injected, JITTER_S, PERIOD_S, Row, Run, Situation};
use crate::faults::{bus, memory, search, stored, wiring};
use crate::nvic::HARD_FAULT;
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

/// All rows.
pub(super) const ROWS: &[Row] = &[
    Row {
        id: "E1",
        fault: "encoder frozen in motion",
        deadline_s: 20e-3,
        run: Run::Injected(Injected {
            situation: Situation::Motion,
            expected: Expected::Shorted,
            inject: |chip, random| {
                let (axis, now) = (axis(random), chip.now);
                let position = chip.plant.encoder(axis, now);
                chip.plant.axes[axis].encoder_fault.frozen = Some(position);
            },
            later: None,
        }),
    },
    Row {
        id: "E2",
        fault: "single jump of the counter",
        deadline_s: 0.0,
        run: Run::Injected(Injected {
            situation: Situation::Motion,
            expected: Expected::Nothing,
            inject: |chip, random| chip.plant.axes[axis(random)].encoder_fault.added = 3000,
            later: Some(|session, since, _| {
                if since >= STEP {
                    let axes = &mut session.machine.chip_mut().plant.axes;
                    axes.iter_mut().for_each(|axis| axis.encoder_fault.added = 0);
                }
                since < STEP
            }),
        }),
    },
    Row {
        id: "E3",
        fault: "16-bit counters wrap in calibration and motion",
        deadline_s: 0.0,
        run: Run::Own(wiring::wraps),
    },
    Row {
        id: "E4",
        fault: "counts lost in motion",
        deadline_s: 0.5,
        run: Run::Injected(Injected {
            situation: Situation::Motion,
            expected: Expected::Shorted,
            inject: |chip, random| chip.plant.axes[axis(random)].encoder_fault.added = 150,
            later: None,
        }),
    },
    Row {
        id: "E5",
        fault: "phases, encoder or shunts connected wrongly",
        deadline_s: 0.0,
        run: Run::Own(wiring::wrong),
    },
    Row {
        id: "C1",
        fault: "current offset jumps by 20 A",
        deadline_s: 50e-3,
        run: Run::Injected(Injected {
            situation: Situation::Motion,
            expected: Expected::Released,
            inject: |chip, random| {
                let (axis, channel) = shunt(random);
                chip.plant.axes[axis].shunt_faults[channel] = Some(ShuntFault::Offset(500.0));
            },
            later: None,
        }),
    },
    Row {
        id: "C2",
        fault: "current sensor at its rail",
        deadline_s: 3.0 * PERIOD_S,
        run: Run::Injected(Injected {
            situation: Situation::Rest,
            expected: Expected::Released,
            inject: |chip, random| {
                let (axis, channel) = shunt(random);
                let code = if random.next_u32() & 1 == 0 { 4095 } else { 0 };
                chip.plant.axes[axis].shunt_faults[channel] = Some(ShuntFault::Stuck(code));
            },
            later: None,
        }),
    },
    Row {
        id: "C3",
        fault: "converter silent",
        deadline_s: 4.0 * PERIOD_S,
        run: Run::Injected(Injected {
            situation: Situation::Rest,
            expected: Expected::Released,
            inject: |chip, random| chip.silent_adc[1 + random.next_u32() as usize % 2] = true,
            later: None,
        }),
    },
    Row {
        id: "C4",
        fault: "gate drivers' fault line",
        deadline_s: 1.5 * PERIOD_S,
        run: Run::Injected(Injected {
            situation: Situation::Rest,
            expected: Expected::Released,
            inject: |chip, _| chip.set_pin(GATE_FAULT, false),
            later: None,
        }),
    },
    Row {
        id: "P1",
        fault: "wire of a phase broken in motion",
        deadline_s: 0.4,
        run: Run::Injected(Injected {
            situation: Situation::Motion,
            expected: Expected::Released,
            inject: |chip, random| chip.plant.axes[axis(random)].open[random.next_u32() as usize % 3] = true,
            later: None,
        }),
    },
    Row {
        id: "P2",
        fault: "gate driver lost its configuration",
        deadline_s: 10e-3,
        run: Run::Injected(Injected {
            situation: Situation::Rest,
            expected: Expected::Released,
            inject: |chip, random| chip.drivers.lose_configuration(axis(random)),
            later: None,
        }),
    },
    Row {
        id: "V1",
        fault: "bus voltage of 63 V",
        deadline_s: 1e-3,
        run: Run::Injected(Injected {
            situation: Situation::Rest,
            expected: Expected::Released,
            inject: |chip, _| chip.plant.set_bus(63.0),
            later: None,
        }),
    },
    Row {
        id: "V2",
        fault: "bus voltage of 15 V",
        deadline_s: 1e-3,
        run: Run::Injected(Injected {
            situation: Situation::Rest,
            expected: Expected::Released,
            inject: |chip, _| chip.plant.set_bus(15.0),
            later: None,
        }),
    },
    Row {
        id: "T1",
        fault: "thermistor open or shorted",
        deadline_s: 100e-3,
        run: Run::Injected(Injected {
            situation: Situation::Rest,
            expected: Expected::Damped,
            inject: |chip, random| {
                chip.plant.thermistors[axis(random)] = if random.next_u32() & 1 == 0 { 4095 } else { 0 };
            },
            later: None,
        }),
    },
    Row {
        id: "X1",
        fault: "emergency stop",
        deadline_s: PERIOD_S,
        run: Run::Injected(Injected {
            situation: Situation::Motion,
            expected: Expected::Released,
            inject: |chip, _| chip.set_pin(STOP, false),
            later: None,
        }),
    },
    Row {
        id: "X2",
        fault: "emergency stop that bounces for 20 ms and closes",
        deadline_s: PERIOD_S,
        run: Run::Injected(Injected {
            situation: Situation::Rest,
            expected: Expected::Released,
            inject: |chip, _| chip.set_pin(STOP, false),
            later: Some(|session, since, count| {
                let bounces = since < ticks(20e-3);
                session.machine.chip_mut().set_pin(STOP, !bounces || count % 7 < 3);
                bounces
            }),
        }),
    },
    Row {
        id: "X3",
        fault: "supply cut in motion, then back: starts off",
        deadline_s: 2.0 * PERIOD_S,
        run: Run::Injected(Injected {
            situation: Situation::Motion,
            expected: Expected::Released,
            // The cut itself comes a period after the beginning.
            inject: |_, _| {},
            later: Some(|session, _, _| {
                session.machine.power_cycle();
                false
            }),
        }),
    },
    Row {
        id: "K1",
        fault: "3 to 12 current ticks of an axis missing in a row",
        deadline_s: 1e-3,
        run: Run::Injected(Injected {
            situation: Situation::Motion,
            expected: Expected::Released,
            inject: |chip, random| {
                let left = 3 + random.next_u32() % 10;
                chip.lost_triggers[axis(random)] = LostTriggers::new(left, 0, left);
            },
            later: None,
        }),
    },
    Row {
        id: "K1",
        fault: "every other current tick of an axis missing, six times",
        deadline_s: 1e-3,
        run: Run::Injected(Injected {
            situation: Situation::Motion,
            expected: Expected::Damped,
            inject: |chip, random| {
                // At 24 such ticks the damping ends too.
                let lost = LostTriggers::new(1, 1, 6);
                chip.lost_triggers[axis(random)] = lost;
            },
            later: None,
        }),
    },
    Row {
        id: "K1",
        fault: "all current ticks held up for 8 periods",
        deadline_s: 1e-3,
        run: Run::Injected(Injected {
            situation: Situation::Motion,
            expected: Expected::Released,
            inject: |_, _| {},
            later: Some(|session, since, _| {
                let held_up = since < 9 * STEP;
                session.machine.hang(held_up.then_some(CURRENT));
                held_up
            }),
        }),
    },
    Row {
        id: "K1",
        fault: "one current tick missing: counted, no reaction",
        deadline_s: 0.0,
        run: Run::Own(search::counted),
    },
    Row {
        id: "K2",
        fault: "search without end, records that nobody reads, full wire",
        deadline_s: JITTER_S,
        run: Run::Own(search::starves),
    },
    Row {
        id: "K3",
        fault: "servo hangs",
        deadline_s: 4e-3 + 512.0 / 32e3,
        run: Run::Injected(Injected {
            situation: Situation::Motion,
            expected: Expected::Released,
            inject: |_, _| {},
            later: Some(|session, _, _| {
                session.machine.hang(Some(SERVO));
                false
            }),
        }),
    },
    Row {
        id: "B1",
        fault: "host's heartbeat or targets end",
        deadline_s: 3.0 * SERVO_S + PERIOD_S,
        run: Run::Own(bus::lost),
    },
    Row {
        id: "B2",
        fault: "controller goes bus-off while the operator has control",
        deadline_s: 0.0,
        run: Run::Injected(Injected {
            situation: Situation::Motion,
            expected: Expected::Nothing,
            inject: |chip, _| {
                let now = chip.now;
                chip.can.go_bus_off(now);
            },
            later: None,
        }),
    },
    Row {
        id: "K4",
        fault: "hard fault",
        deadline_s: 10e-6,
        run: Run::Injected(Injected {
            situation: Situation::Motion,
            expected: Expected::Released,
            inject: |chip, _| {
                let now = chip.now;
                chip.nvic.pend(HARD_FAULT, now);
            },
            later: None,
        }),
    },
    Row {
        id: "K5",
        fault: "crystal stops",
        deadline_s: 50e-6,
        run: Run::Injected(Injected {
            situation: Situation::Motion,
            expected: Expected::Released,
            inject: |chip, _| chip.stop_crystal(),
            later: None,
        }),
    },
    Row {
        id: "B3",
        fault: "malformed and hostile frames",
        deadline_s: JITTER_S,
        run: Run::Own(bus::hostile),
    },
    Row {
        id: "B4",
        fault: "bus with full load of foreign and hostile frames",
        deadline_s: 0.0,
        run: Run::Injected(Injected {
            situation: Situation::Motion,
            expected: Expected::Nothing,
            inject: |chip, random| {
                for _ in 0..5000 {
                    let bytes = random.next_u64().to_le_bytes();
                    // No node control, no synchronisation, no frames of the device itself.
                    let id = 0x190 + (random.next_u32() % 0x370) as u16;
                    chip.send_frame(Frame::new(id, &bytes[..random.next_u32() as usize % 9]));
                }
            },
            later: None,
        }),
    },
    Row {
        id: "F2",
        fault: "stored data corrupt, older or of another leg",
        deadline_s: 0.0,
        run: Run::Own(stored::rotten),
    },
    Row {
        id: "F3",
        fault: "change of the flash asked for, drive on or off",
        deadline_s: 0.0,
        run: Run::Own(stored::asked),
    },
    Row { id: "M1", fault: "stack overflow in motion", deadline_s: 10e-6, run: Run::Own(memory::overflow) },
    Row {
        id: "M2",
        fault: "bit of a gain or limit flips in motion",
        deadline_s: 100e-3,
        run: Run::Own(memory::upset),
    },
];
