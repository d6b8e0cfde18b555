//! Gautier's closed-form regrouping: moves YY, HZ and M of every link but the first to the link before it.
//!
//! A term that a link shares with the one before it, at any joint angle, can be counted there. The result
//! needs 7 (N - 1) + 3 inertial parameters and 4 of the drive per joint, and the torque is unchanged.
//!
//! ```text
//! for i = N .. 2, with s = YY_i + 2 d HZ_i + d^2 M_i and t = HZ_i + d M_i:
//!   XX_(i-1) += s                           HX_(i-1) += a M_i
//!   XY_(i-1) += a sin(alpha) t              HY_(i-1) -= sin(alpha) t
//!   XZ_(i-1) -= a cos(alpha) t              HZ_(i-1) += cos(alpha) t
//!   YY_(i-1) += cos^2(alpha) s + a^2 M_i    M_(i-1)  += M_i
//!   YZ_(i-1) += cos(alpha) sin(alpha) s
//!   ZZ_(i-1) += sin^2(alpha) s + a^2 M_i
//!   XX_i -= YY_i                            YY_i = HZ_i = M_i = 0
//! joint 1, on a fixed base: ZZ_1 += IA_1; IA_1, XX_1, XY_1, XZ_1, YY_1, YZ_1, HZ_1, M_1 = 0
//! ```
//!
//! | symbol | meaning | unit |
//! | --- | --- | --- |
//! | alpha, a, d | Denavit-Hartenberg numbers of joint i | rad, m, m |
//! | XX .. M, IA | parameters, tensor elements | kg m2, kg m, kg |
//!
//! Source: M. Gautier and W. Khalil, Direct calculation of minimum set of inertial parameters of serial
//! robots, 1990; the paper's Eqs (8)-(17) with three corrections: 2 d HZ + d^2 M in (8) and (11)-(13), the
//! minus sign in (10), XX - YY in (7). Cost: about 40 flops per joint.
//! Limits: gravity and parallel axes are ignored. A first axis parallel to gravity hides HX1 and HY1, and
//! parallel axes hide more; [`super::analysis`] finds those.

use super::super::chain::Chain;
use super::super::parameter::{LegParameters, Parameter};
use crate::real::Real;

/// Regroups a leg to the fewest parameters that the closed form allows; the
/// torque of any motion is unchanged.
pub fn regroup<T: Real, const N: usize>(
    chain: &Chain<T, N>,
    parameters: &LegParameters<T, N>,
) -> LegParameters<T, N> {
    use Parameter::{HX, HY, HZ, IA, M, XX, XY, XZ, YY, YZ, ZZ};
    let mut grouped = *parameters;
    for (link, (sin_alpha, cos_alpha, a, d)) in chain.numbers().into_iter().enumerate().skip(1).rev() {
        let Some([before, own]) = grouped.get_mut(link - 1..=link) else {
            continue;
        };
        let (yy, hz, mass) = (own[YY.index()], own[HZ.index()], own[M.index()]);
        let t = hz + d * mass;
        let s = yy + d * (hz + t);
        before[XX.index()] += s;
        before[XY.index()] += a * sin_alpha * t;
        before[XZ.index()] -= a * cos_alpha * t;
        before[YY.index()] += cos_alpha * cos_alpha * s + a * a * mass;
        before[YZ.index()] += cos_alpha * sin_alpha * s;
        before[ZZ.index()] += sin_alpha * sin_alpha * s + a * a * mass;
        before[HX.index()] += a * mass;
        before[HY.index()] -= sin_alpha * t;
        before[HZ.index()] += cos_alpha * t;
        before[M.index()] += mass;
        own[XX.index()] -= yy;
        for moved in [YY, HZ, M] {
            own[moved.index()] = T::zero();
        }
    }
    if let Some(first) = grouped.first_mut() {
        first[ZZ.index()] += first[IA.index()];
        for unseen in [IA, XX, XY, XZ, YY, YZ, HZ, M] {
            first[unseen.index()] = T::zero();
        }
    }
    grouped
}

#[cfg(test)]
mod tests {
    use super::super::super::newton_euler::joint_torques;
    use super::super::super::testing::TestRandom;
    use super::*;

    /// Largest change of torque by a change of parameters, over random legs and motions, N m.
    fn torque_change<const N: usize>(
        seed: u64,
        change: impl Fn(&Chain<f64, N>, &LegParameters<f64, N>) -> LegParameters<f64, N>,
    ) -> f64 {
        let mut random = TestRandom::new(seed);
        let mut worst = 0.0_f64;
        for _ in 0..100 {
            let (chain, leg) = (random.chain::<N>(), random.leg::<N>());
            let changed = change(&chain, &leg);
            let (state, gravity) = (random.state(), random.gravity());
            let before = joint_torques(&chain, &leg, &state, &gravity);
            let after = joint_torques(&chain, &changed, &state, &gravity);
            for joint in 0..N {
                worst = worst.max((before[joint] - after[joint]).abs());
            }
        }
        worst
    }

    #[test]
    fn regrouping_leaves_the_torque_unchanged() {
        // Torques reach 1e3 N m on these legs: a few units in their last place.
        let changes = [
            torque_change::<1>(71, regroup),
            torque_change::<2>(72, regroup),
            torque_change::<3>(73, regroup),
            torque_change::<4>(74, regroup),
        ];
        assert!(changes.iter().all(|change| *change < 5e-12), "{changes:?}");
    }

    #[test]
    fn regrouping_leaves_as_many_inertial_parameters_as_the_rank() {
        let mut random = TestRandom::new(75);
        let grouped = regroup(&random.chain::<3>(), &random.leg());
        let inertial = |joint: &[f64; 14]| joint[..11].iter().filter(|value| **value != 0.0).count();
        // ZZ HX HY of the first link, seven of every other, rotors of all but the first.
        assert_eq!(grouped.map(|joint| inertial(&joint)), [3, 8, 8]);
    }

    #[test]
    fn the_printed_sign_of_equation_ten_changes_the_torque() {
        let change = torque_change::<3>(73, |chain, leg| {
            let mut printed = regroup(chain, leg);
            let (_, cos_alpha, a, d) = chain.numbers()[2];
            let moved = leg[2][Parameter::HZ.index()] + d * leg[2][Parameter::M.index()];
            printed[1][Parameter::XZ.index()] += 2.0 * a * cos_alpha * moved;
            printed
        });
        assert!(change > 1.0, "{change}");
    }

    #[test]
    fn the_printed_factor_two_d_mass_changes_the_torque() {
        let change = torque_change::<3>(73, |chain, leg| {
            let mut printed = regroup(chain, leg);
            let (_, _, _, d) = chain.numbers()[2];
            let mass = leg[2][Parameter::M.index()];
            printed[1][Parameter::XX.index()] += (2.0 * d - d * d) * mass;
            printed
        });
        assert!(change > 1.0, "{change}");
    }
}
