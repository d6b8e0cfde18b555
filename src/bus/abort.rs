//! Why an SDO transfer is broken off: the codes of CiA 301, and no others.

/// An abort code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Abort {
    /// The toggle bit did not alternate.
    Toggle = 0x0503_0000,
    /// The client did not go on within a second.
    Timeout = 0x0504_0000,
    /// A command that does not exist or does not belong here.
    Command = 0x0504_0001,
    /// A block size of 0 or beyond 127.
    BlockSize = 0x0504_0002,
    /// A block's segment number that was never sent.
    Sequence = 0x0504_0003,
    /// The block transfer's check sum is another one.
    Checksum = 0x0504_0004,
    /// Cannot be accessed like that: a PDO's mapping while the PDO exists.
    Access = 0x0601_0000,
    /// Can only be written.
    WriteOnly = 0x0601_0001,
    /// Can only be read.
    ReadOnly = 0x0601_0002,
    /// There is no such object.
    NoObject = 0x0602_0000,
    /// Cannot be mapped into this PDO.
    NotMappable = 0x0604_0041,
    /// More than the eight bytes of a PDO.
    PdoLength = 0x0604_0042,
    /// More bytes than the object has.
    TooLong = 0x0607_0012,
    /// Fewer bytes than the object has.
    TooShort = 0x0607_0013,
    /// The object has no such subindex.
    NoSubindex = 0x0609_0011,
    /// A value the object cannot take.
    Range = 0x0609_0030,
    /// Cannot be kept.
    Store = 0x0800_0020,
    /// Not in this state of the device.
    State = 0x0800_0022,
    /// There is nothing to be read yet.
    NoData = 0x0800_0024,
}

impl Abort {
    /// The code on the bus.
    #[must_use]
    pub const fn code(self) -> u32 {
        self as u32
    }
}
