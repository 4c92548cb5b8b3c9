//! A decoder that calls itself, kept from using up the stack.
//!
//! LAZ follows four sequences of GPS times. The `laz` crate changes from one to another by calling itself, as often as the
//! bytes say: once a point in sound files, without end in damaged ones, because the adaptive model gives a symbol that
//! comes often at most all but 5 of 2^15 parts, so that a change costs as little as 1/36,000 byte. Where a stack ends no
//! panic can be caught. So the decoder runs on a stack with room for all calls between two bytes, and the reader of the
//! bytes refuses to go on when the stack is deep. Chunks in layers (point formats from 6 on) are decoded from a copy
//! inside the crate, where no reader can look: there the large stack outlasts bytes that are damaged by chance (the calls
//! end after some 6,000), but not every file that is made to break it.

use std::io::{Cursor, Error, Read, Result, Seek, SeekFrom};
use std::panic::resume_unwind;
use std::thread;

/// Bytes of the stack, of which only what is used takes memory: 36,000 nested calls of some 200 bytes are 7 MiB.
const STACK: usize = 32 << 20;
/// Bytes of it that may be in use when a byte is read. A LAZ encoder changes the sequence once a point.
const DEEPEST: usize = 1 << 20;

/// The bytes of a chunk.
pub(in crate::io::las) struct WatchedBytes<B> {
    bytes: Cursor<B>,
    /// Address in the stack where the decoder began.
    top: usize,
}

impl<B: AsRef<[u8]>> WatchedBytes<B> {
    pub(in crate::io::las) fn new(bytes: B) -> Self {
        Self { bytes: Cursor::new(bytes), top: here() }
    }

    /// Bytes that were read so far.
    pub(super) fn position(&self) -> u64 {
        self.bytes.position()
    }

    /// The decoder begins here, on this thread.
    pub(super) fn begin(&mut self) {
        self.top = here();
    }

    #[inline(always)]
    fn check(&self) -> Result<()> {
        match here().abs_diff(self.top) <= DEEPEST {
            true => Ok(()),
            false => Err(Error::other("GPS times that change their sequence without end")),
        }
    }
}

/// An address in the stack of this thread.
#[inline(always)]
fn here() -> usize {
    let mark = 0u8;
    std::ptr::from_ref(std::hint::black_box(&mark)).addr()
}

impl<B: AsRef<[u8]>> Read for WatchedBytes<B> {
    #[inline(always)]
    fn read(&mut self, out: &mut [u8]) -> Result<usize> {
        self.check()?;
        self.bytes.read(out)
    }

    #[inline(always)]
    fn read_exact(&mut self, out: &mut [u8]) -> Result<()> {
        self.check()?;
        self.bytes.read_exact(out)
    }
}

impl<B: AsRef<[u8]>> Seek for WatchedBytes<B> {
    fn seek(&mut self, to: SeekFrom) -> Result<u64> {
        self.bytes.seek(to)
    }
}

/// Runs work on a stack of its own; its panics go on here.
///
/// # Errors
/// Those of the work, and that the system gives no thread.
pub(super) fn on_a_large_stack<T: Send>(work: impl FnOnce() -> Result<T> + Send) -> Result<T> {
    thread::scope(|scope| {
        let thread = thread::Builder::new().stack_size(STACK).spawn_scoped(scope, work)?;
        thread.join().unwrap_or_else(|panic| resume_unwind(panic))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reads a byte in each of so many nested calls.
    fn nested(source: &mut WatchedBytes<&[u8]>, calls: usize) -> Result<usize> {
        let room = std::hint::black_box([0u8; 1024]);
        source.read_exact(&mut [0])?;
        Ok(if calls > 1 { nested(source, calls - 1)? } else { 0 } + room.len())
    }

    #[test]
    fn a_deep_stack_is_refused_and_a_shallow_one_is_not() {
        let bytes = vec![0; 100_000];
        let depth = |calls| {
            on_a_large_stack(|| {
                let mut source = WatchedBytes::new(bytes.as_slice());
                source.begin();
                nested(&mut source, calls)
            })
        };
        assert_eq!(depth(100).unwrap(), 102_400);
        assert!(depth(100_000).unwrap_err().to_string().contains("sequence"));
    }

    #[test]
    fn a_panic_on_the_large_stack_comes_back() {
        let panic = std::panic::catch_unwind(|| on_a_large_stack::<()>(|| panic!("lost")));
        assert_eq!(panic.unwrap_err().downcast_ref::<&str>(), Some(&"lost"));
    }
}
