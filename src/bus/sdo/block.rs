//! SDO block transfer: up to 127 segments per acknowledgement, and a check sum over all of them.
//!
//! ```text
//! upload    10100c00 object, block size, threshold        reply  11000c1s object, size
//!           10100011                                      then   c0nnnnnn and 7 bytes, numbered from 1
//!           10100010 last number accepted, block size     then   the segments after that number
//!           10100001                                      after  110nnn01 check sum
//! download  11000cs0 object, size                         reply  10100c00 object, block size
//!           c0nnnnnn and 7 bytes                          reply  10100010 last number in order, block size
//!           110nnn01 check sum                            reply  10100001
//! ```
//! In a segment, c marks the last and nnnnnn is its number. In 110nnn01, nnn bytes of the last are unused.
//!
//! Check sum: x^16 + x^12 + x^5 + 1 from 0 (CRC-16/XMODEM of the catalogue), by the crate `crc` without a
//! table. Cost: 7 bytes of CRC per segment. If the client lost segments, up to 889 bytes are read and summed
//! again at once.

use crc::{CRC_16_XMODEM, Crc, NoTable};

use super::super::abort::Abort;
use super::super::access::Dictionary;
use super::super::dictionary::Object;
use super::super::objects::Objects;
use super::{SEGMENT, Sink, Step, Transfer, answer, named, segment, upload};

const CODE: Crc<u16, NoTable> = Crc::<u16, NoTable>::new(&CRC_16_XMODEM);
/// Largest block, in segments.
pub(super) const LARGEST: u8 = 127;
const WITH_CHECKSUM: u8 = 1 << 2;
const WITH_SIZE: u8 = 1 << 1;

fn sum(before: u16, bytes: &[u8]) -> u16 {
    let mut digest = CODE.digest_with_initial(before);
    digest.update(bytes);
    digest.finalize()
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    /// Waits for the client's start command.
    Begin,
    /// Sends the segments of a block.
    Sending,
    /// Waits for the acknowledgement of the block.
    Sent,
    /// Waits for the client's confirmation of the end.
    Ended,
}

/// Transfer from the object to the client.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BlockUpload {
    phase: Phase,
    size: u32,
    /// Offset of the block; everything before it is acknowledged.
    start: u32,
    /// Segments of the block sent so far.
    sent: u8,
    block: u8,
    checked: bool,
    /// Check sums of the bytes before the block and before the next segment.
    sums: [u16; 2],
}

impl BlockUpload {
    pub(super) fn begin<O: Objects>(
        object: Object,
        request: [u8; 8],
        dictionary: &Dictionary<'_, O>,
    ) -> Result<Step, Abort> {
        let (_, [block, threshold, _, _]) = named(request);
        let size = dictionary.bytes(object, 0, &mut [])?;
        if size == 0 {
            return Err(Abort::NoData);
        }
        if !(1..=LARGEST).contains(&block) {
            return Err(Abort::BlockSize);
        }
        // The client prefers an expedited or segmented transfer for this size.
        if size <= u32::from(threshold) {
            return upload(object, dictionary);
        }
        let checked = request[0] & WITH_CHECKSUM != 0;
        let this = Self { phase: Phase::Begin, size, start: 0, sent: 0, block, checked, sums: [0; 2] };
        let reply = answer(0xC0 | WITH_CHECKSUM | WITH_SIZE, object, size);
        Ok(Step::Begin(Transfer::BlockUpload(this), reply))
    }

    pub(super) fn request<O: Objects>(
        &mut self,
        object: Object,
        request: [u8; 8],
        dictionary: &Dictionary<'_, O>,
    ) -> Result<Step, Abort> {
        let [command, taken, block, ..] = request;
        match (command & 3, self.phase) {
            (3, Phase::Begin) => self.phase = Phase::Sending,
            (2, Phase::Sending | Phase::Sent) => {
                if taken > self.sent {
                    return Err(Abort::Sequence);
                }
                if !(1..=LARGEST).contains(&block) {
                    return Err(Abort::BlockSize);
                }
                self.go_on_after(taken, object, dictionary)?;
                self.block = block;
            }
            (1, Phase::Ended) => return Ok(Step::End(None)),
            _ => return Err(Abort::Command),
        }
        if self.phase == Phase::Ended {
            let unused = (SEGMENT - 1 - (self.size - 1) % SEGMENT) as u8;
            let [low, high] = if self.checked { self.sums[0].to_le_bytes() } else { [0; 2] };
            let end = [0xC1 | unused << 2, low, high, 0, 0, 0, 0, 0];
            return Ok(Step::Stay(Some(end)));
        }
        Ok(Step::Stay(None))
    }

    /// Continues after `taken` acknowledged segments of the block; the others are sent again.
    fn go_on_after<O: Objects>(
        &mut self,
        taken: u8,
        object: Object,
        dictionary: &Dictionary<'_, O>,
    ) -> Result<(), Abort> {
        if taken != self.sent {
            self.sums[1] = self.sums[0];
            for number in 0..u32::from(taken) {
                let (bytes, count, _) =
                    segment(object, self.start + SEGMENT * number, self.size, dictionary)?;
                self.sums[1] = sum(self.sums[1], bytes.get(..count as usize).unwrap_or(&bytes));
            }
        }
        self.start = (self.start + SEGMENT * u32::from(taken)).min(self.size);
        self.sums[0] = self.sums[1];
        self.sent = 0;
        self.phase = if self.start == self.size { Phase::Ended } else { Phase::Sending };
        Ok(())
    }

    /// Returns the next segment of the block.
    pub(super) fn poll<O: Objects>(
        &mut self,
        object: Object,
        dictionary: &Dictionary<'_, O>,
    ) -> Result<Option<[u8; 8]>, Abort> {
        if self.phase != Phase::Sending {
            return Ok(None);
        }
        let offset = self.start + SEGMENT * u32::from(self.sent);
        let (bytes, count, is_last) = segment(object, offset, self.size, dictionary)?;
        self.sums[1] = sum(self.sums[1], bytes.get(..count as usize).unwrap_or(&bytes));
        self.sent += 1;
        if is_last || self.sent == self.block {
            self.phase = Phase::Sent;
        }
        let [a, b, c, d, e, f, g] = bytes;
        Ok(Some([self.sent | u8::from(is_last) << 7, a, b, c, d, e, f, g]))
    }
}

/// Transfer from the client to the object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BlockDownload {
    sink: Sink,
    /// Number of the last segment received in order.
    taken: u8,
    /// Number of all segments received in order, wrapping.
    received: u8,
    /// Newest segment. Only the end message says how many of its bytes are valid.
    held: Option<[u8; 7]>,
    is_last: bool,
    checked: bool,
    sum: u16,
}

impl BlockDownload {
    pub(super) fn begin<O: Objects>(
        object: Object,
        request: [u8; 8],
        dictionary: &mut Dictionary<'_, O>,
    ) -> Result<Step, Abort> {
        let size = u32::from_le_bytes(named(request).1);
        let sink = Sink::new(object, (request[0] & WITH_SIZE != 0).then_some(size), dictionary)?;
        let checked = request[0] & WITH_CHECKSUM != 0;
        let this = Self { sink, taken: 0, received: 0, held: None, is_last: false, checked, sum: 0 };
        let reply = answer(0xA0 | WITH_CHECKSUM, object, u32::from(sink.block()));
        Ok(Step::Begin(Transfer::BlockDownload(this), reply))
    }

    pub(super) fn request<O: Objects>(
        &mut self,
        object: Object,
        request: [u8; 8],
        dictionary: &mut Dictionary<'_, O>,
    ) -> Result<Step, Abort> {
        let [command, bytes @ ..] = request;
        if self.is_last {
            return self.end(object, request, dictionary);
        }
        let (number, is_last) = (command & 0x7F, command & 0x80 != 0);
        if number == self.taken + 1 {
            self.let_go(7, dictionary)?;
            (self.held, self.taken, self.is_last) = (Some(bytes), number, is_last);
            self.received = self.received.wrapping_add(1);
        }
        let block = self.sink.block();
        if !is_last && number != block {
            return Ok(Step::Stay(None));
        }
        let reply = [0xA2, self.taken, block, 0, 0, 0, 0, 0];
        self.taken = 0;
        Ok(Step::Stay(Some(reply)))
    }

    /// Number of segments received in order, wrapping.
    pub(super) const fn received(&self) -> u8 {
        self.received
    }

    /// Takes over the first `count` bytes of the held segment.
    fn let_go<O: Objects>(&mut self, count: usize, dictionary: &mut Dictionary<'_, O>) -> Result<(), Abort> {
        let Some(bytes) = self.held.take() else { return Ok(()) };
        self.sum = sum(self.sum, bytes.get(..count).unwrap_or(&bytes));
        self.sink.put(bytes.into_iter().take(count), dictionary)
    }

    /// Whether a block more does not fit yet.
    pub(super) fn is_full<O: Objects>(&self, dictionary: &Dictionary<'_, O>) -> bool {
        self.sink.is_full(self.sink.block(), dictionary)
    }

    fn end<O: Objects>(
        &mut self,
        object: Object,
        request: [u8; 8],
        dictionary: &mut Dictionary<'_, O>,
    ) -> Result<Step, Abort> {
        let [command, low, high, ..] = request;
        if command & 0b1110_0011 != 0xC1 {
            return Err(Abort::Command);
        }
        self.let_go(7 - usize::from(command >> 2 & 7).min(7), dictionary)?;
        if self.checked && self.sum != u16::from_le_bytes([low, high]) {
            return Err(Abort::Checksum);
        }
        self.sink.end(object, dictionary)?;
        Ok(Step::End(Some([0xA1, 0, 0, 0, 0, 0, 0, 0])))
    }
}
