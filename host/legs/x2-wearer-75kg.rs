// The leg `x2-wearer-75kg`, written by `cargo fw --leg ... --source ...`. Change its leg file instead.

#[rustfmt::skip]
mod described {
use crate::ident::{Choice::*, Constant::*, DriveChoice, Estimator::*, Plan::*};
use crate::leg::{JointDescription, LegDescription, LinkDescription, MotorDescription};
use crate::model::DenavitHartenberg;
use crate::motion::ExcitationTable;
use crate::motor::AbsoluteEncoders;
use crate::safety::{SupplyLimits, WindingRating};
use crate::units::*;

/// The leg.
pub const LEG: LegDescription<2> = LegDescription {
    name: "x2-wearer-75kg",
    gravity: [
        9.81,
        0.0,
        0.0,
    ],
    supply: SupplyLimits {
        draw: None,
        charge: None,
        brake: Ohm(
            2.0,
        ),
    },
    holding_brake: None,
    assist: None,
    joints: [
        JointDescription {
            geometry: DenavitHartenberg {
                alpha: 0.0,
                a: 0.0,
                d: 0.0,
            },
            direction: 1,
            zero_offset: 0.0,
            mirrored: false,
            radian_per_count: Radian(
                1.5339809e-5,
            ),
            torque_per_ampere: NewtonMetrePerAmpere(
                1.5,
            ),
            range: [
                Radian(
                    0.037873644,
                ),
                Radian(
                    0.8758062,
                ),
            ],
            speed: RadianPerSecond(
                4.499459,
            ),
            acceleration: RadianPerSecondSquared(
                34.906586,
            ),
            torque: NewtonMetre(
                85.0,
            ),
            current: Ampere(
                56.666668,
            ),
            inertia: KilogramMetreSquared(
                5.2025476,
            ),
            bandwidth: Hertz(
                6.0,
            ),
            drive: DriveChoice {
                rotor: On,
                constant: On,
                meaning: Offset,
                within_nm: None,
            },
            stribeck: Auto,
            motor: MotorDescription {
                pole_pairs: 7,
                flux: Weber(
                    0.0028571428,
                ),
                counts_per_turn: 8192,
                ratio: 50.0,
                winding: WindingRating {
                    rise: 0.07685294,
                    time_s: 300.0,
                    ambient_c: 40.0,
                    limit_c: 100.0,
                },
                thermistor: None,
                calibration_turns: 1.25,
                absolute: AbsoluteEncoders {
                    rotor: false,
                    joint: None,
                },
            },
        },
        JointDescription {
            geometry: DenavitHartenberg {
                alpha: 0.0,
                a: 0.39,
                d: 0.0,
            },
            direction: -1,
            zero_offset: 0.0,
            mirrored: false,
            radian_per_count: Radian(
                1.5339809e-5,
            ),
            torque_per_ampere: NewtonMetrePerAmpere(
                1.5,
            ),
            range: [
                Radian(
                    -1.667313,
                ),
                Radian(
                    -0.119555056,
                ),
            ],
            speed: RadianPerSecond(
                4.499459,
            ),
            acceleration: RadianPerSecondSquared(
                34.906586,
            ),
            torque: NewtonMetre(
                85.0,
            ),
            current: Ampere(
                56.666668,
            ),
            inertia: KilogramMetreSquared(
                2.3093956,
            ),
            bandwidth: Hertz(
                6.0,
            ),
            drive: DriveChoice {
                rotor: On,
                constant: On,
                meaning: Offset,
                within_nm: None,
            },
            stribeck: Auto,
            motor: MotorDescription {
                pole_pairs: 7,
                flux: Weber(
                    0.0028571428,
                ),
                counts_per_turn: 8192,
                ratio: 50.0,
                winding: WindingRating {
                    rise: 0.07685294,
                    time_s: 300.0,
                    ambient_c: 40.0,
                    limit_c: 100.0,
                },
                thermistor: None,
                calibration_turns: 1.25,
                absolute: AbsoluteEncoders {
                    rotor: false,
                    joint: None,
                },
            },
        },
    ],
    prior: Some(
        [
            LinkDescription {
                mass: 9.84,
                centre_of_mass: [
                    0.198617,
                    0.0,
                    0.0,
                ],
                inertia: [
                    [
                        0.02595,
                        0.0,
                        0.0,
                    ],
                    [
                        0.0,
                        0.17447,
                        0.0,
                    ],
                    [
                        0.0,
                        0.0,
                        0.17447,
                    ],
                ],
                rotor_inertia: 1.7,
                coulomb_friction: 4.0,
                viscous_friction: 4.0,
                offset: 0.0,
            },
            LinkDescription {
                mass: 6.63,
                centre_of_mass: [
                    0.254821,
                    0.029362,
                    0.0,
                ],
                inertia: [
                    [
                        0.038266,
                        -0.028262,
                        0.0,
                    ],
                    [
                        -0.028262,
                        0.143377,
                        0.0,
                    ],
                    [
                        0.0,
                        0.0,
                        0.173169,
                    ],
                ],
                rotor_inertia: 1.7,
                coulomb_friction: 4.0,
                viscous_friction: 4.0,
                offset: 0.0,
            },
        ],
    ),
    plan: OneTime,
    swarm_seed: 1,
    estimator: Robust,
    bandwidth_hz: 16.0,
    excitation: ExcitationTable {
        period_s: 10.0,
        blend_s: 1.0,
        cycles: 2,
        centre_rad: [
            0.49000102,
            -0.84378934,
        ],
        sine_rad: [
            [
                0.16094999,
                0.19199787,
                -0.073413275,
                0.032524455,
                0.07350548,
                0.0,
            ],
            [
                0.1719414,
                -0.018755857,
                -0.18739118,
                0.17622581,
                0.053005245,
                0.0,
            ],
        ],
        cosine_rad: [
            [
                -0.027946783,
                0.1679478,
                -0.06606502,
                0.09734972,
                0.08177971,
                0.0,
            ],
            [
                0.19645625,
                0.09234641,
                -0.14566354,
                0.23661666,
                -0.19379689,
                0.0,
            ],
        ],
    },
    validation: [
        ExcitationTable {
            period_s: 6.5,
            blend_s: 1.0,
            cycles: 1,
            centre_rad: [
                0.480634,
                -0.5982378,
            ],
            sine_rad: [
                [
                    -0.080927424,
                    0.03990172,
                    0.0065903636,
                    0.0024085543,
                    0.0011623893,
                    0.0006527531,
                ],
                [
                    0.3059859,
                    -0.09030858,
                    -0.19125319,
                    0.016653933,
                    0.03001268,
                    0.0015219271,
                ],
            ],
            cosine_rad: [
                [
                    0.17240188,
                    0.00588176,
                    -0.008000589,
                    -0.00482409,
                    -0.0031258848,
                    -0.0021781707,
                ],
                [
                    0.078751005,
                    0.2946709,
                    -0.054019682,
                    -0.09477487,
                    -0.0018989182,
                    0.0036233035,
                ],
            ],
        },
        ExcitationTable {
            period_s: 3.0,
            blend_s: 1.0,
            cycles: 3,
            centre_rad: [
                0.480634,
                -0.5982378,
            ],
            sine_rad: [
                [
                    -0.080927424,
                    0.03990172,
                    0.0065903636,
                    0.0024085543,
                    0.0011623893,
                    0.0006527531,
                ],
                [
                    0.3059859,
                    -0.09030858,
                    -0.19125319,
                    0.016653933,
                    0.03001268,
                    0.0015219271,
                ],
            ],
            cosine_rad: [
                [
                    0.17240188,
                    0.00588176,
                    -0.008000589,
                    -0.00482409,
                    -0.0031258848,
                    -0.0021781707,
                ],
                [
                    0.078751005,
                    0.2946709,
                    -0.054019682,
                    -0.09477487,
                    -0.0018989182,
                    0.0036233035,
                ],
            ],
        },
        ExcitationTable {
            period_s: 8.0,
            blend_s: 1.0,
            cycles: 1,
            centre_rad: [
                0.52871025,
                -0.5983385,
            ],
            sine_rad: [
                [
                    0.012094693,
                    0.12179231,
                    0.05914529,
                    -0.07164741,
                    -0.043033957,
                    0.0,
                ],
                [
                    0.2705758,
                    0.24156864,
                    0.09302427,
                    0.13044982,
                    0.1192457,
                    0.0,
                ],
            ],
            cosine_rad: [
                [
                    -0.25088888,
                    -0.028945645,
                    -0.033401717,
                    -0.066405505,
                    -0.060060494,
                    0.0,
                ],
                [
                    -0.29519153,
                    -0.08175825,
                    -0.059822917,
                    0.0065954598,
                    0.041493274,
                    0.0,
                ],
            ],
        },
    ],
};
}
pub use described::LEG;
