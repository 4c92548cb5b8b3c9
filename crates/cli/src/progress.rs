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

/// What is known about the work at a moment.
#[derive(Clone, Copy, Debug)]
struct Now {
    /// Number of the file from 1 on, and of all files.
    files: [usize; 2],
    stage: &'static str,
    done: u64,
    total: u64,
    /// Seconds since the start, and since the start of the stage.
    seconds: f64,
    in_stage: f64,
}

impl Now {
    /// Share of the stage that is done, 0..1.
    fn share(&self) -> f64 {
        (self.done as f64 / self.total.max(1) as f64).min(1.0)
    }

    /// Items of the stage per second.
    fn rate(&self) -> f64 {
        self.done as f64 / self.in_stage.max(1e-3)
    }

    /// Seconds to the end of the stage, once some of it is done.
    fn left(&self) -> Option<f64> {
        (self.done > 0).then(|| self.total.saturating_sub(self.done) as f64 / self.rate())
    }

    /// `file 3 of 12: ` if there are several.
    fn file(&self) -> String {
        match self.files {
            [number, all] if all > 1 => format!("file {number} of {all}: "),
            _ => String::new(),
        }
    }
}

/// Follows a monitor: notes when its stages begin.
struct Follower<'a> {
    monitor: &'a Monitor,
    start: Instant,
    stage: ([usize; 2], &'static str),
    since: Instant,
}

impl<'a> Follower<'a> {
    fn new(monitor: &'a Monitor) -> Self {
        Self { monitor, start: Instant::now(), stage: ([0; 2], ""), since: Instant::now() }
    }

    /// What is known now, and whether the stage is another one than before.
    fn look(&mut self) -> (Now, bool) {
        let ((stage, done, total), files) = (self.monitor.progress(), self.monitor.files());
        let other = (files, stage) != self.stage;
        if other {
            (self.stage, self.since) = ((files, stage), Instant::now());
        }
        let (seconds, in_stage) = (self.start.elapsed().as_secs_f64(), self.since.elapsed().as_secs_f64());
        (Now { files, stage, done, total, seconds, in_stage }, other)
    }
}

/// Time between two looks at the work, so that the start of a stage is known.
const LOOK: Duration = Duration::from_millis(100);

fn bar(monitor: &Monitor, stopped: &mpsc::Receiver<()>) {
    let style = ProgressStyle::with_template("{msg:>12} [{bar:32}] {percent:>3}%  {per_sec}  {eta} left");
    let bar = ProgressBar::new(0);
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()).progress_chars("=> "));
    let mut follower = Follower::new(monitor);
    while waiting(stopped, LOOK) {
        let (now, other) = follower.look();
        if other {
            bar.reset();
            bar.set_message(format!("{}{}", now.file(), now.stage));
        }
        bar.set_length(now.total);
        bar.set_position(now.done);
    }
    bar.finish_and_clear();
}

fn lines(monitor: &Monitor, stopped: &mpsc::Receiver<()>, every: Duration, form: fn(&Now) -> String) {
    let mut follower = Follower::new(monitor);
    let mut last = Instant::now();
    while waiting(stopped, LOOK) {
        let (now, _) = follower.look();
        if now.total > 0 && last.elapsed() >= every {
            last = Instant::now();
            let _ = writeln!(std::io::stderr().lock(), "{}", form(&now));
        }
    }
}

/// Items a second, of steps as well as of points.
fn speed(rate: f64) -> String {
    match rate {
        _ if rate >= 1e3 || rate == 0.0 => format!("{:.0} k/s", rate / 1e3),
        _ => format!("{rate:.1}/s"),
    }
}

fn plain(now: &Now) -> String {
    let left = now.left().map_or_else(String::new, |left| format!(", {left:.0} s left"));
    format!(
        "{}{}: {:.0} % ({} of {}), {}{left}, after {:.0} s",
        now.file(),
        now.stage,
        100.0 * now.share(),
        now.done,
        now.total,
        speed(now.rate()),
        now.seconds
    )
}

fn json(now: &Now) -> String {
    let Now { files: [file, files], stage, done, total, seconds, .. } = *now;
    let left = now.left().map_or("null".into(), |left| format!("{left:.1}"));
    format!(
        r#"{{"file":{file},"files":{files},"stage":"{stage}","done":{done},"total":{total},"share":{:.4},"per_second":{:.0},"seconds_left":{left},"seconds":{seconds:.3}}}"#,
        now.share(),
        now.rate()
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_tell_file_stage_share_rate_and_time() {
        let now = Now { files: [3, 12], stage: "features", done: 5000, total: 20_000, seconds: 11.2, in_stage: 2.0 };
        assert_eq!(plain(&now), "file 3 of 12: features: 25 % (5000 of 20000), 2 k/s, 6 s left, after 11 s");
        let value: serde_json::Value = serde_json::from_str(&json(&now)).unwrap();
        assert_eq!((value["file"].as_u64(), value["files"].as_u64()), (Some(3), Some(12)));
        assert_eq!((value["share"].as_f64(), value["seconds_left"].as_f64()), (Some(0.25), Some(6.0)));
        let steps = Now { files: [0, 0], stage: "train", done: 5, total: 20, ..now };
        assert_eq!(plain(&steps), "train: 25 % (5 of 20), 2.5/s, 6 s left, after 11 s");
        let begun = Now { files: [0, 0], done: 0, ..now };
        assert_eq!(plain(&begun), "features: 0 % (0 of 20000), 0 k/s, after 11 s");
        assert!(json(&begun).contains(r#""seconds_left":null"#));
    }

    #[test]
    fn a_stage_of_the_next_file_begins_anew() {
        let monitor = Monitor::default();
        let mut follower = Follower::new(&monitor);
        monitor.file(1, 2);
        monitor.stage("read", 10);
        assert!(follower.look().1 && !follower.look().1);
        monitor.file(2, 2);
        monitor.stage("read", 10);
        let (now, other) = follower.look();
        assert!(other && now.files == [2, 2]);
    }
}
