//! Where the identification lies: in the memory that only the processor reaches; its window of blocks, half of it all, in the other.
#![expect(unsafe_code, reason = "a section of the linker's")]

use static_cell::{ConstStaticCell, StaticCell};

use crate::leg::Filters;
use super::flash::Flash;
use super::settings::flash::BYTES;
use crate::task::{EventQueue, bus};
use crate::task::keep::Keeper;
use crate::task::leg::{JOINTS, LEG, Leg, LegIdentification, LegWindow};

#[unsafe(link_section = ".ccm.identification")]
static IDENTIFICATION: StaticCell<LegIdentification> = StaticCell::new();

#[unsafe(link_section = ".ccm.configuration")]
static CONFIGURATION: StaticCell<Leg> = StaticCell::new();

/// What this leg is built from, and its identification, once; `None` where the description makes no leg.
#[inline(never)]
pub fn identification() -> Option<(&'static Leg, &'static mut LegIdentification)> {
    static WINDOW: ConstStaticCell<LegWindow> = ConstStaticCell::new(LegWindow::EMPTY);
    let configuration: &'static Leg = CONFIGURATION.init(LEG.configuration().ok()?);
    let filters = Filters::new(configuration.bandwidth_hz).ok()?;
    let window = WINDOW.take();
    let built = LegIdentification::place(IDENTIFICATION.uninit(), configuration, &filters, window);
    Some((configuration, built))
}

#[unsafe(link_section = ".ccm.told")]
static EVENTS: StaticCell<EventQueue<JOINTS>> = StaticCell::new();

/// The queue from the servo to the identification, once.
pub fn events() -> &'static mut EventQueue<JOINTS> {
    EVENTS.init_with(EventQueue::new)
}

#[unsafe(link_section = ".ccm.station")]
static STATION: StaticCell<bus::BoardStation> = StaticCell::new();

/// The nodes and axes, once.
#[inline(never)]
pub fn station(build: impl FnOnce() -> bus::BoardStation) -> &'static mut bus::BoardStation {
    STATION.init_with(build)
}

#[unsafe(link_section = ".ccm.bus")]
static BUS: StaticCell<bus::Memory> = StaticCell::new();

/// What passes between the bus and the others, once.
#[inline(never)]
pub fn bus() -> &'static mut bus::Memory {
    bus::Memory::place(BUS.uninit())
}

/// Whoever keeps what outlives the power, once; `None` where the flash cannot.
#[inline(never)]
pub fn keeper() -> Option<&'static mut Keeper> {
    static KEEPER: StaticCell<Keeper> = StaticCell::new();
    Some(KEEPER.init(Keeper::new(Flash::new(), BYTES)?))
}
