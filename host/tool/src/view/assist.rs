//! Sections of compensation and assistance.

use scarab_base::number::Number;
use scarab_base::table::{Table, cells};
use scarab_rig::report::assist::{AssistReport, PeriodicReport};

use crate::view::figures::{Figure, Group};
use crate::view::html::Circumstances;
use crate::view::sections::{self, Head, Section};

const TORQUES: &str = "Interaction torque is what the cuffs exert on the exoskeleton's joints, measured in the \
    simulation. All columns have the same motion of the wearer's leg. N m rms over all seeds.";
const PERIODIC_MOTION: &str = "The oscillators are locked while their phase errs by less than 5 % of a cycle. Effort is \
    the rms torque of both muscles in a cycle, without the three cycles in which they may \
    lock. Energy counts from the second cycle after a walking wearer is limp or resists. \
    The worst of all seeds, the mean for the effort.";
const WEARER_SUMS: &str = "Difference of the models `worn` and `empty`. Torque determines these sums; a mass needs \
    an assumption besides.";
/// Sentences about stability, up to the share of compensated friction.
const STABILITY: &str = "Share of the exoskeleton's inertia below which small vibrations on the cuffs decay. The \
    acceleration is known late, which feeds slow vibrations; its lead feeds fast ones. \
    The cuffs' damping takes the energy away. Largest share over five knee angles from 10 to 90 degrees, with ";
const LIMITS: &str = "Simulated legs and wearers, off the ground: swinging, seated or hanging. No force is measured \
    at the cuffs. No person may wear the leg; on hardware every mode is to be tried with a dummy leg \
    (docs/assist.md).";

/// Torque with two decimals, or a dash.
fn torque(value: Number) -> String {
    value.known().map_or("-".into(), |value| format!("{value:.2}"))
}

fn three(value: Number) -> String {
    value.known().map_or("-".into(), |value| format!("{value:.3}"))
}

/// Share of one torque in another, percent.
fn percent(part: Number, whole: Number) -> String {
    match (part.known(), whole.known()) {
        (Some(part), Some(whole)) if whole > 0.0 => format!("{:.0}", 100.0 * part / whole),
        _ => "-".into(),
    }
}

/// Torques of every mode, motion and joint, N m rms.
fn rows(report: &AssistReport) -> Table {
    let is_compared = report.rows.iter().any(|row| row.drives_off_rms_nm.known().is_some());
    let is_carried = report.rows.iter().any(|row| row.wearer_gravity_share.known().is_some());
    let mut table = Table::default()
        .label("mode")
        .text(["motion", "joint"])
        .numbers_if(
            is_compared,
            [
                "drives off",
                "weight carried",
                "true model",
                "identified",
                "CAD prior",
                "identified, % of drives off",
            ],
        )
        .numbers(["wearer", "wearer without"])
        .numbers_if(is_carried, ["gravity share", "without"]);
    for row in &report.rows {
        table.row(cells![
            row.mode,
            &row.motion,
            &row.joint,
            torque(row.drives_off_rms_nm),
            torque(row.gravity_only_rms_nm),
            torque(row.true_model_rms_nm),
            torque(row.identified_rms_nm),
            torque(row.prior_rms_nm),
            percent(row.identified_rms_nm, row.drives_off_rms_nm),
            torque(row.wearer_rms_nm),
            torque(row.wearer_without_rms_nm),
            torque(row.wearer_gravity_share),
            torque(row.wearer_gravity_share_without),
        ]);
    }
    table
}

/// Requested shares of each mode.
fn shares(report: &AssistReport) -> Table {
    let mut table = Table::default().label("mode").numbers(["friction", "inertia", "weight", "periodic"]);
    for shares in &report.shares {
        let [friction, inertia, weight, periodic] =
            [shares.friction, shares.inertia, shares.weight, shares.periodic]
                .map(|share| format!("{share:.2}"));
        table.row(cells![shares.mode, friction, inertia, weight, periodic]);
    }
    table
}

/// Periodic assistance: the worst of all seeds for each cadence, the mean for the effort.
fn periodic(report: &AssistReport) -> Table {
    let mut table = Table::default().label("cadence, Hz").numbers([
        "lock, cycles",
        "relock, cycles",
        "phase error, %",
        "effort, % of without",
        "at most",
        "given limp, J",
        "given resisting, J",
    ]);
    let mut cadences: Vec<f64> = report.periodic.iter().map(|found| found.cadence_hz).collect();
    cadences.sort_by(f64::total_cmp);
    cadences.dedup();
    for cadence in cadences {
        let all = || report.periodic.iter().filter(|found| found.cadence_hz == cadence);
        let worst = |value: fn(&PeriodicReport) -> f64| all().map(value).fold(f64::NEG_INFINITY, f64::max);
        let effort = all().map(|found| found.mean_effort).sum::<f64>() / all().count() as f64;
        table.row(cells![
            format!("{cadence}"),
            format!("{:.1}", worst(|found| found.lock_cycles)),
            format!("{:.1}", worst(|found| found.relock_cycles)),
            format!("{:.2}", worst(|found| found.phase_error_percent)),
            format!("{:.0}", 100.0 * effort),
            format!("{:.0}", 100.0 * worst(|found| found.largest_effort)),
            format!("{:.2}", worst(|found| found.given_limp_j)),
            format!("{:.2}", worst(|found| found.given_resisting_j)),
        ]);
    }
    table
}

/// Base sums of the wearer's leg against anthropometry.
fn wearer_sums(report: &AssistReport) -> Table {
    let is_spread = report.wearer_sums.iter().any(|sum| sum.spread.known().is_some());
    let mut table = Table::default()
        .label("worn - empty")
        .numbers(["value", "sigma"])
        .numbers_if(is_spread, ["spread"])
        .numbers(["anthropometry", "deviation, sigma"])
        .unit();
    for sum in &report.wearer_sums {
        let deviation = match (sum.value.known(), sum.sigma.known(), sum.anthropometry.known()) {
            (Some(value), Some(sigma), Some(expected)) if sigma > 0.0 => {
                format!("{:+.1}", (value - expected) / sigma)
            }
            _ => "-".into(),
        };
        table.row(cells![
            sum.name,
            three(sum.value),
            three(sum.sigma),
            three(sum.spread),
            three(sum.anthropometry),
            deviation,
            sum.unit,
        ]);
    }
    table
}

/// Lines about energy, rest, faults and stability; only what was run.
fn notes(report: &AssistReport) -> Vec<String> {
    let mut notes: Vec<String> =
        report.failures().into_iter().map(|failure| format!("FAILED: {failure}")).collect();
    for refused in &report.refused {
        let reasons = refused.reasons.join(", ");
        notes.push(format!("seed {}: model `{}` refused: {reasons}", refused.seed, refused.model));
    }
    if report.ended > 0 {
        notes.push(format!("sessions that ended by themselves: {}", report.ended));
    }
    let energy = &report.energy;
    if let Some(worst) = energy.worst_j.known() {
        notes.push(format!(
            "energy given to limp and resisting wearers: at most {worst:.2} J in {} runs, budget {} J, exceeded {}",
            energy.runs, energy.budget_j, energy.exceeded
        ));
    }
    if report.legs_at_rest > 0 {
        notes.push(format!("limit cycles at rest: {} of {} legs", report.limit_cycles, report.legs_at_rest));
    }
    if let Some(missed) = report.missed {
        notes.push(format!("injected faults missed: {missed} of {}", report.faults));
    }
    if let Some(mass) = &report.body_mass {
        notes.push(format!(
            "body mass of the wearer: {:.1} kg +- {:.1} kg, assuming {}; sigma contains neither tissue nor cuffs",
            mass.kg, mass.sigma_kg, mass.assumption
        ));
    }
    let stability = &report.stability;
    notes.push(format!(
        "largest stable share of inertia with these cuffs ({} N/m, {} N s/m) and models without error: {:.2} on a limp limb, {:.2} on a held one",
        stability.stiffness_n_per_m,
        stability.damping_n_s_per_m,
        stability.largest_share_limp,
        stability.largest_share_held
    ));
    notes
}

/// All sections, with the figures that were drawn.
pub(crate) fn sections(report: &AssistReport, figures: &[Figure]) -> Vec<Section> {
    let of = |groups: &'static [Group]| figures.iter().filter(|figure| groups.contains(&figure.group));
    let friction = 100.0 * report.stability.friction_share;
    let stability = format!("{STABILITY}{friction:.0} % of viscous friction compensated.");
    let mut sections = vec![
        Section::new("Results").lines(notes(report)),
        Section::new("Shares").explained("Shares of the models' torques.").table(shares(report)),
    ];
    if !report.rows.is_empty() {
        let figures = of(&[Group::Summary, Group::Torque]);
        sections.push(
            Section::new("Torques of hip and knee, N m rms")
                .explained(TORQUES)
                .table(rows(report))
                .figures(figures),
        );
    }
    if !report.periodic.is_empty() {
        sections.push(
            Section::new("Assistance of a periodic motion")
                .explained(PERIODIC_MOTION)
                .table(periodic(report)),
        );
    }
    if !report.wearer_sums.is_empty() {
        sections.push(
            Section::new("The wearer's leg from both models")
                .explained(WEARER_SUMS)
                .table(wearer_sums(report)),
        );
    }
    sections.push(Section::new("Stability").explained(stability).figures(of(&[Group::Search])));
    sections.push(Section::new("Limits of these results").explained(LIMITS));
    sections
}

/// Seeds in words.
pub(crate) fn seeds(report: &AssistReport) -> String {
    let [first, last] = report.seeds;
    if first == last { format!("seed {first}") } else { format!("seeds {first} to {last}") }
}

/// Page of all sections.
pub(crate) fn page(circumstances: &Circumstances, report: &AssistReport, sections: &[Section]) -> String {
    let failures = report.failures();
    let verdict = if failures.is_empty() { "no limit exceeded".to_owned() } else { failures.join(", ") };
    let head = Head {
        kind: "assistance",
        title: &format!("{}: {verdict}", report.leg),
        time_utc: &circumstances.time_utc,
        command: Some(&circumstances.command),
        lines: &[seeds(report)],
    };
    sections::page(head, sections)
}
