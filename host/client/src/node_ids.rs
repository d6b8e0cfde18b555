//! Node-IDs of all boards of a bus, by layer setting services (LSS, CiA 305): found by a search over their
//! serial numbers, so boards with equal node-IDs are found too.

use std::time::Duration;

use scarab::bus::{Identity, NodeId};
use scarab_base::error::ToolError;

use crate::bus::{HOST, RequestError};
use crate::master::Client;
use crate::other_hosts::{MayBeOn, OtherHosts};

/// Services: state of all nodes, identity of one, its answer, search, its answer, node-ID, store, question.
const STATE: u8 = 0x04;
const SELECT: u8 = 0x40;
const SELECTED: u8 = 0x44;
const SEARCH: u8 = 0x46;
const FOUND: u8 = 0x4F;
const SET: u8 = 0x11;
const STORE: u8 = 0x17;
const NODE_ID: u8 = 0x5E;
/// NMT command: reset of the communication.
const RESET: u8 = 130;
/// Time for an answer, and for those of further boards; a longer one for the flash write.
const ANSWER: Duration = Duration::from_millis(100);
const LATE: Duration = Duration::from_millis(60);
const STORING: Duration = Duration::from_secs(8);
/// All numbers of a range.
const ALL: [u32; 2] = [0, u32::MAX];
/// Searches before no board is found: the first questions may fall into the time in which a controller that
/// was alone on the bus recovers.
const TRIALS: usize = 5;
/// Time for the restart of a node.
const RESTART: Duration = Duration::from_millis(500);

/// A board of the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Board {
    /// Serial number.
    pub serial: u32,
    /// Revision number of its firmware.
    pub(crate) revision: u32,
    /// Node-IDs of hip and knee.
    pub nodes: [u8; 2],
}

/// Search and settings; each question is sent to all nodes of the bus.
pub struct NodeIds {
    client: Client,
    identity: Identity,
}

impl NodeIds {
    /// Uses this connection.
    pub fn new(client: Client) -> Self {
        Self { client, identity: Identity::scarab(0, "") }
    }

    /// Finds all boards, in the order of their serial numbers.
    ///
    /// # Errors
    /// Another host uses the bus, the bus fails, or answers are lost again and again.
    pub fn find(&mut self) -> Result<Vec<Board>, ToolError> {
        OtherHosts::listen(&mut self.client, &[], MayBeOn::No)?;
        let mut is_lost = false;
        for _ in 0..TRIALS {
            if self.is_any(ALL, ALL)? {
                if let Some(serials) = self.serials()? {
                    return serials.into_iter().map(|serial| self.board(serial)).collect();
                }
                is_lost = true;
            }
        }
        if is_lost {
            return Err(ToolError::input(
                "boards answer, but some of their answers are lost; stop other programs on the bus",
            ));
        }
        Ok(Vec::new())
    }

    /// Refuses to set a board whose drive is on or has a host. Nodes with a shared node-ID are not asked:
    /// several boards would answer.
    ///
    /// # Errors
    /// Its drive is on, or another host controls it.
    pub fn check_off(&mut self, serial: u32, boards: &[Board]) -> Result<(), ToolError> {
        let is_shared = |node: &u8| boards.iter().filter(|other| other.nodes.contains(node)).count() > 1;
        let board = boards.iter().filter(|board| board.serial == serial);
        let own: Vec<u8> = board.flat_map(|board| board.nodes).filter(|node| !is_shared(node)).collect();
        if own.is_empty() {
            return Ok(());
        }
        OtherHosts::listen(&mut self.client, &own, MayBeOn::No).map(drop)
    }

    /// Searches all serial numbers by halving; `None` if an answer was lost.
    fn serials(&mut self) -> Result<Option<Vec<u32>>, ToolError> {
        let mut serials = Vec::new();
        let mut ranges = vec![ALL];
        while let Some([low, high]) = ranges.pop() {
            if low == high {
                if !self.is_any(ALL, [low, high])? {
                    return Ok(None);
                }
                serials.push(low);
                continue;
            }
            let middle = low + (high - low) / 2;
            let is_below = self.is_any(ALL, [low, middle])?;
            // One that is not in the lower half is in the upper one; the end of the search checks it.
            if !is_below || self.is_any(ALL, [middle + 1, high])? {
                ranges.push([middle + 1, high]);
            }
            if is_below {
                ranges.push([low, middle]);
            }
        }
        // No board may answer between those found.
        let mut next = Some(0);
        for serial in serials.iter().map(|serial| Some(*serial)).chain([None]) {
            let last = serial.map_or(Some(u32::MAX), |serial| serial.checked_sub(1));
            if let (Some(low), Some(high)) = (next, last)
                && low <= high
                && self.is_any(ALL, [low, high])?
            {
                return Ok(None);
            }
            next = serial.and_then(|serial| serial.checked_add(1));
        }
        Ok(Some(serials))
    }

    /// Gives the board with this serial number other node-IDs, and stores them.
    ///
    /// # Errors
    /// The board refuses, or the bus fails.
    pub fn set(&mut self, board: Board, nodes: [u8; 2]) -> Result<(), ToolError> {
        let Board { serial, nodes: before, .. } = board;
        if let Err(error) = self.give(board, nodes).and_then(|()| self.store(serial)) {
            // Otherwise the next reset would apply them.
            self.give(board, before)?;
            self.wait()?;
            return Err(error);
        }
        self.wait()?;
        // A node-ID that the other node still has is free after that node's reset.
        let order = if nodes[0] == before[1] { [before[1], before[0]] } else { before };
        for node in order {
            self.client.manage(node, RESET).map_err(RequestError::for_bus)?;
            self.client.wait(RESTART).map_err(RequestError::for_bus)?;
        }
        let Board { nodes: found, .. } = self.numbers(board)?;
        if found != nodes {
            return Err(refused(serial, &format!("its node-IDs: they are {} and {}", found[0], found[1])));
        }
        Ok(())
    }

    /// Gives a board node-IDs that are not stored yet; its knee stays selected.
    fn give(&mut self, board: Board, nodes: [u8; 2]) -> Result<(), ToolError> {
        for (joint, number) in nodes.into_iter().enumerate() {
            self.select(joint, board)?;
            match self.ask(&[(SET, u32::from(number))], SET, ANSWER)? {
                Some(answer) if answer as u8 == 0 => {}
                Some(answer) => {
                    return Err(refused(board.serial, &format!("node-ID {number} (error {})", answer as u8)));
                }
                None => return Err(silent(board.serial)),
            }
        }
        Ok(())
    }

    /// Stores by the selected node; the nodes of a board store together.
    fn store(&mut self, serial: u32) -> Result<(), ToolError> {
        match self.ask(&[(STORE, 0)], STORE, STORING)? {
            Some(answer) if answer as u8 == 0 => Ok(()),
            Some(_) => Err(refused(serial, "to store: turn its drive off, and end its inhibit reasons")),
            None => Err(silent(serial)),
        }
    }

    /// Whether a first node with a serial number of this range answers. Silence counts when it is repeated,
    /// and the answers of several boards are awaited: a late one would answer the next question.
    fn is_any(&mut self, revisions: [u32; 2], serials: [u32; 2]) -> Result<bool, ToolError> {
        let Identity { vendor, product, .. } = self.identity;
        let fields = [vendor, product, revisions[0], revisions[1], serials[0], serials[1]];
        let requests: Vec<_> = (SEARCH..).zip(fields).collect();
        for _ in 0..2 {
            if self.ask(&requests, FOUND, ANSWER)?.is_some() {
                self.client.wait(LATE).map_err(RequestError::for_bus)?;
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Finds revision and node-IDs of a board.
    fn board(&mut self, serial: u32) -> Result<Board, ToolError> {
        let own = self.identity.revision;
        let [mut low, mut high] = if self.is_any([own; 2], [serial; 2])? { [own; 2] } else { ALL };
        while low < high {
            let middle = low + (high - low) / 2;
            if self.is_any([low, middle], [serial; 2])? { high = middle } else { low = middle + 1 }
        }
        self.numbers(Board { serial, revision: low, nodes: [0; 2] })
    }

    /// Reads the node-IDs of a board.
    fn numbers(&mut self, board: Board) -> Result<Board, ToolError> {
        let mut nodes = [0; 2];
        for (joint, node) in nodes.iter_mut().enumerate() {
            self.select(joint, board)?;
            let number = self.ask(&[(NODE_ID, 0)], NODE_ID, ANSWER)?;
            *node = number.ok_or_else(|| silent(board.serial))? as u8;
        }
        self.wait()?;
        Ok(Board { nodes, ..board })
    }

    /// Selects a node alone.
    fn select(&mut self, joint: usize, board: Board) -> Result<(), ToolError> {
        self.wait()?;
        let Identity { vendor, product, .. } = self.identity.for_joint(joint);
        let requests: Vec<_> = (SELECT..).zip([vendor, product, board.revision, board.serial]).collect();
        self.ask(&requests, SELECTED, ANSWER)?.map(drop).ok_or_else(|| silent(board.serial))
    }

    /// Returns all nodes to the waiting state.
    fn wait(&mut self) -> Result<(), ToolError> {
        self.ask(&[(STATE, 0)], STATE, Duration::ZERO).map(drop)
    }

    fn ask(&mut self, requests: &[(u8, u32)], answer: u8, time: Duration) -> Result<Option<u32>, ToolError> {
        self.client.lss(requests, answer, time).map_err(RequestError::for_bus)
    }
}

/// Checks wanted node-IDs against those of the other boards.
///
/// # Errors
/// Which node-ID cannot be given, and why.
pub fn check(boards: &[Board], serial: u32, nodes: [u8; 2]) -> Result<Board, String> {
    let Some(board) = boards.iter().find(|board| board.serial == serial) else {
        let known: Vec<_> = boards.iter().map(|board| format!("{:08X}", board.serial)).collect();
        return Err(format!(
            "no board with the serial number {serial:08X} answers; there is {}",
            known.join(", ")
        ));
    };
    let [hip, knee] = board.nodes;
    if nodes == [knee, hip] {
        return Err(format!(
            "{serial:08X}: the node-IDs of one board cannot be exchanged at once; give it two others first"
        ));
    }
    if nodes[0] == nodes[1] {
        return Err(format!("{serial:08X}: both node-IDs are {}", nodes[0]));
    }
    for number in nodes {
        if NodeId::new(number).is_none() {
            return Err(format!("{serial:08X}: node-ID {number} is outside 1 to 127"));
        }
        if number == HOST {
            return Err(format!("{serial:08X}: node-ID {number} is this program's own"));
        }
        if let Some(other) =
            boards.iter().find(|other| other.serial != serial && other.nodes.contains(&number))
        {
            return Err(format!("{serial:08X}: node-ID {number} is that of board {:08X}", other.serial));
        }
    }
    Ok(*board)
}

fn refused(serial: u32, what: &str) -> ToolError {
    ToolError::Refused(format!("board {serial:08X} refuses {what}"))
}

fn silent(serial: u32) -> ToolError {
    ToolError::input(format!("board {serial:08X} no longer answers; run the command again"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn node_ids_of_other_boards_are_refused() {
        let boards = [1, 0xAB].map(|serial| Board { serial, revision: 1, nodes: [1, 2] });
        assert_eq!(check(&boards, 0xAB, [3, 4]), Ok(boards[1]));
        for (serial, nodes, words) in [
            (2, [3, 4], "there is 00000001, 000000AB"),
            (1, [3, 3], "both"),
            (1, [0, 3], "outside"),
            (1, [128, 3], "outside"),
            (1, [112, 3], "own"),
            (0xAB, [2, 3], "of board 00000001"),
            (1, [2, 1], "exchanged"),
        ] {
            let why = check(&boards, serial, nodes).expect_err("refused");
            assert!(why.contains(words), "{why}");
        }
    }
}
