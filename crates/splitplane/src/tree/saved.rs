//! Trees in files.
//!
//! A file says what it is and in which version of this format, then of which mesh the tree is and
//! how it was built, then lists the nodes as they are in memory, and ends with the SHA-256 of all
//! before. Numbers are little-endian; lists begin at multiples of 64 bytes, so that a file can be
//! mapped into memory and used as it is. The vertices are not in it: a tree is loaded over its mesh.
//!
//! Nothing that is read is trusted: a length is held against what is left of the file before memory
//! is asked for, and every index against what it points into. So a file that was made to deceive,
//! with the right sum, may give wrong hits; it cannot make a query panic, hang or read what is not
//! its own.

mod stream;

use std::fs::File;
use std::io::{self, BufReader, Read, Write};
use std::path::Path;
use std::sync::Arc;

use memmap2::Mmap;

use super::nodes::Shared;
use super::stored::{self, Stored};
use super::wide::{MAX_FRAMES, Wide};
use super::{Kind, Layout, Nodes, Tree, TreeCard, ValidateError, with_nodes};
use crate::build::{BuildParams, BuildStats, DepthLimit, Expected, ObliquePricing, Ties};
use crate::catalog::{MAX_DIRECTION_COUNT, ParseTreeError, TreeChoice};
use crate::geometry::{Frame, Mesh};
use crate::whole::write_whole;
use stream::{Input, Output, Pass, SUM, wrong};

/// As PNG's: shows where a transfer has changed line ends or cut off a bit.
const MAGIC: [u8; 8] = *b"\x89SPT\r\n\x1a\n";

/// Grows whenever what a file holds, or what that means, changes.
const VERSION: u32 = 4;

/// Why a saved tree was not loaded.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// The file could not be read.
    #[error("cannot be read: {0}")]
    Read(#[from] io::Error),
    /// Something else than a saved tree.
    #[error("is not a saved tree")]
    NotATree,
    /// Saved by a Splitplane with another format.
    #[error(
        "was saved in version {found} of the format, this Splitplane reads version {known}; build \
         the tree again"
    )]
    Version {
        /// The version of the file.
        found: u32,
        /// The version that is read.
        known: u32,
    },
    /// The content is not what was written: cut short, or changed.
    #[error("is damaged: it was cut short or changed")]
    Damaged,
    /// The tree is one over another mesh.
    #[error(
        "is the tree of another mesh, of {triangles} triangles and {vertices} vertices{}",
        if *same_size { " as this one, but not the same" } else { "" }
    )]
    OtherMesh {
        /// Triangles of that mesh.
        triangles: u64,
        /// Vertices of that mesh.
        vertices: u64,
        /// This mesh has as many of both.
        same_size: bool,
    },
    /// The tree is of a kind that there is not.
    #[error(transparent)]
    Tree(#[from] ParseTreeError),
    /// What was written was no tree.
    #[error("is no sound tree: {0}")]
    Unsound(#[from] ValidateError),
    /// A number that cannot be, although the sum is right.
    #[error("is no sound tree: {what}")]
    Invalid {
        /// What is wrong.
        what: String,
    },
}

impl Tree {
    /// Writes the tree to a file, which is then either whole or as it was before. By custom its
    /// name ends in `.spt`.
    ///
    /// The file has the nodes in the tree's layout, its parameters, and the SHA-256 of its mesh and
    /// of all this; not the mesh. A [`Tree::with_traversal`] is not kept.
    ///
    /// ```
    /// # use splitplane::{Mesh, Tree};
    /// # let folder = std::env::temp_dir().join(format!("splitplane-doc-{}", std::process::id()));
    /// # std::fs::create_dir_all(&folder)?;
    /// # let path = folder.join("tree.spt");
    /// # let mesh = Mesh::new(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]])?;
    /// let tree = Tree::new(&mesh)?;
    /// tree.save(&path)?;
    /// assert_eq!(Tree::load(&path, &mesh)?, tree);
    /// # std::fs::remove_dir_all(&folder)?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// What the system says; the file is as it was then.
    pub fn save(&self, path: impl AsRef<Path>) -> io::Result<()> {
        write_whole(path.as_ref(), |file| self.write_to(file))
    }

    /// Writes what [`Tree::save`] does, to wherever.
    ///
    /// # Errors
    /// What `to` says.
    pub fn write_to(&self, to: &mut impl Write) -> io::Result<()> {
        let mut out = Output::new(to);
        out.bytes(&mut MAGIC.clone())?;
        out.u32(&mut VERSION.clone())?;
        let mut head = Head {
            mesh: MeshId::of(&self.mesh),
            name: self.choice.to_string(),
            layout: Layout::ALL
                .iter()
                .position(|&l| l == self.layout())
                .unwrap_or(0) as u32,
            params: self.params.clone(),
            stats: self.stats,
            expected: self.expected.clone(),
        };
        head.pass(&mut out)?;
        match &self.wide {
            None => {
                out.list(&self.shared.directions)?;
                out.list(&self.shared.frames)?;
                with_nodes!(self, nodes => out.list(nodes))?;
                out.list(&self.references)?;
            }
            Some((wide, card)) => {
                out.list(&[Scale {
                    center: wide.center,
                    half_extent: wide.half_extent,
                }])?;
                out.list(&wide.frames)?;
                out.list(&wide.nodes)?;
                out.list(&wide.leaves)?;
                pass_card(&mut out, &mut card.clone())?;
            }
        }
        out.end()
    }

    /// Reads a tree that [`Tree::save`] wrote, over the same mesh.
    ///
    /// The nodes are copied: whatever becomes of the file, the tree stays as it is;
    /// [`Tree::load_mapped`] copies nothing. The sum of the file is checked, and every index in it,
    /// so that no file leads a query astray; see [`LoadError`].
    ///
    /// # Errors
    /// The file cannot be read, is not a saved tree, is damaged, or is that of another mesh.
    pub fn load(path: impl AsRef<Path>, mesh: &Mesh) -> Result<Tree, LoadError> {
        let (file, size) = open(path.as_ref())?;
        load(BufReader::with_capacity(1 << 16, file), size, None, mesh)
    }

    /// As [`Tree::load`], but the nodes stay in the file, which is mapped into memory as long as the
    /// tree or a clone of it is there: processes that have the same tree share one copy, and what
    /// is rarely asked for can leave memory. All of it is read once and checked, as ever.
    ///
    /// ```
    /// # use splitplane::{Mesh, Tree};
    /// # let folder = std::env::temp_dir().join(format!("splitplane-map-{}", std::process::id()));
    /// # std::fs::create_dir_all(&folder)?;
    /// # let path = folder.join("tree.spt");
    /// # let mesh = Mesh::new(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]])?;
    /// Tree::new(&mesh)?.save(&path)?;
    /// // SAFETY: nobody but `save` writes there, which never changes a file that is there.
    /// let tree = unsafe { Tree::load_mapped(&path, &mesh) }?;
    /// assert_eq!(tree, Tree::new(&mesh)?);
    /// # drop(tree);
    /// # std::fs::remove_dir_all(&folder)?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Safety
    /// As long as the tree or a clone of it is there, nobody changes the file in place or cuts it
    /// short: a query would go where the changed nodes lead. To remove it or to put another in its
    /// place, as [`Tree::save`] does, is no such change (Windows refuses it).
    ///
    /// # Errors
    /// Those of [`Tree::load`]; or the system has no such mapping.
    #[allow(unsafe_code)]
    pub unsafe fn load_mapped(path: impl AsRef<Path>, mesh: &Mesh) -> Result<Tree, LoadError> {
        let (file, size) = open(path.as_ref())?;
        if size == 0 {
            return Err(LoadError::NotATree);
        }
        // SAFETY: the caller's word.
        let map = unsafe { stored::map(&file) }?;
        load(&**map, map.len() as u64, Some(&map), mesh)
    }

    /// Reads what [`Tree::write_to`] wrote.
    ///
    /// # Errors
    /// Those of [`Tree::load`].
    pub fn from_bytes(bytes: &[u8], mesh: &Mesh) -> Result<Tree, LoadError> {
        load(bytes, bytes.len() as u64, None, mesh)
    }
}

/// A file that may be a saved tree, and its size.
fn open(path: &Path) -> Result<(File, u64), LoadError> {
    let file = File::open(path)?;
    let metadata = file.metadata()?;
    match metadata.is_file() {
        true => Ok((file, metadata.len())),
        false => Err(LoadError::NotATree),
    }
}

/// Reads a tree; what is `mapped`, if anything, is the same that is read.
fn load(
    from: impl Read,
    size: u64,
    mapped: Option<&Arc<Mmap>>,
    mesh: &Mesh,
) -> Result<Tree, LoadError> {
    let mut input = Input::new(from, size, mapped);
    let (mut magic, mut version) = ([0; 8], 0);
    if size < MAGIC.len() as u64 {
        return Err(LoadError::NotATree);
    }
    input.bytes(&mut magic)?;
    if magic != MAGIC {
        return Err(LoadError::NotATree);
    }
    if input.left < 4 + SUM {
        return Err(LoadError::Damaged);
    }
    input.left -= SUM;
    input.u32(&mut version)?;
    if version != VERSION {
        return Err(LoadError::Version {
            found: version,
            known: VERSION,
        });
    }
    let content = Content::read(&mut input);
    // Whatever was found: what is damaged says nothing.
    if !input.sum_is_right()? {
        return Err(LoadError::Damaged);
    }
    let tree = content?.over(mesh)?;
    tree.check_structure()?;
    Ok(match tree.wide {
        Some((wide, mut card)) => {
            card.bytes = wide.bytes() as u64;
            card.wide = Some(wide.card());
            let wide = Some((wide, card));
            Tree { wide, ..tree }
        }
        None => tree,
    })
}

/// What a file holds, as it was read.
struct Content {
    head: Head,
    choice: TreeChoice,
    nodes: Nodes,
    references: Stored<u32>,
    directions: Vec<[f32; 3]>,
    frames: Vec<Frame>,
    wide: Option<(Wide, TreeCard)>,
}

impl Content {
    fn read(input: &mut Input<'_, impl Read>) -> Result<Content, LoadError> {
        let mut head = Head::default();
        head.pass(input).map_err(invalid)?;
        let choice: TreeChoice = head.name.parse()?;
        let mut content = Content {
            head,
            choice,
            nodes: Nodes::Kd(Vec::new().into()),
            references: Vec::new().into(),
            directions: Vec::new(),
            frames: Vec::new(),
            wide: None,
        };
        content.read_lists(input).map_err(invalid)?;
        if input.left > 0 {
            return Err(invalid(wrong("something follows the tree")));
        }
        Ok(content)
    }

    fn read_lists(&mut self, input: &mut Input<'_, impl Read>) -> io::Result<()> {
        match Layout::ALL.get(self.head.layout as usize) {
            Some(Layout::Binary) => {
                self.directions = input.list()?.to_vec();
                self.frames = input.list()?.to_vec();
                self.nodes = match Kind::of(self.choice.spec) {
                    Kind::Kd => Nodes::Kd(input.list()?),
                    Kind::Indexed => Nodes::Indexed(input.list()?),
                    Kind::Boxes => Nodes::Boxes(input.list()?),
                    Kind::Oblique => Nodes::Oblique(input.list()?),
                };
                self.references = input.list()?;
            }
            Some(Layout::Wide) => {
                let scale: Stored<Scale> = input.list()?;
                let [
                    Scale {
                        center,
                        half_extent,
                    },
                ] = scale[..]
                else {
                    return Err(wrong("one centre of the scene"));
                };
                let wide = Wide {
                    frames: input.list()?.to_vec(),
                    nodes: input.list()?,
                    leaves: input.list()?,
                    center,
                    half_extent,
                };
                let mut card = TreeCard::nothing(self.choice);
                pass_card(input, &mut card)?;
                self.wide = Some((wide, card));
            }
            None => return Err(wrong("a layout that there is not")),
        }
        Ok(())
    }

    /// The tree, with its indices as they were read.
    fn over(self, mesh: &Mesh) -> Result<Tree, LoadError> {
        let (saved, own) = (self.head.mesh, MeshId::of(mesh));
        if saved != own {
            return Err(LoadError::OtherMesh {
                triangles: saved.triangles,
                vertices: saved.vertices,
                same_size: (saved.triangles, saved.vertices) == (own.triangles, own.vertices),
            });
        }
        let params = self.head.params;
        params.check().map_err(|error| LoadError::Invalid {
            what: error.to_string(),
        })?;
        if self.directions.len() > MAX_DIRECTION_COUNT as usize {
            return Err(invalid(wrong("too many directions")));
        }
        if self.frames.len() > MAX_FRAMES {
            return Err(invalid(wrong("too many frames")));
        }
        let axis_nodes = self.choice.spec.axis_nodes;
        Ok(Tree {
            place: Tree::place_over(mesh, &params),
            mesh: mesh.clone(),
            choice: self.choice,
            params,
            nodes: self.nodes,
            references: self.references,
            shared: match self.wide {
                Some(_) => Shared::default(),
                None => Shared::new(self.directions, self.frames, axis_nodes),
            },
            expected: self.head.expected,
            stats: self.head.stats,
            wide: self.wide,
        })
    }
}

/// Which mesh a tree is over.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct MeshId {
    vertices: u64,
    triangles: u64,
    /// SHA-256 of vertices, triangles and origin.
    sum: [u8; 32],
}

impl MeshId {
    fn of(mesh: &Mesh) -> MeshId {
        let mut sink = io::sink();
        let mut out = Output::new(&mut sink);
        let mut hash = || {
            out.list(mesh.positions())?;
            out.list(mesh.triangles())?;
            mesh.origin().iter_mut().try_for_each(|c| out.f64(c))
        };
        hash().expect("a sink takes everything");
        MeshId {
            vertices: mesh.positions().len() as u64,
            triangles: mesh.triangles().len() as u64,
            sum: out.sum(),
        }
    }
}

/// What comes before the lists.
#[derive(Default)]
struct Head {
    mesh: MeshId,
    name: String,
    layout: u32,
    params: BuildParams,
    stats: BuildStats,
    expected: Expected,
}

/// What the wide layout knows of the scene.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Scale {
    center: [f32; 3],
    half_extent: f32,
}

impl Head {
    fn pass(&mut self, by: &mut impl Pass) -> io::Result<()> {
        by.u64(&mut self.mesh.vertices)?;
        by.u64(&mut self.mesh.triangles)?;
        by.bytes(&mut self.mesh.sum)?;
        let mut name = std::mem::take(&mut self.name).into_bytes();
        by.sequence(&mut name, |by, byte| by.bytes(std::slice::from_mut(byte)))?;
        self.name = String::from_utf8(name).map_err(|_| wrong("the tree's name"))?;
        by.u32(&mut self.layout)?;
        pass_params(by, &mut self.params)?;
        pass_stats(by, &mut self.stats)?;
        let Expected {
            axis_visits,
            oblique_visits,
            tests,
        } = &mut self.expected;
        by.f64(axis_visits)?;
        by.f64(oblique_visits)?;
        let mut pairs: Vec<(u32, f64)> =
            tests.iter().map(|(&size, &tests)| (size, tests)).collect();
        by.sequence(&mut pairs, |by, (size, tests)| {
            by.u32(size)?;
            by.f64(tests)
        })?;
        *tests = pairs.into_iter().collect();
        Ok(())
    }
}

fn pass_params(by: &mut impl Pass, params: &mut BuildParams) -> io::Result<()> {
    let (mut pricing, mut alpha) = match params.oblique_pricing {
        ObliquePricing::Published { alpha } => (0, alpha),
        ObliquePricing::Fork { alpha } => (1, alpha),
    };
    let (mut depth, mut base, mut per_level, mut fixed) = match params.max_depth {
        DepthLimit::Log2 { base, per_level } => (0, base, per_level, 0),
        DepthLimit::Fixed(fixed) => (1, 0.0, 0.0, fixed),
    };
    let mut ties = match params.ties {
        Ties::AsPublished => 0,
        Ties::Tolerant => 1,
    };
    by.f64(&mut params.intersection_cost)?;
    by.f64(&mut params.kd_traversal_cost)?;
    by.f64(&mut params.oblique_traversal_cost)?;
    by.u32(&mut pricing)?;
    by.f64(&mut alpha)?;
    by.f64(&mut params.empty_bonus)?;
    by.u32(&mut params.max_prims)?;
    by.u32(&mut depth)?;
    by.f64(&mut base)?;
    by.f64(&mut per_level)?;
    by.u32(&mut fixed)?;
    by.u32(&mut ties)?;
    let mut clip = u32::from(params.clip);
    by.u32(&mut clip)?;
    params.clip = match clip {
        0 => false,
        1 => true,
        _ => return Err(wrong("whether triangles are clipped")),
    };
    by.u32(&mut params.oblique_up_to)?;
    by.f64(&mut params.max_references)?;
    by.u64(&mut params.seed)?;
    params.oblique_pricing = match pricing {
        0 => ObliquePricing::Published { alpha },
        1 => ObliquePricing::Fork { alpha },
        _ => return Err(wrong("how oblique nodes are priced")),
    };
    params.max_depth = match depth {
        0 => DepthLimit::Log2 { base, per_level },
        1 => DepthLimit::Fixed(fixed),
        _ => return Err(wrong("the limit of depths")),
    };
    params.ties = match ties {
        0 => Ties::AsPublished,
        1 => Ties::Tolerant,
        _ => return Err(wrong("how ties are treated")),
    };
    Ok(())
}

fn pass_stats(by: &mut impl Pass, stats: &mut BuildStats) -> io::Result<()> {
    let wins = &mut stats.wins;
    for count in [
        &mut stats.bad_refines,
        &mut stats.candidates,
        &mut stats.uncut_cells,
        &mut stats.limited_leaves,
        &mut wins.axis,
        &mut wins.direction,
        &mut wins.triangle,
        &mut wins.edge,
    ] {
        by.u64(count)?;
    }
    Ok(())
}

/// The card, but for what follows from the nodes.
fn pass_card(by: &mut impl Pass, card: &mut TreeCard) -> io::Result<()> {
    let nodes = &mut card.nodes;
    for count in [
        &mut card.triangles,
        &mut nodes.kd,
        &mut nodes.oblique,
        &mut nodes.leaf,
        &mut nodes.empty_leaf,
        &mut card.references,
        &mut card.largest_leaf,
    ] {
        by.u64(count)?;
    }
    by.u32(&mut card.depth)?;
    by.sequence(&mut card.leaf_sizes, |by, (triangles, leaves)| {
        by.u32(triangles)?;
        by.u64(leaves)
    })?;
    by.sequence(&mut card.depths, |by, (kd, oblique)| {
        by.u64(kd)?;
        by.u64(oblique)
    })?;
    by.f64(&mut card.expected_visits)?;
    by.f64(&mut card.expected_tests)?;
    by.sequence(&mut card.tests_by_leaf_size, |by, (triangles, share)| {
        by.u32(triangles)?;
        by.f64(share)
    })?;
    by.f64(&mut card.sah_cost)?;
    pass_stats(by, &mut card.build)
}

impl TreeCard {
    /// A card to be filled.
    fn nothing(choice: TreeChoice) -> TreeCard {
        TreeCard {
            choice,
            triangles: 0,
            nodes: Default::default(),
            references: 0,
            depth: 0,
            largest_leaf: 0,
            leaf_sizes: Vec::new(),
            depths: Vec::new(),
            expected_visits: 0.0,
            expected_tests: 0.0,
            tests_by_leaf_size: Vec::new(),
            sah_cost: 0.0,
            bytes: 0,
            build: BuildStats::default(),
            wide: None,
        }
    }
}

fn invalid(error: io::Error) -> LoadError {
    match error.kind() {
        io::ErrorKind::InvalidData => LoadError::Invalid {
            what: error.to_string(),
        },
        _ => LoadError::Read(error),
    }
}
