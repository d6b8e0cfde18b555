//! A new image for a board, over its bus (CiA 302-3): clear, write, start, confirm.
//!
//! Nothing is remembered: each run reads from the board which image runs, and begins where that leaves it. A
//! board that does not come to the confirmation goes back to the image before at its next restart.

use std::time::Duration;

use scarab::bus::Abort;
use scarab::bus::program::{ProgramCommand, ProgramError, ProgramStatus};
use scarab_base::error::ToolError;
use scarab_boot::{Check, Header, ImageError};

use crate::adapter::AdapterBus;
use crate::bus::{Bus, Object, RequestError};
use crate::master::Client;
use crate::other_hosts::{MayBeOn, OtherHosts};

/// Program data.
pub const DATA: Object = Object(0x1F50, 1);
const CONTROL: Object = Object(0x1F51, 1);
/// Check sum of the running image.
pub const SOFTWARE: Object = Object(0x1F56, 1);
/// State of an update ([`ProgramStatus`]).
pub const STATUS: Object = Object(0x1F57, 1);
/// Hardware version, and that of a simulated board, which has no program that could be replaced.
const HARDWARE: Object = Object(0x1009, 0);
const SIMULATED: &str = "simulated";
/// Longest clearing: three sectors of 2 s, and the announcement.
const CLEARING: Duration = Duration::from_secs(10);
/// Longest restart with both swaps.
const RESTART: Duration = Duration::from_secs(90);
/// Interval between two looks at the status.
const POLL: Duration = Duration::from_millis(100);

/// Checks a program before the board is touched.
///
/// # Errors
/// What is wrong with it.
pub fn check(program: &[u8]) -> Result<Header, &'static str> {
    if program.starts_with(b"\x7fELF") {
        return Err("an ELF file; send the file with the ending .bin that `cargo fw` writes beside it");
    }
    let header = Check::whole(|offset, into| {
        let from = program.get(offset as usize..offset as usize + into.len());
        from.is_some_and(|from| {
            into.copy_from_slice(from);
            true
        })
    });
    match header {
        Ok(header) if header.length as usize == program.len() => Ok(header),
        Ok(_) => Err("longer than its header states"),
        Err(ImageError::NoHeader) => Err("no image of a Scarab board"),
        Err(ImageError::OtherBoard) => Err("an image for another board"),
        Err(ImageError::Length) => Err("its length is impossible; it was not completed by `cargo fw`"),
        Err(ImageError::Checksum) => Err("damaged: its check sum differs"),
        Err(ImageError::Unreadable) => Err("its end is missing"),
    }
}

/// Update of one board.
pub struct Update<'a, B = AdapterBus> {
    /// Connection to the bus.
    pub client: Client<B>,
    /// Either node of the board.
    pub node: u8,
    /// Receives a line for each step.
    pub say: &'a mut dyn FnMut(&str),
}

impl<B: Bus> Update<'_, B> {
    /// Brings this program onto the board and confirms it.
    ///
    /// # Errors
    /// The board refuses, or the bus fails.
    pub fn run(&mut self, program: &[u8], header: &Header) -> Result<(), ToolError> {
        OtherHosts::listen(&mut self.client, &[self.node], MayBeOn::No)?;
        let running = self.client.try_read(self.node, SOFTWARE).map_err(|error| {
            if error.is(Abort::NoObject) {
                ToolError::Refused("this firmware takes no update over the bus; use a debug probe".into())
            } else {
                error.for_object(self.node, SOFTWARE)
            }
        })?;
        let serial = self.client.read(self.node, Object(0x1018, 4))?;
        (self.say)(&format!("find       serial number {serial:08X}, image {running:08X}"));
        if self.client.text(self.node, HARDWARE)? == SIMULATED {
            return Err(ToolError::Refused(
                "this is a simulated board (`serve`), which never takes an image; `cargo chip serve --next FILE` runs \
                 one that does"
                    .into(),
            ));
        }
        if running != header.checksum {
            if self.status()?.has(ProgramStatus::ON_TRIAL) {
                return Err(ToolError::Refused(
                    "the running image is another one, on trial: send its file to confirm it, or restart the board \
                     to get the image before back"
                        .into(),
                ));
            }
            self.write(program)?;
            self.restart(header)?;
        } else if self.status()?.has(ProgramStatus::STOPPED) {
            // An update that did not end: without a new image the present one resumes.
            self.command(ProgramCommand::Clear)?;
            self.settled()?;
            self.command(ProgramCommand::Start)?;
            let status = self.settled()?;
            if status.has(ProgramStatus::STOPPED) {
                return Err(refused("to resume", status));
            }
        }
        if self.status()?.has(ProgramStatus::ON_TRIAL) {
            self.command(ProgramCommand::Start)?;
            let status = self.settled()?;
            if status.has(ProgramStatus::ON_TRIAL) {
                return Err(refused("the confirmation", status));
            }
            (self.say)("confirm    the new image stays");
        } else {
            (self.say)("confirm    the image runs and is confirmed");
        }
        Ok(())
    }

    fn write(&mut self, program: &[u8]) -> Result<(), ToolError> {
        if !self.status()?.has(ProgramStatus::STOPPED) {
            self.command(ProgramCommand::Stop)?;
            let status = self.settled()?;
            if !status.has(ProgramStatus::STOPPED) {
                return Err(refused("the update", status));
            }
        }
        self.command(ProgramCommand::Clear)?;
        let status = self.settled()?;
        if !status.has(ProgramStatus::CLEARED) {
            return Err(refused("the space of the new image", status));
        }
        (self.say)("clear      done");
        let (say, length) = (&mut self.say, program.len());
        let mut next = 25;
        let progress = |_: &B, arrived: usize| {
            if 100 * arrived >= next * length {
                say(&format!("write      {next} % of {length} bytes"));
                next += 25;
            }
        };
        let written = self.client.download(self.node, DATA, program, progress);
        written.map_err(|error| error.for_object(self.node, DATA))?;
        let status = self.settled()?;
        if status.error() == 0 { Ok(()) } else { Err(refused("the new image", status)) }
    }

    /// Starts the new image and waits until it answers.
    fn restart(&mut self, header: &Header) -> Result<(), ToolError> {
        self.command(ProgramCommand::Start)?;
        let end = self.client.now() + RESTART;
        while self.client.now() < end {
            match self.client.try_read(self.node, STATUS) {
                Ok(status) => {
                    let status = ProgramStatus(status);
                    let waits = status.has(ProgramStatus::UNDER_WAY);
                    if status.has(ProgramStatus::STOPPED) && !waits {
                        return Err(refused("the new image", status));
                    }
                    if !status.has(ProgramStatus::STOPPED) {
                        break;
                    }
                }
                // The board swaps the images.
                Err(RequestError::Silent(_)) => {}
                Err(error) => return Err(error.for_object(self.node, STATUS)),
            }
            self.client.wait(POLL).map_err(|error| error.for_object(self.node, STATUS))?;
        }
        let running = self.client.read(self.node, SOFTWARE)?;
        if running == header.checksum {
            (self.say)("start      the new image runs, on trial");
            return Ok(());
        }
        Err(ToolError::Refused(format!("the board went back to the image {running:08X}")))
    }

    fn status(&mut self) -> Result<ProgramStatus, ToolError> {
        self.client.read(self.node, STATUS).map(ProgramStatus)
    }

    /// Gives a command.
    ///
    /// # Errors
    /// The board refuses, or the bus fails.
    pub fn command(&mut self, command: ProgramCommand) -> Result<(), ToolError> {
        self.client.try_write(self.node, CONTROL, command as u32, 1).map_err(|error| {
            if error.is(Abort::State) {
                let why = "the board refuses it now: turn the drive off, and wait for what is under way";
                ToolError::Refused(why.into())
            } else {
                error.for_object(self.node, CONTROL)
            }
        })
    }

    /// Waits until nothing is under way.
    ///
    /// # Errors
    /// Something stays under way, or the bus fails.
    pub fn settled(&mut self) -> Result<ProgramStatus, ToolError> {
        let end = self.client.now() + CLEARING;
        loop {
            let status = self.status()?;
            if !status.has(ProgramStatus::UNDER_WAY) {
                return Ok(status);
            }
            if self.client.now() > end {
                let seconds = CLEARING.as_secs();
                return Err(ToolError::input(format!("still under way after {seconds} s (1F57:1)")));
            }
            self.client.wait(POLL).map_err(|error| error.for_object(self.node, STATUS))?;
        }
    }
}

fn refused(what: &str, status: ProgramStatus) -> ToolError {
    let known = ProgramError::ALL.into_iter().find(|error| *error as u8 == status.error());
    let words = known.map_or("unknown error", ProgramError::words);
    ToolError::Refused(format!("the board refuses {what}: {words} (1F57:1 = {:#x})", status.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use scarab_boot::{HEADER_AT, seal};

    #[test]
    fn a_wrong_file_is_refused_before_the_board_is_touched() {
        let mut program = vec![7; 2000];
        for (index, word) in Header::UNSEALED.into_iter().enumerate() {
            program[HEADER_AT as usize + 4 * index..][..4].copy_from_slice(&word.to_le_bytes());
        }
        assert!(check(&program).is_err_and(|why| why.contains("not completed")));
        seal(&mut program).expect("an image");
        assert_eq!(check(&program).map(|header| header.length), Ok(2000));
        assert!(check(&program[..1000]).is_err_and(|why| why.contains("end")));
        assert!(check(&[&program[..], &[0; 4]].concat()).is_err_and(|why| why.contains("longer")));
        assert!(check(b"\x7fELF and more").is_err_and(|why| why.contains(".bin")));
        assert!(check(&[0; 1000]).is_err_and(|why| why.contains("no image")));
        program[900] ^= 1;
        assert!(check(&program).is_err_and(|why| why.contains("damaged")));
    }
}
