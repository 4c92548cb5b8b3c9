//! Progress of long calls, shown by a function of Python.

use pyo3::prelude::*;
use scansion_core::parallel::Monitor;
use std::cell::RefCell;
use std::time::{Duration, Instant};

thread_local! {
    /// The function that this thread's calls report to.
    static FOLLOWER: RefCell<Option<Py<PyAny>>> = const { RefCell::new(None) };
}

/// Least time between two reports.
const PAUSE: Duration = Duration::from_millis(100);

/// Sets the function that the calls of this thread report to, `None` for nobody; returns the one before.
#[pyfunction]
#[pyo3(signature = (follower = None))]
pub(crate) fn follow(follower: Option<Py<PyAny>>) -> Option<Py<PyAny>> {
    FOLLOWER.with_borrow_mut(|held| std::mem::replace(held, follower))
}

/// The reports of one call.
pub(crate) struct Reports {
    follower: Option<Py<PyAny>>,
    last: Option<(&'static str, u64, u64)>,
    at: Option<Instant>,
}

impl Reports {
    pub(crate) fn new(py: Python<'_>) -> Self {
        let follower = FOLLOWER.with_borrow(|held| held.as_ref().map(|f| f.clone_ref(py)));
        Self { follower, last: None, at: None }
    }

    /// Reports a change of stage at once, other changes after a pause.
    pub(crate) fn report(&mut self, py: Python<'_>, monitor: &Monitor) -> PyResult<()> {
        let Some(follower) = &self.follower else { return Ok(()) };
        let now = monitor.progress();
        let other = self.last.is_none_or(|last| last.0 != now.0);
        let due = self.at.is_none_or(|at| at.elapsed() >= PAUSE);
        if now.0.is_empty() || self.last == Some(now) || !(other || due) {
            return Ok(());
        }
        (self.last, self.at) = (Some(now), Some(Instant::now()));
        let stage = match monitor.files() {
            [number, all] if all > 1 => format!("file {number} of {all}: {}", now.0),
            _ => now.0.to_string(),
        };
        follower.call1(py, (stage, now.1, now.2)).map(|_| ())
    }
}
