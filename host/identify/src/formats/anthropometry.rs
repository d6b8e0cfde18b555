//! A wearer's thigh, shank and foot from body mass and lengths.
//!
//! Why: a prior for a person without measurements, and simulated persons of any size.
//!
//! - Mass, centre of mass and radius of gyration of a segment are fractions of body mass and segment length,
//!   lengths are fractions of height. Source: Winter, Biomechanics and Motor Control of Human Movement
//!   (lengths there after Drillis and Contini): thigh 0.245, shank 0.246, foot 0.152 of the height.
//! - The ankle is held at a right angle, so shank and foot are one body. The foot's centre of mass lies at
//!   0.307 of its length in front of the ankle (ours: 0.083 m of 0.27 m).
//! - Only sagittal inertias are given. Each segment is completed as a solid of revolution with
//!   mass * radius^2 / 2 about its long axis; the radii are stated below (ours).
//!
//! Frames: x down the segment, y forward, z along the joint's axis; everything lies in the plane z
//! = 0. Limits: adults; a single person differs from the fractions by about 10 %.

/// Thigh, shank and foot of a standing height.
const THIGH_OF_HEIGHT: f64 = 0.245;
const SHANK_OF_HEIGHT: f64 = 0.246;
const FOOT_OF_HEIGHT: f64 = 0.152;

/// Body mass and leg lengths of a person.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wearer {
    /// Body mass, kg.
    pub mass: f64,
    /// Hip to knee, m.
    pub thigh: f64,
    /// Knee to ankle, m.
    pub shank: f64,
    /// Heel to toe, m.
    pub foot: f64,
}

impl Wearer {
    /// Person of this mass (kg) and height (m).
    pub(crate) fn from_height(mass: f64, height: f64) -> Self {
        Self {
            mass,
            thigh: THIGH_OF_HEIGHT * height,
            shank: SHANK_OF_HEIGHT * height,
            foot: FOOT_OF_HEIGHT * height,
        }
    }

    /// The thigh.
    pub(crate) fn thigh(&self) -> Segment {
        limb(0.100 * self.mass, self.thigh, 0.323, 0.08)
    }

    /// Shank and foot.
    pub(crate) fn shank(&self) -> [Segment; 2] {
        let mass = 0.0145 * self.mass;
        let gyration = 0.475 * self.foot;
        let foot = Segment {
            mass,
            x: self.shank,
            y: 0.083 / 0.27 * self.foot,
            sagittal: mass * gyration * gyration,
            radius: 0.04,
            along: Along::Y,
        };
        [limb(0.0465 * self.mass, self.shank, 0.302, 0.055), foot]
    }

    /// Segments of the thigh's link and of the shank's.
    pub fn links(&self) -> [Vec<Segment>; 2] {
        [vec![self.thigh()], self.shank().to_vec()]
    }
}

/// Long axis of a solid of revolution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Along {
    /// Along the segment.
    X,
    /// Forward.
    Y,
}

/// A solid of revolution in the plane of motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Mass, kg.
    pub(crate) mass: f64,
    /// Centre of mass along x, m.
    pub(crate) x: f64,
    /// Centre of mass along y, m.
    pub(crate) y: f64,
    /// Inertia about the joint's axis through the centre of mass, kg m^2.
    pub(crate) sagittal: f64,
    /// Radius, m.
    pub(crate) radius: f64,
    /// Direction of the long axis.
    pub(crate) along: Along,
}

/// Thigh or shank: centre of mass at 0.433 of the length from the upper joint.
fn limb(mass: f64, length: f64, gyration: f64, radius: f64) -> Segment {
    let gyration = gyration * length;
    Segment { mass, x: 0.433 * length, y: 0.0, sagittal: mass * gyration * gyration, radius, along: Along::X }
}

/// Joins segments to a rigid body: mass, centre of mass, and tensor elements XX XY XZ YY YZ ZZ about it.
pub(crate) fn joined(segments: &[Segment]) -> (f64, [f64; 3], [f64; 6]) {
    let mass: f64 = segments.iter().map(|segment| segment.mass).sum();
    let x = segments.iter().map(|segment| segment.mass * segment.x).sum::<f64>() / mass;
    let y = segments.iter().map(|segment| segment.mass * segment.y).sum::<f64>() / mass;
    let mut inertia = [0.0; 6];
    for segment in segments {
        let (dx, dy) = (segment.x - x, segment.y - y);
        let axial = 0.5 * segment.mass * segment.radius * segment.radius;
        let (xx, yy) = match segment.along {
            Along::X => (axial, segment.sagittal),
            Along::Y => (segment.sagittal, axial),
        };
        inertia[0] += xx + segment.mass * dy * dy;
        inertia[1] -= segment.mass * dx * dy;
        inertia[3] += yy + segment.mass * dx * dx;
        inertia[5] += segment.sagittal + segment.mass * (dx * dx + dy * dy);
    }
    (mass, [x, y, 0.0], inertia)
}
