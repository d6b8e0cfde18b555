//! Legs on the bus at the pace of a clock, until the process is told to end.

use std::io::Write;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::board::{Board, TICK_NS};
use super::memory::{BYTES, Memory};
use super::network::Network;
use super::server::Server;
use crate::tool::error::ToolError;
use crate::tool::files;
use crate::tool::leg_file::LegFile;
use crate::tool::pair::Context;
use crate::tool::simulate::{DriveModel, SimulationOptions};

/// A simulation that is so far behind the clock lets the rest go.
const MOST_LATE: Duration = Duration::from_millis(100);
/// Ticks between two looks at the port: 1 ms.
const TICKS_PER_LOOK: u32 = 4;
/// Ticks of the longest change of the flash: 5 s.
const MOST_STORING: u32 = 20_000;
/// Nothing is due before.
const NAP: Duration = Duration::from_micros(200);

/// What is to be served.
#[derive(Clone, Debug)]
pub struct ServeOptions {
    /// Where a client connects.
    pub address: SocketAddr,
    /// Boards on the bus, each with a leg.
    pub legs: usize,
    /// Simulated seconds per second.
    pub speed: f64,
    /// Outlives the process.
    pub flash: Option<PathBuf>,
    /// Of noise.
    pub seed: u64,
    /// Of the bus.
    pub bits_per_s: u64,
}

/// Legs on a bus, their boards started.
pub fn network<const N: usize, const B: usize>(
    leg: &LegFile,
    options: &ServeOptions,
    flash: Option<&[u8]>,
) -> Result<Network<N, B>, ToolError> {
    let simulation =
        SimulationOptions { drive: DriveModel::Full, ..SimulationOptions::of_seed(options.seed) };
    let context = Context::<N, B>::new(leg, &simulation)?;
    let mut boards = Vec::new();
    for place in 0..options.legs {
        let memory = Memory::new(flash.and_then(|bytes| bytes.get(place * BYTES..(place + 1) * BYTES)));
        let (seed, first) = (options.seed + place as u64, (1 + place * N) as u8);
        boards.push(Board::new(leg, context.clone(), seed, first, memory)?);
    }
    Ok(Network::new(boards, options.bits_per_s))
}

/// Serves until the process is asked to end.
pub fn serve<const N: usize, const B: usize>(leg: &LegFile, options: &ServeOptions) -> Result<(), ToolError> {
    let flash = options.flash.as_deref().map(|path| read(path, options.legs)).transpose()?.flatten();
    let mut network = network::<N, B>(leg, options, flash.as_deref())?;
    let refused = |error: std::io::Error| ToolError::input(format!("{}: {error}", options.address));
    let mut server = Server::new(options.address).map_err(refused)?;
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGTERM, signal_hook::consts::SIGINT] {
        signal_hook::flag::register(signal, Arc::clone(&stop)).map_err(refused)?;
    }
    println!("listening {}", server.address().map_err(refused)?);
    std::io::stdout().flush().map_err(refused)?;
    let mut start = Instant::now();
    let mut before_ns = 0;
    let mut alarms = vec![None; options.legs];
    while !stop.load(Ordering::Relaxed) {
        server.poll(|frame| network.send(frame));
        let late = start
            .elapsed()
            .mul_f64(options.speed)
            .saturating_sub(Duration::from_nanos(network.now_ns() - before_ns));
        if late > MOST_LATE.mul_f64(options.speed) {
            (start, before_ns) = (Instant::now(), network.now_ns());
        }
        let due = (late.as_nanos() / u128::from(TICK_NS)).min(TICKS_PER_LOOK.into()) as u32;
        for _ in 0..due {
            network.tick(|sent| {
                if sent.sender > 0 {
                    server.tell(&sent.frame);
                }
            });
        }
        server.flush();
        for (place, (board, told)) in network.boards().iter().zip(&mut alarms).enumerate() {
            let alarm = board.rig.alarm();
            if let Some(code) = alarm.filter(|_| alarm != *told) {
                eprintln!("leg {}: {} ({:#06x}): {}", place + 1, code.name(), code.number(), code.words());
            }
            *told = alarm;
        }
        if network.boards().iter_mut().fold(false, |kept, board| board.flashing().take_kept() | kept) {
            write(options.flash.as_deref(), &mut network)?;
        }
        if due == 0 {
            std::thread::sleep(NAP);
        }
    }
    // What a host asked for before is kept, as fast as it goes.
    for tick in 0..MOST_STORING {
        if tick > TICKS_PER_LOOK && !network.boards().iter_mut().any(|board| board.flashing().is_under_way())
        {
            break;
        }
        network.tick(|_| {});
    }
    write(options.flash.as_deref(), &mut network)
}

/// The flash of all boards; none where the file is not there yet.
fn read(path: &Path, legs: usize) -> Result<Option<Vec<u8>>, ToolError> {
    match std::fs::read(path) {
        Ok(bytes) if bytes.len() == legs * BYTES => Ok(Some(bytes)),
        Ok(bytes) => Err(ToolError::input(format!(
            "{}: {} bytes, the flash of {legs} boards has {}",
            path.display(),
            bytes.len(),
            legs * BYTES
        ))),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(ToolError::input(format!("{}: {error}", path.display()))),
    }
}

fn write<const N: usize, const B: usize>(
    path: Option<&Path>,
    network: &mut Network<N, B>,
) -> Result<(), ToolError> {
    let Some(path) = path else { return Ok(()) };
    let bytes: Vec<u8> =
        network.boards().iter_mut().flat_map(|board| board.memory().bytes().to_vec()).collect();
    files::write(path, &bytes)
}
