//! Hangs of each level: the watchdog must reset the board in time, with bridges off at the latest then.
//!
//! The thread identifies and sends records. No safety function runs there, so its hang does not require a
//! reset.

use serde::Serialize;

use scarab::bus::Frame;
use scarab_base::error::ToolError;

use crate::load::{CURRENT_INTERRUPT, SERVO};
use crate::machine::{End, Snapshot};
use crate::peripherals::rcc::ResetReason;
use crate::plant::Reaction;
use crate::session::Session;
use crate::time::{seconds, ticks};

/// Levels that may hang, with their exceptions; 0 is the thread.
const LEVELS: [(&str, u8); 7] = [
    ("current interrupt", CURRENT_INTERRUPT),
    ("servo", SERVO),
    ("clock", 16 + 50),
    ("bus receive", 16 + 20),
    ("bus", 16 + 19),
    ("housekeeping", 16 + 72),
    ("thread", 0),
];
/// Longest observed time, s.
const LONGEST_S: f64 = 0.2;
/// Clocks of the oscillator from a feed to the reset, and longest time between two feeds, ms.
const WATCHDOG_CLOCKS: f64 = 512.0;
const FEEDING_MS: f64 = 4.0;

/// Hang of one level.
#[derive(Clone, Debug, Serialize)]
pub struct HangReport {
    pub level: &'static str,
    /// Time until both bridges were off, ms; `None` if they stayed on.
    pub released_ms: Option<f64>,
    /// Time until the watchdog's reset, ms; `None` if none came.
    pub reset_ms: Option<f64>,
    /// Longest time until the reset with this oscillator, ms.
    pub longest_ms: f64,
    /// Whether a bridge was on again after the first turn-off and before the reset.
    pub on_again: bool,
}

impl HangReport {
    /// Whether the board was reset in time with its bridges off, or continued if only the thread hung.
    pub fn is_sound(&self) -> bool {
        if self.level == "thread" {
            return self.reset_ms.is_none() && self.released_ms.is_none() && !self.on_again;
        }
        let in_time = |time: Option<f64>| time.is_some_and(|ms| ms <= self.longest_ms);
        in_time(self.reset_ms) && in_time(self.released_ms) && !self.on_again
    }
}

/// Lets each level hang, from a session that is enabled.
pub fn run(session: &mut Session, oscillator_hz: u64) -> Result<Vec<HangReport>, ToolError> {
    let enabled = session.machine.save()?;
    let hang = |(level, exception)| hang(session, &enabled, level, exception, oscillator_hz);
    LEVELS.into_iter().map(hang).collect()
}

fn hang(
    session: &mut Session,
    enabled: &Snapshot,
    level: &'static str,
    exception: u8,
    oscillator_hz: u64,
) -> Result<HangReport, ToolError> {
    session.machine.restore(enabled)?;
    let begun = session.now();
    let chip = session.chip_mut();
    let mut reaction = Reaction::new(&chip.plant);
    chip.iwdg.oscillator_hz = oscillator_hz;
    chip.reschedule();
    chip.plant.switchings.clear();
    session.machine.hang(Some(exception));
    // The receiving level runs only when a frame arrives.
    session.chip_mut().send_frame(Frame::new(0x80, &[]));
    let end = session.machine.run(begun + ticks(LONGEST_S))?;
    let reset = session.now();
    reaction.follow(session.chip().plant.switchings.iter().filter(|switching| switching.at <= reset));
    let since = |at| 1e3 * seconds(at - begun);
    Ok(HangReport {
        level,
        released_ms: reaction.released.map(since),
        reset_ms: (end == End::Reset(ResetReason::Watchdog)).then(|| since(reset)),
        longest_ms: FEEDING_MS + 1e3 * WATCHDOG_CLOCKS / oscillator_hz as f64 + 0.1,
        on_again: reaction.on_again,
    })
}
