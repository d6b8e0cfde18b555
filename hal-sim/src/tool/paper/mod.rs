//! `paper`: the experiments of the paper, each run here and set beside what it prints.
//!
//! Why one command: what a document says of the paper is only as good as the run behind it. Each part yields one
//! [`Section`], from which the terminal, the JSON report, the figures and `docs/paper.md` are made.
//!
//! | part | what is made |
//! | --- | --- |
//! | [`table_three`] | the test functions as printed and as intended, and their least values |

pub mod document;
pub mod table_three;

use serde_json::{Map, Value};

use super::error::ToolError;
use super::figures::Figure;
use super::report::SCHEMA;

/// A table, figure or experiment of the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The test functions.
    TableThree,
}

impl Part {
    /// Everything, in the paper's order.
    pub const ALL: [Self; 1] = [Self::TableThree];
}

/// What holds for all parts.
#[derive(Clone, Copy, Debug)]
pub struct PaperOptions {
    /// Runs of each row; every part has a number of its own where it is not given.
    pub seeds: Option<u64>,
}

/// What one part found.
#[derive(Clone, Debug)]
pub struct Section {
    /// Name of its place in a document ([`document`]).
    pub name: &'static str,
    /// Tables and words, Markdown.
    pub markdown: String,
    /// Drawings.
    pub figures: Vec<Figure>,
    /// Its entries of the JSON report.
    pub json: Map<String, Value>,
}

/// Makes these parts, one after the other.
pub fn run(parts: &[Part], options: &PaperOptions) -> Result<Vec<Section>, ToolError> {
    parts.iter().map(|part| section(*part, options)).collect()
}

fn section(part: Part, _options: &PaperOptions) -> Result<Section, ToolError> {
    match part {
        Part::TableThree => table_three::section(),
    }
}

/// The JSON report: the schema, the rows of Table IV and whatever else was made.
#[must_use]
pub fn report(sections: &[Section]) -> Value {
    let mut report = Map::new();
    report.insert("schema".into(), SCHEMA.into());
    report.insert("rows".into(), Value::Array(Vec::new()));
    for section in sections {
        report.extend(section.json.clone());
    }
    Value::Object(report)
}
