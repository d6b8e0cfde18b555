//! The 4 kHz tick of a leg, following a motion with its model in the feedforward, or following a host.
//!
//! The tick comprises motion, model, observers, controllers, monitor and log.
//!
//! One function contains all of it, as in the image: code with a second caller would be compiled differently.

use core::hint::black_box;

use cortex_m_semihosting::hprintln;
use scarab::hal::{JointSample, Sample};
use scarab::leg::{
    Activity, Control, ControlOutput, ControlRequest, Following, Host, IdentifiedModel, JointCommand,
    LegConfiguration, Step, Target,
};
use scarab::motion::{Motion, MotionState};
use scarab::safety::PowerRequest;
use scarab::servo::SERVO_RATE_HZ;
use scarab::units::{Ampere, NewtonMetre, Radian, RadianPerSecond, RadianPerSecondSquared, Second};

use crate::account::Account;
use crate::counter::{Tally, count, heading};
use crate::leg::{self, GRAVITY, JOINTS, Model};

/// Design bound of both joints, feedforward and monitor included.
const MOST_INSTRUCTIONS: u32 = 4000;
/// Bound of a tick that follows a host with the model in the feedforward: a tenth above the design bound.
/// Measured: docs/results/bus.md.
const MOST_WITH_HOST_AND_MODEL: u32 = 4400;
/// Counted ticks of the motion, after the approach: 2.5 s.
const TICKS: u32 = 10_000;
/// Longest approach to the start.
const MOST_APPROACH_TICKS: u32 = 40_000;

/// An ideal plant: target position to a count and target current, without lag and noise.
fn follow(motion: &MotionState<JOINTS>, currents: [Ampere; JOINTS]) -> Sample<JOINTS> {
    let scales = leg::scales();
    Sample {
        joints: core::array::from_fn(|joint| JointSample {
            encoder_counts: (motion.position_rad[joint] / scales[joint].signed_radian_per_count()) as i32,
            current: currents[joint],
            doubtful: false,
        }),
    }
}

/// One function, with a host or without, as in the image.
#[inline(never)]
pub fn tick(
    control: &mut Control<JOINTS>,
    sample: &Sample<JOINTS>,
    request: Option<ControlRequest>,
    host: Option<Host<'_, JOINTS>>,
) -> ControlOutput<JOINTS> {
    control.tick_with(sample, request.as_ref(), GRAVITY, host)
}

/// Prints the table; adds the bounds to the account. `None` if the leg cannot be built or does not follow.
#[inline(never)]
pub fn report(model: &Model, account: &mut Account) -> Option<()> {
    heading("a leg of two joints, 4 kHz");
    let periodic = leg::excitation()?;
    let configuration = leg::configuration(model.clone(), periodic);
    let (proof, proved) = count(|| configuration.prove(periodic));
    let mut control = Control::new(&configuration).ok()?;
    let identified = IdentifiedModel::new(model, &model.base.project(&leg::truth()));

    let start = MotionState::at_rest(Motion::Periodic(periodic).start_rad());
    let mut sample = follow(&start, [Ampere::ZERO; JOINTS]);
    let way = [
        None,
        Some(PowerRequest::Shutdown),
        Some(PowerRequest::SwitchOn),
        Some(PowerRequest::EnableOperation),
    ];
    for power in way {
        let _ = tick(&mut control, &sample, power.map(ControlRequest::Power), None);
    }
    let adopted = control.adopt(identified) && control.set_tracked(proved.ok()?);
    let mut output = tick(&mut control, &sample, Some(ControlRequest::Track { with_model: true }), None);
    if !adopted || output.refused {
        hprintln!("the leg does not track: {:?}, {:?}", control.state(), control.activity());
        return None;
    }
    let (mut approach, mut run) = (Tally::default(), Tally::default());
    for _ in 0..MOST_APPROACH_TICKS {
        let running = control.activity() == Activity::Track(Step::Run);
        sample = follow(&output.motion, output.servo.drive().currents);
        let (instructions, next) = count(|| tick(black_box(&mut control), black_box(&sample), None, None));
        if running {
            run.push(instructions)
        } else {
            approach.push(instructions)
        }
        output = next;
        if run.number() == TICKS {
            break;
        }
    }
    if run.number() < TICKS {
        hprintln!("the leg stopped: {:?}, {:?}", control.state(), control.activity());
        return None;
    }
    approach.print("tick on the way to the start, model fading in");
    run.print("tick with motion, model, monitor and log");
    account.add("leg tick: motion, servo, monitor, log", run, MOST_INSTRUCTIONS, SERVO_RATE_HZ);
    for feedforward in [false, true] {
        follow_a_host(&configuration, identified, feedforward, account)?;
    }
    hprintln!("{:<48} {:>8}", "once: proof of a motion's limits", proof);
    Some(())
}

/// Counts ticks in which a host commands cyclic positions, a new one every eighth tick.
#[inline(never)]
fn follow_a_host(
    configuration: &LegConfiguration<JOINTS, { leg::BASE }>,
    identified: IdentifiedModel<JOINTS>,
    feedforward: bool,
    account: &mut Account,
) -> Option<()> {
    let (mut control, mut following) = (Control::new(configuration).ok()?, Following::new(configuration));
    let mut command = JointCommand {
        target: Target::Hold,
        request_count: 0,
        feedforward,
        halt: false,
        velocity: RadianPerSecond(0.5),
        acceleration: RadianPerSecondSquared(2.0),
        deceleration: RadianPerSecondSquared(2.0),
        torque_slope_nm_per_s: 40.0,
        range: [Radian(-10.0), Radian(10.0)],
        largest_torque: NewtonMetre(1000.0),
        following_window: Radian(0.09),
        following_time: Second(0.01),
        position_window: Radian(0.02),
        position_time: Second(0.01),
        period: Second(0.002),
    };
    if feedforward && !control.adopt(identified) {
        return None;
    }
    let start = MotionState::at_rest([0.5, -1.0]);
    let mut sample = follow(&start, [Ampere::ZERO; JOINTS]);
    let way = [
        None,
        Some(PowerRequest::Shutdown),
        Some(PowerRequest::SwitchOn),
        Some(PowerRequest::EnableOperation),
    ];
    let (mut tally, mut place) = (Tally::default(), [0.5, 1.0]);
    for number in 0..TICKS {
        if number > 100 && number % 8 == 0 {
            // Back and forth within the range.
            let step = if number / 1000 % 2 == 0 { 0.0005 } else { -0.0005 };
            place = place.map(|place| place + step);
            command.target = Target::CyclicPosition {
                position: Radian::ZERO,
                velocity_offset: RadianPerSecond::ZERO,
                torque_offset: NewtonMetre::ZERO,
            };
        }
        let commands = place.map(|place| JointCommand {
            target: match command.target {
                Target::CyclicPosition { velocity_offset, torque_offset, .. } => {
                    Target::CyclicPosition { position: Radian(place), velocity_offset, torque_offset }
                }
                other => other,
            },
            ..command
        });
        let request = way.get(number as usize).copied().flatten().map(ControlRequest::Power);
        let (instructions, output) = count(|| {
            let commands = black_box(&commands);
            let host = Host { following: &mut following, commands, cancel: false, waits: false };
            tick(black_box(&mut control), black_box(&sample), request, Some(host))
        });
        sample = follow(&output.motion, output.servo.drive().currents);
        if number > 200 {
            tally.push(instructions);
        }
    }
    if control.activity() != Activity::Follow {
        hprintln!("the leg does not follow the host: {:?}", control.state());
        return None;
    }
    let name =
        if feedforward { "  instead: follows a host, with model" } else { "  instead: follows a host" };
    tally.print(name);
    // Replaces a motion's tick and has no share of its own.
    let most = if feedforward { MOST_WITH_HOST_AND_MODEL } else { MOST_INSTRUCTIONS };
    account.add(name, tally, most, 0);
    Some(())
}
