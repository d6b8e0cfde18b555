//! The image on the simulated bus, for existing host software: an slcan adapter on a TCP port.
//!
//! The operator has calibrated the motors, taken the reference and holds the enabling switch. Simulated time
//! follows the clock where the processor is fast enough, and is slower elsewhere.

use std::io::Write;
use std::net::SocketAddr;
use std::time::{Duration, Instant};

use scarab_host::base::error::ToolError;
use scarab_host::rig::bus::server::{Server, What};

use crate::session::Session;
use crate::time::seconds;

/// Simulated time between two polls of the port, s.
const SLICE_S: f64 = 1e-3;
/// Largest number of frames that wait for the wire.
const QUEUE: usize = 64;
/// Lag beyond which lost time is skipped.
const MOST_LAG: Duration = Duration::from_millis(50);

/// Serves for a time, s, or until the process ends.
///
/// # Errors
/// The port cannot be opened, or the model does not support an action of the processor.
pub fn serve(session: &mut Session, address: SocketAddr, duration: Option<f64>) -> Result<(), ToolError> {
    let refused = |error: std::io::Error| ToolError::input(format!("{address}: {error}"));
    let mut server = Server::new(address).map_err(refused)?;
    println!("listening {}", server.address().map_err(refused)?);
    std::io::stdout().flush().map_err(refused)?;
    let begun = session.now();
    let mut due = Instant::now();
    while duration.is_none_or(|duration| seconds(session.now() - begun) < duration) {
        let mut queue = session.machine.chip().can.partner.len();
        let mut frames = Vec::new();
        let events = server.poll(Instant::now(), |frame, _| {
            let taken = queue < QUEUE;
            if taken {
                queue += 1;
                frames.push(frame);
            }
            taken
        });
        for event in events {
            eprintln!("{event}");
            match event.what {
                What::Opened => session.machine.chip_mut().can.connected = true,
                _ if event.ends() => session.machine.chip_mut().can.connected = false,
                _ => {}
            }
        }
        for frame in frames {
            server.show(&frame);
            session.machine.chip_mut().send_frame(frame);
        }
        session.run(SLICE_S)?;
        // The hand releases the leg once the drive holds it.
        let plant = &mut session.machine.chip_mut().plant;
        if plant.is_held() && plant.axes.iter().all(|axis| axis.is_armed()) {
            plant.let_go();
        }
        for (_, frame) in session.machine.chip_mut().can.sent.drain(..) {
            server.show(&frame);
            server.send(&frame);
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
