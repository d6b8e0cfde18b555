//! Description of a wearer as plain numbers, and what is refused.
//!
//! All angles and torques are anatomical, flexion positive; pairs are hip and knee, thigh and shank, or
//! along a segment and forward, as each field says.

use super::muscles::LONGEST_DELAY_S;
use core::fmt;

/// Wearer of an exoskeleton of hip and knee.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WearerDescription {
    /// Thigh.
    pub thigh: SegmentDescription,
    /// Shank and foot as one body.
    pub shank: SegmentDescription,
    /// Distance of the wearer's knee axis from the hip axis, m. Another length than the exoskeleton's offsets
    /// the knee axes.
    pub thigh_length: f64,
    /// Position of the wearer's hip axis from the exoskeleton's, along the thigh at the anatomical zero and
    /// forward, m; 0 for aligned axes.
    pub hip_offset: [f64; 2],
    /// Passive torques of hip and knee.
    pub passive: [PassiveDescription; 2],
    /// Muscles of hip and knee.
    pub muscles: [MuscleDescription; 2],
    /// Delay of the reflexes, s, at most 0.1; used in whole milliseconds.
    pub neural_delay: f64,
    /// Cuffs at thigh and shank.
    pub cuffs: [CuffDescription; 2],
}

impl WearerDescription {
    /// Wearer with these segments (thigh, shank), muscles and cuffs, whose joint axes are the exoskeleton's.
    /// The delay of the reflexes is 70 ms, an assumption.
    pub const fn aligned(
        [thigh, shank]: [SegmentDescription; 2],
        thigh_length: f64,
        muscles: [MuscleDescription; 2],
        cuffs: [CuffDescription; 2],
    ) -> Self {
        Self {
            thigh,
            shank,
            thigh_length,
            hip_offset: [0.0; 2],
            passive: [PassiveDescription::HIP, PassiveDescription::KNEE],
            muscles,
            neural_delay: 0.07,
            cuffs,
        }
    }
}

/// Rigid segment in the plane of motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SegmentDescription {
    /// Mass, kg.
    pub mass: f64,
    /// Centre of mass from the upper joint, along the segment and forward, m.
    pub com: [f64; 2],
    /// Inertia about the joint's axis through the centre of mass, kg m^2.
    pub inertia_com: f64,
}

/// Torque of tissue about a joint without muscle activity.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PassiveDescription {
    /// Stiffness, N m/rad.
    pub stiffness: f64,
    /// Damping, N m s/rad.
    pub damping: f64,
    /// Angle without elastic torque, rad.
    pub rest: f64,
}

impl PassiveDescription {
    /// Hip in the middle of its range; an assumption, small beside the values that muscles reach.
    pub const HIP: Self = Self { stiffness: 5.0, damping: 1.0, rest: 0.35 };
    /// Knee in the middle of its range, as [`Self::HIP`].
    pub const KNEE: Self = Self { stiffness: 1.0, damping: 0.1, rest: 0.35 };
}

/// Stiffness and damping of a joint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Impedance {
    /// N m/rad.
    pub stiffness: f64,
    /// N m s/rad.
    pub damping: f64,
}

/// Muscles of one joint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MuscleDescription {
    /// Largest torque in either direction, N m.
    pub torque_limit: f64,
    /// Impedance of the active muscles, without delay.
    pub intrinsic: Impedance,
    /// Impedance of the reflexes, which act after the neural delay.
    pub reflex: Impedance,
    /// Impedance of contracted antagonists, which replaces the intrinsic one while resisting.
    pub resisting: Impedance,
}

impl MuscleDescription {
    /// Hip of a relaxed walker. Passive and intrinsic impedance together are within 34-66 N m/rad and 1.9-4.6
    /// N m s/rad, identified in the swing phase (van der Kooij et al., IEEE TNSRE 2022). Reflex gains,
    /// resistance and torque limit are assumptions. The reflexes are stable on the free limb with every
    /// permitted delay.
    pub const HIP: Self = Self {
        torque_limit: 120.0,
        intrinsic: Impedance { stiffness: 45.0, damping: 2.0 },
        reflex: Impedance { stiffness: 10.0, damping: 3.0 },
        resisting: Impedance { stiffness: 300.0, damping: 20.0 },
    };
    /// Knee of a relaxed walker, as [`Self::HIP`]; the swing phase has 0-3.5 N m/rad and 0.02-0.14 N m s/rad
    /// there, too little to move an unpowered exoskeleton's knee.
    pub const KNEE: Self = Self {
        torque_limit: 100.0,
        intrinsic: Impedance { stiffness: 2.0, damping: 0.0 },
        reflex: Impedance { stiffness: 4.0, damping: 0.7 },
        resisting: Impedance { stiffness: 200.0, damping: 10.0 },
    };
    /// Hip of a wearer who insists on the motion by contracting antagonists; half of [`Self::HIP`]'s
    /// resistance, an assumption.
    pub const FIRM_HIP: Self = Self { intrinsic: Impedance { stiffness: 150.0, damping: 10.0 }, ..Self::HIP };
    /// Knee of a wearer who insists on the motion, as [`Self::FIRM_HIP`].
    pub const FIRM_KNEE: Self =
        Self { intrinsic: Impedance { stiffness: 100.0, damping: 5.0 }, ..Self::KNEE };
}

/// Cuff between the same segments of wearer and exoskeleton. At the anatomical zero of both it is relaxed
/// and centred.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CuffDescription {
    /// Distance from the exoskeleton's joint above, along its segment, m.
    pub distance: f64,
    /// Coupling along the segment: skin and straps that shear.
    pub along: CuffSpring,
    /// Coupling normal to the segment: pads that press on soft tissue.
    pub across: CuffSpring,
}

impl CuffDescription {
    /// Tight padded cuff. It yields 13 mm across and 50 mm along under 100 N; assumptions about padding on
    /// soft tissue, to be varied.
    pub const fn padded(distance: f64) -> Self {
        Self {
            distance,
            along: CuffSpring { stiffness: 2e3, damping: 40.0, play: 0.0 },
            across: CuffSpring { stiffness: 8e3, damping: 80.0, play: 0.0 },
        }
    }
}

/// Spring and damper with play.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CuffSpring {
    /// Stiffness, N/m.
    pub stiffness: f64,
    /// Damping, N s/m. With play a pad pushes and never pulls, whatever its damping.
    pub damping: f64,
    /// Free travel from the centre in either direction, m.
    pub play: f64,
}

/// Reason why a leg cannot have this wearer, or why a wearer cannot move so.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum WearerError {
    /// No wearer in this world.
    NotWorn,
    /// Leg with another number of joints than hip and knee.
    JointCount(usize),
    /// Axes of hip and knee with an angle between them, rad.
    AxesNotParallel {
        /// Sine of the angle.
        tilt: f64,
    },
    /// Gravity with a component along the axes, m/s^2.
    PlaneNotVertical {
        /// The component.
        sideways: f64,
    },
    /// Knee axis on the hip axis.
    NoThigh {
        /// Distance of the axes, m.
        length: f64,
    },
    /// Positive knee angles that extend the knee.
    KneeDirection,
    /// Number that is not finite, or outside its range.
    OutOfRange {
        /// Part of the wearer or of the motion.
        part: &'static str,
        /// Quantity with its unit.
        quantity: &'static str,
        /// Its value.
        value: f64,
        /// Permitted values.
        range: [f64; 2],
    },
    /// Cuffs too stiff or too damped for the masses: their fastest motion needs too many steps.
    TooFast {
        /// Fastest rate, rad/s.
        rate: f64,
        /// Largest permitted rate, rad/s.
        limit: f64,
    },
}

impl fmt::Display for WearerError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotWorn => out.write_str("this world has no wearer"),
            Self::JointCount(joints) => {
                write!(out, "a wearer needs a leg of 2 joints, hip and knee; this one has {joints}")
            }
            Self::AxesNotParallel { tilt } => {
                write!(out, "a wearer moves in one plane; the axes of hip and knee are {tilt:.1e} rad apart")
            }
            Self::PlaneNotVertical { sideways } => write!(
                out,
                "a wearer's plane of motion must be vertical; gravity has {sideways:.1e} m/s^2 along the axes"
            ),
            Self::NoThigh { length } => {
                write!(out, "hip and knee axes are {length:.1e} m apart; a wearer needs a thigh between them")
            }
            Self::KneeDirection => out.write_str(
                "positive angles must flex both joints; reverse the knee's `direction` in the description",
            ),
            Self::OutOfRange { part, quantity, value, range: [low, high] } => {
                write!(out, "{part}: {quantity} is {value}, permitted {low} to {high}")
            }
            Self::TooFast { rate, limit } => write!(
                out,
                "cuffs move as fast as {rate:.0} rad/s, at most {limit:.0}; reduce their stiffness or damping"
            ),
        }
    }
}

impl core::error::Error for WearerError {}

/// Checks that each quantity of a part is finite and in its range.
pub(super) fn check_ranges(
    part: &'static str,
    quantities: &[(&'static str, f64, [f64; 2])],
) -> Result<(), WearerError> {
    for &(quantity, value, range) in quantities {
        if !(range[0] <= value && value <= range[1]) {
            return Err(WearerError::OutOfRange { part, quantity, value, range });
        }
    }
    Ok(())
}

const PERMITTED_STIFFNESS: [f64; 2] = [0.0, 1e4];
const PERMITTED_DAMPING: [f64; 2] = [0.0, 1e3];
const PERMITTED_OFFSET_M: [f64; 2] = [-1.0, 1.0];

impl WearerDescription {
    /// Checks every number.
    ///
    /// # Errors
    /// [`WearerError::OutOfRange`] with the first wrong one.
    pub fn check(&self) -> Result<(), WearerError> {
        for (part, segment) in [("thigh", &self.thigh), ("shank", &self.shank)] {
            let [along, forward] = segment.com;
            check_ranges(
                part,
                &[
                    ("mass, kg,", segment.mass, [0.01, 100.0]),
                    ("centre of mass along, m,", along, PERMITTED_OFFSET_M),
                    ("centre of mass forward, m,", forward, PERMITTED_OFFSET_M),
                    ("inertia, kg m^2,", segment.inertia_com, [1e-5, 10.0]),
                ],
            )?;
        }
        let [along, forward] = self.hip_offset;
        check_ranges(
            "wearer",
            &[
                ("thigh length, m,", self.thigh_length, [0.05, 1.0]),
                ("hip offset along, m,", along, PERMITTED_OFFSET_M),
                ("hip offset forward, m,", forward, PERMITTED_OFFSET_M),
                ("neural delay, s,", self.neural_delay, [0.0, LONGEST_DELAY_S]),
            ],
        )?;
        for (part, passive, muscle) in
            [("hip", &self.passive[0], &self.muscles[0]), ("knee", &self.passive[1], &self.muscles[1])]
        {
            check_ranges(
                part,
                &[
                    ("passive stiffness, N m/rad,", passive.stiffness, PERMITTED_STIFFNESS),
                    ("passive damping, N m s/rad,", passive.damping, PERMITTED_DAMPING),
                    ("angle at rest, rad,", passive.rest, [-4.0, 4.0]),
                    ("torque limit, N m,", muscle.torque_limit, [0.0, 1e3]),
                    ("intrinsic stiffness, N m/rad,", muscle.intrinsic.stiffness, PERMITTED_STIFFNESS),
                    ("intrinsic damping, N m s/rad,", muscle.intrinsic.damping, PERMITTED_DAMPING),
                    ("reflex stiffness, N m/rad,", muscle.reflex.stiffness, PERMITTED_STIFFNESS),
                    ("reflex damping, N m s/rad,", muscle.reflex.damping, PERMITTED_DAMPING),
                    ("resisting stiffness, N m/rad,", muscle.resisting.stiffness, PERMITTED_STIFFNESS),
                    ("resisting damping, N m s/rad,", muscle.resisting.damping, PERMITTED_DAMPING),
                ],
            )?;
        }
        for (part, cuff) in [("thigh cuff", &self.cuffs[0]), ("shank cuff", &self.cuffs[1])] {
            check_ranges(part, &[("distance, m,", cuff.distance, [0.01, 1.0])])?;
            for coupling in [&cuff.along, &cuff.across] {
                check_ranges(
                    part,
                    &[
                        ("stiffness, N/m,", coupling.stiffness, [0.0, 1e8]),
                        ("damping, N s/m,", coupling.damping, [0.0, 1e6]),
                        ("play, m,", coupling.play, [0.0, 0.1]),
                    ],
                )?;
            }
        }
        Ok(())
    }
}
