//! Node-ID and the COB-IDs derived from it.

/// Node-ID, 1 to 127.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NodeId(u8);

impl NodeId {
    /// Creates a node-ID, or `None` outside 1 to 127.
    pub const fn new(number: u8) -> Option<Self> {
        if matches!(number, 1..=127) { Some(Self(number)) } else { None }
    }

    /// Returns the number.
    pub const fn number(self) -> u8 {
        self.0
    }

    /// Returns a COB-ID of the predefined connection set: function base plus node-ID.
    pub(crate) const fn on(self, base: u16) -> u16 {
        base + self.0 as u16
    }
}
