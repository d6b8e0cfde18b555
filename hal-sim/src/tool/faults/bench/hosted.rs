//! A leg on the bus that its host moves, and forks of it: where the rows of the bus and of what is kept begin.

use std::panic::{AssertUnwindSafe, catch_unwind};

use rayon::prelude::*;
use scarab::hal::Contacts;
use scarab::leg::Permission;

use super::super::campaign::{BASE, begin};
use super::super::catalogue::JOINTS;
use super::super::dice::Dice;
use super::super::entry::Head;
use super::super::invariants::{Invariants, Scope};
use super::super::rig::Rig;
use super::super::run::Outcome;
use super::outcome;
use crate::tool::bus::board::Board;
use crate::tool::bus::host::Host;
use crate::tool::bus::memory::Memory;
use crate::tool::error::ToolError;
use crate::tool::leg_file::LegFile;
use crate::tool::pair::Context;
use crate::tool::simulate::{DriveModel, SimulationOptions};

/// Servo ticks of the motion in which forks begin: two ways there and back.
const MOTION: u64 = 11_400;
/// An operator lets go of the switch for so long, servo ticks.
const LET_GO: u64 = 400;
/// Forks that wait for each other; half a megabyte each.
const BATCH: usize = 64;

/// A board with an operator who holds the switch, alone on its bus.
pub(super) fn board(leg: &LegFile) -> Result<Board<JOINTS, BASE>, ToolError> {
    Board::new(leg, context(leg)?, 1, 1, Memory::new(None))
}

/// What such a board is made from.
pub(super) fn context(leg: &LegFile) -> Result<Context<JOINTS, BASE>, ToolError> {
    let options = SimulationOptions { drive: DriveModel::Full, ..SimulationOptions::of_seed(1) };
    Context::new(leg, &options)
}

/// A host, its nodes started and mapped, the leg off.
pub(super) fn started(leg: &LegFile) -> Result<Host, ToolError> {
    let mut host = Host::new(board(leg)?);
    host.begin()?;
    Ok(host)
}

/// A host that moves its leg.
pub(super) fn hosted(leg: &LegFile) -> Result<Host, ToolError> {
    let mut host = started(leg)?;
    host.move_leg(leg)?;
    Ok(host)
}

/// No host, and an operator whose leg identifies itself.
pub(super) fn identifying(leg: &LegFile) -> Result<Host, ToolError> {
    let mut host = Host::new(board(leg)?);
    // It was held all the time.
    host.rig().hand = Contacts::default();
    host.run(LET_GO);
    begin(leg, host.rig())?;
    Ok(host)
}

/// One fork.
pub(super) struct Fork<'a> {
    pub(super) head: &'a Head,
    pub(super) seed: u64,
    pub(super) dice: Dice,
    pub(super) host: Host,
    pub(super) invariants: Invariants<JOINTS>,
    /// Period in which it began.
    begun: u64,
}

impl Fork<'_> {
    /// One servo tick; invariants are asked in each of its periods. The instant of its first command, ns.
    pub(super) fn tick(&mut self) -> u64 {
        let begun_ns = self.host.network.now_ns();
        let invariants = &mut self.invariants;
        self.host.tick(|rig: &Rig<JOINTS, BASE>| invariants.see(rig, false));
        begun_ns
    }

    /// So many of them.
    pub(super) fn run(&mut self, ticks: u64) {
        for _ in 0..ticks {
            self.tick();
        }
    }

    /// What the drive's state is called now, unless it follows.
    pub(super) fn safe_state(&mut self) -> Option<&'static str> {
        match self.host.rig().state().permission() {
            Permission::Follow => None,
            Permission::Damp => Some("Damp"),
            Permission::Released => Some("Off"),
        }
    }

    /// Something that had to hold and did not.
    pub(super) fn broken(&mut self, what: &str) {
        let (host, invariants) = (&mut self.host, &mut self.invariants);
        invariants.note(host.rig(), what);
    }

    /// What came of it, made safe in this state; `alarm` as it was when that was seen.
    pub(super) fn ended(mut self, state: Option<&'static str>, alarm: Option<&'static str>) -> Outcome {
        let hash = format!("{:016x}", self.host.rig().hash);
        Outcome {
            period: self.begun,
            alarm,
            broken: self.invariants.into_broken(),
            hash,
            ..outcome(self.head, self.seed, state)
        }
    }
}

/// A run of each seed on a fork at an instant of its dice.
pub(super) fn forked<'a>(
    head: &'a Head,
    leg: &LegFile,
    base: Host,
    seeds: &[u64],
    run: impl Fn(Fork<'a>) -> Result<Outcome, ToolError> + Sync,
) -> Result<Vec<Outcome>, ToolError> {
    forked_within(head, leg, base, seeds, Scope { torque: true, range: true, place: true }, run)
}

/// The same, with invariants of this scope.
pub(super) fn forked_within<'a>(
    head: &'a Head,
    leg: &LegFile,
    mut base: Host,
    seeds: &[u64],
    scope: Scope,
    run: impl Fn(Fork<'a>) -> Result<Outcome, ToolError> + Sync,
) -> Result<Vec<Outcome>, ToolError> {
    let drawn = |seed: &u64| {
        let mut dice = Dice::new(head.id, *seed);
        (dice.below(MOTION), *seed, dice)
    };
    let mut jobs: Vec<_> = seeds.iter().map(drawn).collect();
    jobs.sort_by_key(|(instant, seed, _)| (*instant, *seed));
    let (mut outcomes, mut now) = (Vec::with_capacity(seeds.len()), 0);
    for jobs in jobs.chunks(BATCH) {
        let mut forks = Vec::with_capacity(BATCH);
        for (instant, seed, dice) in jobs {
            base.run(instant - now);
            now = *instant;
            let mut host = base.clone();
            let begun = host.rig().period;
            let invariants = Invariants::new(leg, scope, host.rig());
            forks.push(Fork { head, seed: *seed, dice: dice.clone(), host, invariants, begun });
        }
        let one = |fork: Fork<'a>| {
            let seed = fork.seed;
            catch_unwind(AssertUnwindSafe(|| run(fork))).unwrap_or_else(|_| {
                Ok(Outcome { broken: vec!["a panic".into()], ..outcome(head, seed, None) })
            })
        };
        outcomes.extend(forks.into_par_iter().map(one).collect::<Result<Vec<_>, _>>()?);
    }
    outcomes.sort_by_key(|outcome| outcome.seed);
    Ok(outcomes)
}
