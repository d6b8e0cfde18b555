//! Network management (NMT): states, commands and the boot-up message of a node.
//!
//! ```text
//! start -> boot-up message -> PreOperational <--> Operational      SDO in both, PDO in Operational only
//!                                   ^--> Stopped <--^              only heartbeat and commands in Stopped
//! reset node, reset communication: from every state back to the start
//! ```
//!
//! Source: CiA 301, network management.

/// COB-ID of NMT commands.
pub(crate) const COMMAND: u16 = 0x000;
/// Function base of boot-up and heartbeat messages; the node-ID is added.
pub(crate) const HEARTBEAT: u16 = 0x700;

/// NMT state; the number is sent in the heartbeat.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum NmtState {
    /// Boot-up message not sent yet.
    Initialising = 0,
    /// Heartbeat and NMT commands only.
    Stopped = 4,
    /// All services.
    Operational = 5,
    /// All services but PDO.
    PreOperational = 127,
}

impl NmtState {
    /// Whether SDO is served.
    pub(crate) const fn serves(self) -> bool {
        matches!(self, Self::Operational | Self::PreOperational)
    }
}

/// Command of the NMT master.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Command {
    /// Changes the state.
    Go(NmtState),
    /// Resets the node.
    Reset(Reset),
}

/// Extent of a reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Reset {
    /// Objects up to 1FFF and the node-ID.
    Communication,
    /// All objects.
    Node,
}

/// Decodes an NMT command; `None` if it is invalid or addressed to another node.
pub fn command(data: &[u8], node: u8) -> Option<Command> {
    let &[command, target] = data else { return None };
    if target != 0 && target != node {
        return None;
    }
    match command {
        1 => Some(Command::Go(NmtState::Operational)),
        2 => Some(Command::Go(NmtState::Stopped)),
        128 => Some(Command::Go(NmtState::PreOperational)),
        129 => Some(Command::Reset(Reset::Node)),
        130 => Some(Command::Reset(Reset::Communication)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_applies_to_the_addressed_node_or_to_all() {
        let start = Some(Command::Go(NmtState::Operational));
        assert_eq!(command(&[1, 5], 5), start);
        assert_eq!(command(&[1, 0], 5), start);
        assert_eq!(command(&[1, 6], 5), None);
        assert_eq!(command(&[1], 5), None);
        assert_eq!(command(&[3, 5], 5), None);
    }
}
