//! Complete drive against closed formulas that hold for every motor, bridge and bus.
#![expect(clippy::disallowed_methods, reason = "expected values by another library than the plant's")]

use crate::plant::common::worn_leg;
use core::f64::consts::{PI, TAU};

use hal_sim::drive::axis::{Axis, AxisFlow, PERIOD_S};
use hal_sim::drive::complete::{CompleteDrives, Rotor};
use hal_sim::drive::description::{
    AxisDescription, BridgeDescription, CompleteDescription, CounterDescription, MotorDescription,
    SHIFT_QUARTERS, ShuntDescription, SupplyDescription, ThermistorDescription, Wiring,
};
use hal_sim::drive::motor::{Direction, Motor, Terminal};
use hal_sim::drive::stand::{Geared, Load, Stand};
use hal_sim::world::World;
use rand_core::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;
use scarab::hal::{AxisCommand, AxisSample};

/// Motor with saliency, so that nothing cancels by chance.
const MOTOR: MotorDescription = MotorDescription {
    resistance: 0.039,
    inductance_d: 15e-6,
    inductance_q: 19e-6,
    flux: 0.002_857,
    pole_pairs: 7,
    electrical_zero: 0.7,
    cogging: 0.0,
    cogging_periods: 84,
    thermal_resistance: 1.0,
    thermal_time: 300.0,
    thermistor: None,
};

const BUS: f64 = 48.0;

fn axis() -> AxisDescription {
    AxisDescription {
        motor: MOTOR,
        bridge: BridgeDescription { on_resistance: 0.0, ..BridgeDescription::default() },
        shunts: ShuntDescription { offset_codes: [0.0; 2], noise_codes: 0.0, ..ShuntDescription::default() },
        counter: CounterDescription { counts: 8192.0, start: 0, index: 0.0, error: 0.0, absolute: false },
        joint_encoder: None,
        wiring: Wiring::default(),
        ratio: 50.0,
    }
}

fn cold(angle: f64) -> Motor {
    Motor::new(&MOTOR, 0.0, Direction::from_angle(angle))
}

/// Phase quantities of an amplitude at `angle` ahead of a phase's axis.
fn phases(amplitude: f64, angle: f64) -> [f64; 3] {
    core::array::from_fn(|phase| amplitude * (angle - TAU / 3.0 * phase as f64).cos())
}

/// Amplitudes along and across a direction.
fn along_and_across(phases: &[f64; 3], angle: f64) -> [f64; 2] {
    let sum = |turn: f64| -> f64 {
        (0..3).map(|phase| phases[phase] * (angle + turn - TAU / 3.0 * phase as f64).cos()).sum()
    };
    [2.0 / 3.0 * sum(0.0), 2.0 / 3.0 * sum(PI / 2.0)]
}

fn held(voltages: [f64; 3]) -> [Terminal; 3] {
    voltages.map(Terminal::Held)
}

#[test]
fn current_of_a_locked_rotor_follows_inductances_and_resistance() {
    let angle = 0.9;
    for (turn, inductance) in [(0.0, MOTOR.inductance_d), (PI / 2.0, MOTOR.inductance_q)] {
        let mut motor = cold(angle);
        let voltages = phases(0.5, angle + turn);
        let duration = 3e-4;
        for _ in 0..3000 {
            motor.advance(&held(voltages), 0.0, duration / 3000.0);
        }
        let expected = 0.5 / MOTOR.resistance * (1.0 - (-duration * MOTOR.resistance / inductance).exp());
        let found = along_and_across(&motor.currents(), angle);
        let index = usize::from(turn > 0.0);
        // Midpoint steps of 0.1 us against a time constant of 0.4 ms.
        assert!((found[index] - expected).abs() < 1e-6, "{found:?} {expected}");
        assert!(found[1 - index].abs() < 1e-9, "the axes couple at rest: {found:?}");
    }
}

#[test]
fn torque_is_that_of_magnets_and_reluctance() {
    let angle = 2.1;
    let (along, across) = (-12.0, 40.0);
    let mut motor = cold(angle);
    // Voltage impulses that charge both axes at once.
    let impulse = [along * MOTOR.inductance_d, across * MOTOR.inductance_q];
    let volts: [f64; 3] = core::array::from_fn(|phase| {
        phases(impulse[0], angle)[phase] + phases(impulse[1], angle + PI / 2.0)[phase]
    });
    motor.advance(&held(volts.map(|volt| volt * 1e9)), 0.0, 1e-9);
    let found = along_and_across(&motor.currents(), angle);
    assert!((found[0] - along).abs() < 1e-3 && (found[1] - across).abs() < 1e-3, "{found:?}");
    let flow = motor.advance(&held([0.0; 3]), 0.0, 1e-12);
    let expected =
        1.5 * 7.0 * (MOTOR.flux * found[1] + (MOTOR.inductance_d - MOTOR.inductance_q) * found[0] * found[1]);
    assert!((flow.impulse / 1e-12 / expected - 1.0).abs() < 1e-6, "{} {expected}", flow.impulse / 1e-12);
}

/// Steady state of a motor with connected terminals, by the textbook's equations.
#[test]
fn a_short_circuit_brakes_with_the_textbook_s_current_and_torque() {
    for speed in [50.0, 600.0, 3000.0] {
        let mut motor = cold(0.0);
        let mut mean = 0.0;
        let step = 2e-6;
        let steps = 20_000;
        for number in 0..steps {
            let flow = motor.advance(&held([0.0; 3]), speed, step);
            if number >= steps / 2 {
                mean += flow.impulse / step / f64::from(steps / 2);
            }
        }
        let (r, ld, lq) = (MOTOR.resistance, MOTOR.inductance_d, MOTOR.inductance_q);
        let across = -r * speed * MOTOR.flux / (r * r + speed * speed * ld * lq);
        let along = speed * lq / r * across;
        let found = along_and_across(&motor.currents(), speed * step * f64::from(steps));
        // 40 ms are a hundred time constants; midpoint steps of 2 us at up to 3000 rad/s.
        assert!((found[0] - along).abs() < 2e-4 * along.abs(), "{found:?} {along}");
        assert!((found[1] - across).abs() < 2e-4 * across.abs().max(along.abs()), "{found:?} {across}");
        let torque = 10.5 * (MOTOR.flux * across + (ld - lq) * along * across);
        assert!((mean / torque - 1.0).abs() < 1e-3, "{mean} {torque}");
    }
}

#[test]
fn open_terminals_have_the_magnets_voltage_and_no_torque() {
    let off = [Terminal::Off(f64::NEG_INFINITY, f64::INFINITY); 3];
    let mut motor = cold(0.0);
    let speed = 1500.0;
    for _ in 0..1000 {
        let flow = motor.advance(&off, speed, 1e-5);
        assert!(flow.impulse.abs() < 1e-15);
    }
    assert!(motor.currents().iter().all(|current| current.abs() < 1e-9));
    // One terminal is held, another is read. The bus is too low for the voltage between phases, so
    // diodes conduct.
    let peak = 3.0_f64.sqrt() * MOTOR.flux * speed;
    for (bus, conducts) in [(0.98 * peak - 1.6, true), (1.02 * peak - 1.6, false)] {
        let diodes = [Terminal::Off(-0.8, bus + 0.8); 3];
        let mut motor = cold(0.0);
        let mut largest = 0.0_f64;
        for _ in 0..2000 {
            motor.advance(&diodes, speed, 5e-6);
            largest = motor.currents().iter().fold(largest, |most, current| most.max(current.abs()));
        }
        assert_eq!(largest > 1e-3, conducts, "{bus} {largest}");
    }
}

/// Duties that apply a voltage (V) at an electrical angle.
fn duties(voltage: f64, angle: f64) -> AxisCommand {
    let duty = phases(voltage, angle).map(|volt| (0.5 + volt / BUS) as f32);
    AxisCommand { enabled: true, duty }
}

/// Runs one period under a command; its sample without noise, and impulse, charge and heat.
fn period(axis: &mut Axis, command: &AxisCommand) -> (AxisSample, AxisFlow) {
    let sample = axis.begin(command, 0, &mut Xoshiro256PlusPlus::seed_from_u64(1));
    let mut sum = AxisFlow::default();
    for _ in 0..4 {
        let flow = axis.advance(BUS);
        sum.impulse += flow.impulse;
        sum.charge += flow.charge;
        sum.heat += flow.heat;
    }
    (sample, sum)
}

/// Rotor at constant speed under a rotating voltage vector; impulse, charge and heat of each period.
fn turning(
    description: &AxisDescription,
    speed: f64,
    voltage: f64,
    lead: f64,
    periods: u32,
) -> (Axis, Vec<AxisFlow>) {
    let mut axis = Axis::new(description, 0.0, 0);
    let mut flows = Vec::new();
    for number in 0..periods {
        let angle = speed * PERIOD_S * f64::from(number);
        axis.set_rotor(angle, speed);
        let electrical = 7.0 * (angle + 0.5 * speed * PERIOD_S) + MOTOR.electrical_zero;
        flows.push(period(&mut axis, &duties(voltage, electrical + lead)).1);
    }
    (axis, flows)
}

#[test]
fn energy_from_the_bus_is_heat_work_and_field() {
    // Motoring and braking at a speed with a back-EMF of 3.0 V.
    let speed = 150.0;
    for lead in [PI / 2.0, 2.3, -PI / 2.0] {
        for dead_time in [0.0, 20.0 / 168e6] {
            let mut description = axis();
            description.bridge.dead_time = dead_time;
            description.bridge.diode_drop = 0.0;
            let (axis, flows) = turning(&description, speed, 4.0, lead, 4000);
            let sum = |of: &dyn Fn(&AxisFlow) -> f64| flows.iter().map(of).sum::<f64>();
            let drawn = BUS * sum(&|flow| flow.charge);
            let spent =
                sum(&|flow| flow.heat) + speed * sum(&|flow| flow.impulse) + axis.motor().field_energy();
            let size = sum(&|flow| flow.heat) + speed * sum(&|flow| flow.impulse.abs());
            // Midpoint steps of at most a quarter (10 us) conserve energy to second order: (10 us /
            // 0.4 ms)^2 is 6e-4. Within a dead time the current's path is implicit of first order.
            let tolerance = if dead_time == 0.0 { 1e-3 } else { 2e-3 };
            assert!((drawn - spent).abs() < tolerance * size, "{lead} {dead_time}: {drawn} {spent}");
        }
    }
}

#[test]
fn dead_time_reduces_the_voltage_against_the_current() {
    let mut with = axis();
    with.bridge.diode_drop = 0.0;
    let mut without = with;
    without.bridge.dead_time = 0.0;
    // A large current in phase A returns in equal parts through B and C, rotor at rest.
    let resistance = MOTOR.resistance;
    let settle = |description: &AxisDescription, voltage: f64| {
        let mut axis = Axis::new(description, 0.0, 0);
        for _ in 0..500 {
            period(&mut axis, &duties(voltage, 0.0));
        }
        axis.currents()[0]
    };
    for voltage in [1.5, -1.5] {
        let lost = (settle(&without, voltage) - settle(&with, voltage)) * resistance;
        // Each output loses dead time / period of the bus voltage in the direction of its current:
        // 1 and 2 x 1/2 of it, 4/3 along A.
        let expected = voltage.signum() * 4.0 / 3.0 * BUS * with.bridge.dead_time / PERIOD_S;
        // Tolerance: ripple at the sample and the timer's steps of 14 mV.
        assert!((lost - expected).abs() < 0.05 * expected.abs(), "{lost} {expected}");
    }
}

#[test]
fn codes_are_the_currents_at_the_middle_of_the_lower_zero_vector() {
    let mut description = axis();
    description.bridge.dead_time = 0.0;
    let (mut axis, _) = turning(&description, 150.0, 4.5, 1.9, 2001);
    let expected = axis.currents();
    let (sample, _) = period(&mut axis, &AxisCommand::OFF);
    let step = description.shunts.ampere_per_code();
    for (channel, code) in sample.shunt_codes.iter().enumerate() {
        let read = (f64::from(*code) - 2048.0) * step;
        // Half a step: the converter waits for the amplifier's lag, to 2 ns of a slope of up to 0.4 A/us.
        assert!((read - expected[channel + 1]).abs() < 0.5 * step + 0.001, "{read} {expected:?}");
        assert!(expected[channel + 1].abs() > 5.0, "{expected:?}");
    }
}

/// Comparison with every step between edges divided by a hundred.
#[test]
fn steps_at_edges_alone_are_fine_enough() {
    let description = axis();
    let speed = 225.0;
    let (coarse, flows) = turning(&description, speed, 6.6, 1.95, 240);
    let mut bridge = hal_sim::drive::bridge::Bridge::new(&description.bridge, PERIOD_S);
    let mut motor = cold(MOTOR.electrical_zero);
    let mut impulse = 0.0;
    for number in 0..240 {
        let angle = speed * PERIOD_S * f64::from(number);
        motor.set_angle(Direction::from_angle(7.0 * angle + MOTOR.electrical_zero));
        let electrical = 7.0 * (angle + 0.5 * speed * PERIOD_S) + MOTOR.electrical_zero;
        bridge.begin(&duties(6.6, electrical + 1.95));
        let mut now = 0.0;
        while now < PERIOD_S {
            bridge.pass(now);
            let next = bridge.next_edge(PERIOD_S);
            let terminals = core::array::from_fn(|output| bridge.output(output, BUS));
            for _ in 0..100 {
                impulse += motor.advance(&terminals, 7.0 * speed, (next - now) / 100.0).impulse;
            }
            now = next;
        }
    }
    let moved: f64 = flows.iter().map(|flow| flow.impulse).sum();
    let worst = coarse
        .currents()
        .iter()
        .zip(motor.currents())
        .fold(0.0_f64, |worst, (one, other)| worst.max((one - other).abs()));
    let size = motor.currents().iter().fold(0.0_f64, |most, current| most.max(current.abs()));
    assert!(size > 20.0, "{size}");
    // A tenth of a converter step of 40 mA; measured 3.8 mA and 4e-5.
    assert!(worst < 5e-3, "{worst:e} A");
    assert!((moved / impulse - 1.0).abs() < 1e-4, "{:e}", moved / impulse - 1.0);
}

pub fn board() -> CompleteDescription<2> {
    CompleteDescription::new([axis(); 2], SupplyDescription::default())
}

#[test]
fn braking_charges_the_capacitor_and_the_brake_resistor_discharges_it() {
    let run = |brake: f64| {
        let mut drives = CompleteDrives::new(&board(), &[0.0; 2], 1);
        let mut highest = 0.0_f64;
        let speed = 225.0;
        for number in 0..2400 {
            let angle = speed * PERIOD_S * f64::from(number);
            let rotor = Rotor { angle, speed };
            let electrical = 7.0 * (angle + 0.5 * speed * PERIOD_S) + MOTOR.electrical_zero;
            let above = drives.supply().voltage() > 50.0;
            let share = if above { brake } else { 0.0 };
            let (_, torque) = drives.period(&[rotor; 2], &[duties(3.5, electrical + 1.75); 2], share);
            assert!(number < 200 || torque.iter().all(|torque| *torque < 0.0), "{torque:?}");
            highest = highest.max(drives.supply().voltage());
        }
        (highest, drives)
    };
    let (unbraked, drives) = run(0.0);
    let returned = -drives.supply().energy().bridges;
    let stored = 0.5 * 1.5e-3 * (drives.supply().voltage().powi(2) - BUS * BUS);
    assert!(unbraked > 55.0, "{unbraked}");
    assert!((stored / returned - 1.0).abs() < 0.1, "{stored} {returned}");
    let (braked, _) = run(1.0);
    assert!(braked < 51.0, "{braked}");
}

#[test]
fn an_axis_applies_a_command_half_a_period_after_the_previous_axis() {
    let mut drives = CompleteDrives::new(&board(), &[0.0; 2], 1);
    let command = duties(3.0, 0.3);
    let bus = |drives: &CompleteDrives<2>| drives.axes().map(|axis| axis.currents()[0]);
    drives.period(&[Rotor::default(); 2], &[command; 2], 0.0);
    let first = bus(&drives);
    // The second axis has had half of its period, one of two equal pulses; the first axis' pulse
    // has decayed by at most a tenth.
    assert!(first[0] > 0.5 && (0.5..0.56).contains(&(first[1] / first[0])), "{first:?}");
}

/// Codes of both axes' shunts after some periods with this voltage along A in the second axis and
/// none in the first.
fn codes_beside(volt: f64, shift_quarters: u32, ampere_per_edge: f64) -> [[u16; 2]; 2] {
    let mut description = board();
    description.shift_quarters = shift_quarters;
    description.coupling.ampere_per_edge = ampere_per_edge;
    let mut drives = CompleteDrives::new(&description, &[0.0; 2], 1);
    let commands = [duties(0.0, 0.0), duties(volt, 0.0)];
    let mut samples = [AxisSample::default(); 2];
    for _ in 0..6 {
        samples = drives.period(&[Rotor::default(); 2], &commands, 0.0).0;
    }
    samples.map(|sample| sample.shunt_codes)
}

#[test]
fn edges_of_the_other_bridge_disturb_at_quarter_but_not_half_period() {
    let step = axis().shunts.ampere_per_code();
    let errors = |volt: f64, shift: u32, ampere: f64| {
        let [with, without] = [ampere, 0.0].map(|ampere| codes_beside(volt, shift, ampere));
        [0, 1].map(|axis| {
            [0, 1].map(|shunt| (f64::from(with[axis][shunt]) - f64::from(without[axis][shunt])) * step)
        })
    };
    // Without a voltage all three outputs of the second axis fall at three quarters of its period,
    // the first axis' sampling instant. The outputs of the first rise at a quarter of its own
    // period, the second axis' sampling instant.
    for (axis, sum) in errors(0.0, 1, 0.8).into_iter().zip([-2.4, 2.4]) {
        assert!(axis.iter().all(|error| (error - sum).abs() < 0.6 * step), "{axis:?} {sum}");
    }
    // Output A of the second axis leaves the window first: 12 V are a quarter of the bus.
    let [first, _] = errors(12.0, 1, 0.8);
    assert!(first.iter().all(|error| error.abs() < 1.0), "{first:?}");
    for volt in [0.0, 3.0, 12.0, 20.0] {
        assert_eq!(errors(volt, SHIFT_QUARTERS, 0.8), [[0.0; 2]; 2], "{volt} V");
    }
    // Disabled unless described.
    assert_eq!(board().coupling.ampere_per_edge, 0.0);
    // A pulse of 2.5 % about the middle of the second axis' period rises 0.52 us before the middle.
    let mut narrow = Axis::new(&axis(), 0.0, 0);
    let mut noise = Xoshiro256PlusPlus::seed_from_u64(1);
    narrow.begin(&AxisCommand { enabled: true, duty: [0.025, 0.5, 0.5] }, 0, &mut noise);
    for _ in 0..2 {
        narrow.advance(BUS);
    }
    assert_eq!([narrow.edges(-0.938e-6, 0.262e-6), narrow.edges(-0.3e-6, 0.262e-6)], [1, 0]);
}

#[test]
fn wiring_connects_outputs_to_the_described_phases() {
    let current = |wiring: Wiring| {
        let mut description = axis();
        description.wiring = wiring;
        description.bridge.dead_time = 0.0;
        let mut axis = Axis::new(&description, 0.0, 0);
        let mut sample = AxisSample::default();
        for _ in 0..200 {
            sample = period(&mut axis, &duties(1.0, TAU / 3.0)).0;
        }
        sample.shunt_codes.map(|code| (f64::from(code) - 2048.0) * description.shunts.ampere_per_code())
    };
    let plain = current(Wiring::default());
    // 1 V along output B at rest: 25.6 A into it, half of it out of A and C each. Another rotor
    // angle changes only the inductance.
    assert!((plain[0] - 25.6).abs() < 0.5 && (plain[1] + 12.8).abs() < 0.5, "{plain:?}");
    let exchanged = current(Wiring { shunts_exchanged: true, ..Wiring::default() });
    assert!((exchanged[1] - plain[0]).abs() < 0.1 && (exchanged[0] - plain[1]).abs() < 0.1);
    let inverted = current(Wiring { shunts_inverted: [true, false], ..Wiring::default() });
    assert!((inverted[0] + plain[0]).abs() < 0.1 && (inverted[1] - plain[1]).abs() < 0.1);
    let open = current(Wiring { open: Some(1), ..Wiring::default() });
    assert!(open[0].abs() < 0.1, "{open:?}");
    let swapped = current(Wiring { phases: [0, 2, 1], ..Wiring::default() });
    assert!((swapped[0] - plain[0]).abs() < 0.5, "the current of the bridge's output differs: {swapped:?}");
}

#[test]
fn a_loaded_winding_warms_by_thermal_resistance_times_power() {
    let mut description = axis();
    description.motor.thermal_time = 0.05;
    let mut axis = Axis::new(&description, 0.0, 0);
    let mut heat = 0.0;
    for _ in 0..24_000 {
        heat = period(&mut axis, &duties(1.0, 0.0)).1.heat;
    }
    let power = heat / PERIOD_S;
    // 1 K/W, twenty time constants; the power itself falls as the resistance rises.
    assert!((axis.motor().temperature() - 20.0 - power).abs() < 0.01 * power, "{power}");
    let resistance = MOTOR.resistance * (1.0 + 0.00393 * power);
    assert!((axis.motor().resistance() / resistance - 1.0).abs() < 0.01);
}

#[test]
fn a_thermistor_follows_its_winding_with_a_lag() {
    let mut description = axis();
    description.motor.thermistor =
        Some(ThermistorDescription { pull_up: 3300.0, at_25_c: 10_000.0, beta: 3435.0, lag: 10.0 });
    let code = |seconds: f64| {
        let mut motor = Motor::new(&description.motor, 0.0, Direction::from_angle(0.0));
        // 60 K above 20 degrees within a moment, by the time constant of 300 s; then 1 K/W holds them.
        motor.warm(60.0 * 300.0, 0.0);
        for _ in 0..(1e3 * seconds) as u32 {
            motor.warm(0.06, 1e-3);
        }
        assert!((motor.temperature() - 80.0).abs() < 0.01, "{}", motor.temperature());
        f64::from(motor.thermistor_code().expect("fitted"))
    };
    // 103AT-2 (Semitec) at 20 and 80 degrees: 12.09 and 1.668 kOhm.
    let divided = |ohm: f64| 4096.0 * ohm / (ohm + 3300.0);
    assert!((code(0.0) / divided(12_090.0) - 1.0).abs() < 0.01, "{}", code(0.0));
    assert!((code(100.0) / divided(1668.0) - 1.0).abs() < 0.03, "{}", code(100.0));
    assert!(code(10.0) < code(5.0) && code(10.0) > code(20.0));
}

#[test]
fn a_free_rotor_accelerates_by_the_torque_and_sticks_at_rest() {
    let load = |torque: f64| Load::Free { inertia: 2e-4, coulomb: 0.02, viscous: 0.0, torque };
    let mut stand = Stand::new(&axis(), &SupplyDescription::default(), load(0.015), 0.3, 1);
    for _ in 0..1000 {
        stand.period(&AxisCommand::OFF, 0.0);
    }
    assert_eq!(stand.rotor(), Rotor { angle: 0.3, speed: 0.0 }, "a load below the friction moves the rotor");
    stand.set_load(load(0.05));
    for _ in 0..2400 {
        stand.period(&AxisCommand::OFF, 0.0);
    }
    let expected = -(0.05 - 0.02) / 2e-4 * 0.1;
    assert!((stand.rotor().speed / expected - 1.0).abs() < 1e-9, "{:?}", stand.rotor());
}

/// Samples and states of a world under commands that excite both axes.
fn shaken(world: &mut World<2>, periods: core::ops::Range<u32>) -> Vec<[AxisSample; 2]> {
    let command = |number: u32, turn: f64| duties(1.2, f64::from(number / 600) * 0.9 + turn);
    periods.map(|number| world.period(&[command(number, 0.0), command(number, 2.0)], 0.0)).collect()
}

#[test]
fn a_world_with_complete_drives_and_its_copies_repeat_bit_for_bit() {
    let noisy = || {
        let mut board = board();
        for axis in &mut board.axes {
            axis.shunts = ShuntDescription::default();
            axis.motor.cogging = 0.017;
        }
        board
    };
    let start = |seed: u64| World::with_complete_drives(&worn_leg(), &noisy(), seed);
    let (mut one, mut same, mut other) = (start(7), start(7), start(8));
    let first = shaken(&mut one, 0..4000);
    assert!(first == shaken(&mut same, 0..4000));
    assert!(first != shaken(&mut other, 0..4000));
    let mut copy = one.clone();
    assert!(copy == one);
    assert!(shaken(&mut copy, 4000..6000) == shaken(&mut one, 4000..6000));
    assert!(copy == one);
    copy.period(&[AxisCommand::OFF; 2], 0.0);
    assert!(copy != one);
    let moved = one.truth();
    assert!((moved.time_s - 0.25).abs() < 1e-12 && moved.motor_torque[0].abs() > 1.0, "{moved:?}");
}

#[test]
fn a_coasting_leg_swings_as_with_ideal_drives_off() {
    // Without current the electrical part has no effect; only the step of the mechanics differs, 42
    // instead of 250 us.
    let mut ideal = World::new(&worn_leg(), 1);
    let mut complete = World::with_complete_drives(&worn_leg(), &board(), 1);
    for world in [&mut ideal, &mut complete] {
        world.move_to(&[1.2, -0.4]);
        for _ in 0..4000 {
            world.advance();
        }
    }
    for joint in 0..2 {
        let (one, two) = (ideal.anatomical_position()[joint], complete.anatomical_position()[joint]);
        assert!((one - two).abs() < 1e-5, "{one} {two}");
    }
    assert!((ideal.anatomical_position()[0] - 1.2).abs() > 0.1, "it swings");
}

/// Period of a leg of 2 kg m^2 and 40 N m that swings freely behind a gear with this backlash, s.
fn swing(backlash: f64) -> f64 {
    let leg = Geared {
        rotor_inertia: 1e-3,
        rotor_coulomb: 0.0,
        rotor_viscous: 0.0,
        ratio: 50.0,
        backlash,
        inertia: 2.0,
        coulomb: 0.0,
        viscous: 0.0,
        gravity: 40.0,
        start: 0.02,
        supported_s: 0.0,
    };
    let supply = SupplyDescription::default();
    let mut stand = Stand::new(&axis(), &supply, Load::Geared(leg), 0.3, 1);
    let mut crossings = Vec::new();
    let mut before = leg.start;
    for period in 0..120_000 {
        stand.period(&AxisCommand::OFF, 0.0);
        let angle = leg.start + stand.joint().angle;
        if before > 0.0 && angle <= 0.0 {
            crossings.push(f64::from(period) * PERIOD_S);
        }
        before = angle;
    }
    (crossings[1] - crossings[0]).max(crossings[2] - crossings[1])
}

#[test]
fn a_leg_behind_a_gear_swings_with_the_rotor_and_within_the_backlash_without_it() {
    let period = |inertia: f64| TAU * (inertia / 40.0).sqrt();
    // The rotor counts with the square of the ratio: 2.5 kg m^2.
    assert!((swing(0.0) / period(2.0 + 2.5) - 1.0).abs() < 2e-3, "{}", swing(0.0));
    // Half of the backlash is more than the swing's whole width.
    assert!((swing(0.1) / period(2.0) - 1.0).abs() < 2e-3, "{}", swing(0.1));
}
