//! Ports A to I (RM0090 8.4): modes, pulls, outputs, alternate functions, and levels from outside.

use crate::findings::{Access, NO_REGISTER, NOT_MODELLED};

/// Ports of the chip.
const PORTS: usize = 9;

/// Mode of a pin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    Input,
    Output,
    /// Alternate function, by number.
    Alternate(u32),
    Analog,
}

/// Registers of one port.
#[derive(Clone, Copy, Debug, Default)]
struct Port {
    mode: u32,
    kind: u32,
    speed: u32,
    pull: u32,
    output: u32,
    functions: [u32; 2],
    /// Pins with a level from outside, and those levels.
    driven: u32,
    levels: u32,
    /// Levels as the inputs see them.
    inputs: u32,
}

impl Port {
    /// Computes the levels that the inputs see.
    fn update_inputs(&mut self) {
        self.inputs = 0;
        for pin in 0..16 {
            let bit = match self.mode >> (2 * pin) & 3 {
                // An analog pin's input is off.
                3 => 0,
                // An open drain that is not pulled down follows the level from outside.
                1 if self.kind >> pin & 1 == 0 || self.output >> pin & 1 == 0 => self.output >> pin & 1,
                _ if self.driven >> pin & 1 == 1 => self.levels >> pin & 1,
                _ => u32::from(self.pull >> (2 * pin) & 3 == 1),
            };
            self.inputs |= bit << pin;
        }
    }
}

/// State of all ports.
#[derive(Clone, Debug)]
pub struct Gpio {
    ports: [Port; PORTS],
}

/// Name and number of a pin: port letter and number.
pub type Pin = (char, u32);

fn index(port: char) -> usize {
    (port as usize).wrapping_sub('A' as usize).min(PORTS - 1)
}

impl Gpio {
    /// State after a reset.
    pub fn new() -> Self {
        let mut gpio = Self { ports: [Port::default(); PORTS] };
        gpio.reset();
        gpio
    }

    /// Resets the registers; levels from outside stay.
    pub fn reset(&mut self) {
        for (index, port) in self.ports.iter_mut().enumerate() {
            // The debug port's pins.
            let (mode, speed, pull) = match index {
                0 => (0xA800_0000, 0x0C00_0000, 0x6400_0000),
                1 => (0x0000_0280, 0x0000_00C0, 0x0000_0100),
                _ => (0, 0, 0),
            };
            *port = Port { mode, speed, pull, driven: port.driven, levels: port.levels, ..Port::default() };
            port.update_inputs();
        }
    }

    /// Mode of a pin.
    pub fn mode(&self, (port, pin): Pin) -> Mode {
        let port = &self.ports[index(port)];
        match port.mode >> (2 * pin) & 3 {
            0 => Mode::Input,
            1 => Mode::Output,
            2 => Mode::Alternate(port.functions[(pin / 8) as usize] >> (4 * (pin % 8)) & 0xF),
            _ => Mode::Analog,
        }
    }

    /// Whether a pin is an output at high level.
    pub fn is_driven_high(&self, pin: Pin) -> bool {
        self.mode(pin) == Mode::Output && self.ports[index(pin.0)].output >> pin.1 & 1 == 1
    }

    /// Whether neither processor nor board holds a pin's level. JTAG's pins, function 0, are not driven.
    pub fn is_floating(&self, pin: Pin) -> bool {
        let port = &self.ports[index(pin.0)];
        let is_driven = matches!(self.mode(pin), Mode::Output) || port.driven >> pin.1 & 1 == 1;
        let is_other = matches!(self.mode(pin), Mode::Alternate(function) if function != 0);
        !is_driven && !is_other && port.pull >> (2 * pin.1) & 3 == 0
    }

    /// Sets the level that the board applies to a pin. Returns whether the pin's level changed, and to what.
    pub fn apply(&mut self, (port, pin): Pin, level: bool) -> Option<bool> {
        let before = self.level((port, pin));
        let state = &mut self.ports[index(port)];
        state.driven |= 1 << pin;
        if level {
            state.levels |= 1 << pin
        } else {
            state.levels &= !(1 << pin)
        }
        state.update_inputs();
        let after = self.level((port, pin));
        (before != after).then_some(after)
    }

    /// Level of a pin as its input sees it.
    pub fn level(&self, (port, pin): Pin) -> bool {
        self.ports[index(port)].inputs >> pin & 1 == 1
    }

    /// Reads a register of a port, by the offset from port A.
    pub fn read(&self, offset: u32, access: &mut Access<'_>) -> u32 {
        let number = (offset / 0x400) as usize;
        let Some(port) = self.ports.get(number) else { return 0 };
        match offset % 0x400 {
            0x00 => port.mode,
            0x04 => port.kind,
            0x08 => port.speed,
            0x0C => port.pull,
            0x10 => port.inputs,
            0x14 => port.output,
            0x18 | 0x1C => 0,
            offset @ (0x20 | 0x24) => port.functions[(offset as usize - 0x20) / 4],
            other => access.no_register(name(number, other)),
        }
    }

    /// Writes a register of a port, by the offset from port A.
    pub fn write(&mut self, offset: u32, value: u32, access: &mut Access<'_>) {
        let number = (offset / 0x400) as usize;
        let Some(port) = self.ports.get_mut(number) else { return };
        match offset % 0x400 {
            0x00 => port.mode = value,
            0x04 => port.kind = access.implemented(value, 0xFFFF, "GPIO_OTYPER"),
            0x08 => port.speed = value,
            0x0C => {
                if value & value >> 1 & 0x5555_5555 != 0 {
                    access.refuse("reserved pull selected", name(number, 0x0C));
                }
                port.pull = value;
            }
            0x10 => access.refuse("read-only register written", name(number, 0x10)),
            0x14 => port.output = access.implemented(value, 0xFFFF, "GPIO_ODR"),
            // Setting has priority over resetting.
            0x18 => port.output = port.output & !(value >> 16) | value & 0xFFFF,
            0x1C => access.refuse(NOT_MODELLED, name(number, 0x1C)),
            offset @ (0x20 | 0x24) => port.functions[(offset as usize - 0x20) / 4] = value,
            other => access.refuse(NO_REGISTER, name(number, other)),
        }
        port.update_inputs();
    }
}

fn name(port: usize, offset: u32) -> String {
    format!("GPIO{}+{offset:#x}", (b'A' + port as u8) as char)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::findings::Findings;

    #[test]
    fn an_input_reads_the_outside_or_its_pull_an_output_itself() {
        let (mut gpio, mut findings) = (Gpio::new(), Findings::default());
        let mut write = |gpio: &mut Gpio, offset: u32, value: u32| {
            gpio.write(0x800 + offset, value, &mut Access { now: 0, findings: &mut findings });
        };
        assert!(!gpio.level(('C', 4)));
        write(&mut gpio, 0x0C, 1 << 8);
        assert!(gpio.level(('C', 4)));
        assert_eq!(gpio.apply(('C', 4), false), Some(false));
        assert_eq!(gpio.apply(('C', 4), false), None);
        write(&mut gpio, 0x00, 1 << 8);
        write(&mut gpio, 0x18, 1 << 4);
        assert!(gpio.level(('C', 4)) && gpio.is_driven_high(('C', 4)));
        write(&mut gpio, 0x18, 1 << 20);
        assert!(!gpio.level(('C', 4)));
        write(&mut gpio, 0x24, 6 << 8);
        write(&mut gpio, 0x00, 2 << 20);
        assert_eq!(gpio.mode(('C', 10)), Mode::Alternate(6));
    }
}
