use super::*;
use crate::hal::CURRENT_RATE_HZ;
use crate::motor::testing::MOTOR;

const PERIOD_S: f64 = 1.0 / CURRENT_RATE_HZ as f64;

/// A motor in the rotor's frame with the loop's delay: the voltage of one sample acts from the next on.
struct Plant {
    current: [f64; 2],
    pending: [f64; 2],
    speed: f64,
    flux: f64,
}

impl Plant {
    fn at(speed: f64) -> Self {
        // State after a long time at zero current.
        Self { current: [0.0; 2], pending: [0.0, speed * 2.9e-3], speed, flux: 2.9e-3 }
    }

    fn step(&mut self, volts: Rotating<Volt>) {
        let acting = core::mem::replace(&mut self.pending, [f64::from(volts.d.0), f64::from(volts.q.0)]);
        for _ in 0..50 {
            let step = PERIOD_S / 50.0;
            let [id, iq] = self.current;
            self.current[0] += step * (acting[0] - 0.05 * id + self.speed * 27e-6 * iq) / 24e-6;
            self.current[1] += step * (acting[1] - 0.05 * iq - self.speed * (24e-6 * id + self.flux)) / 27e-6;
        }
    }

    fn measured(&self) -> Rotating<Ampere> {
        Rotating { d: Ampere(self.current[0] as f32), q: Ampere(self.current[1] as f32) }
    }
}

fn gains(bandwidth: f32, feedforward: bool) -> CurrentGains {
    CurrentGains::new(&MOTOR, Hertz(bandwidth), feedforward).expect("usual")
}

fn quadrature(q: Ampere) -> Rotating<Ampere> {
    Rotating { d: Ampere::ZERO, q }
}

fn settled(plant: &mut Plant, gains: &CurrentGains, target: f32, limit: f32, ticks: usize) -> CurrentLoop {
    let mut current_loop = CurrentLoop::default();
    for _ in 0..ticks {
        let volts = current_loop.voltage(
            gains,
            quadrature(Ampere(target)),
            plant.measured(),
            plant.speed as f32,
            Volt(limit),
        );
        plant.step(volts);
    }
    current_loop
}

#[test]
fn a_step_arrives_without_error_with_the_overshoot_of_its_phase_margin() {
    for (bandwidth, margin, most) in [(500.0, 78.75, 0.02), (1000.0, 67.5, 0.05), (2000.0, 45.0, 0.35)] {
        let gains = gains(bandwidth, true);
        let phase_margin_deg = 90.0 - 360.0 * DELAY_PERIODS * gains.bandwidth.0 / CURRENT_RATE_HZ as f32;
        assert!((phase_margin_deg - margin).abs() < 1e-3);
        let mut plant = Plant::at(0.0);
        let mut current_loop = CurrentLoop::default();
        let (mut peak, mut crossed) = (0.0_f64, None);
        for tick in 0..600 {
            let volts =
                current_loop.voltage(&gains, quadrature(Ampere(10.0)), plant.measured(), 0.0, Volt(24.0));
            plant.step(volts);
            peak = peak.max(plant.current[1]);
            if plant.current[1] > 6.32 && crossed.is_none() {
                crossed = Some(tick);
            }
        }
        let [d, q] = plant.current;
        assert!((q - 10.0).abs() < 0.01 && d.abs() < 1e-3, "{d} {q}");
        assert!(peak < 10.0 * (1.0 + most), "{bandwidth}: {peak}");
        // A first-order lag of the bandwidth reaches 63 % after 1 / (2 pi f); one and a half periods of delay
        // come before.
        let expected = 1.0 / (core::f64::consts::TAU * f64::from(bandwidth)) / PERIOD_S + 1.5;
        let crossed = crossed.expect("reached") as f64 + 1.0;
        assert!((crossed - expected).abs() < 1.5, "{bandwidth}: {crossed} of {expected} ticks");
    }
}

#[test]
fn feedforward_keeps_a_step_of_one_axis_out_of_the_other() {
    // 1500 rad/s electrical: 215 rad/s at the motor, 246 degrees/s behind a gear of 50.
    let disturbed = |feedforward| {
        let gains = gains(1000.0, feedforward);
        let mut plant = Plant::at(1500.0);
        let mut current_loop = settled(&mut plant, &gains, 0.0, 24.0, 2000);
        let mut worst = 0.0_f64;
        for _ in 0..200 {
            let volts =
                current_loop.voltage(&gains, quadrature(Ampere(20.0)), plant.measured(), 1500.0, Volt(24.0));
            plant.step(volts);
            worst = worst.max(plant.current[0].abs());
        }
        worst
    };
    let (with, without) = (disturbed(true), disturbed(false));
    // The remainder is due to the delay: 1.5 periods of a change that takes four.
    assert!(with < 0.45 * without && with < 1.5, "{with} A with, {without} A without");
}

#[test]
fn the_sign_of_each_feedforward_is_the_motors() {
    let gains = gains(1000.0, true);
    let at_rest = Rotating { d: Ampere(2.0), q: Ampere(3.0) };
    let volts =
        |speed| CurrentLoop::default().voltage(&gains, quadrature(Ampere(3.0)), at_rest, speed, Volt(24.0));
    let (forward, still) = (volts(1000.0), volts(0.0));
    assert!((forward.d.0 - still.d.0 + 1000.0 * 27e-6 * 3.0).abs() < 1e-5, "{forward:?} {still:?}");
    assert!((forward.q.0 - still.q.0 - 1000.0 * (24e-6 * 2.0 + 2.9e-3)).abs() < 1e-5);
}

#[test]
fn at_the_limit_the_field_stays_and_the_voltage_never_exceeds_it() {
    let gains = gains(1000.0, true);
    // The back-EMF is 4.6 V; 40 A need 2.7 V across and 2 V along: 5 V are too few.
    let mut plant = Plant::at(1600.0);
    let mut current_loop = CurrentLoop::default();
    for tick in 0..4000 {
        let volts =
            current_loop.voltage(&gains, quadrature(Ampere(40.0)), plant.measured(), 1600.0, Volt(5.0));
        assert!(volts.d.0 * volts.d.0 + volts.q.0 * volts.q.0 <= 25.001);
        plant.step(volts);
        if tick > 1000 {
            assert!(plant.current[0].abs() < 0.2, "{:?}", plant.current);
        }
    }
    assert!(plant.current[1] > 0.0 && plant.current[1] < 15.0, "{:?}", plant.current);
}

#[test]
fn nothing_winds_up_at_the_limit() {
    let gains = gains(1000.0, true);
    let recovery = |ticks_at_limit| {
        let mut plant = Plant::at(1600.0);
        let mut current_loop = settled(&mut plant, &gains, 40.0, 5.0, ticks_at_limit);
        let mut last_outside = 0;
        for tick in 0..2000 {
            let volts =
                current_loop.voltage(&gains, quadrature(Ampere(0.0)), plant.measured(), 1600.0, Volt(5.0));
            plant.step(volts);
            if plant.current[1].abs() > 0.5 {
                last_outside = tick;
            }
        }
        last_outside
    };
    // Recovery is independent of the time at the limit. 30 ticks are 1.25 ms: from 8 A to 0.5 A with L/R =
    // 0.5 ms.
    let (short, long) = (recovery(400), recovery(40_000));
    assert!(short == long && long < 30, "{short}, {long} ticks");
}

#[test]
fn another_bandwidth_gives_the_gains_that_were_derived_for_it() {
    let mut changed = gains(1000.0, true);
    changed.set_bandwidth(Hertz(500.0));
    let derived = gains(500.0, true);
    assert!((changed.least_ohm() / derived.least_ohm() - 1.0).abs() < 1e-6);
    assert!((changed.proportional_ohm.q / derived.proportional_ohm.q - 1.0).abs() < 1e-6);
    assert_eq!(changed.bandwidth, derived.bandwidth);
}

#[test]
fn absurd_motors_and_bandwidths_are_refused() {
    let refused = |change: fn(&mut MotorConstants), bandwidth| {
        let mut motor = MOTOR;
        change(&mut motor);
        CurrentGains::new(&motor, Hertz(bandwidth), true).is_none()
    };
    assert!(refused(|_| (), 5000.0) && refused(|_| (), f32::NAN) && !refused(|_| (), 1000.0));
    assert!(refused(|m| m.resistance.0 = 0.0, 1000.0) && refused(|m| m.flux.0 = -1.0, 1000.0));
    assert!(refused(|m| m.direct_inductance.0 = f32::NAN, 1000.0));
    assert!(refused(|m| m.quadrature_inductance.0 = 1.0, 1000.0));
}

#[test]
fn a_loop_that_takes_over_goes_on_with_the_voltage_that_held_the_current() {
    let gains = CurrentGains::new(&MOTOR, Hertz(1000.0), false).expect("usual");
    let held = Rotating { d: Volt(1.5), q: Volt(-0.5) };
    let current = Rotating { d: Ampere::ZERO, q: Ampere(7.0) };
    let voltage =
        CurrentLoop::holding(held).voltage(&gains, quadrature(Ampere(7.0)), current, 0.0, Volt(20.0));
    assert!((voltage.d.0 - 1.5).abs() < 1e-6 && (voltage.q.0 + 0.5).abs() < 1e-6, "{voltage:?}");
}

#[test]
fn the_power_is_that_of_the_motors_terminals() {
    for feedforward in [true, false] {
        for speed in [-900.0, 0.0, 900.0] {
            for target in [-30.0, 30.0] {
                let mut plant = Plant::at(speed);
                let current_loop = settled(&mut plant, &gains(1000.0, feedforward), target, 20.0, 2000);
                let [d, q] = plant.current;
                // The settled voltages act: 1.5 v i.
                let expected = 1.5 * (plant.pending[0] * d + plant.pending[1] * q);
                let gains = gains(1000.0, feedforward);
                let power = f64::from(current_loop.power_w(&gains, plant.measured(), speed as f32));
                assert!((power - expected).abs() < 0.01 * expected.abs(), "{power} W, not {expected} W");
            }
        }
    }
}
