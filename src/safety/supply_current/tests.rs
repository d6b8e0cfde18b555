use super::*;

const LIMITS: SupplyLimits =
    SupplyLimits { draw: Some(Ampere(10.0)), charge: Some(Ampere(4.0)), brake: Ohm(2.0) };
const BUS: Volt = Volt(48.0);
/// Servo ticks per second.
const SECOND: u32 = SERVO_RATE_HZ;

/// A leg whose torque draws a current that grows with a power of the torque's share, on a bus of 48 V.
#[derive(Clone, Copy)]
struct Leg {
    /// Current with the whole torque cap, A; negative where the leg returns energy.
    full_a: f32,
    /// Power of the torque: 1 for mechanical power, 2 for the windings' heat.
    power: u8,
    /// Share of the cap that is requested.
    wanted: f32,
}

/// Runs the closed loop for two seconds: a torque acts two ticks after its share, delayed as that of a
/// current loop. Returns current and share in each tick.
fn closed(leg: Leg, limits: SupplyLimits, resistor: bool) -> Vec<(f32, f32, Option<FaultCode>)> {
    let mut supply = SupplyCurrent::new(limits);
    let (mut torque, mut late, mut given) = (0.0_f32, [0.0_f32; 2], 0.0);
    let tick = |_| {
        torque += 0.75 * (late[0] - torque);
        let bridges = leg.full_a * if leg.power == 1 { torque } else { torque * torque };
        let found = supply.advance(bridges * BUS.0, given, BUS);
        let current = bridges + given * BUS.0 / 2.0;
        given = if resistor { supply.brake_duty() } else { 0.0 };
        let share = supply.shares()[usize::from(leg.full_a < 0.0)];
        late = [late[1], leg.wanted.min(share)];
        (current, share, found)
    };
    (0..2 * SECOND).map(tick).collect()
}

#[test]
fn the_closed_loop_settles_below_the_limit_without_chatter() {
    for power in [1, 2] {
        for full_a in [12.0, 30.0, 100.0, 300.0] {
            for wanted in [0.5, 1.0] {
                let leg = Leg { full_a, power, wanted };
                let run = closed(leg, LIMITS, false);
                let (current, share, _) = run[run.len() - 1];
                let settled = &run[run.len() / 4..];
                let swing = settled.iter().fold(0.0_f32, |most, (_, now, _)| most.max((now - share).abs()));
                assert!(swing < 1e-3 * share, "{full_a} {power} {wanted}: share {share}, swing {swing}");
                assert!(current < 9.01, "{full_a} {power} {wanted}: {current}");
                // At most thirty times the limit at once: the share passes its end by half.
                let least = run.iter().fold(1.0_f32, |least, (_, now, _)| least.min(*now));
                assert!(least > 0.45 * share, "{full_a} {power} {wanted}: {least} {share}");
                assert!(run.iter().all(|(.., found)| found.is_none()), "{full_a} {power} {wanted}");
            }
        }
    }
}

#[test]
fn returned_current_goes_to_the_resistor_first_and_then_costs_torque() {
    let leg = Leg { full_a: -12.0, power: 1, wanted: 1.0 };
    let (current, share, _) = closed(leg, LIMITS, true)[SECOND as usize];
    assert!((current + 3.0).abs() < 0.01 && share == 1.0, "{current} {share}");
    let (current, share, _) = closed(leg, LIMITS, false)[SECOND as usize];
    assert!((current + 3.6).abs() < 0.01 && share < 0.31, "{current} {share}");
    // More than the resistor can take at 0.95: 22.8 A.
    let strong = Leg { full_a: -60.0, ..leg };
    let (current, share, _) = closed(strong, LIMITS, true)[SECOND as usize];
    assert!((current + 3.6).abs() < 0.01 && share < 0.5, "{current} {share}");
}

#[test]
fn a_current_that_no_share_reduces_is_a_fault_after_a_fifth_of_a_second() {
    for (current_a, expected) in
        [(12.6, Some(FaultCode::SupplyCurrent)), (-5.1, Some(FaultCode::ChargeCurrent))]
    {
        let mut supply = SupplyCurrent::new(LIMITS);
        let found =
            (0..SECOND).find_map(|tick| supply.advance(current_a * BUS.0, 0.0, BUS).map(|code| (tick, code)));
        let (tick, code) = found.expect("a fault");
        // The low-pass reaches 99 percent of a step after 35 ticks.
        assert!((u32::from(FAULT_TICKS) - 1..u32::from(FAULT_TICKS) + 40).contains(&tick), "{tick}");
        assert_eq!(Some(code), expected);
    }
    for current_a in [12.4, -4.9] {
        let mut supply = SupplyCurrent::new(LIMITS);
        assert!((0..SECOND).all(|_| supply.advance(current_a * BUS.0, 0.0, BUS).is_none()), "{current_a}");
    }
}

#[test]
fn without_limits_nothing_is_reduced_or_braked() {
    let mut supply = SupplyCurrent::new(SupplyLimits::NONE);
    for power_w in [1e4, -1e4, f32::INFINITY] {
        assert!((0..SECOND).all(|_| supply.advance(power_w, 0.5, BUS).is_none()));
        assert_eq!((supply.shares(), supply.brake_duty()), ([1.0; 2], 0.0));
    }
}

#[test]
fn a_power_that_is_not_finite_leaves_a_finite_estimate() {
    let mut supply = SupplyCurrent::new(LIMITS);
    for (power_w, bus) in [(f32::NAN, BUS), (f32::INFINITY, BUS), (1.0, Volt(0.0)), (1.0, Volt(f32::NAN))] {
        let _ = supply.advance(power_w, 0.0, bus);
        assert!(supply.bridges_a.is_finite() && supply.brake_duty().is_finite(), "{supply:?}");
    }
    (0..SECOND).for_each(|_| {
        let _ = supply.advance(48.0, 0.0, BUS);
    });
    assert!((supply.bridges_a - 1.0).abs() < 1e-3 && supply.shares() == [1.0; 2], "{supply:?}");
}
