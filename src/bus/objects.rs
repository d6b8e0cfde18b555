//! What stands behind the dictionary: the values of the profile's and the maker's objects.
//!
//! Numbers cross as 32 bits, the low bytes of which count: an INTEGER16 of -1 is `0xFFFF`, with the upper half ignored.

use super::abort::Abort;
use super::dictionary::Object;
use super::emergency::ErrorReport;

/// Why the host can no longer be relied on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lost {
    /// Its heartbeat (1016).
    Heartbeat,
    /// A PDO that has an event timer.
    ReceivedPdo,
    /// It spoke in every cycle and no longer speaks.
    Silent,
    /// The controller left the bus, or frames were lost (`true`); or it is near leaving it.
    Bus(bool),
    /// The master took the node out of Operational.
    Stopped,
    /// The master had the node, or its communication, begin anew.
    Reset,
}

/// The values from index 2000 on. The node asks only for objects of the table that may be accessed that way, with a
/// value of the right size.
pub trait Objects {
    /// The value of an object.
    ///
    /// # Errors
    /// [`Abort`] where there is none now.
    fn read(&self, object: Object) -> Result<u32, Abort>;

    /// Gives an object a value.
    ///
    /// # Errors
    /// [`Abort`] where it cannot take it.
    fn write(&mut self, object: Object, value: u32) -> Result<(), Abort>;

    /// The bytes of a text from `offset` on, as many as fit into `into`; how many bytes it has in all. It must not change
    /// before it is read to its end.
    ///
    /// # Errors
    /// [`Abort`] where there is none now.
    fn bytes(&self, object: Object, offset: u32, into: &mut [u8]) -> Result<u32, Abort> {
        let _ = (object, offset, into);
        Err(Abort::NoObject)
    }

    /// The error there is now, for an emergency message.
    fn error(&self) -> Option<ErrorReport>;

    /// The host is lost, the bus is, or the node is told to stop: what moves has to stop as its option codes say.
    fn lost(&mut self, why: Lost);

    /// A host that falls silent is missed: the drive is on, by a host.
    fn misses_host(&self) -> bool {
        false
    }

    /// Everything that was written is as after the start again.
    fn reset(&mut self);

    /// A SYNC has come; what it was to bring has been written.
    fn synchronise(&mut self) {}

    /// Keeps all parameters (1010) or returns to the defaults at the next start (1011).
    ///
    /// # Errors
    /// [`Abort::Store`] where nothing can be kept, [`Abort::State`] while the drive is on.
    fn store(&mut self, defaults: bool) -> Result<(), Abort> {
        let _ = defaults;
        Err(Abort::Store)
    }
}
