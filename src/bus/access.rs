//! One door to every object: the table's rules first, then whoever has the value.

use super::abort::Abort;
use super::communication::Communication;
use super::dictionary::{Access, Object, Row, Type, find};
use super::objects::Objects;

/// From here on the values are not the node's.
pub(super) const PROFILE: u16 = 0x2000;

/// Object 603F, which repeats what 1003 has.
const ERROR_CODE: u16 = 0x603F;

/// What 1010 and 1011 want to be written: "save" and "load".
const SAVE: u32 = u32::from_le_bytes(*b"save");
const LOAD: u32 = u32::from_le_bytes(*b"load");

/// The node's objects and the others.
pub struct Dictionary<'a, O> {
    /// 1000 to 1FFF.
    pub communication: &'a mut Communication,
    /// From 2000 on.
    pub objects: &'a mut O,
}

impl<O: Objects> Dictionary<'_, O> {
    /// A number and its bytes.
    ///
    /// # Errors
    /// Those of the object.
    pub fn read(&self, object: Object) -> Result<u32, Abort> {
        let row = find(object)?;
        match row.access {
            Access::Const => Ok(row.default),
            _ => self.value(object),
        }
    }

    /// A number of an object that is known to exist and not to be constant.
    ///
    /// # Errors
    /// Those of the object.
    pub fn value(&self, object: Object) -> Result<u32, Abort> {
        match object.index {
            ..PROFILE => self.communication.read(object),
            // The newest entry of the list.
            ERROR_CODE => Ok(self.communication.emergency.newest()),
            _ => self.objects.read(object),
        }
    }

    /// The row of an object that may be written.
    ///
    /// # Errors
    /// [`Abort::ReadOnly`], or that there is none.
    pub fn writable(&self, object: Object) -> Result<&'static Row, Abort> {
        let row = find(object)?;
        if row.access == Access::Both { Ok(row) } else { Err(Abort::ReadOnly) }
    }

    /// Gives a writable object a number of the right size.
    ///
    /// # Errors
    /// Those of the object.
    pub fn write(&mut self, object: Object, value: u32) -> Result<(), Abort> {
        match (object.index, value) {
            (0x1010, SAVE) => self.objects.store(false),
            (0x1011, LOAD) => self.objects.store(true),
            (0x1010 | 0x1011, _) => Err(Abort::Store),
            (..PROFILE, _) => self.communication.write(object, value),
            _ => self.objects.write(object, value),
        }
    }

    /// Bytes of any object from `offset` on, as many as fit; how many it has in all.
    ///
    /// # Errors
    /// Those of the object.
    pub fn bytes(&self, object: Object, offset: u32, into: &mut [u8]) -> Result<u32, Abort> {
        let row = find(object)?;
        if matches!(row.kind, Type::Text | Type::Domain) {
            return if object.index < PROFILE {
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
