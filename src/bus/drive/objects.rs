//! Reads and writes the objects of the drive profile.

use super::Mode;
use super::control::{Axis, DAMPING_UNIT, STIFFNESS_UNIT, Settings};
use crate::bus::abort::Abort;
use crate::bus::dictionary::Object;
use crate::bus::objects::{Lost, Objects};
use crate::bus::table::is_of_leg;

/// Low bytes of a signed number.
macro_rules! bits {
    ($value:expr) => {
        i32::from($value) as u32
    };
}

/// Value in millionths; saturates.
fn micro(value: f32) -> u32 {
    ((value * 1e6) as i32) as u32
}

/// Whether a value is 0 or within these limits.
fn is_default_or_within(value: u32, [least, most]: [u16; 2]) -> bool {
    value == 0 || (u32::from(least)..=u32::from(most)).contains(&value)
}

impl Axis {
    /// Sets a limit of the position (607D). A powered joint's place must stay within the limits.
    fn set_range(&mut self, sub: u8, limit: i32) -> Result<(), Abort> {
        let [low, high] = self.settings.range;
        let range = if sub == 1 { [limit, high] } else { [low, limit] };
        if range[0] > range[1] {
            return Err(Abort::MaximumBelowMinimum);
        }
        let position = micro(self.status.position.0) as i32;
        if self.is_powered() && !(range[0]..=range[1]).contains(&position) {
            return Err(Abort::State);
        }
        self.settings.range = range;
        Ok(())
    }
}

impl Objects for Axis {
    fn read(&self, object: Object) -> Result<u32, Abort> {
        let (settings, status, constants) = (&self.settings, &self.status, &self.constants);
        let thousandths = |torque: f32| bits!((torque / self.constants.rated_torque.0 * 1e3) as i16);
        Ok(match (object.index, object.sub) {
            // Unit 0.001 rad/s, range +-32 rad/s.
            (0x2010, _) => bits!((status.velocity.0 * 1e3) as i16),
            (0x2001, _) => u32::from(settings.node_id),
            (0x2002, _) => u32::from(settings.bit_rate),
            (0x2011, _) => u32::from(settings.feedforward),
            (0x2012, _) => u32::from(settings.returns),
            (0x2013, _) => u32::from(settings.watches),
            (0x2020, 1) => u32::from(settings.impedance[0]),
            (0x2020, 2) => u32::from(settings.impedance[1]),
            (0x2020, 3) => u32::from((constants.impedance[0] / STIFFNESS_UNIT) as u16),
            (0x2020, 4) => u32::from((constants.impedance[1] / DAMPING_UNIT) as u16),
            (0x2021, 1) => u32::from(settings.position_bandwidth),
            (0x2021, 2) => u32::from(constants.position_bandwidth_limits()[0]),
            (0x2021, 3) => u32::from(constants.position_bandwidth_limits()[1]),
            (0x2021, 4) => u32::from(settings.current_bandwidth),
            (0x2021, 5) => u32::from(constants.current_bandwidth_limits()[0]),
            (0x2021, 6) => u32::from(constants.current_bandwidth_limits()[1]),
            // Objects of the leg; they are not held here.
            (0x2120, 0) => 13,
            (index, _) if is_of_leg(index) => return Err(Abort::NoData),
            (0x219A | 0x60FD, _) => status.inputs,
            (0x6007, _) => bits!(settings.connection_option),
            (0x6040, _) => u32::from(self.controlword),
            (0x6041, _) => u32::from(self.statusword()),
            (0x605A, _) => bits!(settings.quick_stop_option),
            (0x605B | 0x605C | 0x607E, _) => 0,
            (0x605D, _) => 1,
            (0x605E, _) => 2,
            (0x6060, _) => bits!(settings.mode),
            (0x6061, _) => bits!(self.mode()),
            (0x6062, _) => micro(status.position_demand.0),
            (0x6064, _) => micro(status.position.0),
            (0x6065, _) => settings.following_window,
            (0x6066, _) => u32::from(settings.following_time_ms),
            (0x6067, _) => settings.position_window,
            (0x6068, _) => u32::from(settings.position_time_ms),
            (0x606B, _) => micro(status.velocity_demand.0),
            (0x606C, _) => micro(status.velocity.0),
            (0x606D, _) => u32::from(settings.velocity_window),
            (0x606E, _) => u32::from(settings.velocity_time_ms),
            (0x606F, _) => u32::from(settings.standing_speed),
            (0x6070, _) => u32::from(settings.standing_time_ms),
            (0x6071, _) => bits!(settings.target_torque),
            (0x6072, _) => u32::from(settings.largest_torque),
            (0x6074, _) => thousandths(status.torque_demand.0),
            (0x6075, _) => (self.constants.rated_current.0 * 1e3) as u32,
            (0x6076, _) => (self.constants.rated_torque.0 * 1e3) as u32,
            (0x6077, _) => thousandths(status.torque.0),
            (0x6078, _) => bits!(
                (status.torque.0 / constants.torque_per_ampere.0 / constants.rated_current.0 * 1e3) as i16
            ),
            (0x6079, _) => (status.bus.0 * 1e3) as u32,
            (0x607A, _) => settings.target_position as u32,
            (0x607C, _) => settings.home_offset as u32,
            (0x607D, 1) => settings.range[0] as u32,
            (0x607D, 2) => settings.range[1] as u32,
            (0x607F, _) => micro(constants.speed.0),
            // Motor speed in revolutions per minute.
            (0x6080, _) => (constants.speed.0 * constants.ratio * (30.0 / core::f32::consts::PI)) as u32,
            (0x6081, _) => settings.profile_velocity,
            (0x6083, _) => settings.profile_acceleration,
            (0x6084, _) => settings.profile_deceleration,
            (0x6086, _) => 0,
            (0x6087, _) => settings.torque_slope,
            (0x608F, _) => constants.counts_per_turn,
            // Per 1000 revolutions of the joint.
            (0x6091, _) => (constants.ratio * 1e3 + 0.5) as u32,
            (0x6098, _) => bits!(settings.homing_method.max(0)),
            (0x60B1, _) => settings.velocity_offset as u32,
            (0x60B2, _) => bits!(settings.torque_offset),
            (0x60C1, 1) => settings.interpolation_data as u32,
            (0x60C2, 1) => u32::from(settings.period),
            (0x60C2, 2) => bits!(settings.period_index),
            (0x60F2, _) => u32::from(settings.positioning_option),
            (0x60F4, _) => micro((status.position_demand - status.position).0),
            (0x2194 | 0x60FE, _) => settings.outputs,
            (0x60FF, _) => settings.target_velocity as u32,
            (0x6502, _) => self.constants.modes,
            _ => return Err(Abort::NoObject),
        })
    }

    fn write(&mut self, object: Object, value: u32) -> Result<(), Abort> {
        let constants = &self.constants;
        let settings = &mut self.settings;
        let is = |allowed: &[i32]| allowed.contains(&i32::from(value as i16));
        match (object.index, object.sub) {
            (0x2120, 0) => {}
            (index, _) if is_of_leg(index) => return Err(Abort::State),
            // 0: the default node-ID of the board.
            (0x2001, _) if value <= 127 => settings.node_id = value as u8,
            (0x2002, _) if matches!(value, 125 | 250 | 500 | 1000) => settings.bit_rate = value as u16,
            (0x2011, _) if value <= 1 => settings.feedforward = value == 1,
            (0x2012, _) if value <= 1 => settings.returns = value == 1,
            (0x2013, _) if value <= 1 => settings.watches = value == 1,
            (0x2020, 1) => (settings.impedance[0], self.targets.impedance[0]) = (value as u16, true),
            (0x2020, 2) => (settings.impedance[1], self.targets.impedance[1]) = (value as u16, true),
            (0x2021, 1) if is_default_or_within(value, constants.position_bandwidth_limits()) => {
                settings.position_bandwidth = value as u16;
            }
            (0x2021, 4) if is_default_or_within(value, constants.current_bandwidth_limits()) => {
                settings.current_bandwidth = value as u16;
            }
            (0x6007, _) if is(&[0, 1, 2, 3]) => settings.connection_option = value as i16,
            (0x6040, _) => self.control(value as u16),
            // Fault reactions are chosen per fault; a halt always slows down along the profile.
            (0x605A, _) if is(&[0, 2]) => settings.quick_stop_option = value as i16,
            (0x605B | 0x605C | 0x607E, _) if is(&[0]) => {}
            (0x605D, _) if is(&[1]) => {}
            (0x605E, _) if is(&[2]) => {}
            (0x6060, _) => {
                let is_offered = Mode::from_number(value as i8)
                    .map_or(value as i8 == 0, |mode| self.constants.modes & mode.bit() != 0);
                if !is_offered {
                    return Err(Abort::Range);
                }
                self.set_mode(value as i8);
            }
            (0x6065, _) => settings.following_window = value,
            (0x6066, _) => settings.following_time_ms = value as u16,
            (0x6067, _) => settings.position_window = value,
            (0x6068, _) => settings.position_time_ms = value as u16,
            (0x606D, _) => settings.velocity_window = value as u16,
            (0x606E, _) => settings.velocity_time_ms = value as u16,
            (0x606F, _) => settings.standing_speed = value as u16,
            (0x6070, _) => settings.standing_time_ms = value as u16,
            (0x6071, _) => (settings.target_torque, self.targets.torque) = (value as i16, true),
            (0x6072, _) => settings.largest_torque = value as u16,
            (0x607A, _) => (settings.target_position, self.targets.position) = (value as i32, true),
            (0x607C, _) => settings.home_offset = value as i32,
            (0x607D, sub) => return self.set_range(sub, value as i32),
            (0x6081, _) => settings.profile_velocity = value,
            (0x6083, _) if value > 0 => settings.profile_acceleration = value,
            (0x6084, _) if value > 0 => settings.profile_deceleration = value,
            (0x6086, _) if value as i16 == 0 => {}
            (0x6087, _) => settings.torque_slope = value,
            // Methods that take the present position as home.
            (0x6098, _) if matches!(value as i8, 0 | 35 | 37) => settings.homing_method = value as i8,
            (0x60B1, _) => (settings.velocity_offset, self.targets.velocity_offset) = (value as i32, true),
            (0x60B2, _) => (settings.torque_offset, self.targets.torque_offset) = (value as i16, true),
            (0x60C1, 1) => settings.interpolation_data = value as i32,
            (0x60C2, 1) => settings.set_period(value as u8, settings.period_index)?,
            (0x60C2, 2) => settings.set_period(settings.period, value as i8)?,
            (0x60F2, _) if value <= 2 => settings.positioning_option = value as u16,
            (0x2194 | 0x60FE, _) => settings.outputs = value,
            (0x60FF, _) => (settings.target_velocity, self.targets.velocity) = (value as i32, true),
            (
                0x2001
                | 0x2002
                | 0x2011
                | 0x2012
                | 0x2013
                | 0x2021
                | 0x6007
                | 0x605A..=0x605E
                | 0x607E
                | 0x6083
                | 0x6084
                | 0x6086
                | 0x6098
                | 0x60F2,
                _,
            ) => {
                return Err(Abort::Range);
            }
            _ => return Err(Abort::NoObject),
        }
        Ok(())
    }

    /// A 0 that a PDO repeats is idle: it is no command to disable voltage.
    fn write_mapped(&mut self, object: Object, value: u32) -> Result<(), Abort> {
        if object.index == 0x6040 && value as u16 == 0 && !self.commanded {
            Ok(())
        } else {
            self.write(object, value)
        }
    }

    fn lost(&mut self, why: Lost) {
        self.lose(why);
    }

    fn misses_host(&self) -> bool {
        self.settings.watches && (self.commanded || self.hosted) && self.own.is_enabled()
    }

    fn reset(&mut self) {
        self.settings = Settings::NEW;
        self.commanded = false;
        self.void_targets();
    }
}
