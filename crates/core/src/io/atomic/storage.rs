//! The file being written, which is brought to the disk while it grows: at the end less is left to wait for.

use super::step;
use std::fs::File;
use std::io::{Error, Result, Seek, SeekFrom, Write};
use std::thread::{Builder, JoinHandle};

/// Bytes after which what has been written is synced: a fraction of a second of a fast disk.
const EVERY: usize = 64 << 20;

/// The file. Every operation passes through `step`, where tests can make it fail.
#[derive(Debug)]
pub struct Storage {
    file: File,
    /// Bytes written since the last sync began.
    new: usize,
    /// A sync that goes on in the background.
    sync: Option<JoinHandle<Result<()>>>,
}

impl Storage {
    pub(super) fn new(file: File) -> Self {
        Self { file, new: 0, sync: None }
    }

    /// Waits until everything is on the disk.
    pub(super) fn sync(&mut self) -> Result<()> {
        step()?;
        self.settle()?;
        self.file.sync_all()
    }

    /// Waits for the sync in the background; its failure is reported only once by the system, so it must not be lost.
    fn settle(&mut self) -> Result<()> {
        self.sync.take().map_or(Ok(()), |sync| sync.join().unwrap_or_else(|_| Err(Error::other("the sync failed"))))
    }

    /// Begins a sync in the background if enough is new and none goes on. Without a thread it is left to the end.
    fn written(&mut self, bytes: usize) -> Result<()> {
        self.new = self.new.saturating_add(bytes);
        if self.new < EVERY || self.sync.as_ref().is_some_and(|sync| !sync.is_finished()) {
            return Ok(());
        }
        self.settle()?;
        let file = self.file.try_clone()?;
        self.sync = Builder::new().name("sync".to_string()).spawn(move || file.sync_data()).ok();
        self.new = 0;
        Ok(())
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
        storage.sync().unwrap();
        assert!(storage.sync.is_none());
        let read = std::fs::read(&path).unwrap();
        assert!(read.len() == 9 * part.len() && read.chunks(part.len()).all(|chunk| chunk == part));
    }

    #[test]
    fn a_failed_sync_is_reported() {
        let folder = tempfile::tempdir().unwrap();
        let mut storage = Storage::new(File::create(folder.path().join("file")).unwrap());
        storage.sync = Some(std::thread::spawn(|| Err(Error::other("the disk is full"))));
        assert_eq!(storage.sync().unwrap_err().to_string(), "the disk is full");
    }
}
