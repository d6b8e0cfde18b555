//! Stored parameters of a board: what a host wants stored, the outcome, and what a reset recalls.

use super::{Device, StoreCommand};
use crate::bus::drive::{Axis, USUAL_KBIT};
use crate::bus::nmt::{NmtState, Reset};
use crate::bus::node::{Node, Storing};
use crate::bus::node_id::NodeId;
use crate::bus::stored_parameters::{StoredNode, stored_bit_rate, stored_node_id};

impl<const N: usize, const LOG: usize> Device<N, LOG> {
    /// Sets the stored parameters of a node and restarts all nodes with theirs.
    pub fn recall(&mut self, joint: usize, bytes: &[u8]) {
        if let Some(stored) = self.stored.get_mut(joint) {
            *stored = StoredNode::from_bytes(bytes);
        }
        // The new node-ID of one node may free the default of another.
        self.pending_reset = [Some(Reset::Node); N];
        self.recall_reset();
    }

    /// Node-IDs according to these parameters.
    fn numbers(&self, stored: &[StoredNode; N]) -> [NodeId; N] {
        let mut numbers = self.own;
        for (number, stored) in numbers.iter_mut().zip(stored) {
            *number = stored_node_id(stored.bytes()).unwrap_or(*number);
        }
        numbers
    }

    /// Node-IDs after the pending resets: of a reset node the stored one, after a communication reset the one
    /// that a host has set since. The present ones if two nodes would share one.
    fn numbers_after_reset(&self) -> [NodeId; N] {
        let present = self.nodes.each_ref().map(Node::id);
        let mut next = present;
        let stored = self.numbers(&self.stored);
        let nodes = next.iter_mut().zip(&self.pending_reset).zip(stored).zip(self.own).zip(&self.axes);
        for ((((number, reset), stored), own), axis) in nodes {
            match reset {
                Some(Reset::Node) => *number = stored,
                Some(Reset::Communication) => *number = axis.node_id().unwrap_or(own),
                None => {}
            }
        }
        if are_distinct(&next) { next } else { present }
    }

    /// Restarts the nodes that were reset, with their stored parameters.
    pub(super) fn recall_reset(&mut self) {
        if self.pending_reset.iter().all(Option::is_none) {
            return;
        }
        let numbers = self.numbers_after_reset();
        for (joint, number) in numbers.into_iter().enumerate() {
            let Some(reset) = self.pending_reset.get_mut(joint).and_then(Option::take) else { continue };
            let (Some(node), Some(axis), Some(stored)) =
                (self.nodes.get_mut(joint), self.axes.get_mut(joint), self.stored.get(joint))
            else {
                continue;
            };
            // A reset node already has its initial state, except for its node-ID.
            if node.id() != number || node.state() != NmtState::Initialising {
                *node = Node::new(number, self.identity.for_joint(joint));
            }
            node.recall(stored.bytes(), reset, axis);
            node.goes_on(self.controller, self.storing);
            if reset == Reset::Node {
                // The bit rate applies to all nodes; without a stored one the default returns.
                let rate = self.bit_rate().unwrap_or(USUAL_KBIT);
                self.axes.iter_mut().for_each(|axis| axis.set_bit_rate(rate));
            }
        }
    }

    /// Copies a node's bit rate to all nodes, because the board has one controller.
    pub(super) fn share_bit_rate(&mut self, joint: usize) {
        let Some(rate) = self.axes.get(joint).map(Axis::bit_rate) else { return };
        self.axes.iter_mut().for_each(|axis| axis.set_bit_rate(rate));
    }

    /// Takes the pending store request and encodes each node's objects into `into`. The objects apply only
    /// after [`Self::stored`]. If they do not fit, or two nodes would share a node-ID, nothing is stored;
    /// hosts receive FF0D, then 5530.
    pub(crate) fn take_store(&mut self, into: &mut [StoredNode; N]) -> Option<StoreCommand> {
        self.recall_reset();
        let defaults = self.leg.take_store()?;
        self.nodes.iter_mut().for_each(|node| node.store_begins(defaults));
        let mut fits = true;
        for ((node, axis), stored) in self.nodes.iter_mut().zip(&mut self.axes).zip(into.iter_mut()) {
            *stored = StoredNode::NOTHING;
            if !defaults {
                fits &= node.store_into(axis, stored).is_ok();
            }
        }
        if !fits || !are_distinct(&self.numbers(into)) {
            // All or nothing. The detour by `Busy` reports a repeated failure again.
            self.storing(Storing::Busy);
            self.storing(Storing::Failed);
            self.nodes.iter_mut().for_each(|node| node.stored(false));
            return None;
        }
        Some(if defaults { StoreCommand::Defaults } else { StoreCommand::All })
    }

    /// Reports the outcome of storing `objects`. A reset recalls them only after success; after a failure it
    /// recalls the previous ones.
    pub fn stored(&mut self, done: bool, objects: &[StoredNode; N]) {
        if done {
            self.stored = *objects;
        }
        // No frame was received during the flash write, and a board's clock did not advance.
        for node in &mut self.nodes {
            node.stood_still(self.last_call_us);
            node.stored(done);
        }
        self.storing(if done { Storing::Done } else { Storing::Failed });
    }

    /// Sets the state of the store; hosts receive an emergency message.
    pub fn storing(&mut self, storing: Storing) {
        self.storing = storing;
        self.nodes.iter_mut().for_each(|node| node.on_store(storing));
    }

    /// Announces a pause for a new image to hosts, as one for the store, or its end. The state of the store
    /// stays.
    pub(crate) fn pause(&mut self, pauses: bool) {
        let storing = if pauses { Storing::Busy } else { self.storing };
        self.nodes.iter_mut().for_each(|node| node.on_store(storing));
    }

    /// Returns the stored bit rate, kbit/s.
    pub(crate) fn bit_rate(&self) -> Option<u16> {
        self.stored.iter().find_map(|stored| stored_bit_rate(stored.bytes()))
    }
}

/// Whether no two nodes share a node-ID.
fn are_distinct(numbers: &[NodeId]) -> bool {
    let is_other = |index: usize, number| numbers.iter().skip(index + 1).all(|other| other != number);
    numbers.iter().enumerate().all(|(index, number)| is_other(index, number))
}
