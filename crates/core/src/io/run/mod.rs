//! The files of one run: inputs and outputs.
//!
//! Every input is opened through [`open`](super::open), every output through [`atomic`](super::atomic); both register
//! their files with the current run of their thread. So no command can overwrite one of its inputs unless that is
//! allowed, and an input that changes while it is read is an error. Two paths are the same file if the system says so
//! (hard and symbolic links) or if their full paths are equal. Runs are independent: each has its own list of files,
//! and each thread its own current run.

#[cfg(test)]
mod tests;

use crate::error::{Error, Result};
use crate::parallel::Monitor;
use std::cell::{Cell, RefCell};
use std::fs::{File, OpenOptions};
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::time::SystemTime;

thread_local! {
    static CURRENT: RefCell<Option<Rc<Files>>> = const { RefCell::new(None) };
}

/// Number of bytes at the start of a file that are compared to see whether it has changed.
const START: u64 = 4096;

/// Rules of a run.
#[derive(Clone, Debug, Default)]
pub struct Rules {
    /// Can end the wait for a pipe.
    pub monitor: Monitor,
    /// Whether an output may replace an input.
    pub replace: Replace,
    /// Whether an output may replace another file that exists.
    pub existing: Replace,
}

/// Whether an output may replace a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Replace {
    /// It may.
    #[default]
    Allowed,
    /// It may not; the text says what the user can do instead.
    Refused(&'static str),
}

#[derive(Debug, Default)]
struct Files {
    rules: Rules,
    inputs: RefCell<Vec<Input>>,
    outputs: RefCell<Vec<Output>>,
    /// Files that the run goes on from and writes again.
    continued: RefCell<Vec<Place>>,
    /// The enclosing run, for a part of it.
    whole: Option<Rc<Files>>,
}

#[derive(Debug)]
struct Input {
    typed: PathBuf,
    place: Place,
    /// `None` until the file is opened.
    state: Option<State>,
}

#[derive(Debug)]
struct Output {
    typed: PathBuf,
    place: Place,
    stage: Cell<Stage>,
}

/// Progress of an output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// Will be written.
    Announced,
    /// Is being written.
    Begun,
    /// Has its final name.
    Done,
}

/// Identity of a file.
#[derive(Clone, Debug)]
struct Place {
    /// Device and inode number, if the system has them.
    file: Option<(u64, u64)>,
    /// Full path without links.
    path: PathBuf,
}

/// Properties that must not change while a file is read.
#[derive(Clone, Debug, PartialEq, Eq)]
struct State {
    file: Option<(u64, u64)>,
    size: u64,
    modified: Option<SystemTime>,
    /// Checksum of the first bytes.
    start: u32,
}

/// Performs `work` as one run.
pub fn run<T>(rules: Rules, work: impl FnOnce() -> T) -> T {
    within(Files { rules, ..Files::default() }, work)
}

/// Performs `work` as a part of this thread's run, with inputs of its own, which are forgotten afterwards.
pub fn part<T>(work: impl FnOnce() -> T) -> T {
    let whole = current();
    let rules = whole.as_ref().map(|whole| whole.rules.clone()).unwrap_or_default();
    within(Files { rules, whole, ..Files::default() }, work)
}

/// Performs `work` in this thread's run; if there is none, in a new run in which outputs may replace inputs.
pub(super) fn joined<T>(monitor: &Monitor, work: impl FnOnce() -> T) -> T {
    match current() {
        Some(_) => work(),
        None => run(Rules { monitor: monitor.clone(), ..Rules::default() }, work),
    }
}

fn within<T>(files: Files, work: impl FnOnce() -> T) -> T {
    /// Restores the previous run when dropped, also after a panic.
    struct Back(Option<Rc<Files>>);
    impl Drop for Back {
        fn drop(&mut self) {
            CURRENT.replace(self.0.take());
        }
    }
    let _back = Back(CURRENT.replace(Some(Rc::new(files))));
    work()
}

fn current() -> Option<Rc<Files>> {
    CURRENT.with_borrow(Clone::clone)
}

/// The monitor of this thread's run.
pub(super) fn monitor() -> Monitor {
    current().map(|files| files.rules.monitor.clone()).unwrap_or_default()
}

/// Registers a file that will be read later, so that outputs can be compared with it before.
pub fn expect(path: &Path) {
    if let Some(files) = current() {
        let place = Place::of(path);
        files.inputs.borrow_mut().push(Input { typed: path.to_path_buf(), place, state: None });
    }
}

/// Warns of each file that stands more than once among these inputs, whose points would count several times.
pub fn warn_of_twice(inputs: &[PathBuf], monitor: &Monitor) {
    let places: Vec<Place> = inputs.iter().map(|path| Place::of(path)).collect();
    for (at, place) in places.iter().enumerate() {
        if let Some(first) = places[..at].iter().position(|earlier| earlier.is(place)) {
            let [one, other] = [first, at].map(|at| inputs[at].display());
            monitor.warn(match inputs[first] == inputs[at] {
                true => format!("{one} is an input more than once: its points count each time"),
                false => {
                    format!("{one} and {other} are the same file, an input more than once: its points count each time")
                }
            });
        }
    }
}

/// Registers a file from which the run goes on if it exists, and which it then writes again: the same file may be input
/// and output.
pub fn goes_on_from(path: &Path) {
    if let Some(files) = current() {
        files.continued.borrow_mut().push(Place::of(path));
    }
}

/// Whether a file that appears under the name of an output before it is complete must not be replaced.
pub(super) fn refuses_existing(target: &Path) -> Option<&'static str> {
    let files = current()?;
    match files.rules.existing {
        Replace::Refused(advice) if !files.goes_on_from(&Place::of(target)) => Some(advice),
        _ => None,
    }
}

/// To be called for every file that was opened for reading.
///
/// # Errors
/// If the file will also be written, or is a different one than when it was opened before.
pub(super) fn opened(path: &Path, file: &File) -> Result<()> {
    let Some(files) = current() else { return Ok(()) };
    let state = State::of(file).map_err(|e| Error::io(path, e))?;
    let place = Place { file: state.file, path: full(path) };
    if let Replace::Refused(advice) = files.rules.replace {
        for level in files.levels() {
            let outputs = level.outputs.borrow();
            let same = outputs.iter().find(|o| o.stage.get() != Stage::Done && o.place.is(&place));
            let same = same.filter(|_| !files.goes_on_from(&place));
            if let Some(output) = same {
                return Err(same_file(path, &output.typed, advice));
            }
        }
    }
    let mut inputs = files.inputs.borrow_mut();
    match inputs.iter_mut().find(|i| i.typed == path) {
        Some(before) if before.state.as_ref().is_some_and(|old| *old != state) => return Err(changed(path)),
        Some(before) => before.state = Some(state),
        None => inputs.push(Input { typed: path.to_path_buf(), place, state: Some(state) }),
    }
    Ok(())
}

/// Fails if a file has changed since it was opened in this run. A deleted file does not change what was read.
pub(super) fn unchanged(path: &Path) -> Result<()> {
    let Some(files) = current() else { return Ok(()) };
    let inputs = files.inputs.borrow();
    let before = inputs.iter().find(|i| i.typed == path).and_then(|input| input.state.as_ref());
    let Some(before) = before else { return Ok(()) };
    match at_once(path) {
        Err(Error::Io { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => Ok(()),
        Ok(file) if State::of(&file).is_ok_and(|now| now == *before) => Ok(()),
        _ => Err(changed(path)),
    }
}

/// To be called before an output is examined for the first time; `target` is `typed` after following links. Returns
/// whether it is the run's first output in its folder.
///
/// # Errors
/// If two outputs are the same file, or the output is an input, or exists and must not be replaced.
pub(super) fn announce(typed: &Path, target: &Path) -> Result<bool> {
    let Some(files) = current() else { return Ok(true) };
    let output = Output::new(typed, target, Stage::Announced);
    for level in files.levels() {
        if let Some(other) = level.outputs.borrow().iter().find(|o| o.place.is(&output.place)) {
            return Err(Error::SameFile {
                first: other.typed.clone(),
                second: typed.to_path_buf(),
                what: "an output twice",
                advice: "give each its own name",
            });
        }
    }
    files.check(&output)?;
    files.check_new(typed, target)?;
    let folder = |output: &Output| output.place.path.parent().map(|p| p.as_os_str().to_os_string());
    let here = folder(&output);
    let first = files.levels().all(|level| level.outputs.borrow().iter().all(|other| folder(other) != here));
    files.outputs.borrow_mut().push(output);
    Ok(first)
}

/// To be called when an output is started.
///
/// # Errors
/// If the output is an input.
pub(super) fn begun(typed: &Path, target: &Path) -> Result<()> {
    let Some(files) = current() else { return Ok(()) };
    let output = Output::new(typed, target, Stage::Begun);
    files.check(&output)?;
    for level in files.levels() {
        if let Some(own) = level.outputs.borrow().iter().find(|o| o.place.is(&output.place)) {
            own.stage.set(Stage::Begun);
            return Ok(());
        }
    }
    files.check_new(typed, target)?;
    files.outputs.borrow_mut().push(output);
    Ok(())
}

/// To be called when an output has its final name: the old file is not read any more.
pub(super) fn done(target: &Path) {
    let Some(files) = current() else { return };
    let path = full(target).into_os_string();
    for level in files.levels() {
        level
            .outputs
            .borrow()
            .iter()
            .filter(|o| o.place.path.as_os_str() == path)
            .for_each(|o| o.stage.set(Stage::Done));
        level.inputs.borrow_mut().retain(|i| i.place.path.as_os_str() != path);
    }
}

/// Opens any kind of file without waiting for another program.
pub(super) fn at_once(path: &Path) -> Result<File> {
    let mut options = OpenOptions::new();
    options.read(true);
    #[cfg(unix)]
    {
        use rustix::fs::OFlags;
        use std::os::unix::fs::OpenOptionsExt;
        options.custom_flags((OFlags::NONBLOCK | OFlags::NOCTTY).bits().cast_signed());
    }
    options.open(path).map_err(|e| Error::io(path, e))
}

impl Files {
    /// Fails if an output exists and must not be replaced.
    fn check_new(&self, typed: &Path, target: &Path) -> Result<()> {
        match self.rules.existing {
            Replace::Refused(advice) if target.exists() && !self.goes_on_from(&Place::of(target)) => {
                Err(Error::io(typed, exists(advice)))
            }
            _ => Ok(()),
        }
    }

    /// Whether the run goes on from this file.
    fn goes_on_from(&self, place: &Place) -> bool {
        self.levels().any(|level| level.continued.borrow().iter().any(|other| other.is(place)))
    }

    /// This part of the run and the enclosing ones.
    fn levels(&self) -> impl Iterator<Item = &Self> {
        std::iter::successors(Some(self), |files| files.whole.as_deref())
    }

    /// Fails if the output is an input and the rules forbid that.
    fn check(&self, output: &Output) -> Result<()> {
        let Replace::Refused(advice) = self.rules.replace else { return Ok(()) };
        for level in self.levels() {
            let input = level.inputs.borrow().iter().find(|i| i.place.is(&output.place)).map(|i| i.typed.clone());
            if let Some(input) = input.filter(|_| !self.goes_on_from(&output.place)) {
                return Err(same_file(&input, &output.typed, advice));
            }
        }
        Ok(())
    }
}

/// The error about an output that exists.
pub(super) fn exists(advice: &str) -> std::io::Error {
    std::io::Error::new(std::io::ErrorKind::AlreadyExists, format!("it exists; {advice}"))
}

impl Output {
    fn new(typed: &Path, target: &Path, stage: Stage) -> Self {
        Self { typed: typed.to_path_buf(), place: Place::of(target), stage: Cell::new(stage) }
    }
}

impl Place {
    fn of(path: &Path) -> Self {
        Self { file: std::fs::metadata(path).ok().and_then(|about| number(&about)), path: full(path) }
    }

    fn is(&self, other: &Self) -> bool {
        let linked = self.file.is_some() && self.file == other.file;
        // Numbers alone are not enough: a file that was replaced under the same name has a new one.
        linked || self.path.as_os_str() == other.path.as_os_str()
    }
}

impl State {
    /// Does not change the read position of the file.
    fn of(mut file: &File) -> std::io::Result<Self> {
        let about = file.metadata()?;
        let at = file.stream_position()?;
        file.seek(SeekFrom::Start(0))?;
        let mut start = Vec::new();
        file.take(START).read_to_end(&mut start)?;
        file.seek(SeekFrom::Start(at))?;
        let (file, modified) = (number(&about), about.modified().ok());
        Ok(Self { file, size: about.len(), modified, start: crc32fast::hash(&start) })
    }
}

#[cfg(unix)]
#[expect(clippy::unnecessary_wraps, reason = "other systems have none")]
fn number(about: &std::fs::Metadata) -> Option<(u64, u64)> {
    use std::os::unix::fs::MetadataExt;
    Some((about.dev(), about.ino()))
}

#[cfg(not(unix))]
fn number(_: &std::fs::Metadata) -> Option<(u64, u64)> {
    None
}

/// The full path without links; for a file that does not exist yet, with the full path of its folder.
fn full(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| {
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let folder = folder.canonicalize().unwrap_or_else(|_| folder.to_path_buf());
        path.file_name().map_or(folder.clone(), |name| folder.join(name))
    })
}

fn same_file(input: &Path, output: &Path, advice: &'static str) -> Error {
    Error::SameFile { first: input.to_path_buf(), second: output.to_path_buf(), what: "input and output", advice }
}

fn changed(path: &Path) -> Error {
    let reason = "the file changed while it was read; let its writer finish, then run this again".to_string();
    Error::Unsupported { path: path.to_path_buf(), reason }
}
