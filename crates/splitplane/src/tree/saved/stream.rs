//! The bytes of a saved tree, one after the other.

use std::io::{self, Read, Write};
use std::sync::Arc;

use bytemuck::Pod;
use memmap2::Mmap;
use sha2::{Digest, Sha256};

use crate::tree::stored::{Keeper, Stored};
use crate::tree::wide::WideNode;

/// Bytes of the sum at the end.
pub(super) const SUM: u64 = 32;

/// Lists begin at multiples of it.
const ALIGNMENT: u64 = align_of::<WideNode>() as u64;

/// Numbers on their way into a file or out of one: what writes them and what reads them is the
/// same function.
pub(super) trait Pass: Sized {
    /// Writes these bytes, or puts what is read into their place.
    fn bytes(&mut self, bytes: &mut [u8]) -> io::Result<()>;

    fn u32(&mut self, number: &mut u32) -> io::Result<()> {
        let mut bytes = number.to_le_bytes();
        self.bytes(&mut bytes)?;
        *number = u32::from_le_bytes(bytes);
        Ok(())
    }

    fn u64(&mut self, number: &mut u64) -> io::Result<()> {
        let mut bytes = number.to_le_bytes();
        self.bytes(&mut bytes)?;
        *number = u64::from_le_bytes(bytes);
        Ok(())
    }

    fn f64(&mut self, number: &mut f64) -> io::Result<()> {
        let mut bits = number.to_bits();
        self.u64(&mut bits)?;
        *number = f64::from_bits(bits);
        Ok(())
    }

    /// A list of few things.
    fn sequence<T: Default>(
        &mut self,
        list: &mut Vec<T>,
        mut each: impl FnMut(&mut Self, &mut T) -> io::Result<()>,
    ) -> io::Result<()> {
        let mut count = list.len() as u64;
        self.u64(&mut count)?;
        // Not all at once: the number may be a lie.
        for i in 0..count as usize {
            if i == list.len() {
                list.push(T::default());
            }
            each(self, &mut list[i])?;
        }
        Ok(())
    }
}

pub(super) struct Output<'a, W> {
    to: &'a mut W,
    /// Bytes so far.
    at: u64,
    sum: Sha256,
}

impl<W: Write> Pass for Output<'_, W> {
    fn bytes(&mut self, bytes: &mut [u8]) -> io::Result<()> {
        self.write(bytes)
    }
}

impl<'a, W: Write> Output<'a, W> {
    pub(super) fn new(to: &'a mut W) -> Self {
        Output {
            to,
            at: 0,
            sum: Sha256::new(),
        }
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.at += bytes.len() as u64;
        self.sum.update(bytes);
        self.to.write_all(bytes)
    }

    /// A list of things that consist of numbers of four bytes, behind their count.
    pub(super) fn list<T: Pod>(&mut self, list: &[T]) -> io::Result<()> {
        self.u64(&mut (list.len() as u64))?;
        self.write(&[0; ALIGNMENT as usize][..gap(self.at)])?;
        if cfg!(target_endian = "little") {
            return self.write(bytemuck::cast_slice(list));
        }
        let words = bytemuck::cast_slice::<T, u32>(list);
        words
            .iter()
            .try_for_each(|word| self.write(&word.to_le_bytes()))
    }

    /// The sum of all so far.
    pub(super) fn sum(self) -> [u8; SUM as usize] {
        self.sum.finalize().into()
    }

    /// Writes the sum behind all.
    pub(super) fn end(self) -> io::Result<()> {
        let Output { to, sum, .. } = self;
        to.write_all(&sum.finalize())
    }
}

/// How many bytes lie between this place and the next where a list may begin.
fn gap(at: u64) -> usize {
    (at.next_multiple_of(ALIGNMENT) - at) as usize
}

pub(super) struct Input<'a, R> {
    from: R,
    /// Bytes so far.
    at: u64,
    /// Bytes before the sum.
    pub(super) left: u64,
    sum: Sha256,
    /// What is read, if it may be used where it lies.
    mapped: Option<&'a Arc<Mmap>>,
}

impl<R: Read> Pass for Input<'_, R> {
    fn bytes(&mut self, bytes: &mut [u8]) -> io::Result<()> {
        self.left = (self.left)
            .checked_sub(bytes.len() as u64)
            .ok_or_else(|| wrong("more than there is"))?;
        self.from.read_exact(bytes)?;
        self.at += bytes.len() as u64;
        self.sum.update(&*bytes);
        Ok(())
    }
}

impl<'a, R: Read> Input<'a, R> {
    /// `mapped`, if anything, is what is read.
    pub(super) fn new(from: R, size: u64, mapped: Option<&'a Arc<Mmap>>) -> Self {
        Input {
            from,
            at: 0,
            left: size,
            sum: Sha256::new(),
            mapped,
        }
    }

    pub(super) fn list<T: Pod + Keeper>(&mut self) -> io::Result<Stored<T>> {
        let mut count = 0;
        self.u64(&mut count)?;
        let mut empty = [0; ALIGNMENT as usize];
        let empty = &mut empty[..gap(self.at)];
        self.bytes(empty)?;
        if empty.iter().any(|&byte| byte != 0) {
            return Err(wrong("something between lists"));
        }
        if count > self.left / size_of::<T>() as u64 {
            return Err(wrong("a list longer than the file"));
        }
        if let Some(map) = self.mapped.filter(|_| cfg!(target_endian = "little")) {
            let list = Stored::mapped(map, self.at as usize, count as usize);
            self.skip(count * size_of::<T>() as u64)?;
            return list.ok_or_else(|| wrong("a list where none can be"));
        }
        let mut list = vec![T::zeroed(); count as usize];
        // In parts, so that what was read is still at hand when it is summed up.
        for part in bytemuck::cast_slice_mut::<T, u8>(&mut list).chunks_mut(1 << 18) {
            self.bytes(part)?;
        }
        if cfg!(target_endian = "big") {
            for word in bytemuck::cast_slice_mut::<T, u32>(&mut list) {
                *word = u32::from_le(*word);
            }
        }
        Ok(list.into())
    }

    /// Reads what others look at, or nobody.
    fn skip(&mut self, mut bytes: u64) -> io::Result<()> {
        let mut part = [0; 1 << 14];
        while bytes > 0 {
            let count = bytes.min(part.len() as u64);
            self.bytes(&mut part[..count as usize])?;
            bytes -= count;
        }
        Ok(())
    }

    /// Reads what is left, and whether all that was read is what the sum says.
    pub(super) fn sum_is_right(mut self) -> io::Result<bool> {
        self.skip(self.left)?;
        let mut sum = [0; SUM as usize];
        self.from.read_exact(&mut sum)?;
        Ok(sum == <[u8; SUM as usize]>::from(self.sum.finalize()))
    }
}

/// What the content says cannot be.
pub(super) fn wrong(what: &'static str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, what)
}
