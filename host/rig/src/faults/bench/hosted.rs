//! A leg on the bus, moved by its host, and its forks: the base of the rows of bus and store.

use std::panic::{AssertUnwindSafe, catch_unwind};

use hal_sim::faults::{Channel, Form, Injection, Timing};
use rayon::prelude::*;
use scarab::hal::Contacts;
use scarab::leg::Permission;
use scarab_base::error::ToolError;
use scarab_base::random::Random;
use scarab_identify::formats::leg_file::LegFile;

use crate::bus::board::{Board, Label};
use crate::bus::host::Host;
use crate::faults::bench::{Outcomes, outcome};
use crate::faults::catalogue::{Fault, TICK_MS};
use crate::faults::invariants::{Invariants, Scope};
use crate::faults::run::Outcome;
use crate::faulty_board::Rig;
use crate::operator::begin;
use crate::pair::Context;
use crate::parameter_file::memory::Memory;
use scarab::model::planar::{BASE, JOINTS};

/// Servo ticks of the motion in which forks begin: two strokes back and forth.
const MOTION: u64 = 11_400;
/// Servo ticks for which the operator releases the switch.
const LET_GO: u64 = 400;
/// Forks per batch, half a megabyte each.
const BATCH: usize = 64;

/// A board with an operator who holds the switch, alone on its bus.
pub(super) fn board(leg: &LegFile) -> Result<Board<JOINTS, BASE>, ToolError> {
    Board::new(leg, context(leg)?, 1, Label::SINGLE, Memory::new(None))
}

/// Context of such a board.
pub(super) fn context(leg: &LegFile) -> Result<Context<JOINTS, BASE>, ToolError> {
    Context::with_complete_drives(leg, 1)
}

/// A host, its nodes started and mapped, the leg off.
pub(super) fn started(leg: &LegFile) -> Result<Host, ToolError> {
    let mut host = Host::new(board(leg)?);
    host.begin()?;
    Ok(host)
}

/// A host that moves its leg.
pub(super) fn hosted(leg: &LegFile) -> Result<Host, ToolError> {
    moving(leg, context(leg)?)
}

/// A host that moves a leg whose firmware has another context.
pub(super) fn moving(leg: &LegFile, context: Context<JOINTS, BASE>) -> Result<Host, ToolError> {
    let mut host = Host::new(Board::new(leg, context, 1, Label::SINGLE, Memory::new(None))?);
    host.begin()?;
    host.move_leg(leg)?;
    Ok(host)
}

/// A bus without host commands, and an operator who starts an identification.
pub(super) fn identifying(leg: &LegFile) -> Result<Host, ToolError> {
    let mut host = Host::new(board(leg)?);
    // The switch was held before.
    host.rig().hand = Contacts::default();
    host.run(LET_GO);
    begin(leg, host.rig())?;
    Ok(host)
}

/// One fork.
pub(super) struct Fork<'a> {
    pub(super) fault: &'a Fault,
    pub(super) seed: u64,
    pub(super) random: Random,
    pub(super) host: Host,
    pub(super) invariants: Invariants<JOINTS>,
    /// Period in which the fork began.
    begun: u64,
}

impl Fork<'_> {
    /// Runs one servo tick and checks the invariants in each period. Returns the time of its first command,
    /// ns.
    pub(super) fn tick(&mut self) -> u64 {
        let begun_ns = self.host.network.now_ns();
        let invariants = &mut self.invariants;
        self.host.tick(|rig: &Rig<JOINTS, BASE>| invariants.see(rig, false));
        begun_ns
    }

    /// Runs some servo ticks.
    pub(super) fn run(&mut self, ticks: u64) {
        for _ in 0..ticks {
            self.tick();
        }
    }

    /// Adds a fault of a joint's channel.
    pub(super) fn inject(&mut self, channel: Channel, joint: usize, form: Form, timing: Timing) {
        if !self.host.rig().injector.add(Injection { channel, joint, form, timing }) {
            self.broken("no space for an injection");
        }
    }

    /// Runs until a safe state is reached, by `state`, or for so many ticks. Returns it with its time, ms.
    pub(super) fn until(
        &mut self,
        ticks: u64,
        state: impl Fn(&mut Self) -> Option<&'static str>,
    ) -> Option<(&'static str, f64)> {
        (0..ticks).find_map(|tick| {
            self.tick();
            state(self).map(|state| (state, (tick + 1) as f64 * TICK_MS))
        })
    }

    /// Name of the drive's safe state; `None` while the drive follows.
    pub(super) fn safe_state(&mut self) -> Option<&'static str> {
        match self.host.rig().state().permission() {
            Permission::Follow => None,
            Permission::Damp => Some("Damp"),
            Permission::Off => Some("Off"),
        }
    }

    /// Notes a broken requirement.
    pub(super) fn broken(&mut self, what: &str) {
        let (host, invariants) = (&mut self.host, &mut self.invariants);
        invariants.note(host.rig(), what);
    }

    /// Outcome with this safe state; `alarm` is the one at its detection.
    pub(super) fn ended(mut self, state: Option<&'static str>, alarm: Option<&'static str>) -> Outcome {
        let hash = format!("{:016x}", self.host.rig().hash);
        Outcome {
            period: self.begun,
            alarm,
            broken: self.invariants.into_broken(),
            hash,
            ..outcome(self.fault, self.seed, state)
        }
    }
}

/// Runs each seed on a fork at a random time of the motion.
pub(super) fn forked<'a>(
    fault: &'a Fault,
    leg: &LegFile,
    base: Host,
    seeds: &[u64],
    run: impl Fn(Fork<'a>) -> Result<Outcome, ToolError> + Sync,
) -> Outcomes {
    forked_within(fault, leg, base, seeds, Scope { torque: true, range: true, rotor_position: true }, run)
}

/// Like [`forked`], with invariants of this scope.
pub(super) fn forked_within<'a>(
    fault: &'a Fault,
    leg: &LegFile,
    mut base: Host,
    seeds: &[u64],
    scope: Scope,
    run: impl Fn(Fork<'a>) -> Result<Outcome, ToolError> + Sync,
) -> Outcomes {
    let drawn = |seed: &u64| {
        let mut random = Random::new(fault.id, *seed);
        (random.below(MOTION), *seed, random)
    };
    let mut jobs: Vec<_> = seeds.iter().map(drawn).collect();
    jobs.sort_by_key(|(instant, seed, _)| (*instant, *seed));
    let (mut outcomes, mut now) = (Vec::with_capacity(seeds.len()), 0);
    for jobs in jobs.chunks(BATCH) {
        let mut forks = Vec::with_capacity(BATCH);
        for (instant, seed, random) in jobs {
            base.run(instant - now);
            now = *instant;
            let mut host = base.clone();
            let begun = host.rig().period;
            let invariants = Invariants::new(leg, scope, host.rig());
            forks.push(Fork { fault, seed: *seed, random: random.clone(), host, invariants, begun });
        }
        let one = |fork: Fork<'a>| {
            let seed = fork.seed;
            catch_unwind(AssertUnwindSafe(|| run(fork))).unwrap_or_else(|_| {
                Ok(Outcome { broken: vec!["a panic".into()], ..outcome(fault, seed, None) })
            })
        };
        outcomes.extend(forks.into_par_iter().map(one).collect::<Result<Vec<_>, _>>()?);
    }
    outcomes.sort_by_key(|outcome| outcome.seed);
    Ok(outcomes)
}
