//! Sources of a live picture: each reports what it sees while it runs, paced to the clock.
//!
//! | part | content |
//! | --- | --- |
//! | `clock`, `picture` | pace; samples, rows and estimates from logged samples |
//! | `simulated` | a simulated leg that identifies itself |
//! | `playback` | a recording, played back |
//! | `bus` | legs on a CANopen bus, from the frames of a silent listener |
//! | `traced` | the trace of a board, as it arrives or from a file |

pub(crate) mod bus;
pub(crate) mod clock;
pub(crate) mod picture;
pub(crate) mod playback;
pub mod report;
pub(crate) mod simulated;
pub(crate) mod traced;
