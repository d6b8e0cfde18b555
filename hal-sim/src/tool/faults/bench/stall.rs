//! F3, with the drive off: a host has its node keep something, and the processor stands while the one bank of the flash is written.
//!
//! The order is the board's (`operation::Storing`): interlock, announcement, a second look, the watchdog's longer time, the flash, the watchdog's
//! usual time, the interlock let go. Between them the bus and the leg go on. While the flash works nobody ticks, the plant goes on, the
//! wearer turns the leg and what the host sends is lost.
//!
//! | flash | processor stands for | afterwards |
//! | --- | --- | --- |
//! | words only | 16 us for each four bytes | the host enables the leg as before |
//! | a sector erased | 1 to 2 s each beside | joints have no zeros any more: nothing enables before a reference was taken |
//!
//! Neither is anybody's fault: nothing is raised, no watchdog bites. Hosts were told before (FF01) and are told after (0000), and what was
//! asked for is kept.

use core::cell::RefCell;

use embassy_futures::block_on;
use scarab::leg::{DriveState, Permission};
use scarab::operation::{Storing, StoringBoard};
use scarab::safety::{Cause, FaultCode};

use super::super::entry::Head;
use super::super::rig::PERIODS_PER_S;
use super::super::run::Outcome;
use super::hosted::{Fork, forked, started};
use super::lost::watched;
use crate::tool::bus::host::Host;
use crate::tool::error::ToolError;
use crate::tool::leg_file::LegFile;

/// A state in which may be written.
const OFF: DriveState = DriveState::SwitchOnDisabled;
/// Of a sector, bytes; records that fill one.
const SECTOR: u64 = 128 * 1024;
const MOST_RECORDS: u32 = 1000;
/// Servo ticks of a millisecond, until what was asked for is on its way, and until hosts were told.
const TICKS_PER_MS: u64 = 4;
const ASKED: u64 = 16;
const TOLD: u64 = 40;
const NS_PER_S: u64 = 1_000_000_000;
/// A word takes so long, ns.
const WORD_NS: u64 = 16_000;
/// 8 s instead of 16 ms.
const STRETCHED: u64 = 500;
/// Servo ticks of a host that wants its leg enabled.
const ENABLING: u64 = 400;
const SAVE: u32 = u32::from_le_bytes(*b"save");
/// Following window that is kept, micro-radian.
const WINDOW: u16 = 0x6065;
const NODES: [u16; 2] = [1, 2];
/// Emergency messages: the flash is about to be written; nothing is wrong.
const STORING: u16 = 0xFF01;
const CLEAR: u16 = 0;

/// A host whose leg is off, on a board whose flash has no room for one more save.
fn full(leg: &LegFile) -> Result<Host, ToolError> {
    let mut host = started(leg)?;
    for size in [96, 2] {
        for number in 0..MOST_RECORDS {
            let bytes = [number.to_le_bytes(); 96].concat();
            let mut tried = host.board().memory().clone();
            tried.keep_objects(OFF, 0, &bytes[..4 * size]);
            if tried.worked().1 > host.board().memory().worked().1 {
                break;
            }
            *host.board().memory() = tried;
        }
    }
    Ok(host)
}

pub(super) fn stall(
    head: &Head,
    leg: &LegFile,
    seeds: &[u64],
    blind: bool,
) -> Result<Vec<Outcome>, ToolError> {
    let (erased, words): (Vec<u64>, Vec<u64>) = seeds.iter().partition(|seed| seed.is_multiple_of(4));
    let mut outcomes = forked(head, leg, full(leg)?, &erased, |fork| stalled(fork, true, blind))?;
    outcomes.extend(forked(head, leg, started(leg)?, &words, |fork| stalled(fork, false, blind))?);
    Ok(outcomes)
}

fn stalled(mut fork: Fork<'_>, erases: bool, blind: bool) -> Result<Outcome, ToolError> {
    let window = 20_000 + fork.dice.below(20_000) as u32;
    if fork.dice.coin() {
        watched(&mut fork, [true, false], false)?;
    }
    for node in NODES {
        fork.host.write(node, WINDOW, 0, window, 4)?;
    }
    fork.host.board().keep_later();
    if erases {
        // Somebody moves the leg meanwhile.
        let (joint, push) = (fork.dice.below(2) as usize, fork.dice.sign() * fork.dice.uniform(0.0, 20.0));
        fork.host.rig().world.push(joint, push, 3.0);
    }
    fork.host.write(1 + fork.dice.below(2) as u16, 0x1010, 1, SAVE, 4)?;
    fork.run(ASKED);
    let Some((keeping, objects)) = fork.host.board().take_asked() else {
        return Ok(fork.ended(None, None));
    };
    let before = fork.host.board().memory().worked();
    let fork = RefCell::new(fork);
    let mut board = Board { fork: &fork, blind, raised: false };
    let change = || {
        let mut fork = fork.borrow_mut();
        let kept = fork.host.board().keep(keeping, &objects);
        let after = fork.host.board().memory().worked();
        let sectors = u64::from(after.1 - before.1);
        let words = (after.0 - before.0 - sectors * SECTOR) / 4;
        let erasing_ns = (fork.dice.uniform(1.0, 2.0) * NS_PER_S as f64) as u64;
        let stands_ns = words * WORD_NS + sectors * erasing_ns;
        fork.host.network.pass(stands_ns);
        fork.host.rig().stand_still(stands_ns * PERIODS_PER_S / NS_PER_S);
        kept
    };
    let kept = block_on(Storing::new().change(&mut board, change));
    let mut fork = fork.into_inner();
    fork.host.board().stored(kept, &objects);
    let erased = fork.host.board().memory().worked().1 > before.1;
    fork.run(TOLD);
    let told = NODES.map(|node| {
        fork.host.told().iter().filter(|(from, _)| *from == node).map(|told| told.1).collect::<Vec<_>>()
    });
    let tells = told
        .iter()
        .all(|codes| codes.starts_with(&[STORING]) && codes.ends_with(&[CLEAR]) && codes.len() == 2);
    let alarm = fork.host.rig().alarm().map(FaultCode::name);
    let calm = alarm.is_none() && !fork.host.rig().is_restarted();
    // Commanded to stay where it is, which takes some cycles to tell.
    fork.host.speaks.targets = true;
    fork.run(ASKED);
    for word in [6, 7, 15] {
        NODES.into_iter().for_each(|node| fork.host.command(node, word));
        fork.run(ENABLING);
    }
    let enabled = fork.host.is_enabled();
    fork.host.board().power_on();
    fork.run(TOLD);
    let windows = [fork.host.read(1, WINDOW, 0)?, fork.host.read(2, WINDOW, 0)?];
    let safe = kept && tells && calm && enabled != erased && erased == erases && windows == [window; 2];
    Ok(fork.ended(safe.then_some("-"), alarm))
}

/// The board that stores; blind, nobody is told that it does.
struct Board<'a, 'b> {
    fork: &'a RefCell<Fork<'b>>,
    blind: bool,
    raised: bool,
}

impl StoringBoard for Board<'_, '_> {
    fn permission(&self) -> Permission {
        self.fork.borrow_mut().host.rig().state().permission()
    }

    fn causes(&self) -> u32 {
        let unseen = if self.blind && self.raised { Cause::Storing.bit() } else { 0 };
        self.fork.borrow_mut().host.rig().causes() | unseen
    }

    fn raise(&mut self, cause: Cause) {
        self.raised = true;
        if !self.blind {
            self.fork.borrow_mut().host.rig().raise(cause);
        }
    }

    fn stored(&mut self) {
        self.fork.borrow_mut().host.rig().stored();
    }

    fn stretch(&mut self) -> bool {
        self.fork.borrow_mut().host.rig().stretch(STRETCHED);
        true
    }

    fn tighten(&mut self) -> bool {
        self.fork.borrow_mut().host.rig().stretch(1);
        true
    }

    async fn wait_ms(&mut self, milliseconds: u64) {
        self.fork.borrow_mut().run(milliseconds * TICKS_PER_MS);
    }
}
