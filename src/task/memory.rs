//! Static memory of the large objects.
//!
//! The identification lies in core-coupled memory; its window of blocks, half of the total, and the nodes of
//! the bus in the other memory.
#![expect(unsafe_code, reason = "sections of the linker script")]

use static_cell::{ConstStaticCell, StaticCell};

use super::bus;
use super::leg::{JOINTS, LEG, Leg, LegIdentification, LegWindow};
use super::storage::StorageTask;
use crate::board::odrive_v3_6::flash::SmallSectors;
use crate::leg::Filters;
use crate::operation::EventQueue;
use scarab_boot::Region;

#[unsafe(link_section = ".ccm.identification")]
static IDENTIFICATION: StaticCell<LegIdentification> = StaticCell::new();

#[unsafe(link_section = ".ccm.configuration")]
static CONFIGURATION: StaticCell<Leg> = StaticCell::new();

/// Configuration and identification of this leg, once; `None` where the description is invalid.
#[inline(never)]
pub fn identification() -> Option<(&'static Leg, &'static mut LegIdentification)> {
    static WINDOW: ConstStaticCell<LegWindow> = ConstStaticCell::new(LegWindow::EMPTY);
    let configuration: &'static Leg = CONFIGURATION.init(LEG.configuration().ok()?);
    let filters = Filters::new(configuration.bandwidth_hz).ok()?;
    let window = WINDOW.take();
    let built = LegIdentification::new_in(IDENTIFICATION.uninit(), configuration, &filters, window);
    Some((configuration, built))
}

#[unsafe(link_section = ".ccm.events")]
static EVENTS: StaticCell<EventQueue<JOINTS>> = StaticCell::new();

/// Queue from the servo to the identification, once.
pub fn events() -> &'static mut EventQueue<JOINTS> {
    EVENTS.init_with(EventQueue::new)
}

static DEVICE: StaticCell<bus::BoardDevice> = StaticCell::new();

/// Nodes and axes of the bus, once.
#[inline(never)]
pub fn device(build: impl FnOnce() -> bus::BoardDevice) -> &'static mut bus::BoardDevice {
    DEVICE.init_with(build)
}

#[unsafe(link_section = ".ccm.bus")]
static BUS: StaticCell<bus::Memory> = StaticCell::new();

/// Data exchanged between the bus and the other levels, once.
#[inline(never)]
pub fn bus() -> &'static mut bus::Memory {
    bus::Memory::new_in(BUS.uninit())
}

/// Task state of the storage, once; `None` where the flash has no valid size.
#[inline(never)]
pub fn storage() -> Option<&'static mut StorageTask> {
    static STORAGE: StaticCell<StorageTask> = StaticCell::new();
    Some(STORAGE.init(StorageTask::new(SmallSectors::parameters(), Region::PARAMETERS.bytes())?))
}
