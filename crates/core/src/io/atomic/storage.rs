//! The file being written. It is synced to the disk while it grows, so that the final sync takes less time.

use super::step;
use std::fs::File;
use std::io::{Error, Result, Seek, SeekFrom, Write};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::task::Poll;
use std::thread::Builder;
use std::time::Duration;

/// Bytes after which what has been written is synced: a fraction of a second of a fast disk.
const EVERY: usize = 64 << 20;

/// Interval at which a wait for the disk looks whether the work was cancelled.
const LOOK: Duration = Duration::from_millis(20);

/// The file. Every operation passes through `step`, where tests can make it fail.
#[derive(Debug)]
pub struct Storage {
    file: File,
    /// Bytes written since the last sync began.
    new: usize,
    /// The outcome of a sync that goes on in the background.
    sync: Option<Receiver<Result<()>>>,
}

impl Storage {
    pub(super) fn new(file: File) -> Self {
        Self { file, new: 0, sync: None }
    }

    /// Waits until everything is on the disk; false if that was given up because the work is `cancelled`.
    pub(super) fn sync(&mut self, cancelled: impl Fn() -> bool) -> Result<bool> {
        step()?;
        if !self.settle(&cancelled)? {
            return Ok(false);
        }
        if !self.begin(File::sync_all)? {
            return self.file.sync_all().map(|()| true);
        }
        self.settle(&cancelled)
    }

    /// Waits for the sync in the background; false if that was given up because the work is `cancelled`.
    fn settle(&mut self, cancelled: &impl Fn() -> bool) -> Result<bool> {
        loop {
            match self.outcome(LOOK) {
                Poll::Ready(outcome) => return outcome.map(|()| true),
                Poll::Pending if cancelled() => return Ok(false),
                Poll::Pending => {}
            }
        }
    }

    /// The outcome of the sync in the background if it ends within this time. The system reports a failure only once,
    /// so it must not be lost.
    fn outcome(&mut self, patience: Duration) -> Poll<Result<()>> {
        let Some(sync) = &self.sync else { return Poll::Ready(Ok(())) };
        let outcome = match sync.recv_timeout(patience) {
            Err(RecvTimeoutError::Timeout) => return Poll::Pending,
            Err(RecvTimeoutError::Disconnected) => Err(Error::other("the sync failed")),
            Ok(outcome) => outcome,
        };
        self.sync = None;
        Poll::Ready(outcome)
    }

    /// Begins a sync in the background; false if no thread can be had for it.
    fn begin(&mut self, sync: impl FnOnce(&File) -> Result<()> + Send + 'static) -> Result<bool> {
        let file = self.file.try_clone()?;
        let (sender, receiver) = channel();
        // Nobody listens any more if the work was cancelled.
        let work = move || drop(sender.send(sync(&file)));
        let begun = Builder::new().name("sync".to_string()).spawn(work).is_ok();
        self.sync = begun.then_some(receiver);
        self.new = 0;
        Ok(begun)
    }

    /// Begins a sync in the background if enough is new and none goes on. Without a thread it is left to the end.
    fn written(&mut self, bytes: usize) -> Result<()> {
        self.new = self.new.saturating_add(bytes);
        if self.new < EVERY {
            return Ok(());
        }
        match self.outcome(Duration::ZERO) {
            Poll::Pending => Ok(()),
            Poll::Ready(outcome) => outcome.and_then(|()| self.begin(File::sync_data)).map(drop),
        }
    }
}

impl Write for Storage {
    fn write(&mut self, bytes: &[u8]) -> Result<usize> {
        if let Err(error) = step() {
            // A full disk accepts a part before it refuses.
            let _ = self.file.write(&bytes[..bytes.len() / 2]);
            return Err(error);
        }
        let count = self.file.write(bytes)?;
        self.written(count)?;
        Ok(count)
    }

    fn flush(&mut self) -> Result<()> {
        step()?;
        self.file.flush()
    }
}

impl Seek for Storage {
    fn seek(&mut self, to: SeekFrom) -> Result<u64> {
        step()?;
        self.file.seek(to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_is_synced_while_it_grows_is_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("large");
        let mut storage = Storage::new(File::create(&path).unwrap());
        let part: Vec<u8> = (0..EVERY / 4 + 7).map(|i| (i % 251) as u8).collect();
        let mut begun = 0;
        for _ in 0..9 {
            storage.write_all(&part).unwrap();
            begun += usize::from(storage.new == 0);
        }
        assert!(begun > 0, "no sync has begun");
        assert!(storage.sync(|| false).unwrap());
        assert!(storage.sync.is_none());
        let read = std::fs::read(&path).unwrap();
        assert!(read.len() == 9 * part.len() && read.chunks(part.len()).all(|chunk| chunk == part));
    }

    #[test]
    fn a_failed_sync_is_reported() {
        let folder = tempfile::tempdir().unwrap();
        let mut storage = Storage::new(File::create(folder.path().join("file")).unwrap());
        storage.begin(|_| Err(Error::other("the disk is full"))).unwrap();
        assert_eq!(storage.sync(|| false).unwrap_err().to_string(), "the disk is full");
    }

    #[test]
    fn a_wait_for_the_disk_ends_when_the_work_is_cancelled() {
        let folder = tempfile::tempdir().unwrap();
        let mut storage = Storage::new(File::create(folder.path().join("file")).unwrap());
        let (release, held) = channel::<()>();
        storage.begin(move |_| held.recv().map_err(|_| Error::other("the test has ended"))).unwrap();
        let looks = std::cell::Cell::new(0);
        let cancelled = || looks.replace(looks.get() + 1) == 2;
        assert!(!storage.sync(cancelled).unwrap(), "given up");
        assert_eq!(looks.get(), 3, "it had waited");
        release.send(()).unwrap();
        assert!(storage.sync(|| false).unwrap(), "the disk was slow, not broken");
    }
}
