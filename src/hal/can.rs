//! CAN frame with an 11-bit identifier, and the state of the bus controller.

/// Classic CAN frame: identifier and up to eight bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame {
    id: u16,
    length: u8,
    data: [u8; 8],
}

impl Frame {
    /// A data frame. Longer `data` is cut to eight bytes, `id` to its lowest eleven bits.
    pub fn new(id: u16, data: &[u8]) -> Self {
        let mut bytes = [0; 8];
        let mut length = 0;
        for (slot, byte) in bytes.iter_mut().zip(data) {
            *slot = *byte;
            length += 1;
        }
        Self { id: id & 0x7FF, length, data: bytes }
    }

    /// Identifier, 11 bits.
    pub const fn id(&self) -> u16 {
        self.id
    }

    /// Data bytes.
    pub fn data(&self) -> &[u8] {
        self.data.get(..usize::from(self.length)).unwrap_or(&self.data)
    }

    /// Data bytes of a frame that has all eight.
    pub fn full(&self) -> Option<[u8; 8]> {
        (self.length == 8).then_some(self.data)
    }

    /// Fewest and most bits on the wire, including the three of the intermission: 47 and 8 for each
    /// byte. At most a stuff bit is added after every four of the 34 bits, and 8 for each byte, between
    /// start and checksum.
    pub const fn bits(&self) -> [u32; 2] {
        let data = 8 * self.length as u32;
        [47 + data, 47 + data + (33 + data) / 4]
    }
}

/// State of the bus controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Controller {
    /// Error active: takes part in the bus.
    Active,
    /// Error passive: too many errors to disturb others.
    Passive,
    /// Bus off.
    Off,
    /// Frames arrived faster than they were read. Reported once.
    Overrun,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_keeps_what_fits_and_says_how_long_it_is() {
        let frame = Frame::new(0xF81, &[1, 2, 3]);
        assert_eq!((frame.id(), frame.data(), frame.full()), (0x781, &[1, 2, 3][..], None));
        assert_eq!(Frame::new(1, &[7; 12]).full(), Some([7; 8]));
        // 1 + 11 + 1 + 1 + 1 + 4 + 15 + 1 + 1 + 1 + 7 + 3. Fields: start, id, RTR, IDE, r0, DLC, CRC, CRC
        // delimiter, ACK, ACK delimiter, end, intermission.
        assert_eq!((Frame::new(0, &[]).bits(), Frame::new(0, &[0; 8]).bits()), ([47, 55], [111, 135]));
    }
}
