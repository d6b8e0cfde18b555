//! Level 6 on the board: the tasks around `operation::Housekeeper` and `operation::Watch`.

use embassy_time::{Duration, Ticker};

use super::SIGNALS;
use super::leg::JOINTS;
use crate::board::odrive_v3_6::hardware::Odrive;
use crate::board::windings;
use crate::operation::{Housekeeper, HousekeepingEnds, RATE_HZ, Watch};
use crate::safety::GUARD_RATE_HZ;

/// Turns both bridges off where current ticks stop, and feeds the watchdog while everything else runs.
#[embassy_executor::task]
pub async fn watch() -> ! {
    let mut ticker = Ticker::every(Duration::from_hz(u64::from(GUARD_RATE_HZ)));
    let mut watch = Watch::new(&SIGNALS);
    loop {
        ticker.next().await;
        // Late checks are not made up for: two in a row would read the same count.
        ticker.reset();
        watch.check(&SIGNALS, &mut Odrive);
    }
}

/// Runs all other work of this level.
#[embassy_executor::task]
pub async fn run(
    mut keeper: Housekeeper<JOINTS>,
    mut ends: HousekeepingEnds<'static, JOINTS>,
    mut board: Odrive,
) -> ! {
    let mut ticker = Ticker::every(Duration::from_hz(u64::from(RATE_HZ)));
    loop {
        ticker.next().await;
        // A late round is not made up for: the waits of a gate drivers' reset are counted in rounds.
        ticker.reset();
        keeper.round(&mut ends, &SIGNALS, &mut board);
        windings::store(core::array::from_fn(|joint| SIGNALS.winding_c(joint)));
    }
}
