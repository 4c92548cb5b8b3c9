//! The only module with threads: ordered parallel map and fold, cancellation and the release of memory after it,
//! progress, warnings.
//!
//! Core uses rayon's current thread pool; only the command line and the Python package create one. Results are
//! collected in the order of the items, so that they are the same bytes for any number of threads.

use crate::error::{Error, Result};
use rayon::prelude::*;
use std::ops::{Deref, DerefMut, Range};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::{array, mem, thread};

/// Connects a long computation with its caller, who can cancel it and follow its progress.
///
/// Clones share one state. `Monitor::default()` is never cancelled.
#[derive(Clone, Debug, Default)]
pub struct Monitor(Arc<State>);

#[derive(Debug, Default)]
struct State {
    cancelled: AtomicBool,
    done: AtomicU64,
    total: AtomicU64,
    stage: std::sync::Mutex<&'static str>,
    /// Number of the current file from 1 on, and of all files.
    files: std::sync::Mutex<[usize; 2]>,
    warnings: std::sync::Mutex<Vec<String>>,
    /// Items after which the work is cancelled, if not 0.
    #[cfg(test)]
    most: AtomicU64,
}

impl Monitor {
    /// Is cancelled once a stage has reported this number of items, for tests.
    #[cfg(test)]
    pub(crate) fn cancelled_after(items: u64) -> Self {
        let monitor = Self::default();
        monitor.0.most.store(items, Ordering::Relaxed);
        monitor
    }

    /// Requests cancellation; the computation returns [`Error::Interrupted`] soon after.
    pub fn cancel(&self) {
        self.0.cancelled.store(true, Ordering::Relaxed);
    }

    /// Fails if the work was cancelled. To be called at least every few milliseconds.
    pub fn check(&self) -> Result<()> {
        if self.is_cancelled() { Err(Error::Interrupted) } else { Ok(()) }
    }

    /// Whether the work was cancelled, for code that cannot return an error.
    pub fn is_cancelled(&self) -> bool {
        self.0.cancelled.load(Ordering::Relaxed)
    }

    /// Starts a stage of `total` items (points, trees).
    pub fn stage(&self, name: &'static str, total: u64) {
        if let Ok(mut stage) = self.0.stage.lock() {
            *stage = name;
        }
        self.0.done.store(0, Ordering::Relaxed);
        self.0.total.store(total, Ordering::Relaxed);
    }

    /// Starts the work on a file, of several: its number from 1 on, and that of all.
    pub fn file(&self, number: usize, all: usize) {
        if let Ok(mut files) = self.0.files.lock() {
            *files = [number, all];
        }
    }

    /// Number of the current file from 1 on, and of all files; zeros if that was not told.
    pub fn files(&self) -> [usize; 2] {
        self.0.files.lock().map(|files| *files).unwrap_or_default()
    }

    /// Stores a warning for the user (each text once); the caller shows it.
    pub fn warn(&self, text: impl Into<String>) {
        let text = text.into();
        if let Ok(mut warnings) = self.0.warnings.lock()
            && !warnings.contains(&text)
        {
            warnings.push(text);
        }
    }

    /// The warnings since the last call, in order.
    pub fn take_warnings(&self) -> Vec<String> {
        self.0.warnings.lock().map(|mut warnings| std::mem::take(&mut *warnings)).unwrap_or_default()
    }

    /// Reports that `items` more are done.
    pub fn advance(&self, items: u64) {
        let _before = self.0.done.fetch_add(items, Ordering::Relaxed);
        #[cfg(test)]
        if (1..=_before + items).contains(&self.0.most.load(Ordering::Relaxed)) {
            self.cancel();
        }
    }

    /// Name of the current stage, number of items done, and total number.
    pub fn progress(&self) -> (&'static str, u64, u64) {
        let stage = self.0.stage.lock().map(|s| *s).unwrap_or_default();
        (stage, self.0.done.load(Ordering::Relaxed), self.0.total.load(Ordering::Relaxed))
    }
}

/// Number of items of light work (nanoseconds each) between two checks for cancellation.
const PIECE: usize = 16_384;

/// Number of items of light work that are computed in one call.
const GROUP: usize = 16;

/// The pieces of `0..len` in order, with a check for cancellation before each; the first error is the last item.
///
/// For serial loops over many items of some nanoseconds each.
pub fn watched(len: usize, monitor: &Monitor) -> impl Iterator<Item = Result<Range<usize>>> + '_ {
    (0..len).step_by(PIECE).map(move |at| monitor.check().map(|()| at..at.saturating_add(PIECE).min(len)))
}

/// Makes a list as long as told, with copies of `value` at its end; memory is slow when it is touched for the first time.
///
/// # Errors
/// If the work was cancelled.
pub fn resize_watched<T: Clone>(items: &mut Vec<T>, len: usize, value: &T, monitor: &Monitor) -> Result<()> {
    items.truncate(len);
    items.reserve_exact(len - items.len());
    while items.len() < len {
        monitor.check()?;
        items.resize(items.len().saturating_add(PIECE).min(len), value.clone());
    }
    Ok(())
}

/// Checks for cancellation at intervals in serial loops that do not run over `0..len` (for those see [`watched`]).
#[derive(Debug)]
pub struct Looks<'a> {
    monitor: &'a Monitor,
    /// Steps until the next check.
    left: usize,
}

impl<'a> Looks<'a> {
    /// Checks this monitor, the first time at the first step.
    pub fn at(monitor: &'a Monitor) -> Self {
        Self { monitor, left: 0 }
    }

    /// Counts one step of some nanoseconds.
    ///
    /// # Errors
    /// If the work was cancelled.
    #[inline]
    pub fn step(&mut self) -> Result<()> {
        self.steps(1)
    }

    /// Counts `count` steps of some nanoseconds each.
    ///
    /// # Errors
    /// If the work was cancelled.
    #[inline]
    pub fn steps(&mut self, count: usize) -> Result<()> {
        if self.left > count {
            self.left -= count;
            return Ok(());
        }
        self.left = PIECE;
        self.monitor.check()
    }
}

/// A large value whose memory a cancelled computation does not wait to free: the system takes a tenth of a second or more to
/// take back a gigabyte, so after cancellation a separate thread frees it. No result depends on that thread.
#[derive(Debug, Default)]
pub struct Held<T: Default + Send + 'static> {
    value: T,
    monitor: Monitor,
}

impl<T: Default + Send + 'static> Held<T> {
    /// Holds a value during the work that the monitor watches.
    pub fn new(value: T, monitor: &Monitor) -> Self {
        Self { value, monitor: monitor.clone() }
    }

    /// The value, no longer held.
    pub fn into_inner(mut self) -> T {
        // Nothing is left to free.
        self.monitor = Monitor::default();
        mem::take(&mut self.value)
    }
}

impl<T: Default + Send + 'static> Deref for Held<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.value
    }
}

impl<T: Default + Send + 'static> DerefMut for Held<T> {
    fn deref_mut(&mut self) -> &mut T {
        &mut self.value
    }
}

impl<T: Default + Send + 'static> Drop for Held<T> {
    fn drop(&mut self) {
        if self.monitor.is_cancelled() {
            let value = mem::take(&mut self.value);
            // Without a thread the value is freed here.
            let _ = thread::Builder::new().spawn(move || drop(value));
        }
    }
}

/// Sorts in parallel, unstably. After cancellation all items compare as equal, so that the sort ends at once.
///
/// # Errors
/// If the work was cancelled; the items are then in no useful order.
pub fn sort_watched<T: Ord + Send>(items: &mut [T], monitor: &Monitor) -> Result<()> {
    sort_watched_by(items, T::cmp, monitor)
}

/// Like [`sort_watched`], by the order that is given.
///
/// # Errors
/// If the work was cancelled.
pub fn sort_watched_by<T: Send>(
    items: &mut [T],
    order: impl Fn(&T, &T) -> std::cmp::Ordering + Sync,
    monitor: &Monitor,
) -> Result<()> {
    items.par_sort_unstable_by(|a, b| if monitor.is_cancelled() { std::cmp::Ordering::Equal } else { order(a, b) });
    monitor.check()
}

/// Maps `0..count` in parallel, in order, by a kernel of some nanoseconds an item. After cancellation the remaining
/// items are skipped.
///
/// # Errors
/// If the work was cancelled.
pub fn map_watched<T: Default + Send>(
    count: usize,
    monitor: &Monitor,
    kernel: impl Fn(usize) -> T + Sync,
) -> Result<Vec<T>> {
    // Without this look, cancelled work would still touch the memory of all items.
    monitor.check()?;
    let item = |i: usize| if i < count && !monitor.is_cancelled() { kernel(i) } else { T::default() };
    let group = |g: usize| -> [T; GROUP] { array::from_fn(|k| item(g * GROUP + k)) };
    let mut all = collected(count.div_ceil(GROUP), &group).into_flattened();
    all.truncate(count);
    monitor.check().map(|()| all)
}

/// Maps groups in parallel, in order. The kernel is called through a pointer, so that rayon's code is compiled once for each
/// type and not once for each kernel.
fn collected<T: Send>(count: usize, kernel: &(dyn Fn(usize) -> T + Sync)) -> Vec<T> {
    (0..count).into_par_iter().map(kernel).collect()
}

/// Maps items of long work in parallel, in order, at most `most` at a time in a thread. Rayon's code is compiled once for all
/// types and kernels.
fn in_slots<T: Send>(items: Range<usize>, most: usize, kernel: impl Fn(usize) -> T + Sync) -> impl Iterator<Item = T> {
    let slots: Vec<Mutex<Option<T>>> = items.clone().map(|_| Mutex::new(None)).collect();
    for_each(slots.len(), most, &|slot| {
        let found = kernel(items.start + slot);
        *slots[slot].lock().unwrap_or_else(PoisonError::into_inner) = Some(found);
    });
    slots.into_iter().filter_map(|slot| slot.into_inner().unwrap_or_else(PoisonError::into_inner))
}

/// Calls `work` with each number below `count` in parallel.
fn for_each(count: usize, most: usize, work: &(dyn Fn(usize) + Sync)) {
    (0..count).into_par_iter().with_max_len(most).for_each(work);
}

/// Concatenates all parts in order; each part is freed once its items are copied.
///
/// # Errors
/// If the work was cancelled.
pub fn concat_watched<T>(parts: Vec<Vec<T>>, monitor: &Monitor) -> Result<Vec<T>> {
    let mut all = Vec::with_capacity(parts.iter().map(Vec::len).sum());
    for part in parts {
        monitor.check()?;
        all.extend(part);
    }
    Ok(all)
}

/// Maps `0..count` in parallel and returns the results in order. After cancellation the remaining items are skipped.
///
/// # Errors
/// If the work was cancelled, or the first error of `kernel` in the order of the items.
pub fn map_ordered<T: Send>(
    count: usize,
    monitor: &Monitor,
    kernel: impl Fn(usize) -> Result<T> + Sync,
) -> Result<Vec<T>> {
    in_slots(0..count, count, |i| monitor.check().and_then(|()| kernel(i))).collect()
}

/// Like [`map_ordered`], of the items of a slice.
///
/// # Errors
/// As [`map_ordered`].
pub fn map_each<I: Sync, T: Send>(
    items: &[I],
    monitor: &Monitor,
    kernel: impl Fn(&I) -> Result<T> + Sync,
) -> Result<Vec<T>> {
    map_ordered(items.len(), monitor, |i| kernel(&items[i]))
}

/// Like [`map_ordered`], with a scratch value that is reused from item to item: about as many are made as there are threads.
/// Results must not depend on it.
///
/// # Errors
/// As [`map_ordered`].
pub fn map_ordered_with<S: Send, T: Send>(
    items: Range<usize>,
    monitor: &Monitor,
    scratch: impl Fn() -> S + Sync + Send,
    kernel: impl Fn(&mut S, usize) -> Result<T> + Sync + Send,
) -> Result<Vec<T>> {
    let unused = Mutex::new(Vec::new());
    let pool = || unused.lock().unwrap_or_else(PoisonError::into_inner);
    let one = |i: usize| {
        monitor.check()?;
        let waiting = pool().pop();
        let mut own = waiting.unwrap_or_else(&scratch);
        let found = kernel(&mut own, i);
        pool().push(own);
        found
    };
    in_slots(items, 4, one).collect()
}

/// Fills a list in parallel, in parts of `size` items, of which the last may have fewer; the kernel gets the number of the
/// part. After cancellation the remaining parts are skipped.
///
/// # Errors
/// If the work was cancelled.
pub fn fill_parts<T: Send>(
    items: &mut [T],
    size: usize,
    monitor: &Monitor,
    kernel: impl Fn(usize, &mut [T]) + Sync,
) -> Result<()> {
    each_part(items, size.max(1), &|number, part| {
        if !monitor.is_cancelled() {
            kernel(number, part);
        }
    });
    monitor.check()
}

/// Calls `work` with each part of a list in parallel, and its number.
fn each_part<T: Send>(items: &mut [T], size: usize, work: &(dyn Fn(usize, &mut [T]) + Sync)) {
    items.par_chunks_mut(size).enumerate().for_each(|(number, part)| work(number, part));
}

/// Maps fixed chunks of `0..len` in parallel and folds their results in order; independent of the number of threads.
pub fn fold_ordered<T: Send>(
    len: usize,
    chunk: usize,
    kernel: impl Fn(Range<usize>) -> T + Sync,
    mut fold: impl FnMut(T, T) -> T,
) -> Option<T> {
    let chunk = chunk.max(1);
    let part = |c: usize| kernel(c * chunk..((c + 1) * chunk).min(len));
    in_slots(0..len.div_ceil(chunk), len, part).reduce(&mut fold)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc;

    #[test]
    fn fold_gives_the_same_bits_for_any_pool() {
        let values: Vec<f64> = (0..10_000).map(|i| 1.0 / (1.0 + f64::from(i))).collect();
        let sum = || fold_ordered(values.len(), 128, |r| values[r].iter().sum::<f64>(), |a, b| a + b).unwrap();
        let with = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap().install(sum);
        assert_eq!(with(1).to_bits(), with(3).to_bits());
    }

    #[test]
    fn parts_are_filled_by_their_number_until_the_work_is_cancelled() {
        let monitor = Monitor::default();
        let mut items = vec![0; 25];
        fill_parts(&mut items, 10, &monitor, |number, part| part.fill(10 * number + part.len())).unwrap();
        assert!(items.iter().enumerate().all(|(i, &item)| item == [10, 20, 25][i / 10]));
        monitor.cancel();
        assert!(fill_parts(&mut items, 10, &monitor, |_, part| part.fill(0)).is_err());
        assert_eq!(items[24], 25);
    }

    #[test]
    fn pieces_cover_all_items_in_order_until_the_work_is_cancelled() {
        let monitor = Monitor::default();
        for len in [0, 1, PIECE, 3 * PIECE + 7] {
            assert!(watched(len, &monitor).flat_map(Result::unwrap).eq(0..len));
        }
        let seen = watched(5 * PIECE, &monitor).inspect(|_| monitor.cancel()).take_while(Result::is_ok).count();
        assert_eq!(seen, 1);
    }

    #[test]
    fn a_list_gets_its_length_unless_the_work_is_cancelled() {
        let (monitor, mut items) = (Monitor::default(), vec![1; 5]);
        for (len, expected) in [(3, vec![1; 3]), (2 * PIECE + 1, [vec![1; 3], vec![7; 2 * PIECE - 2]].concat())] {
            resize_watched(&mut items, len, &7, &monitor).unwrap();
            assert_eq!(items, expected);
        }
        monitor.cancel();
        assert!(resize_watched(&mut items, 4 * PIECE, &7, &monitor).is_err());
        assert!(items.len() < 4 * PIECE);
    }

    #[test]
    fn items_and_parts_stand_in_order_unless_the_work_is_cancelled() {
        let monitor = Monitor::default();
        let squares: Vec<usize> = (0..PIECE + 7).map(|i| i * i).collect();
        assert_eq!(map_watched(PIECE + 7, &monitor, |i| i * i).unwrap(), squares);
        let parts: Vec<Vec<usize>> = squares.chunks(1000).map(<[usize]>::to_vec).collect();
        assert_eq!(concat_watched(parts.clone(), &monitor).unwrap(), squares);
        monitor.cancel();
        assert!(map_watched::<usize>(9, &monitor, |_| panic!("not called")).is_err());
        assert!(concat_watched(parts, &monitor).is_err());
    }

    #[test]
    fn scratch_values_are_made_once_a_thread() {
        let made = std::sync::atomic::AtomicUsize::new(0);
        let scratch = || made.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        let run = || map_ordered_with(0..1000, &Monitor::default(), scratch, |_, i| Ok(2 * i)).unwrap();
        let found = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap().install(run);
        assert!(found.into_iter().eq((0..1000).map(|i| 2 * i)));
        assert!((1..=3).contains(&made.into_inner()));
    }

    #[test]
    fn what_is_held_is_freed_by_another_thread_once_the_work_is_cancelled() {
        /// Sends the thread that frees it.
        #[derive(Default)]
        struct Large(Option<mpsc::Sender<thread::ThreadId>>);
        impl Drop for Large {
            fn drop(&mut self) {
                let _ = self.0.take().map(|sender| sender.send(thread::current().id()));
            }
        }
        let (monitor, (sender, freed)) = (Monitor::default(), mpsc::channel());
        let held = || Held::new(Large(Some(sender.clone())), &monitor);
        drop(held());
        assert_eq!(freed.recv().unwrap(), thread::current().id());
        let (late, taken) = (held(), held().into_inner());
        monitor.cancel();
        drop(late);
        assert_ne!(freed.recv().unwrap(), thread::current().id());
        drop(taken);
        assert_eq!(freed.recv().unwrap(), thread::current().id());
    }

    #[test]
    fn looks_end_a_loop_once_the_work_is_cancelled() {
        let monitor = Monitor::default();
        let mut looks = Looks::at(&monitor);
        assert!((0..3 * PIECE).all(|_| looks.step().is_ok()));
        monitor.cancel();
        assert!((0..PIECE).any(|_| looks.step().is_err()));
        assert!(Looks::at(&monitor).step().is_err() && looks.steps(PIECE).is_err());
    }

    #[test]
    fn a_sort_is_that_of_the_standard_library_and_ends_when_it_is_cancelled() {
        let scrambled = || (0..300_000u64).map(|i| i.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40).collect::<Vec<_>>();
        let (mut items, mut expected) = (scrambled(), scrambled());
        sort_watched(&mut items, &Monitor::default()).unwrap();
        expected.sort_unstable();
        assert_eq!(items, expected);
        // Cancelled during the sort, at different moments.
        for moment in [1, 1000, 100_000, 1_000_000] {
            let monitor = Monitor::default();
            let compared = AtomicU64::new(0);
            let mut items: Vec<Counted<'_>> =
                scrambled().into_iter().map(|v| Counted(v, &compared, &monitor, moment)).collect();
            assert!(sort_watched(&mut items, &monitor).is_err());
            let values: Vec<u64> = items.iter().map(|item| item.0).collect();
            assert!(compared.into_inner() < moment + 100, "no comparison after the end");
            let mut left = values;
            left.sort_unstable();
            assert_eq!(left, expected, "nothing is lost");
        }
    }

    /// Cancels the work at the given comparison.
    #[derive(Debug)]
    struct Counted<'a>(u64, &'a AtomicU64, &'a Monitor, u64);

    impl Ord for Counted<'_> {
        fn cmp(&self, other: &Self) -> std::cmp::Ordering {
            if self.1.fetch_add(1, Ordering::Relaxed) + 1 >= self.3 {
                self.2.cancel();
            }
            self.0.cmp(&other.0)
        }
    }

    impl PartialOrd for Counted<'_> {
        fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
            Some(self.cmp(other))
        }
    }

    impl PartialEq for Counted<'_> {
        fn eq(&self, other: &Self) -> bool {
            self.0 == other.0
        }
    }

    impl Eq for Counted<'_> {}

    #[test]
    fn a_warning_is_kept_once_until_it_is_taken() {
        let monitor = Monitor::default();
        ["a", "b", "a"].into_iter().for_each(|text| monitor.clone().warn(text));
        assert_eq!((monitor.take_warnings(), monitor.take_warnings().len()), (vec!["a".into(), "b".to_string()], 0));
    }

    #[test]
    fn cancelled_work_returns_interrupted() {
        let monitor = Monitor::default();
        monitor.cancel();
        assert!(matches!(map_ordered(3, &monitor, Ok), Err(Error::Interrupted)));
    }
}
