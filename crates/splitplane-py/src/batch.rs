//! Many queries at once: on a pool of threads, without the interpreter's lock, and stopped by
//! Ctrl-C.

use std::collections::HashMap;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, mpsc};
use std::time::Duration;

use numpy::{Element, PyArray2, PyArrayDescr, PyArrayMethods, PyReadonlyArray2};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::type_object::PyTypeCheck;
use pyo3::types::PyTuple;
use rayon::{ThreadPool, ThreadPoolBuilder};

/// Queries between two looks at whether the user wants to stop: some tens of milliseconds.
const BLOCK: usize = 1 << 18;

/// Queries that a thread takes at a time: their rays and answers stay in the first cache.
pub(crate) const CHUNK: usize = 1 << 6;

/// The pool of that many threads, 0 being one per core; made once for each number.
fn pool(threads: usize) -> PyResult<Arc<ThreadPool>> {
    static POOLS: Mutex<Option<HashMap<usize, Arc<ThreadPool>>>> = Mutex::new(None);
    let mut pools = POOLS
        .lock()
        .unwrap_or_else(|poisoned| poisoned.into_inner());
    let pools = pools.get_or_insert_with(HashMap::new);
    if let Some(pool) = pools.get(&threads) {
        return Ok(pool.clone());
    }
    let pool = (ThreadPoolBuilder::new().num_threads(threads).build())
        .map_err(|error| PyRuntimeError::new_err(format!("cannot start threads: {error}")))?;
    let pool = Arc::new(pool);
    pools.insert(threads, pool.clone());
    Ok(pool)
}

/// Calls `work` for ranges that cover `0..count`, on that many threads.
pub(crate) fn in_blocks(
    py: Python<'_>,
    count: usize,
    threads: usize,
    mut work: impl FnMut(Range<usize>) + Send,
) -> PyResult<()> {
    let pool = pool(threads)?;
    for start in (0..count).step_by(BLOCK) {
        let block = start..count.min(start + BLOCK);
        py.detach(|| pool.install(|| work(block)));
        py.check_signals()?;
    }
    Ok(())
}

/// Does long work beside the interpreter, which looks every now and then whether the user wants to
/// stop. `work` gets the flag that then says so.
pub(crate) fn interruptible<T: Send>(
    py: Python<'_>,
    work: impl FnOnce(&AtomicBool) -> T + Send,
) -> PyResult<T> {
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let (done, waiting) = mpsc::channel();
        let stop_it = &stop;
        scope.spawn(move || {
            // Nobody waits any more after an interruption.
            let _ = done.send(work(stop_it));
        });
        // A receiver is not `Sync`, but nothing else uses it.
        let waiting = Mutex::new(waiting);
        loop {
            let answer = py.detach(|| {
                let waiting = waiting
                    .lock()
                    .unwrap_or_else(|poisoned| poisoned.into_inner());
                waiting.recv_timeout(Duration::from_millis(50))
            });
            match answer {
                Ok(found) => return Ok(found),
                Err(mpsc::RecvTimeoutError::Timeout) => {
                    if let Err(interrupt) = py.check_signals() {
                        stop.store(true, Ordering::Relaxed);
                        return Err(interrupt);
                    }
                }
                Err(mpsc::RecvTimeoutError::Disconnected) => {
                    return Err(PyRuntimeError::new_err("the work ended without a result"));
                }
            }
        }
    })
}

/// The rows of an array of that many columns, where they lie.
pub(crate) fn rows<'a, T: Element, const N: usize>(
    array: &'a PyReadonlyArray2<'_, T>,
    what: &str,
) -> PyResult<&'a [[T; N]]> {
    let shape = array.as_array().shape().to_vec();
    if shape[1] != N {
        return Err(PyValueError::new_err(format!(
            "{what} has the shape {shape:?}"
        )));
    }
    let numbers = (array.as_slice())
        .map_err(|_| PyValueError::new_err(format!("{what} is not contiguous")))?;
    Ok(numbers.as_chunks().0)
}

/// A new array whose numbers are any: all of it must be written.
pub(crate) fn empty<'py, A: PyTypeCheck>(
    py: Python<'py>,
    shape: &[usize],
    number: Bound<'py, PyArrayDescr>,
) -> PyResult<Bound<'py, A>> {
    let empty = py.import("numpy")?.getattr("empty")?;
    let array = empty.call1((PyTuple::new(py, shape)?, number))?;
    Ok(array.cast_into()?)
}

/// An array with a row for each of `rows`; their memory becomes the array's.
pub(crate) fn array2<const N: usize, T: Element>(
    py: Python<'_>,
    rows: Vec<[T; N]>,
) -> PyResult<Bound<'_, PyArray2<T>>> {
    let count = rows.len();
    numpy::PyArray1::from_vec(py, rows.into_flattened()).reshape([count, N])
}
