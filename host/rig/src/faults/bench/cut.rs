//! X3: the supply is cut while a host moves the leg, and the processor stops. The power returns while the
//! operator still holds the switch and the host continues as before.
//!
//! Requirement: the image starts without calibration and zeros, so the drive stays disabled (not ready to
//! switch on), independent of host and operator. All stored data is present. Blind: half of the runs start as
//! a board that still has everything in memory, the others with an empty memory.

use scarab::hal::{AxisCommand, Contacts, SERVO_RATE_HZ};
use scarab_base::error::ToolError;
use scarab_identify::formats::leg_file::LegFile;

use crate::bus::host::{SAVE, WINDOW};
use crate::faults::bench::Outcomes;
use crate::faults::bench::hosted::{Fork, forked, started};
use crate::faults::catalogue::Fault;
use crate::faults::run::Outcome;
use crate::parameter_file::memory::Memory;
use scarab::model::planar::JOINTS;

/// Servo ticks until the bus voltage must be zero, of operated contacts, and of an opened switch.
const PATIENCE: u64 = 2 * SERVO_RATE_HZ as u64;
const HANDS: u64 = 1000;
const OPEN: u64 = 200;
/// Bus voltage with the supply present, V.
const BUS_V: f64 = 48.0;
/// Stored following window, micro-radian.
const KEPT: u32 = 43_210;

pub(super) fn cut(fault: &Fault, leg: &LegFile, seeds: &[u64], blind: bool) -> Outcomes {
    let mut host = started(leg)?;
    host.write_both(WINDOW, KEPT, 4)?;
    host.write(1, 0x1010, 1, SAVE, 4)?;
    host.run(400);
    host.move_leg(leg)?;
    let ready = host.clone();
    forked(fault, leg, host, seeds, |mut fork| {
        let remembers = blind && fork.seed.is_multiple_of(2);
        if blind && !remembers {
            *fork.host.board().memory() = Memory::new(None);
        }
        let board = remembers.then(|| ready.clone());
        one(fork, board.map(|mut host| host.board().clone()))
    })
}

type Board = crate::bus::board::Board<JOINTS, { scarab::model::planar::BASE }>;

fn set_source(fork: &mut Fork<'_>, volts: f64) {
    if let Some(drives) = fork.host.rig().world.complete_drives_mut() {
        drives.supply_mut().set_source(volts);
    }
}

fn one(mut fork: Fork<'_>, remembers: Option<Board>) -> Result<Outcome, ToolError> {
    // Bus voltage below which the regulator no longer supplies the processor.
    let dies_at = fork.random.uniform(4.0, 12.0);
    let away = fork.random.below(24 * 500);
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
    // Without power there are no commands: the bridges' switches are open.
    for _ in 0..away {
        fork.host.rig().world.period(&[AxisCommand::OFF; JOINTS], 0.0);
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
        // The switch is held, opened, held again.
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
    fork.host.speaks.set_cycle(false);
    fork.host.speaks.words = false;
    let windows = [fork.host.read(1, WINDOW, 0)?, fork.host.read(2, WINDOW, 0)?];
    let safe = !enabled && windows == [KEPT; 2];
    Ok(fork.ended(safe.then_some("Refuse"), None))
}
