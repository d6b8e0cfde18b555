//! What of a board's nodes outlives power and reset: what a host wants kept, how that ended, and what a node begins with.

use super::{Keeping, Station};
use crate::bus::drive::{Axis, USUAL_KBIT};
use crate::bus::kept::{KeptNode, kept_bit_rate, kept_node_id};
use crate::bus::nmt::{NmtState, Reset};
use crate::bus::node::{Node, Storing};
use crate::bus::node_id::NodeId;

impl<const N: usize, const LOG: usize> Station<N, LOG> {
    /// What a memory holds of a node, as after the start.
    pub fn recall(&mut self, joint: usize, bytes: &[u8]) {
        if let Some(kept) = self.kept.get_mut(joint) {
            *kept = KeptNode::of(bytes);
        }
        // The number of one may free another's.
        self.anew = [Some(Reset::Node); N];
        self.recall_reset();
    }

    /// The nodes' numbers with these objects; none where two would have the same.
    fn numbers(&self, kept: &[KeptNode; N]) -> Option<[NodeId; N]> {
        let mut numbers = self.own;
        for (number, kept) in numbers.iter_mut().zip(kept) {
            *number = kept_node_id(kept.bytes()).unwrap_or(*number);
        }
        let is_other = |place: usize, number| numbers.iter().skip(place + 1).all(|other| other != number);
        numbers.iter().enumerate().all(|(place, number)| is_other(place, number)).then_some(numbers)
    }

    /// Nodes that were reset begin anew, with what was kept of them.
    pub(super) fn recall_reset(&mut self) {
        if self.anew.iter().all(Option::is_none) {
            return;
        }
        let numbers = self.numbers(&self.kept).unwrap_or(self.own);
        for (joint, number) in numbers.into_iter().enumerate() {
            let Some(reset) = self.anew.get_mut(joint).and_then(Option::take) else { continue };
            let (Some(node), Some(axis), Some(kept)) =
                (self.nodes.get_mut(joint), self.axes.get_mut(joint), self.kept.get(joint))
            else {
                continue;
            };
            // One that was reset is as new, but for its number.
            if node.id() != number || node.state() != NmtState::Initialising {
                *node = Node::new(number, self.identity);
            }
            node.recall(kept.bytes(), reset, axis);
            node.goes_on(self.controller, self.storing);
            if reset == Reset::Node {
                // What one of them keeps holds for all, and what nobody keeps is as after the start.
                let rate = self.bit_rate().unwrap_or(USUAL_KBIT);
                self.axes.iter_mut().for_each(|axis| axis.set_bit_rate(rate));
            }
        }
    }

    /// The leg has one controller: what a host set at one node holds for all.
    pub(super) fn share_bit_rate(&mut self, joint: usize) {
        let Some(rate) = self.axes.get(joint).map(Axis::bit_rate) else { return };
        self.axes.iter_mut().for_each(|axis| axis.set_bit_rate(rate));
    }

    /// What a host wants kept, once, and each node's objects for the store: until [`Self::stored`] says so nothing of it counts. Neither more
    /// than fits nor one number for two nodes is kept, and hosts are told (FF0D, then 5530).
    pub fn take_store(&mut self, into: &mut [KeptNode; N]) -> Option<Keeping> {
        self.recall_reset();
        let defaults = self.leg.take_store()?;
        let mut fits = true;
        for ((node, axis), kept) in self.nodes.iter_mut().zip(&mut self.axes).zip(into.iter_mut()) {
            *kept = KeptNode::NOTHING;
            if !defaults {
                fits &= node.keep_into(axis, kept).is_ok();
            }
        }
        if !fits || self.numbers(into).is_none() {
            // All of it or nothing; and told again after one that failed before.
            self.storing(Storing::Busy);
            self.storing(Storing::Failed);
            return None;
        }
        Some(if defaults { Keeping::Defaults } else { Keeping::All })
    }

    /// How a store of these objects ended. Only what was done is what a node begins with when it is reset; after one that failed it
    /// is what it was before.
    pub fn stored(&mut self, done: bool, objects: &[KeptNode; N]) {
        if done {
            self.kept = *objects;
        }
        // While the flash was written nobody was heard, and on a board no time passed.
        self.nodes.iter_mut().for_each(|node| node.stood_still(self.looked_us));
        self.storing(if done { Storing::Done } else { Storing::Failed });
    }

    /// Where the store stands: hosts are told by an emergency message.
    pub fn storing(&mut self, storing: Storing) {
        self.storing = storing;
        self.nodes.iter_mut().for_each(|node| node.on_store(storing));
    }

    /// The bit rate that is kept, kbit/s.
    #[must_use]
    pub fn bit_rate(&self) -> Option<u16> {
        self.kept.iter().find_map(|kept| kept_bit_rate(kept.bytes()))
    }
}
