//! Lists that do not change any more: a tree's own, or parts of a file that is mapped into memory.

#![allow(unsafe_code)]

use std::any::Any;
use std::fs::File;
use std::io;
use std::ops::Deref;
use std::panic::{RefUnwindSafe, UnwindSafe};
use std::ptr::NonNull;
use std::sync::Arc;

use bytemuck::Pod;
use memmap2::Mmap;

/// A list that is shared, not copied, when it is cloned. As a plain list it is two words that
/// queries read, wherever its items lie.
pub(crate) struct Stored<T> {
    items: NonNull<[T]>,
    /// What they lie in.
    keeper: Arc<dyn Keeper>,
}

/// Whatever items may lie in, and items themselves.
pub(crate) trait Keeper: Any + Send + Sync + UnwindSafe + RefUnwindSafe {}

impl<T: Any + Send + Sync + UnwindSafe + RefUnwindSafe> Keeper for T {}

// SAFETY: it is read only, as what keeps it is.
unsafe impl<T: Send + Sync> Send for Stored<T> {}
// SAFETY: as above.
unsafe impl<T: Send + Sync> Sync for Stored<T> {}

impl<T> Deref for Stored<T> {
    type Target = [T];

    #[inline(always)]
    fn deref(&self) -> &[T] {
        // SAFETY: they were a slice of what the keeper owns, which is as long as this there and
        // lends nothing else to be written; that of a file is as `map` asks.
        unsafe { self.items.as_ref() }
    }
}

impl<T: Keeper> From<Vec<T>> for Stored<T> {
    fn from(list: Vec<T>) -> Stored<T> {
        let keeper = Arc::new(list);
        Stored {
            items: NonNull::from(keeper.as_slice()),
            keeper,
        }
    }
}

impl<T: Pod> Stored<T> {
    /// So many items from byte `start` of a file; nothing where there are not as many, or not at a
    /// place where such items can be.
    pub(crate) fn mapped(file: &Arc<Mmap>, start: usize, count: usize) -> Option<Stored<T>> {
        let end = start.checked_add(count.checked_mul(size_of::<T>())?)?;
        let items: &[T] = bytemuck::try_cast_slice(file.get(start..end)?).ok()?;
        Some(Stored {
            items: NonNull::from(items),
            keeper: Arc::clone(file) as _,
        })
    }
}

impl<T> Clone for Stored<T> {
    fn clone(&self) -> Self {
        Stored {
            items: self.items,
            keeper: Arc::clone(&self.keeper),
        }
    }
}

impl<T: std::fmt::Debug> std::fmt::Debug for Stored<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        (**self).fmt(f)
    }
}

impl<T: PartialEq> PartialEq for Stored<T> {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

/// A file as memory, to be read.
///
/// # Safety
/// As long as this or any [`Stored`] of it are there, nobody changes the file or cuts it short.
pub(crate) unsafe fn map(file: &File) -> io::Result<Arc<Mmap>> {
    // SAFETY: the caller's word.
    unsafe { Mmap::map(file) }.map(Arc::new)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_is_shared_and_kept() {
        let list: Stored<u32> = vec![3, 1, 4].into();
        let copy = list.clone();
        assert!(std::ptr::eq(&*list, &*copy));
        drop(list);
        assert_eq!(*copy, [3, 1, 4]);
        let copy = std::thread::spawn(move || copy[2]).join();
        assert_eq!(copy.unwrap(), 4);
    }

    #[cfg(not(miri))]
    #[test]
    fn items_of_a_file_are_where_they_can_be() {
        let bytes: Vec<u8> = (0..64).collect();
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(&file, &bytes).unwrap();
        // SAFETY: nobody else knows the file.
        let map = unsafe { map(file.as_file()) }.unwrap();
        let items = Stored::<u32>::mapped(&map, 4, 2).unwrap();
        assert_eq!(*items, [0x0706_0504, 0x0b0a_0908].map(u32::from_le));
        assert!(Stored::<u32>::mapped(&map, 0, 16).is_some());
        for (start, count) in [(2, 1), (0, 17), (61, 1), (64, usize::MAX), (usize::MAX, 1)] {
            assert!(Stored::<u32>::mapped(&map, start, count).is_none());
        }
        drop(map);
        assert_eq!(items[0].to_le_bytes(), bytes[4..8]);
    }
}
