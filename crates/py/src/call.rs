//! Long calls of the core: without the GIL, in a thread pool of their own, interruptible by Ctrl-C.
//!
//! The pool exists only during the call, so that a process that forks afterwards never waits for threads that it does
//! not have.

use crate::error::raise;
use crate::progress::Reports;
use crate::words::in_python;
use pyo3::exceptions::{PyRuntimeError, PyUserWarning, PyValueError};
use pyo3::prelude::*;
use scansion_core::io::run::{Rules, run};
use scansion_core::parallel::Monitor;
use std::ffi::CString;
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

/// Interval at which signals are checked.
const POLL: Duration = Duration::from_millis(10);

/// Runs `work` on `n_jobs` threads while this thread watches for signals.
pub(crate) fn call<T: Send>(
    py: Python<'_>,
    n_jobs: Option<i64>,
    work: impl FnOnce(&Monitor) -> scansion_core::Result<T> + Send,
) -> PyResult<T> {
    call_with(py, n_jobs, &Monitor::default(), work)
}

/// The same with a monitor that outlives the call; a signal cancels it permanently.
pub(crate) fn call_with<T: Send>(
    py: Python<'_>,
    n_jobs: Option<i64>,
    monitor: &Monitor,
    work: impl FnOnce(&Monitor) -> scansion_core::Result<T> + Send,
) -> PyResult<T> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads(n_jobs)?).build();
    let pool = pool.map_err(|e| PyRuntimeError::new_err(format!("threads cannot be started: {e}")))?;
    let (done, caller) = (AtomicBool::new(false), thread::current());
    thread::scope(|scope| {
        let worker = thread::Builder::new().spawn_scoped(scope, || {
            let result = catch_unwind(AssertUnwindSafe(|| {
                pool.install(|| {
                    let rules = Rules { monitor: monitor.clone(), ..Rules::default() };
                    run(rules, || work(monitor))
                })
            }));
            done.store(true, Ordering::Release);
            caller.unpark();
            result
        });
        let worker = worker.map_err(|e| PyRuntimeError::new_err(format!("a thread cannot be started: {e}")))?;
        let signal = watch(py, &done, monitor);
        let result = py.detach(|| worker.join()).and_then(|caught| caught);
        signal?;
        for text in monitor.take_warnings() {
            let text = CString::new(in_python(&text).replace('\0', " ")).unwrap_or_default();
            PyErr::warn(py, &py.get_type::<PyUserWarning>(), &text, 2)?;
        }
        result.map_err(|_| PyRuntimeError::new_err("internal error in scansion; please report it"))?.map_err(raise)
    })
}

/// Waits until the work is done and reports its progress; an exception of a signal (`KeyboardInterrupt`) or of the
/// function that shows the progress cancels the work and is returned.
fn watch(py: Python<'_>, done: &AtomicBool, monitor: &Monitor) -> PyResult<()> {
    let mut reports = Reports::new(py);
    while !done.load(Ordering::Acquire) {
        py.detach(|| thread::park_timeout(POLL));
        py.check_signals().and_then(|()| reports.report(py, monitor)).inspect_err(|_| monitor.cancel())?;
    }
    Ok(())
}

/// Items processed between two checks for Ctrl-C.
const PIECE: usize = 1 << 18;

/// Light work on `0..len`, serial and on this thread, with a check for Ctrl-C after each piece.
pub(crate) fn in_pieces(py: Python<'_>, len: usize, mut work: impl FnMut(Range<usize>) + Send) -> PyResult<()> {
    for first in (0..len).step_by(PIECE) {
        py.detach(|| work(first..(first + PIECE).min(len)));
        py.check_signals()?;
    }
    Ok(())
}

/// Number of threads for scikit-learn's `n_jobs`: `None` and -1 use all, -2 all but one. rayon takes 0 as all.
fn threads(n_jobs: Option<i64>) -> PyResult<usize> {
    let all = || thread::available_parallelism().map_or(1, std::num::NonZero::get) as i64;
    match n_jobs {
        None | Some(-1) => Ok(0),
        Some(0) => Err(PyValueError::new_err("n_jobs: found 0, expected 1 or more, -1 (all) or None (all)")),
        Some(n) if n > 0 => Ok(n.min(1024) as usize),
        Some(n) => Ok(all().saturating_add(1).saturating_add(n).max(1) as usize),
    }
}
