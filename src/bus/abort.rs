//! Abort codes of SDO transfers (CiA 301).

/// Reason why an SDO transfer is aborted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Abort {
    /// The toggle bit did not alternate.
    Toggle = 0x0503_0000,
    /// The client sent no further request within one second.
    Timeout = 0x0504_0000,
    /// The command is unknown, or not valid in this phase of the transfer.
    Command = 0x0504_0001,
    /// The block size is 0 or above 127.
    BlockSize = 0x0504_0002,
    /// The client acknowledged a segment number that was never sent.
    Sequence = 0x0504_0003,
    /// The check sum of the block transfer differs.
    Checksum = 0x0504_0004,
    /// Access is not supported now: a PDO's mapping cannot be changed while the PDO exists.
    Access = 0x0601_0000,
    /// The object is write-only.
    WriteOnly = 0x0601_0001,
    /// The object is read-only.
    ReadOnly = 0x0601_0002,
    /// No object has this index.
    NoObject = 0x0602_0000,
    /// The object cannot be mapped into this PDO.
    NotMappable = 0x0604_0041,
    /// The mapped objects exceed the eight bytes of a PDO.
    PdoLength = 0x0604_0042,
    /// Another parameter stands against the value: both consumers (1016) would watch the same node.
    Incompatible = 0x0604_0043,
    /// The value has more bytes than the object.
    TooLong = 0x0607_0012,
    /// The value has fewer bytes than the object.
    TooShort = 0x0607_0013,
    /// The object has no such subindex.
    NoSubindex = 0x0609_0011,
    /// The value is out of the object's range.
    Range = 0x0609_0030,
    /// The upper limit would be below the lower one.
    MaximumBelowMinimum = 0x0609_0036,
    /// The parameters cannot be stored.
    Store = 0x0800_0020,
    /// The state of the device does not allow the access.
    State = 0x0800_0022,
    /// No value is available yet.
    NoData = 0x0800_0024,
}

impl Abort {
    /// Abort code as transmitted.
    pub const fn code(self) -> u32 {
        self as u32
    }
}
