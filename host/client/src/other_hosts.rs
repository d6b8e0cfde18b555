//! The look for another host, with which every procedure on a bus begins.
//!
//! CANopen does not arbitrate between two masters: a node follows whichever frame came last. A procedure that
//! begins beside another host would take its motion for the operator's hand, and stop or move its leg.
//!
//! | sign of another host | found by |
//! | --- | --- |
//! | SYNC, received PDOs, SDO requests, network management, LSS, a second run of this program | listening |
//! | a controlword that stands | 6040 |
//! | a drive that is on | 6041; with 6040 at 0 the operator's contacts have turned it on |
//!
//! Limits: a host that has enabled nothing and sends less often than `LISTENING` is heard later, by
//! `OtherHosts::check`. Frames of a client behind the same adapter program are not always shown.

use scarab_base::error::ToolError;
use std::time::Duration;

use crate::bus::{Bus, HOST, Object, RequestError};
use crate::master::Client;
use crate::words::JointState;

/// Time in which a host that controls a leg shows itself.
pub(crate) const LISTENING: Duration = Duration::from_secs(1);
/// NMT command: start of a node.
const START: u8 = 1;
/// Bit of a COB-ID: the message does not exist.
const ABSENT: u32 = 1 << 31;
const CONTROLWORD: Object = Object(0x6040, 0);
const STATUSWORD: Object = Object(0x6041, 0);
const SYNC: Object = Object(0x1005, 0);
/// First identifiers of received PDOs and SDO requests of nodes with default settings.
const RECEIVED: [u16; 4] = [0x200, 0x300, 0x400, 0x500];
const REQUEST: u16 = 0x600;

/// Turning on that a procedure permits before it begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum MayBeOn {
    /// None.
    No,
    /// By the operator's contacts.
    ByContacts,
}

/// Identifiers that only another host sends.
#[derive(Clone, Debug)]
pub(crate) struct OtherHosts {
    signs: Vec<(u16, String)>,
}

impl OtherHosts {
    /// Looks for another host of these nodes; without nodes for one of any. A stopped node is started.
    ///
    /// # Errors
    /// [`ToolError::Refused`] with the sign and the next step; or the bus fails.
    pub fn listen<B: Bus>(
        client: &mut Client<B>,
        nodes: &[u8],
        may_be_on: MayBeOn,
    ) -> Result<Self, ToolError> {
        let mut signs = vec![
            (0, "network management".into()),
            (0x80, "SYNC".into()),
            (0x7E5, "layer setting services (LSS)".into()),
            (0x700 + u16::from(HOST), format!("the heartbeat of node {HOST}, a second run of this program")),
        ];
        let all: Vec<u8> = (1..=127).collect();
        for node in if nodes.is_empty() { all.as_slice() } else { nodes } {
            signs.push((REQUEST + u16::from(*node), format!("SDO requests to node {node}")));
            for base in RECEIVED.into_iter().filter(|_| nodes.is_empty()) {
                signs.push((base + u16::from(*node), format!("a PDO for node {node}")));
            }
        }
        let mut found = Self { signs };
        client.wait(LISTENING).map_err(RequestError::for_bus)?;
        found.check(client)?;
        for node in nodes {
            found.add_signs(client, *node)?;
            found.check(client)?;
            check_drive(client, *node, may_be_on)?;
        }
        Ok(found)
    }

    /// Refuses if another host was heard, now or since the look began.
    ///
    /// # Errors
    /// [`ToolError::Refused`] with the sign and the next step.
    pub fn check<B: Bus>(&self, client: &Client<B>) -> Result<(), ToolError> {
        match self.signs.iter().find(|(identifier, _)| client.has_heard(*identifier)) {
            None => Ok(()),
            Some((identifier, words)) => Err(ToolError::Refused(format!(
                "another host uses the bus: {words} (identifier {identifier:03X}) is heard; end its program or \
                 unplug its adapter, then run the command again"
            ))),
        }
    }

    /// Adds the identifiers of SYNC and received PDOs that a node is set to.
    fn add_signs<B: Bus>(&mut self, client: &mut Client<B>, node: u8) -> Result<(), ToolError> {
        // A stopped node answers no SDO.
        if optional(client, node, STATUSWORD).is_err() {
            client.manage(node, START).map_err(RequestError::for_bus)?;
        }
        let pdos = (0..).zip(RECEIVED).map(|(index, base)| {
            let words = format!("received PDO {} of node {node}", index + 1);
            (Object(0x1400 + index, 1), u32::from(base) + u32::from(node), words)
        });
        let sync = (SYNC, 0x80, "SYNC".to_owned());
        for (object, default, words) in core::iter::once(sync).chain(pdos) {
            let identifier = optional(client, node, object)?.unwrap_or(default);
            if identifier & ABSENT == 0 && identifier & 0x7FF != 0 {
                self.signs.push(((identifier & 0x7FF) as u16, words));
            }
        }
        Ok(())
    }
}

/// Reads an object that other firmware may not have.
fn optional<B: Bus>(client: &mut Client<B>, node: u8, object: Object) -> Result<Option<u32>, ToolError> {
    match client.try_read(node, object) {
        Ok(value) => Ok(Some(value)),
        Err(RequestError::Aborted(_)) => Ok(None),
        Err(error) => Err(error.for_object(node, object)),
    }
}

/// Refuses a drive that a host controls, or that is on although it must not be.
fn check_drive<B: Bus>(client: &mut Client<B>, node: u8, may_be_on: MayBeOn) -> Result<(), ToolError> {
    let controlword = optional(client, node, CONTROLWORD)?.unwrap_or(0);
    let state = optional(client, node, STATUSWORD)?.and_then(|word| JointState::from_statusword(word as u16));
    let name = state.map_or("unknown state", JointState::name);
    if controlword != 0 {
        return Err(ToolError::Refused(format!(
            "node {node}: another host controls the drive ({name}; its controlword, 6040, is {controlword:04X}): end \
             its program; if it is gone, support the leg and write 0 to 6040 or restart the board; then run the \
             command again"
        )));
    }
    if may_be_on == MayBeOn::No && state.is_some_and(JointState::is_on) {
        return Err(ToolError::Refused(format!(
            "node {node}: the drive is on ({name}), by the operator's contacts: support the leg and open the \
             enabling switch, then run the command again"
        )));
    }
    Ok(())
}
