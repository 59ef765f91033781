//! Watching a build, and stopping it.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use super::grow::PARALLEL_FROM;

/// Watches long work, and may stop it.
pub trait Progress: Sync {
    /// `done` of `total` parts of the work are done. Called now and then, from any thread.
    fn advanced(&self, _done: u64, _total: u64) {}
    /// Asked often; once it says yes, the work ends with an error that says so.
    fn cancelled(&self) -> bool {
        false
    }
    /// A part of a build that concerns so many triangles begins, on this thread. Parts lie within
    /// each other; only those of thousands of triangles are told.
    fn began(&self, _part: BuildPart, _triangles: usize) {}
    /// The part that began last on this thread and has not ended yet, ends.
    fn ended(&self) {}
}

/// A part of a build.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BuildPart {
    /// Where triangles start and end along the directions of the whole tree is sorted.
    Sort,
    /// A node, with all that is below it.
    Subtree,
    /// The search for the split plane of a node.
    Search,
    /// The part of a search that goes along one direction, where directions are shared among threads.
    Sweep,
    /// The triangles and the cell of a node are divided between its children.
    Divide,
}

impl BuildPart {
    /// In a word, for timelines.
    pub fn name(self) -> &'static str {
        match self {
            BuildPart::Sort => "sort",
            BuildPart::Subtree => "subtree",
            BuildPart::Search => "search",
            BuildPart::Sweep => "sweep",
            BuildPart::Divide => "divide",
        }
    }
}

/// Watches nothing, never stops.
impl Progress for () {}

/// The root's share of the work.
pub(super) const WHOLE: u64 = 1 << 40;

/// How much of the work is done before it is told again.
const STEP: u64 = WHOLE / 512;

/// A build as it goes on, for all its threads.
pub(super) struct Watched<'a> {
    progress: &'a dyn Progress,
    triangles: u64,
    done: AtomicU64,
    stopped: AtomicBool,
    references: AtomicU64,
    max_references: u64,
}

impl<'a> Watched<'a> {
    /// A build over that many triangles; progress is told in triangles.
    /// References are counted up to `max_references`; then the build stops.
    pub(super) fn new(progress: &'a dyn Progress, triangles: usize, max_references: f64) -> Self {
        Watched {
            progress,
            triangles: triangles as u64,
            done: AtomicU64::new(0),
            stopped: AtomicBool::new(false),
            references: AtomicU64::new(0),
            max_references: max_references as u64,
        }
    }

    /// A part of the work, as a share of [`WHOLE`], is done: a leaf of so many references.
    pub(super) fn finished(&self, share: u64, references: usize) {
        // Once it is stopped, what is called a leaf is not done.
        if self.is_stopped() {
            return;
        }
        let count = references as u64;
        let before = self.references.fetch_add(count, Ordering::Relaxed);
        if before + count > self.max_references {
            self.stopped.store(true, Ordering::Relaxed);
        }
        let before = self.done.fetch_add(share, Ordering::Relaxed);
        let done = before + share;
        if done / STEP != before / STEP {
            let triangles = u128::from(done) * u128::from(self.triangles) / u128::from(WHOLE);
            self.progress.advanced(triangles as u64, self.triangles);
        }
    }

    /// Tells of a part of the build, until what is given back is dropped.
    pub(super) fn part(&self, part: BuildPart, triangles: usize) -> Option<Told<'a>> {
        (triangles >= PARALLEL_FROM).then(|| {
            self.progress.began(part, triangles);
            Told(self.progress)
        })
    }

    /// Asks whether to stop.
    pub(super) fn ask(&self) -> bool {
        if self.progress.cancelled() {
            self.stopped.store(true, Ordering::Relaxed);
        }
        self.is_stopped()
    }

    /// Whether more references were asked for than there may be.
    pub(super) fn is_over(&self) -> bool {
        self.references.load(Ordering::Relaxed) > self.max_references
    }

    pub(super) fn is_stopped(&self) -> bool {
        self.stopped.load(Ordering::Relaxed)
    }
}

/// A part of a build that was told, while it goes on.
pub(super) struct Told<'a>(&'a dyn Progress);

impl Drop for Told<'_> {
    fn drop(&mut self) {
        self.0.ended();
    }
}

/// The shares of two children with these numbers of triangles.
pub(super) fn divide(share: u64, below: usize, above: usize) -> (u64, u64) {
    let all = (below + above).max(1) as u128;
    let first = (u128::from(share) * below as u128 / all) as u64;
    (first, share - first)
}
