//! The image on the simulated bus, for existing host software: an slcan adapter on a TCP port.
//!
//! The operator has calibrated the motors, taken the reference and holds the enabling switch; or the board is
//! as delivered, and the operator does what a commissioning host asks ([`Operator`]). Simulated time follows
//! the clock where the processor is fast enough, and is slower elsewhere.

use std::io::Write;
use std::net::SocketAddr;
use std::time::{Duration, Instant};

use scarab::bus::Frame;
use scarab::bus::commissioning::{BoardState, StepResult};
use scarab_base::error::ToolError;
use scarab_rig::bus::server::{Server, What};
use scarab_rig::pair::start_position;

use crate::plant::JOINTS;
use crate::session::Session;
use crate::time::{Ticks, seconds, ticks};

/// Simulated time between two polls of the port, s.
const SLICE_S: f64 = 1e-3;
/// Largest number of frames that wait for the wire.
const QUEUE: usize = 64;
/// Lag beyond which lost time is skipped.
const MOST_LAG: Duration = Duration::from_millis(50);

/// Time to read what the host asks for, s.
const READS_S: f64 = 2.0;
/// Time of a motion by hand, and until the switch is closed after it, s.
const BY_HAND_S: f64 = 1.0;
const STANDS_S: f64 = 1.5;

/// Operator who reads what the board answers to a commissioning host, as its screen would say it: holds or
/// opens the enabling switch where the board refuses a step because of it, holds it while the joints are
/// brought to their zero and lets it go there, and brings the leg into its range after the reference.
#[derive(Clone, Copy, Debug, Default)]
pub struct Operator {
    /// When the board was first seen to have no zeros, while a host looks at it.
    asked: Option<Ticks>,
    /// The joints were brought to their zero, and into their range.
    is_at_zero: bool,
    is_in_range: bool,
    /// When the enabling switch is to be opened, and closed.
    opens: Option<Ticks>,
    closes: Option<Ticks>,
}

impl Operator {
    /// Reacts to a frame of the board.
    fn on_frame(&mut self, frame: &Frame, session: &mut Session) {
        // Answers to reads of 2160:2 and 3.
        let &[0x4F, 0x60, 0x21, sub, value, ..] = frame.data() else { return };
        let now = session.now();
        if sub == 3 {
            if value == StepResult::SwitchOpen as u8 {
                session.hold_switch(true);
            } else if value == StepResult::SwitchClosed as u8 || value == StepResult::ContactsNotOpened as u8
            {
                session.hold_switch(false);
            }
        }
        let has = |bit: u8| sub == 2 && value & bit != 0;
        let lacks_zeros = has(BoardState::CALIBRATED) && !has(BoardState::REFERENCED);
        let asked = if lacks_zeros { *self.asked.get_or_insert(now) } else { now };
        if now - asked > ticks(READS_S) && !self.is_at_zero {
            self.is_at_zero = true;
            session.chip_mut().plant.couple(now);
            session.chip_mut().plant.move_by_hand([0.0; JOINTS], now, BY_HAND_S);
            session.hold_switch(true);
            self.opens = Some(now + ticks(STANDS_S));
        }
        // The host shows that the reference, which the opened switch began, has ended.
        let is_taken = sub == 3 && value == StepResult::Done as u8 && self.is_at_zero && self.opens.is_none();
        if (has(BoardState::REFERENCED) || is_taken) && !self.is_in_range {
            self.is_in_range = true;
            let to = start_position(&session.leg);
            session.chip_mut().plant.move_by_hand(to, now, BY_HAND_S);
            session.hold_switch(false);
            self.closes = Some(now + ticks(STANDS_S));
        }
    }

    /// Opens and closes the switch when it is due.
    fn act(&mut self, session: &mut Session) {
        if self.opens.take_if(|opens| *opens <= session.now()).is_some() {
            session.hold_switch(false);
        }
        if self.closes.take_if(|closes| *closes <= session.now()).is_some() {
            session.hold_switch(true);
        }
    }
}

/// Serves for a time, s, or until the process ends.
///
/// # Errors
/// The port cannot be opened, or the model does not support an action of the processor.
pub fn serve(
    session: &mut Session,
    address: SocketAddr,
    duration: Option<f64>,
    mut operator: Option<Operator>,
) -> Result<(), ToolError> {
    let refused = |error: std::io::Error| ToolError::input(format!("{address}: {error}"));
    let mut server = Server::new(address).map_err(refused)?;
    println!("listening {}", server.address().map_err(refused)?);
    std::io::stdout().flush().map_err(refused)?;
    let begun = session.now();
    let mut due = Instant::now();
    while duration.is_none_or(|duration| seconds(session.now() - begun) < duration) {
        let queued = session.chip().can.partner.len();
        let mut frames: Vec<Frame> = Vec::new();
        let events = server.poll(Instant::now(), |frame, _| {
            let taken = queued + frames.len() < QUEUE;
            frames.extend(taken.then_some(frame));
            taken
        });
        for event in events {
            eprintln!("{event}");
            match event.what {
                What::Opened => session.chip_mut().can.connected = true,
                _ if event.ends() => session.chip_mut().can.connected = false,
                _ => {}
            }
        }
        for frame in frames {
            server.show(&frame);
            session.chip_mut().send_frame(frame);
        }
        session.run(SLICE_S)?;
        // The hand releases the leg once the drive holds it.
        let plant = &mut session.chip_mut().plant;
        if plant.is_held() && plant.axes.iter().all(|axis| axis.is_armed) {
            plant.let_go();
        }
        let sent: Vec<Frame> = session.chip_mut().can.sent.drain(..).map(|(_, frame)| frame).collect();
        for frame in &sent {
            server.show(frame);
            server.send(frame);
        }
        if let Some(operator) = &mut operator {
            sent.iter().for_each(|frame| operator.on_frame(frame, session));
            operator.act(session);
        }
        server.flush().iter().for_each(|event| eprintln!("{event}"));
        due += Duration::from_secs_f64(SLICE_S);
        let now = Instant::now();
        match due.checked_duration_since(now) {
            Some(ahead) => std::thread::sleep(ahead),
            None if now - due > MOST_LAG => due = now,
            None => {}
        }
    }
    Ok(())
}
