//! Records of the image, read from its memory as a debug probe does, and decoded by `scarab-rig`.
//!
//! The image's transport (SEGGER RTT) is a ring buffer in memory: its control block names buffer, size, and
//! the positions of writer and reader. A probe reads up to the writer's position and moves the reader's.

use scarab_base::error::ToolError;
use scarab_rig::trace::Decoder;
use scarab_rig::trace::read::Trace;
use scarab_rig::trace::text;

use crate::machine::Machine;
use crate::time::{Ticks, seconds};

const CONTROL_BLOCK: &str = "_SEGGER_RTT";
/// Offset of the first channel in the control block, and its length.
const CHANNEL: u32 = 24;
const CHANNEL_BYTES: usize = 24;

/// A probe that reads the image's records.
#[derive(Debug)]
pub struct Probe {
    block: u32,
    decoder: Decoder,
    /// Records so far, as `scarab-rig` reads them.
    pub trace: Trace,
    /// Records with the time at which they were read.
    pub lines: Vec<(Ticks, String)>,
}

impl Probe {
    /// A probe on this machine.
    ///
    /// # Errors
    /// The image sends no records.
    pub fn new(machine: &Machine) -> Result<Self, ToolError> {
        let image = machine.image();
        let block = image
            .address(CONTROL_BLOCK)
            .ok_or_else(|| ToolError::input(format!("the image has no symbol {CONTROL_BLOCK}")))?;
        let decoder = Decoder::new(&image.elf)?;
        Ok(Self { block, decoder, trace: Trace::default(), lines: Vec::new() })
    }

    /// Reads what the image has written since the last call.
    pub fn poll(&mut self, machine: &mut Machine) {
        let mut channel = [0; CHANNEL_BYTES];
        if !machine.memory(self.block + CHANNEL, &mut channel) {
            return;
        }
        let word = |index: usize| u32::from_le_bytes([0, 1, 2, 3].map(|byte| channel[4 * index + byte]));
        let (buffer, size, writer, reader) = (word(1), word(2), word(3), word(4));
        // Not yet initialised, or empty.
        if writer == reader || size == 0 || size > 0x1_0000 || writer >= size || reader >= size {
            return;
        }
        let mut bytes = Vec::new();
        let parts = if writer > reader { [reader..writer, 0..0] } else { [reader..size, 0..writer] };
        for part in parts.into_iter().filter(|part| !part.is_empty()) {
            let start = bytes.len();
            bytes.resize(start + part.len(), 0);
            machine.memory(buffer + part.start, &mut bytes[start..]);
        }
        machine.set_memory(self.block + CHANNEL + 16, &writer.to_le_bytes());
        let (now, trace, lines) = (machine.chip().now, &mut self.trace, &mut self.lines);
        self.decoder.feed(&bytes, |line| {
            trace.push(line);
            if let Some(record) = text::record(line) {
                lines.push((now, record.into_owned()));
            }
        });
    }

    /// First record from an index on that begins with `kind` and contains all `words`.
    pub fn find(&self, from: usize, kind: &str, words: &[&str]) -> Option<&str> {
        let fits = |line: &&(Ticks, String)| {
            line.1.split(' ').next() == Some(kind)
                && words.iter().all(|word| line.1.split(' ').any(|field| field == *word))
        };
        self.lines.get(from..)?.iter().find(fits).map(|(_, line)| line.as_str())
    }

    /// Records as text with their times.
    pub fn text(&self) -> String {
        self.lines.iter().map(|(at, line)| format!("{:10.4} {line}\n", seconds(*at))).collect()
    }
}

/// Value of a field of a record.
pub fn field<'a>(line: &'a str, key: &str) -> Option<&'a str> {
    line.split(' ').find_map(|field| field.strip_prefix(key)?.strip_prefix('='))
}
