//! Random corruption of files: reading one ends in an error that names the file, or in a valid
//! result, never in a panic.
//!
//! Valid files are corrupted at random: bytes, lines, numbers, the end. The seed is fixed;
//! `SCARAB_FUZZ_CASES` requests more than the few hundred cases of each kind in every test run. A failure is
//! reduced to the fewest changes that cause it.

use std::path::Path;

use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestCaseError, TestRng, TestRunner};
use scarab_identify::formats::excitation::Excitation;
use scarab_identify::formats::leg_file::{LegFile, SHIPPED_LEGS};
use scarab_identify::formats::model_file::ModelFile;
use scarab_identify::formats::recording::Recording;
use scarab_identify::formats::robot::Robot;
use scarab_identify::leg::from_robot;
use scarab_rig::traced::run::StreamReader;
use scarab_rig::traced::run_report;

use crate::command::{Folder, MUJOCO};
use crate::kept;
use crate::robots;
use crate::trace::session;

const CASES: u32 = 200;
const NAME: &str = "spoilt-file";
const EXCITATION: &str = include_str!("../data/excitation/x2_wearer_75kg.toml");
/// Replacements of a number.
const NUMBERS: [&str; 16] = [
    "nan",
    "inf",
    "-inf",
    "1e308",
    "-1e308",
    "1e-320",
    "0",
    "-0.0",
    "-1",
    "4294967296",
    "-9223372036854775808",
    "1e999",
    "",
    "\"text\"",
    "[]",
    "3.5",
];

/// One change: kind, position, and content.
type Change = (u8, f64, u32);

fn changes() -> impl Strategy<Value = Vec<Change>> {
    prop::collection::vec((0_u8..9, 0.0..1.0_f64, any::<u32>()), 1..6)
}

/// Byte ranges of the numbers in a text.
fn numbers(text: &[u8]) -> Vec<(usize, usize)> {
    let digit = |byte: u8| byte.is_ascii_digit() || b".eE+-".contains(&byte);
    let mut found = Vec::new();
    let mut start = 0;
    while start < text.len() {
        let length = text[start..].iter().take_while(|byte| digit(**byte)).count();
        if text[start..start + length].iter().any(u8::is_ascii_digit) {
            found.push((start, start + length));
        }
        start += length.max(1);
    }
    found
}

fn spoilt(good: &str, changes: &[Change]) -> Vec<u8> {
    let mut text = good.as_bytes().to_vec();
    for &(kind, share, what) in changes {
        if text.is_empty() {
            break;
        }
        let at = ((share * text.len() as f64) as usize).min(text.len() - 1);
        let line = |from: usize| {
            let begin = text[..from].iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end + 1);
            let end =
                text[from..].iter().position(|byte| *byte == b'\n').map_or(text.len(), |end| from + end + 1);
            begin..end
        };
        match kind {
            0 => text[at] ^= 1 << (what % 8),
            1 => text.insert(at, what as u8),
            2 => {
                text.drain(at..(at + what as usize % 40).min(text.len()));
            }
            3 => text.truncate(at),
            4 => {
                let range = line(at);
                text.drain(range);
            }
            5 => {
                let (range, again) = (line(at), text[line(at)].to_vec());
                text.splice(range.start..range.start, again);
            }
            6 => {
                let (from, to) = (line(at), line(what as usize % text.len()));
                let moved = text[from].to_vec();
                text.splice(to.start..to.start, moved);
            }
            _ => {
                let numbers = numbers(&text);
                if let Some((begin, end)) = numbers.get((share * numbers.len() as f64) as usize) {
                    text.splice(*begin..*end, NUMBERS[what as usize % NUMBERS.len()].bytes());
                }
            }
        }
    }
    text
}

/// Corrupts the files and passes each to the reader, which returns the message of a rejection.
fn fuzz(files: &[String], read: impl Fn(&[u8]) -> Result<(), String>) {
    let cases = std::env::var("SCARAB_FUZZ_CASES").ok().and_then(|cases| cases.parse().ok()).unwrap_or(CASES);
    let config = Config { cases, failure_persistence: None, ..Config::default() };
    let mut runner = TestRunner::new_with_rng(config, TestRng::deterministic_rng(RngAlgorithm::ChaCha));
    let strategy = (0..files.len(), changes());
    let result = runner.run(&strategy, |(file, changes)| match read(&spoilt(&files[file], &changes)) {
        Err(words) if !words.contains(NAME) => {
            Err(TestCaseError::fail(format!("does not name the file: {words}")))
        }
        _ => Ok(()),
    });
    if let Err(failure) = result {
        panic!("{failure}");
    }
}

/// Decodes text as a program would; other bytes are rejected there.
fn text(bytes: &[u8]) -> Option<&str> {
    std::str::from_utf8(bytes).ok()
}

#[test]
fn corrupted_leg_files_are_refused_by_name_or_valid() {
    let legs: Vec<String> = SHIPPED_LEGS.iter().map(|(_, text)| (*text).to_owned()).collect();
    fuzz(&legs, |bytes| {
        let Some(text) = text(bytes) else { return Ok(()) };
        let leg = LegFile::parse(text, NAME).map_err(|error| error.to_string())?;
        // Accepted files can be written, read and simulated.
        LegFile::parse(&leg.to_toml(), NAME).map_err(|error| error.to_string())?;
        let _ = leg.description::<2>();
        let _ = leg.complete_description::<2>();
        Ok(())
    });
}

#[test]
fn corrupted_robot_descriptions_are_refused_by_name_or_become_legs() {
    let described = robots::vectors();
    let mut texts: Vec<String> = described.iter().map(|robot| robot.urdf.clone()).collect();
    let mut options: Vec<_> = described.iter().map(robots::options).collect();
    texts.push(robots::SIMPLE.to_owned());
    options.push(robots::plain());
    fuzz(&texts, |bytes| {
        let Some(text) = text(bytes) else { return Ok(()) };
        let robot = Robot::parse(text, NAME).map_err(|error| error.to_string())?;
        // Every choice of joints and locks, whichever text was corrupted.
        for options in &options {
            match from_robot::leg(&robot, options) {
                Err(error) if !error.to_string().contains(NAME) => return Err(error.to_string()),
                Err(_) => {}
                Ok(found) => {
                    LegFile::parse(&found.text, NAME).map_err(|error| error.reason)?;
                }
            }
        }
        Ok(())
    });
}

#[test]
fn corrupted_recordings_are_refused_by_name_or_valid() {
    let whole = std::fs::read_to_string(MUJOCO).expect("shipped");
    let begin: String = whole.lines().take(60).map(|line| format!("{line}\n")).collect();
    fuzz(&[begin], |bytes| {
        let Some(text) = text(bytes) else { return Ok(()) };
        let recording = Recording::parse(Path::new(NAME), text, 2).map_err(|error| error.to_string())?;
        let finite = recording.time_s.iter().all(|time| time.is_finite());
        if finite { Ok(()) } else { Err("a time that is not finite was accepted".into()) }
    });
}

#[test]
fn corrupted_models_are_refused_by_name_or_unchanged() {
    let good = kept::model();
    fuzz(&[kept::text()], |bytes| {
        let Some(text) = text(bytes) else { return Ok(()) };
        let model = ModelFile::parse(text, NAME).map_err(|error| error.to_string())?;
        // The checksum permits changes of comments and spaces only.
        if model == good { Ok(()) } else { Err("an edited model was accepted".into()) }
    });
}

#[test]
fn corrupted_motions_are_refused_by_name_or_valid() {
    let folder = Folder::new();
    let path = folder.path(NAME);
    fuzz(&[EXCITATION.to_owned()], |bytes| {
        std::fs::write(&path, bytes).expect("a temporary file");
        let motion = Excitation::load(&path).map_err(|error| error.to_string())?;
        let _ = motion.motion::<2>();
        Ok(())
    });
}

#[test]
fn corrupted_traces_are_refused_by_name_or_reported() {
    let (whole, leg) = (session::text(&session::quiet()), session::default_leg());
    fuzz(&[whole], |bytes| {
        let mut reader = StreamReader::new(None);
        reader.feed(bytes).map_err(|error| error.to_string())?;
        let trace = reader.finish(Path::new(NAME)).map_err(|error| error.to_string())?;
        let _ = run_report(&trace, &leg);
        Ok(())
    });
}
