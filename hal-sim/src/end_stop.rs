//! The mechanical end stops of a joint.
//!
//! Why: a leg with its drive off falls. The end stop decides where it rests and whether it can be enabled
//! there.
//!
//! ```text
//! torque = -(STIFFNESS depth + DAMPING rate)   while the joint is beyond a stop; never a pull
//! ```
//!
//! Each stop stands for a buffer of stiff rubber. The thigh with its shank (some 5 kg m^2) falls against it
//! at 1 rad/s, which is 2.5 J: 10,000 N m/rad absorb them within 1.3 degrees, and the drive's 85 N m press a
//! joint 0.5 degrees into it. The damping is a quarter of the critical damping at 4 kg m^2. Both values are
//! assumptions, not measurements. Integration in steps of a servo tick stays stable down to 0.03 kg m^2. N m,
//! rad, rad/s, anatomical. Cost: two comparisons per joint and step away from the stops.

/// N m/rad.
const STIFFNESS: f64 = 10e3;
/// N m s/rad.
const DAMPING: f64 = 100.0;

/// Torque of both stops on a joint at this angle, with this rate.
pub fn torque(stops: Option<[f64; 2]>, angle: f64, rate: f64) -> f64 {
    let Some([low, high]) = stops else { return 0.0 };
    if angle > high {
        (STIFFNESS * (high - angle) - DAMPING * rate).min(0.0)
    } else if angle < low {
        (STIFFNESS * (low - angle) - DAMPING * rate).max(0.0)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stop_pushes_back_but_never_pulls() {
        let stops = Some([-0.1, 1.0]);
        for (angle, rate, expected) in [
            (0.99, 9.0, 0.0),
            (-0.09, -9.0, 0.0),
            (1.01, 1.0, -200.0),
            (-0.11, -1.0, 200.0),
            (1.01, -2.0, 0.0),
        ] {
            assert!((torque(stops, angle, rate) - expected).abs() < 1e-9, "{angle} {rate}");
        }
        assert_eq!(torque(None, 9.0, 9.0), 0.0);
    }
}
