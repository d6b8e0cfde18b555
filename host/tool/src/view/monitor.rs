//! Prints the results of monitoring in words and tables.

use scarab_base::error::ToolError;
use scarab_base::number::{Number, number};
use scarab_base::output::say;
use scarab_base::table::{Table, cells};
use scarab_rig::report::monitor::{MonitorRun, MonitorRuns, UpdateReport};

/// Prints a run in a few lines.
fn print_run(run: &MonitorRun) -> Result<(), ToolError> {
    if !run.refused.is_empty() {
        say!("seed {}: refused, {}: no model to monitor", run.seed, run.refused.join(", "));
        return Ok(());
    }
    if run.hours > 0.0 {
        say!("seed {}: {} false alarms in {} h", run.seed, run.false_alarms_at_s.len(), run.hours);
    }
    if !run.changed {
        return Ok(());
    }
    let Some(alarm) = &run.alarm else {
        say!("seed {}: the change was not detected", run.seed);
        return Ok(());
    };
    say!(
        "seed {}: detected after {:.1} s at {} (sums {}, limit {})",
        run.seed,
        alarm.after_s,
        alarm.joints.join(" and "),
        alarm.statistic.iter().map(|sum| number(*sum)).collect::<Vec<_>>().join(" "),
        number(run.limit)
    );
    let Some(update) = &run.update else {
        say!("  too few rows for an update");
        return Ok(());
    };
    print_update(run, update)
}

/// Prints cause, changes and effect of a quick update.
fn print_update(run: &MonitorRun, update: &UpdateReport) -> Result<(), ToolError> {
    let compared: Vec<_> = update
        .hypotheses
        .iter()
        .map(|hypothesis| {
            let freedom = hypothesis.freedom.known().unwrap_or(0.0);
            let noise = if hypothesis.explains { " (noise)" } else { "" };
            format!("{} {} of {freedom}{noise}", hypothesis.name, number(hypothesis.chi_square))
        })
        .collect();
    say!(
        "  {:.1} s later: {}{}{}; chi-square: {}",
        update.after_s,
        update.cause,
        update.link.as_ref().map(|link| format!(" on {link}")).unwrap_or_default(),
        if update.right { "" } else { ", which is wrong" },
        compared.join(", ")
    );
    let mut table =
        Table::default().label("  change of").numbers(["value", "sigma"]).unit().numbers(["truth"]);
    for value in &update.values {
        table.row(cells![
            format!("  {}", value.name),
            number(value.value),
            number(value.sigma),
            value.unit,
            number(value.truth),
        ]);
    }
    if !table.is_empty() {
        say!("{}", table.to_text().trim_end());
    }
    let energies =
        |values: &[Number]| values.iter().map(|value| number(*value)).collect::<Vec<_>>().join(" ");
    say!(
        "  residual energy over that at acceptance {} before, {} after; position error {} deg before the change, {} with \
         the old model, {} with the update{}",
        energies(&update.energy_before),
        energies(&update.energy_after),
        number(run.error_deg_before),
        number(run.error_deg_changed),
        number(run.error_deg_updated),
        if run.alarm_after_update { "; another alarm after the update" } else { "" },
    );
    Ok(())
}

fn mean_and_spread(values: &[f64]) -> (f64, f64) {
    let count = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / count;
    (mean, (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / count).sqrt())
}

/// Prints statistics of many runs, or all of a few.
pub(crate) fn print_runs(report: &MonitorRuns) -> Result<(), ToolError> {
    let runs = &report.runs;
    say!("{}: walking, 3 s cycle", report.leg);
    if runs.len() < 4 {
        return runs.iter().try_for_each(print_run);
    }
    for run in runs.iter().filter(|run| !run.refused.is_empty()) {
        print_run(run)?;
    }
    let hours: f64 = runs.iter().map(|run| run.hours).sum();
    let alarms: usize = runs.iter().map(|run| run.false_alarms_at_s.len()).sum();
    say!("{} runs; {alarms} false alarms in {hours} h and before the changes", runs.len());
    let changed: Vec<_> = runs.iter().filter(|run| run.changed).collect();
    let noticed: Vec<_> = changed.iter().filter_map(|run| run.alarm.as_ref()).collect();
    if changed.is_empty() {
        return Ok(());
    }
    let mut delays: Vec<_> = noticed.iter().map(|alarm| alarm.after_s).collect();
    delays.sort_by(f64::total_cmp);
    let at = |share: f64| delays.get((share * delays.len().saturating_sub(1) as f64) as usize).copied();
    say!(
        "detected: {} of {}, after {} s in the median, {} s at worst",
        noticed.len(),
        changed.len(),
        number(at(0.5).into()),
        number(at(1.0).into())
    );
    let updates: Vec<_> = changed.iter().filter_map(|run| run.update.as_ref()).collect();
    for cause in ["payload", "friction", "nothing", "unexplained"] {
        let count = updates.iter().filter(|update| update.cause == cause).count();
        if count > 0 {
            say!("explained as {cause}: {count}");
        }
    }
    let again = changed.iter().filter(|run| run.alarm_after_update).count();
    say!("another alarm within a minute of the update: {again}");
    say!("{}", change_table(&updates).to_text().trim_end());
    Ok(())
}

/// Identified changes of the updates with the right cause, against the true ones.
fn change_table(updates: &[&UpdateReport]) -> Table {
    let right: Vec<_> = updates.iter().filter(|update| update.right).collect();
    let mut table = Table::default()
        .label("change of")
        .numbers(["truth", "mean", "spread", "rms sigma", "worst error"])
        .unit();
    for value in right.first().map_or(&[][..], |update| &update.values) {
        let same: Vec<_> =
            right.iter().flat_map(|update| &update.values).filter(|other| other.name == value.name).collect();
        let found: Vec<_> = same.iter().filter_map(|value| value.value.known()).collect();
        let sigma: f64 = same.iter().filter_map(|value| value.sigma.known()).map(|sigma| sigma * sigma).sum();
        let (mean, spread) = mean_and_spread(&found);
        let truth = value.truth.known();
        let worst = truth.map(|truth| found.iter().map(|value| (value - truth).abs()).fold(0.0, f64::max));
        table.row(cells![
            &value.name,
            number(value.truth),
            number(mean.into()),
            number(spread.into()),
            number((sigma / same.len().max(1) as f64).sqrt().into()),
            number(worst.into()),
            value.unit,
        ]);
    }
    table
}
