//! How the steps of a session are sent to a leg, and what each of them permits.

use scarab::hal::SERVO_RATE_HZ;
use scarab::model::planar::JOINTS;

use super::commanded::{MODE, WORD};
use super::witness::{COMES_TO_REST, CREEP, HELD, HostedLeg, MILLISECOND, NODES, Play, TAKES_OVER};
use super::{CONTROLWORD, MODE as MODE_OBJECT, MODES, Object, Step};

/// Bits of 60FD that say why a leg is not enabled: an inhibit reason, no zeros, no calibration, a joint that
/// is outside its range, moves, or has no reading.
const REASONS: i32 = 0x7E_0000;
/// Speed that an enabled leg must follow, micro-radian/s.
const TEST_SPEED: i32 = 100_000;
/// Limit beyond those of every leg, micro-radian, also per second.
const BEYOND_LIMITS: i32 = 20_000_000;
/// Attempts to enable a leg that states no reason.
const ATTEMPTS: u32 = 2;
/// Attempts to reset a leg: a reset is lost while the leg writes its flash and its receive queue is full.
const RESETS: u32 = 3;
/// Time for which a new value explains a step of the torque, ticks: a cyclic target that has jumped is
/// interpolated over its period, and the joint then follows.
const AFTER_VALUE: u64 = 500 * MILLISECOND as u64;

/// Difference between commanded and measured speed from one reading to the next, micro-radian/s.
const SPEED_CHANGE: u32 = 150_000;
/// Cycles of a host until its silence would be noticed.
const ARMING_CYCLES: u32 = 25;
/// Time in which a silent host stops the leg, ticks.
const SILENCE_TICKS: u32 = 600 * MILLISECOND;
/// Longest time for which the leg erases and writes its flash memory, ticks: two sectors.
const LONGEST_FLASH_WRITE: u64 = 1000 * MILLISECOND as u64;
/// Bit 10 of the statusword.
const REACHED: i32 = 0x400;
/// Halt bit of the controlword.
const HALT: i32 = 0x100;

/// Whether a new value of an object may change the torque at once in a mode. Profiles, homing, a new mode
/// and a halt may not: they start from the joint's position, velocity and torque.
fn asks_for_a_step(mode: Option<i8>, index: u16) -> bool {
    let Some(mode) = mode else { return MODES.iter().any(|mode| asks_for_a_step(Some(*mode), index)) };
    match index {
        0x607A | 0x607D => matches!(mode, 8 | -1),
        0x60FF => mode == -1,
        // 6087 may be as steep as a host wants.
        0x6071 | 0x6087 => matches!(mode, 4 | 10 | -1),
        0x60B1 => matches!(mode, 8 | 9),
        0x60B2 => matches!(mode, 8..=10),
        0x2020 => mode == -1,
        0x6072 => true,
        // A narrower window takes the commanded position to a joint that does not move on.
        0x6065 => matches!(mode, 3 | 9),
        _ => false,
    }
}

/// The joint that a step means, or all.
fn addressed(joint: usize) -> impl Iterator<Item = usize> {
    (0..JOINTS).filter(move |other| joint == JOINTS || *other == joint)
}

impl<L: HostedLeg> Play<L> {
    /// Writes an object by SDO that may act. Returns whether it was confirmed.
    fn write(
        &mut self,
        joint: usize,
        (index, sub, bytes): (u16, u8, u8),
        value: i32,
    ) -> Result<bool, String> {
        if matches!(index, WORD | MODE) {
            self.stops = [self.ticks + TAKES_OVER; JOINTS];
        }
        if matches!(index, 0x1010 | 0x1011) {
            self.writes_flash_until = self.ticks + LONGEST_FLASH_WRITE;
        }
        if index == 0x1010 {
            self.commanded.iter_mut().for_each(|commanded| commanded.may_have_saved = true);
        }
        self.commanded[joint].write(index, sub, self.ticks);
        self.expect(joint, index);
        let is_confirmed = self.request(joint, (index, sub, bytes), value)?;
        if is_confirmed {
            self.commanded[joint].confirm(index, sub, value);
            // A host that stops or takes the leg: the operator has to close the switch again.
            self.by_hand &= index != WORD;
        }
        Ok(is_confirmed)
    }

    /// Writes an object by SDO; the answer comes within a few ticks. Returns whether it was confirmed.
    fn request(
        &mut self,
        joint: usize,
        (index, sub, bytes): (u16, u8, u8),
        value: i32,
    ) -> Result<bool, String> {
        let ([low, high], [a, b, c, d]) = (index.to_le_bytes(), value.to_le_bytes());
        let mut data = [0x23 | (4 - bytes) << 2, low, high, sub, a, b, c, d];
        data[4 + usize::from(bytes)..].fill(0);
        self.answer = None;
        self.send(0x600 + NODES[joint], &data);
        self.run(3)?;
        Ok(self.answer.is_some_and(|answer| answer[..4] == [0x60, low, high, sub]))
    }

    fn read(&mut self, joint: usize, index: u16, sub: u8) -> Result<Option<i32>, String> {
        let [low, high] = index.to_le_bytes();
        self.answer = None;
        self.send(0x600 + NODES[joint], &[0x40, low, high, sub, 0, 0, 0, 0]);
        self.run(6)?;
        let answer =
            self.answer.filter(|answer| answer[0] & 0xE0 == 0x40 && answer[1..4] == [low, high, sub]);
        Ok(answer.map(|answer| i32::from_le_bytes([answer[4], answer[5], answer[6], answer[7]])))
    }

    fn word(&mut self, joint: usize, word: u16) -> Result<(), String> {
        addressed(joint).try_for_each(|joint| {
            self.commanded[joint].word(word, self.ticks);
            self.write(joint, (WORD, 0, 2), i32::from(word)).map(|_| ())
        })
    }

    /// Writes the mode. It is certain once the node has it.
    fn mode(&mut self, joint: usize, mode: i8) -> Result<(), String> {
        self.commanded[joint].set_mode(None);
        self.explain_pending(joint, Some(mode));
        let is_confirmed = self.write(joint, (MODE, 0, 1), i32::from(mode))?;
        self.run(L::DELAY)?;
        self.commanded[joint].set_mode(Some(mode).filter(|_| is_confirmed));
        Ok(())
    }

    /// A new value of an object is on its way to a joint.
    fn expect(&mut self, joint: usize, index: u16) {
        self.pending[joint] |= index == 0x6071;
        if asks_for_a_step(self.commanded[joint].mode, index) {
            self.explained[joint] = self.ticks + AFTER_VALUE;
        }
    }

    /// A PDO may write these objects of a joint.
    fn expect_all(&mut self, joint: usize, objects: &[u16]) {
        objects.iter().for_each(|index| self.expect(joint, *index));
        if objects.iter().any(|index| matches!(*index, WORD | MODE)) {
            self.stops = [self.ticks + TAKES_OVER; JOINTS];
        }
        if objects.contains(&MODE) {
            self.explain_pending(joint, None);
        }
    }

    /// Sends a received PDO, numbered from 1.
    fn pdo(&mut self, joint: usize, number: u16, bytes: &[u8; 8]) {
        let objects = self.commanded[joint].receive(usize::from(number) - 1, *bytes, self.ticks);
        self.expect_all(joint, &objects);
        self.send(0x100 + 0x100 * number + NODES[joint], bytes);
    }

    fn map(&mut self, joint: usize, number: u16, objects: [Object; 2]) -> Result<(), String> {
        let pdo = number - 1;
        let cob = i32::from(0x100 + 0x100 * number + NODES[joint]);
        let entries = objects.map(|Object(index, sub, bytes)| {
            i32::from(index) << 16 | i32::from(sub) << 8 | i32::from(8 * bytes)
        });
        self.commanded[joint].map(usize::from(pdo), objects, false);
        let mut is_confirmed = true;
        for (object, value) in [
            ((0x1400 + pdo, 1, 4), cob | i32::MIN),
            ((0x1600 + pdo, 0, 1), 0),
            ((0x1600 + pdo, 1, 4), entries[0]),
            ((0x1600 + pdo, 2, 4), entries[1]),
            ((0x1600 + pdo, 0, 1), 2),
            ((0x1400 + pdo, 1, 4), cob),
        ] {
            is_confirmed &= self.write(joint, object, value)?;
        }
        self.commanded[joint].map(usize::from(pdo), objects, is_confirmed);
        Ok(())
    }

    /// Reads the modes that are not certain.
    fn learn_modes(&mut self) -> Result<(), String> {
        for joint in 0..JOINTS {
            let commanded = &self.commanded[joint];
            if (commanded.mode.is_none() || commanded.maps_mode())
                && let Some(mode) = self.read(joint, MODE, 0)?
            {
                let mode = Some(mode as i8).filter(|_| !self.commanded[joint].mode_waits());
                if self.commanded[joint].mode != mode {
                    self.commanded[joint].set_mode(mode);
                    self.explain_pending(joint, mode);
                }
            }
        }
        Ok(())
    }

    /// The value that a joint has in this mode begins to act: the leg is enabled, or the mode is new.
    pub(super) fn explain_pending(&mut self, joint: usize, mode: Option<i8>) {
        if self.pending[joint] && matches!(mode, None | Some(4 | 10)) {
            self.explained[joint] = self.ticks + AFTER_VALUE;
        }
    }

    /// Compares the statuswords with the leg.
    fn words(&mut self) -> Result<(), String> {
        for joint in 0..JOINTS {
            let before = (self.is_enabled, self.fault);
            let Some(word) = self.read(joint, 0x6041, 0)? else { continue };
            let Some(mode) = self.read(joint, 0x6061, 0)? else { continue };
            self.run(L::DELAY)?;
            if before != (self.is_enabled, self.fault) {
                continue;
            }
            let (word, mode) = (word as u16, mode as i8);
            let powered = word & 0x806F == 0x27;
            let failed = matches!(word & 0x4F, 0x08 | 0x0F);
            let follows = powered && matches!(mode, -1 | 8..=10) && word & 0x1000 != 0;
            let commanded = &self.commanded[joint];
            let may_follow = commanded.may_move_in(mode) || commanded.stays();
            if powered != self.is_enabled || failed != self.fault.is_some() || follows && !may_follow {
                return Err(format!("words: joint {joint} {word:04X} in mode {mode}, {before:?}"));
            }
            if powered && mode == 3 {
                self.check_reached(joint)?;
            }
            if let Some(largest) = self.read(joint, 0x6072, 0)? {
                self.commanded[joint].may_sag = largest < 1000;
            }
        }
        Ok(())
    }

    /// "Target reached" in profile velocity mode: the joint has the commanded velocity, within 607F.
    fn check_reached(&mut self, joint: usize) -> Result<(), String> {
        let commanded = &self.commanded[joint];
        if commanded.mode != Some(3) || !commanded.may_move_in(3) || !commanded.is_certain {
            return Ok(());
        }
        let mut values = [0; 7];
        let objects = [0x6041, 0x6040, 0x60FF, 0x607F, 0x606C, 0x606D, 0x6041];
        for (value, index) in values.iter_mut().zip(objects) {
            let Some(read) = self.read(joint, index, 0)? else { return Ok(()) };
            *value = read;
        }
        let [before, word, target, most, speed, window, after] = values;
        let is_reached = before & after & REACHED != 0;
        let is_near = target.clamp(-most, most).abs_diff(speed) <= window as u32 + SPEED_CHANGE;
        if self.is_enabled && !self.returns[joint] && is_reached && word & HALT == 0 && !is_near {
            return Err(format!("words: joint {joint} has reached {target} with {speed} micro-radian/s"));
        }
        Ok(())
    }

    pub(super) fn step(&mut self, step: &Step) -> Result<(), String> {
        match *step {
            Step::Write(joint, Object(index, sub, bytes), value) => {
                self.write(joint, (index, sub, bytes), value).map(|_| ())
            }
            Step::Word(joint, word) if word & 0x8F != 0xF && word & 0x80 == 0 => self.disable(joint, word),
            Step::Word(joint, word) => self.word(joint, word),
            Step::Enable => self.enable(),
            Step::Mode(joint, mode) => addressed(joint).try_for_each(|joint| self.mode(joint, mode)),
            Step::Near(joint, by) => self.near(joint, by),
            Step::Velocity(joint, speed, limit) => self.velocity(joint, speed, limit),
            Step::Load(joint, offset, speed, halts) => self.load(joint, offset, speed, halts),
            Step::Stay(joint) => self.stay(joint),
            Step::Exclude(joint, by, mode) => self.exclude(joint, by, mode),
            Step::Home(joint, offset) => self.home(joint, offset),
            Step::Pdo(joint, number, bytes) => {
                self.pdo(joint, number, &bytes);
                self.run(2)?;
                self.learn_modes()
            }
            Step::Map(joint, number, objects) => self.map(joint, number, objects),
            Step::WordAndMode(joint, number, word, mode, mode_first) => {
                let ([low, high], [mode]) = (word.to_le_bytes(), mode.to_le_bytes());
                let (objects, bytes) = if mode_first {
                    ([MODE_OBJECT, CONTROLWORD], [mode, low, high])
                } else {
                    ([CONTROLWORD, MODE_OBJECT], [low, high, mode])
                };
                self.map(joint, number, objects)?;
                let [a, b, c] = bytes;
                self.pdo(joint, number, &[a, b, c, 0, 0, 0, 0, 0]);
                self.run(2)?;
                self.learn_modes()
            }
            Step::StartElsewhere(joint, by, mode) => self.start_elsewhere(joint, by, mode),
            Step::Cycle(words, count, apart) => self.cycle(words, count, apart),
            Step::Sync(count, apart, is_counted) => self.sync(count, apart, is_counted),
            Step::StopSync(apart) => self.stop_sync(apart),
            Step::LoseHost(joint, speed, by_position) => self.lose_host(joint, speed, by_position),
            Step::Nmt(command, node) => self.nmt(command, node),
            Step::Lss(service, byte) => {
                self.send(0x7E5, &[service, byte, 0, 0, 0, 0, 0, 0]);
                self.run(8)
            }
            Step::Watch(joint, entry, time) => {
                self.write(joint, (0x1016, entry, 4), 0x7F << 16 | i32::from(time))?;
                self.send(0x77F, &[5]);
                self.run(2)
            }
            Step::Contacts(enabling, start, ticks) => {
                self.hand(enabling, start);
                self.run(ticks.into())
            }
            Step::Plug(plugged) => {
                (self.plugged, self.unheard) = (plugged, None);
                self.commanded.iter_mut().for_each(|commanded| commanded.is_certain = false);
                self.leg.plug(plugged);
                self.run(8)
            }
            Step::Wait(ticks) => {
                self.run(u32::from(ticks))?;
                self.learn_modes()?;
                self.words()
            }
        }
    }

    fn enable(&mut self) -> Result<(), String> {
        [6, 7, 0xF].into_iter().try_for_each(|word| {
            self.word(JOINTS, word)?;
            self.run(8)
        })
    }

    /// Commands a joint to a position so far from its present one.
    fn near(&mut self, joint: usize, by: i32) -> Result<(), String> {
        let Some(position) = self.read(joint, 0x6064, 0)? else { return Ok(()) };
        self.write(joint, (0x607A, 0, 4), position.wrapping_add(by)).map(|_| ())
    }

    /// Commands a joint to stay where it is, without offsets. One that is held must not move.
    fn stay(&mut self, joint: usize) -> Result<(), String> {
        let Some(position) = self.read(joint, 0x6064, 0)? else { return Ok(()) };
        let is_held = self.is_at_rest(joint);
        if is_held {
            self.commanded[joint].stay(self.ticks);
        }
        for (index, bytes, value) in [(0x60B1, 4, 0), (0x60B2, 2, 0), (0x607A, 4, position), (0x60FF, 4, 0)] {
            if is_held {
                // Between demanded and present position are the encoder's steps.
                self.expect(joint, index);
                self.request(joint, (index, 0, bytes), value)?;
            } else {
                self.write(joint, (index, 0, bytes), value)?;
            }
        }
        Ok(())
    }

    /// Enables a joint that its limits exclude: they must not pull it.
    fn exclude(&mut self, joint: usize, by: i32, mode: i8) -> Result<(), String> {
        self.disable(JOINTS, 0)?;
        let Some(position) = self.read(joint, 0x6064, 0)? else { return Ok(()) };
        let sub = if by > 0 { 1 } else { 2 };
        self.write(joint, (0x607D, sub, 4), position.wrapping_add(by))?;
        self.mode(joint, mode)?;
        self.enable()?;
        self.run(COMES_TO_REST as u32 * 5 / 4)?;
        self.stay(joint)?;
        self.run(100 * MILLISECOND)
    }

    /// Sets bit 4 in another mode, and then profile position: nothing may start.
    fn start_elsewhere(&mut self, joint: usize, by: i32, mode: i8) -> Result<(), String> {
        self.mode(joint, mode)?;
        self.enable()?;
        self.near(joint, by)?;
        self.word(joint, 0x1F)?;
        self.mode(joint, 1)?;
        self.run(50 * MILLISECOND)
    }

    fn nmt(&mut self, command: u8, node: u8) -> Result<(), String> {
        if command != 1 {
            // A node that resets or stops does not report an earlier fault.
            self.unheard = None;
            self.commanded.iter_mut().for_each(|commanded| commanded.is_certain = false);
        }
        if command == 129 {
            // 6072 is whole again, in the ticks until the leg is stopped too.
            (0..JOINTS).for_each(|joint| self.expect(joint, 0x6072));
        }
        self.send(0, &[command, node]);
        self.run(8)
    }

    /// Writes a controlword that stops the leg; once it is confirmed, the leg is not enabled.
    fn disable(&mut self, joint: usize, word: u16) -> Result<(), String> {
        for joint in addressed(joint) {
            self.commanded[joint].word(word, self.ticks);
            let is_confirmed = self.write(joint, (WORD, 0, 2), i32::from(word))?;
            self.run(TAKES_OVER as u32 + L::DELAY)?;
            if is_confirmed && self.is_enabled {
                return Err(format!("stops: {word:04X} is confirmed, and the leg stays enabled"));
            }
        }
        Ok(())
    }

    /// Gives the present position of a joint another value. Targets of before are void then.
    fn home(&mut self, joint: usize, offset: i32) -> Result<(), String> {
        self.mode(joint, 6)?;
        self.write(joint, (0x6098, 0, 1), 37)?;
        self.write(joint, (0x607C, 0, 4), offset)?;
        self.word(joint, 0x0F)?;
        self.run(8)?;
        let was_enabled = self.is_enabled && self.read(joint, 0x6061, 0)? == Some(6);
        self.word(joint, 0x1F)?;
        self.word(joint, 0x0F)?;
        self.run(L::DELAY)?;
        if was_enabled && self.is_enabled && self.plugged && !self.moves_itself {
            self.commanded[joint].home();
        }
        Ok(())
    }

    /// Commands a velocity for 0.4 s.
    fn velocity(&mut self, joint: usize, speed: i32, limit: i32) -> Result<(), String> {
        self.mode(joint, 3)?;
        self.write(joint, (0x6081, 0, 4), limit)?;
        self.enable()?;
        self.write(joint, (0x60FF, 0, 4), speed)?;
        self.run(400 * MILLISECOND)?;
        self.words()
    }

    /// Ends the motion of a joint that has just begun, and its load: by a halt, or with its mode.
    fn load(&mut self, joint: usize, offset: i32, speed: i32, halts: bool) -> Result<(), String> {
        self.mode(joint, 9)?;
        self.enable()?;
        self.write(joint, (0x60B2, 0, 2), offset)?;
        self.write(joint, (0x60FF, 0, 4), 0)?;
        self.run(AFTER_VALUE as u32)?;
        self.write(joint, (0x60FF, 0, 4), speed)?;
        if halts {
            self.word(joint, 0xF | HALT as u16)?
        } else {
            self.mode(joint, 0)?
        }
        self.run(50 * MILLISECOND)
    }

    /// A host moves a joint and is lost; the leg stays enabled and comes to rest.
    fn lose_host(&mut self, joint: usize, speed: i32, by_position: bool) -> Result<(), String> {
        // The leg is silent while it writes its flash memory, and misses no host.
        self.run(self.writes_flash_until.saturating_sub(self.ticks) as u32)?;
        self.nmt(1, 0)?;
        for node in 0..JOINTS {
            self.write(node, (0x6007, 0, 2), 0)?;
        }
        self.mode(joint, if by_position { 1 } else { 3 })?;
        self.enable()?;
        let watches = self.write(joint, (0x1016, 1, 4), 0x7F << 16 | 150)?;
        self.send(0x77F, &[5]);
        let begins = self.ticks;
        if by_position {
            self.write(joint, (0x6081, 0, 4), speed.abs())?;
            for by in [speed, speed / 2] {
                self.near(joint, by)?;
                self.word(joint, 0x1F)?;
                self.word(joint, 0x0F)?;
            }
        } else {
            self.write(joint, (0x60FF, 0, 4), speed)?;
        }
        self.run(400 * MILLISECOND)?;
        if watches && self.plugged && !self.commanded[joint].may_stop && self.lost_at[joint] < begins {
            return Err(format!("targets: joint {joint} does not miss its host"));
        }
        if self.is_enabled && !self.commanded[joint].may_move() && self.speed[joint].abs() > CREEP {
            return Err(format!("targets: joint {joint} goes on without its host"));
        }
        self.words()
    }

    fn cycle(&mut self, words: [u16; JOINTS], count: u8, apart: u8) -> Result<(), String> {
        for _ in 0..count {
            for (joint, word) in words.into_iter().enumerate() {
                let [low, high] = word.to_le_bytes();
                self.pdo(joint, 1, &[low, high, 0, 0, 0, 0, 0, 0]);
            }
            self.run(u32::from(apart))?;
        }
        self.learn_modes()
    }

    fn sync(&mut self, count: u8, apart: u8, is_counted: bool) -> Result<(), String> {
        for number in 1..=count {
            let counter = [number];
            self.send_sync(&counter[..usize::from(is_counted)]);
            self.run(u32::from(apart))?;
        }
        self.learn_modes()
    }

    fn send_sync(&mut self, data: &[u8]) {
        for joint in 0..JOINTS {
            let objects = self.commanded[joint].synchronise(self.ticks);
            self.expect_all(joint, &objects);
        }
        self.send(0x80, data);
    }

    /// A host that sends synchronous PDOs enables the leg; then its SYNC ends, and its PDOs go on.
    fn stop_sync(&mut self, apart: u8) -> Result<(), String> {
        self.nmt(1, 0)?;
        for joint in 0..JOINTS {
            for (object, value) in [
                ((0x1400, 2, 1), 1),
                ((0x1005, 0, 4), 0x80),
                ((0x1019, 0, 1), 0),
                ((0x2013, 0, 1), 1),
                ((0x6007, 0, 2), 3),
            ] {
                if !self.write(joint, object, value)? {
                    return Ok(());
                }
            }
        }
        self.enable()?;
        let mut cycles = |count: u32, with_sync: bool| {
            let mut was_off = false;
            for _ in 0..count {
                (0..JOINTS).for_each(|joint| self.pdo(joint, 1, &[0xF, 0, 0, 0, 0, 0, 0, 0]));
                if with_sync {
                    self.send_sync(&[]);
                }
                self.run(u32::from(apart))?;
                was_off |= !self.is_enabled || self.moves_itself || !self.plugged;
            }
            Ok::<bool, String>(was_off)
        };
        if cycles(ARMING_CYCLES, true)? || cycles(SILENCE_TICKS / u32::from(apart), false)? {
            return self.learn_modes();
        }
        Err("silence: the leg is enabled without SYNC".into())
    }

    /// The enabled leg moves when a well-behaved host commands a velocity, towards the middle of its range.
    fn follows(&mut self) -> Result<(), String> {
        // A joint that moves when it is enabled first comes to rest.
        self.run(COMES_TO_REST as u32 / 2)?;
        let before = self.position;
        let sign: [i32; JOINTS] = core::array::from_fn(|joint| {
            let [low, high] = self.bounds[joint].range;
            if before[joint] < (low + high) / 2.0 { 1 } else { -1 }
        });
        for joint in 0..JOINTS {
            self.mode(joint, 3)?;
            // Limits that another host may have saved.
            for (index, sub, value) in [
                (0x607D, 1, -BEYOND_LIMITS),
                (0x607D, 2, BEYOND_LIMITS),
                (0x607D, 1, -BEYOND_LIMITS),
                (0x6081, 0, BEYOND_LIMITS),
                (0x6083, 0, BEYOND_LIMITS),
            ] {
                self.write(joint, (index, sub, 4), value)?;
            }
            self.write(joint, (0x6072, 0, 2), 1000)?;
            self.write(joint, (0x60FF, 0, 4), TEST_SPEED * sign[joint])?;
        }
        self.run(SERVO_RATE_HZ / 4)?;
        let moves = |joint: usize| f64::from(sign[joint]) * (self.position[joint] - before[joint]) > HELD;
        if self.is_enabled && !(0..JOINTS).all(moves) || !self.is_enabled && self.fault.is_none() {
            return Err(format!("again: enabled, moves from {before:?} to {:?} rad", self.position));
        }
        Ok(())
    }

    /// What hosts said about the next identification and assistance ended with their session.
    fn check_session_settings(&mut self) -> Result<(), String> {
        for (index, sub) in [(0x2100, 13), (0x2150, 1), (0x2150, 2), (0x2150, 3), (0x2150, 4)] {
            if let Some(value) = self.read(0, index, sub)?.filter(|value| *value != 0) {
                return Err(format!("session: {index:04X}:{sub} is {value} after a reset"));
            }
        }
        Ok(())
    }

    /// The operator opens the enabling switch and closes it again.
    fn release_and_hold(&mut self) -> Result<(), String> {
        self.hand(false, false);
        self.run(SERVO_RATE_HZ / 20)?;
        self.hand(true, false);
        Ok(())
    }

    /// Resets both nodes, until both have sent their boot-up message.
    fn reset(&mut self) -> Result<(), String> {
        self.has_booted = [false; JOINTS];
        for _ in 0..RESETS {
            self.send(0x7E5, &[4, 0, 0, 0, 0, 0, 0, 0]);
            self.nmt(129, 0)?;
            self.run(SERVO_RATE_HZ * 3 / 5)?;
            if self.has_booted == [true; JOINTS] {
                return Ok(());
            }
        }
        Err(format!("reset: boot-up messages: {:?}", self.has_booted))
    }

    /// A well-behaved host enables the leg, or hears why it cannot.
    pub(super) fn again(&mut self) -> Result<(), String> {
        self.unheard = None;
        self.plugged = true;
        self.leg.plug(true);
        // A contact that is closed from the start on enables nothing.
        self.release_and_hold()?;
        self.reset()?;
        self.check_session_settings()?;
        self.send(0, &[1, 0]);
        self.run(40)?;
        let mut inputs = [None; JOINTS];
        for _ in 0..ATTEMPTS {
            for word in [0, 0x80, 0, 6, 7, 0xF] {
                self.word(JOINTS, word)?;
                // A reset takes 24 ms, and a brake its time.
                self.run(SERVO_RATE_HZ / 20)?;
            }
            if self.is_enabled {
                return self.follows();
            }
            inputs = [self.read(0, 0x60FD, 0)?, self.read(1, 0x60FD, 0)?];
            if inputs.iter().flatten().any(|inputs| inputs & REASONS != 0) {
                return Ok(());
            }
            // After a reset the switch must have been open.
            self.release_and_hold()?;
        }
        let words = [self.read(0, 0x6041, 0)?, self.read(1, 0x6041, 0)?];
        Err(format!("again: {:?}, 60FD {inputs:X?}, 6041 {words:X?}, heard {:X?}", self.fault, self.heard))
    }
}
