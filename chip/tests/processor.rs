//! Exceptions, sleep, faults, reset and saved machines, with small programs of a few instructions.

use std::rc::Rc;
use std::sync::{Mutex, MutexGuard, PoisonError};

use scarab_chip::chip::Chip;
use scarab_chip::image::Image;
use scarab_chip::machine::{End, Machine, TIME_FACTOR};
use scarab_chip::plant::Plant;
use scarab_chip::time::{Ticks, ticks};
use scarab_identify::formats::leg_file::{DEFAULT_LEG, LegFile};

const RAM: u32 = 0x2000_0000;
/// Addresses of the interrupt enables and of the priorities.
const ISER: u32 = 0xE000_E100;
const IPR: u32 = 0xE000_E400;

/// Only one Unicorn instance at a time: several in threads of one process crash.
static ONE: Mutex<()> = Mutex::new(());

fn alone() -> MutexGuard<'static, ()> {
    ONE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A program under construction: vectors, then code.
struct Program {
    vectors: Vec<u32>,
    code: Vec<u16>,
}

impl Program {
    const START: u32 = 0x0800_0200;

    fn new() -> Self {
        Self { vectors: vec![Self::START | 1; 128], code: Vec::new() }
    }

    fn here(&self) -> u32 {
        Self::START + 2 * self.code.len() as u32
    }

    fn put(&mut self, code: &[u16]) -> &mut Self {
        self.code.extend(code);
        self
    }

    /// Loads a constant: `movw`, `movt`.
    fn constant(&mut self, register: u16, value: u32) -> &mut Self {
        for (opcode, half) in [(0xF240, value & 0xFFFF), (0xF2C0, value >> 16)] {
            let half = half as u16;
            let first = opcode | (half >> 11 & 1) << 10 | half >> 12;
            self.put(&[first, (half >> 8 & 7) << 12 | register << 8 | half & 0xFF]);
        }
        self
    }

    /// Stores a constant at an address: uses r0 and r1.
    fn store(&mut self, address: u32, value: u32) -> &mut Self {
        // str r1, [r0]
        self.constant(0, address).constant(1, value).put(&[0x6001])
    }

    fn halt(&mut self) -> &mut Self {
        self.put(&[0xE7FE])
    }

    /// Places the next code as the handler of an exception.
    fn handler(&mut self, exception: usize) -> &mut Self {
        self.vectors[exception] = self.here() | 1;
        self
    }

    fn machine(&self) -> Machine {
        let mut bytes: Vec<u8> = Vec::new();
        let mut vectors = self.vectors.clone();
        vectors[0] = RAM + 0x1_0000;
        bytes.extend(vectors.iter().flat_map(|vector| vector.to_le_bytes()));
        bytes.extend(self.code.iter().flat_map(|half| half.to_le_bytes()));
        let plant = Plant::new(&LegFile::load(DEFAULT_LEG).expect("shipped"), 1).expect("motors");
        let image = Rc::new(Image::from_bytes(&bytes));
        Machine::new(&image, Chip::new(plant, 1), TIME_FACTOR).expect("Unicorn")
    }
}

fn word(machine: &Machine, address: u32) -> u32 {
    let mut bytes = [0; 4];
    assert!(machine.memory(address, &mut bytes));
    u32::from_le_bytes(bytes)
}

fn run(machine: &mut Machine, duration: f64) -> End {
    let until = machine.chip().now + ticks(duration);
    machine.run(until).expect("runs")
}

/// Enables an interrupt with a priority.
fn enable(program: &mut Program, interrupt: u32, priority: u32) {
    program.store(IPR + (interrupt & !3), priority << (8 * (interrupt % 4)));
    program.store(ISER + 4 * (interrupt / 32), 1 << (interrupt % 32));
}

/// Begins a program with TIM5's interrupt every millisecond: clock 16 MHz, prescaler 16, top 999.
fn every_millisecond() -> Program {
    let mut program = Program::new();
    program.store(0x4002_3840, 1 << 3);
    for (offset, value) in [(0x28, 15), (0x2C, 999), (0x14, 1), (0x10, 0), (0x0C, 1), (0x00, 1)] {
        program.store(0x4000_0C00 + offset, value);
    }
    enable(&mut program, 50, 0x20);
    program
}

#[test]
fn a_sleeping_processor_wakes_for_a_timer_and_sleeps_on() {
    let _alone = alone();
    let mut program = every_millisecond();
    let top = program.here();
    // wfe; b top
    program.put(&[0xBF20, 0xE7FD]);
    assert_eq!(program.here(), top + 4);
    program.handler(66).store(0x4000_0C10, 0).put(&[0x4770]);
    let mut machine = program.machine();
    run(&mut machine, 0.1005);
    assert_eq!(machine.chip().load.usage(66).entries, 100);
    assert!(machine.chip().load.awake(machine.chip().now) < 0.05);
    assert!(machine.chip().findings.is_empty(), "{:?}", machine.chip().findings);
}

#[test]
fn a_masked_interrupt_still_ends_a_wait() {
    let _alone = alone();
    let mut program = every_millisecond();
    // cpsid i; wfi; the mark; cpsie i
    program.put(&[0xB672, 0xBF30]).store(RAM, 5).put(&[0xB662]).halt();
    program.handler(66).constant(0, RAM).put(&[0x6802, 0x6042]).store(0x4000_0C10, 0).put(&[0x4770]);
    let mut machine = program.machine();
    machine.set_memory(RAM, &[0; 8]);
    run(&mut machine, 0.5e-3);
    assert_eq!(word(&machine, RAM), 0);
    run(&mut machine, 1e-3);
    assert_eq!((word(&machine, RAM), word(&machine, RAM + 4)), (5, 5));
}

#[test]
fn frequent_interrupts_do_not_change_a_computation() {
    let _alone = alone();
    let mut program = Program::new();
    program.store(0x4002_3840, 1 << 3);
    // Every 149 counts of 16 MHz.
    for (offset, value) in [(0x28, 0), (0x2C, 148), (0x14, 1), (0x10, 0), (0x0C, 1)] {
        program.store(0x4000_0C00 + offset, value);
    }
    enable(&mut program, 50, 0x20);
    program.constant(0, RAM).put(&[0x2200, 0x6002, 0x2100]);
    // vmov s1, #1.0; vsub s0, s1, s1; vsub s16, s1, s1
    program.put(&[0xEEF7, 0x0A00, 0xEE30, 0x0AE0, 0xEE30, 0x8AE0]);
    program.store(0x4000_0C00, 1).constant(0, RAM).put(&[0x2100]);
    let top = program.here();
    // ldr r2, [r0]; adds r2, #1; str r2, [r0]; b next; adds r1, #1; str r1, [r0, #4]; b next
    program.put(&[0x6802, 0x3201, 0x6002, 0xE7FF, 0x3101, 0x6041, 0xE7FF]);
    // vadd s0, s0, s1; vstr s0, [r0, #8]; b next; vadd s16, s16, s1; vstr s16, [r0, #12]
    program.put(&[0xEE30, 0x0A20, 0xED80, 0x0A02, 0xE7FF, 0xEE38, 0x8A20, 0xED80, 0x8A03]);
    // vcmp.f32 s0, s16; b next; vmrs APSR_nzcv, fpscr; b next; it ne; strne r1, [r0, #16]
    program.put(&[0xEEB4, 0x0A48, 0xE7FF, 0xEEF1, 0xFA10, 0xE7FF, 0xBF18, 0x6101]);
    // b top
    let back = (i64::from(top) - i64::from(program.here()) - 4) / 2;
    program.put(&[0xE000 | (back as u16 & 0x7FF)]);
    program.handler(66).store(0x4000_0C10, 0);
    // vmov s0, #2.0; vmov s1, #2.0; vcmp s0, #0; movs r2, #0; bx lr
    program.put(&[0xEEB0, 0x0A00, 0xEEF0, 0x0A00, 0xEEB5, 0x0A40, 0x2200, 0x4770]);
    let mut machine = program.machine();
    machine.set_memory(RAM, &[0; 32]);
    run(&mut machine, 5e-3);
    let count = word(&machine, RAM);
    assert!(count > 500 && machine.chip().load.usage(66).entries > 400, "{count}");
    let floats = [8, 12].map(|offset| f32::from_bits(word(&machine, RAM + offset)));
    // The last round may be incomplete.
    assert!(word(&machine, RAM + 4).abs_diff(count) <= 1, "{} {count}", word(&machine, RAM + 4));
    assert!(floats.iter().all(|float| (float - count as f32).abs() <= 1.0), "{floats:?} {count}");
    assert_eq!(word(&machine, RAM + 16), 0, "floats differed {floats:?} {count}");
}

#[test]
fn an_access_without_memory_is_a_hard_fault_with_its_address() {
    let _alone = alone();
    let mut program = Program::new();
    // ldr r1, [r0]
    program.constant(0, 0x6000_0000).put(&[0x6801]).halt();
    program.handler(3).constant(0, 0xE000_ED28).put(&[0x6802, 0x6903]);
    // str r2, [r0]; str r3, [r0, #4]; ldr r2, [sp, #24]; str r2, [r0, #8]
    program.constant(0, RAM).put(&[0x6002, 0x6043, 0x9A06, 0x6082]).halt();
    let mut machine = program.machine();
    run(&mut machine, 1e-4);
    assert_eq!(word(&machine, RAM), 1 << 9 | 1 << 15);
    assert_eq!(word(&machine, RAM + 4), 0x6000_0000);
    assert_eq!(word(&machine, RAM + 8), Program::START + 8);
}

#[test]
fn a_supervisor_call_that_cannot_run_is_a_hard_fault() {
    let _alone = alone();
    let mut program = Program::new();
    // cpsid i; svc 0
    program.put(&[0xB672, 0xDF00]).halt();
    program.handler(11).store(RAM, 11).halt();
    program.handler(3).store(RAM, 3).halt();
    let mut machine = program.machine();
    run(&mut machine, 1e-4);
    assert_eq!(word(&machine, RAM), 3);
}

#[test]
fn a_fault_within_a_hard_fault_locks_up() {
    let _alone = alone();
    let mut program = Program::new();
    program.constant(0, 0x6000_0000).put(&[0x6801]);
    program.handler(3).put(&[0x6801]).halt();
    let mut machine = program.machine();
    assert_eq!(run(&mut machine, 1e-3), End::Time);
    let before = machine.chip().load.instructions;
    assert_eq!(run(&mut machine, 1e-3), End::Time);
    assert_eq!(machine.chip().load.instructions, before);
}

#[test]
fn a_restored_machine_repeats_the_first_run() {
    let _alone = alone();
    let mut program = Program::new();
    // adds r4, #1; str r4, [r0]; b
    program.constant(0, RAM).put(&[0x2400, 0x3401, 0x6004, 0xE7FC]);
    let mut machine = program.machine();
    run(&mut machine, 3e-5);
    let saved = machine.save().expect("saved");
    let state = |machine: &Machine| -> (Ticks, u64, u32) {
        (machine.chip().now, machine.chip().load.instructions, word(machine, RAM))
    };
    run(&mut machine, 4e-5);
    let first = state(&machine);
    machine.restore(&saved).expect("restored");
    run(&mut machine, 1e-5);
    run(&mut machine, 3e-5);
    assert_eq!(state(&machine), first);
    let mut other = program.machine();
    other.restore(&saved).expect("restored");
    run(&mut other, 4e-5);
    assert_eq!(state(&other), first);
}
