//! Threads of the package's own.
//!
//! Why not rayon's global threads: a process that Python forks has none of them, and the first parallel loop
//! would wait forever. The threads' stacks are large enough for every computation, whatever Python's threads
//! have.

use std::sync::{Arc, Mutex, PoisonError};

use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::error::argument;

/// Stack of a thread, bytes. An identification of three joints needs below 1 MB.
const STACK: usize = 8 << 20;

/// Threads, and the process that started them.
static POOL: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);

/// Computes on the package's threads, while other threads of Python run.
pub fn compute<T: Send>(py: Python<'_>, task: impl FnOnce() -> T + Send) -> PyResult<T> {
    let threads = py.detach(threads)?;
    Ok(py.detach(|| threads.install(task)))
}

fn threads() -> PyResult<Arc<ThreadPool>> {
    let process = std::process::id();
    let mut slot = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((owner, threads)) = &*slot
        && *owner == process
    {
        return Ok(threads.clone());
    }
    let built = ThreadPoolBuilder::new().stack_size(STACK).build();
    let threads = Arc::new(built.map_err(|error| argument(format!("no threads can be started: {error}")))?);
    // The threads of the process before the fork do not exist here, so nothing may wait for their end.
    std::mem::forget(slot.replace((process, threads.clone())));
    Ok(threads)
}
