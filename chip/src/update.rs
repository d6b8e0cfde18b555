//! A new image over the bus, on the unmodified bootloader and image: the whole way, damaged images, and power
//! cuts at every kind of step.
//!
//! The new image is the present one with another version text, sealed again, so that 1F56 and 100A
//! distinguish both. After every trial the board must run one of the two images, undamaged, and answer; after
//! the last cut of each part it must take another update.

use std::fmt::Write as _;

use scarab::bus::program::{ProgramCommand, ProgramError, ProgramStatus};
use scarab_base::error::ToolError;
use scarab_boot::{HEADER_AT, Region, seal};
use scarab_client::bus::{Object, Patience};
use scarab_client::update::{DATA, SOFTWARE, STATUS, Update, check};
use serde::Serialize;

use crate::machine::Snapshot;
use crate::peripherals::flash::Cut;
use crate::session::Session;
use crate::time::seconds;

/// Node through which the image comes.
const NODE: u8 = 1;
/// Longest start that swaps both images and swaps them back, s.
const SWAPPED_S: f64 = 90.0;
/// Segments of a block.
const BLOCK: usize = 32;
/// Word that requests a swap, as `embassy-boot` writes it.
const SWAP: [u8; 4] = [0xF0; 4];
/// Instants within an erase at which the power is cut.
const SHARES: [f64; 3] = [0.05, 0.5, 0.95];

/// Image that a trial may leave running.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Expected {
    Old,
    New,
    Either,
}

/// One trial.
#[derive(Clone, Debug, Serialize)]
pub struct Trial {
    /// What was done.
    pub what: String,
    /// What was found, or what was wrong.
    pub found: String,
    /// Whether it is as it must be.
    pub passes: bool,
}

/// Result of all trials.
#[derive(Clone, Debug, Default, Serialize)]
pub struct UpdateReport {
    /// Bytes of the image.
    pub bytes: usize,
    pub download_s: f64,
    /// Time from the start command to the boot-up message of the new image, s.
    pub restart_s: f64,
    pub trials: Vec<Trial>,
}

impl UpdateReport {
    /// Number of trials that did not pass.
    pub fn failed(&self) -> usize {
        self.trials.iter().filter(|trial| !trial.passes).count()
    }

    pub fn text(&self) -> String {
        let mut text = format!(
            "image {} bytes; download {:.1} s, restart with swap {:.1} s\n",
            self.bytes, self.download_s, self.restart_s
        );
        for trial in &self.trials {
            let mark = if trial.passes { "ok    " } else { "FAILED" };
            let _ = writeln!(text, "{mark} {}: {}", trial.what, trial.found);
        }
        let _ = writeln!(text, "{} of {} trials pass", self.trials.len() - self.failed(), self.trials.len());
        text
    }
}

/// Old and new program, and the saved states from which trials begin.
struct Bench<'a> {
    session: &'a mut Session,
    old: Vec<u8>,
    new: Vec<u8>,
    report: UpdateReport,
}

/// Check sum in the header of a program.
fn checksum(program: &[u8]) -> u32 {
    let at = HEADER_AT as usize + 12;
    u32::from_le_bytes([program[at], program[at + 1], program[at + 2], program[at + 3]])
}

/// Program that differs from this one in its version text.
fn changed(program: &[u8]) -> Result<Vec<u8>, ToolError> {
    let version = env!("CARGO_PKG_VERSION").as_bytes();
    let mut new = program.to_vec();
    let addresses: Vec<usize> =
        (0..new.len() - version.len()).filter(|&at| &new[at..at + version.len()] == version).collect();
    if addresses.is_empty() {
        return Err(ToolError::input("the image does not contain its version"));
    }
    for at in addresses {
        new[at + version.len() - 1] = b'9';
    }
    seal(&mut new).map_err(|error| ToolError::input(format!("the changed image: {error:?}")))?;
    Ok(new)
}

impl Session {
    /// Runs until the first node's boot-up message, without a request of the host.
    fn await_start(&mut self, longest: f64) -> Result<(), ToolError> {
        self.await_boot_up(longest, 5e-3)?;
        self.run(1e-2)
    }

    /// Cuts the power and waits until an image runs.
    fn start_up(&mut self) -> Result<(), ToolError> {
        self.forget_frames();
        self.machine.power_cycle();
        self.await_start(SWAPPED_S)
    }

    /// Gives a command for the program.
    fn command(&mut self, command: ProgramCommand) -> Result<(), ToolError> {
        Update { client: self.client(), node: NODE, say: &mut |_: &str| {} }.command(command)
    }

    /// Waits until nothing is under way; the board is silent while it erases a sector.
    fn settled(&mut self) -> Result<ProgramStatus, ToolError> {
        let patience = core::mem::replace(&mut self.patience, Patience::REAL.answer);
        let settled = Update { client: self.client(), node: NODE, say: &mut |_: &str| {} }.settled();
        self.patience = patience;
        settled
    }

    /// Gives a command and waits until it is finished.
    fn command_done(&mut self, command: ProgramCommand) -> Result<ProgramStatus, ToolError> {
        self.command(command)?;
        self.settled()
    }

    /// Writes a program; `between` is called after each block.
    fn download(
        &mut self,
        program: &[u8],
        mut between: impl FnMut(&Self) -> Result<(), ToolError>,
    ) -> Result<(), ToolError> {
        let (mut blocks, mut kept) = (0, Ok(()));
        let progress = |session: &&mut Self, _| {
            blocks += 1;
            if kept.is_ok() {
                kept = between(session);
            }
        };
        let written = self.client().download(NODE, DATA, program, progress);
        written.map_err(|error| error.refused(NODE, DATA))?;
        let least = program.len().div_ceil(7 * BLOCK);
        if blocks != least {
            return Err(ToolError::Refused(format!(
                "{blocks} blocks instead of {least}: segments were lost"
            )));
        }
        kept
    }

    fn read(&mut self, Object(index, sub): Object) -> Result<u32, ToolError> {
        self.read_object(u16::from(NODE), index, sub)
    }
}

impl Bench<'_> {
    fn note(&mut self, what: impl Into<String>, found: Result<String, String>) {
        let passes = found.is_ok();
        let found = found.unwrap_or_else(|wrong| wrong);
        self.report.trials.push(Trial { what: what.into(), found, passes });
    }

    /// Checks which image runs and that its sectors are undamaged.
    fn running(&mut self, expected: Expected) -> Result<String, String> {
        let software = self.session.read(SOFTWARE).map_err(|error| error.to_string())?;
        let status = self.session.read(STATUS).map_err(|error| error.to_string())?;
        let is_new = software == checksum(&self.new);
        if !is_new && software != checksum(&self.old) {
            return Err(format!("1F56 is {software:#x}, of neither image"));
        }
        let (name, program) = if is_new { ("new", &self.new) } else { ("old", &self.old) };
        if !self.session.chip().flash.region(&Region::IMAGE).starts_with(program) {
            return Err(format!("the sectors of the {name} image differ from it"));
        }
        let trial = if ProgramStatus(status).has(ProgramStatus::ON_TRIAL) { ", on trial" } else { "" };
        let found = format!("the {name} image runs{trial}");
        match expected {
            Expected::Old if is_new => Err(found),
            Expected::New if !is_new => Err(found),
            _ => Ok(found),
        }
    }

    /// Restarts from a power cut and checks what runs.
    fn start_up(&mut self, expected: Expected) -> Result<String, String> {
        self.session.start_up().map_err(|error| error.to_string())?;
        self.running(expected)
    }

    /// The whole way to a new image on trial; returns the states after clearing, writing and restarting.
    fn whole(&mut self) -> Result<[Snapshot; 4], ToolError> {
        let idle = self.session.machine.save()?;
        self.session.command_done(ProgramCommand::Stop)?;
        let cleared = self.session.command_done(ProgramCommand::Clear)?;
        let is_cleared = cleared.has(ProgramStatus::CLEARED);
        self.note("clear", if is_cleared { Ok("cleared".into()) } else { Err(format!("{cleared:x?}")) });
        let cleared = self.session.machine.save()?;
        let begun = self.session.now();
        let program = self.new.clone();
        self.session.download(&program, |_| Ok(()))?;
        self.session.settled()?;
        self.report.download_s = seconds(self.session.now() - begun);
        let written = self.session.machine.save()?;
        let (begun, resets) = (self.session.now(), self.session.resets.len());
        self.session.command(ProgramCommand::Start)?;
        self.session.await_start(SWAPPED_S)?;
        self.report.restart_s = seconds(self.session.now() - begun);
        let found = self.running(Expected::New);
        let once = self.session.resets.len() == resets + 1;
        self.note("start", if once { found } else { Err("the board did not restart once".into()) });
        Ok([idle, cleared, written, self.session.machine.save()?])
    }

    /// What becomes of an image on trial.
    fn trials(&mut self, trial: &Snapshot) -> Result<(), ToolError> {
        self.session.machine.restore(trial)?;
        self.session.command(ProgramCommand::Reset)?;
        let found = self.session.await_start(SWAPPED_S).map_err(|error| error.to_string());
        let found = found.and_then(|()| self.running(Expected::Old));
        self.note("restart by 1F51 without confirmation", found);
        let found = self.start_up(Expected::Old);
        self.note("power cut after that", found);
        self.session.machine.restore(trial)?;
        let refused = [ProgramCommand::Stop, ProgramCommand::Clear]
            .map(|command| matches!(self.session.command(command), Err(ToolError::Refused(_))));
        let found = self.start_up(Expected::Old);
        let found = if refused == [true; 2] { found } else { Err("stopped or cleared".into()) };
        self.note("another update while on trial is refused; power cut", found);
        self.session.machine.restore(trial)?;
        let found = self.start_up(Expected::Old);
        self.note("power cut without confirmation", found);
        self.session.machine.restore(trial)?;
        // During the trial the old image begins at the second sector of the space.
        let old = Region::NEW_IMAGE.sector_bytes as usize;
        self.session.chip_mut().flash.region_mut(&Region::NEW_IMAGE)[old + 1000] ^= 1;
        let found = self.start_up(Expected::New);
        self.note("power cut without confirmation, and the old image has decayed", found);
        self.session.machine.restore(trial)?;
        let status = self.session.command_done(ProgramCommand::Start)?;
        let confirmed = !status.has(ProgramStatus::ON_TRIAL);
        let found = self.start_up(Expected::New);
        self.note("power cut after the confirmation", if confirmed { found } else { Err("on trial".into()) });
        Ok(())
    }

    /// Damaged images: the running image refuses them, the bootloader swaps them back.
    fn damaged(&mut self, idle: &Snapshot, written: &Snapshot) -> Result<(), ToolError> {
        let (header, length) = (HEADER_AT as usize, self.new.len());
        let resealed = |at: usize, value: u32| {
            move |image: &mut [u8]| image[at..at + 4].copy_from_slice(&value.to_le_bytes())
        };
        let flip = |at: usize| move |image: &mut [u8]| image[at] ^= 1;
        type Damage<'a> = Box<dyn Fn(&mut [u8]) + 'a>;
        let cases: [(&str, Damage<'_>, ProgramError); 11] = [
            ("no image at all", Box::new(|image| image.fill(0)), ProgramError::NoProgram),
            ("nothing arrived", Box::new(|image| image.fill(0xFF)), ProgramError::NoProgram),
            ("no magic word", Box::new(flip(header)), ProgramError::NoProgram),
            ("image of another board", Box::new(flip(header + 4)), ProgramError::Format),
            (
                "length beyond the sectors",
                Box::new(resealed(header + 8, Region::IMAGE.bytes() + 4)),
                ProgramError::Format,
            ),
            ("length not in words", Box::new(resealed(header + 8, 1001)), ProgramError::Format),
            ("length too short", Box::new(resealed(header + 8, 1000)), ProgramError::Checksum),
            ("not sealed", Box::new(resealed(header + 8, u32::MAX)), ProgramError::Format),
            ("another check sum", Box::new(flip(header + 12)), ProgramError::Checksum),
            ("first bit wrong", Box::new(flip(0)), ProgramError::Checksum),
            ("end missing", Box::new(move |image| image[length - 4..].fill(0xFF)), ProgramError::Checksum),
        ];
        for (name, damage, error) in &cases {
            self.session.machine.restore(written)?;
            damage(self.session.chip_mut().flash.region_mut(&Region::NEW_IMAGE));
            let status = self.session.command_done(ProgramCommand::Start)?;
            let is_refused = status.error() == *error as u8 && status.has(ProgramStatus::STOPPED);
            let found = format!("refused: {}", error.words());
            let found = if is_refused { Ok(found) } else { Err(format!("status {:#x}", status.0)) };
            self.note(format!("{name}, by the image"), found);
            let found = self.start_up(Expected::Old);
            self.note(format!("{name}, power cut after the refusal"), found);
        }
        for (name, damage, _) in cases.iter().skip(1).step_by(3) {
            self.session.machine.restore(idle)?;
            let flash = &mut self.session.chip_mut().flash;
            let space = flash.region_mut(&Region::NEW_IMAGE);
            space[..self.new.len()].copy_from_slice(&self.new);
            damage(space);
            let state = flash.region_mut(&Region::STATE);
            state.fill(0xFF);
            state[..4].copy_from_slice(&SWAP);
            let found = self.start_up(Expected::Old);
            self.note(format!("{name}, by the bootloader"), found);
        }
        Ok(())
    }

    /// Cuts the power at words and within erases of a part of the way. `begin` starts it; afterwards one of
    /// the expected images must run.
    fn cut(
        &mut self,
        name: &str,
        from: &Snapshot,
        points: u64,
        expected: Expected,
        begin: impl Fn(&mut Session) -> Result<(), ToolError>,
    ) -> Result<(), ToolError> {
        self.session.machine.restore(from)?;
        let flash = &self.session.chip().flash;
        let before = (flash.words, flash.erasures);
        begin(self.session)?;
        let flash = &self.session.chip().flash;
        let (words, erasures) = (flash.words - before.0, flash.erasures - before.1);
        let at_words = (0..points.min(words)).map(|point| Cut::Word(point * words / points.min(words)));
        let at_erasures = (0..erasures).flat_map(|erasure| SHARES.map(|share| Cut::Erasure(erasure, share)));
        let (mut runs, mut wrong) = ([0; 2], Vec::new());
        let cuts: Vec<Cut> = at_words.chain(at_erasures).collect();
        for cut in &cuts {
            self.session.machine.restore(from)?;
            self.session.chip_mut().flash.cut = Some(*cut);
            // The board is silent after the cut, which ends the wait of a host.
            let _ = begin(self.session);
            if !self.session.chip().flash.is_cut {
                wrong.push(format!("{cut:?}: the power was not cut"));
                continue;
            }
            match self.start_up(expected) {
                Ok(found) => runs[usize::from(found.contains("new"))] += 1,
                Err(error) => wrong.push(format!("{cut:?}: {error}")),
            }
        }
        let found = format!(
            "{} cuts in {words} words and {erasures} erases; the old image runs after {}, the new after {}",
            cuts.len(),
            runs[0],
            runs[1]
        );
        let found = if wrong.is_empty() { Ok(found) } else { Err(wrong.join("; ")) };
        self.note(format!("power cuts while the board {name}"), found);
        self.note_update(&format!("while the board {name}"));
        Ok(())
    }

    /// Cuts the power after blocks of the download.
    fn cut_download(&mut self, cleared: &Snapshot, points: u64) -> Result<(), ToolError> {
        self.session.machine.restore(cleared)?;
        let program = self.new.clone();
        let blocks = program.len().div_ceil(7 * BLOCK);
        let every = (blocks as u64 / points).max(1);
        let (mut count, mut states) = (0, Vec::new());
        self.session.download(&program, |session| {
            count += 1;
            if count % every == 0 {
                states.push(session.machine.save()?);
            }
            Ok(())
        })?;
        let mut wrong = Vec::new();
        for state in &states {
            self.session.machine.restore(state)?;
            if let Err(error) = self.start_up(Expected::Old) {
                wrong.push(error);
            }
        }
        let found = format!("{} cuts in {count} blocks; the old image runs after each", states.len());
        self.note(
            "power cuts between blocks",
            if wrong.is_empty() { Ok(found) } else { Err(wrong.join("; ")) },
        );
        self.note_update("between blocks");
        Ok(())
    }

    /// Updates the board once more, from where the last power cut has left it.
    fn note_update(&mut self, cut: &str) {
        let found = self.update();
        self.note(format!("another update after the last power cut {cut}"), found);
    }

    /// Confirms an image on trial, and brings the other one onto the board.
    fn update(&mut self) -> Result<String, String> {
        let words = |error: ToolError| error.to_string();
        let status = self.session.read(STATUS).map_err(words)?;
        if ProgramStatus(status).has(ProgramStatus::ON_TRIAL) {
            self.session.command_done(ProgramCommand::Start).map_err(words)?;
        }
        let is_new = self.session.read(SOFTWARE).map_err(words)? == checksum(&self.new);
        let (program, expected) =
            if is_new { (&self.old, Expected::Old) } else { (&self.new, Expected::New) };
        let header = check(program)?;
        let patience = core::mem::replace(&mut self.session.patience, Patience::REAL.answer);
        let mut update = Update { client: self.session.client(), node: NODE, say: &mut |_: &str| {} };
        let updated = update.run(program, &header).map_err(words);
        self.session.patience = patience;
        updated?;
        self.running(expected)
    }
}

/// The running image, and the same with another version text.
///
/// # Errors
/// The image does not contain its version.
pub fn programs(session: &Session) -> Result<[Vec<u8>; 2], ToolError> {
    let image = session.chip().flash.region(&Region::IMAGE);
    let at = HEADER_AT as usize + 8;
    let length = u32::from_le_bytes([image[at], image[at + 1], image[at + 2], image[at + 3]]) as usize;
    let old = image.get(..length).ok_or_else(|| ToolError::input("the image is not sealed"))?.to_vec();
    let new = changed(&old)?;
    Ok([old, new])
}

/// Tries everything, from a session that was just started. `points` is the least number of cuts in each long
/// part, as far as it has so many places; in the download there can be one after every block.
///
/// # Errors
/// The image does not take an update at all.
pub fn run(session: &mut Session, points: u64, every_block: bool) -> Result<UpdateReport, ToolError> {
    let [old, new] = programs(session)?;
    let report = UpdateReport { bytes: old.len(), ..UpdateReport::default() };
    let mut bench = Bench { session, old, new, report };
    let [idle, cleared, written, trial] = bench.whole()?;
    bench.trials(&trial)?;
    bench.damaged(&idle, &written)?;
    bench.cut("clears the space", &idle, points, Expected::Old, |session| {
        session.command_done(ProgramCommand::Stop)?;
        session.command_done(ProgramCommand::Clear).map(drop)
    })?;
    bench.cut_download(&cleared, if every_block { u64::MAX } else { points })?;
    bench.cut("swaps the new image in", &written, points, Expected::Either, |session| {
        session.command(ProgramCommand::Start)?;
        session.await_start(SWAPPED_S)
    })?;
    bench.cut("swaps the old image back", &trial, points, Expected::Old, |session| {
        session.command(ProgramCommand::Reset)?;
        session.await_start(SWAPPED_S)
    })?;
    bench.cut("confirms the new image", &trial, points, Expected::Either, |session| {
        session.command_done(ProgramCommand::Start).map(drop)
    })?;
    Ok(bench.report)
}

#[cfg(test)]
mod tests {
    use super::*;
    use scarab_boot::Header;

    #[test]
    fn the_changed_image_differs_in_version_and_check_sum_only() {
        let mut image = vec![0; 2000];
        for (index, word) in Header::UNSEALED.into_iter().enumerate() {
            image[HEADER_AT as usize + 4 * index..][..4].copy_from_slice(&word.to_le_bytes());
        }
        image[1000..1000 + env!("CARGO_PKG_VERSION").len()]
            .copy_from_slice(env!("CARGO_PKG_VERSION").as_bytes());
        seal(&mut image).expect("an image");
        let new = changed(&image).expect("a version");
        assert_ne!(checksum(&new), checksum(&image));
        let at = HEADER_AT as usize + 12;
        let other = (0..2000).filter(|&index| new[index] != image[index] && !(at..at + 4).contains(&index));
        assert_eq!(other.collect::<Vec<_>>(), [1000 + env!("CARGO_PKG_VERSION").len() - 1]);
        assert!(changed(&[0; 1000]).is_err());
    }
}
