//! Ctrl-C, SIGTERM and SIGHUP: the work is cancelled, temporary files are removed, the exit code tells which signal it was.
//!
//! SIGABRT is what the standard library ends a process with whose memory does not suffice, after a line with the amount.
//! No code of ours runs in that thread any more; another one removes the temporary files and ends the process.

use crate::exit_code::ExitCode;
use scansion_core::io::abandon_outputs;
use scansion_core::parallel::Monitor;
use signal_hook::consts::{SIGABRT, SIGHUP, SIGINT, SIGTERM};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, LazyLock, Mutex, Once};
use std::time::{Duration, Instant};

/// How often signals are looked for.
const POLL: Duration = Duration::from_millis(20);
/// Time that the work has to end by itself. Freeing some gigabytes may take longer; the system does that faster.
const GRACE: Duration = Duration::from_millis(400);

static SIGNAL: LazyLock<Arc<AtomicUsize>> = LazyLock::new(Arc::default);
static ABORTED: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);
#[cfg(unix)]
static PIPE: Mutex<Option<(std::io::PipeReader, std::io::PipeWriter)>> = Mutex::new(None);
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
            if std::thread::Builder::new().name("signals".into()).spawn(watch).is_ok() {
                // Where this fails an abort ends the process as the system does it.
                let _ = hold_aborts();
            }
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
    let running = || CURRENT.lock().ok().and_then(|current| current.clone());
    let mut asked: Option<Instant> = None;
    loop {
        std::thread::sleep(POLL);
        if ABORTED.load(Ordering::Relaxed) {
            aborted();
        }
        match running().filter(|_| SIGNAL.load(Ordering::Relaxed) != 0) {
            None => asked = None,
            Some(monitor) => {
                monitor.cancel();
                if asked.get_or_insert_with(Instant::now).elapsed() > GRACE {
                    abandon_outputs();
                    std::process::exit(exit_code() as i32);
                }
            }
        }
    }
}

/// Makes a thread that aborts wait for [`aborted`]: its handler sets the flag, then writes to a pipe that is full.
#[cfg(unix)]
fn hold_aborts() -> std::io::Result<()> {
    use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
    use std::io::Write;
    signal_hook::flag::register(SIGABRT, Arc::clone(&ABORTED))?;
    let (reader, mut writer) = std::io::pipe()?;
    let held = writer.try_clone()?;
    signal_hook::low_level::pipe::register(SIGABRT, held)?;
    // Registering has made it a pipe that does not wait, so that this ends when it is full.
    while writer.write(&[0; 4096]).is_ok() {}
    fcntl_setfl(&writer, fcntl_getfl(&writer)? - OFlags::NONBLOCK)?;
    // Open until the process ends.
    if let Ok(mut pipe) = PIPE.lock() {
        *pipe = Some((reader, writer));
    }
    Ok(())
}

#[cfg(not(unix))]
fn hold_aborts() -> std::io::Result<()> {
    Ok(())
}

/// Removes what was written and ends the process; asks for no memory and no lock that another thread may hold.
fn aborted() -> ! {
    abandon_outputs();
    let text =
        b"error: ended by what the line above says; where an allocation failed there was not enough memory: raise the \
        limit, or take a part of the points at a time. Outputs that were not complete are removed\n";
    #[cfg(unix)]
    let _ = rustix::io::write(rustix::stdio::stderr(), text);
    signal_hook::low_level::exit(i32::from(ExitCode::Failed as u8))
}

/// The exit code of an interrupted run.
pub(crate) fn exit_code() -> ExitCode {
    match SIGNAL.load(Ordering::Relaxed) as i32 {
        SIGTERM => ExitCode::Terminated,
        SIGHUP => ExitCode::HungUp,
        _ => ExitCode::Interrupted,
    }
}
