//! Power cuts at every word of a save and within an erase; the next start must find the old or the new value.

use serde::Serialize;

use scarab_base::error::ToolError;

use crate::machine::Snapshot;
use crate::peripherals::flash::Cut;
use crate::session::Session;
use crate::time::ticks;

/// Stored object: following error window of the first node.
pub(crate) const OBJECT: u16 = 0x6065;
const OLD: u32 = 1000;
const NEW: u32 = 2000;
/// Request that changes the flash: index of its object, and the word that is written there.
pub(crate) type Request = (u16, [u8; 4]);
pub(crate) const SAVE: Request = (0x1010, *b"save");
pub(crate) const LOAD: Request = (0x1011, *b"load");
/// Longest answer to a request that changes the flash, s.
pub(crate) const LONGEST_S: f64 = 12.0;
/// Longest start that repairs the flash, s: two sectors are erased.
const REPAIR_S: f64 = 6.0;
/// Instants within an erase at which the power is cut.
const ERASURES: u32 = 20;

/// Cuts within one save.
#[derive(Clone, Debug, Default, Serialize)]
pub struct SaveReport {
    /// Saved data.
    pub save: &'static str,
    /// Words of the save; the power is cut at each.
    pub words: u64,
    /// Starts that found the value before, and the new one.
    pub found: [u32; 2],
}

/// Result of all cuts.
#[derive(Clone, Debug, Default, Serialize)]
pub struct CutReport {
    pub saves: Vec<SaveReport>,
    /// Cuts within an erase.
    pub erasures: u32,
    /// Starts that found the old value, and the default one, after a cut erase.
    pub found_after_erasure: [u32; 2],
    /// Starts that found another value.
    pub violations: Vec<String>,
}

impl Session {
    /// Starts the board again after a power cut and waits for its node.
    pub(crate) fn power_up(&mut self) -> Result<(), ToolError> {
        self.forget_frames();
        self.machine.power_cycle();
        self.boot()?;
        // Frames before the boot-up message are not answered.
        self.await_boot_up(REPAIR_S, 1e-3)
    }

    /// Runs until the first node's boot-up message, or until the power is cut.
    pub(crate) fn await_boot_up(&mut self, longest: f64, poll: f64) -> Result<(), ToolError> {
        let end = self.now() + ticks(longest);
        while !self.chip().can.sent.iter().any(|(_, frame)| frame.id() == 0x701) {
            if self.now() >= end {
                return Err(ToolError::input(format!("no boot-up message within {longest} s")));
            }
            if self.chip().flash.is_cut {
                return Ok(());
            }
            self.run(poll)?;
        }
        Ok(())
    }

    /// Starts the board again after a power cut and reads the stored object.
    fn read_after_cut(&mut self) -> Result<u32, ToolError> {
        self.power_up()?;
        self.run(1e-2)?;
        self.read_object(1, OBJECT, 0)
    }
}

/// Cuts the power everywhere, from a session that was just started with an empty flash.
///
/// # Errors
/// The image does not store at all.
pub fn run(session: &mut Session) -> Result<CutReport, ToolError> {
    let default = session.read_object(1, OBJECT, 0)?;
    let empty = session.machine.save()?;
    let mut report = CutReport::default();
    cut_saves(session, "first save", &empty, [default, OLD], &mut report)?;
    session.machine.restore(&empty)?;
    session.write_object(1, OBJECT, 0, OLD)?;
    session.store(SAVE, LONGEST_S)?;
    let old = session.machine.save()?;
    cut_saves(session, "second save", &old, [OLD, NEW], &mut report)?;
    cut_erasures(session, &old, default, &mut report)?;
    session.machine.restore(&old)?;
    Ok(report)
}

fn cut_saves(
    session: &mut Session,
    save: &'static str,
    saved: &Snapshot,
    [before, after]: [u32; 2],
    report: &mut CutReport,
) -> Result<(), ToolError> {
    let mut cuts = SaveReport { save, ..SaveReport::default() };
    session.machine.restore(saved)?;
    let words = session.chip().flash.words;
    session.write_object(1, OBJECT, 0, after)?;
    session.store(SAVE, LONGEST_S)?;
    cuts.words = session.chip().flash.words - words;
    // One more than the words: the save is then complete.
    for word in 0..=cuts.words {
        session.machine.restore(saved)?;
        session.write_object(1, OBJECT, 0, after)?;
        session.chip_mut().flash.cut = Some(Cut::Word(word));
        session.store(SAVE, LONGEST_S)?;
        if session.chip().flash.is_cut == (word == cuts.words) {
            report.violations.push(format!("{save}: the power was not cut at word {word}"));
            continue;
        }
        match session.read_after_cut() {
            Ok(value) if value == before && word < cuts.words => cuts.found[0] += 1,
            Ok(value) if value == after => cuts.found[1] += 1,
            other => report.violations.push(format!("{save}, cut at word {word}: {other:?}")),
        }
    }
    report.saves.push(cuts);
    Ok(())
}

fn cut_erasures(
    session: &mut Session,
    old: &Snapshot,
    default: u32,
    report: &mut CutReport,
) -> Result<(), ToolError> {
    for step in 0..ERASURES {
        session.machine.restore(old)?;
        let share = (f64::from(step) + 0.5) / f64::from(ERASURES);
        session.chip_mut().flash.cut = Some(Cut::Erasure(0, share));
        session.store(LOAD, LONGEST_S)?;
        if !session.chip().flash.is_cut {
            report.violations.push(format!("the power was not cut within erase {step}"));
            continue;
        }
        report.erasures += 1;
        match session.read_after_cut() {
            Ok(OLD) => report.found_after_erasure[0] += 1,
            Ok(value) if value == default => report.found_after_erasure[1] += 1,
            other => report.violations.push(format!("after a cut within erase {step}: {other:?}")),
        }
    }
    Ok(())
}
