//! The processor core (Unicorn) with the chip around it: exceptions, sleep, stalls, faults, reset.
//!
//! Time is instructions times a factor. The block hook adds the time of a basic block before it runs, then
//! processes due events, then takes an interrupt if one preempts. So an interrupt comes at a block's
//! boundary, late by at most one block, and a register access within a block sees the time of the block's
//! end.
//!
//! Unicorn leaves exceptions to its user. An entry stores a frame of 8 or, with floating point in use, 26
//! words; a return with an EXC_RETURN address is reported by Unicorn as interrupt 8. After the program status
//! changes, Unicorn rebuilds its cached flags only where APSR_NZCV is written too.
//!
//! Known limits: the floating-point frame is always stored, never lazily; an entry costs 12 cycles, a return
//! 10, a tail-chained one 6. Memory protection and the process stack are not modelled.

mod calls;
mod changes;

use std::collections::HashMap;
use std::fmt::Debug;
use std::rc::Rc;

use scarab_base::error::ToolError;
use scarab_boot::{FLASH, FLASH_BYTES, Region};
use unicorn_engine::unicorn_const::{Arch, HookType, MemType, Mode, Prot};
use unicorn_engine::{ArmCpuModel, RegisterARM as Register, UcHookId, Unicorn};

pub use calls::Calls;
use calls::Watched;

use crate::chip::Chip;
use crate::image::Image;
use crate::nvic::{EXCEPTIONS, HARD_FAULT, NMI, SUPERVISOR_CALL};
use crate::peripherals::debug::{SYSTEM_BYTES, SYSTEM_MEMORY, system_memory};
use crate::peripherals::rcc::ResetReason;
use crate::system::{PRIVATE, fault};
use crate::time::{NEVER, Ticks};

pub const RAM: u32 = 0x2000_0000;
const RAM_BYTES: usize = 128 * 1024;
const CCM: u32 = 0x1000_0000;
const CCM_BYTES: usize = 64 * 1024;
const PERIPHERALS: u32 = 0x4000_0000;
const PERIPHERAL_BYTES: u64 = 0x8_0000;
const PRIVATE_BYTES: u64 = 0x10_0000;

/// Cycles of an exception's entry, its return, and a tail-chained entry.
const ENTRY: Ticks = 12;
const RETURN: Ticks = 10;
const CHAINED: Ticks = 6;
/// Fraction bits of the time of an instruction.
const FRACTION: u32 = 16;
/// Floating point is in use (FPCA). Unicorn's Cortex-M4 also looks at the bit of larger cores (SFPA). Without
/// it the next floating-point instruction would begin a new context and clear the status register's flags.
const FLOATS: u32 = 1 << 2 | 1 << 3;
/// Instructions found by their code: send event, wait for event.
const SEND_EVENT: u16 = 0xBF40;
const WAIT_FOR_EVENT: u16 = 0xBF20;
/// Instruction at which Unicorn stops.
const WAIT_FOR_INTERRUPT: u16 = 0xBF30;

type Core<'a> = Unicorn<'a, State>;

/// State that the hooks share.
struct State {
    chip: Chip,
    image: Rc<Image>,
    /// Size and number of instructions of each block in flash, by half its address.
    blocks: Vec<(u16, u16)>,
    /// Time of an instruction, fractions of a tick, and the elapsed part of a tick.
    cost: u64,
    rest: u64,
    cycle: Ticks,
    factor: f64,
    until: Ticks,
    /// Address at which the processor continues after a stop.
    resume: Option<u32>,
    /// The time of the block at the resume address was added before the stop.
    paid: bool,
    asleep: bool,
    fault: Option<(u32, u32)>,
    locked_up: bool,
    /// Exception whose code hangs; 0 is the thread.
    hung: Option<u8>,
    broken: Option<String>,
    /// Hooks on the image's SEV instructions, and whether the image has not changed since.
    events: (Vec<UcHookId>, bool),
    /// Instructions by exception and block, if they are counted.
    profile: Option<HashMap<(u8, u32), u64>>,
    /// Functions whose calls are counted; instructions of each exception so far, and of its last block.
    watched: Vec<Watched>,
    counted: Vec<[u64; 2]>,
}

/// Reason why a run ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum End {
    /// The requested time was reached.
    Time,
    /// The chip was reset; it has started again.
    Reset(ResetReason),
    /// Power was cut within a flash operation; the machine must be started again.
    PowerCut,
}

/// Processor, peripherals and plant, saved.
pub struct Snapshot {
    registers: Vec<u32>,
    memory: Vec<u8>,
    pub chip: Chip,
    rest: u64,
    resume: u32,
    paid: bool,
    asleep: bool,
}

/// Bytes of the bootloader, which nothing changes.
const FIXED_BYTES: usize = Region::BOOTLOADER.bytes() as usize;

/// The microcontroller on its board.
pub struct Machine {
    core: Core<'static>,
}

/// Usual number of cycles per instruction.
pub const TIME_FACTOR: f64 = 1.34;

fn broken(what: &str) -> impl Fn(unicorn_engine::uc_error) -> ToolError + '_ {
    move |error| ToolError::input(format!("the processor model rejects {what}: {error:?}"))
}

impl Machine {
    /// A machine after power-on; `factor` is the number of cycles per instruction.
    ///
    /// # Errors
    /// Unicorn cannot be initialised.
    pub fn new(image: &Rc<Image>, chip: Chip, factor: f64) -> Result<Self, ToolError> {
        let state = State::new(Rc::clone(image), chip, factor);
        let mut core = Unicorn::new_with_data(Arch::ARM, Mode::THUMB | Mode::MCLASS, state)
            .map_err(broken("its architecture"))?;
        core.ctl_set_cpu_model(ArmCpuModel::CORTEX_M4 as i32).map_err(broken("a Cortex-M4"))?;
        map_memory(&mut core).map_err(broken("its memory"))?;
        map_registers(&mut core).map_err(broken("its registers"))?;
        add_hooks(&mut core).map_err(broken("its hooks"))?;
        let mut machine = Self { core };
        machine.start();
        Ok(machine)
    }

    pub fn chip(&self) -> &Chip {
        &self.core.get_data().chip
    }

    pub fn chip_mut(&mut self) -> &mut Chip {
        &mut self.core.get_data_mut().chip
    }

    pub fn image(&self) -> &Rc<Image> {
        &self.core.get_data().image
    }

    /// Lets the code of an exception hang from now on: its time passes without progress. 0 is the thread.
    pub fn hang(&mut self, exception: Option<u8>) {
        self.core.get_data_mut().hung = exception;
    }

    /// Counts the instructions of each function from now on.
    pub fn begin_profile(&mut self) {
        self.core.get_data_mut().profile = Some(HashMap::new());
    }

    /// Instructions since [`Machine::begin_profile`] by exception and function, most first.
    pub fn profile(&self) -> Vec<(u8, String, u64)> {
        let state = self.core.get_data();
        let mut functions: HashMap<(u8, String), u64> = HashMap::new();
        for (&(exception, address), instructions) in state.profile.iter().flatten() {
            *functions.entry((exception, state.image.function(address))).or_default() += instructions;
        }
        let mut functions: Vec<_> =
            functions.into_iter().map(|((exception, name), count)| (exception, name, count)).collect();
        functions.sort_by(|a, b| b.2.cmp(&a.2).then_with(|| (a.0, &a.1).cmp(&(b.0, &b.1))));
        functions
    }

    /// Counts the calls of these functions from now on.
    pub fn watch(&mut self, entries: &[u32]) {
        self.core.get_data_mut().watched = entries.iter().copied().map(Watched::new).collect();
    }

    /// Calls since [`Machine::watch`], in its order.
    pub fn calls(&self) -> Vec<Calls> {
        self.core.get_data().watched.iter().map(|watched| watched.calls).collect()
    }

    pub fn memory(&self, address: u32, bytes: &mut [u8]) -> bool {
        self.core.mem_read(address.into(), bytes).is_ok()
    }

    pub fn set_memory(&mut self, address: u32, bytes: &[u8]) -> bool {
        self.core.mem_write(address.into(), bytes).is_ok()
    }

    /// Moves the used part of the stack down until so many bytes are left below it, as deep calls do.
    pub fn use_up_stack(&mut self, left: u32) {
        let top = self.image().word(Region::IMAGE.address).unwrap_or(0);
        let pointer = get(&self.core, Register::SP);
        let mut used = vec![0; top.wrapping_sub(pointer) as usize % RAM_BYTES];
        // A frame's place depends on the pointer's alignment.
        let moved = RAM + (left & !7) + (pointer & 4);
        if self.memory(pointer, &mut used) && self.set_memory(moved, &used) {
            put(&mut self.core, Register::SP, moved);
        }
    }

    pub fn is_asleep(&self) -> bool {
        self.core.get_data().asleep
    }

    /// Continues at another address of the code, outside conditional blocks, with this value in R0 if any.
    pub fn jump(&mut self, address: u32, argument: Option<u32>) {
        let status = get(&self.core, Register::XPSR);
        put(&mut self.core, Register::XPSR_NZCVQG, status & 0xF80F_01FF | 1 << 24);
        put(&mut self.core, Register::APSR_NZCV, status & 0xF000_0000);
        if let Some(argument) = argument {
            put(&mut self.core, Register::R0, argument);
        }
        let state = self.core.get_data_mut();
        (state.resume, state.paid, state.asleep) = (Some(address & !1), false, false);
    }

    /// Starts from the reset vector.
    fn start(&mut self) {
        changes::follow_events(&mut self.core);
        let image = Rc::clone(self.image());
        put(&mut self.core, Register::CONTROL, 0);
        for mask in [Register::PRIMASK, Register::BASEPRI, Register::FAULTMASK] {
            put(&mut self.core, mask, 0);
        }
        put(&mut self.core, Register::XPSR_NZCVQG, 1 << 24);
        put(&mut self.core, Register::APSR_NZCV, 0);
        put(&mut self.core, Register::LR, u32::MAX);
        put(&mut self.core, Register::SP, image.word(FLASH).unwrap_or(0));
        let state = self.core.get_data_mut();
        state.resume = Some(image.word(FLASH + 4).unwrap_or(0) & !1);
        (state.paid, state.asleep, state.locked_up, state.fault) = (false, false, false, None);
        state.hung = None;
        state.follow_clock(true);
    }

    /// Resets the chip as its pin does, and starts again.
    pub fn reset(&mut self, reason: ResetReason) {
        self.chip_mut().reset(reason);
        self.start();
    }

    /// Loses memory, as a power cut does, and starts again; flash cells and plant stay.
    pub fn power_cycle(&mut self) {
        self.core.get_data_mut().chip.rcc = crate::peripherals::rcc::Rcc::new();
        let noise: Vec<u8> = (0..RAM_BYTES).map(|index| (index as u8).wrapping_mul(0x9D) ^ 0xA5).collect();
        self.set_memory(RAM, &noise);
        self.set_memory(CCM, &noise[..CCM_BYTES]);
        self.reset(ResetReason::PowerOn);
    }

    /// Runs until an instant.
    ///
    /// # Errors
    /// The model does not support an action of the processor.
    pub fn run(&mut self, until: Ticks) -> Result<End, ToolError> {
        loop {
            let state = self.core.get_data_mut();
            state.until = until;
            if let Some(reason) = state.chip.reset_request {
                self.reset(reason);
                return Ok(End::Reset(reason));
            }
            if state.chip.flash.is_cut {
                return Ok(End::PowerCut);
            }
            if state.chip.now >= until {
                return Ok(End::Time);
            }
            self.step()?;
        }
    }

    /// Runs until an event stops the processor.
    fn step(&mut self) -> Result<(), ToolError> {
        let state = self.core.get_data_mut();
        let mut pc = state.resume.take().unwrap_or(0);
        if state.asleep {
            match sleep(&mut self.core, pc) {
                Woken::Stopped => {
                    self.core.get_data_mut().resume = Some(pc);
                    return Ok(());
                }
                Woken::Entered(handler) => pc = handler,
                Woken::Continues => {}
            }
        }
        let outcome = self.core.emu_start(u64::from(pc | 1), u64::from(u32::MAX), 0, 0);
        let state = self.core.get_data_mut();
        if let Some(what) = state.broken.take() {
            return Err(ToolError::input(what));
        }
        if state.fault.is_some() {
            return self.take_fault();
        }
        match outcome {
            _ if state.resume.is_some() => Ok(()),
            Ok(()) if code_before(&self.core, get(&self.core, Register::PC)) == Some(WAIT_FOR_INTERRUPT) => {
                let pc = get(&self.core, Register::PC);
                let state = self.core.get_data_mut();
                (state.resume, state.asleep, state.paid) = (Some(pc), true, false);
                Ok(())
            }
            Ok(()) => Err(self.lost("the processor stopped without a reason")),
            Err(error) => Err(self.lost(&format!("the processor stopped: {error:?}"))),
        }
    }

    fn lost(&self, what: &str) -> ToolError {
        let pc = get(&self.core, Register::PC);
        ToolError::input(format!("{what} at {pc:#010x} ({})", self.image().function(pc)))
    }

    /// Enters the hard fault; within one the processor locks up.
    fn take_fault(&mut self) -> Result<(), ToolError> {
        let state = self.core.get_data_mut();
        let Some((status, address)) = state.fault.take() else { return Ok(()) };
        let pc = get(&self.core, Register::PC);
        let state = self.core.get_data_mut();
        state.chip.system.faults[0] |= status;
        state.chip.system.faults[1] |= 1 << 30;
        if status & fault::DATA == fault::DATA {
            state.chip.system.fault_address = address;
        }
        if state.chip.nvic.running() < 0 {
            (state.locked_up, state.asleep, state.resume) = (true, true, Some(pc));
            return Ok(());
        }
        state.chip.nvic.pend(HARD_FAULT, state.chip.now);
        let handler = enter(&mut self.core, HARD_FAULT, pc);
        self.core.get_data_mut().resume = Some(handler);
        Ok(())
    }

    /// Saves processor, peripherals and plant.
    pub fn save(&self) -> Result<Snapshot, ToolError> {
        let mut memory = vec![0; RAM_BYTES + CCM_BYTES];
        let (ram, ccm) = memory.split_at_mut(RAM_BYTES);
        self.core.mem_read(RAM.into(), ram).map_err(broken("a read of its memory"))?;
        self.core.mem_read(CCM.into(), ccm).map_err(broken("a read of its memory"))?;
        let state = self.core.get_data();
        Ok(Snapshot {
            registers: registers().map(|register| read(&self.core, register)).collect(),
            memory,
            chip: state.chip.clone(),
            rest: state.rest,
            resume: state.resume.unwrap_or(0),
            paid: state.paid,
            asleep: state.asleep,
        })
    }

    /// Returns to a saved state, of this machine or of another with the same image.
    ///
    /// # Errors
    /// Unicorn rejects a register or the memory.
    pub fn restore(&mut self, saved: &Snapshot) -> Result<(), ToolError> {
        let (ram, ccm) = saved.memory.split_at(RAM_BYTES);
        self.core.mem_write(RAM.into(), ram).map_err(broken("a write of its memory"))?;
        self.core.mem_write(CCM.into(), ccm).map_err(broken("a write of its memory"))?;
        for (register, value) in registers().zip(&saved.registers) {
            self.core.reg_write(register, u64::from(*value)).map_err(broken("a register"))?;
        }
        let status = get(&self.core, Register::XPSR);
        put(&mut self.core, Register::APSR_NZCV, status & 0xF000_0000);
        let state = self.core.get_data_mut();
        let image = state.chip.flash.region(&Region::IMAGE) != saved.chip.flash.region(&Region::IMAGE);
        state.chip = saved.chip.clone();
        if image {
            state.chip.flash.changed = Some(0..Region::IMAGE.bytes() as usize);
        }
        (state.rest, state.resume) = (saved.rest, Some(saved.resume));
        (state.paid, state.asleep, state.locked_up) = (saved.paid, saved.asleep, false);
        (state.fault, state.hung) = (None, None);
        state.follow_clock(true);
        Ok(())
    }
}

impl State {
    fn new(image: Rc<Image>, chip: Chip, factor: f64) -> Self {
        Self {
            chip,
            image,
            blocks: vec![(0, 0); FLASH_BYTES as usize / 2],
            cost: 0,
            rest: 0,
            cycle: 0,
            factor,
            until: 0,
            resume: None,
            paid: false,
            asleep: false,
            fault: None,
            locked_up: false,
            hung: None,
            broken: None,
            events: (Vec::new(), false),
            profile: None,
            watched: Vec::new(),
            counted: vec![[0; 2]; EXCEPTIONS],
        }
    }

    /// Computes the time of an instruction again after the clock changed.
    fn follow_clock(&mut self, anyway: bool) {
        let cycle = self.chip.rcc.cycle();
        if anyway || cycle != self.cycle {
            self.cycle = cycle;
            self.cost = (self.factor * cycle as f64 * f64::from(1_u32 << FRACTION)).round() as u64;
        }
    }

    /// Adds the time of a block.
    #[inline]
    fn pay(&mut self, address: u32, size: u32) {
        let instructions = self.instructions(address, size);
        self.chip.load.instructions += instructions;
        if let Some(profile) = &mut self.profile {
            *profile.entry((self.chip.nvic.current(), address)).or_default() += instructions;
        }
        let counted = &mut self.counted[usize::from(self.chip.nvic.current())];
        *counted = [counted[0] + instructions, instructions];
        let passed = self.rest + instructions * self.cost;
        self.chip.now += passed >> FRACTION;
        self.rest = passed & ((1 << FRACTION) - 1);
    }

    #[inline]
    fn instructions(&mut self, address: u32, size: u32) -> u64 {
        let Some(known) = self.blocks.get_mut((address.wrapping_sub(FLASH) / 2) as usize) else {
            return u64::from(size / 3).max(1);
        };
        if u32::from(known.0) != size {
            *known = (size as u16, self.image.instructions(address, size) as u16);
        }
        known.1.into()
    }

    /// Stalls the processor while the flash is changed: events go on, nothing executes.
    fn stall(&mut self) {
        let stall = core::mem::take(&mut self.chip.flash.stall);
        let end = self.chip.now + stall;
        while self.chip.now < end && self.chip.reset_request.is_none() {
            self.chip.now = end.min(self.chip.due.max(self.chip.now));
            self.chip.advance();
        }
    }

    fn must_stop(&self) -> bool {
        self.chip.now >= self.until || self.chip.reset_request.is_some() || self.chip.flash.is_cut
    }
}

fn get(core: &Core<'_>, register: impl Into<i32>) -> u32 {
    core.reg_read(register).map_or(0, |value| value as u32)
}

fn put(core: &mut Core<'_>, register: impl Into<i32> + Copy + Debug, value: u32) {
    if core.reg_write(register, u64::from(value)).is_err() {
        core.get_data_mut().broken = Some(format!("register {register:?} cannot be written"));
    }
}

fn map_memory(core: &mut Core<'_>) -> Result<(), unicorn_engine::uc_error> {
    let image = Rc::clone(&core.get_data().image);
    // All sectors but the bootloader's and the image's hold data only; `map_registers` maps them. The
    // bootloader appears at address 0 too.
    for address in [FLASH, 0] {
        core.mem_map(address.into(), FIXED_BYTES as u64, Prot::READ | Prot::EXEC)?;
        core.mem_write(address.into(), &image.flash[..FIXED_BYTES])?;
    }
    let (address, bytes) = (Region::IMAGE.address, Region::IMAGE.bytes());
    core.mem_map(address.into(), bytes.into(), Prot::ALL)?;
    let flash = &mut core.get_data_mut().chip.flash;
    for region in [Region::STATE, Region::PARAMETERS, Region::LOG, Region::IMAGE, Region::NEW_IMAGE] {
        let at = (region.address - FLASH) as usize;
        flash.region_mut(&region).copy_from_slice(&image.flash[at..at + region.bytes() as usize]);
    }
    flash.changed = None;
    core.mem_write(address.into(), &image.flash[(address - FLASH) as usize..][..bytes as usize])?;
    for (address, bytes) in [(RAM, RAM_BYTES), (CCM, CCM_BYTES)] {
        core.mem_map(address.into(), bytes as u64, Prot::READ | Prot::WRITE)?;
        core.mem_write(address.into(), &vec![0xA5; bytes])?;
    }
    core.mem_map(SYSTEM_MEMORY.into(), SYSTEM_BYTES as u64, Prot::READ)?;
    core.mem_write(SYSTEM_MEMORY.into(), &system_memory())
}

fn map_registers(core: &mut Core<'_>) -> Result<(), unicorn_engine::uc_error> {
    core.mmio_map(
        PERIPHERALS.into(),
        PERIPHERAL_BYTES,
        Some(|core: &mut Core<'_>, offset: u64, _: usize| {
            u64::from(core.get_data_mut().chip.read(PERIPHERALS + offset as u32))
        }),
        Some(|core: &mut Core<'_>, offset: u64, size: usize, value: u64| {
            let state = core.get_data_mut();
            state.chip.write(PERIPHERALS + offset as u32, value as u32, size);
            state.follow_clock(false);
            if state.chip.flash.stall > 0 {
                state.stall();
            }
        }),
    )?;
    core.mmio_map(
        PRIVATE.into(),
        PRIVATE_BYTES,
        Some(|core: &mut Core<'_>, offset: u64, size: usize| {
            u64::from(core.get_data_mut().chip.read_private(offset as u32, size))
        }),
        Some(|core: &mut Core<'_>, offset: u64, size: usize, value: u64| {
            core.get_data_mut().chip.write_private(offset as u32, size, value as u32);
        }),
    )?;
    let data = [Region::STATE, Region::PARAMETERS, Region::LOG, Region::NEW_IMAGE];
    data.iter().try_for_each(|region| changes::map_data(core, region))
}

fn add_hooks(core: &mut Core<'_>) -> Result<(), unicorn_engine::uc_error> {
    core.add_block_hook(1, 0, |core, address, size| on_block(core, address as u32, size))?;
    core.add_intr_hook(on_interrupt)?;
    core.add_insn_invalid_hook(on_invalid)?;
    changes::hook(core)?;
    core.add_mem_hook(HookType::MEM_UNMAPPED | HookType::MEM_PROT, 1, 0, |core, kind, address, _, _| {
        let status = match kind {
            MemType::FETCH_UNMAPPED | MemType::FETCH_PROT => fault::FETCH,
            _ => fault::DATA,
        };
        core.get_data_mut().fault = Some((status, address as u32));
        false
    })?;
    Ok(())
}

/// Before a basic block: time, events, stop, interrupts.
fn on_block(core: &mut Core<'_>, address: u32, size: u32) {
    let state = core.get_data_mut();
    if core::mem::take(&mut state.paid) {
        // Counted before the stop.
    } else {
        state.pay(address, size);
    }
    state.chip.findings.pc = address;
    if state.chip.flash.changed.is_some() {
        changes::show(core);
    }
    let state = core.get_data_mut();
    if state.chip.now >= state.chip.due {
        state.chip.advance();
    }
    if state.must_stop() {
        (state.resume, state.paid) = (Some(address), true);
        stop(core);
        return;
    }
    if state.chip.nvic.ready() != 0
        && let Some(handler) = interrupt(core, address)
    {
        return put(core, Register::PC, handler | 1);
    }
    let state = core.get_data();
    if state.hung == Some(state.chip.nvic.current()) {
        // A hung level returns to its block and never runs it.
        return put(core, Register::PC, address | 1);
    }
    if !state.watched.is_empty() {
        calls::follow(core, address);
    }
}

fn stop(core: &mut Core<'_>) {
    if let Err(error) = core.emu_stop() {
        core.get_data_mut().broken = Some(format!("the processor model does not stop: {error:?}"));
    }
}

/// Priority at which the processor runs, base priority included.
fn based(core: &Core<'_>) -> i16 {
    let running = core.get_data().chip.nvic.running();
    let base = get(core, Register::BASEPRI) as i16 & 0xF0;
    if base > 0 { running.min(base) } else { running }
}

/// Priority at which the processor runs, masks included.
fn running(core: &Core<'_>) -> i16 {
    let running = based(core);
    let running = if get(core, Register::PRIMASK) & 1 == 1 { running.min(0) } else { running };
    if get(core, Register::FAULTMASK) & 1 == 1 { running.min(-1) } else { running }
}

/// Enters the interrupt that preempts code at `pc`, if one does; returns its handler.
fn interrupt(core: &mut Core<'_>, pc: u32) -> Option<u32> {
    let nvic = &core.get_data().chip.nvic;
    nvic.preempting(nvic.running())?;
    let exception = core.get_data().chip.nvic.preempting(running(core))?;
    Some(enter(core, exception, pc))
}

/// Registers of a frame, except PC and status.
const STACKED: [Register; 6] =
    [Register::R0, Register::R1, Register::R2, Register::R3, Register::R12, Register::LR];

/// Registers that a saved machine holds besides R0 to R12 and the single-precision ones. Unicorn's own saved
/// contexts belong to one instance.
const SAVED: [Register; 8] = [
    Register::CONTROL,
    Register::XPSR_NZCVQG,
    Register::SP,
    Register::LR,
    Register::PRIMASK,
    Register::BASEPRI,
    Register::FAULTMASK,
    Register::FPSCR,
];

/// All saved registers, as Unicorn's numbers.
fn registers() -> impl Iterator<Item = i32> {
    let general = Register::R0 as i32..=Register::R12 as i32;
    SAVED.into_iter().map(|register| register as i32).chain(general).chain((0..32).map(single))
}

/// Value of a saved register; the program status is read whole.
fn read(core: &Core<'_>, register: i32) -> u32 {
    get(core, if register == Register::XPSR_NZCVQG as i32 { Register::XPSR as i32 } else { register })
}

/// Number of a single-precision register for Unicorn.
fn single(number: i32) -> i32 {
    Register::S0 as i32 + number
}

/// Stores a frame and enters an exception; returns its handler.
fn enter(core: &mut Core<'_>, exception: u8, pc: u32) -> u32 {
    let status = get(core, Register::XPSR) | 1 << 24;
    let floats = get(core, Register::CONTROL) & 4 != 0;
    let sp = get(core, Register::SP);
    let odd = sp >> 2 & 1;
    let mut frame = Vec::with_capacity(26);
    frame.extend(STACKED.map(|register| get(core, register)));
    frame.extend([pc & !1, status & !(1 << 9) | odd << 9]);
    if floats {
        frame.extend((0..16).map(|number| get(core, single(number))));
        frame.extend([get(core, Register::FPSCR), 0]);
    }
    let sp = sp.wrapping_sub(4 * odd + 4 * frame.len() as u32);
    let bytes: Vec<u8> = frame.iter().flat_map(|word| word.to_le_bytes()).collect();
    let stored = core.mem_write(sp.into(), &bytes).is_ok();
    put(core, Register::SP, sp);
    let nested = core.get_data().chip.nvic.depth() > 0;
    let link = if nested { 0xFFFF_FFF1 } else { 0xFFFF_FFF9_u32 } & !if floats { 0x10 } else { 0 };
    let mut exception = exception;
    if !stored {
        let state = core.get_data_mut();
        state.chip.system.faults[0] |= fault::STACKING;
        state.chip.system.faults[1] |= 1 << 30;
        exception = HARD_FAULT;
    }
    vector(core, exception, status, link, ENTRY)
}

/// Makes an exception active after its frame was stored; returns its handler.
fn vector(core: &mut Core<'_>, exception: u8, status: u32, link: u32, cycles: Ticks) -> u32 {
    let state = core.get_data_mut();
    let chip = &mut state.chip;
    if exception == HARD_FAULT {
        chip.hard_fault = chip.hard_fault.or(Some(chip.now));
    }
    let pended = chip.nvic.pended.get(usize::from(exception)).copied().unwrap_or(chip.now);
    chip.now += cycles * state.cycle;
    chip.nvic.enter(exception);
    chip.load.enter(exception, pended, chip.now);
    chip.event = true;
    let table = if chip.system.vectors == 0 { FLASH } else { chip.system.vectors };
    let handler = state.image.word(table + 4 * u32::from(exception)).unwrap_or(0);
    // Interrupted conditional blocks are restored from the frame.
    put(core, Register::XPSR_NZCVQG, status & 0xF80F_0000 | 1 << 24 | u32::from(exception));
    put(core, Register::CONTROL, 0);
    put(core, Register::APSR_NZCV, status & 0xF000_0000);
    put(core, Register::LR, link);
    handler & !1
}

/// Events that Unicorn reports by number: 2 supervisor call, 8 return from an exception.
fn on_interrupt(core: &mut Core<'_>, number: u32) {
    match number {
        8 => {
            let link = get(core, Register::PC) | 1;
            let pc = leave(core, link);
            put(core, Register::PC, pc | 1);
        }
        2 => {
            let pc = get(core, Register::PC);
            if !core.get_data().chip.nvic.preempts(SUPERVISOR_CALL, running(core)) {
                // A call that cannot run is a hard fault (B1.5.5).
                core.get_data_mut().fault = Some((0, 0));
                return stop(core);
            }
            let now = core.get_data().chip.now;
            core.get_data_mut().chip.nvic.pend(SUPERVISOR_CALL, now);
            let handler = enter(core, SUPERVISOR_CALL, pc);
            put(core, Register::PC, handler | 1);
        }
        _ => {
            core.get_data_mut().fault = Some((fault::INSTRUCTION, 0));
            stop(core);
        }
    }
}

/// Leaves an exception, or enters the next one with the same frame; returns the address to continue at.
fn leave(core: &mut Core<'_>, link: u32) -> u32 {
    let state = core.get_data_mut();
    let now = state.chip.now;
    let left = state.chip.nvic.leave(now);
    state.chip.load.leave(now);
    state.chip.event = true;
    if left != Some(NMI) {
        put(core, Register::FAULTMASK, 0);
    }
    let next = core.get_data().chip.nvic.preempting(running(core));
    if let Some(next) = next {
        let status = get(core, Register::XPSR);
        return vector(core, next, status, link, CHAINED);
    }
    let floats = link & 0x10 == 0;
    let sp = get(core, Register::SP);
    let mut bytes = [0; 4 * 26];
    let bytes = &mut bytes[..4 * if floats { 26 } else { 8 }];
    if core.mem_read(sp.into(), bytes).is_err() {
        core.get_data_mut().fault = Some((fault::STACKING, 0));
        stop(core);
        return link;
    }
    let word = |index: usize| u32::from_le_bytes([0, 1, 2, 3].map(|byte| bytes[4 * index + byte]));
    for (index, register) in STACKED.into_iter().enumerate() {
        put(core, register, word(index));
    }
    if floats {
        for number in 0..16 {
            put(core, single(number), word(8 + number as usize));
        }
        put(core, Register::FPSCR, word(24));
    }
    let (pc, status) = (word(6), word(7));
    put(core, Register::SP, sp + bytes.len() as u32 + 4 * (status >> 9 & 1));
    put(core, Register::XPSR_NZCVQG, status & !(1 << 9));
    put(core, Register::CONTROL, if floats { FLOATS } else { 0 });
    put(core, Register::APSR_NZCV, status & 0xF000_0000);
    let state = core.get_data_mut();
    state.chip.now += RETURN * state.cycle;
    pc & !1
}

/// End of a sleep.
enum Woken {
    /// The program continues.
    Continues,
    /// An interrupt's handler continues.
    Entered(u32),
    /// The run ends while asleep.
    Stopped,
}

/// Halfword before an address.
fn code_before(core: &Core<'_>, pc: u32) -> Option<u16> {
    let mut code = [0; 2];
    core.mem_read(pc.wrapping_sub(2).into(), &mut code).ok()?;
    Some(u16::from_le_bytes(code))
}

/// Instructions that Unicorn does not execute: wait for event, and unknown ones.
fn on_invalid(core: &mut Core<'_>) -> bool {
    let pc = get(core, Register::PC);
    if code_before(core, pc) != Some(WAIT_FOR_EVENT) {
        core.get_data_mut().fault = Some((fault::INSTRUCTION, 0));
        return false;
    }
    match sleep(core, pc) {
        Woken::Continues => {}
        Woken::Entered(handler) => put(core, Register::PC, handler | 1),
        Woken::Stopped => {
            let state = core.get_data_mut();
            (state.resume, state.asleep, state.paid) = (Some(pc), true, false);
            stop(core);
        }
    }
    true
}

/// Sleeps until an event, or until an interrupt that would preempt without its mask (ARMv7-M B1.5.17,
/// B1.5.18); `pc` is the address after the instruction.
fn sleep(core: &mut Core<'_>, pc: u32) -> Woken {
    let for_interrupt = code_before(core, pc) == Some(WAIT_FOR_INTERRUPT);
    loop {
        let state = core.get_data_mut();
        state.asleep = false;
        if state.locked_up {
            // Only a reset ends this state.
        } else if !for_interrupt && core::mem::take(&mut state.chip.event) || state.hung == Some(0) {
            return Woken::Continues;
        } else if state.chip.nvic.ready() != 0 {
            if !for_interrupt && state.chip.wakes_when_pending() {
                return Woken::Continues;
            }
            if let Some(handler) = interrupt(core, pc) {
                return Woken::Entered(handler);
            }
            if for_interrupt && core.get_data().chip.nvic.preempting(based(core)).is_some() {
                return Woken::Continues;
            }
        }
        let state = core.get_data_mut();
        if state.must_stop() {
            state.asleep = true;
            return Woken::Stopped;
        }
        let begun = state.chip.now;
        let next = state.chip.due.min(state.until).max(begun);
        debug_assert!(next != NEVER);
        state.chip.now = next;
        state.chip.load.sleep(next - begun);
        state.chip.debug.woke(begun, next);
        state.chip.advance();
    }
}
