//! The published crate `foc` (16.16 fixed point) beside the same steps of this firmware in single precision.
//!
//! Its update is sine and cosine, Clarke, Park, two PI controllers, Park back and space vectors. It has no voltage limit, no
//! anti-windup, no feedforward, no dead-time or delay compensation, no borders; converting codes and angles is the caller's.

use core::hint::black_box;

use cortex_m_semihosting::hprintln;
use fixed::types::I16F16;
use foc::pid::PIController;
use foc::pwm::SpaceVector;
use scarab::motor::{
    BridgeTiming, CurrentGains, CurrentLoop, DeadTime, ElectricalAngle, Modulator, MotorConstants, Phases,
    Sine,
};
use scarab::units::{Ampere, Henry, Ohm, Volt, Weber};

use crate::counter::{Tally, count};

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
        let rotor = angle.rotation(Sine::Fast);
        let stationary = currents.to_stationary();
        let measured = stationary.to_rotating(rotor);
        let voltage = self.current_loop.voltage(&self.gains, target, measured, 0.0, Volt(25.0));
        self.modulator.duties(voltage.to_stationary(rotor), 1.0 / 48.0, stationary)
    }
}

type Foc = foc::Foc<SpaceVector, 3500>;

#[inline(never)]
fn update(foc: &mut Foc, currents: [I16F16; 2], angle: I16F16, target: I16F16, period: I16F16) -> [u16; 3] {
    foc.update(currents, angle, target, period)
}

pub fn report() {
    let Some(mut steps) = Steps::new() else { return };
    let controller = || PIController::new(I16F16::from_num(0.003), I16F16::from_num(0.001));
    let mut foc = Foc::new(controller(), controller());
    let (mut ours, mut theirs) = (Tally::default(), Tally::default());
    for step in 0..360 {
        let angle = ElectricalAngle::from_turns(step as f32 / 360.0 - 0.5);
        let rotor = angle.rotation(Sine::Exact);
        let phases =
            scarab::motor::Rotating { d: Ampere(0.1), q: Ampere(5.0) }.to_stationary(rotor).to_phases();
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
    }
    hprintln!("same steps as the crate foc    {:>6} {:>6}", ours.mean(), ours.most());
    hprintln!("crate foc 0.3.0                {:>6} {:>6}", theirs.mean(), theirs.most());
}
