//! The bus as a client sees it: frames and a clock. Behind it is an adapter, a simulated network, or a model
//! of the microcontroller.

use std::time::Duration;

use scarab::bus::{Abort, Frame};
use scarab_base::error::ToolError;

/// Node-ID of this host.
pub(crate) const HOST: u8 = 0x70;
/// Longest value that is read, in bytes.
pub(crate) const MOST_BYTES: usize = 4096;

/// Frames to and from the nodes, and the time that they live in.
pub trait Bus {
    /// Sends a frame.
    ///
    /// # Errors
    /// The bus failed.
    fn send(&mut self, frame: &Frame) -> Result<(), RequestError>;

    /// Receives the next frame; `None` if none comes before [`Bus::now`] is `until`. Frames that have arrived
    /// are returned even if it is later. A simulated bus may keep other frames than answers to itself, and
    /// forget those that were not received before the next one is sent.
    ///
    /// # Errors
    /// The bus failed, or no node can answer any more.
    fn receive(&mut self, until: Duration) -> Result<Option<Frame>, RequestError>;

    /// Time since an instant that does not change.
    fn now(&self) -> Duration;

    /// Times after which a client repeats a request, and gives it up.
    fn patience(&self) -> Patience {
        Patience::REAL
    }
}

/// Times of a request without an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Patience {
    /// Longest wait for the answer.
    pub answer: Duration,
    /// Time after which the request is repeated.
    pub(crate) repeat: Duration,
}

impl Patience {
    /// On a real bus: a board that erases a sector of a new image is silent for up to 2 s.
    pub const REAL: Self = Self { answer: Duration::from_secs(6), repeat: Duration::from_secs(1) };

    /// One request, which must be answered in this time: a simulated bus loses none.
    pub const fn once(answer: Duration) -> Self {
        Self { answer, repeat: answer }
    }
}

impl<B: Bus> Bus for &mut B {
    fn send(&mut self, frame: &Frame) -> Result<(), RequestError> {
        (**self).send(frame)
    }

    fn receive(&mut self, until: Duration) -> Result<Option<Frame>, RequestError> {
        (**self).receive(until)
    }

    fn now(&self) -> Duration {
        (**self).now()
    }

    fn patience(&self) -> Patience {
        (**self).patience()
    }
}

/// Object of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Object(pub u16, pub u8);

/// Why a request failed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RequestError {
    /// The node aborted the transfer with this code.
    Aborted(u32),
    /// The node did not answer within this time.
    Silent(Duration),
    /// The value has no end.
    Endless,
    /// The bus failed, with the next step where the user can take one.
    Failed(String),
}

impl RequestError {
    /// Whether the node aborted for this reason.
    pub fn is(&self, abort: Abort) -> bool {
        *self == Self::Aborted(abort.code())
    }

    /// Error of the bus as a whole.
    pub(crate) fn for_bus(self) -> ToolError {
        match self {
            Self::Failed(why) => ToolError::input(why),
            Self::Silent(_) | Self::Endless | Self::Aborted(_) => ToolError::input("no answer on the bus"),
        }
    }

    /// Error with the node and the object.
    pub(crate) fn for_object(self, node: u8, Object(index, sub): Object) -> ToolError {
        let why = match self {
            Self::Aborted(code) => format!("refused with abort code {code:08X}"),
            Self::Silent(patience) => format!(
                "no answer within {} s: is the board powered, the bit rate right, the bus terminated? `node-ids` lists the boards",
                patience.as_secs_f64()
            ),
            Self::Endless => {
                format!("the value has more than {MOST_BYTES} bytes: this is no node of a Scarab board")
            }
            Self::Failed(_) => return self.for_bus(),
        };
        ToolError::input(format!("node {node}, object {index:04X}:{sub}: {why}"))
    }

    /// Like `Self::for_object`; a node that aborts has refused.
    pub fn refused(self, node: u8, object: Object) -> ToolError {
        match self {
            Self::Aborted(_) => ToolError::Refused(self.for_object(node, object).to_string()),
            error => error.for_object(node, object),
        }
    }
}
