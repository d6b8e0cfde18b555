//! F3, with the drive off: a host has its node keep something, and the processor stands while the one bank of the flash is written.
//!
//! The order is the board's (`operation::Storing`): interlock, announcement, a second look, the watchdog's longer time, the flash, the watchdog's
//! usual time, the interlock let go. Between them the bus and the leg go on. While the flash works nobody ticks, the plant goes on, the
//! wearer turns the leg, and of what the host sends the controller keeps three frames.
//!
//! | flash | processor stands for | afterwards |
//! | --- | --- | --- |
//! | words only | 16 us for each four bytes | the host enables the leg as before |
//! | a sector erased | 1 to 2 s each beside | joints have no zeros any more: nothing enables before a reference was taken |
//!
//! Neither is anybody's fault: nothing is raised, no watchdog bites. Hosts were told before (FF0D) and are told after (0000), and, where they
//! went on sending, that frames were lost (8110, 0000); what was asked for is kept.

use scarab::leg::DriveState;
use scarab::safety::{FaultCode, NO_ERROR, NoticeCode};

use super::super::entry::Head;
use super::super::run::Outcome;
use super::hosted::{Fork, forked, started};
use super::lost::watched;
use crate::tool::bus::host::Host;
use crate::tool::error::ToolError;
use crate::tool::leg_file::LegFile;

/// A state in which may be written.
const OFF: DriveState = DriveState::SwitchOnDisabled;
/// Records that fill a sector.
const MOST_RECORDS: u32 = 1000;
/// Servo ticks until what was asked for is on its way, of the longest change of the flash, and until hosts were told.
const ASKED: u64 = 16;
const LONGEST: u64 = 20_000;
const TOLD: u64 = 40;
const NS_PER_S: f64 = 1e9;
/// Servo ticks of a host that wants its leg enabled.
const ENABLING: u64 = 400;
const SAVE: u32 = u32::from_le_bytes(*b"save");
/// Following window that is kept, micro-radian.
const WINDOW: u16 = 0x6065;
const NODES: [u16; 2] = [1, 2];
/// Emergency messages: the flash is about to be written; frames were lost; nothing is wrong.
const STORING: u16 = NoticeCode::Storing.number();
const LOST: u16 = NoticeCode::Overrun.number();
const CLEAR: u16 = NO_ERROR;

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
    if erases {
        // Somebody moves the leg meanwhile.
        let (joint, push) = (fork.dice.below(2) as usize, fork.dice.sign() * fork.dice.uniform(0.0, 20.0));
        fork.host.rig().world.push(joint, push, 3.0);
    }
    let erasing_ns = (fork.dice.uniform(1.0, 2.0) * NS_PER_S) as u64;
    let before = fork.host.board().memory().worked().1;
    let flashing = fork.host.board().flashing();
    (flashing.erasing_ns, flashing.unannounced) = (erasing_ns, blind);
    fork.host.write(1 + fork.dice.below(2) as u16, 0x1010, 1, SAVE, 4)?;
    fork.run(ASKED);
    for _ in 0..LONGEST {
        if !fork.host.board().flashing().is_under_way() {
            break;
        }
        fork.tick();
    }
    let erased = fork.host.board().memory().worked().1 > before;
    fork.run(TOLD);
    let told = NODES.map(|node| {
        fork.host.told().iter().filter(|(from, _)| *from == node).map(|told| told.1).collect::<Vec<_>>()
    });
    // What the host sent while the processor stood may have been lost, which it is told; nothing else.
    let tells = told.iter().all(|codes| {
        let first = codes.strip_prefix(&[STORING]);
        first.is_some_and(|rest| rest == [CLEAR] || rest == [LOST, CLEAR, CLEAR])
    });
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
    let safe = tells && calm && enabled != erased && erased == erases && windows == [window; 2];
    Ok(fork.ended(safe.then_some("-"), alarm))
}
