//! A thigh and a shank of any thigh length, for synthetic motion.

use nalgebra::Vector3;
use scarab::ident::RowModel;
use scarab::model::planar::BASE;
use scarab::model::{BaseParameters, Chain, DenavitHartenberg, LegParameters};
use scarab::real::Real;

pub const GRAVITY: Vector3<f64> = Vector3::new(9.81, 0.0, 0.0);

/// Parameters XX XY XZ YY YZ ZZ HX HY HZ M IA FC FV OFF of a thigh and a shank.
pub const TRUTH: LegParameters<f64, 2> = [
    [0.03, -0.016, 0.0, 0.5, 0.0, 0.506, 1.7, 0.10, 0.0, 8.5, 0.12, 3.0, 1.2, 0.4],
    [0.013, 0.011, 0.0, 0.25, 0.0, 0.2546, 0.864, -0.072, 0.0, 4.8, 0.08, 2.0, 0.8, -0.3],
];

pub fn chain(length_m: f64) -> Chain<f64, 2> {
    let link = |a| DenavitHartenberg { alpha: 0.0, a, d: 0.0 };
    Chain::new(&[link(0.0), link(length_m)]).expect("finite")
}

pub fn row_model<T: Real>(length_m: f64) -> RowModel<T, 2, BASE> {
    let (chain, gravity) = (chain(length_m).convert(), GRAVITY.map(T::from_double));
    let base = BaseParameters::analyse(&chain, &gravity, &[[true; 14]; 2]).expect("thirteen base parameters");
    RowModel::new(chain, gravity, base)
}
