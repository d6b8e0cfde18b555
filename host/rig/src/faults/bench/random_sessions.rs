//! B7: random host sessions. Each run is one on a whole leg (`random_hosts`); half of them come
//! to a leg that its operator has enabled.

use std::panic::{AssertUnwindSafe, catch_unwind};

use rayon::prelude::*;
use scarab::bus::Frame;
use scarab::hal::Contacts;
use scarab::leg::Activity;
use scarab::model::planar::{BASE, JOINTS};
use scarab_base::error::ToolError;
use scarab_base::random::Random;
use scarab_identify::formats::leg_file::LegFile;

use crate::bus::network::Network;
use crate::faults::bench::hosted::board;
use crate::faults::bench::{Bench, outcome};
use crate::faults::catalogue::{self, Fault};
use crate::faults::outcome::Outcome;
use crate::faults::random_hosts::{HostSession, HostedLeg, JointBounds, LegState, check_session, is_like};

pub(super) const BENCH: Bench = Bench { fault: &catalogue::B7, run: sessions };

/// Runs that reducing a session may take.
const MOST_RUNS: u32 = 400;

/// A simulated leg on its bus.
#[derive(Clone)]
struct SimulatedLeg(Network<JOINTS, BASE>);

impl SimulatedLeg {
    /// A leg that is off, and one that its operator has enabled.
    fn both(leg: &LegFile) -> Result<[Self; 2], ToolError> {
        let off = Self(Network::new(vec![board(leg)?], 1_000_000));
        let mut by_hand = off.clone();
        if !by_hand.0.boards()[0].enable_by_contacts() {
            return Err(ToolError::Refused("the operator's contacts do not enable the leg".into()));
        }
        Ok([off, by_hand])
    }
}

impl HostedLeg for SimulatedLeg {
    const DELAY: u32 = 0;
    const OVERSHOOT: f64 = 1.001;

    fn send(&mut self, frame: Frame) {
        self.0.send(frame);
    }

    fn hold(&mut self, contacts: Contacts) {
        self.0.boards()[0].rig.hand = contacts;
    }

    fn plug(&mut self, plugged: bool) {
        self.0.set_plugged(plugged);
    }

    fn tick(&mut self, heard: &mut dyn FnMut(&Frame)) -> Result<Option<LegState>, String> {
        self.0.tick(|sent| {
            if sent.sender != 0 {
                heard(&sent.frame);
            }
        });
        let rig = &self.0.boards()[0].rig;
        Ok(rig.output.as_ref().map(|output| LegState {
            is_enabled: output.servo.decision.state.is_enabled(),
            fault: output.servo.decision.state.fault().map(|fault| fault.code.number()),
            torque: output.servo.decision.torque.map(|torque| torque.0.into()),
            position: rig.world.anatomical_position(),
            speed: Some(output.motion.velocity_rad_per_s),
            returns: output.servo.decision.returns,
            bounded: output.servo.decision.limited.map(|limited| limited.range || limited.speed),
            moves_itself: !matches!(rig.leg.control().activity(), Activity::Idle | Activity::Follow),
        }))
    }
}

fn sessions(fault: &Fault, leg: &LegFile, seeds: &[u64], _: bool) -> Result<Vec<Outcome>, ToolError> {
    let (legs, bounds) = (SimulatedLeg::both(leg)?, JointBounds::from_leg(leg)?);
    let judged = |session: &HostSession| {
        let leg = legs[usize::from(session.by_hand)].clone();
        catch_unwind(AssertUnwindSafe(|| check_session(leg, bounds, session)))
            .unwrap_or_else(|_| Err("a panic".into()))
    };
    let one = |seed: &u64| {
        let session = HostSession::draw(&mut Random::new(fault.id, *seed));
        let Err(first) = judged(&session) else { return outcome(fault, *seed, Some(fault.state)) };
        let reduced =
            session.reduced(MOST_RUNS, |session| judged(session).is_err_and(|why| is_like(&why, &first)));
        let why = judged(&reduced).err().unwrap_or(first);
        Outcome { broken: vec![format!("{why}; {reduced:?}")], ..outcome(fault, *seed, None) }
    };
    Ok(seeds.par_iter().map(one).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::faults::random_hosts::Step;
    use scarab_identify::formats::leg_file::DEFAULT_LEG;

    #[test]
    fn a_host_that_acts_while_the_switch_closes_keeps_the_leg_off() {
        let leg = LegFile::load(DEFAULT_LEG).expect("a shipped leg");
        let ([_, by_hand], bounds) =
            (SimulatedLeg::both(&leg).expect("legs"), JointBounds::from_leg(&leg).expect("bounds"));
        // The stop of a host that does not have the leg, and one that takes it and leaves.
        for acts in [vec![Step::Word(JOINTS, 0)], vec![Step::Word(JOINTS, 6), Step::Nmt(129, 0)]] {
            // The leg damps, or is off; the switch counts after 80 ticks, and its steps take some more.
            for (open, closed) in
                [(20, 20), (20, 120), (1300, 4), (1300, 40), (1300, 76), (1300, 80), (1300, 84)]
            {
                let closing = [Step::Wait(open), Step::Contacts(true, false, closed)];
                let opened = [Step::Contacts(false, false, 4)];
                let steps =
                    opened.into_iter().chain(closing).chain(acts.clone()).chain([Step::Wait(400)]).collect();
                let session = HostSession { by_hand: true, steps };
                let found = check_session(by_hand.clone(), bounds, &session);
                assert_eq!(found, Ok(()), "{session:?}");
            }
        }
    }

    #[test]
    fn no_random_session_breaks_an_invariant() {
        let leg = LegFile::load(DEFAULT_LEG).expect("a shipped leg");
        let seeds: Vec<u64> = (1..=200).collect();
        let found = sessions(BENCH.fault, &leg, &seeds, false).expect("sessions");
        let broken = found.iter().filter(|outcome| !outcome.broken.is_empty());
        let broken: Vec<String> =
            broken.map(|outcome| format!("seed {}: {}", outcome.seed, outcome.broken.join("; "))).collect();
        assert!(broken.is_empty(), "{}", broken.join("\n"));
    }
}
