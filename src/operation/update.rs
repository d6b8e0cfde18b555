//! A new image over the bus, at thread level: clearing its space, writing, checking, requesting the swap.
//!
//! ```text
//! Stop     interlock and watchdog as for a save (`Storing`); both stay until the end
//! Clear    three sectors, one per step; each stalls the processor for 1 to 2 s
//! bytes    written word by word, 16 us each; between two words every level runs
//! Start    header, length and check sum from the flash; then the swap is requested and the board restarts
//! Start    with nothing written, or after an error: the present program resumes, and the error stays shown
//! Reset    the board restarts
//! ```
//!
//! After the restart the bootloader swaps the images. The new one runs on trial: until a host has reached it
//! and written Start again, every restart brings the image before back. So a new image whose bus does not
//! work cannot stay.
//!
//! Each step takes a few milliseconds at most, an erase aside.

use heapless::spsc::Consumer;
use scarab_boot::{Check, ImageError, Region};

use super::signals::Signals;
use crate::bus::program::{ProgramCommand, ProgramError, ProgramStatus};
use crate::hal::ProgramMemory;

/// Words that one step writes: 1 ms.
const WORDS: u32 = 64;
/// Chunks that one step checks.
const CHUNKS: u32 = 8;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// Waits for bytes or a command.
    Waits,
    /// Erases this sector next.
    Clears(u32),
    /// Checks the new image.
    Checks(Check),
}

/// What a command begins while the program runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Begun {
    /// The program is stopped for a new image.
    Stopped,
    /// The running image is confirmed.
    Confirmation,
    /// The board restarts.
    Restart,
}

/// State of an update.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Update {
    stage: Stage,
    is_cleared: bool,
    /// Bytes that were received; those of the last, incomplete word are in `word`.
    received: u32,
    word: [u8; 4],
    error: ProgramError,
    is_on_trial: bool,
}

impl Update {
    /// State after the start; `is_on_trial`: the running image is not confirmed.
    pub const fn new(is_on_trial: bool) -> Self {
        Self {
            stage: Stage::Waits,
            is_cleared: false,
            received: 0,
            word: [0; 4],
            error: ProgramError::None,
            is_on_trial,
        }
    }

    /// Begins what a command asks for while the program runs, if it needs the flash. `Reset` needs none but
    /// goes the same way, so that hosts hear of the pause.
    pub fn begin<const N: usize>(&mut self, command: ProgramCommand, signals: &Signals<N>) -> Option<Begun> {
        self.error = ProgramError::None;
        let begun = match command {
            // The space of the new image holds the one that comes back at the next restart.
            ProgramCommand::Stop if self.is_on_trial => None,
            ProgramCommand::Stop => {
                // What an update before has left must be cleared first.
                *self = Self::new(self.is_on_trial);
                Some(Begun::Stopped)
            }
            ProgramCommand::Start if self.is_on_trial => Some(Begun::Confirmation),
            ProgramCommand::Reset => Some(Begun::Restart),
            ProgramCommand::Start | ProgramCommand::Clear => None,
        };
        signals.set_program_status(self.status(0).with(ProgramStatus::UNDER_WAY, begun.is_some()));
        begun
    }

    /// Runs one step of what has begun, while `Storing` permits changes of the flash; returns whether it
    /// succeeded when it has ended.
    pub fn change<const N: usize>(
        &mut self,
        begun: Begun,
        signals: &Signals<N>,
        bytes: &mut Consumer<'_, u8>,
        memory: &mut impl ProgramMemory,
    ) -> Option<bool> {
        match begun {
            Begun::Stopped => self.step(signals, bytes, memory).then_some(self.error == ProgramError::None),
            Begun::Confirmation => {
                let confirmed = memory.confirm();
                self.is_on_trial &= !confirmed;
                self.error = if confirmed { ProgramError::None } else { ProgramError::Write };
                Some(confirmed)
            }
            Begun::Restart => {
                memory.restart();
                Some(true)
            }
        }
    }

    /// Shows the state after the program resumed; `done`: what a host asked for succeeded.
    pub fn end<const N: usize>(&mut self, done: bool, signals: &Signals<N>) {
        self.error = match self.error {
            _ if done => ProgramError::None,
            ProgramError::None => ProgramError::Forbidden,
            error => error,
        };
        signals.set_program_status(self.status(0));
    }

    fn status(&self, bits: u32) -> ProgramStatus {
        ProgramStatus(bits | (self.error as u32) << 1)
            .with(ProgramStatus::ON_TRIAL, self.is_on_trial)
            .with(ProgramStatus::CLEARED, self.is_cleared && self.received == 0)
    }

    /// Runs one step while the program is stopped; returns whether it resumes.
    fn step<const N: usize>(
        &mut self,
        signals: &Signals<N>,
        bytes: &mut Consumer<'_, u8>,
        memory: &mut impl ProgramMemory,
    ) -> bool {
        let resumes = match self.stage {
            // All bytes before the command that follows them.
            Stage::Waits if bytes.ready() => {
                self.write(bytes, memory);
                false
            }
            Stage::Waits => match signals.take_program_command() {
                Some(command) => self.apply_command(command, memory),
                None => false,
            },
            Stage::Clears(sector) => {
                self.clear(sector, memory);
                false
            }
            Stage::Checks(check) => {
                self.check(check, memory);
                false
            }
        };
        let under_way = self.stage != Stage::Waits || bytes.ready();
        let status = self.status(ProgramStatus::STOPPED).with(ProgramStatus::UNDER_WAY, under_way);
        signals.set_program_status(status);
        resumes
    }

    fn apply_command(&mut self, command: ProgramCommand, memory: &mut impl ProgramMemory) -> bool {
        match command {
            ProgramCommand::Stop => {}
            ProgramCommand::Clear => {
                (self.is_cleared, self.received, self.error) = (false, 0, ProgramError::None);
                self.stage = Stage::Clears(0);
            }
            ProgramCommand::Reset => memory.restart(),
            // Nothing was written, or not all of it is in the flash, or the check has refused it.
            ProgramCommand::Start if self.received == 0 || self.error != ProgramError::None => return true,
            ProgramCommand::Start => match Check::begin(|offset, into| memory.read(offset, into)) {
                Ok(check) => self.stage = Stage::Checks(check),
                Err(error) => self.refuse(error),
            },
        }
        false
    }

    fn clear(&mut self, sector: u32, memory: &mut impl ProgramMemory) {
        if !memory.erase(sector) {
            (self.stage, self.error) = (Stage::Waits, ProgramError::Write);
            return;
        }
        let next = sector + 1;
        self.is_cleared = next == Region::IMAGE.sectors;
        self.stage = if self.is_cleared { Stage::Waits } else { Stage::Clears(next) };
    }

    /// Writes the next words; after an error their bytes are discarded.
    fn write(&mut self, bytes: &mut Consumer<'_, u8>, memory: &mut impl ProgramMemory) {
        for _ in 0..4 * WORDS {
            let Some(byte) = bytes.dequeue() else { return };
            if self.error != ProgramError::None {
                continue;
            }
            if !self.is_cleared || self.received >= Region::IMAGE.bytes() {
                self.error = ProgramError::NotCleared;
                continue;
            }
            let [_, b, c, d] = self.word;
            self.word = [b, c, d, byte];
            self.received += 1;
            if self.received.is_multiple_of(4) && !memory.write(self.received - 4, self.word) {
                self.error = ProgramError::Write;
            }
        }
    }

    fn check(&mut self, mut check: Check, memory: &mut impl ProgramMemory) {
        let mut read = |offset: u32, into: &mut [u8]| memory.read(offset, into);
        for _ in 0..CHUNKS {
            match check.step(&mut read) {
                None => self.stage = Stage::Checks(check),
                Some(Err(error)) => return self.refuse(error),
                Some(Ok(_)) => {
                    self.stage = Stage::Waits;
                    if memory.request_swap() {
                        memory.restart();
                    } else {
                        self.error = ProgramError::Write;
                    }
                    return;
                }
            }
        }
    }

    fn refuse(&mut self, error: ImageError) {
        self.stage = Stage::Waits;
        self.error = match error {
            ImageError::NoHeader => ProgramError::NoProgram,
            ImageError::OtherBoard | ImageError::Length => ProgramError::Format,
            ImageError::Checksum | ImageError::Unreadable => ProgramError::Checksum,
        };
    }
}

#[cfg(test)]
mod tests;
