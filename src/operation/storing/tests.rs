extern crate std;

use std::vec::Vec;

use super::super::testing::{TestHardware, TestWatchdog};
use super::*;

/// A board around a change of the flash, with its clock in milliseconds.
struct Bench {
    hardware: TestHardware<2>,
    inhibit: Inhibit,
    permission: Permission,
    now_ms: u64,
    /// Becomes so at this time.
    later: Option<(u64, Permission, u32)>,
    /// When `storing` was raised and let go.
    storing: Vec<(u64, bool)>,
}

impl Bench {
    fn off() -> Self {
        Self {
            hardware: TestHardware::new(),
            inhibit: Inhibit::new(),
            permission: Permission::Released,
            now_ms: 0,
            later: None,
            storing: Vec::new(),
        }
    }

    /// A board whose watchdog takes so long for a write.
    fn with_watchdog(takes_ms: Option<u64>) -> Self {
        let mut bench = Self::off();
        bench.hardware.watchdog.takes_ms = takes_ms;
        bench
    }

    fn step(&mut self, storing: &mut Storing, change: impl FnOnce() -> bool) -> Option<bool> {
        let before = self.inhibit.is_storing();
        let done = storing.step(&self.inhibit, self.permission, &mut self.hardware, change);
        if self.inhibit.is_storing() != before {
            self.storing.push((self.now_ms, !before));
        }
        done
    }

    fn look_after(&mut self, storing: &mut Storing) {
        storing.look_after(&self.inhibit, &mut self.hardware);
    }

    fn pass(&mut self) {
        self.now_ms += 1;
        self.hardware.watchdog.pass(1);
        if let Some((_, permission, causes)) = self.later.take_if(|(when, ..)| *when <= self.now_ms) {
            self.permission = permission;
            self.inhibit.raise_bits(causes);
        }
    }

    fn causes(&self) -> u32 {
        self.inhibit.causes()
    }
}

/// Whether it was done, and how often the flash was touched.
fn change(storing: &mut Storing, bench: &mut Bench) -> (bool, u32) {
    change_with(storing, bench, true)
}

fn change_with(storing: &mut Storing, bench: &mut Bench, says: bool) -> (bool, u32) {
    let mut touched = 0;
    for _ in 0..1000 {
        let change = || {
            touched += 1;
            says
        };
        if let Some(done) = bench.step(storing, change) {
            return (done, touched);
        }
        bench.pass();
    }
    panic!("it does not end");
}

/// The watchdog took its usual time at the start.
fn settled() -> Storing {
    let mut storing = Storing::new();
    Bench::off().look_after(&mut storing);
    storing
}

#[test]
fn a_watchdog_with_the_starts_time_keeps_the_drive_off_after_a_reset_as_well() {
    let (mut storing, mut bench) = (Storing::new(), Bench::with_watchdog(None));
    bench.hardware.watchdog.stretched = true;
    for _ in 0..3 {
        bench.look_after(&mut storing);
        assert_eq!(bench.causes(), Cause::Watchdog.bit());
        // The operator's reset.
        bench.inhibit = Inhibit::new();
        assert_eq!(change(&mut storing, &mut bench), (false, 0));
    }
    bench.hardware.watchdog = TestWatchdog { takes_ms: Some(3), ..TestWatchdog::default() };
    bench.look_after(&mut storing);
    assert_eq!((bench.causes(), change(&mut storing, &mut bench)), (0, (true, 1)));
}

#[test]
fn the_flash_is_changed_between_a_watchdog_that_is_stretched_and_one_that_is_tight_again() {
    let (mut storing, mut bench) = (settled(), Bench::off());
    assert_eq!(change(&mut storing, &mut bench), (true, 1));
    assert_eq!(
        (bench.hardware.watchdog.stretched, bench.hardware.watchdog.under_way, bench.causes()),
        (false, None, 0)
    );
    // 20 ms of announcement, twice 48 ms of the watchdog's, some to step on, one of them for the current loops.
    assert_eq!(bench.storing, [(0, true), (119, false)]);
}

#[test]
fn what_is_not_done_is_said() {
    let (mut storing, mut bench) = (settled(), Bench::off());
    assert_eq!(change_with(&mut storing, &mut bench, false), (false, 1));
    assert_eq!((bench.causes(), bench.hardware.watchdog.stretched), (0, false));
}

#[test]
fn nothing_is_touched_while_the_drive_is_on_or_something_forbids_to_enable() {
    let brakes = Cause::EncoderFrozen.bit();
    for (permission, causes) in [
        (Permission::Follow, 0),
        (Permission::Damp, 0),
        (Permission::Released, brakes),
        (Permission::Released, Cause::EmergencyStop.bit()),
    ] {
        let mut bench = Bench { permission, ..Bench::off() };
        bench.inhibit.raise_bits(causes);
        assert_eq!(change(&mut settled(), &mut bench), (false, 0), "{permission:?} {causes:#x}");
        // Nobody is released for it either.
        assert_eq!((bench.causes(), bench.storing), (causes, Vec::new()));
    }
}

#[test]
fn a_drive_that_was_enabled_in_the_last_moment_is_seen_after_the_announcement() {
    for later in [(1, Permission::Damp, 0), (20, Permission::Follow, 0), (7, Permission::Released, 1)] {
        let mut bench = Bench { later: Some(later), ..Bench::off() };
        assert_eq!(change(&mut settled(), &mut bench), (false, 0), "{later:?}");
        assert_eq!(bench.storing, [(0, true), (21, false)]);
        assert_eq!(bench.hardware.watchdog.under_way, None);
    }
}

#[test]
fn a_watchdog_that_does_not_take_its_time_keeps_the_flash_as_it_is_and_the_drive_off() {
    let (mut storing, mut bench) = (settled(), Bench::off());
    bench.hardware.watchdog.takes_ms = None;
    assert_eq!(change(&mut storing, &mut bench), (false, 0));
    // Nobody knows which time it has: enabled again only once that is known.
    assert_eq!(bench.causes(), Cause::Watchdog.bit());
    bench.inhibit = Inhibit::new();
    bench.look_after(&mut storing);
    assert_eq!(bench.causes(), Cause::Watchdog.bit());
    bench.inhibit = Inhibit::new();
    assert_eq!(change(&mut storing, &mut bench), (false, 0));
    bench.hardware.watchdog = TestWatchdog { takes_ms: Some(3), ..TestWatchdog::default() };
    bench.look_after(&mut storing);
    assert_eq!((bench.causes(), storing), (0, settled()));
    assert_eq!(change(&mut storing, &mut bench), (true, 1));
}

#[test]
fn a_watchdog_that_was_stretched_and_does_not_come_back_keeps_the_drive_off_until_it_does() {
    let (mut storing, mut bench) = (settled(), Bench::off());
    bench.hardware.watchdog.takes_ms = Some(150);
    assert_eq!(change(&mut storing, &mut bench), (true, 1));
    bench.hardware.watchdog.takes_ms = Some(190);
    let mut slow = Bench::with_watchdog(Some(190));
    assert_eq!((change(&mut storing, &mut slow), slow.causes()), ((true, 1), 0));
    // Asked in every round of the keeper from then on.
    let mut stuck = Bench::with_watchdog(None);
    stuck.hardware.watchdog.stretched = true;
    let mut storing = Storing::new();
    stuck.look_after(&mut storing);
    assert_eq!(stuck.causes(), Cause::Watchdog.bit());
    stuck.hardware.watchdog.pass(u64::MAX);
    stuck.look_after(&mut storing);
    assert_eq!(storing, settled());
}
