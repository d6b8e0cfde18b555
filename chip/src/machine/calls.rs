//! Instructions of whole calls of named functions, the functions that they call included.
//!
//! A call begins where an exception, or the thread, reaches the function's first block. It ends where the
//! same exception reaches the return address with the stack pointer of the beginning. Instructions of
//! interrupts that preempt it do not count.

use super::*;

/// Calls of one function so far.
#[derive(Clone, Copy, Debug, Default)]
pub struct Calls {
    pub count: u64,
    /// Instructions of all.
    pub instructions: u64,
    /// Instructions of the longest.
    pub worst: u64,
}

/// A function whose calls are counted.
#[derive(Clone, Copy, Debug)]
pub(super) struct Watched {
    entry: u32,
    pub calls: Calls,
    open: Option<Open>,
}

/// A call in progress.
#[derive(Clone, Copy, Debug)]
struct Open {
    exception: u8,
    back: u32,
    stack: u32,
    /// Instructions of the exception at the beginning.
    begun: u64,
}

impl Watched {
    pub fn new(entry: u32) -> Self {
        Self { entry, calls: Calls::default(), open: None }
    }
}

/// Follows the watched functions at the beginning of a block.
pub(super) fn follow(core: &mut Core<'_>, address: u32) {
    for index in 0..core.get_data().watched.len() {
        let state = core.get_data();
        let (watched, exception) = (state.watched[index], state.chip.nvic.current());
        // The block that begins is already counted.
        let [until, last] = state.counted[usize::from(exception)];
        let before = until - last;
        match watched.open {
            None if address == watched.entry => {
                let (back, stack) = (get(core, Register::LR) & !1, get(core, Register::SP));
                let open = Open { exception, back, stack, begun: before };
                core.get_data_mut().watched[index].open = Some(open);
            }
            Some(open)
                if (address, exception) == (open.back, open.exception)
                    && get(core, Register::SP) == open.stack =>
            {
                let watched = &mut core.get_data_mut().watched[index];
                let own = before - open.begun;
                watched.open = None;
                watched.calls.count += 1;
                watched.calls.instructions += own;
                watched.calls.worst = watched.calls.worst.max(own);
            }
            _ => {}
        }
    }
}
