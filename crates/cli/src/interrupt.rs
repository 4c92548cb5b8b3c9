//! Ctrl-C, SIGTERM and SIGHUP: cancel the work, remove temporary files, and set the exit code of the signal.
//!
//! When memory runs out, the standard library prints the amount and ends the process with SIGABRT. No code of ours can
//! run in that thread any more; another thread removes the temporary files and ends the process.

use crate::exit_code::ExitCode;
use scansion_core::io::abandon_outputs;
use scansion_core::parallel::Monitor;
use signal_hook::consts::{SIGABRT, SIGHUP, SIGINT, SIGTERM};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Barrier, LazyLock, Mutex, Once};
use std::time::{Duration, Instant};

/// Interval at which signals are checked.
const POLL: Duration = Duration::from_millis(20);
/// Time given to the work to end by itself. Freeing some gigabytes may take longer; the system does that faster.
const GRACE: Duration = Duration::from_millis(400);

static SIGNAL: LazyLock<Arc<AtomicUsize>> = LazyLock::new(Arc::default);
static ABORTED: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);
#[cfg(unix)]
static PIPE: Mutex<Option<(std::io::PipeReader, std::io::PipeWriter)>> = Mutex::new(None);
static CURRENT: Mutex<Option<Monitor>> = Mutex::new(None);
static WATCHER: Once = Once::new();
/// Passed once the thread that watches is running.
static RUNNING: Barrier = Barrier::new(2);

/// A command that signals can end, until this is dropped.
pub(crate) struct Interruptible(Monitor);

impl Interruptible {
    /// Starts a command. The handlers are installed once per process.
    pub(crate) fn begin() -> Self {
        let monitor = Monitor::default();
        SIGNAL.store(0, Ordering::Relaxed);
        if let Ok(mut current) = CURRENT.lock() {
            *current = Some(monitor.clone());
        }
        WATCHER.call_once(|| {
            if std::thread::Builder::new().name("signals".into()).spawn(watch).is_ok() {
                handle_signals();
            }
            // With a handler, writing beyond the largest size of a file is an error of that file.
            #[cfg(unix)]
            let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default());
        });
        Self(monitor)
    }

    /// The monitor that signals cancel.
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

/// Installs the handlers that the watching thread reacts to. Where one cannot be installed, the signal ends the process in
/// the usual way.
fn handle_signals() {
    // A thread that finds no memory for its signal stack aborts as it starts. Until it is running, no handler may hold an
    // abort: nothing would end the process then.
    RUNNING.wait();
    for signal in [SIGINT, SIGTERM, SIGHUP] {
        let _ = signal_hook::flag::register_usize(signal, Arc::clone(&SIGNAL), signal as usize);
    }
    let _ = hold_aborts();
}

fn watch() {
    RUNNING.wait();
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
                    crate::pipes::remove();
                    std::process::exit(exit_code() as i32);
                }
            }
        }
    }
}

/// Makes a thread that aborts wait for [`aborted`]: its handler sets the flag and then blocks on a full pipe.
#[cfg(unix)]
fn hold_aborts() -> std::io::Result<()> {
    use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
    use std::io::Write;
    signal_hook::flag::register(SIGABRT, Arc::clone(&ABORTED))?;
    let (reader, mut writer) = std::io::pipe()?;
    let held = writer.try_clone()?;
    signal_hook::low_level::pipe::register(SIGABRT, held)?;
    // Registering has made the pipe non-blocking, so that this loop ends when it is full.
    while writer.write(&[0; 4096]).is_ok() {}
    fcntl_setfl(&writer, fcntl_getfl(&writer)? - OFlags::NONBLOCK)?;
    // Keeps the pipe open until the process ends.
    if let Ok(mut pipe) = PIPE.lock() {
        *pipe = Some((reader, writer));
    }
    Ok(())
}

#[cfg(not(unix))]
fn hold_aborts() -> std::io::Result<()> {
    Ok(())
}

/// Removes temporary files and ends the process, without allocating memory or waiting for locks of other threads.
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
