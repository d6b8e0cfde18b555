//! SDO server: a client reads or writes any object by expedited, segmented or block transfer.
//!
//! Why three ways: four bytes fit into one exchange. Longer values need segments, each of them acknowledged.
//! A log of hundreds of kilobytes needs blocks of up to 127 segments with one acknowledgement. Nothing is
//! buffered: an upload reads the object seven bytes at a time, a download collects one number or passes the
//! bytes of a domain on. While a domain has no space, the answer that asks for more waits.
//!
//! One transfer at a time; a new request ends the old one. If the client is silent for a second, the server
//! aborts with 0504 0000. [`Server::poll`] returns the answers. Source: CiA 301, SDO.

mod block;
mod segment;

use super::abort::Abort;
use super::access::Dictionary;
use super::dictionary::{Object, Row, Type};
use super::objects::Objects;
use super::program;
use block::{BlockDownload, BlockUpload};
use segment::{SegmentDownload, SegmentUpload};

/// Timeout of a client, us.
pub(crate) const TIMEOUT_US: u64 = 1_000_000;

/// Bytes of a segment.
const SEGMENT: u32 = 7;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Transfer {
    Upload(SegmentUpload),
    Download(SegmentDownload),
    BlockUpload(BlockUpload),
    BlockDownload(BlockDownload),
}

/// Result of a request.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Step {
    /// Starts a transfer, with its first answer.
    Begin(Transfer, [u8; 8]),
    /// Continues the active transfer, with an answer if one is due.
    Stay(Option<[u8; 8]>),
    /// Ends the transfer, with the last answer if the client expects one.
    End(Option<[u8; 8]>),
}

/// SDO server of one node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Server {
    object: Object,
    transfer: Option<Transfer>,
    due_us: u64,
    answer: Option<[u8; 8]>,
}

/// First four bytes of most answers.
const fn head(command: u8, object: Object) -> [u8; 4] {
    let [low, high] = object.index.to_le_bytes();
    [command, low, high, object.sub]
}

/// Complete answer with a 32-bit value.
const fn answer(command: u8, object: Object, value: u32) -> [u8; 8] {
    let [a, b, c, d] = head(command, object);
    let [e, f, g, h] = value.to_le_bytes();
    [a, b, c, d, e, f, g, h]
}

const fn aborted(object: Object, abort: Abort) -> [u8; 8] {
    answer(0x80, object, abort.code())
}

/// Object named by a request, and the request's last four bytes.
const fn named(request: [u8; 8]) -> (Object, [u8; 4]) {
    let [_, low, high, sub, a, b, c, d] = request;
    (Object::at(u16::from_le_bytes([low, high]), sub), [a, b, c, d])
}

/// Seven bytes of an object from `offset` on, the number of valid ones, and whether they are the last.
///
/// # Errors
/// [`Abort::State`] if the size has changed since the transfer began, or `offset` is beyond the end.
fn segment<O: Objects>(
    object: Object,
    offset: u32,
    size: u32,
    dictionary: &Dictionary<'_, O>,
) -> Result<([u8; 7], u32, bool), Abort> {
    let mut bytes = [0; 7];
    let now = dictionary.bytes(object, offset, &mut bytes)?;
    // The object was changed during the transfer.
    if now != size || offset >= size {
        return Err(Abort::State);
    }
    let count = (size - offset).min(SEGMENT);
    Ok((bytes, count, offset + count == size))
}

/// Destination of a download: a number that is gathered, or a domain that takes its bytes at once.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Sink {
    Number(Gathered),
    Domain,
}

impl Sink {
    /// Prepares for an object; `declared` is the size stated by the client.
    fn new<O: Objects>(
        object: Object,
        declared: Option<u32>,
        dictionary: &mut Dictionary<'_, O>,
    ) -> Result<Self, Abort> {
        let row = dictionary.writable(object)?;
        if row.kind == Type::Domain {
            dictionary.objects.begin_domain(object, declared)?;
            return Ok(Self::Domain);
        }
        Gathered::new(row, declared).map(Self::Number)
    }

    /// Block size that is announced to the client, in segments.
    const fn block(&self) -> u8 {
        match self {
            Self::Number(_) => block::LARGEST,
            Self::Domain => program::BLOCK,
        }
    }

    /// Takes the next bytes.
    fn put<O: Objects>(
        &mut self,
        mut bytes: impl Iterator<Item = u8>,
        dictionary: &mut Dictionary<'_, O>,
    ) -> Result<(), Abort> {
        match self {
            Self::Number(gathered) => gathered.put(bytes),
            Self::Domain => bytes.try_for_each(|byte| dictionary.objects.push(byte)),
        }
    }

    /// Ends the download: a number is written.
    fn end<O: Objects>(&self, object: Object, dictionary: &mut Dictionary<'_, O>) -> Result<(), Abort> {
        match self {
            Self::Number(gathered) => dictionary.write(object, gathered.value()?),
            Self::Domain => Ok(()),
        }
    }

    /// Whether the answer that asks for the next segments, so many, must wait.
    fn is_full<O: Objects>(&self, segments: u8, dictionary: &Dictionary<'_, O>) -> bool {
        // One more: the last segment is held back until its length is known.
        let bytes = SEGMENT as usize * (usize::from(segments) + 1);
        *self == Self::Domain && dictionary.objects.room() < bytes
    }
}

/// A number received piece by piece.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Gathered {
    bytes: [u8; 4],
    count: u8,
    size: u8,
}

impl Gathered {
    /// Prepares for the number of a row; `declared` is the size stated by the client.
    fn new(row: &Row, declared: Option<u32>) -> Result<Self, Abort> {
        let size = row.kind.size().ok_or(Abort::ReadOnly)?;
        match declared {
            // Host software writes another maker's INTEGER32 to 2120:0. The write has no effect.
            _ if (row.index, row.sub) == (0x2120, 0) => Ok(Self { bytes: [0; 4], count: 0, size }),
            Some(declared) if declared > u32::from(size) => Err(Abort::TooLong),
            Some(declared) if declared < u32::from(size) => Err(Abort::TooShort),
            _ => Ok(Self { bytes: [0; 4], count: 0, size }),
        }
    }

    fn put(&mut self, bytes: impl Iterator<Item = u8>) -> Result<(), Abort> {
        for byte in bytes {
            if self.count >= self.size {
                return Err(Abort::TooLong);
            }
            *self.bytes.get_mut(usize::from(self.count)).ok_or(Abort::TooLong)? = byte;
            self.count += 1;
        }
        Ok(())
    }

    fn value(&self) -> Result<u32, Abort> {
        if self.count == self.size { Ok(u32::from_le_bytes(self.bytes)) } else { Err(Abort::TooShort) }
    }
}

impl Server {
    /// No transfer active.
    pub(crate) const IDLE: Self = Self { object: Object::at(0, 0), transfer: None, due_us: 0, answer: None };

    /// Handles a request of the client.
    pub(crate) fn request<O: Objects>(
        &mut self,
        request: [u8; 8],
        now_us: u64,
        dictionary: &mut Dictionary<'_, O>,
    ) {
        let due_us = core::mem::replace(&mut self.due_us, now_us + TIMEOUT_US);
        // In a block download the first byte is a segment number, except for 0x80 (abort).
        if request[0] == 0x80 {
            (self.transfer, self.answer) = (None, None);
            return;
        }
        let command = request[0] >> 5;
        let step = match (self.transfer.as_mut(), command) {
            (Some(Transfer::BlockDownload(block)), _) => {
                let received = block.received();
                let step = block.request(self.object, request, dictionary);
                // Whatever a new host asks for counts as a segment; it must not keep the transfer of the one
                // before alive.
                if matches!(step, Ok(Step::Stay(_))) && block.received() == received {
                    self.due_us = due_us;
                }
                step
            }
            (Some(Transfer::Download(segments)), 0) => segments.request(self.object, request, dictionary),
            (Some(Transfer::Upload(segments)), 3) => segments.request(self.object, request, dictionary),
            (Some(Transfer::BlockUpload(block)), 5) if request[0] & 3 != 0 => {
                block.request(self.object, request, dictionary)
            }
            _ => {
                let begins = match command {
                    1 | 2 => true,
                    6 => request[0] & 1 == 0,
                    5 => request[0] & 3 == 0,
                    _ => false,
                };
                // Other commands do not name an object; an abort then refers to the previous one.
                if begins {
                    self.object = named(request).0;
                }
                match (command, request[0] & 3) {
                    (1, _) => download(self.object, request, dictionary),
                    (2, _) => upload(self.object, dictionary),
                    (6, 0 | 2) => BlockDownload::begin(self.object, request, dictionary),
                    (5, 0) => BlockUpload::begin(self.object, request, dictionary),
                    _ => Err(Abort::Command),
                }
            }
        };
        self.answer = match step {
            Ok(Step::Begin(transfer, answer)) => {
                self.transfer = Some(transfer);
                Some(answer)
            }
            Ok(Step::Stay(answer)) => answer,
            Ok(Step::End(answer)) => {
                self.transfer = None;
                answer
            }
            Err(abort) => {
                self.transfer = None;
                Some(aborted(self.object, abort))
            }
        };
    }

    /// Restarts the timeout after a time in which nothing could be received.
    pub(crate) fn wait(&mut self, now_us: u64) {
        self.due_us = now_us + TIMEOUT_US;
    }

    /// Returns the next answer, the next segment of a block, or the abort after a timeout.
    pub(crate) fn poll<O: Objects>(
        &mut self,
        now_us: u64,
        dictionary: &mut Dictionary<'_, O>,
    ) -> Option<[u8; 8]> {
        let is_full = match &self.transfer {
            Some(Transfer::Download(segments)) => segments.is_full(dictionary),
            Some(Transfer::BlockDownload(block)) => block.is_full(dictionary),
            _ => false,
        };
        if is_full {
            self.wait(now_us);
            return None;
        }
        let waiting = self.answer.take();
        if waiting.is_some() {
            return waiting;
        }
        let transfer = self.transfer.as_mut()?;
        if let Transfer::BlockUpload(block) = transfer {
            match block.poll(self.object, dictionary) {
                Ok(None) => {}
                Ok(answer) => {
                    self.due_us = now_us + TIMEOUT_US;
                    return answer;
                }
                Err(abort) => {
                    self.transfer = None;
                    return Some(aborted(self.object, abort));
                }
            }
        }
        if now_us < self.due_us {
            return None;
        }
        self.transfer = None;
        Some(aborted(self.object, Abort::Timeout))
    }
}

/// Starts a download. An expedited one is complete at once.
fn download<O: Objects>(
    object: Object,
    request: [u8; 8],
    dictionary: &mut Dictionary<'_, O>,
) -> Result<Step, Abort> {
    let (_, bytes) = named(request);
    let (is_expedited, has_size) = (request[0] & 2 != 0, request[0] & 1 != 0);
    if !is_expedited {
        let size = has_size.then_some(u32::from_le_bytes(bytes));
        let segments = SegmentDownload::new(Sink::new(object, size, dictionary)?);
        return Ok(Step::Begin(Transfer::Download(segments), answer(0x60, object, 0)));
    }
    let count = has_size.then_some(u32::from(4 - (request[0] >> 2 & 3)));
    let mut gathered = Gathered::new(dictionary.writable(object)?, count)?;
    gathered.put(bytes.into_iter().take(usize::from(gathered.size)))?;
    dictionary.write(object, gathered.value()?)?;
    Ok(Step::End(Some(answer(0x60, object, 0))))
}

/// Starts an upload; expedited if the value fits.
fn upload<O: Objects>(object: Object, dictionary: &Dictionary<'_, O>) -> Result<Step, Abort> {
    let mut bytes = [0; 4];
    match dictionary.bytes(object, 0, &mut bytes)? {
        0 => Err(Abort::NoData),
        size @ 1..=4 => {
            let command = 0x43 | ((4 - size as u8) << 2);
            Ok(Step::End(Some(answer(command, object, u32::from_le_bytes(bytes)))))
        }
        size => {
            let segments = SegmentUpload::new(size);
            Ok(Step::Begin(Transfer::Upload(segments), answer(0x41, object, size)))
        }
    }
}

#[cfg(test)]
mod tests;
