//! Ctrl-C and SIGTERM: the work is cancelled, temporary files go, the exit code tells which signal it was.

use crate::exit_code::ExitCode;
use scansion_core::parallel::Monitor;
use signal_hook::consts::{SIGINT, SIGTERM};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, LazyLock, Mutex, Once};
use std::time::Duration;

static SIGNAL: LazyLock<Arc<AtomicUsize>> = LazyLock::new(Arc::default);
static CURRENT: Mutex<Option<Monitor>> = Mutex::new(None);
static WATCHER: Once = Once::new();

/// A monitor that SIGINT and SIGTERM cancel within 50 ms. The handler is installed once in a process.
pub(crate) fn monitor() -> Monitor {
    let monitor = Monitor::default();
    if let Ok(mut current) = CURRENT.lock() {
        *current = Some(monitor.clone());
    }
    WATCHER.call_once(|| {
        for signal in [SIGINT, SIGTERM] {
            // Where a handler cannot be installed the system's default ends the process.
            let _ = signal_hook::flag::register_usize(signal, Arc::clone(&SIGNAL), signal as usize);
        }
        let _ = std::thread::Builder::new().name("signals".into()).spawn(watch);
    });
    monitor
}

fn watch() {
    while SIGNAL.load(Ordering::Relaxed) == 0 {
        std::thread::sleep(Duration::from_millis(20));
    }
    if let Ok(current) = CURRENT.lock() {
        current.iter().for_each(Monitor::cancel);
    }
}

/// The exit code of an interrupted run.
pub(crate) fn exit_code() -> ExitCode {
    match SIGNAL.load(Ordering::Relaxed) as i32 {
        SIGTERM => ExitCode::Terminated,
        _ => ExitCode::Interrupted,
    }
}
