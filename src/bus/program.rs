//! Objects 1F50 to 1F57: a new image over the bus (CiA 302-3), without I/O.
//!
//! ```text
//! 1F51:1 <- 0   stop the program: the drive stays off      1F51:1 -> 0 stopped, 1 running
//!               refused while the running image is on trial
//! 1F51:1 <- 3   clear the space of the new image
//! 1F50:1 <- ... the new image, a DOMAIN
//! 1F51:1 <- 1   start: check the new image, swap it in, restart; or resume, if none was written
//!               of a running image on trial: confirm it
//! 1F51:1 <- 2   restart; an image on trial is swapped back
//! 1F56:1        check sum of the running image
//! 1F57:1        status: bit 0 under way, bits 1 to 7 error, bits 8 to 10 below
//! ```
//!
//! Nothing is decided here: commands and bytes are passed on ([`crate::operation::Update`]), its status is
//! read. The image is never held as a whole. An answer to a host waits while no space for the next bytes is
//! free, so none are lost however slow the flash is.

use heapless::Deque;

use super::abort::Abort;
use crate::listed::listed;

/// Bytes that wait for the level below: one block of [`BLOCK`] segments of seven bytes and the one that is
/// held back.
const WAITING: usize = 240;
/// Segments of a block, as announced to the host.
pub(super) const BLOCK: u8 = 32;

listed! {
    /// Command of a host (1F51:1), with CiA 302-3's numbers.
    #[repr(u8)]
    pub enum ProgramCommand {
        /// All commands, in the order of their numbers.
        ALL;
        /// Stop the program, so that a new one can be written.
        Stop = 0;
        /// Start the new program, resume the present one, or confirm one on trial.
        Start = 1;
        /// Restart the board.
        Reset = 2;
        /// Clear the space of the new program.
        Clear = 3;
    }
}

impl ProgramCommand {
    /// Command with this number.
    pub(crate) fn from_number(number: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|command| *command as u32 == number)
    }
}

listed! {
    /// Error in 1F57, with CiA 302-3's numbers.
    #[derive(Default)]
    #[repr(u8)]
    pub enum ProgramError {
        /// All errors.
        ALL,
        /// Words for a host's display.
        words;
        /// No error.
        #[default]
        None = 0, "no error";
        /// What was written has no header of an image.
        NoProgram = 1, "no image was written";
        /// The image is for another board, or states an impossible length.
        Format = 2, "the image is for another board, or its length is impossible";
        /// The check sum differs.
        Checksum = 3, "the image is damaged: its check sum differs";
        /// Bytes came before the space was cleared, or more than fit.
        NotCleared = 4, "bytes came before the space was cleared, or more than fit";
        /// The flash did not take a change.
        Write = 5, "the flash did not take a change";
        /// The drive is on, motors brake, or the watchdog does not take its longer time.
        Forbidden = 7, "not now: the drive is on, motors brake, the watchdog does not take its longer time, or a simulated board";
    }
}

/// Status of an update (1F57:1).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ProgramStatus(pub u32);

impl ProgramStatus {
    /// A command or bytes are not finished yet.
    pub const UNDER_WAY: u32 = 1;
    /// The program is stopped.
    pub const STOPPED: u32 = 1 << 8;
    /// The space of the new program is cleared, and nothing was written since.
    pub const CLEARED: u32 = 1 << 9;
    /// The running program is on trial: without confirmation the next restart swaps it back.
    pub const ON_TRIAL: u32 = 1 << 10;

    /// Whether all of these bits are set.
    pub const fn has(self, bits: u32) -> bool {
        self.0 & bits == bits
    }

    /// Sets bits if `is_set`.
    pub(crate) const fn with(self, bits: u32, is_set: bool) -> Self {
        Self(self.0 | if is_set { bits } else { 0 })
    }

    /// Number of the error.
    pub const fn error(self) -> u8 {
        (self.0 >> 1 & 0x7F) as u8
    }
}

/// Objects 1F50 to 1F57 of a board.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ProgramObjects {
    status: ProgramStatus,
    /// Check sum of the running image.
    checksum: u32,
    asked: Option<ProgramCommand>,
    bytes: Deque<u8, WAITING>,
}

impl ProgramObjects {
    /// Objects of an image with this check sum.
    pub const fn new(checksum: u32) -> Self {
        Self { status: ProgramStatus(0), checksum, asked: None, bytes: Deque::new() }
    }

    /// Takes over the status; returns whether it has changed.
    pub(crate) fn update(&mut self, status: ProgramStatus) -> bool {
        let changed = self.status != status;
        self.status = status;
        if !status.has(ProgramStatus::STOPPED) {
            // The level below takes them only while the program is stopped.
            self.bytes.clear();
        }
        changed
    }

    /// Takes the command that a host wrote.
    pub(crate) fn take_command(&mut self) -> Option<ProgramCommand> {
        self.asked.take()
    }

    /// Takes the next byte of the image.
    pub(crate) fn take_byte(&mut self) -> Option<u8> {
        self.bytes.pop_front()
    }

    fn status(&self) -> ProgramStatus {
        let is_under_way = self.asked.is_some() || !self.bytes.is_empty();
        self.status.with(ProgramStatus::UNDER_WAY, is_under_way)
    }

    /// Reads a number.
    pub(super) fn read(&self, index: u16) -> Result<u32, Abort> {
        match index {
            0x1F51 => Ok(u32::from(!self.status.has(ProgramStatus::STOPPED))),
            0x1F56 => Ok(self.checksum),
            0x1F57 => Ok(self.status().0),
            _ => Err(Abort::WriteOnly),
        }
    }

    /// Writes 1F51:1. `is_off`: the drive is off.
    pub(super) fn command(&mut self, value: u32, is_off: bool) -> Result<(), Abort> {
        let command = ProgramCommand::from_number(value).ok_or(Abort::Range)?;
        let is_stopped = self.status.has(ProgramStatus::STOPPED);
        // While an image is on trial, the space of the new one holds the one that comes back.
        let is_on_trial = self.status.has(ProgramStatus::ON_TRIAL);
        let is_permitted = match command {
            ProgramCommand::Stop => is_off && !is_on_trial,
            ProgramCommand::Reset | ProgramCommand::Start => is_off,
            ProgramCommand::Clear => is_stopped,
        };
        if self.status().has(ProgramStatus::UNDER_WAY) || !is_permitted {
            return Err(Abort::State);
        }
        self.asked = Some(command);
        Ok(())
    }

    /// Begins to receive an image.
    pub(super) fn begin(&self) -> Result<(), Abort> {
        let ready = ProgramStatus::STOPPED | ProgramStatus::CLEARED;
        let status = self.status();
        if status.has(ready) && !status.has(ProgramStatus::UNDER_WAY) { Ok(()) } else { Err(Abort::State) }
    }

    /// Bytes that can be taken now.
    pub(super) fn room(&self) -> usize {
        WAITING - self.bytes.len()
    }

    /// Takes a byte of the image.
    pub(super) fn push(&mut self, byte: u8) -> Result<(), Abort> {
        if !self.status.has(ProgramStatus::STOPPED) {
            return Err(Abort::State);
        }
        self.bytes.push_back(byte).map_err(|_| Abort::Sequence)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stopped() -> ProgramObjects {
        let mut objects = ProgramObjects::new(7);
        objects.update(ProgramStatus(ProgramStatus::STOPPED | ProgramStatus::CLEARED));
        objects
    }

    #[test]
    fn numbers_are_those_of_cia_302() {
        for number in 0..4 {
            assert_eq!(ProgramCommand::from_number(number).map(|command| command as u32), Some(number));
        }
        assert_eq!(ProgramCommand::from_number(4), None);
        assert_eq!(ProgramStatus((ProgramError::Checksum as u32) << 1 | 1).error(), 3);
    }

    #[test]
    fn a_program_stops_only_with_the_drive_off_and_is_cleared_only_when_stopped() {
        let mut objects = ProgramObjects::new(7);
        assert_eq!(objects.command(0, false), Err(Abort::State));
        assert_eq!(objects.command(3, true), Err(Abort::State));
        assert_eq!(objects.command(4, true), Err(Abort::Range));
        assert_eq!(objects.begin(), Err(Abort::State));
        assert_eq!((objects.read(0x1F51), objects.read(0x1F56)), (Ok(1), Ok(7)));
        assert_eq!(objects.command(0, true), Ok(()));
        assert_eq!(objects.read(0x1F57), Ok(ProgramStatus::UNDER_WAY));
        assert_eq!(objects.command(0, true), Err(Abort::State), "the one before is under way");
        assert_eq!(objects.take_command(), Some(ProgramCommand::Stop));
        let mut objects = ProgramObjects::new(7);
        objects.update(ProgramStatus(ProgramStatus::ON_TRIAL));
        assert_eq!((objects.command(0, true), objects.command(1, true)), (Err(Abort::State), Ok(())));
        let mut objects = stopped();
        assert_eq!((objects.begin(), objects.read(0x1F51)), (Ok(()), Ok(0)));
        assert_eq!(objects.command(3, true), Ok(()));
    }

    #[test]
    fn bytes_wait_in_their_order_and_none_is_lost_unnoticed() {
        let mut objects = stopped();
        for number in 0..WAITING {
            assert_eq!(objects.room(), WAITING - number);
            assert_eq!(objects.push(number as u8), Ok(()));
        }
        assert_eq!(objects.push(0), Err(Abort::Sequence));
        assert!(objects.status().has(ProgramStatus::UNDER_WAY));
        for number in 0..WAITING {
            assert_eq!(objects.take_byte(), Some(number as u8));
        }
        assert_eq!(objects.take_byte(), None);
        assert!(WAITING > 7 * (usize::from(BLOCK) + 1));
    }
}
