//! Interface to the values of the profile-specific and manufacturer-specific objects.
//!
//! Numbers are passed as 32 bits; only the low bytes of the object's size are valid. An INTEGER16 of -1 may
//! be passed as `0xFFFF`.

use super::abort::Abort;
use super::dictionary::Object;

/// Event after which the host can no longer be relied on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lost {
    /// The heartbeat of a monitored node (1016) timed out.
    Heartbeat,
    /// A received PDO missed its event timer.
    ReceivedPdo,
    /// A cyclic host stopped sending.
    Silent,
    /// `true`: the controller is bus-off, or frames were lost. `false`: the controller is error passive.
    Bus(bool),
    /// The master commanded the node out of Operational.
    Stopped,
    /// The master reset the node or its communication.
    Reset,
}

/// Values of the objects from index 2000 on. The node calls these functions only for objects of the table,
/// with permitted access and values of the right size.
pub trait Objects {
    /// Reads an object.
    ///
    /// # Errors
    /// [`Abort`] if there is no value now.
    fn read(&self, object: Object) -> Result<u32, Abort>;

    /// Writes an object.
    ///
    /// # Errors
    /// [`Abort`] if the value is not accepted.
    fn write(&mut self, object: Object, value: u32) -> Result<(), Abort>;

    /// Writes an object by a received PDO, which a host may repeat without a change.
    ///
    /// # Errors
    /// [`Abort`] if the value is not accepted.
    fn write_mapped(&mut self, object: Object, value: u32) -> Result<(), Abort> {
        self.write(object, value)
    }

    /// Copies the bytes of a text or domain from `offset` on into `into`; returns its total size in bytes.
    /// The content must not change until it has been read to the end.
    ///
    /// # Errors
    /// [`Abort`] if there is no content now.
    fn bytes(&self, object: Object, offset: u32, into: &mut [u8]) -> Result<u32, Abort> {
        let _ = (object, offset, into);
        Err(Abort::NoObject)
    }

    /// Begins to write a domain; `size` is the number of bytes that the host announced.
    ///
    /// # Errors
    /// [`Abort`] if nothing can be written now.
    fn begin_domain(&mut self, object: Object, size: Option<u32>) -> Result<(), Abort> {
        let _ = (object, size);
        Err(Abort::ReadOnly)
    }

    /// Bytes of a domain that can be taken now. The host's next bytes are asked for when there is space.
    fn room(&self) -> usize {
        0
    }

    /// Takes the next byte of a domain.
    ///
    /// # Errors
    /// [`Abort`] if there is no space.
    fn push(&mut self, byte: u8) -> Result<(), Abort> {
        let _ = byte;
        Err(Abort::ReadOnly)
    }

    /// Handles a lost host, a lost bus or a stop command: the drive stops as its option codes say.
    fn lost(&mut self, why: Lost);

    /// Whether a silent host is a fault: a host has enabled the drive.
    fn misses_host(&self) -> bool {
        false
    }

    /// Restores the state after the start, for everything a host has written.
    fn reset(&mut self);

    /// Handles a SYNC. The values of synchronous PDOs have been written before.
    fn synchronise(&mut self) {}

    /// Stores all parameters (1010) or restores the defaults at the next start (1011).
    ///
    /// # Errors
    /// [`Abort::Store`] if the board cannot store, [`Abort::State`] while the drive is enabled.
    fn store(&mut self, defaults: bool) -> Result<(), Abort> {
        let _ = defaults;
        Err(Abort::Store)
    }
}
