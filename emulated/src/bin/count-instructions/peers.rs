//! Compares the crate `foc` (16.16 fixed point) with the same steps of this firmware in single precision.
//!
//! Its update is sine and cosine (CORDIC), Clarke, Park, two PI controllers, Park back and space vectors. The
//! crate targets processors without floating point; the comparison uses it because it is what a crate
//! registry offers. It lacks voltage limit, anti-windup, feedforward, dead-time and delay compensation,
//! minimum zero vector and limits; the caller converts codes and angles. This firmware is measured without
//! these features, except limit and anti-windup, which are part of its PI.

use core::hint::black_box;

use cortex_m_semihosting::hprintln;
use fixed::types::I16F16;
use foc::park_clarke::{
    RotatingReferenceFrame, ThreePhaseBalancedReferenceFrame, clarke, inverse_park, park,
};
use foc::pid::PIController;
use foc::pwm::{Modulation, SpaceVector};
use scarab::motor::{
    BridgeTiming, CurrentGains, CurrentLoop, DeadTime, ElectricalAngle, Modulator, MotorConstants, Phases,
    Rotating, Sine,
};
use scarab::units::{Ampere, Henry, Ohm, Volt, Weber};

use crate::counter::{Tally, count, heading};

struct Steps {
    gains: CurrentGains,
    current_loop: CurrentLoop,
    modulator: Modulator,
}

impl Steps {
    fn new() -> Option<Self> {
        let motor = MotorConstants {
            resistance: Ohm(0.05),
            direct_inductance: Henry(25e-6),
            quadrature_inductance: Henry(25e-6),
            flux: Weber(0.0),
        };
        Some(Self {
            gains: CurrentGains::new(&motor, crate::motor::CONFIGURATION.bandwidth, false)?,
            current_loop: CurrentLoop::default(),
            modulator: Modulator::new(BridgeTiming::ODRIVE_3_6, DeadTime::Uncompensated)?,
        })
    }

    #[inline(never)]
    fn update(&mut self, currents: Phases<Ampere>, angle: ElectricalAngle, target: Ampere) -> [f32; 3] {
        let rotor = angle.rotation(Sine::Exact);
        let stationary = currents.to_stationary();
        let measured = stationary.to_rotating(rotor);
        let voltage = self.current_loop.voltage(&self.gains, target, measured, 0.0, Volt(25.0));
        self.modulator.duties(voltage.to_stationary(rotor), 1.0 / 48.0, stationary)
    }
}

/// Greatest compare value of a period at 24 kHz.
const RESOLUTION: u16 = 3500;
type Foc = foc::Foc<SpaceVector, RESOLUTION>;

#[inline(never)]
fn update(foc: &mut Foc, currents: [I16F16; 2], angle: I16F16, target: I16F16, period: I16F16) -> [u16; 3] {
    foc.update(currents, angle, target, period)
}

pub fn report() {
    let Some(mut steps) = Steps::new() else { return };
    let controller = || PIController::new(I16F16::from_num(0.003), I16F16::from_num(0.001));
    let (mut foc, mut single) = (Foc::new(controller(), controller()), controller());
    let (mut ours, mut theirs, mut parts) = (Tally::default(), Tally::default(), [Tally::default(); 3]);
    for step in 0..360 {
        let angle = ElectricalAngle::from_turns(step as f32 / 360.0 - 0.5);
        let rotor = angle.rotation(Sine::Exact);
        let phases = Rotating { d: Ampere(0.1), q: Ampere(5.0) }.to_stationary(rotor).to_phases();
        let (instructions, _) =
            count(|| steps.update(black_box(phases), black_box(angle), black_box(Ampere(5.1))));
        ours.push(instructions);
        let fixed = [phases.a, phases.b].map(|current| I16F16::from_num(current.0));
        let radian = I16F16::from_num(angle.turns() * core::f32::consts::TAU);
        let (target, period) = (I16F16::from_num(5.1), I16F16::from_num(1.0 / 24_000.0));
        let (instructions, _) = count(|| {
            update(&mut foc, black_box(fixed), black_box(radian), black_box(target), black_box(period))
        });
        theirs.push(instructions);

        let [sine, cosine] = [rotor.sine, rotor.cosine].map(I16F16::from_num);
        let (instructions, [d, q]) = count(|| {
            let [a, b] = black_box(fixed);
            let turned =
                park(black_box(cosine), black_box(sine), clarke(ThreePhaseBalancedReferenceFrame { a, b }));
            [turned.d, turned.q]
        });
        parts[0].push(instructions);
        let (instructions, voltage) =
            count(|| black_box(&mut single).update(black_box(q), black_box(target), black_box(period)));
        parts[1].push(instructions);
        let (instructions, _) = count(|| {
            let rotating = RotatingReferenceFrame { d: black_box(d), q: black_box(voltage) };
            let stationary = inverse_park(black_box(cosine), black_box(sine), rotating);
            SpaceVector::as_compare_value::<RESOLUTION>(stationary)
        });
        parts[2].push(instructions);
    }
    heading("beside the crate foc 0.3.0");
    ours.print("the same steps here, in single precision");
    theirs.print("foc::Foc::update, in 16.16 fixed point");
    parts[0].print("  Clarke and Park");
    parts[1].print("  one of its two PI controllers");
    parts[2].print("  Park back, space vectors");
    let rest = theirs.mean().saturating_sub(parts[0].mean() + 2 * parts[1].mean() + parts[2].mean());
    hprintln!("{:<48} {:>8}", "  the rest: its sine and cosine", rest);
}
