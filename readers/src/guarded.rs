//! Ends the panic of a library in an error.
//!
//! Damaged files make both libraries panic: `parquet` 60 where the page of a dictionary is missing,
//! `mcap` 0.26 where a chunk is shorter than its records. Their arithmetic is checked in every profile (the
//! workspace's `Cargo.toml`), so that such a length ends here instead of wrapping around.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::Once;

use crate::Error;

thread_local! {
    /// Whether a panic of this thread is reported as an error, and not printed.
    static IS_GUARDED: Cell<bool> = const { Cell::new(false) };
}

/// Runs a decoder; its panic becomes an error.
pub(crate) fn guarded<T>(decode: impl FnOnce() -> Result<T, Error>) -> Result<T, Error> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let print = take_hook();
        set_hook(Box::new(move |panic| {
            if !IS_GUARDED.get() {
                print(panic);
            }
        }));
    });
    let outer = IS_GUARDED.replace(true);
    let result = catch_unwind(AssertUnwindSafe(decode));
    IS_GUARDED.set(outer);
    result.unwrap_or_else(|panic| {
        let words = panic.downcast_ref::<String>().map(String::as_str);
        let words = words.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no reason");
        Err(Error::new(format!("damaged file: its decoder gave up ({words})")))
    })
}
