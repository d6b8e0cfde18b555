//! `trace`: decodes and reports the records of a board.

use clap::Args;
use scarab_base::error::{EXIT_ACCEPTED, EXIT_REFUSED, ToolError};
use scarab_base::output;
use scarab_identify::formats::leg_file::LegFile;
use scarab_rig::trace::Trace;
use scarab_rig::traced::curves::curves;
use scarab_rig::traced::{log, run as reading, run_report};

use crate::cli::arguments::{Input, LegName, Output, OutputFolder};
use crate::cli::common::{draw_into, write_json};
use crate::cli::model::ModelArguments;
use crate::view::tables;

/// Trace and outputs.
#[derive(Args, Debug)]
pub(crate) struct TraceArguments {
    /// Recorded trace, or - for standard input: text as a debug probe prints it, or a defmt stream with
    /// --image.
    file: Input,
    /// Image (ELF) that sent the stream; contains the texts of the records.
    #[arg(long, value_name = "ELF")]
    image: Option<Input>,
    /// Name of a shipped leg, or a leg file. Default: the leg that the image names.
    #[arg(long)]
    leg: Option<LegName>,
    /// Write the report as JSON here, for exit codes 0 and 3.
    #[arg(long)]
    json: Option<Output>,
    /// Write the 500 Hz log of one motion here, as a recording for replay.
    #[arg(long)]
    csv: Option<Output>,
    /// Motion for --csv: 0 is the training motion, from 1 on the predicted motions.
    #[arg(long, value_name = "NUMBER", requires = "csv", default_value_t = log::TRAINING)]
    csv_motion: u8,
    /// Write the run as one HTML page here.
    #[arg(long)]
    report: Option<Output>,
    /// Draw the contents of the trace into this directory, as SVG.
    #[arg(long)]
    figures: Option<OutputFolder>,
    /// Write the records as lines of text here, readable without the image.
    #[arg(long)]
    text: Option<Output>,
    /// Print all fourteen parameters of every joint with their status.
    #[arg(long)]
    parameters: bool,
    #[command(flatten)]
    model: ModelArguments,
}

/// Reads and reports; returns the exit code.
pub(crate) fn run(arguments: &TraceArguments) -> Result<u8, ToolError> {
    let trace = reading::read(&arguments.file, arguments.image.as_deref(), arguments.text.as_deref())?;
    output::print(&reading::preface(&trace))?;
    let outcome = report(arguments, &trace);
    output::print(&reading::attention(&trace))?;
    outcome
}

fn report(arguments: &TraceArguments, trace: &Trace) -> Result<u8, ToolError> {
    let leg = &leg(arguments, trace)?;
    if let Some(path) = &arguments.csv {
        let motion = arguments.csv_motion;
        let written = log::write(trace, leg, motion, path)?;
        let missing = match written.missing {
            0 => String::new(),
            missing => format!(", {missing} missing in between"),
        };
        let others = match log::others(trace, motion) {
            others if others.is_empty() => String::new(),
            others => format!("; the trace contains motions {others} as well (--csv-motion)"),
        };
        let (path, samples) = (path.display(), written.samples);
        output::print(&format!("log: {path}, {samples} samples of motion {motion}{missing}{others}\n\n"))?;
    }
    let kept = arguments.model.kept(leg)?;
    let mut run = run_report(trace, leg)?;
    arguments.model.compare(kept.as_ref(), &mut run);
    if let Some(path) = &arguments.json {
        write_json(path, &run)?;
    }
    tables::print_run(&run, leg)?;
    if arguments.parameters {
        output::print(&format!("\n{}", tables::all_parameters(&run)))?;
    }
    let (figures, page) = (arguments.figures.as_deref(), arguments.report.as_deref());
    if figures.is_some() || page.is_some() {
        draw_into(leg, figures, page, &run, &curves(trace, leg)?, &[])?;
    }
    arguments.model.save(leg, &run, leg.bandwidth_hz)?;
    Ok(if run.accepted() { EXIT_ACCEPTED } else { EXIT_REFUSED })
}

fn leg(arguments: &TraceArguments, trace: &Trace) -> Result<LegFile, ToolError> {
    if let Some(name) = &arguments.leg {
        return Ok(LegFile::load(name)?);
    }
    let Some(boot) = &trace.boot else {
        return Err(ToolError::input("the trace does not name its leg (no record `boot`): add --leg FILE"));
    };
    LegFile::load(&boot.leg).map_err(|error| {
        ToolError::input(format!("the trace comes from the leg `{}`: add --leg FILE ({error})", boot.leg))
    })
}
