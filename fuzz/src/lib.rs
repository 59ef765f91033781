//! What the fuzzer does with its bytes. The corpus goes through the same functions as an ordinary
//! test (`crates/splitplane-render/tests/fuzz_corpus.rs`).
//!
//! Readers are fed through the file system, as their users feed them.

use std::path::Path;

use sha2::{Digest, Sha256};
use splitplane::{
    Axis, BuildParams, Coherence, Layout, Mesh, Ray, TREES, Ties, Tree, TreeChoice, brute_force,
};
use splitplane_render::scene::{LoadOptions, Scene, load};

/// What a target does with its bytes. It panics where something is wrong.
pub type Target = fn(&[u8]);

/// All targets, by name.
pub const TARGETS: &[(&str, Target)] = &[
    ("pbrt_text", pbrt_text),
    ("pbrt_scene", pbrt_scene),
    ("ply", ply),
    ("obj", obj),
    ("stl", stl),
    ("texture", texture),
    ("build_and_cast", build_and_cast),
    ("saved_tree", saved_tree),
];

/// Longer files find nothing more.
const LONGEST: usize = 64 << 10;

/// Writes files into a folder of this thread, and reads the first of them as a scene. What was
/// read must be sound.
fn read(files: &[(&str, &[u8])]) {
    thread_local! {
        static FOLDER: Option<tempfile::TempDir> = tempfile::tempdir().ok();
    }
    if files.iter().any(|(_, bytes)| bytes.len() > LONGEST) {
        return;
    }
    FOLDER.with(|folder| {
        let folder = folder.as_ref().expect("there is a place for files").path();
        for (name, bytes) in files {
            std::fs::write(folder.join(name), bytes).expect("files can be written");
        }
        let first = folder.join(files[0].0);
        match load(&first.to_string_lossy(), &LoadOptions::default()) {
            Ok(scene) => check(&scene),
            Err(error) => assert!(!error.message.is_empty()),
        }
    });
}

/// What a scene promises.
fn check(scene: &Scene) {
    let mesh = &scene.mesh;
    let mut end = 0;
    for shape in &scene.shapes {
        assert_eq!(shape.triangles.start, end, "shapes follow each other");
        end = shape.triangles.end;
        assert!((shape.material as usize) < scene.materials.len());
    }
    assert_eq!(
        end as usize,
        mesh.triangles().len(),
        "shapes cover the mesh"
    );
    for list in [scene.normals.len(), scene.uvs.len()] {
        assert!(list == 0 || list == mesh.positions().len());
    }
    assert!(mesh.usable_triangles().len() + mesh.skipped().total() == mesh.triangles().len());
    assert!(scene.film.width > 0 && scene.film.height > 0);
}

/// A pbrt file of any bytes: the tokenizer's work, mostly.
pub fn pbrt_text(bytes: &[u8]) {
    read(&[("scene.pbrt", bytes)]);
}

/// Words of pbrt files. One byte of input is one of them, or begins a number or the text as it is.
const WORDS: &[&str] = &[
    "WorldBegin\n",
    "WorldEnd\n",
    "AttributeBegin\n",
    "AttributeEnd\n",
    "TransformBegin\n",
    "TransformEnd\n",
    "ObjectBegin ",
    "ObjectEnd\n",
    "ObjectInstance ",
    "Identity\n",
    "Translate ",
    "Scale ",
    "Rotate ",
    "LookAt ",
    "Transform ",
    "ConcatTransform ",
    "CoordinateSystem ",
    "CoordSysTransform ",
    "ReverseOrientation\n",
    "Camera \"perspective\" ",
    "Film \"image\" ",
    "Sampler \"halton\" ",
    "Sampler \"random\" ",
    "PixelFilter \"box\" ",
    "PixelFilter \"gaussian\" ",
    "Integrator \"path\" ",
    "Integrator \"ambientocclusion\" ",
    "Accelerator \"kdtree\" ",
    "Material \"matte\" ",
    "Material \"glass\" ",
    "Material \"metal\" ",
    "Material \"mix\" ",
    "MakeNamedMaterial ",
    "NamedMaterial ",
    "Texture ",
    "LightSource \"infinite\" ",
    "LightSource \"point\" ",
    "LightSource \"distant\" ",
    "AreaLightSource \"diffuse\" ",
    "Shape \"trianglemesh\" ",
    "Shape \"sphere\" ",
    "Shape \"loopsubdiv\" ",
    "Shape \"plymesh\" ",
    "Shape \"disk\" ",
    "Shape \"cylinder\" ",
    "Shape \"curve\" ",
    "Shape \"heightfield\" ",
    "MediumInterface ",
    "Include ",
    "\"a\" ",
    "\"b\" ",
    "\"scene.pbrt\" ",
    "\"spectrum\" \"imagemap\" ",
    "\"float\" \"scale\" ",
    "\"spectrum\" \"checkerboard\" ",
    "\"point P\" ",
    "\"normal N\" ",
    "\"float uv\" ",
    "\"integer indices\" ",
    "\"integer nlevels\" ",
    "\"float radius\" ",
    "\"float fov\" ",
    "\"rgb Kd\" ",
    "\"texture Kd\" ",
    "\"string filename\" ",
    "\"string type\" ",
    "\"string type\" \"matte\" ",
    "\"rgb L\" ",
    "\"spectrum L\" ",
    "\"blackbody L\" ",
    "\"integer xresolution\" ",
    "\"integer yresolution\" ",
    "\"integer pixelsamples\" ",
    "\"float cropwindow\" ",
    "\"integer nu\" ",
    "\"integer nv\" ",
    "\"float Pz\" ",
    "\"float phimax\" ",
    "\"bool twosided\" ",
    "\"true\" ",
    "\"false\" ",
    "[ ",
    "] ",
    "# ",
    "\n",
    "-",
    "1e38 ",
    "1e-40 ",
    "nan ",
    "0 ",
    "1 ",
    "2 ",
    "3 ",
    "0.5 ",
    "-1 ",
    "0 0 0  1 0 0  0 1 0 ",
    "0 1 2 ",
    "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1 ",
    "4294967295 ",
    "16 ",
];

/// A pbrt file of words that pbrt files have.
pub fn pbrt_scene(bytes: &[u8]) {
    let mut text = Vec::new();
    let mut bytes = bytes.iter();
    while let Some(&byte) = bytes.next() {
        match WORDS.get(byte as usize) {
            Some(word) => text.extend_from_slice(word.as_bytes()),
            None if byte >= 0xf0 => text.extend(bytes.next()),
            None => text.extend_from_slice(format!("{} ", i32::from(byte) - 160).as_bytes()),
        }
    }
    read(&[("scene.pbrt", &text)]);
}

/// A PLY file.
pub fn ply(bytes: &[u8]) {
    read(&[("mesh.ply", bytes)]);
}

/// An OBJ file, and from its first `newmtl` on a library of materials, `m`.
pub fn obj(bytes: &[u8]) {
    let library = bytes.windows(6).position(|word| word == b"newmtl");
    let (mesh, library) = bytes.split_at(library.unwrap_or(bytes.len()));
    read(&[("mesh.obj", mesh), ("m", library)]);
}

/// An STL file.
pub fn stl(bytes: &[u8]) {
    read(&[("mesh.stl", bytes)]);
}

/// A picture that a material names; the first byte says of what kind it is.
pub fn texture(bytes: &[u8]) {
    const KINDS: [&str; 6] = ["png", "exr", "tga", "jpg", "hdr", "bmp"];
    let Some((&kind, picture)) = bytes.split_first() else {
        return;
    };
    let name = format!("picture.{}", KINDS[kind as usize % KINDS.len()]);
    let scene = format!(
        "WorldBegin Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"{name}\"\n\
         Material \"matte\" \"texture Kd\" \"t\"\n\
         Shape \"trianglemesh\" \"integer indices\" [0 1 2] \"point P\" [0 0 0 1 0 0 0 1 0]\n\
         WorldEnd"
    );
    read(&[("scene.pbrt", scene.as_bytes()), (&name, picture)]);
}

/// Coordinates that meet: a byte chooses one, or four bytes that follow are it.
struct Numbers<'a>(std::slice::Iter<'a, u8>);

impl Numbers<'_> {
    fn byte(&mut self) -> Option<u8> {
        self.0.next().copied()
    }

    fn number(&mut self) -> Option<f32> {
        const SPECIAL: [f32; 8] = [
            -0.0,
            1e-40,
            1e18,
            -1e18,
            f32::NAN,
            f32::INFINITY,
            1e-20,
            1e6,
        ];
        Some(match self.byte()? {
            byte @ ..=0xdf => (f32::from(byte) - 112.0) / 16.0,
            byte @ 0xe0..=0xef => SPECIAL[byte as usize % SPECIAL.len()],
            _ => {
                let mut four = [0; 4];
                for byte in &mut four {
                    *byte = self.byte()?;
                }
                f32::from_bits(u32::from_le_bytes(four))
            }
        })
    }

    fn point(&mut self) -> Option<[f32; 3]> {
        Some([self.number()?, self.number()?, self.number()?])
    }
}

/// A mesh, a tree over it, and rays, against testing every triangle.
pub fn build_and_cast(bytes: &[u8]) {
    let mut numbers = Numbers(bytes.iter());
    let (Some(tree), Some(count), Some(options)) = (numbers.byte(), numbers.byte(), numbers.byte())
    else {
        return;
    };
    let vertices = usize::from(count % 64);
    let Some(positions) = (0..vertices)
        .map(|_| numbers.point())
        .collect::<Option<Vec<_>>>()
    else {
        return;
    };
    let mut triangles = Vec::new();
    if options & 1 == 0 {
        // Every three vertices.
        triangles.extend((2..vertices as u32).step_by(3).map(|i| [i - 2, i - 1, i]));
    } else {
        // A strip: all share edges.
        triangles.extend((2..vertices as u32).map(|i| [i - 2, i - 1, i]));
    }
    if options & 2 != 0 {
        triangles.extend_from_within(..);
    }
    let mesh = Mesh::new(positions, triangles).expect("all indices are in range");
    let spec = &TREES[usize::from(tree) % TREES.len()];
    let choice = TreeChoice::new(spec.name, None).expect("a tree of the list");
    let params = BuildParams {
        ties: if options & 4 == 0 {
            Ties::Tolerant
        } else {
            Ties::AsPublished
        },
        clip: options & 16 == 0,
        seed: u64::from(options >> 4),
        ..BuildParams::default()
    };
    let tree = Tree::build(&mesh, choice, &params).expect("a small mesh has a tree");
    tree.validate().expect("a tree is sound");
    let wide = tree.clone().with_layout(Layout::Wide);
    let wide = wide.expect("a small tree is stored in wide nodes");
    let mut all = Vec::new();
    let (mut rays, mut truths) = (Vec::new(), Vec::new());
    while let (Some(origin), Some(direction)) = (numbers.point(), numbers.point()) {
        let mut ray = Ray::new(origin, direction);
        if options & 8 != 0 {
            let (Some(t_min), Some(t_max)) = (numbers.number(), numbers.number()) else {
                return;
            };
            (ray.t_min, ray.t_max) = (t_min, t_max);
        }
        let truth = brute_force(&mesh, &ray);
        for tree in [&tree, &wide] {
            let case = || format!("{choice}, {}: {ray:?}", tree.layout());
            assert_eq!(tree.closest_hit(&ray, &mut ()), truth, "{}", case());
            let any = tree.any_hit(&ray, &mut ());
            assert_eq!(any, truth.is_some(), "{}", case());
            tree.all_hits(&ray, &mut all, &mut ());
            assert_eq!(all.first(), truth.as_ref(), "{}", case());
        }
        rays.push(ray);
        truths.push(truth);
    }
    // Few rays go together as well: each of them more than once.
    let count = rays.len().next_multiple_of(TOGETHER);
    let rays: Vec<_> = rays.into_iter().cycle().take(count).collect();
    let truths: Vec<_> = truths.into_iter().cycle().take(count).collect();
    let is_hit: Vec<_> = truths.iter().map(Option::is_some).collect();
    for coherence in [Coherence::Coherent, Coherence::Incoherent] {
        let (mut hits, mut any) = (vec![None; count], vec![false; count]);
        wide.closest_hits_as(coherence, &rays, &mut hits);
        wide.any_hits_as(coherence, &rays, &mut any);
        assert_eq!(hits, truths, "{choice}, {coherence:?}: {rays:?}");
        assert_eq!(any, is_hit, "{choice}, {coherence:?}: {rays:?}");
    }
}

/// Rays that go through a tree together.
const TOGETHER: usize = 16;

/// The mesh that saved trees are loaded over.
fn mesh_of_saved_trees() -> Mesh {
    let corner = |i: u32| {
        let c = |shift: u32| (i.wrapping_mul(2_654_435_761) >> shift & 15) as f32 / 8.0 - 1.0;
        [c(4), c(12), c(20)]
    };
    let triangles = (0..8).map(|i| [i, i + 1, i + 2]).collect();
    Mesh::new((1..11).map(corner).collect(), triangles).expect("all indices are in range")
}

/// A saved tree, with the sum that it should have: refused, or one that answers.
pub fn saved_tree(bytes: &[u8]) {
    let mesh = mesh_of_saved_trees();
    let mut bytes = bytes.to_vec();
    if let Some(content) = bytes.len().checked_sub(32) {
        let sum = Sha256::digest(&bytes[..content]);
        bytes[content..].copy_from_slice(&sum);
    }
    let Ok(tree) = Tree::from_bytes(&bytes, &mesh) else {
        return;
    };
    let mut hits = Vec::new();
    let towards = |[x, y, z]: [f32; 3]| Ray::new([x, y, z], [0.3 - x, 0.2 - y, 0.1 - z]);
    for [x, y, z] in mesh.positions().iter().copied().chain([[1e19, 0.0, 0.0]]) {
        let ray = towards([x, y, z]);
        tree.closest_hit(&ray, &mut ());
        tree.any_hit(&ray, &mut ());
        tree.all_hits(&ray, &mut hits, &mut ());
        tree.closest_point([x, y, z], f32::INFINITY, &mut ());
        tree.contains([x, y, z], &mut ());
    }
    let rays: Vec<Ray> = (mesh.positions().iter().copied().map(towards))
        .cycle()
        .take(TOGETHER)
        .collect();
    let (mut together, mut any) = ([None; TOGETHER], [false; TOGETHER]);
    for coherence in [Coherence::Coherent, Coherence::Incoherent] {
        tree.closest_hits_as(coherence, &rays, &mut together);
        tree.any_hits_as(coherence, &rays, &mut any);
    }
    tree.triangles_in_box(&tree.bounds(), &mut ());
    tree.section(Axis::X, 0.1, u32::MAX);
    tree.card();
    let _ = tree.validate();
    let mut again = Vec::new();
    tree.write_to(&mut again).expect("memory takes everything");
    assert!(
        Tree::from_bytes(&again, &mesh).is_ok(),
        "what was saved is loaded"
    );
}

/// Whether these are the bytes of a saved tree of this version.
pub fn is_saved_tree(bytes: &[u8]) -> bool {
    Tree::from_bytes(bytes, &mesh_of_saved_trees()).is_ok()
}

/// What the corpus of [`saved_tree`] is: a tree of each kind in each layout.
pub fn saved_trees() -> Vec<(String, Vec<u8>)> {
    let mesh = mesh_of_saved_trees();
    let mut files = Vec::new();
    for spec in TREES {
        let choice = TreeChoice::new(spec.name, None).expect("a tree of the list");
        let tree = Tree::build(&mesh, choice, &BuildParams::default()).expect("it is small");
        for layout in Layout::ALL {
            let tree = tree.clone().with_layout(layout).expect("it is small");
            let mut bytes = Vec::new();
            tree.write_to(&mut bytes).expect("memory takes everything");
            files.push((format!("{}-{layout}", spec.name), bytes));
        }
    }
    files
}

/// The corpus of a target.
pub fn corpus(fuzz_folder: &Path, target: &str) -> Vec<(String, Vec<u8>)> {
    let folder = fuzz_folder.join("corpus").join(target);
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut files: Vec<(String, Vec<u8>)> = entries
        .filter_map(|entry| {
            let name = entry.file_name().to_string_lossy().into_owned();
            Some((name, std::fs::read(entry.path()).ok()?))
        })
        .collect();
    files.sort();
    files
}
