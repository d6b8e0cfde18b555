//! Power cuts at every word of a save and within an erase; the next start must find the old or the new value.

use serde::Serialize;

use scarab_host::base::error::ToolError;

use crate::machine::Snapshot;
use crate::peripherals::flash::Cut;
use crate::session::Session;

/// Object that is stored: following error window of the first node.
const OBJECT: u16 = 0x6065;
const OLD: u32 = 1000;
const NEW: u32 = 2000;
const SAVE: (u16, u32) = (0x1010, u32::from_le_bytes(*b"save"));
const LOAD: (u16, u32) = (0x1011, u32::from_le_bytes(*b"load"));
/// Longest answer to a request that changes the flash, s.
const LONGEST_S: f64 = 12.0;
/// Instants within an erase at which the power is cut.
const ERASURES: u32 = 20;

/// Result of all cuts.
#[derive(Clone, Debug, Default, Serialize)]
pub struct CutReport {
    /// Words of the save, each of which was cut once.
    pub words: u64,
    /// Starts that found the old and the new value after a cut save.
    pub found: [u32; 2],
    /// Cuts within an erase; starts that found the old value, and the default one.
    pub erasures: u32,
    /// Starts that found the old value, and the default one, after a cut erase.
    pub found_after_erasure: [u32; 2],
    /// Starts that found anything else.
    pub violations: Vec<String>,
}

impl Session {
    /// Starts the board again after a power cut and reads the stored object.
    fn read_after_cut(&mut self) -> Result<u32, ToolError> {
        self.machine.power_cycle();
        self.boot()?;
        self.read_object(1, OBJECT, 0)
    }
}

/// Cuts the power everywhere, from a session that has just started with an empty flash.
///
/// # Errors
/// The image does not store at all.
pub fn run(session: &mut Session) -> Result<CutReport, ToolError> {
    let default = session.read_object(1, OBJECT, 0)?;
    session.write_object(1, OBJECT, 0, OLD, 0.5)?;
    session.write_object(1, SAVE.0, 1, SAVE.1, LONGEST_S)?;
    let old = session.save()?;
    let mut report = CutReport::default();
    cut_saves(session, &old, &mut report)?;
    cut_erasures(session, &old, default, &mut report)?;
    session.machine.restore(&old)?;
    Ok(report)
}

fn cut_saves(session: &mut Session, old: &Snapshot, report: &mut CutReport) -> Result<(), ToolError> {
    let before = session.machine.chip().flash.words;
    session.write_object(1, OBJECT, 0, NEW, 0.5)?;
    session.write_object(1, SAVE.0, 1, SAVE.1, LONGEST_S)?;
    report.words = session.machine.chip().flash.words - before;
    for word in 0..report.words {
        session.machine.restore(old)?;
        session.write_object(1, OBJECT, 0, NEW, 0.5)?;
        session.machine.chip_mut().flash.cut = Some(Cut::Word(word));
        // No answer comes from a board without power.
        let _ = session.write_object(1, SAVE.0, 1, SAVE.1, LONGEST_S);
        if !session.machine.chip().flash.is_cut {
            report.violations.push(format!("the power was not cut at word {word}"));
            continue;
        }
        match session.read_after_cut() {
            Ok(OLD) => report.found[0] += 1,
            Ok(NEW) => report.found[1] += 1,
            other => report.violations.push(format!("after a cut at word {word}: {other:?}")),
        }
    }
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
        session.machine.chip_mut().flash.cut = Some(Cut::Erasure(share));
        let _ = session.write_object(1, LOAD.0, 1, LOAD.1, LONGEST_S);
        if !session.machine.chip().flash.is_cut {
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
