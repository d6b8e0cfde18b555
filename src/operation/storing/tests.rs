use super::super::testing::{TestHardware, TestWatchdog};
use super::*;

/// A board during a flash write, with its clock in milliseconds.
struct Bench {
    hardware: TestHardware<2>,
    inhibit: Inhibit,
    permission: Permission,
    now_ms: u64,
    /// Time at which the permission changes and these inhibit bits are set.
    later: Option<(u64, Permission, u32)>,
    /// Times at which `storing` was set and cleared.
    storing: Vec<(u64, bool)>,
}

impl Bench {
    fn off() -> Self {
        Self {
            hardware: TestHardware::new(),
            inhibit: Inhibit::new(),
            permission: Permission::Off,
            now_ms: 0,
            later: None,
            storing: Vec::new(),
        }
    }

    /// A board whose watchdog needs some time for a write, or never finishes.
    fn with_watchdog(takes_ms: Option<u64>) -> Self {
        let mut bench = Self::off();
        bench.hardware.watchdog.takes_ms = takes_ms;
        bench
    }

    fn step(&mut self, storing: &mut Storing, change: impl FnOnce() -> Option<bool>) -> Option<bool> {
        let before = self.inhibit.is_storing();
        let done =
            storing.step(&self.inhibit, self.permission, Purpose::Parameters, &mut self.hardware, change);
        if self.inhibit.is_storing() != before {
            self.storing.push((self.now_ms, !before));
        }
        done
    }

    fn supervise(&mut self, storing: &mut Storing) {
        storing.supervise(&self.inhibit, &mut self.hardware);
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

/// Returns whether the write succeeded, and the number of flash accesses.
fn change(storing: &mut Storing, bench: &mut Bench) -> (bool, u32) {
    change_with(storing, bench, true, |_| ())
}

/// As [`change`], with a flash that succeeds or fails; `before` may change the board before each step.
fn change_with(
    storing: &mut Storing,
    bench: &mut Bench,
    says: bool,
    before: impl Fn(&mut Bench),
) -> (bool, u32) {
    let mut touched = 0;
    for _ in 0..1000 {
        before(bench);
        let change = || {
            touched += 1;
            Some(says)
        };
        if let Some(done) = bench.step(storing, change) {
            return (done, touched);
        }
        bench.pass();
    }
    panic!("the write does not end");
}

/// State in which the watchdog has taken its usual period at the start.
fn settled() -> Storing {
    let mut storing = Storing::new();
    Bench::off().supervise(&mut storing);
    storing
}

#[test]
fn a_watchdog_with_the_starts_period_keeps_the_drive_off() {
    let (mut storing, mut bench) = (Storing::new(), Bench::with_watchdog(None));
    bench.hardware.watchdog.stretched = true;
    for _ in 0..3 {
        bench.supervise(&mut storing);
        assert_eq!(bench.causes(), InhibitReason::Watchdog.bit());
        // The operator's reset.
        bench.inhibit = Inhibit::new();
        assert_eq!(change(&mut storing, &mut bench), (false, 0));
    }
    bench.hardware.watchdog = TestWatchdog { takes_ms: Some(3), ..TestWatchdog::default() };
    bench.supervise(&mut storing);
    assert_eq!((bench.causes(), change(&mut storing, &mut bench)), (0, (true, 1)));
}

#[test]
fn the_watchdog_is_stretched_during_a_flash_write() {
    let (mut storing, mut bench) = (settled(), Bench::off());
    assert_eq!(change(&mut storing, &mut bench), (true, 1));
    let watchdog = bench.hardware.watchdog;
    assert_eq!((watchdog.stretched, watchdog.under_way, bench.causes()), (false, None, 0));
    // 20 ms for the announcement, twice 48 ms for the watchdog, three steps, of which one is for the current
    // loops.
    assert_eq!(bench.storing, [(0, true), (119, false)]);
}

#[test]
fn a_failed_write_is_reported() {
    let (mut storing, mut bench) = (settled(), Bench::off());
    assert_eq!(change_with(&mut storing, &mut bench, false, |_| ()), (false, 1));
    assert_eq!((bench.causes(), bench.hardware.watchdog.stretched), (0, false));
}

#[test]
fn nothing_is_written_while_the_drive_is_on_or_inhibited() {
    let brakes = InhibitReason::EncoderFrozen.bit();
    for (permission, causes) in [
        (Permission::Follow, 0),
        (Permission::Damp, 0),
        (Permission::Off, brakes),
        (Permission::Off, InhibitReason::EmergencyStop.bit()),
    ] {
        let mut bench = Bench { permission, ..Bench::off() };
        bench.inhibit.raise_bits(causes);
        assert_eq!(change(&mut settled(), &mut bench), (false, 0), "{permission:?} {causes:#x}");
        // The bridges stay as they are.
        assert_eq!((bench.causes(), bench.storing), (causes, Vec::new()));
    }
}

#[test]
fn a_low_supply_of_the_processor_inhibits_and_prevents_the_write() {
    let low = InhibitReason::ProcessorSupply.bit();
    let mut bench = Bench::off();
    bench.hardware.processor_supply_is_low = true;
    assert_eq!(change(&mut settled(), &mut bench), (false, 0));
    assert_eq!((bench.causes(), bench.storing), (low, Vec::new()));
    // The supply falls during the announcement.
    let mut bench = Bench::off();
    let fall = |bench: &mut Bench| bench.hardware.processor_supply_is_low = bench.now_ms >= 10;
    assert_eq!(change_with(&mut settled(), &mut bench, true, fall), (false, 0));
    assert_eq!((bench.causes(), bench.storing), (low, vec![(0, true), (21, false)]));
    // A drive that is on is no reason to look at the supply, which would turn it off.
    let mut bench = Bench { permission: Permission::Follow, ..Bench::off() };
    bench.hardware.processor_supply_is_low = true;
    assert_eq!((change(&mut settled(), &mut bench), bench.causes()), ((false, 0), 0));
}

#[test]
fn a_drive_enabled_during_the_announcement_prevents_the_write() {
    for later in [(1, Permission::Damp, 0), (20, Permission::Follow, 0), (7, Permission::Off, 1)] {
        let mut bench = Bench { later: Some(later), ..Bench::off() };
        assert_eq!(change(&mut settled(), &mut bench), (false, 0), "{later:?}");
        assert_eq!(bench.storing, [(0, true), (21, false)]);
        assert_eq!(bench.hardware.watchdog.under_way, None);
    }
}

#[test]
fn a_watchdog_that_keeps_its_period_prevents_the_write() {
    let (mut storing, mut bench) = (settled(), Bench::off());
    bench.hardware.watchdog.takes_ms = None;
    assert_eq!(change(&mut storing, &mut bench), (false, 0));
    // The watchdog's period is unknown: the drive stays off until it is known.
    assert_eq!(bench.causes(), InhibitReason::Watchdog.bit());
    bench.inhibit = Inhibit::new();
    bench.supervise(&mut storing);
    assert_eq!(bench.causes(), InhibitReason::Watchdog.bit());
    bench.inhibit = Inhibit::new();
    assert_eq!(change(&mut storing, &mut bench), (false, 0));
    bench.hardware.watchdog = TestWatchdog { takes_ms: Some(3), ..TestWatchdog::default() };
    bench.supervise(&mut storing);
    assert_eq!((bench.causes(), storing), (0, settled()));
    assert_eq!(change(&mut storing, &mut bench), (true, 1));
}

#[test]
fn the_drive_stays_off_until_the_watchdog_is_tight_again() {
    let (mut storing, mut bench) = (settled(), Bench::off());
    bench.hardware.watchdog.takes_ms = Some(150);
    assert_eq!(change(&mut storing, &mut bench), (true, 1));
    bench.hardware.watchdog.takes_ms = Some(190);
    let mut slow = Bench::with_watchdog(Some(190));
    assert_eq!((change(&mut storing, &mut slow), slow.causes()), ((true, 1), 0));
    // The watchdog is checked regularly from then on.
    let mut stuck = Bench::with_watchdog(None);
    stuck.hardware.watchdog.stretched = true;
    let mut storing = Storing::new();
    stuck.supervise(&mut storing);
    assert_eq!(stuck.causes(), InhibitReason::Watchdog.bit());
    stuck.hardware.watchdog.pass(u64::MAX);
    stuck.supervise(&mut storing);
    assert_eq!(storing, settled());
}

#[test]
fn a_new_image_is_taken_despite_an_inhibit_reason_but_not_while_motors_brake() {
    for (causes, permitted) in [
        (0, true),
        (InhibitReason::EmergencyStop.bit(), true),
        (InhibitReason::EncoderFrozen.bit(), false),
        (InhibitReason::EncoderFrozen.bit() | InhibitReason::EmergencyStop.bit(), true),
    ] {
        let (mut storing, mut bench) = (settled(), Bench::off());
        bench.inhibit.raise_bits(causes);
        let mut steps = 0;
        let done = (0..1000).find_map(|_| {
            let change = || {
                steps += 1;
                (steps == 5).then_some(true)
            };
            let Bench { hardware, inhibit, permission, .. } = &mut bench;
            let done = storing.step(inhibit, *permission, Purpose::Program, hardware, change);
            bench.pass();
            done
        });
        assert_eq!((done, steps), (Some(permitted), if permitted { 5 } else { 0 }), "{causes:#x}");
        assert_eq!(bench.causes(), causes);
    }
}
