//! F3 with the drive off: a host stores objects, and the processor stalls while the flash's only bank is
//! written.
//!
//! The order is the board's (`operation::Storing`): interlock, announcement, second check, the watchdog's
//! longer period, the flash, the watchdog's usual period, interlock cleared. Between these steps bus and leg
//! continue. During the write there are no ticks, the plant continues, the wearer turns the leg, and the
//! controller keeps three of the host's frames.
//!
//! | flash | stall | afterwards |
//! | --- | --- | --- |
//! | words only | 16 us for each four bytes | the host enables the leg as before |
//! | a sector erased | 0.25 to 0.5 s more for each | no zeros: enabling requires a new reference |
//!
//! Neither is a fault: nothing is reported, and the watchdog does not reset. Hosts receive FF0D before and
//! 0000 after the write. Hosts that continue to send also receive the loss of frames (8110). At
//! the end no error is left. The requested data is stored.

use scarab::leg::DriveState;
use scarab::safety::{FaultCode, NO_ERROR, NoticeCode};
use scarab_base::error::ToolError;
use scarab_identify::formats::leg_file::LegFile;

use crate::bus::host::{Host, NODES, SAVE, WINDOW};
use crate::faults::bench::Outcomes;
use crate::faults::bench::hosted::{Fork, forked, started};
use crate::faults::bench::lost::watched;
use crate::faults::catalogue::Fault;
use crate::faults::run::Outcome;

/// Drive state in which writing is permitted.
const OFF: DriveState = DriveState::SwitchOnDisabled;
/// More records than fill a sector.
const MOST_RECORDS: u32 = 1000;
/// Servo ticks until a request is in progress, of the longest flash write, and until hosts are informed,
/// twice the inhibit time of emergency messages, or a board has started.
const START_TICKS: u64 = 16;
const LONGEST: u64 = 20_000;
const REPORT_TICKS: u64 = 80;
const NS_PER_S: f64 = 1e9;
/// Servo ticks for each step of enabling.
const ENABLING: u64 = 400;
const ERROR_REGISTER: u16 = 0x1001;
/// Emergency codes: a flash write begins; frames were lost; no error.
const STORING: u16 = NoticeCode::Storing.number();
const LOST: u16 = NoticeCode::Overrun.number();
const CLEAR: u16 = NO_ERROR;

/// A host with its leg off, on a board whose flash is full before the next save.
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

pub(super) fn stall(fault: &Fault, leg: &LegFile, seeds: &[u64], blind: bool) -> Outcomes {
    let (erased, words): (Vec<u64>, Vec<u64>) = seeds.iter().partition(|seed| seed.is_multiple_of(4));
    let mut outcomes = forked(fault, leg, full(leg)?, &erased, |fork| stalled(fork, true, blind))?;
    outcomes.extend(forked(fault, leg, started(leg)?, &words, |fork| stalled(fork, false, blind))?);
    Ok(outcomes)
}

fn stalled(mut fork: Fork<'_>, erases: bool, blind: bool) -> Result<Outcome, ToolError> {
    let window = 20_000 + fork.random.below(20_000) as u32;
    if fork.random.coin() {
        watched(&mut fork, [true, false], false)?;
    }
    fork.host.write_both(WINDOW, window, 4)?;
    if erases {
        // The wearer moves the leg during the stall.
        let (joint, push) =
            (fork.random.below(2) as usize, fork.random.sign() * fork.random.uniform(0.0, 20.0));
        fork.host.rig().world.push(joint, push, 3.0);
    }
    let erasing_ns = (fork.random.uniform(0.25, 0.5) * NS_PER_S) as u64;
    let before = fork.host.board().memory().worked().1;
    let flashing = fork.host.board().flashing();
    (flashing.erasing_ns, flashing.unannounced) = (erasing_ns, blind);
    fork.host.write(1 + fork.random.below(2) as u16, 0x1010, 1, SAVE, 4)?;
    fork.run(START_TICKS);
    for _ in 0..LONGEST {
        if !fork.host.board().flashing().is_under_way() {
            break;
        }
        fork.tick();
    }
    let erased = fork.host.board().memory().worked().1 > before;
    fork.run(REPORT_TICKS);
    let reports = NODES.map(|node| {
        fork.host
            .emergencies()
            .iter()
            .filter(|(from, _)| *from == node)
            .map(|(_, code)| *code)
            .collect::<Vec<_>>()
    });
    // Frames sent during the stall may be lost, which is reported; nothing else may be. The inhibit time
    // makes one message of the ends of both.
    let is_reported = reports.iter().all(|codes| {
        let first = codes.strip_prefix(&[STORING]);
        first.is_some_and(|rest| matches!(rest, [CLEAR] | [LOST, CLEAR] | [LOST, CLEAR, CLEAR]))
    });
    let registers = [fork.host.read(1, ERROR_REGISTER, 0)?, fork.host.read(2, ERROR_REGISTER, 0)?];
    let is_reported = is_reported && registers == [0; 2];
    let alarm = fork.host.rig().alarm().map(FaultCode::name);
    let calm = alarm.is_none() && !fork.host.rig().is_restarted();
    // The leg is commanded to keep its position, which takes some cycles to send.
    fork.host.speaks.set_cycle(true);
    fork.run(START_TICKS);
    for word in [6, 7, 15] {
        NODES.into_iter().for_each(|node| fork.host.command(node, word));
        fork.run(ENABLING);
    }
    let enabled = fork.host.is_enabled();
    fork.host.board().power_on();
    fork.run(REPORT_TICKS);
    let windows = [fork.host.read(1, WINDOW, 0)?, fork.host.read(2, WINDOW, 0)?];
    let safe = is_reported && calm && enabled != erased && erased == erases && windows == [window; 2];
    Ok(fork.ended(safe.then_some("-"), alarm))
}
