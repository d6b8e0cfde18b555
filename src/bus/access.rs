//! Access to every object: checks the table's rules, then reads or writes the value where it is held.

use super::abort::Abort;
use super::communication::Communication;
use super::dictionary::{Access, Object, Row, Type, find};
use super::objects::Objects;

/// First index of the objects that are not held by the node itself.
pub(super) const PROFILE: u16 = 0x2000;

/// Objects of the program, held by the board.
const PROGRAM: core::ops::RangeInclusive<u16> = 0x1F50..=0x1F57;

/// Object 603F; repeats the newest entry of 1003.
const ERROR_CODE: u16 = 0x603F;

/// Signatures expected by 1010 and 1011: "save" and "load".
const SAVE: u32 = u32::from_le_bytes(*b"save");
const LOAD: u32 = u32::from_le_bytes(*b"load");

/// All objects of a node, in two ranges.
pub(crate) struct Dictionary<'a, O> {
    /// Objects 1000 to 1FFF.
    pub(crate) communication: &'a mut Communication,
    /// Objects from 2000 on.
    pub(crate) objects: &'a mut O,
}

impl<O: Objects> Dictionary<'_, O> {
    /// Reads a number, constants included.
    ///
    /// # Errors
    /// [`Abort`] of an unknown object, or of the object itself.
    pub(crate) fn read(&self, object: Object) -> Result<u32, Abort> {
        let row = find(object)?;
        match row.access {
            Access::Const => Ok(row.default),
            _ => self.value(object),
        }
    }

    /// Reads a number. The object must exist and must not be constant.
    ///
    /// # Errors
    /// [`Abort`] of the object.
    pub(crate) fn value(&self, object: Object) -> Result<u32, Abort> {
        match object.index {
            index if PROGRAM.contains(&index) => self.objects.read(object),
            ..PROFILE => self.communication.read(object),
            // Newest entry of the error list.
            ERROR_CODE => Ok(self.communication.emergency.newest()),
            _ => self.objects.read(object),
        }
    }

    /// Returns the row of a writable object.
    ///
    /// # Errors
    /// [`Abort::ReadOnly`], or the error of an unknown object.
    pub(crate) fn writable(&self, object: Object) -> Result<&'static Row, Abort> {
        let row = find(object)?;
        if matches!(row.access, Access::Both | Access::Write) { Ok(row) } else { Err(Abort::ReadOnly) }
    }

    /// Writes a number. The object must be writable and the value of the right size.
    ///
    /// # Errors
    /// [`Abort`] of the object.
    pub(crate) fn write(&mut self, object: Object, value: u32) -> Result<(), Abort> {
        match (object.index, value) {
            (0x1010, SAVE) => self.objects.store(false),
            (0x1011, LOAD) => self.objects.store(true),
            (0x1010 | 0x1011, _) => Err(Abort::Store),
            (index, _) if PROGRAM.contains(&index) => self.objects.write(object, value),
            (..PROFILE, _) => self.communication.write(object, value),
            _ => self.objects.write(object, value),
        }
    }

    /// Copies the bytes of any object from `offset` on into `into`; returns the object's total size in bytes.
    ///
    /// # Errors
    /// [`Abort`] of an unknown object, or of the object itself.
    pub(crate) fn bytes(&self, object: Object, offset: u32, into: &mut [u8]) -> Result<u32, Abort> {
        let row = find(object)?;
        if matches!(row.kind, Type::Text | Type::Domain) {
            return if object.index < *PROGRAM.start() {
                self.communication.text(object, offset, into)
            } else {
                self.objects.bytes(object, offset, into)
            };
        }
        let size = row.kind.size().unwrap_or(0);
        let bytes = self.read(object)?.to_le_bytes();
        let rest = bytes.iter().take(usize::from(size)).skip(offset as usize);
        for (to, from) in into.iter_mut().zip(rest) {
            *to = *from;
        }
        Ok(u32::from(size))
    }
}
