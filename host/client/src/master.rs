//! CANopen master of a host: network management and SDO transfers over any [`Bus`]. Reads and writes objects
//! of nodes, and keeps their emergency messages.
//!
//! Source: CiA 301, SDO. Values of up to four bytes are transferred at once, longer ones are read in segments
//! and written in blocks.

use std::time::Duration;

use crc::{CRC_16_XMODEM, Crc};
use scarab::bus::Frame;
use scarab_base::error::ToolError;
use scarab_base::output::printable;

use crate::adapter::{Adapter, AdapterBus};
use crate::bus::{Bus, MOST_BYTES, Object, RequestError};

/// Number of identifiers.
const IDENTIFIERS: usize = 0x800;
/// Blocks in a row of which a node takes nothing.
const MOST_VAIN: u32 = 8;
/// Bytes of a segment.
const SEGMENT: usize = 7;
const REQUEST: u16 = 0x600;
const ANSWER: u16 = 0x580;
const EMERGENCY: u16 = 0x80;
/// COB-IDs of the layer setting services.
const LSS: [u16; 2] = [0x7E5, 0x7E4];

/// Emergency message of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Emergency {
    /// Node-ID.
    pub(crate) node: u8,
    /// Error code; 0 when the error has ended.
    pub(crate) code: u16,
    /// Bytes behind the error register; those of a short message are 0.
    pub(crate) information: [u8; 5],
}

/// Connection to the nodes of a bus.
pub struct Client<B = AdapterBus> {
    bus: B,
    emergencies: Vec<Emergency>,
    /// Identifiers that were received; an adapter does not return this client's own frames.
    heard: Box<[bool; IDENTIFIERS]>,
}

impl Client {
    /// Takes over an adapter with an open channel.
    ///
    /// # Errors
    /// Those of the operating system.
    pub fn new(adapter: Adapter) -> Result<Self, ToolError> {
        AdapterBus::new(adapter).map(Self::over)
    }

    /// Sends heartbeats as long as this client exists ([`AdapterBus::begin_heartbeats`]).
    pub(crate) fn begin_heartbeats(&self) {
        self.bus.begin_heartbeats();
    }
}

impl<B: Bus> Client<B> {
    /// Takes over a bus.
    pub fn over(bus: B) -> Self {
        Self { bus, emergencies: Vec::new(), heard: Box::new([false; IDENTIFIERS]) }
    }

    /// Present time of the bus.
    pub(crate) fn now(&self) -> Duration {
        self.bus.now()
    }

    /// Whether a frame with this identifier was received.
    pub(crate) fn has_heard(&self, identifier: u16) -> bool {
        self.heard.get(usize::from(identifier)).is_some_and(|heard| *heard)
    }

    /// Sends a frame.
    ///
    /// # Errors
    /// The bus failed, or no node can answer any more.
    pub(crate) fn send(&mut self, frame: &Frame) -> Result<(), RequestError> {
        self.bus.send(frame)
    }

    /// Receives frames for a time, or until one is wanted.
    fn receive(
        &mut self,
        until: Duration,
        wanted: impl Fn(&Frame) -> bool,
    ) -> Result<Option<Frame>, RequestError> {
        loop {
            let Some(frame) = self.bus.receive(until)? else { return Ok(None) };
            if let Some(heard) = self.heard.get_mut(usize::from(frame.id())) {
                *heard = true;
            }
            if let (0x81..=0xFF, [low, high, rest @ ..]) = (frame.id(), frame.data()) {
                let mut information = [0; 5];
                for (to, from) in information.iter_mut().zip(rest.iter().skip(1)) {
                    *to = *from;
                }
                let (node, code) = ((frame.id() - EMERGENCY) as u8, u16::from_le_bytes([*low, *high]));
                self.emergencies.push(Emergency { node, code, information });
            }
            if wanted(&frame) {
                return Ok(Some(frame));
            }
        }
    }

    /// Waits, and keeps emergency messages.
    ///
    /// # Errors
    /// The bus failed, or no node can answer any more.
    pub(crate) fn wait(&mut self, time: Duration) -> Result<(), RequestError> {
        self.receive(self.now() + time, |_| false).map(drop)
    }

    /// Takes the emergency messages since the last call.
    pub(crate) fn take_emergencies(&mut self) -> Vec<Emergency> {
        std::mem::take(&mut self.emergencies)
    }

    /// Sends a request, repeatedly if it is not answered.
    fn ask(&mut self, node: u8, request: [u8; 8], object: Option<Object>) -> Result<[u8; 8], RequestError> {
        // A late answer to an earlier request.
        self.receive(self.now(), |_| false)?;
        let patience = self.bus.patience();
        let end = self.now() + patience.answer;
        while self.now() < end {
            self.send(&Frame::new(REQUEST + u16::from(node), &request))?;
            let answers = |frame: &Frame| {
                let data = frame.data();
                let named = |Object(index, sub): Object| {
                    data.get(1..4) == Some(&[index as u8, (index >> 8) as u8, sub])
                };
                // An abort, or the answer to this kind of request: segment, upload, download.
                let kind = data.first().map(|command| command >> 5);
                let expected = match request[0] >> 5 {
                    3 => 0,
                    2 => 2,
                    6 => 5,
                    _ => 3,
                };
                let answers = kind == Some(4) || kind == Some(expected);
                frame.id() == ANSWER + u16::from(node)
                    && data.len() == 8
                    && answers
                    && object.is_none_or(named)
            };
            let Some(frame) = self.receive(end.min(self.now() + patience.repeat), answers)? else { continue };
            let Ok(data) = <[u8; 8]>::try_from(frame.data()) else { continue };
            if data[0] == 0x80 {
                let [.., a, b, c, d] = data;
                return Err(RequestError::Aborted(u32::from_le_bytes([a, b, c, d])));
            }
            return Ok(data);
        }
        Err(RequestError::Silent(patience.answer))
    }

    /// Sends requests of the layer setting services, each a service and its number, and waits for an answer
    /// with the service `answer`: its number, or `None` if no node answers in time.
    ///
    /// # Errors
    /// The bus failed, or no node can answer any more.
    pub(crate) fn lss(
        &mut self,
        requests: &[(u8, u32)],
        answer: u8,
        time: Duration,
    ) -> Result<Option<u32>, RequestError> {
        self.receive(self.now(), |_| false)?;
        let [to, from] = LSS;
        for (service, number) in requests {
            let [a, b, c, d] = number.to_le_bytes();
            self.send(&Frame::new(to, &[*service, a, b, c, d, 0, 0, 0]))?;
        }
        let answers = |frame: &Frame| frame.id() == from && frame.data().first() == Some(&answer);
        let found = self.receive(self.now() + time, answers)?;
        Ok(found.and_then(|frame| {
            let number = frame.data().get(1..5)?.try_into().ok()?;
            Some(u32::from_le_bytes(number))
        }))
    }

    /// Sends a network management command to a node.
    ///
    /// # Errors
    /// The bus failed, or no node can answer any more.
    pub(crate) fn manage(&mut self, node: u8, command: u8) -> Result<(), RequestError> {
        self.send(&Frame::new(0, &[command, node]))
    }

    /// Reads the bytes of an object.
    ///
    /// # Errors
    /// The node refuses or is silent.
    pub fn bytes(&mut self, node: u8, object: Object) -> Result<Vec<u8>, RequestError> {
        let Object(index, sub) = object;
        let [low, high] = index.to_le_bytes();
        let [command, _, _, _, value @ ..] =
            self.ask(node, [0x40, low, high, sub, 0, 0, 0, 0], Some(object))?;
        if command & 2 != 0 {
            let unused = if command & 1 == 0 { 0 } else { usize::from(command >> 2 & 3) };
            return Ok(value[..4 - unused].to_vec());
        }
        let mut bytes = Vec::new();
        for toggle in [0, 0x10].into_iter().cycle() {
            let [command, part @ ..] = self.ask(node, [0x60 | toggle, 0, 0, 0, 0, 0, 0, 0], None)?;
            let unused = usize::from(command >> 1 & 7);
            bytes.extend_from_slice(&part[..7 - unused.min(7)]);
            if command & 1 != 0 {
                break;
            }
            if bytes.len() > MOST_BYTES {
                return Err(RequestError::Endless);
            }
        }
        Ok(bytes)
    }

    /// Reads a number of at most four bytes; it is not sign-extended.
    ///
    /// # Errors
    /// The node refuses or is silent.
    pub fn try_read(&mut self, node: u8, object: Object) -> Result<u32, RequestError> {
        let bytes = self.bytes(node, object)?;
        Ok(bytes.iter().take(4).rev().fold(0, |value, byte| value << 8 | u32::from(*byte)))
    }

    /// Reads a number of at most four bytes; it is not sign-extended.
    ///
    /// # Errors
    /// The node refuses or is silent.
    pub fn read(&mut self, node: u8, object: Object) -> Result<u32, ToolError> {
        self.try_read(node, object).map_err(|error| error.for_object(node, object))
    }

    /// Reads a REAL32; unknown values are NaN.
    ///
    /// # Errors
    /// The node refuses or is silent.
    pub(crate) fn real(&mut self, node: u8, object: Object) -> Result<f64, ToolError> {
        self.read(node, object).map(|bits| f64::from(f32::from_bits(bits)))
    }

    /// Reads a text; its control characters are escaped.
    ///
    /// # Errors
    /// The node refuses or is silent.
    pub fn text(&mut self, node: u8, object: Object) -> Result<String, ToolError> {
        let bytes = self.bytes(node, object).map_err(|error| error.for_object(node, object))?;
        Ok(printable(&String::from_utf8_lossy(&bytes)))
    }

    /// Writes bytes by block transfer; `progress` is called with the bus and the number that has arrived.
    ///
    /// # Errors
    /// The node refuses or is silent.
    pub fn download(
        &mut self,
        node: u8,
        object: Object,
        bytes: &[u8],
        mut progress: impl FnMut(&B, usize),
    ) -> Result<(), RequestError> {
        let Object(index, sub) = object;
        let ([low, high], [a, b, c, d]) = (index.to_le_bytes(), (bytes.len() as u32).to_le_bytes());
        let begin = self.ask(node, [0xC6, low, high, sub, a, b, c, d], Some(object))?;
        let (mut offset, mut block) = (0, usize::from(begin[4]).clamp(1, 127));
        let mut vain = 0;
        while offset < bytes.len() {
            let end = bytes.len().min(offset + SEGMENT * block);
            for (number, segment) in (1..).zip(bytes[offset..end].chunks(SEGMENT)) {
                let is_last = offset + SEGMENT * usize::from(number) >= bytes.len();
                let mut data = [0; 8];
                data[0] = number | u8::from(is_last) << 7;
                data[1..=segment.len()].copy_from_slice(segment);
                self.send(&Frame::new(REQUEST + u16::from(node), &data))?;
            }
            let patience = self.bus.patience().answer;
            let until = self.now() + patience;
            let Some(frame) = self.receive(until, |frame| {
                frame.id() == ANSWER + u16::from(node) && matches!(frame.data().first(), Some(0x80 | 0xA2))
            })?
            else {
                return Err(RequestError::Silent(patience));
            };
            match *frame.data() {
                [0xA2, taken, next, ..] => {
                    vain = if taken == 0 { vain + 1 } else { 0 };
                    if vain > MOST_VAIN {
                        return Err(RequestError::Silent(patience));
                    }
                    // The node asks for the segments after a lost one again.
                    offset = end.min(offset + SEGMENT * usize::from(taken));
                    block = usize::from(next).clamp(1, 127);
                }
                [.., a, b, c, d] => return Err(RequestError::Aborted(u32::from_le_bytes([a, b, c, d]))),
                _ => return Err(RequestError::Silent(patience)),
            }
            progress(&self.bus, offset);
        }
        let unused = (bytes.len().next_multiple_of(SEGMENT) - bytes.len()) as u8;
        let [low, high] = Crc::<u16>::new(&CRC_16_XMODEM).checksum(bytes).to_le_bytes();
        self.ask(node, [0xC1 | unused << 2, low, high, 0, 0, 0, 0, 0], None).map(drop)
    }

    /// Writes a number of `size` bytes.
    ///
    /// # Errors
    /// The node refuses or is silent.
    pub fn try_write(&mut self, node: u8, object: Object, value: u32, size: u8) -> Result<(), RequestError> {
        let Object(index, sub) = object;
        let ([low, high], [a, b, c, d]) = (index.to_le_bytes(), value.to_le_bytes());
        let request = [0x23 | (4 - size.min(4)) << 2, low, high, sub, a, b, c, d];
        self.ask(node, request, Some(object)).map(drop)
    }

    /// Writes a number of `size` bytes.
    ///
    /// # Errors
    /// The node refuses or is silent.
    pub fn write(&mut self, node: u8, object: Object, value: u32, size: u8) -> Result<(), ToolError> {
        self.try_write(node, object, value, size).map_err(|error| error.for_object(node, object))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bus::Patience;

    /// Node that accepts a block transfer and takes none of its segments.
    struct TakesNothing {
        blocks: u32,
        answer: Option<Frame>,
        now: Duration,
    }

    impl Bus for TakesNothing {
        fn send(&mut self, frame: &Frame) -> Result<(), RequestError> {
            let answer = |data: [u8; 8]| Some(Frame::new(ANSWER + 3, &data));
            match frame.data() {
                [0xC6, ..] => self.answer = answer([0xA4, 0x50, 0x1F, 1, 2, 0, 0, 0]),
                [2, ..] => {
                    self.blocks += 1;
                    self.answer = answer([0xA2, 0, 2, 0, 0, 0, 0, 0]);
                }
                _ => {}
            }
            Ok(())
        }

        fn receive(&mut self, until: Duration) -> Result<Option<Frame>, RequestError> {
            let answer = self.answer.take();
            if answer.is_none() {
                self.now = until;
            }
            Ok(answer)
        }

        fn now(&self) -> Duration {
            self.now
        }
    }

    #[test]
    fn a_download_is_given_up_where_the_node_takes_no_segment() {
        let mut client = Client::over(TakesNothing { blocks: 0, answer: None, now: Duration::ZERO });
        let result = client.download(3, Object(0x1F50, 1), &[0; 100], |_, taken| assert_eq!(taken, 0));
        assert_eq!(result, Err(RequestError::Silent(Patience::REAL.answer)));
        assert_eq!(client.bus.blocks, MOST_VAIN + 1);
    }
}
