//! Decodes a `defmt` stream into lines.
//!
//! The device sends indices and bare values; the texts are in its image. Frames end with a zero byte and
//! contain none (rzCOBS). A listener that joins late or loses bytes therefore finds the next frame. Frames
//! that do not decode are counted and skipped. Single-precision values return with the same bits, since
//! `defmt-decoder` writes the shortest digits that do so.
//!
//! Cost: memory for one frame, independent of the length of the stream. Limits: an image that sends frames
//! without an encoding is refused, since decoding could not resume after a gap. A damaged frame that still
//! decodes is reported unchanged; its record number then rarely continues the sequence.

use std::panic::{AssertUnwindSafe, catch_unwind};

use defmt_decoder::{Encoding, Table};

use scarab_base::error::ToolError;

/// Limit above which a frame is invalid, bytes; the longest record has fewer than 200.
const LONGEST_FRAME: usize = 4096;

/// Input that did not decode.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Skipped {
    /// Frames that did not decode.
    pub frames: u64,
    /// Bytes in those frames.
    pub bytes: u64,
    /// Bytes before the first frame that decoded: the listener joined late.
    pub first_bytes: u64,
    /// Bytes at the end of an incomplete frame.
    pub cut_bytes: u64,
}

/// Decodes the stream of one image.
#[derive(Debug)]
pub struct Decoder {
    table: Table,
    frame: Vec<u8>,
    /// Bytes of a frame beyond [`LONGEST_FRAME`].
    overlong: u64,
    decoded: u64,
    skipped: Skipped,
}

impl Decoder {
    /// A decoder with the texts of an image (ELF).
    ///
    /// # Errors
    /// The file is no image, belongs to another program, or has no `defmt` or another version of it.
    pub fn new(image: &[u8]) -> Result<Self, ToolError> {
        let table = Table::parse(image)
            .map_err(|error| ToolError::input(format!("cannot be used as an image: {error}")))?
            .ok_or_else(|| {
                ToolError::input(
                    "holds no texts of records (no section .defmt): not an image that sends a trace, or a stripped one",
                )
            })?;
        if table.encoding() != Encoding::Rzcobs {
            return Err(ToolError::input("sends frames without an encoding; rzcobs is needed"));
        }
        if !table.raw_symbols().any(|symbol| symbol.contains("boot n={=u32}")) {
            return Err(ToolError::input("contains no Scarab trace records: an image of another program"));
        }
        Ok(Self { table, frame: Vec::new(), overlong: 0, decoded: 0, skipped: Skipped::default() })
    }

    /// Takes bytes in pieces of any size; passes each line on.
    pub fn feed(&mut self, bytes: &[u8], mut line: impl FnMut(&str)) {
        for &byte in bytes {
            if byte != 0 {
                if self.frame.len() < LONGEST_FRAME {
                    self.frame.push(byte);
                } else {
                    self.overlong += 1;
                }
                continue;
            }
            if self.frame.is_empty() {
                continue;
            }
            match self.frame() {
                Some(text) => {
                    self.decoded += 1;
                    line(&text);
                }
                None => self.skip(),
            }
            self.frame.clear();
            self.overlong = 0;
        }
    }

    /// Ends the stream and returns what did not decode.
    pub fn finish(&mut self) -> Skipped {
        self.skipped.cut_bytes += self.frame.len() as u64 + self.overlong;
        self.frame.clear();
        self.overlong = 0;
        self.skipped
    }

    /// Frames that were decoded.
    pub(crate) fn decoded(&self) -> u64 {
        self.decoded
    }

    fn skip(&mut self) {
        let bytes = self.frame.len() as u64 + self.overlong + 1;
        self.skipped.frames += 1;
        self.skipped.bytes += bytes;
        if self.decoded == 0 {
            self.skipped.first_bytes += bytes;
        }
    }

    /// Decodes the completed frame to text.
    fn frame(&self) -> Option<String> {
        if self.overlong > 0 {
            return None;
        }
        // The decoder trusts its image; bytes that only look like a frame must not panic the tool.
        catch_unwind(AssertUnwindSafe(|| {
            let mut stream = self.table.new_stream_decoder();
            stream.received(&self.frame);
            stream.received(&[0]);
            stream.decode().ok().map(|frame| frame.display_message().to_string())
        }))
        .ok()
        .flatten()
    }
}

impl Skipped {
    /// Summary in words; `None` where everything decoded.
    pub(crate) fn words(&self) -> Option<String> {
        let mut words = Vec::new();
        if self.first_bytes > 0 {
            words.push(format!("{} bytes before the first whole frame", self.first_bytes));
        }
        let later = self.bytes - self.first_bytes;
        if later > 0 {
            words.push(format!("{later} further bytes that are not frames of this image"));
        }
        if self.cut_bytes > 0 {
            words.push(format!("{} bytes at the end, of an incomplete frame", self.cut_bytes));
        }
        (!words.is_empty()).then(|| format!("passed over: {}", words.join("; ")))
    }
}
