//! Runs of the divided parts: each row of a table over many seeds, in parallel, whole or a shard of it.
//!
//! A shard computes its runs of every row; tables are made of all runs, joined in the order of their seeds.
//! Table III, Figure 5 and the curves of Figure 7 are single runs of seconds, made where the tables are.

use indicatif::{ProgressBar, ProgressStyle};
use rayon::prelude::*;
use scarab_base::error::ToolError;
use scarab_base::shard::Shard;
use scarab_identify::formats::shard::ShardResults;
use scarab_identify::report::RunReport;
use serde::{Deserialize, Serialize};

use super::chain::{Fit, JOINTS};
use super::convergence::SETS;
use super::load_change::LoadRun;
use super::searches::Hits;
use super::seeds::ReportSeed;
use super::swarm_bench::Trial;

/// Results of the runs of each row.
pub type RowRuns<T> = Vec<Vec<T>>;

/// Results of the runs of all parts; `None` for parts that are not asked for.
#[derive(Debug, Default, Serialize, Deserialize)]
pub struct PaperRuns {
    /// Hits of the searches.
    pub table_four: Option<RowRuns<Hits>>,
    /// Reports by plan.
    pub tables_five_six: Option<RowRuns<RunReport>>,
    /// Torque errors by noise and method.
    pub figure_seven: Option<RowRuns<[Fit; JOINTS]>>,
    /// One row.
    pub load_change: Option<RowRuns<LoadRun>>,
    /// Searches by leg and set of unknowns.
    pub convergence: Option<RowRuns<[Option<Trial>; SETS]>>,
}

impl PaperRuns {
    /// Number of runs.
    pub fn count(&self) -> usize {
        fn runs_of<T>(rows: &Option<RowRuns<T>>) -> usize {
            rows.iter().flatten().map(Vec::len).sum()
        }
        runs_of(&self.table_four)
            + runs_of(&self.tables_five_six)
            + runs_of(&self.figure_seven)
            + runs_of(&self.load_change)
            + runs_of(&self.convergence)
    }
}

/// Runs this shard's seeds of every row in parallel; `runs` is the number of seeds of the whole.
pub fn run_rows<C: Sync, R: Send>(
    what: &str,
    rows: &[C],
    runs: u64,
    shard: Shard,
    run: impl Fn(&C, ReportSeed) -> Result<R, ToolError> + Sync,
) -> Result<RowRuns<R>, ToolError> {
    let numbers: Vec<u64> = (0..runs).collect();
    let seeds = shard.part(&numbers).iter().map(|number| ReportSeed::from_run(*number));
    let all: Vec<_> = rows.iter().flat_map(|row| seeds.clone().map(move |seed| (row, seed))).collect();
    let progress = ProgressBar::new(all.len() as u64).with_message(what.to_owned());
    let style = "{msg:28} {bar:32} {pos}/{len} runs, {elapsed} gone, {eta} left";
    if let Ok(style) = ProgressStyle::with_template(style) {
        progress.set_style(style);
    }
    let found = all.par_iter().map(|(row, seed)| {
        let run = run(row, *seed);
        progress.inc(1);
        run
    });
    let found: Result<Vec<R>, _> = found.collect();
    progress.finish_and_clear();
    let (mut found, length) = (found?.into_iter(), seeds.len());
    Ok(rows.iter().map(|_| found.by_ref().take(length).collect()).collect())
}

/// Joins one part's runs of all shards; `runs` is the number of seeds of the whole.
pub fn joined<T>(
    shards: &mut [ShardResults<PaperRuns>],
    what: &str,
    runs: u64,
    of: impl Fn(&mut PaperRuns) -> &mut Option<RowRuns<T>>,
) -> Result<RowRuns<T>, ToolError> {
    let mut whole: RowRuns<T> = Vec::new();
    for (index, shard) in shards.iter_mut().enumerate() {
        let rows = of(&mut shard.results).take().ok_or_else(|| shard.damaged(&format!("{what}: no runs")))?;
        if index == 0 {
            whole.resize_with(rows.len(), Vec::new);
        }
        if rows.len() != whole.len() {
            return Err(shard.damaged(&format!("{what}: {} rows, {} are due", rows.len(), whole.len())));
        }
        for (all, row) in whole.iter_mut().zip(rows) {
            shard.check_count(what, row.len(), runs as usize)?;
            all.extend(row);
        }
    }
    Ok(whole)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_join_to_the_runs_of_the_whole_in_their_order() {
        let run = |shard| {
            run_rows("rows", &[10, 20], 5, shard, |row, seed| Ok(row + seed.search())).expect("numbers")
        };
        let whole = run(Shard::WHOLE);
        let seed = |run| ReportSeed::from_run(run).search();
        assert_eq!(whole, [10, 20].map(|row| (0..5).map(|run| row + seed(run)).collect::<Vec<_>>()));
        for count in 1..=7 {
            let mut joined = vec![Vec::new(); 2];
            for index in 1..=count {
                let part = run(Shard::new(index, count).expect("a shard"));
                joined.iter_mut().zip(part).for_each(|(all, row)| all.extend(row));
            }
            assert_eq!(joined, whole, "{count} shards");
        }
    }

    #[test]
    fn a_shard_with_a_run_too_few_is_refused_with_its_part() {
        let hits = || Some(vec![vec![Vec::new(); 2]]);
        let shard = |index| Shard::new(index, 2).expect("a shard");
        let results =
            |index| ShardResults::new(shard(index), PaperRuns { table_four: hits(), ..PaperRuns::default() });
        let join =
            |runs| joined(&mut [results(1), results(2)], "table IV", runs, |runs| &mut runs.table_four);
        assert_eq!(join(4).expect("two runs each")[0].len(), 4);
        let refusal = join(5).expect_err("a run is missing").to_string();
        assert!(
            refusal.contains("table IV: 2 runs, 3 are due") && refusal.contains("shard 2 of 2"),
            "{refusal}"
        );
    }
}
