//! Command line of `cargo chip`.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use clap::{Args, Parser, Subcommand};
use scarab_base::error::{EXIT_REFUSED, ToolError};
use scarab_base::files;
use scarab_base::number::Number;
use scarab_identify::formats::leg_file::{DEFAULT_LEG, LegFile};
use scarab_rig::assist::study::Mode;
use scarab_rig::assist::subject::Cuffs;
use serde::Serialize;

use crate::assist::{self, AssistComparison};
use crate::findings::Finding;
use crate::image::Image;
use crate::load::LEVELS;
use crate::machine::TIME_FACTOR;
use crate::report::{ChipReport, LoadReport};
use crate::session::{Session, Step};
use crate::time::seconds;
use crate::{
    crashes, drivers, faults, hangs, report, sampling, serve, situations, stops, store_cuts, update,
};

/// Run the flash image on a model of its microcontroller.
#[derive(Parser, Debug)]
#[command(name = "cargo chip", version)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand, Debug)]
enum Command {
    /// Start the board and operate it by its contacts.
    Run {
        #[command(flatten)]
        common: Common,
        /// Steps, in order.
        #[arg(long = "do", value_enum, value_delimiter = ',')]
        steps: Vec<Step>,
        /// Write the image's records as text here.
        #[arg(long, value_name = "FILE")]
        records: Option<PathBuf>,
        /// Time to run after the last step, s.
        #[arg(long, value_name = "S", default_value_t = 0.0)]
        seconds: f64,
    },
    /// Let the image assist a walking wearer, and compare the interaction torque with the host's complete
    /// drives; exit code 3 if they differ by more than 5 %.
    Assist {
        /// Shipped leg or leg file with a wearer (`segments`).
        #[arg(long, default_value = DEFAULT_LEG)]
        leg: String,
        /// Mode; may be repeated. All three unless given.
        #[arg(long, value_enum)]
        mode: Vec<Mode>,
        #[command(flatten)]
        run: Simulated,
    },
    /// Open the emergency stop's contact at many phases of the PWM period.
    Stops {
        #[command(flatten)]
        common: Common,
        /// Phases in each situation.
        #[arg(long, default_value_t = 100)]
        phases: u32,
    },
    /// Measure the sampling instants of both axes.
    Sampling(Common),
    /// Cut the power at every word of a save and within an erase.
    StoreCuts(Common),
    /// Update the image over the bus: the whole way, damaged images, power cuts.
    Update {
        #[command(flatten)]
        common: Common,
        /// Power cuts in each long part of the way.
        #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u64).range(1..))]
        cuts: u64,
        /// Cut the power after every block of the download.
        #[arg(long)]
        every_block: bool,
    },
    /// Measure the load in each situation: idle, calibrating, holding, identifying, following a host.
    Load {
        #[command(flatten)]
        common: Common,
        /// Write the instructions of each function here, as CSV.
        #[arg(long, value_name = "FILE")]
        profile: Option<PathBuf>,
    },
    /// Connect the image to the simulated bus, for existing host software.
    Serve {
        #[command(flatten)]
        common: Common,
        /// Address of the TCP port with the slcan protocol.
        #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:29536")]
        slcan: SocketAddr,
        /// Begin with a board as delivered: not calibrated. The simulated operator does what `cargo sim
        /// commission` asks for.
        #[arg(long)]
        delivered: bool,
        /// Write a new image for this board here, which differs in its version only, for an update.
        #[arg(long, value_name = "FILE.bin")]
        next: Option<PathBuf>,
        /// Simulated time to serve, s; without it until the process ends.
        #[arg(long, value_name = "S")]
        seconds: Option<f64>,
    },
    /// Inject rows of the fault catalogue.
    Faults {
        #[command(flatten)]
        common: Common,
        /// Runs of each row.
        #[arg(long, default_value_t = 20)]
        seeds: u32,
        /// Rows, such as X1; all unless given.
        #[arg(long, value_delimiter = ',')]
        rows: Vec<String>,
    },
    /// Let each level hang and check the watchdog.
    Hangs {
        #[command(flatten)]
        common: Common,
        /// Frequency of the watchdog's oscillator, Hz: 17000 to 47000.
        #[arg(long, default_value_t = 32_000)]
        oscillator_hz: u64,
    },
    /// Let the image crash and check that bridges are off before the record, and the next start refuses.
    Crashes(Common),
    /// Check the model by a program that uses embassy-stm32's drivers only.
    Drivers {
        /// Program (ELF); built unless given.
        #[arg(long)]
        image: Option<PathBuf>,
        /// Write the result as JSON here.
        #[arg(long, value_name = "FILE")]
        json: Option<PathBuf>,
    },
}

/// Seed, time and result of a simulation.
#[derive(Args, Clone, Debug)]
struct Simulated {
    /// Seed of everything random.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Cycles per instruction, 1 to 2.
    #[arg(long, default_value_t = TIME_FACTOR, value_parser = factor)]
    time_factor: f64,
    /// Write the result as JSON here.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Image, leg, time and seed.
#[derive(Args, Clone, Debug)]
struct Common {
    /// Shipped leg or leg file, for image and plant.
    #[arg(long, default_value = DEFAULT_LEG)]
    leg: String,
    /// The leg has an absolute encoder at each rotor and each joint.
    #[arg(long)]
    absolute_encoders: bool,
    /// The leg has a thermistor in each motor.
    #[arg(long)]
    thermistors: bool,
    /// Image (ELF) of that leg; built unless given.
    #[arg(long)]
    image: Option<PathBuf>,
    #[command(flatten)]
    run: Simulated,
}

fn factor(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(factor) if (1.0..=2.0).contains(&factor) => Ok(factor),
        _ => Err(format!("`{text}` is not within 1 to 2")),
    }
}

/// Runs the program.
pub fn main() -> ExitCode {
    let outcome = match Arguments::parse().command {
        Command::Run { common, steps, records, seconds } => run(&common, &steps, records.as_deref(), seconds),
        Command::Assist { leg, mode, run } => run_assist(&leg, &mode, &run),
        Command::Stops { common, phases } => run_stops(&common, phases),
        Command::Sampling(common) => run_sampling(&common),
        Command::StoreCuts(common) => run_store_cuts(&common),
        Command::Update { common, cuts, every_block } => run_update(&common, cuts, every_block),
        Command::Load { common, profile } => run_load(&common, profile.as_deref()),
        Command::Serve { common, slcan, delivered, next, seconds } => {
            run_serve(&common, slcan, delivered, next.as_deref(), seconds)
        }
        Command::Faults { common, seeds, rows } => run_faults(&common, seeds, &rows),
        Command::Hangs { common, oscillator_hz } => run_hangs(&common, oscillator_hz),
        Command::Crashes(common) => run_crashes(&common),
        Command::Drivers { image, json } => run_drivers(image, json.as_deref()),
    };
    match outcome {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(EXIT_REFUSED),
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}

impl Common {
    fn session(&self) -> Result<Session, ToolError> {
        let leg = LegFile::load_for_image(&self.leg, false)?;
        let leg = if self.absolute_encoders { leg.with_absolute_encoders() } else { leg };
        let leg = if self.thermistors { leg.with_thermistors() } else { leg };
        let image = match &self.image {
            Some(path) => Image::load(path)?,
            None => Image::build(&leg)?,
        };
        Session::new(&image, &leg, self.run.time_factor, self.run.seed)
    }

    /// A session whose board has started.
    fn booted(&self) -> Result<Session, ToolError> {
        let mut session = self.session()?;
        session.boot()?;
        Ok(session)
    }

    /// A session with the drive enabled.
    fn enabled(&self) -> Result<Session, ToolError> {
        let mut session = self.booted()?;
        session.enable_drive()?;
        Ok(session)
    }

    fn write(&self, result: &impl Serialize) -> Result<(), ToolError> {
        write(self.run.json.as_deref(), result)
    }
}

/// Writes a result as JSON, if a file is given.
fn write(path: Option<&Path>, result: &impl Serialize) -> Result<(), ToolError> {
    let Some(path) = path else { return Ok(()) };
    let text = serde_json::to_string_pretty(result).map_err(|error| ToolError::cannot_write(path, &error))?;
    files::write(path, &(text + "\n"))
}

fn run(common: &Common, steps: &[Step], records: Option<&Path>, duration: f64) -> Result<bool, ToolError> {
    let begun = Instant::now();
    let mut session = common.session()?;
    session.prints = true;
    let outcome = operate(&mut session, steps, duration);
    if let Some(path) = records {
        files::write(path, session.probe.text())?;
    }
    if let Err(error) = outcome {
        let (unknown, known) = report::findings(&session);
        print_findings(&unknown, &known);
        return Err(error);
    }
    let identified = steps.contains(&Step::Identify);
    let mut report = ChipReport::new(&mut session, identified, common.run.time_factor, common.run.seed)?;
    report.stop = stops::at_end(&mut session)?;
    print_run(&report, begun.elapsed().as_secs_f64());
    common.write(&report)?;
    let is_sound = report.findings.is_empty() && report.missed_current_ticks == 0;
    let stops = report.stop.as_ref().is_none_or(stops::Situation::is_sound);
    Ok(is_sound
        && stops
        && report.stack_suffices()
        && report.verdict != "refused"
        && report.agrees_with_the_plant())
}

fn operate(session: &mut Session, steps: &[Step], duration: f64) -> Result<(), ToolError> {
    session.boot()?;
    for step in steps {
        session.begin_measurement();
        session.step(*step)?;
        let [hip, knee] = session.chip().plant.position().map(f64::to_degrees);
        println!("{:9.3} s  {step:?} done; joints {hip:.2} {knee:.2} degrees", seconds(session.now()));
    }
    session.run(duration)
}

fn print_findings(unknown: &[Finding], known: &[(Finding, &str)]) {
    for finding in unknown {
        println!(
            "finding: {}: {} at {:#010x} in {} ({} times)",
            finding.register, finding.what, finding.pc, finding.function, finding.count
        );
    }
    for (finding, reason) in known {
        println!("known finding: {}: {} ({reason})", finding.register, finding.what);
    }
}

/// Prints the processor's load by interrupt and by level.
fn print_load(report: &ChipReport) {
    println!("interrupt          per second   instructions mean   worst   latency us   longest us");
    for (name, used) in &report.interrupts {
        println!(
            "{name:<18} {:>10.1} {:>19.1} {:>7} {:>12.2} {:>12.2}",
            used.per_second,
            used.mean_instructions,
            used.worst_instructions,
            used.worst_latency_us,
            used.longest_us
        );
    }
    let load = &report.load;
    println!(
        "load: {:.1} %, level 0 {:.1} %, servo {:.1} %, bus {:.1} %, housekeeping {:.1} %, thread {:.1} %",
        100.0 * load.total,
        100.0 * load.level0,
        100.0 * load.servo,
        100.0 * load.bus,
        100.0 * load.housekeeping,
        100.0 * load.thread
    );
}

fn print_run(report: &ChipReport, wall_s: f64) {
    print_findings(&report.findings, &report.known_findings);
    for base in &report.base_parameters {
        let show = |number: Number| number.known().map_or("-".to_owned(), |value| format!("{value:.6}"));
        println!(
            "{:>6} {:>11} +- {} {}, error {:+.2} of the leg file's sigma",
            base.name,
            show(base.value),
            show(base.sigma),
            base.unit,
            report.errors.get(&base.name).copied().unwrap_or(f64::NAN)
        );
    }
    println!(
        "verdict {}{}",
        report.verdict,
        report.reasons.iter().map(|why| format!(", {why}")).collect::<String>()
    );
    print_load(report);
    println!(
        "missed: {} current ticks, {} servo ticks; conversions lost {}; stack {} of {} bytes; records {} read, {} lost; resets {}",
        report.missed_current_ticks,
        report.servo_missed,
        report.lost_conversions,
        report.stack[0],
        report.stack[1],
        report.records[0],
        report.records[1],
        report.resets.len()
    );
    if let Some(stop) = &report.stop {
        println!(
            "emergency stop: {} phases, off after {:.2} us worst, for good {:.2} us; on again {}, stayed on {}",
            stop.phases, stop.worst_us, stop.worst_final_us, stop.on_again, stop.stayed_on
        );
    }
    println!(
        "simulated {:.3} s in {wall_s:.2} s: {:.2} of real time, {:.1} M instructions/s",
        report.simulated_s,
        report.simulated_s / wall_s,
        1e-6 * report.instructions as f64 / wall_s
    );
}

fn run_assist(leg: &str, modes: &[Mode], run: &Simulated) -> Result<bool, ToolError> {
    let leg = LegFile::load(leg)?;
    let all = [Mode::Transparent, Mode::Weight, Mode::Periodic];
    let modes = if modes.is_empty() { &all[..] } else { modes };
    // Firm cuffs: their resonance lies above a gait's harmonics, where small differences would grow.
    let cuffs = Cuffs { stiffness: 20e3, damping: 400.0 };
    let mut found = Vec::new();
    for mode in modes {
        let comparison = assist::compare(&leg, *mode, &cuffs, run.seed, run.time_factor)?;
        println!(
            "{:<12} interaction torque, N m rms: image {:.3} {:.3}, host {:.3} {:.3}; phases {}; law {:.1} % of the processor; missed {}",
            comparison.mode,
            comparison.image_rms_nm[0],
            comparison.image_rms_nm[1],
            comparison.host_rms_nm[0],
            comparison.host_rms_nm[1],
            comparison.image_phases.join(" "),
            100.0 * comparison.law_share,
            comparison.missed_current_ticks,
        );
        found.push(comparison);
    }
    write(run.json.as_deref(), &found)?;
    Ok(found.iter().all(AssistComparison::is_good))
}

fn run_stops(common: &Common, phases: u32) -> Result<bool, ToolError> {
    let report = stops::run(&mut common.booted()?, phases, common.run.time_factor)?;
    for situation in &report.situations {
        println!(
            "{:<12} {} stops, a bridge on at {}: off after {:.2} us mean, {:.2} us worst, permanently {:.2} us; on again {} ({:.2} us), stayed on {}",
            situation.name,
            situation.phases,
            situation.armed,
            situation.mean_us,
            situation.worst_us,
            situation.worst_final_us,
            situation.on_again,
            situation.longest_again_us,
            situation.stayed_on
        );
    }
    common.write(&report)?;
    Ok(report.is_sound())
}

fn run_store_cuts(common: &Common) -> Result<bool, ToolError> {
    let report = store_cuts::run(&mut common.booted()?)?;
    for save in &report.saves {
        println!(
            "{} of {} words, power cut at each and once after: {} starts with the old value, {} with the new one",
            save.save, save.words, save.found[0], save.found[1]
        );
    }
    println!(
        "{} cuts within an erase: {} starts with the old value, {} with the default",
        report.erasures, report.found_after_erasure[0], report.found_after_erasure[1]
    );
    report.violations.iter().for_each(|violation| println!("violation: {violation}"));
    common.write(&report)?;
    Ok(report.violations.is_empty())
}

fn run_update(common: &Common, cuts: u64, every_block: bool) -> Result<bool, ToolError> {
    let report = update::run(&mut common.booted()?, cuts, every_block)?;
    print!("{}", report.text());
    common.write(&report)?;
    Ok(report.failed() == 0)
}

fn run_load(common: &Common, profile: Option<&Path>) -> Result<bool, ToolError> {
    let mut session = common.booted()?;
    let found = situations::run(&mut session, profile.is_some())?;
    println!("mean and largest instructions of each interrupt, and shares of the processor");
    let names: Vec<String> = found.iter().map(|situation| format!("{:>14}", situation.name)).collect();
    println!("{:<18}{}", "", names.concat());
    for (name, _) in LEVELS {
        let cells = found.iter().map(|situation| {
            let used = &situation.interrupts[name];
            format!("{:>7.0} {:>6}", used.mean_instructions, used.worst_instructions)
        });
        println!("{name:<18}{}", cells.collect::<String>());
    }
    type Share = fn(&LoadReport) -> f64;
    let shares: [(&str, Share); 6] = [
        ("level 0", |load| load.level0),
        ("servo", |load| load.servo),
        ("bus", |load| load.bus),
        ("housekeeping", |load| load.housekeeping),
        ("thread", |load| load.thread),
        ("in all", |load| load.total),
    ];
    for (name, share) in shares {
        let cells = found.iter().map(|situation| format!("{:>12.1} %", 100.0 * share(&situation.load)));
        println!("{name:<18}{}", cells.collect::<String>());
    }
    for situation in &found {
        for (name, calls) in situation.calls.iter().filter(|(_, calls)| calls.count > 0) {
            println!(
                "{}: {name}: {} calls, {:.0} instructions in the mean, {} at worst, {:.2} s at 8 ns in all",
                situation.name, calls.count, calls.mean_instructions, calls.worst_instructions, calls.seconds
            );
        }
    }
    if let Some(path) = profile {
        let mut text = String::from("situation,exception,instructions,function\n");
        for situation in &found {
            for (exception, function, instructions) in &situation.profile {
                text.push_str(&format!("{},{exception},{instructions},\"{function}\"\n", situation.name));
            }
        }
        files::write(path, &text)?;
    }
    common.write(&found)?;
    let (unknown, known) = report::findings(&session);
    print_findings(&unknown, &known);
    let missed = situations::missed_goals(&found);
    missed.iter().for_each(|goal| println!("missed goal: {goal}"));
    Ok(missed.is_empty() && unknown.is_empty())
}

fn run_serve(
    common: &Common,
    slcan: SocketAddr,
    delivered: bool,
    next: Option<&Path>,
    duration: Option<f64>,
) -> Result<bool, ToolError> {
    let mut session = common.booted()?;
    if !delivered {
        for (step, words) in
            [(Step::Calibrate, "calibrates both motors"), (Step::Reference, "takes the reference")]
        {
            eprintln!("the operator {words}; the port opens afterwards");
            session.step(step)?;
        }
        // A host enables the drive; the leg is let go at its last position.
        session.hold_switch(true);
    }
    if let Some(path) = next {
        let [_, next] = update::programs(&session)?;
        files::write(path, &next)?;
    }
    session.chip_mut().can.connected = false;
    session.prints = true;
    let operator = delivered.then(serve::Operator::default);
    serve::serve(&mut session, slcan, duration, operator)?;
    let (unknown, known) = report::findings(&session);
    print_findings(&unknown, &known);
    Ok(unknown.is_empty())
}

fn run_faults(common: &Common, seeds: u32, rows: &[String]) -> Result<bool, ToolError> {
    let reports = faults::run(&mut common.booted()?, seeds, rows)?;
    for report in &reports {
        println!(
            "{:<3} {:<56} missed {} of {}, worst {:.4} ms, deadline {:.4} ms",
            report.id, report.fault, report.missed, report.runs, report.worst_ms, report.deadline_ms
        );
        report.complaints.iter().take(3).for_each(|complaint| println!("      {complaint}"));
    }
    common.write(&reports)?;
    Ok(reports.iter().all(|report| report.missed == 0))
}

fn run_hangs(common: &Common, oscillator_hz: u64) -> Result<bool, ToolError> {
    let reports = hangs::run(&mut common.enabled()?, oscillator_hz)?;
    for report in &reports {
        let time = |time: Option<f64>| time.map_or("never".to_owned(), |time| format!("after {time:.3} ms"));
        println!(
            "{:<18} bridges off {}, reset {}{}",
            report.level,
            time(report.released_ms),
            time(report.reset_ms),
            if report.on_again { ", on again" } else { "" }
        );
    }
    common.write(&reports)?;
    Ok(reports.iter().all(hangs::HangReport::is_sound))
}

fn run_crashes(common: &Common) -> Result<bool, ToolError> {
    let reports = crashes::run(&mut common.enabled()?)?;
    for report in &reports {
        let time = |time: Option<f64>| time.map_or("never".to_owned(), |time| format!("after {time:.2} us"));
        println!(
            "{:<14} {:<11} bridges off {}, record written {} to {}, reset {}",
            report.kind,
            report.situation,
            time(report.released_us),
            time(report.stored_us.map(|[first, _]| first)),
            time(report.stored_us.map(|[_, last]| last)),
            time(report.reset_us)
        );
        println!("    {}", report.record);
        report.complaints.iter().for_each(|complaint| println!("    FAILED: {complaint}"));
    }
    common.write(&reports)?;
    Ok(reports.iter().all(|report| report.complaints.is_empty()))
}

fn run_drivers(image: Option<PathBuf>, json: Option<&Path>) -> Result<bool, ToolError> {
    let rows = drivers::check(&image.map_or_else(drivers::build, Ok)?)?;
    println!(
        "{:<10} | {:<56} | {:<56} | verdict",
        "peripheral", "request to the driver", "what the model shows"
    );
    for row in &rows {
        println!("{:<10} | {:<56} | {:<56} | {}", row.peripheral, row.requested, row.shown, row.verdict());
    }
    write(json, &rows)?;
    Ok(rows.iter().all(drivers::Row::is_sound))
}

fn run_sampling(common: &Common) -> Result<bool, ToolError> {
    let report = sampling::run(&mut common.enabled()?)?;
    for report in &report.situations {
        println!(
            "{:<8} axis {}: {} conversions, trigger {:.1} to {:.1} ns and hold {:.1} to {:.1} ns after the middle; edges of the other bridge before {}",
            report.situation,
            report.axis,
            report.conversions,
            report.trigger_ns[0],
            report.trigger_ns[1],
            report.hold_ns[0],
            report.hold_ns[1],
            report.disturbed
        );
    }
    for step in &report.sweep.steps {
        println!(
            "other bridge at {:>2} to {:>2} V: {} conversions, {} with an edge before",
            step.from_v,
            step.from_v + 1,
            step.conversions,
            step.disturbed
        );
    }
    println!(
        "bus {:.1} V, other bridge up to {:.2} V: no edge up to {:.2} V (documented: {:.1} V); above, edges before {:.1} % of the conversions",
        report.sweep.bus_v,
        report.sweep.highest_v,
        report.sweep.clean_v,
        sampling::CLEAN_V,
        100.0 * report.sweep.share_above
    );
    common.write(&report)?;
    Ok(report.is_sound())
}
