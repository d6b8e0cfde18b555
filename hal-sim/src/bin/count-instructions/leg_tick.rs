//! The 4 kHz tick of a leg that follows a motion with its model in the feedforward: motion, model, observers, controllers,
//! monitor, log.

use core::hint::black_box;

use cortex_m_semihosting::hprintln;
use scarab::hal::{JointSample, Sample};
use scarab::leg::{Activity, Control, ControlOutput, ControlRequest, IdentifiedModel, Step};
use scarab::motion::{Motion, MotionState, Periodic};
use scarab::safety::PowerRequest;
use scarab::servo::{JointConfiguration, NoModel, SERVO_RATE_HZ, Servo, ServoCommand};
use scarab::units::Ampere;

use crate::account::Account;
use crate::counter::{Tally, count, heading};
use crate::leg::{self, GRAVITY, JOINTS, Model};

/// Design: both joints, feedforward and monitor included.
const MOST_INSTRUCTIONS: u32 = 4000;
/// Ticks of the motion that are counted, after the way to its start: 2.5 s.
const TICKS: u32 = 10_000;
/// Longest way to the start.
const MOST_APPROACH_TICKS: u32 = 40_000;

/// A plant that stands where it was told to be, to a count, with the current it was told: no lag, no noise.
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

#[inline(never)]
fn tick(
    control: &mut Control<JOINTS>,
    sample: &Sample<JOINTS>,
    request: Option<ControlRequest<JOINTS>>,
) -> ControlOutput<JOINTS> {
    control.tick(sample, request, GRAVITY)
}

/// Prints the table; whether the bound is kept. `None` where the leg cannot be built or does not follow.
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
        let _ = tick(&mut control, &sample, power.map(ControlRequest::Power));
    }
    let adopted = control.adopt(identified);
    let mut output =
        tick(&mut control, &sample, Some(ControlRequest::Track { motion: proved.ok()?, with_model: true }));
    if !adopted || output.refused {
        hprintln!("the leg does not track: {:?}, {:?}", control.state(), control.activity());
        return None;
    }
    let (mut approach, mut run) = (Tally::default(), Tally::default());
    for _ in 0..MOST_APPROACH_TICKS {
        let running = control.activity() == Activity::Track(Step::Run);
        sample = follow(&output.motion, output.servo.drive().currents);
        let (instructions, next) = count(|| tick(black_box(&mut control), black_box(&sample), None));
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
    servo(&configuration.joints, &identified, periodic)?;
    hprintln!("{:<48} {:>8}", "once: proof of a motion's limits", proof);
    Some(())
}

/// The servo alone, and what it is given.
fn servo(
    joints: &[JointConfiguration; JOINTS],
    identified: &IdentifiedModel<JOINTS>,
    periodic: Periodic<JOINTS>,
) -> Option<()> {
    let (mut bare, mut modelled) = (Servo::new(*joints).ok()?, Servo::new(*joints).ok()?);
    let (mut state, mut without, mut with) = (Tally::default(), Tally::default(), Tally::default());
    for number in 0..2000 {
        let (instructions, motion) = count(|| black_box(&periodic).state_at(black_box(number)));
        state.push(instructions);
        let sample = follow(&motion, [Ampere::ZERO; JOINTS]);
        // The first ticks switch on.
        let power = [PowerRequest::Shutdown, PowerRequest::SwitchOn, PowerRequest::EnableOperation]
            .get((number as usize).wrapping_sub(1))
            .copied();
        let command = ServoCommand::<JOINTS, NoModel> { motion, feedforward: None, power };
        let (instructions, output) =
            count(|| black_box(&mut bare).tick(black_box(&sample), black_box(&command), GRAVITY));
        black_box(output);
        without.push(instructions);
        let command = ServoCommand { motion, feedforward: Some(identified), power };
        let (instructions, output) =
            count(|| black_box(&mut modelled).tick(black_box(&sample), black_box(&command), GRAVITY));
        black_box(output);
        with.push(instructions);
    }
    state.print("  of it: the commanded state, six harmonics");
    without.print("  of it: servo and monitor, no model");
    with.print("  of it: servo, monitor and model");
    Some(())
}
