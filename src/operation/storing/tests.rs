extern crate std;

use std::vec::Vec;

use super::*;

/// The watchdog's registers: a write while one is under way is ignored.
#[derive(Clone, Copy, Debug, Default)]
struct Watchdog {
    stretched: bool,
    /// Milliseconds until what was written counts, and what that is.
    under_way: Option<(u64, bool)>,
    /// A write takes so long; `None` for ever.
    takes_ms: Option<u64>,
}

impl Watchdog {
    fn ask(&mut self, stretched: bool) -> bool {
        if self.under_way.is_none() && self.stretched != stretched {
            self.under_way = Some((self.takes_ms.unwrap_or(u64::MAX), stretched));
        }
        self.under_way.is_none() && self.stretched == stretched
    }

    fn pass(&mut self, milliseconds: u64) {
        self.under_way = self.under_way.and_then(|(left, value)| {
            if left > milliseconds {
                return Some((left - milliseconds, value));
            }
            self.stretched = value;
            None
        });
    }
}

#[derive(Debug)]
struct Board {
    permission: Permission,
    causes: u32,
    watchdog: Watchdog,
    now_ms: u64,
    /// Becomes so at this time.
    later: Option<(u64, Permission, u32)>,
    /// When `storing` was raised and let go.
    storing: Vec<(u64, bool)>,
}

impl Board {
    fn off() -> Self {
        Self {
            permission: Permission::Released,
            causes: 0,
            watchdog: Watchdog { takes_ms: Some(48), ..Watchdog::default() },
            now_ms: 0,
            later: None,
            storing: Vec::new(),
        }
    }
}

impl StoringBoard for Board {
    fn permission(&self) -> Permission {
        self.permission
    }

    fn causes(&self) -> u32 {
        self.causes
    }

    fn raise(&mut self, cause: Cause) {
        self.causes |= cause.bit();
        if cause == Cause::Storing {
            self.storing.push((self.now_ms, true));
        }
    }

    fn stored(&mut self) {
        self.causes &= !Cause::Storing.bit();
        self.storing.push((self.now_ms, false));
    }

    fn stretch(&mut self) -> bool {
        self.watchdog.ask(true)
    }

    fn tighten(&mut self) -> bool {
        self.watchdog.ask(false)
    }
}

impl Board {
    fn pass(&mut self) {
        self.now_ms += 1;
        self.watchdog.pass(1);
        if let Some((_, permission, causes)) = self.later.take_if(|(when, ..)| *when <= self.now_ms) {
            self.permission = permission;
            self.causes |= causes;
        }
    }
}

/// Whether it was done, and how often the flash was touched.
fn change(storing: &mut Storing, board: &mut Board) -> (bool, u32) {
    change_with(storing, board, true)
}

fn change_with(storing: &mut Storing, board: &mut Board, says: bool) -> (bool, u32) {
    let mut touched = 0;
    for _ in 0..1000 {
        let change = || {
            touched += 1;
            says
        };
        if let Some(done) = storing.step(board, change) {
            return (done, touched);
        }
        board.pass();
    }
    panic!("it does not end");
}

#[test]
fn the_flash_is_changed_between_a_watchdog_that_is_stretched_and_one_that_is_tight_again() {
    let (mut storing, mut board) = (Storing::new(), Board::off());
    assert_eq!(change(&mut storing, &mut board), (true, 1));
    assert_eq!((board.watchdog.stretched, board.watchdog.under_way, board.causes), (false, None, 0));
    // 20 ms of announcement, twice 48 ms of the watchdog's, some to step on, one of them for the current loops.
    assert_eq!(board.storing, [(0, true), (119, false)]);
}

#[test]
fn what_is_not_done_is_said() {
    let (mut storing, mut board) = (Storing::new(), Board::off());
    assert_eq!(change_with(&mut storing, &mut board, false), (false, 1));
    assert_eq!((board.causes, board.watchdog.stretched), (0, false));
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
        let mut board = Board { permission, causes, ..Board::off() };
        assert_eq!(change(&mut Storing::new(), &mut board), (false, 0), "{permission:?} {causes:#x}");
        // Nobody is released for it either.
        assert_eq!((board.storing, board.causes), (Vec::new(), causes));
    }
}

#[test]
fn a_drive_that_was_enabled_in_the_last_moment_is_seen_after_the_announcement() {
    for later in [(1, Permission::Damp, 0), (20, Permission::Follow, 0), (7, Permission::Released, 1)] {
        let mut board = Board { later: Some(later), ..Board::off() };
        assert_eq!(change(&mut Storing::new(), &mut board), (false, 0), "{later:?}");
        assert_eq!(board.storing, [(0, true), (21, false)]);
        assert_eq!(board.watchdog.under_way, None);
    }
}

#[test]
fn a_watchdog_that_does_not_take_its_time_keeps_the_flash_as_it_is_and_the_drive_off() {
    let (mut storing, mut board) = (Storing::new(), Board::off());
    board.watchdog.takes_ms = None;
    assert_eq!(change(&mut storing, &mut board), (false, 0));
    // Nobody knows which time it has: enabled again only once that is known.
    assert_eq!(board.causes, Cause::Watchdog.bit());
    board.causes = 0;
    storing.look_after(&mut board);
    assert_eq!(board.causes, Cause::Watchdog.bit());
    board.causes = 0;
    assert_eq!(change(&mut storing, &mut board), (false, 0));
    board.watchdog = Watchdog { takes_ms: Some(3), ..Watchdog::default() };
    storing.look_after(&mut board);
    assert_eq!((board.causes, storing), (0, Storing::new()));
    assert_eq!(change(&mut storing, &mut board), (true, 1));
}

#[test]
fn a_watchdog_that_was_stretched_and_does_not_come_back_keeps_the_drive_off_until_it_does() {
    let (mut storing, mut board) = (Storing::new(), Board::off());
    board.watchdog.takes_ms = Some(150);
    assert_eq!(change(&mut storing, &mut board), (true, 1));
    board.watchdog.takes_ms = Some(190);
    let mut slow =
        Board { watchdog: Watchdog { takes_ms: Some(190), ..Watchdog::default() }, ..Board::off() };
    assert_eq!((change(&mut storing, &mut slow), slow.causes), ((true, 1), 0));
    // Asked in every round of the keeper from then on.
    let mut stuck = Board { watchdog: Watchdog { stretched: true, ..Watchdog::default() }, ..Board::off() };
    let mut storing = Storing { loose: true, ..Storing::new() };
    storing.look_after(&mut stuck);
    assert_eq!(stuck.causes, Cause::Watchdog.bit());
    stuck.watchdog.pass(u64::MAX);
    storing.look_after(&mut stuck);
    assert_eq!(storing, Storing::new());
}
