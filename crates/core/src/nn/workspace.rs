//! Reusable buffers. The system clears each page of fresh memory on its first use, which takes as long as the
//! arithmetic of a narrow layer.

use super::scalar::Scalar;
use std::sync::{Mutex, PoisonError};

/// Buffers that are kept, at most.
const MOST: usize = 64;

/// Buffers that are free. What they held does not matter: they are filled before they are handed out.
#[derive(Debug, Default)]
pub struct Workspace<T> {
    free: Mutex<Vec<Vec<T>>>,
}

impl<T: Scalar> Workspace<T> {
    /// A buffer of so many zeros.
    pub fn zeros(&self, count: usize) -> Vec<T> {
        let mut buffer = self.taken(count);
        buffer.resize(count, T::ZERO);
        buffer
    }

    /// A copy of these values.
    pub fn copied(&self, values: &[T]) -> Vec<T> {
        let mut buffer = self.taken(values.len());
        buffer.extend_from_slice(values);
        buffer
    }

    /// Gives a buffer back.
    pub fn recycle(&self, mut buffer: Vec<T>) {
        buffer.clear();
        let mut free = self.free.lock().unwrap_or_else(PoisonError::into_inner);
        let place = free.partition_point(|other| other.capacity() < buffer.capacity());
        free.insert(place, buffer);
        if free.len() > MOST {
            free.remove(0);
        }
    }

    /// The smallest free buffer with room for so many values, empty; a new one if there is none.
    fn taken(&self, count: usize) -> Vec<T> {
        let mut free = self.free.lock().unwrap_or_else(PoisonError::into_inner);
        let place = free.partition_point(|buffer| buffer.capacity() < count);
        match place < free.len() && free[place].capacity() / 4 <= count {
            true => free.remove(place),
            false => {
                drop(free);
                // Some room, as the next batch is a little larger or smaller.
                Vec::with_capacity(count + count / 8)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buffers_come_back_empty_of_what_they_held() {
        let workspace = Workspace::<f32>::default();
        let mut first = workspace.zeros(1000);
        first.fill(7.0);
        let place = first.as_ptr();
        workspace.recycle(first);
        let again = workspace.zeros(900);
        assert_eq!((again.as_ptr(), again), (place, vec![0.0; 900]));
        let copy = workspace.copied(&[1.0, 2.0]);
        assert_eq!(copy, [1.0, 2.0]);
        // A small request does not take a large buffer.
        workspace.recycle(workspace.zeros(100_000));
        assert!(workspace.zeros(10).capacity() < 100);
        (0..200).for_each(|size| workspace.recycle(vec![0.0; size + 1]));
        assert_eq!(workspace.free.lock().unwrap().len(), MOST);
    }
}
