//! A session of assistance with every share: the 4 kHz tick, and the law at 500 Hz.
//!
//! The joints swing periodically, as a wearer would move them: the oscillators lock and the gate opens.

use core::hint::black_box;

use cortex_m_semihosting::hprintln;
use scarab::assist::AssistLaw;
use scarab::hal::{JointSample, Sample};
use scarab::leg::{
    Activity, AssistPhase, AssistShares, Assured, Control, ControlRequest, IdentifiedModel, Wearing,
};
use scarab::real::sin_cos;
use scarab::safety::PowerRequest;
use scarab::servo::{LOG_RATE_HZ, SERVO_RATE_HZ};
use scarab::units::Ampere;

use crate::account::Account;
use crate::counter::{Tally, count, heading};
use crate::leg::{self, JOINTS, Model};
use crate::leg_tick::tick;

/// Design bound of a tick in a session.
const MOST_PER_TICK: u32 = 4000;
/// Design bound of the law.
const MOST_PER_SAMPLE: u32 = 15_000;
/// Ticks of the session: 12 s.
const TICKS: u32 = 12 * SERVO_RATE_HZ;
/// Ticks in which the session fades in and the oscillators lock.
const FIRST: u32 = 8 * SERVO_RATE_HZ;
const SWING_HZ: f32 = 0.8;

/// Joints that swing about the middle of their range; currents of the last command.
fn swing(number: u32, currents: [Ampere; JOINTS]) -> Sample<JOINTS> {
    let phase = core::f32::consts::TAU * SWING_HZ * number as f32 / SERVO_RATE_HZ as f32;
    let (sine, cosine) = sin_cos(phase);
    let angles = [0.5 + 0.25 * sine, -(1.0 + 0.4 * cosine)];
    let scales = leg::scales();
    Sample {
        joints: core::array::from_fn(|joint| JointSample {
            encoder_counts: (angles[joint] / scales[joint].signed_radian_per_count()) as i32,
            current: currents[joint],
            doubtful: false,
        }),
    }
}

/// Prints the table; adds the bounds to the account. `None` if the leg cannot be built or does not assist.
#[inline(never)]
pub fn report(model: &Model, account: &mut Account) -> Option<()> {
    heading("assistance with every share");
    let configuration = leg::configuration(model.clone(), leg::excitation()?);
    let mut control = Control::new(&configuration).ok()?;
    let assured = Assured { coulomb_nm: [2.0; JOINTS], viscous: [1.0; JOINTS], inertia_share: 0.9 };
    let worn = IdentifiedModel::new(model, &model.base.project(&leg::truth())).with_assured(assured);
    let empty = IdentifiedModel::new(
        model,
        &model.base.project(&leg::truth().map(|link| link.map(|value| 0.6 * value))),
    )
    .with_assured(assured);
    if !control.set_model(Wearing::Empty, empty) || !control.set_model(Wearing::Worn, worn) {
        return None;
    }
    let way = [
        None,
        Some(PowerRequest::Shutdown),
        Some(PowerRequest::SwitchOn),
        Some(PowerRequest::EnableOperation),
    ];
    let rest = swing(0, [Ampere::ZERO; JOINTS]);
    for power in way {
        let _ = tick(&mut control, &rest, power.map(ControlRequest::Power), None);
    }
    let mut law = AssistLaw::new();
    let shares = AssistShares { friction: 1.0, inertia: 0.5, weight: 0.5, periodic: 0.3 };
    let (begin, first) = count(|| tick(&mut control, &rest, Some(ControlRequest::Assist(shares)), None));
    law.begin(control.take_session()?);
    let mut currents = first.servo.drive().currents;
    let (mut ticks, mut samples) = (Tally::default(), Tally::default());
    for number in 0..TICKS {
        let sample = swing(number, currents);
        let (instructions, output) = count(|| tick(black_box(&mut control), black_box(&sample), None, None));
        currents = output.servo.drive().currents;
        let counted = number >= FIRST;
        if counted {
            ticks.push(instructions);
        }
        let Some(logged) = &output.logged else { continue };
        let (instructions, torque) = count(|| law.step(black_box(&logged.sample)));
        let mut torque = torque?;
        // These joints obey no torque, so their energy says nothing.
        (torque.damping, torque.is_exhausted) = (0.0, false);
        control.receive_torque(&torque);
        if counted {
            samples.push(instructions);
        }
    }
    if control.activity() != Activity::Assist(AssistPhase::Run) {
        hprintln!("the leg does not assist: {:?}, {:?}", control.state(), control.activity());
        return None;
    }
    hprintln!("{:<48} {:>8}", "once: tick that begins a session", begin);
    ticks.print("tick in a session");
    samples.print("law, one sample");
    let gate = law.periodic().map_or(0.0, |periodic| periodic.gate());
    hprintln!("gate of the periodic assistance {:.2}", gate);
    account.add("  instead: assistance", ticks, MOST_PER_TICK, 0);
    account.add("law of the assistance", samples, MOST_PER_SAMPLE, LOG_RATE_HZ);
    Some(())
}
