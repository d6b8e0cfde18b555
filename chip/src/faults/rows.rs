//! The rows: those of one injection as data, the others by their own runs. Fault and deadline are the
//! catalogue's.

use rand_core::Rng;
use rand_xoshiro::Xoshiro256PlusPlus;
use scarab::bus::Frame;
use scarab_rig::faults::catalogue::{self, Fault};

use crate::chip::{GATE_FAULT, LostTriggers, STOP};
use crate::faults::{Expected, Inject, Injected, JITTER_S, Later, OwnRun, PERIOD_S, Row, Run, Situation};
use crate::faults::{bus, memory, random_sessions, search, stored, wiring};
use crate::load::{CURRENT_INTERRUPT, SERVO};
use crate::plant::{JOINTS, STEP, ShuntFault};
use crate::time::ticks;

fn axis(random: &mut Xoshiro256PlusPlus) -> usize {
    random.next_u32() as usize % JOINTS
}

fn shunt(random: &mut Xoshiro256PlusPlus) -> (usize, usize) {
    (axis(random), random.next_u32() as usize % 2)
}

/// A row of one injection.
const fn injected(fault: &'static Fault, situation: Situation, expected: Expected, inject: Inject) -> Row {
    let injected = Injected { situation, expected, inject, later: None };
    Row { fault, case: None, within_s: None, run: Run::Injected(injected) }
}

impl Row {
    /// Injects only this case of the fault.
    const fn case(mut self, case: &'static str) -> Self {
        self.case = Some(case);
        self
    }

    /// Replaces the catalogue's deadline, s.
    const fn within(mut self, seconds: f64) -> Self {
        self.within_s = Some(seconds);
        self
    }

    /// Adds changes after the injection.
    const fn changing(mut self, later: Later) -> Self {
        if let Run::Injected(injected) = &mut self.run {
            injected.later = Some(later);
        }
        self
    }
}

/// A row with a run of its own.
const fn own(fault: &'static Fault, run: OwnRun) -> Row {
    Row { fault, case: None, within_s: None, run: Run::Own(run) }
}

pub(super) const ROWS: &[Row] = &[
    injected(&catalogue::E1, Situation::Motion, Expected::Shorted, |chip, random| {
        let (axis, now) = (axis(random), chip.now);
        let position = chip.plant.encoder(axis, now);
        chip.plant.axes[axis].encoder_fault.frozen = Some(position);
    }),
    injected(&catalogue::E2, Situation::Motion, Expected::Nothing, |chip, random| {
        chip.plant.axes[axis(random)].encoder_fault.added = 3000
    })
    .case("single jump of the counter")
    .changing(|session, since, _| {
        if since >= STEP {
            let axes = &mut session.chip_mut().plant.axes;
            axes.iter_mut().for_each(|axis| axis.encoder_fault.added = 0);
        }
        since < STEP
    }),
    own(&catalogue::E3, wiring::wraps).case("16-bit counters wrap in calibration and motion"),
    injected(&catalogue::E4, Situation::Motion, Expected::Shorted, |chip, random| {
        chip.plant.axes[axis(random)].encoder_fault.added = 150
    })
    .case("counts lost in motion")
    .within(0.5),
    own(&catalogue::E5, wiring::wrong).case("phases, encoder or shunts connected wrongly"),
    injected(&catalogue::C1, Situation::Motion, Expected::Released, |chip, random| {
        let (axis, channel) = shunt(random);
        chip.plant.axes[axis].shunt_faults[channel] = Some(ShuntFault::Offset(500.0));
    })
    .case("current offset jumps by 20 A"),
    injected(&catalogue::C2, Situation::Rest, Expected::Released, |chip, random| {
        let (axis, channel) = shunt(random);
        let code = if random.next_u32() & 1 == 0 { 4095 } else { 0 };
        chip.plant.axes[axis].shunt_faults[channel] = Some(ShuntFault::Stuck(code));
    })
    .within(3.0 * PERIOD_S),
    injected(&catalogue::C3, Situation::Rest, Expected::Released, |chip, random| {
        chip.silent_adc[1 + random.next_u32() as usize % 2] = true
    }),
    injected(&catalogue::C4, Situation::Rest, Expected::Released, |chip, _| chip.set_pin(GATE_FAULT, false))
        .case("gate drivers' fault line")
        .within(1.5 * PERIOD_S),
    injected(&catalogue::P1, Situation::Motion, Expected::Released, |chip, random| {
        chip.plant.axes[axis(random)].open[random.next_u32() as usize % 3] = true
    })
    .case("wire of a phase broken in motion")
    .within(0.4),
    injected(&catalogue::P2, Situation::Rest, Expected::Released, |chip, random| {
        chip.drivers.lose_configuration(axis(random))
    }),
    injected(&catalogue::V1, Situation::Rest, Expected::Released, |chip, _| chip.plant.set_bus(63.0))
        .case("bus voltage of 63 V")
        .within(1e-3),
    injected(&catalogue::V2, Situation::Rest, Expected::Released, |chip, _| chip.plant.set_bus(15.0))
        .case("bus voltage of 15 V"),
    injected(&catalogue::T1, Situation::Rest, Expected::Damped, |chip, random| {
        chip.plant.thermistors[axis(random)] = if random.next_u32() & 1 == 0 { 4095 } else { 0 };
    })
    .case("thermistor open or shorted"),
    injected(&catalogue::X1, Situation::Motion, Expected::Released, |chip, _| chip.set_pin(STOP, false)),
    injected(&catalogue::X2, Situation::Rest, Expected::Released, |chip, _| chip.set_pin(STOP, false))
        .case("emergency stop that bounces for 20 ms and closes")
        .changing(|session, since, count| {
            let bounces = since < ticks(20e-3);
            session.chip_mut().set_pin(STOP, !bounces || count % 7 < 3);
            bounces
        }),
    injected(
        &catalogue::X3,
        Situation::Motion,
        Expected::Released,
        // The cut itself comes a period after the beginning.
        |_, _| {},
    )
    .case("supply cut in motion, then back: starts off")
    .within(2.0 * PERIOD_S)
    .changing(|session, _, _| {
        session.machine.power_cycle();
        false
    }),
    injected(&catalogue::K1, Situation::Motion, Expected::Released, |chip, random| {
        let left = 3 + random.next_u32() % 10;
        chip.lost_triggers[axis(random)] = LostTriggers::new(left, 0, left);
    })
    .case("3 to 12 current ticks of an axis missing in a row"),
    injected(&catalogue::K1, Situation::Motion, Expected::Damped, |chip, random| {
        // At 24 such ticks the damping ends too.
        let lost = LostTriggers::new(1, 1, 6);
        chip.lost_triggers[axis(random)] = lost;
    })
    .case("every other current tick of an axis missing, six times"),
    injected(&catalogue::K1, Situation::Motion, Expected::Released, |_, _| {})
        .case("all current ticks held up for 8 periods")
        .changing(|session, since, _| {
            let held_up = since < 9 * STEP;
            session.machine.hang(held_up.then_some(CURRENT_INTERRUPT));
            held_up
        }),
    own(&catalogue::K1, search::counted).case("one current tick missing: counted, no reaction"),
    own(&catalogue::K2, search::starves).within(JITTER_S),
    injected(&catalogue::K3, Situation::Motion, Expected::Released, |_, _| {})
        .case("servo hangs")
        .within(4e-3 + 512.0 / 32e3)
        .changing(|session, _, _| {
            session.machine.hang(Some(SERVO));
            false
        }),
    own(&catalogue::B1, bus::lost).case("host's heartbeat, targets or SYNC end"),
    injected(&catalogue::B2, Situation::Motion, Expected::Nothing, |chip, _| {
        let now = chip.now;
        chip.can.go_bus_off(now);
    })
    .case("controller goes bus-off while the operator has control"),
    own(&catalogue::K4, memory::crash).case("panic, hard fault, unhandled interrupt in motion"),
    injected(&catalogue::K5, Situation::Motion, Expected::Released, |chip, _| chip.stop_crystal())
        .within(50e-6),
    own(&catalogue::B6, bus::taken_over),
    own(&catalogue::B7, random_sessions::played),
    own(&catalogue::B3, bus::hostile).within(JITTER_S),
    injected(&catalogue::B4, Situation::Motion, Expected::Nothing, |chip, random| {
        for _ in 0..5000 {
            let bytes = random.next_u64().to_le_bytes();
            // No node control, no synchronisation, no frames of the device itself.
            let id = 0x190 + (random.next_u32() % 0x370) as u16;
            chip.send_frame(Frame::new(id, &bytes[..random.next_u32() as usize % 9]));
        }
    })
    .case("bus with full load of foreign and hostile frames"),
    own(&catalogue::F2, stored::corrupted_records),
    own(&catalogue::F3, stored::requested),
    own(&catalogue::M1, memory::overflow),
    own(&catalogue::M2, memory::upset),
];
