//! Communication objects 1000 to 1FFF, which the node holds itself.

use crc::{CRC_32_ISO_HDLC, Crc, NoTable};

use super::abort::Abort;
use super::dictionary::{Mapping, Object};
use super::emergency::{Emergency, Source};
use super::heartbeat::{Clock, Consumer, WATCHED};
use super::nmt::NmtState;
use super::node_id::NodeId;
use super::pdo::receive::Receive;
use super::pdo::transmit::Transmit;
use super::pdo::{ABSENT, PDOS, Parameters, is_assignable};
use super::silence::Silence;

/// Default mapping, as host software for exoskeletons expects it.
const RECEIVED: [u32; PDOS] = [0x6040_0010, 0x607A_0020, 0x60FF_0020, 0x6071_0010];
const SENT: [&[u32]; PDOS] = [&[0x6041_0010], &[0x6064_0020, 0x606C_0020], &[0x6077_0010], &[0x60FD_0020]];

/// Identity of the device (1018, 1008 to 100A).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Identity {
    /// Vendor-ID assigned by CiA; 0 if there is none.
    pub vendor: u32,
    /// Product code: 1 for the first joint, 2 for the second.
    pub product: u32,
    /// Revision of the bus behaviour; major number in the upper half.
    pub revision: u32,
    /// Serial number of the board.
    pub(crate) serial: u32,
    /// Check sum of the running image (1F56); 0 where there is none.
    pub(crate) checksum: u32,
    /// Device name, hardware version, software version.
    pub(crate) texts: [&'static str; 3],
}

impl Identity {
    /// Identity of this firmware. The vendor-ID is 0: CiA has assigned none.
    pub const fn scarab(serial: u32, hardware: &'static str) -> Self {
        Self {
            vendor: 0,
            product: 1,
            revision: 1 << 16,
            serial,
            checksum: 0,
            texts: ["Scarab joint drive", hardware, env!("CARGO_PKG_VERSION")],
        }
    }

    /// Serial number of a board by its processor's 96-bit number: a CRC, so that boards of one wafer differ.
    pub const fn serial(unique: [u32; 3]) -> u32 {
        let [[a, b, c, d], [e, f, g, h], [i, j, k, l]] =
            [unique[0].to_le_bytes(), unique[1].to_le_bytes(), unique[2].to_le_bytes()];
        Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC).checksum(&[a, b, c, d, e, f, g, h, i, j, k, l])
    }

    /// Identity of a joint's node. The nodes of a board differ in the product code only.
    pub const fn for_joint(self, joint: usize) -> Self {
        Self { product: self.product + joint as u32, ..self }
    }
}

/// State of the communication objects of one node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Communication {
    pub(super) node: NodeId,
    pub(super) identity: Identity,
    pub(super) state: NmtState,
    pub(super) emergency: Emergency,
    pub(super) consumers: [Consumer; WATCHED],
    /// Detects the silence of a cyclic host that sends no heartbeat.
    pub(super) silence: Silence,
    /// Object 1017, ms.
    pub(super) heartbeat_ms: u16,
    pub(super) heartbeat: Clock,
    /// Object 1005.
    pub(super) sync: u32,
    /// Object 1019.
    pub(super) sync_overflow: u8,
    /// Object 1029:1.
    pub(super) on_error: u8,
    pub(super) receive: [Receive; PDOS],
    pub(super) transmit: [Transmit; PDOS],
}

impl Communication {
    /// Creates the state after the start.
    pub fn new(node: NodeId, identity: Identity) -> Self {
        let base = |first: u16, pdo: usize| node.on(first + 0x100 * pdo as u16);
        let receive = |pdo: usize| {
            let mapped = RECEIVED.get(pdo).copied().unwrap_or(0);
            Receive::new(Parameters::new(Mapping::Receive, base(0x200, pdo), 255, 0, &[mapped]))
        };
        let transmit = |pdo: usize| {
            let mapped: &[u32] = SENT.get(pdo).copied().unwrap_or(&[]);
            let kind = if pdo == 0 { 255 } else { 1 };
            Transmit::new(Parameters::new(Mapping::Transmit, base(0x180, pdo), kind, 10, mapped))
        };
        Self {
            node,
            identity,
            state: NmtState::Initialising,
            emergency: Emergency::new(u32::from(node.on(0x80))),
            consumers: [Consumer::default(); WATCHED],
            silence: Silence::default(),
            heartbeat_ms: 0,
            heartbeat: Clock::NEW,
            sync: 0x80,
            sync_overflow: 0,
            on_error: 0,
            receive: core::array::from_fn(receive),
            transmit: core::array::from_fn(transmit),
        }
    }

    /// Reads a number.
    ///
    /// # Errors
    /// [`Abort`] of the object.
    pub(crate) fn read(&self, object: Object) -> Result<u32, Abort> {
        let Object { index, sub } = object;
        let pdo = usize::from(index & 0xFF);
        Ok(match (index, sub) {
            (0x1001, _) => u32::from(self.emergency.register()),
            (0x1003, _) => return self.emergency.history(sub),
            (0x1005, _) => self.sync,
            // Capability: stores on command only.
            (0x1010 | 0x1011, _) => 1,
            (0x1014, _) => self.emergency.identifier,
            (0x1015, _) => u32::from(self.emergency.inhibit),
            (0x1016, 1..) => self.consumers.get(usize::from(sub) - 1).ok_or(Abort::NoSubindex)?.setting(),
            (0x1017, _) => u32::from(self.heartbeat_ms),
            (0x1018, 1) => self.identity.vendor,
            (0x1018, 2) => self.identity.product,
            (0x1018, 3) => self.identity.revision,
            (0x1018, 4) => self.identity.serial,
            (0x1019, _) => u32::from(self.sync_overflow),
            (0x1029, _) => u32::from(self.on_error),
            (0x1200, 1) => u32::from(self.node.on(0x600)),
            (0x1200, 2) => u32::from(self.node.on(0x580)),
            (0x1400..=0x14FF, _) => return self.received(pdo)?.communication(sub),
            (0x1600..=0x16FF, _) => return self.received(pdo)?.mapping(sub),
            (0x1800..=0x18FF, _) => return self.transmitted(pdo)?.communication(sub),
            (0x1A00..=0x1AFF, _) => return self.transmitted(pdo)?.mapping(sub),
            _ => return Err(Abort::NoObject),
        })
    }

    /// Writes a number.
    ///
    /// # Errors
    /// [`Abort`] of the object.
    pub(crate) fn write(&mut self, object: Object, value: u32) -> Result<(), Abort> {
        let Object { index, sub } = object;
        let pdo = usize::from(index & 0xFF);
        match (index, sub) {
            (0x1003, _) => return self.emergency.forget(value),
            // A value with bit 30, which would make this node the SYNC producer, is not assignable.
            (0x1005, _) if self.may_be_sync(value) => self.sync = value,
            (0x1014, _) if self.may_be_emergency(value) => self.emergency.identifier = value,
            (0x1015, _) => self.emergency.inhibit = value as u16,
            (0x1016, 1..) => {
                let number = sub - 1;
                let watches = |setting: u32| (setting & 0xFFFF != 0).then_some(setting >> 16);
                let mut others =
                    self.consumers.iter().enumerate().filter(|(other, _)| *other != usize::from(number));
                let is_taken = others.any(|(_, other)| watches(other.setting()) == watches(value));
                if is_taken && watches(value).is_some() {
                    return Err(Abort::Incompatible);
                }
                self.consumers.get_mut(usize::from(number)).ok_or(Abort::NoSubindex)?.set(value)?;
                // Monitoring restarts, so an earlier loss is no longer active.
                self.emergency.set(Source::Heartbeat(number), None);
            }
            (0x1017, _) => (self.heartbeat_ms, self.heartbeat) = (value as u16, Clock::NEW),
            (0x1019, _) if matches!(value, 0 | 2..=240) => {
                self.sync_overflow = value as u8;
                self.emergency.set(Source::Sync, None);
            }
            (0x1029, _) if value <= 2 => self.on_error = value as u8,
            (0x1005 | 0x1014 | 0x1019 | 0x1029, _) => return Err(Abort::Range),
            (0x1400..=0x14FF | 0x1800..=0x18FF, 1) if self.is_message(object, value) => {
                return Err(Abort::Range);
            }
            (0x1400..=0x16FF | 0x1800..=0x1AFF, _) => {
                let parameters = if index < 0x1800 {
                    let receive = self.receive.get_mut(pdo).ok_or(Abort::NoObject)?;
                    receive.stop();
                    self.emergency.set(Source::Receive(pdo as u8), None);
                    &mut receive.parameters
                } else {
                    let transmit = self.transmit.get_mut(pdo).ok_or(Abort::NoObject)?;
                    transmit.restart();
                    &mut transmit.parameters
                };
                let is_mapping = index & 0x200 != 0;
                return if is_mapping {
                    parameters.set_mapping(sub, value)
                } else {
                    parameters.set_communication(sub, value)
                };
            }
            _ => return Err(Abort::NoObject),
        }
        Ok(())
    }

    /// Copies the bytes of a text; see [`Objects::bytes`](super::Objects::bytes).
    pub(super) fn text(&self, object: Object, offset: u32, into: &mut [u8]) -> Result<u32, Abort> {
        let number = usize::from(object.index.wrapping_sub(0x1008));
        let text = self.identity.texts.get(number).ok_or(Abort::NoObject)?.as_bytes();
        for (to, from) in into.iter_mut().zip(text.iter().skip(offset as usize)) {
            *to = *from;
        }
        Ok(text.len() as u32)
    }

    /// Whether 1005 accepts the value: the default, or an assignable COB-ID that no other message here uses.
    fn may_be_sync(&self, value: u32) -> bool {
        (value == 0x80 || is_assignable(value)) && value != self.emergency.identifier && !self.is_pdo(value)
    }

    /// Whether 1014 accepts the value. Bit 31 disables the messages.
    fn may_be_emergency(&self, value: u32) -> bool {
        let number = value & !ABSENT;
        let is_free = matches!(number, 0x81..=0xFF) || is_assignable(number);
        is_free && (value & ABSENT != 0 || number != self.sync && !self.is_pdo(number))
    }

    /// Whether an existing PDO uses this COB-ID.
    fn is_pdo(&self, number: u32) -> bool {
        let received = self.receive.iter().map(|pdo| &pdo.parameters);
        let mut all = received.chain(self.transmit.iter().map(|pdo| &pdo.parameters));
        all.any(|pdo| pdo.identifier().is_some_and(|own| u32::from(own) == number))
    }

    /// Whether a PDO with this identifier would collide with SYNC, emergency or another PDO. Bit 30 is
    /// ignored.
    fn is_message(&self, object: Object, identifier: u32) -> bool {
        let number = identifier & 0x7FF;
        let own = self.read(object).is_ok_and(|own| own & ABSENT == 0 && own & 0x7FF == number);
        identifier & ABSENT == 0
            && (number == self.sync || number == self.emergency.identifier || !own && self.is_pdo(number))
    }

    fn received(&self, pdo: usize) -> Result<&Parameters, Abort> {
        self.receive.get(pdo).map(|receive| &receive.parameters).ok_or(Abort::NoObject)
    }

    fn transmitted(&self, pdo: usize) -> Result<&Parameters, Abort> {
        self.transmit.get(pdo).map(|transmit| &transmit.parameters).ok_or(Abort::NoObject)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbouring_processors_have_different_serial_numbers() {
        // Check value of this CRC, in its first nine bytes.
        assert_eq!(Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC).checksum(b"123456789"), 0xCBF4_3926);
        // Same lot, other coordinates on the wafer: the words' XOR would be the same for many.
        let unique = |x: u32, y: u32| Identity::serial([x | y << 16, 0x3533_510E ^ x, 0x3233_3836 ^ y << 16]);
        let mut seen = std::collections::BTreeSet::new();
        for x in 0..64 {
            assert!((0..64).all(|y| seen.insert(unique(x, y))), "{x}");
        }
    }
}
