//! Progress of long work: a bar on a terminal, a line every 10 s elsewhere, JSON lines for programs.

use crate::args::{Global, ProgressMode};
use indicatif::{ProgressBar, ProgressStyle};
use scansion_core::parallel::Monitor;
use std::io::{IsTerminal, Write};
use std::sync::mpsc;
use std::time::{Duration, Instant};

/// Displays the progress of a monitor from a separate thread until dropped.
#[derive(Debug)]
pub(crate) struct Progress {
    stop: Option<mpsc::Sender<()>>,
    thread: Option<std::thread::JoinHandle<()>>,
}

impl Progress {
    /// Starts the display, according to the flags and the terminal.
    pub(crate) fn watch(monitor: &Monitor, global: &Global) -> Self {
        let terminal = std::io::stderr().is_terminal();
        let show: fn(&Monitor, &mpsc::Receiver<()>) = match global.progress {
            _ if global.quiet => return Self { stop: None, thread: None },
            ProgressMode::Never => return Self { stop: None, thread: None },
            ProgressMode::Json => |m, r| lines(m, r, Duration::from_secs(1), json),
            ProgressMode::Auto if terminal => bar,
            ProgressMode::Auto => |m, r| lines(m, r, Duration::from_secs(10), plain),
        };
        let (stop, stopped) = mpsc::channel();
        let monitor = monitor.clone();
        let thread = std::thread::Builder::new().name("progress".into()).spawn(move || show(&monitor, &stopped)).ok();
        Self { stop: Some(stop), thread }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        drop(self.stop.take());
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn waiting(stopped: &mpsc::Receiver<()>, time: Duration) -> bool {
    matches!(stopped.recv_timeout(time), Err(mpsc::RecvTimeoutError::Timeout))
}

fn bar(monitor: &Monitor, stopped: &mpsc::Receiver<()>) {
    let style = ProgressStyle::with_template("{msg:>12} [{bar:32}] {percent:>3}%  {per_sec}  {eta} left");
    let bar = ProgressBar::new(0);
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()).progress_chars("=> "));
    let mut last = "";
    while waiting(stopped, Duration::from_millis(100)) {
        let (stage, done, total) = monitor.progress();
        if stage != last {
            bar.reset();
            bar.set_message(stage);
            last = stage;
        }
        bar.set_length(total);
        bar.set_position(done);
    }
    bar.finish_and_clear();
}

fn lines(monitor: &Monitor, stopped: &mpsc::Receiver<()>, every: Duration, form: fn(&str, u64, u64, f64) -> String) {
    let start = Instant::now();
    while waiting(stopped, every) {
        let (stage, done, total) = monitor.progress();
        if total > 0 {
            let _ = writeln!(std::io::stderr().lock(), "{}", form(stage, done, total, start.elapsed().as_secs_f64()));
        }
    }
}

fn plain(stage: &str, done: u64, total: u64, seconds: f64) -> String {
    format!("{stage}: {:.0} % ({done} of {total}) after {seconds:.0} s", 100.0 * done as f64 / total as f64)
}

fn json(stage: &str, done: u64, total: u64, seconds: f64) -> String {
    format!(r#"{{"stage":"{stage}","done":{done},"total":{total},"seconds":{seconds:.3}}}"#)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_tell_stage_share_and_time() {
        assert_eq!(plain("features", 5, 20, 11.2), "features: 25 % (5 of 20) after 11 s");
        assert!(json("features", 5, 20, 1.0).starts_with(r#"{"stage":"features","done":5,"total":20"#));
    }
}
