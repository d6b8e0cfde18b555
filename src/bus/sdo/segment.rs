//! SDO segmented transfer: seven bytes per segment, each of them acknowledged.
//!
//! ```text
//! upload    request 011t----                      reply  000tnnnc, 7 bytes
//! download  request 000tnnnc, 7 bytes             reply  001t----
//! ```
//! t alternates, starting with 0; n bytes of the seven are unused; c marks the last segment.

use super::super::abort::Abort;
use super::super::access::Dictionary;
use super::super::dictionary::Object;
use super::super::objects::Objects;
use super::{SEGMENT, Sink, Step, segment};

const TOGGLE: u8 = 1 << 4;

/// Transfer from the object to the client.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SegmentUpload {
    size: u32,
    offset: u32,
    toggle: u8,
}

impl SegmentUpload {
    pub(super) const fn new(size: u32) -> Self {
        Self { size, offset: 0, toggle: 0 }
    }

    pub(super) fn request<O: Objects>(
        &mut self,
        object: Object,
        request: [u8; 8],
        dictionary: &Dictionary<'_, O>,
    ) -> Result<Step, Abort> {
        if request[0] & TOGGLE != self.toggle {
            return Err(Abort::Toggle);
        }
        let (bytes, count, is_last) = segment(object, self.offset, self.size, dictionary)?;
        let command = self.toggle | ((SEGMENT - count) as u8) << 1 | u8::from(is_last);
        let [a, b, c, d, e, f, g] = bytes;
        let answer = [command, a, b, c, d, e, f, g];
        self.offset += count;
        self.toggle ^= TOGGLE;
        Ok(if is_last { Step::End(Some(answer)) } else { Step::Stay(Some(answer)) })
    }
}

/// Transfer from the client to the object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SegmentDownload {
    sink: Sink,
    toggle: u8,
}

impl SegmentDownload {
    pub(super) const fn new(sink: Sink) -> Self {
        Self { sink, toggle: 0 }
    }

    /// Whether another segment does not fit yet.
    pub(super) fn is_full<O: Objects>(&self, dictionary: &Dictionary<'_, O>) -> bool {
        self.sink.is_full(1, dictionary)
    }

    pub(super) fn request<O: Objects>(
        &mut self,
        object: Object,
        request: [u8; 8],
        dictionary: &mut Dictionary<'_, O>,
    ) -> Result<Step, Abort> {
        if request[0] & TOGGLE != self.toggle {
            return Err(Abort::Toggle);
        }
        let count = 7 - usize::from(request[0] >> 1 & 7);
        self.sink.put(request.into_iter().skip(1).take(count), dictionary)?;
        let answer = [0x20 | self.toggle, 0, 0, 0, 0, 0, 0, 0];
        if request[0] & 1 == 0 {
            self.toggle ^= TOGGLE;
            return Ok(Step::Stay(Some(answer)));
        }
        self.sink.end(object, dictionary)?;
        Ok(Step::End(Some(answer)))
    }
}
