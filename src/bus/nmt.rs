//! Network management: the node's state, the commands that move it, and the message of its start.
//!
//! ```text
//! start -> boot-up message -> PreOperational <--> Operational      SDO in both, PDO in Operational only,
//!                                   ^--> Stopped <--^              nothing but heartbeat and commands in Stopped
//! reset node, reset communication: from everywhere back to the start
//! ```
//!
//! Source: CiA 301, network management.

/// Identifier of commands.
pub const COMMAND: u16 = 0x000;
/// Identifier of boot-up and heartbeat, the node's number to be added.
pub const HEARTBEAT: u16 = 0x700;

/// What the node takes part in; the number is the heartbeat's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum NmtState {
    /// Before the boot-up message.
    Initialising = 0,
    /// Heartbeat only.
    Stopped = 4,
    /// All.
    Operational = 5,
    /// All but PDO.
    PreOperational = 127,
}

impl NmtState {
    /// Whether SDO is served.
    #[must_use]
    pub const fn serves(self) -> bool {
        matches!(self, Self::Operational | Self::PreOperational)
    }
}

/// What a master commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// Go to a state.
    Go(NmtState),
    /// Begin anew.
    Reset(Reset),
}

/// How much begins anew.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Reset {
    /// The objects up to 1FFF, and the node's number.
    Communication,
    /// All objects.
    Node,
}

/// The command in a frame's bytes, if it is one for this node.
#[must_use]
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
    fn a_command_counts_for_its_node_and_for_all() {
        let start = Some(Command::Go(NmtState::Operational));
        assert_eq!(command(&[1, 5], 5), start);
        assert_eq!(command(&[1, 0], 5), start);
        assert_eq!(command(&[1, 6], 5), None);
        assert_eq!(command(&[1], 5), None);
        assert_eq!(command(&[3, 5], 5), None);
    }
}
