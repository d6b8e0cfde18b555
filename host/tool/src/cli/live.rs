//! `live`: a leg that identifies itself, a recording, a board's trace or legs on a bus, shown in a browser.

use std::fs::File;
use std::io::Read;
use std::net::SocketAddr;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use clap::Args;
use scarab_base::error::{EXIT_ACCEPTED, EXIT_INPUT, EXIT_REFUSED, FileError, ToolError};
use scarab_base::output::say;
use scarab_client::adapter::listen;
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::formats::model_file::ModelFile;
use scarab_identify::formats::recording::Recording;
use scarab_identify::leg::matching::refuse_another_leg;
use scarab_identify::leg::setup::DEFAULT_SEED;
use scarab_identify::run::replay::{Recordings, ReplayOptions};
use scarab_rig::options::{DriveModel, SimulationOptions};
use scarab_rig::perturb::Perturbation;
use scarab_rig::traced::run::{StreamReader, decoder};

use crate::cli::adapter::bit_rates;
use crate::cli::arguments::{Input, one_of};
use crate::cli::identify::DRIVES;
use crate::cli::import::ImportArguments;
use crate::cli::leg_options::LegOptions;
use crate::live::bus::{BusInput, Lines, watch};
use crate::live::playback::play;
use crate::live::report::LiveUpdate;
use crate::live::simulated::{LiveOptions, identify};
use crate::live::traced::{TraceInput, follow};
use crate::view::live::hub::Hub;
use crate::view::live::server::Server;
use crate::view::tables;

/// Smallest and largest speed, simulated seconds per second.
const SPEED: (f64, f64) = (1e-3, 1e3);
/// Legs on one page.
const MOST_LEGS: usize = 4;
/// Pause between two looks at the signals.
const PAUSE: Duration = Duration::from_millis(50);

/// Leg, speed and address.
#[derive(Args, Debug)]
pub(crate) struct LiveArguments {
    #[command(flatten)]
    leg: LegOptions,
    /// Simulated seconds per second.
    #[arg(long, value_name = "K", default_value_t = 1.0)]
    speed: f64,
    /// Seed of noise and swarm.
    #[arg(long, default_value_t = DEFAULT_SEED)]
    seed: u64,
    /// Identifications, one after the other, with growing seeds.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=100_000), help_heading = "Simulation")]
    runs: u32,
    /// Ideal currents, or motors, bridges and sensors under the board's current loops.
    #[arg(long, value_parser = one_of(DRIVES), default_value = "ideal", help_heading = "Simulation")]
    drive: DriveModel,
    /// Inject a deliberate error: NAME or NAME=VALUE, repeatable.
    #[arg(long, value_name = "NAME[=VALUE]", help_heading = "Simulation")]
    perturb: Vec<Perturbation>,
    /// Play this recording instead of simulating; --leg is required.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["runs", "drive", "perturb"], help_heading = "Recordings")]
    recording: Option<Input>,
    /// Share of the recording to identify from, above 0 and below 1; the rest is predicted.
    #[arg(long, requires = "recording", allow_negative_numbers = true, help_heading = "Recordings")]
    split: Option<f64>,
    #[command(flatten)]
    import: ImportArguments,
    /// Show this trace of a board instead, - for standard input; --leg is required.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["runs", "drive", "perturb", "recording"], help_heading = "Board")]
    trace: Option<Input>,
    /// Image (ELF) that sent the trace as a defmt stream; without it the trace is text.
    #[arg(long, value_name = "ELF", requires = "trace", help_heading = "Board")]
    image: Option<Input>,
    /// Show the legs on this CANopen bus, heard by an slcan adapter: HOST:PORT or a serial device; --leg is
    /// required.
    #[arg(long, value_name = "ADAPTER", group = "bus", conflicts_with_all = ["runs", "drive", "perturb", "recording", "trace", "seed", "speed"], help_heading = "Bus")]
    slcan: Option<String>,
    /// Show the legs in these lines of `candump -L`, - for standard input; --leg is required.
    #[arg(long, value_name = "FILE", group = "bus", conflicts_with_all = ["runs", "drive", "perturb", "recording", "trace", "seed"], help_heading = "Bus")]
    candump: Option<Input>,
    /// Node-IDs, leg by leg, proximal joint first. Default: one leg with nodes from 1 on.
    #[arg(long, value_name = "ID,ID,..", value_delimiter = ',', value_parser = clap::value_parser!(u8).range(1..=127), requires = "bus", help_heading = "Bus")]
    nodes: Vec<u8>,
    /// Bit rate of the bus, kbit/s.
    #[arg(long, value_name = "KBIT", default_value = "1000", value_parser = bit_rates(), requires = "bus", help_heading = "Bus")]
    bit_rate: u64,
    /// Model (--save-model) that predicts the torque of every leg. Without one it is predicted once a host
    /// has read the parameters.
    #[arg(long, value_name = "FILE", requires = "bus", help_heading = "Bus")]
    model: Option<Input>,
    /// Address and port of the page; port 0 selects a free one. Outside this machine it needs --token.
    #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:0")]
    listen: SocketAddr,
    /// Word that the page's address must contain: 16 or more letters and digits.
    #[arg(long)]
    token: Option<String>,
    /// End after the last identification; else the page stays until Ctrl-C.
    #[arg(long)]
    once: bool,
}

/// Source of the picture.
enum Source {
    Simulated(Box<SimulationOptions>, LiveOptions),
    Recording(Box<(Recordings, ReplayOptions)>, f64),
    Trace(Box<TraceInput>),
    Bus(Box<BusInput>),
}

impl LiveArguments {
    fn source(&self, leg: &LegFile) -> Result<Source, ToolError> {
        if let Some(file) = &self.trace {
            let reader = StreamReader::new(decoder(self.image.as_deref())?);
            let (input, speed) = self.open(file)?;
            let name = file.display().to_string();
            return Ok(Source::Trace(Box::new(TraceInput { input, reader, name, speed })));
        }
        if let Some(source) = self.bus(leg)? {
            return Ok(source);
        }
        let Some(file) = &self.recording else {
            let options = SimulationOptions {
                drive: self.drive,
                perturbations: self.perturb.clone(),
                ..SimulationOptions::with_seed(self.seed)
            };
            return Ok(Source::Simulated(
                Box::new(options),
                LiveOptions { speed: self.speed, runs: self.runs },
            ));
        };
        let import = self.import.import(leg, self.leg.name())?;
        let read = Recording::read(file, &import)?;
        let recordings = Recordings { training: vec![read], ..Recordings::default() };
        let options = ReplayOptions {
            split: self.split,
            swarm_seed: self.seed,
            import: Some(import),
            ..ReplayOptions::from_leg(leg)
        };
        Ok(Source::Recording(Box::new((recordings, options)), self.speed))
    }
}

impl LiveArguments {
    /// Opens a file, played at the requested speed, or standard input.
    fn open(&self, file: &Input) -> Result<(Box<dyn Read + Send>, Option<f64>), ToolError> {
        if &**file == Path::new("-") {
            return Ok((Box::new(std::io::stdin()), None));
        }
        let opened = File::open(&**file).map_err(|error| FileError::unreadable(file, &error))?;
        Ok((Box::new(opened), Some(self.speed)))
    }

    /// Bus to be shown, if one is named.
    fn bus(&self, leg: &LegFile) -> Result<Option<Source>, ToolError> {
        if self.slcan.is_none() && self.candump.is_none() {
            return Ok(None);
        }
        let joints = leg.joints.len();
        let nodes: Vec<u8> =
            if self.nodes.is_empty() { (1..=joints as u8).collect() } else { self.nodes.clone() };
        let repeated = nodes.iter().enumerate().find(|(index, id)| nodes[..*index].contains(id));
        if let Some((_, id)) = repeated {
            return Err(ToolError::input(format!("--nodes: {id} occurs twice")));
        }
        if !nodes.len().is_multiple_of(joints) || nodes.len() > MOST_LEGS * joints {
            return Err(ToolError::input(format!(
                "--nodes: {} node-IDs; {} has {joints} joints, so that 1 to {MOST_LEGS} legs have {joints} to {}",
                nodes.len(),
                leg.name,
                MOST_LEGS * joints
            )));
        }
        let model = self.model.as_ref().map(|path| -> Result<ModelFile, ToolError> {
            let model = ModelFile::load(path)?;
            refuse_another_leg(&model, &path.display().to_string(), leg)?;
            Ok(model)
        });
        let model = model.transpose()?;
        let bits_per_s = 1000 * self.bit_rate;
        let (lines, name, (input, speed)) = match (&self.slcan, &self.candump) {
            (Some(adapter), _) => (
                Lines::Slcan,
                adapter.clone(),
                (Box::new(listen(adapter, self.bit_rate)?) as Box<dyn Read + Send>, None),
            ),
            (None, Some(file)) => (Lines::Candump, file.display().to_string(), self.open(file)?),
            (None, None) => return Ok(None),
        };
        let input = BusInput { input, lines, name, nodes, bits_per_s, model, speed };
        Ok(Some(Source::Bus(Box::new(input))))
    }
}

/// Serves the page until Ctrl-C; returns the exit code of the last identification.
pub(crate) fn run(arguments: &LiveArguments) -> Result<u8, ToolError> {
    for (is_given, example) in [
        (arguments.recording.is_some(), "live --recording run.csv --leg my-leg.toml"),
        (arguments.trace.is_some(), "live --trace trace.txt --leg my-leg.toml"),
        (arguments.candump.is_some(), "live --candump - --leg my-leg.toml"),
        (arguments.slcan.is_some(), "live --slcan /dev/ttyACM0 --leg my-leg.toml"),
    ] {
        if is_given {
            arguments.leg.require(example)?;
        }
    }
    let leg = arguments.leg.load()?;
    let speed = arguments.speed;
    let (slowest, fastest) = SPEED;
    if !(slowest..=fastest).contains(&speed) {
        return Err(ToolError::input(format!("--speed: {speed:?} must be from {slowest} to {fastest}")));
    }
    let source = arguments.source(&leg)?;
    let server = Server::new(arguments.listen, arguments.token.clone())?;
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGTERM, signal_hook::consts::SIGINT] {
        let registered = signal_hook::flag::register(signal, Arc::clone(&stop));
        registered.map_err(|error| ToolError::input(format!("signals cannot be caught: {error}")))?;
    }
    say!("live: {}", server.url());
    if !arguments.listen.ip().is_loopback() {
        eprintln!(
            "warning: {} can be reached from other machines; the page is not encrypted. There the address begins with \
             this machine's IP address instead of `localhost`",
            arguments.listen
        );
    }
    let hub = Arc::new(Hub::default());
    let shown = Arc::clone(&hub);
    // Ends with the process.
    let page = thread::spawn(move || server.serve(shown));
    let judges = !matches!(source, Source::Bus(_));
    let mut source = Some(thread::spawn(move || report(&leg, source, &hub)));
    let mut outcome = None;
    while !stop.load(Ordering::Relaxed) {
        if page.is_finished() {
            page.join().map_err(|_| ToolError::input("the page's thread failed"))??;
            return Ok(EXIT_REFUSED);
        }
        if let Some(ended) = source.take_if(|source| source.is_finished()) {
            let (code, words) = ended.join().map_err(|_| ToolError::input("the simulation failed"))??;
            say!("{words}");
            outcome = Some(code);
            if arguments.once {
                break;
            }
            say!("the page stays open until Ctrl-C");
        }
        thread::sleep(PAUSE);
    }
    if outcome.is_none() && judges {
        eprintln!("stopped before a verdict");
    }
    Ok(outcome.unwrap_or(if judges { EXIT_REFUSED } else { EXIT_ACCEPTED }))
}

/// Runs the source; returns the exit code and the verdict with its reasons.
fn report(leg: &LegFile, source: Source, hub: &Hub) -> Result<(u8, String), ToolError> {
    let out = &|update: LiveUpdate| hub.push(update);
    let report = match source {
        Source::Simulated(options, live) => Some(identify(leg, &options, &live, out)?),
        Source::Recording(recorded, speed) => {
            let (recordings, options) = &*recorded;
            Some(play(leg, recordings, options, speed, out)?)
        }
        Source::Trace(input) => follow(leg, *input, out)?,
        Source::Bus(input) => {
            let code = if input.lines == Lines::Slcan { EXIT_INPUT } else { EXIT_ACCEPTED };
            return Ok((code, watch(leg, *input, out)?));
        }
    };
    let Some(report) = report else { return Ok((EXIT_INPUT, "the trace has no complete result".into())) };
    let code = if report.accepted() { EXIT_ACCEPTED } else { EXIT_REFUSED };
    let explained =
        report.reasons.iter().map(|reason| format!("  {reason}: {}", tables::explanation(reason)));
    let lines: Vec<String> = core::iter::once(tables::verdict_line(&report)).chain(explained).collect();
    Ok((code, lines.join("\n")))
}
