//! Serves legs on the bus in real time, until SIGTERM or SIGINT.

use scarab_base::error::{FileError, ToolError};
use scarab_base::files;
use scarab_client::alarms::Alarms;
use scarab_client::wire::Sent;
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::leg::exercise::Exercise;
use scarab_identify::with_leg_size;
use std::fs::File;
use std::io::{Read, Write};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::bus::adapter::{Adapter, Dropped, MOST_AGE};
use crate::bus::board::{Board, Label};
use crate::bus::network::Network;
use crate::bus::pace::{BOOT_TICKS, Pace, judge, reachable};
use crate::bus::server::{Event, Server, What};
use crate::pair::Context;
use crate::parameter_file::memory::{BYTES, Memory};
use crate::worn::Worn;

/// Ticks between two polls of the port: 1 ms.
const TICKS_PER_LOOK: u64 = 4;
/// Longest store operation in ticks: 5 s.
const MOST_STORING: u64 = 20_000;
/// Sleep if no tick is due.
const NAP: Duration = Duration::from_micros(200);

/// State of the boards before a host comes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Beginning {
    /// Calibrated, with zeros; the drive is off, and the operator holds the enabling switch.
    #[default]
    Ready,
    /// Neither calibrated nor with zeros; the contacts are open.
    Uncalibrated,
    /// Ready, and enabled by the operator's contacts.
    EnabledByContacts,
}

/// Options of the command.
#[derive(Clone, Debug)]
pub struct ServeOptions {
    /// Address of the port.
    pub address: SocketAddr,
    /// Number of boards on the bus, each with a leg.
    pub legs: usize,
    /// All boards have the node-IDs of a new one.
    pub are_new: bool,
    /// Simulated seconds per second.
    pub speed: f64,
    /// File of the boards' flash, which persists after the process.
    pub flash: Option<PathBuf>,
    /// Seed of the noise.
    pub seed: u64,
    /// Bit rate of the bus.
    pub bits_per_s: u64,
    /// State of the boards before a host comes.
    pub beginning: Beginning,
    /// Motion of each leg's wearer during assistance; `None` for legs without a wearer of their own.
    pub wearer: Option<Exercise>,
}

impl ServeOptions {
    /// Legs in real time at a free port of this machine.
    pub fn local(legs: usize) -> Self {
        Self {
            address: ([127, 0, 0, 1], 0).into(),
            legs,
            are_new: false,
            speed: 1.0,
            flash: None,
            seed: 1,
            bits_per_s: 1_000_000,
            beginning: Beginning::Ready,
            wearer: None,
        }
    }
}

/// Creates the wearer of each leg, if any.
pub(crate) fn wearers<const N: usize, const B: usize>(
    leg: &LegFile,
    options: &ServeOptions,
) -> Result<Vec<Worn<N>>, ToolError> {
    let worn = |index| Some(Worn::new::<B>(leg, options.wearer?, options.seed + index as u64));
    (0..options.legs).filter_map(worn).collect()
}

/// Creates the bus with the legs, boards started. Each leg is on its wearer, if there are any.
pub fn network<const N: usize, const B: usize>(
    leg: &LegFile,
    options: &ServeOptions,
    flash: Option<&[u8]>,
    wearers: &[Worn<N>],
) -> Result<Network<N, B>, ToolError> {
    let leg = wearers.first().map_or(leg, |worn| &worn.exoskeleton);
    let context = Context::<N, B>::with_complete_drives(leg, options.seed)?;
    let mut boards = Vec::new();
    for index in 0..options.legs {
        let memory = Memory::new(flash.and_then(|bytes| bytes.get(index * BYTES..(index + 1) * BYTES)));
        let first = if options.are_new { 1 } else { 1 + index * N };
        let label = Label { first: first as u8, serial: 1 + index as u32 };
        let mut board = Board::new(leg, context.clone(), options.seed + index as u64, label, memory)?;
        if options.beginning == Beginning::Uncalibrated {
            board.forget();
        }
        if let Some(worn) = wearers.get(index) {
            worn.dress(&mut board.rig)?;
        }
        if options.beginning == Beginning::EnabledByContacts && !board.enable_by_contacts() {
            return Err(leg.error("the operator's contacts do not enable it").into());
        }
        boards.push(board);
    }
    Ok(Network::new(boards, options.bits_per_s))
}

/// Serves until a termination signal.
///
/// # Errors
/// The leg file, the flash file or the port cannot be used.
pub fn serve(leg: &LegFile, options: &ServeOptions) -> Result<(), ToolError> {
    with_leg_size!(leg, serve_sized(leg, options))
}

fn serve_sized<const N: usize, const B: usize>(
    leg: &LegFile,
    options: &ServeOptions,
) -> Result<(), ToolError> {
    let flash = options.flash.as_deref().map(|path| read(path, options.legs)).transpose()?.flatten();
    let mut wearers = wearers::<N, B>(leg, options)?;
    let mut network = network::<N, B>(leg, options, flash.as_deref(), &wearers)?;
    // A node ignores every frame until it has sent its boot-up message.
    (0..BOOT_TICKS).for_each(|_| network.tick(|_| {}));
    // Written before any client connects, so that a file error appears before a host stores anything.
    write(options.flash.as_deref(), &mut network)?;
    warn(options, &network)?;
    let refused = |error: std::io::Error| ToolError::input(format!("{}: {error}", options.address));
    let mut server = Server::new(options.address).map_err(refused)?;
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGTERM, signal_hook::consts::SIGINT] {
        signal_hook::flag::register(signal, Arc::clone(&stop)).map_err(refused)?;
    }
    println!("listening {}", server.address().map_err(refused)?);
    std::io::stdout().flush().map_err(refused)?;
    let mut adapter = Adapter::new(options.bits_per_s, options.speed);
    let mut pace = Pace::new(options.speed, Instant::now(), network.now_ns());
    let mut alarms = vec![Alarms::default(); options.legs];
    while !stop.load(Ordering::Relaxed) {
        let now = Instant::now();
        let take = |frame, since| adapter.push(frame, since, network.effect(&frame));
        let events = server.poll(now, take);
        report(&events, &mut adapter, network.now_ns());
        let due = pace.due(now, network.now_ns()).min(TICKS_PER_LOOK);
        let mut sent_by_boards = Vec::new();
        for (board, worn) in network.boards().iter_mut().zip(&mut wearers) {
            worn.accompany(&mut board.rig)?;
        }
        for _ in 0..due {
            adapter.tick(&mut network, Instant::now(), |sent| {
                server.show(&sent.frame);
                if sent.sender > 0 {
                    server.send(&sent.frame);
                    sent_by_boards.push(*sent);
                }
            });
        }
        report(&server.flush(), &mut adapter, network.now_ns());
        if let Some(second) = pace.second(now, network.now_ns()) {
            let reports = [second.report(options.speed), not_carried_out(adapter.take_dropped())];
            reports.iter().flatten().for_each(|report| eprintln!("last second: {report}"));
        }
        print_alarms(network.boards(), &mut alarms, &sent_by_boards);
        if network.boards().iter_mut().fold(false, |kept, board| board.flashing().take_kept() | kept) {
            write(options.flash.as_deref(), &mut network)?;
        }
        if due == 0 {
            std::thread::sleep(NAP);
        }
    }
    finish_storing(&mut network);
    write(options.flash.as_deref(), &mut network)
}

/// Warns of a speed that this machine hardly holds, and of a port that other machines reach.
fn warn<const N: usize, const B: usize>(
    options: &ServeOptions,
    network: &Network<N, B>,
) -> Result<(), ToolError> {
    if let Some(warning) =
        judge(options.speed, &reachable(network), options.legs).map_err(ToolError::input)?
    {
        eprintln!("warning: {warning}");
    }
    if !options.address.ip().is_loopback() {
        eprintln!(
            "warning: {} can be reached from other machines, and slcan has no password: every client that connects commands the legs",
            options.address
        );
    }
    Ok(())
}

/// Prints each board's new fault, and its emergency messages among the frames just sent.
fn print_alarms<const N: usize, const B: usize>(
    boards: &[Board<N, B>],
    alarms: &mut [Alarms],
    sent: &[Sent],
) {
    for (leg, (board, alarms)) in (1..).zip(boards.iter().zip(alarms)) {
        let fault = alarms.fault(board.rig.alarm());
        let own = sent.iter().filter(|sent| sent.sender == leg && board.is_emergency(&sent.frame));
        let messages = own.filter_map(|sent| alarms.emergency(&sent.frame));
        fault.into_iter().chain(messages).for_each(|line| eprintln!("leg {leg}: {line}"));
    }
}

/// Completes a store operation in progress, as fast as possible.
fn finish_storing<const N: usize, const B: usize>(network: &mut Network<N, B>) {
    for tick in 0..MOST_STORING {
        if tick > TICKS_PER_LOOK && !network.boards().iter_mut().any(|board| board.flashing().is_under_way())
        {
            break;
        }
        network.tick(|_| {});
    }
}

/// Prints events of connections; the plug follows the client.
fn report(events: &[Event], adapter: &mut Adapter, now_ns: u64) {
    for event in events {
        eprintln!("{event}");
        match event.what {
            What::Opened => adapter.opened(),
            _ if event.ends() => adapter.closed(now_ns),
            _ => {}
        }
    }
}

/// Report of client frames that were not sent, if any.
fn not_carried_out(dropped: Dropped) -> Option<String> {
    let Dropped { refused, displaced, old } = dropped;
    (dropped != Dropped::default()).then(|| {
        format!(
            "frames of the client not carried out: {refused} refused (the queue held all that the wire carries in {} ms), {displaced} \
             displaced by a stop, {old} set-points older than that",
            MOST_AGE.as_millis()
        )
    })
}

/// Reads the flash of all boards; `None` if the file does not exist.
fn read(path: &Path, legs: usize) -> Result<Option<Vec<u8>>, ToolError> {
    let failed = |error: std::io::Error| FileError::unreadable(path, &error);
    let file = match File::open(path) {
        Ok(file) => file,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(failed(error).into()),
    };
    let (mut bytes, length) = (Vec::new(), legs * BYTES);
    // A device file may have no end.
    file.take(length as u64 + 1).read_to_end(&mut bytes).map_err(failed)?;
    if bytes.len() == length {
        return Ok(Some(bytes));
    }
    let found = if bytes.len() > length { format!("more than {length}") } else { bytes.len().to_string() };
    let reason = format!("{found} bytes, the flash of {legs} boards has {length}");
    Err(FileError::new(path.display(), reason).into())
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
