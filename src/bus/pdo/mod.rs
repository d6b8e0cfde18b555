//! Process data objects: communication (1400, 1800) and mapping parameters (1600, 1A00) of both directions.
//!
//! Why remappable while Operational: CiA 301 lets a device refuse that, but host software for exoskeletons
//! starts the node first and configures its PDOs afterwards. The standard's sequence is required:
//!
//! ```text
//! comm:1 = 0x80000000 | COB    disable the PDO
//! map:0 = 0                    open the mapping for writing
//! map:i = index << 16 | sub << 8 | bits
//! map:0 = n
//! comm:1 = COB                 enable the PDO
//! ```
//!
//! Transmission types: 0 at the next SYNC if a value changed, 1 to 240 every nth SYNC, 254 and 255 on a
//! change. Received PDOs of types 0 to 240 take effect at the next SYNC. Source: CiA 301, PDO. Limits: whole
//! bytes; no RTR (252, 253).

pub(super) mod receive;
pub(super) mod transmit;

use super::abort::Abort;
use super::dictionary::{Mapping, Object, Type, find};

/// Number of PDOs per direction.
pub(crate) const PDOS: usize = 4;
/// Largest number of objects in one PDO.
pub(crate) const MAPPED: usize = 8;

/// Bit of a COB-ID: the message does not exist.
pub(super) const ABSENT: u32 = 1 << 31;
const EXTENDED: u32 = 1 << 29;
/// A transmitted PDO is not sent on a remote frame.
const NO_REMOTE: u32 = 1 << 30;
/// Bits used only by extended identifiers.
const BEYOND: u32 = 0x1FFF_F800;

/// Whether a host may assign this COB-ID. Excluded are those that CiA 301 reserves for NMT, SYNC, emergency,
/// SDO and heartbeat.
pub(super) const fn is_assignable(number: u32) -> bool {
    matches!(number, 0x181..=0x57F | 0x681..=0x6DF)
}

/// Placeholder for outputs, which CORC maps with 16 bits in its versions of October 2022 to April 2025 and
/// with 32 bits in later ones. Refused, that host walks with one leg of two: it configures no further node.
const PLACEHOLDERS: [Object; 2] = [Object::at(0x2194, 0), Object::at(0x60FE, 1)];

/// One mapped object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Mapped {
    /// Address of the object.
    pub(crate) object: Object,
    /// Size in bytes.
    pub(crate) size: u8,
}

impl Mapped {
    const fn from_entry(entry: u32) -> Self {
        Self { object: Object::at((entry >> 16) as u16, (entry >> 8) as u8), size: entry as u8 / 8 }
    }

    /// Whether the entry is a dummy: index 2 to 7, the standard's types. Its bytes are ignored.
    pub(crate) const fn is_dummy(self) -> bool {
        self.object.index <= Type::U32 as u16
    }
}

/// Communication and mapping parameters of one PDO.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Parameters {
    direction: Mapping,
    identifier: u32,
    kind: u8,
    inhibit: u16,
    event_ms: u16,
    sync_start: u8,
    count: u8,
    map: [u32; MAPPED],
}

impl Parameters {
    /// Creates parameters with COB-ID, transmission type, inhibit time (units of 100 us) and mapped objects.
    pub fn new(direction: Mapping, identifier: u16, kind: u8, inhibit: u16, mapped: &[u32]) -> Self {
        let mut map = [0; MAPPED];
        for (slot, entry) in map.iter_mut().zip(mapped) {
            *slot = *entry;
        }
        let count = mapped.len().min(MAPPED) as u8;
        let identifier = u32::from(identifier);
        Self { direction, identifier, kind, inhibit, event_ms: 0, sync_start: 0, count, map }
    }

    /// Returns the COB-ID, or `None` if the PDO does not exist.
    pub(crate) fn identifier(&self) -> Option<u16> {
        (self.identifier & ABSENT == 0).then_some((self.identifier & 0x7FF) as u16)
    }

    /// Whether the PDO waits for a SYNC.
    pub(crate) const fn is_synchronous(&self) -> bool {
        self.kind <= 240
    }

    /// Mapped objects in the order of their bytes.
    pub(crate) fn mapped(&self) -> impl Iterator<Item = Mapped> + use<> {
        self.map.into_iter().take(usize::from(self.count)).map(Mapped::from_entry)
    }

    /// Length of the frame in bytes.
    pub(crate) fn length(&self) -> usize {
        self.mapped().map(|mapped| usize::from(mapped.size)).sum()
    }

    /// Reads an object of 1400 or 1800.
    pub(super) fn communication(&self, sub: u8) -> Result<u32, Abort> {
        match sub {
            1 if self.direction == Mapping::Transmit => Ok(self.identifier | NO_REMOTE),
            1 => Ok(self.identifier),
            2 => Ok(u32::from(self.kind)),
            3 => Ok(u32::from(self.inhibit)),
            4 => Ok(0),
            5 => Ok(u32::from(self.event_ms)),
            6 => Ok(u32::from(self.sync_start)),
            _ => Err(Abort::NoSubindex),
        }
    }

    /// Writes an object of 1400 or 1800.
    pub(super) fn set_communication(&mut self, sub: u8, value: u32) -> Result<(), Abort> {
        match sub {
            1 => return self.set_identifier(value),
            2 if matches!(value, 0..=240 | 254 | 255) => self.kind = value as u8,
            // Hosts that write the whole configuration write it unchanged.
            3 if value == u32::from(self.inhibit) => {}
            3 if self.direction == Mapping::Transmit && self.identifier().is_some() => {
                return Err(Abort::Access);
            }
            3 => self.inhibit = value as u16,
            4 if value == 0 => {}
            5 => self.event_ms = value as u16,
            6 if value <= 240 => self.sync_start = value as u8,
            2 | 4 | 6 => return Err(Abort::Range),
            _ => return Err(Abort::NoSubindex),
        }
        Ok(())
    }

    /// Sets the COB-ID. An existing PDO can only be disabled.
    fn set_identifier(&mut self, value: u32) -> Result<(), Abort> {
        let number = value & 0x7FF;
        let exists = value & ABSENT == 0;
        let changes = self.identifier().is_some_and(|own| u32::from(own) != number);
        if value & (EXTENDED | BEYOND) != 0 || exists && (!is_assignable(number) || changes) {
            return Err(Abort::Range);
        }
        self.identifier = value;
        Ok(())
    }

    /// Reads an object of 1600 or 1A00.
    pub(super) fn mapping(&self, sub: u8) -> Result<u32, Abort> {
        match usize::from(sub).checked_sub(1) {
            None => Ok(u32::from(self.count)),
            Some(index) => self.map.get(index).copied().ok_or(Abort::NoSubindex),
        }
    }

    /// Writes an object of 1600 or 1A00.
    pub(super) fn set_mapping(&mut self, sub: u8, value: u32) -> Result<(), Abort> {
        if self.identifier().is_some() {
            return Err(Abort::Access);
        }
        let Some(index) = usize::from(sub).checked_sub(1) else { return self.set_count(value) };
        if self.count != 0 {
            return Err(Abort::Access);
        }
        if value != 0 {
            self.check(value)?;
        }
        *self.map.get_mut(index).ok_or(Abort::NoSubindex)? = value;
        Ok(())
    }

    fn set_count(&mut self, value: u32) -> Result<(), Abort> {
        if value as usize > MAPPED {
            return Err(Abort::PdoLength);
        }
        let mut bytes = 0;
        for entry in self.map.iter().take(value as usize) {
            self.check(*entry)?;
            bytes += Mapped::from_entry(*entry).size;
        }
        if bytes > 8 {
            return Err(Abort::PdoLength);
        }
        self.count = value as u8;
        Ok(())
    }

    fn check(&self, entry: u32) -> Result<(), Abort> {
        let Mapped { object, size } = Mapped::from_entry(entry);
        let bits = entry as u8;
        if Mapped::from_entry(entry).is_dummy() {
            let fits = match object.index {
                2 | 5 => bits == 8,
                3 | 6 => bits == 16,
                4 | 7 => bits == 32,
                _ => false,
            };
            let is_dummy = fits && object.sub == 0 && self.direction == Mapping::Receive;
            return if is_dummy { Ok(()) } else { Err(Abort::NotMappable) };
        }
        let row = find(object)?;
        let is_allowed = row.mapping == Mapping::Any || row.mapping == self.direction;
        let is_short = PLACEHOLDERS.contains(&object) && size == 2;
        if is_allowed && bits == 8 * size && (row.kind.size() == Some(size) || is_short) {
            Ok(())
        } else {
            Err(Abort::NotMappable)
        }
    }
}

#[cfg(test)]
mod tests;
