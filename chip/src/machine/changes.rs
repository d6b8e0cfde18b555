//! Changes of the flash by the processor: data sectors, the image's own sectors, and what follows for the
//! model of the processor.

use super::*;

/// Maps sectors of the flash from which nothing is executed.
pub(super) fn map_data(core: &mut Core<'_>, region: &Region) -> Result<(), unicorn_engine::uc_error> {
    let first = region.address - FLASH;
    core.mmio_map(
        region.address.into(),
        region.bytes().into(),
        Some(move |core: &mut Core<'_>, offset: u64, size: usize| {
            u64::from(core.get_data_mut().chip.load_flash(first + offset as u32, size))
        }),
        Some(move |core: &mut Core<'_>, offset: u64, size: usize, value: u64| {
            let state = core.get_data_mut();
            state.chip.program_flash(first + offset as u32, size, value as u32);
            state.stall();
        }),
    )
}

/// Hooks stores to the image's sectors.
pub(super) fn hook(core: &mut Core<'_>) -> Result<(), unicorn_engine::uc_error> {
    // The processor's store follows the hook; [`show`] then replaces it by what the flash holds.
    let (first, bytes) = (Region::IMAGE.address, Region::IMAGE.bytes());
    core.add_mem_hook(
        HookType::MEM_WRITE,
        first.into(),
        u64::from(first + bytes) - 1,
        |core, _, address, size, value| {
            let state = core.get_data_mut();
            let offset = address as u32 - FLASH;
            state.chip.program_flash(offset, size, value as u32);
            let at = (address as u32 - Region::IMAGE.address) as usize;
            let changed = state.chip.flash.changed.get_or_insert(at..at + size);
            *changed = changed.start.min(at)..changed.end.max(at + size);
            state.stall();
            true
        },
    )?;
    Ok(())
}

/// Copies changes of the image's sectors to where the processor reads and executes them.
pub(super) fn show(core: &mut Core<'_>) {
    let state = core.get_data_mut();
    let Some(changed) = state.chip.flash.changed.take() else { return };
    let bytes = state.chip.flash.region(&Region::IMAGE)[changed.clone()].to_vec();
    let at = (Region::IMAGE.address - FLASH) as usize + changed.start;
    Rc::make_mut(&mut state.image).flash[at..at + bytes.len()].copy_from_slice(&bytes);
    state.events.1 = false;
    state.blocks[at / 2..(at + bytes.len()).div_ceil(2)].fill((0, 0));
    if core.mem_write(u64::from(FLASH) + at as u64, &bytes).is_err() {
        core.get_data_mut().broken = Some("the image's sectors cannot be changed".to_owned());
    }
}

/// Hooks the image's SEV instructions, which Unicorn ignores, again after the image has changed.
pub(super) fn follow_events(core: &mut Core<'_>) {
    if core.get_data().events.1 {
        return;
    }
    for before in core::mem::take(&mut core.get_data_mut().events.0) {
        let _ = core.remove_hook(before);
    }
    let found = core.get_data().image.find(SEND_EVENT);
    let hooks = found.into_iter().map(|address| {
        core.add_code_hook(address.into(), address.into(), |core, _, _| {
            core.get_data_mut().chip.event = true;
        })
    });
    match hooks.collect() {
        Ok(hooks) => core.get_data_mut().events = (hooks, true),
        Err(error) => core.get_data_mut().broken = Some(format!("no hook on an instruction: {error:?}")),
    }
}
