//! Ctrl-C, SIGTERM and SIGHUP: the work is cancelled, temporary files are removed, the exit code tells which signal it was.

use crate::exit_code::ExitCode;
use scansion_core::io::abandon_outputs;
use scansion_core::parallel::Monitor;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, LazyLock, Mutex, Once};
use std::time::{Duration, Instant};

/// How often signals are looked for.
const POLL: Duration = Duration::from_millis(20);
/// Time that the work has to end by itself. Freeing some gigabytes may take longer; the system does that faster.
const GRACE: Duration = Duration::from_millis(400);

static SIGNAL: LazyLock<Arc<AtomicUsize>> = LazyLock::new(Arc::default);
static CURRENT: Mutex<Option<Monitor>> = Mutex::new(None);
static WATCHER: Once = Once::new();

/// A command that signals can end, from its beginning until this is dropped.
pub(crate) struct Interruptible(Monitor);

impl Interruptible {
    /// Begins a command. The handlers are installed once in a process.
    pub(crate) fn begin() -> Self {
        let monitor = Monitor::default();
        SIGNAL.store(0, Ordering::Relaxed);
        if let Ok(mut current) = CURRENT.lock() {
            *current = Some(monitor.clone());
        }
        WATCHER.call_once(|| {
            for signal in [SIGINT, SIGTERM, SIGHUP] {
                // Where a handler cannot be installed the system's default ends the process.
                let _ = signal_hook::flag::register_usize(signal, Arc::clone(&SIGNAL), signal as usize);
            }
            let _ = std::thread::Builder::new().name("signals".into()).spawn(watch);
        });
        Self(monitor)
    }

    /// What signals cancel.
    pub(crate) fn monitor(&self) -> Monitor {
        self.0.clone()
    }
}

impl Drop for Interruptible {
    fn drop(&mut self) {
        if let Ok(mut current) = CURRENT.lock() {
            *current = None;
        }
    }
}

fn watch() {
    loop {
        std::thread::sleep(POLL);
        let running = || CURRENT.lock().ok().and_then(|current| current.clone());
        if SIGNAL.load(Ordering::Relaxed) == 0 {
            continue;
        }
        let Some(monitor) = running() else { continue };
        monitor.cancel();
        let asked = Instant::now();
        while running().is_some() && asked.elapsed() < GRACE {
            std::thread::sleep(POLL);
        }
        if running().is_some() {
            abandon_outputs();
            std::process::exit(exit_code() as i32);
        }
    }
}

/// The exit code of an interrupted run.
pub(crate) fn exit_code() -> ExitCode {
    match SIGNAL.load(Ordering::Relaxed) as i32 {
        SIGTERM => ExitCode::Terminated,
        SIGHUP => ExitCode::HungUp,
        _ => ExitCode::Interrupted,
    }
}
