//! Distribution and autocorrelation of the residual torque, compared with noise.
//!
//! Left: distribution of the residuals in units of the noise's standard deviation, against the
//! normal distribution. Right: their autocorrelation, against that of white noise behind the same
//! filter. Residuals above that curve are not noise.

use plotters::element::{PathElement, Rectangle};
use plotters::style::Color;
use plotters::style::text_anchor::HPos;
use scarab_identify::report::series::{Role, Series, autocorrelation};

use crate::view::figures::canvas::{
    Area, Axes, BLUE, DARK, DrawingError, Key, LEFT, PALE, axes, legend, line, px, text,
};

/// Height of one joint, pixels.
const JOINT_HEIGHT: i32 = 190;
/// Height of title and legend.
const HEAD: i32 = 56;
/// Widest residual with a bar of its own, sigma.
const WIDEST: f64 = 4.5;
/// Width of one bar, sigma.
const BAR: f64 = 0.5;
/// Time from one row to the next, s.
const ROW_S: f64 = scarab::ident::DECIMATION as f64 / scarab::ident::SAMPLE_RATE_HZ;

pub(crate) fn height(joints: usize) -> u32 {
    (HEAD + JOINT_HEIGHT * joints.max(1) as i32).unsigned_abs()
}

/// Draws a row for each joint.
pub(crate) fn whole(area: &Area<'_>, joints: &[&str], series: &Series) -> Result<(), DrawingError> {
    let title = "Residuals where the joint moves: distribution, and autocorrelation of those of the motion identified from";
    text(area, (12, 14), 13, HPos::Left, title)?;
    let entries = [
        ("motion identified from", Key::Field(PALE)),
        ("unused motions", Key::Curve(line(BLUE, 6))),
        ("white noise through the same filter", Key::Curve(line(DARK, 4))),
    ];
    legend(area, (LEFT, 36), &entries)?;
    let (_, rows) = area.split_vertically(px(HEAD));
    for (joint, (part, name)) in rows.split_evenly((joints.len().max(1), 1)).iter().zip(joints).enumerate() {
        let of = |role: Role| -> Vec<Vec<Option<f64>>> {
            let motions = series.motions.iter().filter(|motion| motion.role == role);
            let joints = motions.filter_map(|motion| motion.joints.get(joint));
            joints.map(|curves| curves.residual_nm().collect()).collect()
        };
        let (training, unused) = (of(Role::Training), of(Role::Validation));
        let (left, right) = part.split_horizontally(px(450));
        let sigma = series.noise_nm.get(joint).copied().filter(|sigma| *sigma > 0.0).unwrap_or(1.0);
        distribution(&left, name, sigma, &training, &unused)?;
        correlation(&right, &training, &series.white_correlation)?;
    }
    Ok(())
}

/// Share of residuals per sigma in each bar from -WIDEST on; wider residuals count in the outermost bars.
fn density(residuals: &[Vec<Option<f64>>], sigma: f64) -> Vec<f64> {
    let bars = (2.0 * WIDEST / BAR) as usize;
    let mut counts = vec![0_u32; bars];
    for residual in residuals.iter().flatten().flatten() {
        let bar = ((residual / sigma + WIDEST) / BAR).floor().clamp(0.0, (bars - 1) as f64);
        counts[bar as usize] += 1;
    }
    let all = counts.iter().sum::<u32>().max(1);
    counts.into_iter().map(|count| f64::from(count) / f64::from(all) / BAR).collect()
}

fn distribution(
    area: &Area<'_>,
    name: &str,
    sigma: f64,
    training: &[Vec<Option<f64>>],
    unused: &[Vec<Option<f64>>],
) -> Result<(), DrawingError> {
    let (own, other) = (density(training, sigma), density(unused, sigma));
    let normal = |x: f64| (-x * x / 2.0).exp() / std::f64::consts::TAU.sqrt();
    let highest = own.iter().chain(&other).copied().fold(normal(0.0), f64::max);
    let y_label = format!("{name}, share per sigma");
    let frame = Axes {
        x: -WIDEST..WIDEST,
        y: 0.0..1.08 * highest,
        x_label: "residual / sigma of the noise",
        y_label: &y_label,
        x_ticks: 9,
        y_ticks: 5,
    };
    let mut chart = axes(area, &frame)?;
    let left = |bar: usize| -WIDEST + BAR * bar as f64;
    chart.draw_series(
        own.iter()
            .enumerate()
            .map(|(bar, share)| Rectangle::new([(left(bar), 0.0), (left(bar) + BAR, *share)], PALE.filled())),
    )?;
    if unused.iter().flatten().flatten().next().is_some() {
        let mut outline = vec![(-WIDEST, 0.0)];
        for (bar, share) in other.iter().enumerate() {
            outline.extend([(left(bar), *share), (left(bar) + BAR, *share)]);
        }
        outline.push((WIDEST, 0.0));
        chart.draw_series([PathElement::new(outline, line(BLUE, 5))])?;
    }
    let bell = (-90..=90).map(|tenth| f64::from(tenth) / 20.0).map(|x| (x, normal(x)));
    chart.draw_series([PathElement::new(bell.collect::<Vec<_>>(), line(DARK, 4))])?;
    Ok(())
}

fn correlation(area: &Area<'_>, training: &[Vec<Option<f64>>], white: &[f64]) -> Result<(), DrawingError> {
    let found = autocorrelation(training, white.len());
    let lowest = found.iter().chain(white).copied().fold(-0.3, f64::min);
    let end = ROW_S * white.len().max(2) as f64;
    let frame = Axes {
        x: -ROW_S / 2.0..end,
        y: 1.05 * lowest..1.05,
        x_label: "lag, s",
        y_label: "autocorrelation",
        x_ticks: 8,
        y_ticks: 6,
    };
    let mut chart = axes(area, &frame)?;
    let half = 0.35 * ROW_S;
    chart.draw_series(found.iter().enumerate().map(|(lag, share)| {
        let middle = ROW_S * lag as f64;
        Rectangle::new([(middle - half, 0.0), (middle + half, *share)], PALE.filled())
    }))?;
    let expected = white.iter().enumerate().map(|(lag, share)| (ROW_S * lag as f64, *share));
    chart.draw_series([PathElement::new(expected.collect::<Vec<_>>(), line(DARK, 4))])?;
    chart.draw_series([PathElement::new(vec![(-ROW_S / 2.0, 0.0), (end, 0.0)], line(DARK, 2))])?;
    Ok(())
}
