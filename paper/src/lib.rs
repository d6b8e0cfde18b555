//! The experiments of the paper, reproduced and compared with its printed results. `cargo paper` runs them.
//!
//! Why one command: each statement about the paper needs a run that supports it. Each part yields one
//! [`Section`], the source of terminal output, JSON report, figures and `docs/results/paper.md`.
//!
//! | part | contents |
//! | --- | --- |
//! | [`table_three`] | the test functions as printed and as intended, and their least values |
//! | [`table_four`] | the searches on test functions: [`searches`], [`contenders`], [`goals`] |
//! | [`mod@runs`] | runs of all rows, whole or a shard of them |
//! | [`figure_five`] | paths of the searches in the plane |
//! | [`problems`], [`seeds`], [`recorder`], [`statistics`] | test problems, seeds, evaluation counts, rows |
//! | [`tables_five_six`] | parameters of the three-joint chain, by both methods |
//! | [`figure_seven`] | torque of the chain on the verification motion |
//! | [`load_change`] | the chain identified before and after its load changes |
//! | [`convergence`] | iterations of the default swarm on identification problems |
//! | [`figures`] | paths and convergence of swarms; torque of the chain |

#![expect(
    clippy::disallowed_methods,
    reason = "the paper's experiments run on the host only and may use std's mathematics"
)]

pub mod chain;
pub mod contenders;
pub mod convergence;
pub mod digits;
pub mod figure_five;
pub mod figure_seven;
pub mod figures;
pub mod goals;
pub mod load_change;
pub mod printed;
pub mod problems;
pub mod ranks;
pub mod raw_cost;
pub mod recorder;
pub mod runs;
pub mod searches;
pub mod seeds;
pub mod seen_links;
pub mod statistics;
pub mod swarm_bench;
pub mod table_four;
pub mod table_three;
pub mod tables_five_six;
pub mod verification;

use scarab_base::error::ToolError;
use scarab_base::shard::Shard;
use scarab_identify::formats::shard::ShardResults;
use scarab_identify::report::SCHEMA;
use scarab_tool::view::figures::Figure;
use serde_json::{Map, Value};

use crate::runs::{PaperRuns, joined};

/// A table, figure or experiment of the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The test functions.
    TableThree,
    /// The searches.
    TableFour,
    /// Paths of the searches in the plane.
    FigureFive,
    /// Parameters of the chain; both tables come from the same runs.
    TablesFiveSix,
    /// Torque of the chain on the verification motion.
    FigureSeven,
    /// The chain before and after its load changes.
    LoadChange,
    /// Convergence of the swarm on identification problems.
    Convergence,
}

impl Part {
    /// All parts, in the paper's order.
    pub const ALL: [Self; 6] = [
        Self::TableThree,
        Self::TableFour,
        Self::FigureFive,
        Self::TablesFiveSix,
        Self::FigureSeven,
        Self::LoadChange,
    ];

    /// Whether the part has runs that shards divide.
    pub const fn is_divided(self) -> bool {
        !matches!(self, Self::TableThree | Self::FigureFive)
    }

    /// Name of the part's section in a document ([`scarab_tool::view::document`]).
    pub const fn section_name(self) -> &'static str {
        match self {
            Self::TableThree => "table-iii",
            Self::TableFour => "table-iv",
            Self::FigureFive => "figure-5",
            Self::TablesFiveSix => "tables-v-vi",
            Self::FigureSeven => "figure-7",
            Self::LoadChange => "load-change",
            Self::Convergence => "convergence",
        }
    }
}

/// Options of all parts.
#[derive(Clone, Debug)]
pub struct PaperOptions {
    /// Runs of each row; `None` uses the default of each part.
    pub seeds: Option<u64>,
    /// Searches of Table IV; empty for all.
    pub algorithms: Vec<contenders::Algorithm>,
    /// Part of the runs of each row.
    pub shard: Shard,
}

impl PaperOptions {
    /// Runs of each row of a part with this default.
    pub fn runs(&self, default: u64) -> u64 {
        self.seeds.unwrap_or(default)
    }
}

/// Results of one part.
#[derive(Clone, Debug)]
pub struct Section {
    /// Name of the section in a document ([`scarab_tool::view::document`]).
    pub name: &'static str,
    /// Tables and text, Markdown.
    pub markdown: String,
    /// Drawings.
    pub figures: Vec<Figure>,
    /// Entries for the JSON report.
    pub json: Map<String, Value>,
}

impl Section {
    /// Section from a report, with its entry of the JSON report and its figures.
    fn new(
        part: Part,
        entry: &str,
        report: &impl serde::Serialize,
        markdown: String,
        figures: Vec<Figure>,
    ) -> Result<Self, ToolError> {
        let value =
            serde_json::to_value(report).map_err(|error| ToolError::input(format!("no JSON: {error}")))?;
        Ok(Self {
            name: part.section_name(),
            markdown,
            figures,
            json: Map::from_iter([(entry.to_owned(), value)]),
        })
    }
}

/// Runs of these parts, whole or a shard of them.
pub fn runs(parts: &[Part], options: &PaperOptions) -> Result<PaperRuns, ToolError> {
    let (mut all, shard) = (PaperRuns::default(), options.shard);
    for part in parts {
        match part {
            Part::TableThree | Part::FigureFive => {}
            Part::TableFour => all.table_four = Some(table_four::runs(options)?),
            Part::TablesFiveSix => {
                let runs = options.runs(tables_five_six::RUNS);
                all.tables_five_six = Some(tables_five_six::runs(runs, shard)?);
            }
            Part::FigureSeven => {
                let runs = options.runs(figure_seven::RUNS);
                all.figure_seven = Some(figure_seven::runs(runs, &figure_seven::LEVELS, shard)?);
            }
            Part::LoadChange => {
                all.load_change = Some(load_change::runs(options.runs(load_change::RUNS), shard)?);
            }
            Part::Convergence => {
                all.convergence = Some(convergence::runs(options.runs(convergence::RUNS), shard)?);
            }
        }
    }
    Ok(all)
}

/// Sections of these parts, from the runs of all shards.
pub fn sections(
    parts: &[Part],
    options: &PaperOptions,
    mut shards: Vec<ShardResults<PaperRuns>>,
) -> Result<Vec<Section>, ToolError> {
    parts.iter().map(|part| section(*part, options, &mut shards)).collect()
}

fn section(
    part: Part,
    options: &PaperOptions,
    shards: &mut [ShardResults<PaperRuns>],
) -> Result<Section, ToolError> {
    let name = part.section_name();
    match part {
        Part::TableThree => table_three::section(),
        Part::FigureFive => figure_five::section(options),
        Part::TableFour => {
            let runs = joined(shards, name, options.runs(table_four::RUNS), |runs| &mut runs.table_four)?;
            table_four::section(options, &runs)
        }
        Part::TablesFiveSix => {
            let runs = options.runs(tables_five_six::RUNS);
            tables_five_six::section(&joined(shards, name, runs, |runs| &mut runs.tables_five_six)?)
        }
        Part::FigureSeven => {
            let runs = options.runs(figure_seven::RUNS);
            figure_seven::section(&joined(shards, name, runs, |runs| &mut runs.figure_seven)?)
        }
        Part::LoadChange => {
            let runs = options.runs(load_change::RUNS);
            load_change::section(&joined(shards, name, runs, |runs| &mut runs.load_change)?)
        }
        Part::Convergence => {
            let runs = options.runs(convergence::RUNS);
            convergence::section(&joined(shards, name, runs, |runs| &mut runs.convergence)?)
        }
    }
}

/// JSON report: schema, rows of Table IV, and the entries of the other parts.
pub fn report(sections: &[Section]) -> Value {
    let mut report = Map::new();
    report.insert("schema".into(), SCHEMA.into());
    report.insert("rows".into(), Value::Array(Vec::new()));
    for section in sections {
        report.extend(section.json.clone());
    }
    Value::Object(report)
}
