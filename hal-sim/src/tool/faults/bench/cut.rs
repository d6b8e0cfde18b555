//! X3: the supply is cut while a host moves the leg, the processor dies, and the power comes back under an operator who still holds the
//! switch and a host that goes on as if nothing had been.
//!
//! What has to follow: the image boots without calibration and zeros, so it stays disabled (not ready to switch on) whatever host and hand do,
//! and what was kept is there, whole. Blind, half of the runs boot as a board that knows everything still, the others with an empty memory.

use scarab::hal::AxisCommand;

use super::super::catalogue::JOINTS;
use super::super::entry::Head;
use super::super::run::Outcome;
use super::Bench;
use super::hosted::{Fork, forked, started};
use crate::tool::bus::memory::Memory;
use crate::tool::error::ToolError;
use crate::tool::leg_file::LegFile;
use scarab::hal::Contacts;

/// Servo ticks until the bus has to be gone; a quarter of a second of hands at the contacts, and of a switch that is opened.
const PATIENCE: u64 = 2 * 4000;
const HANDS: u64 = 1000;
const OPEN: u64 = 200;
/// Of the bus with its supply there, V.
const BUS_V: f64 = 48.0;
const SAVE: u32 = u32::from_le_bytes(*b"save");
/// Following window that is kept, micro-radian.
const WINDOW: u16 = 0x6065;
const KEPT: u32 = 43_210;

pub(super) const BENCH: Bench = Bench {
    head: Head {
        id: "X3",
        fault: "supply cut while moving, then back",
        detector: "nothing is calibrated after a boot; the store",
        state: "Refuse until reset",
        deadline_ms: f64::INFINITY,
        unit: "",
        codes: &[],
        lacking: None,
    },
    run: cut,
};

fn cut(head: &Head, leg: &LegFile, seeds: &[u64], blind: bool) -> Result<Vec<Outcome>, ToolError> {
    let mut host = started(leg)?;
    for node in [1, 2] {
        host.write(node, WINDOW, 0, KEPT, 4)?;
    }
    host.write(1, 0x1010, 1, SAVE, 4)?;
    host.run(400);
    host.move_leg(leg)?;
    let ready = host.clone();
    forked(head, leg, host, seeds, |mut fork| {
        let remembers = blind && fork.seed.is_multiple_of(2);
        if blind && !remembers {
            *fork.host.board().memory() = Memory::new(None);
        }
        let board = remembers.then(|| ready.clone());
        one(fork, board.map(|mut host| host.board().clone()))
    })
}

type Board = crate::tool::bus::board::Board<JOINTS, { super::super::campaign::BASE }>;

fn set_source(fork: &mut Fork<'_>, volts: f64) {
    if let Some(drives) = fork.host.rig().world.complete_drives_mut() {
        drives.supply_mut().set_source(volts);
    }
}

fn one(mut fork: Fork<'_>, remembers: Option<Board>) -> Result<Outcome, ToolError> {
    // Of the regulator: the processor dies somewhere below.
    let dies_at = fork.dice.uniform(4.0, 12.0);
    let away = fork.dice.below(24 * 500);
    set_source(&mut fork, 0.0);
    let bus = |fork: &mut Fork<'_>| {
        fork.host.rig().world.complete_drives().map_or(0.0, |drives| drives.supply().voltage())
    };
    for _ in 0..PATIENCE {
        fork.tick();
        if bus(&mut fork) < dies_at {
            break;
        }
    }
    // The one that is not there any more commands nothing: the bridges' switches are open.
    for _ in 0..away {
        fork.host.rig().world.period(&[AxisCommand::RELEASED; JOINTS], 0.0);
    }
    set_source(&mut fork, BUS_V);
    match remembers {
        Some(mut board) => {
            board.rig.world = fork.host.rig().world.clone();
            *fork.host.board() = board;
        }
        None => fork.host.board().power_on(),
    }
    let mut enabled = false;
    for tick in 0..2 * HANDS + OPEN {
        // Held on, let go, held again.
        fork.host.rig().hand = Contacts { enabling: !(HANDS..HANDS + OPEN).contains(&tick), start: false };
        if tick % 100 == 0 {
            fork.host.network.send(scarab::bus::Frame::new(0, &[1, 0]));
            for word in [6, 7, 15] {
                fork.host.command(1, word);
                fork.host.command(2, word);
            }
        }
        fork.host.tick(|_| {});
        enabled |= fork.host.is_enabled() || fork.host.rig().is_switching();
    }
    fork.host.speaks.targets = false;
    fork.host.speaks.words = false;
    let windows = [fork.host.read(1, WINDOW, 0)?, fork.host.read(2, WINDOW, 0)?];
    let safe = !enabled && windows == [KEPT; 2];
    Ok(fork.ended(safe.then_some("Refuse"), None))
}
