//! Tables of compensation and assistance, for the terminal and the page.

use scarab_base::number::Number;
use scarab_base::table::{Table, cells};
use scarab_rig::report::assist::{AssistReport, PeriodicReport};

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
pub(crate) fn rows(report: &AssistReport) -> Table {
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
pub fn shares(report: &AssistReport) -> Table {
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
pub(crate) fn periodic(report: &AssistReport) -> Table {
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
pub(crate) fn wearer_sums(report: &AssistReport) -> Table {
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
pub(crate) fn notes(report: &AssistReport) -> Vec<String> {
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

/// Everything for the terminal.
pub fn text(report: &AssistReport) -> String {
    let [first, last] = report.seeds;
    let seeds = if first == last { format!("seed {first}") } else { format!("seeds {first} to {last}") };
    let mut text = format!("{}: {seeds}\n\nshares\n{}", report.leg, shares(report).to_text());
    if !report.rows.is_empty() {
        text += &format!("\ntorques of hip and knee, N m rms\n{}", rows(report).to_text());
    }
    if !report.periodic.is_empty() {
        text += &format!("\nassistance of a periodic motion\n{}", periodic(report).to_text());
    }
    if !report.wearer_sums.is_empty() {
        text += &format!("\nthe wearer's leg from both models\n{}", wearer_sums(report).to_text());
    }
    text.push('\n');
    for note in notes(report) {
        text += &format!("{note}\n");
    }
    text
}
