//! Embree 4, by the library that is found when it is asked for.

use std::ffi::{CString, c_char, c_int, c_uint, c_void};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicIsize, Ordering};

use anyhow::{Context, Result, anyhow, bail};
use libloading::Library;
use splitplane::{Hit, Ray};

use crate::contender::{Contender, Geometry, each};
use crate::rays::Kind;

type Handle = *mut c_void;
type Monitor = unsafe extern "C" fn(*mut c_void, isize, bool) -> bool;

/// The functions that are used, as `embree4/rtcore*.h` declares them.
macro_rules! functions {
    ($($name:ident: fn($($argument:ty),*) $(-> $result:ty)?;)*) => {
        #[allow(non_snake_case)]
        struct Functions {
            $($name: unsafe extern "C" fn($($argument),*) $(-> $result)?,)*
            _library: Library,
        }

        impl Functions {
            fn load(path: &Path) -> Result<Self> {
                // SAFETY: loading runs the initialisers of Embree and of its TBB, which ask for
                // nothing.
                let library = unsafe { Library::new(path) }?;
                Ok(Functions {
                    // SAFETY: the types are those of the header of Embree 4; the library outlives
                    // the pointers, being kept beside them.
                    $($name: unsafe { *library.get(stringify!($name))? },)*
                    _library: library,
                })
            }
        }
    };
}

functions! {
    rtcNewDevice: fn(*const c_char) -> Handle;
    rtcReleaseDevice: fn(Handle);
    rtcGetDeviceError: fn(Handle) -> c_int;
    rtcGetDeviceProperty: fn(Handle, c_int) -> isize;
    rtcSetDeviceMemoryMonitorFunction: fn(Handle, Option<Monitor>, *mut c_void);
    rtcNewScene: fn(Handle) -> Handle;
    rtcReleaseScene: fn(Handle);
    rtcSetSceneFlags: fn(Handle, c_int);
    rtcSetSceneBuildQuality: fn(Handle, c_int);
    rtcNewGeometry: fn(Handle, c_int) -> Handle;
    rtcSetSharedGeometryBuffer:
        fn(Handle, c_int, c_uint, c_int, *const c_void, usize, usize, usize);
    rtcCommitGeometry: fn(Handle);
    rtcAttachGeometry: fn(Handle, Handle) -> c_uint;
    rtcReleaseGeometry: fn(Handle);
    rtcCommitScene: fn(Handle);
    rtcIntersect1: fn(Handle, *mut RayHit1, *const Arguments);
    rtcOccluded1: fn(Handle, *mut RayHit1, *const Arguments);
    rtcIntersect4: fn(*const c_int, Handle, *mut RayHits<4>, *const Arguments);
    rtcOccluded4: fn(*const c_int, Handle, *mut RayHits<4>, *const Arguments);
    rtcIntersect8: fn(*const c_int, Handle, *mut RayHits<8>, *const Arguments);
    rtcOccluded8: fn(*const c_int, Handle, *mut RayHits<8>, *const Arguments);
    rtcIntersect16: fn(*const c_int, Handle, *mut RayHits<16>, *const Arguments);
    rtcOccluded16: fn(*const c_int, Handle, *mut RayHits<16>, *const Arguments);
}

const SCENE_FLAG_ROBUST: c_int = 4;
const BUILD_QUALITY_HIGH: c_int = 2;
const GEOMETRY_TYPE_TRIANGLE: c_int = 0;
const BUFFER_TYPE_INDEX: c_int = 0;
const BUFFER_TYPE_VERTEX: c_int = 1;
const FORMAT_UINT3: c_int = 0x5003;
const FORMAT_FLOAT3: c_int = 0x9003;
const PROPERTY_VERSION_MAJOR: c_int = 1;
const PROPERTY_VERSION_MINOR: c_int = 2;
const PROPERTY_VERSION_PATCH: c_int = 3;
const RAY_QUERY_FLAG_COHERENT: c_int = 1 << 16;
const FEATURE_FLAG_ALL: c_int = -1;
const NO_ID: u32 = u32::MAX;

/// `RTCRayHit`; a ray without hit is its beginning.
#[repr(C, align(64))]
#[derive(Clone, Copy)]
struct RayHit1 {
    origin: [f32; 3],
    t_near: f32,
    direction: [f32; 3],
    time: f32,
    t_far: f32,
    mask: u32,
    id: u32,
    flags: u32,
    normal: [f32; 3],
    u: f32,
    v: f32,
    primitive: u32,
    geometry: u32,
    instance: u32,
    instance_primitive: u32,
}

/// `RTCRayHit4`, `RTCRayHit8`, `RTCRayHit16`.
#[repr(C, align(64))]
#[derive(Clone, Copy)]
struct RayHits<const N: usize> {
    origin: [[f32; N]; 3],
    t_near: [f32; N],
    direction: [[f32; N]; 3],
    time: [f32; N],
    t_far: [f32; N],
    mask: [u32; N],
    id: [u32; N],
    flags: [u32; N],
    normal: [[f32; N]; 3],
    u: [f32; N],
    v: [f32; N],
    primitive: [u32; N],
    geometry: [u32; N],
    instance: [u32; N],
    instance_primitive: [u32; N],
}

/// `RTCIntersectArguments` and `RTCOccludedArguments`, as `rtcInit…Arguments` fills them; longer
/// than in any version 4.
#[repr(C)]
struct Arguments {
    flags: c_int,
    features: c_int,
    rest: [usize; 8],
}

impl Arguments {
    fn new(coherent: bool) -> Self {
        Arguments {
            flags: if coherent { RAY_QUERY_FLAG_COHERENT } else { 0 },
            features: FEATURE_FLAG_ALL,
            rest: [0; 8],
        }
    }
}

/// Numbers too small to be normal are 0 while this lives, as Embree's manual asks for.
struct DenormalsAreZero(#[cfg(target_arch = "x86_64")] u32);

impl DenormalsAreZero {
    #[cfg(target_arch = "x86_64")]
    fn on() -> Self {
        let (mut before, mut now) = (0u32, 0u32);
        // SAFETY: reads the control register of the SSE unit into a local, and writes it back with
        // the bits FTZ and DAZ set. Until it is restored, this thread only moves numbers; Embree
        // alone computes.
        unsafe {
            std::arch::asm!("stmxcsr [{}]", in(reg) &raw mut before, options(nostack));
            let wanted = before | 0x8040;
            std::arch::asm!("ldmxcsr [{}]", in(reg) &raw const wanted, options(nostack));
            std::arch::asm!("stmxcsr [{}]", in(reg) &raw mut now, options(nostack));
        }
        assert_eq!(now & 0x8040, 0x8040, "FTZ and DAZ are set");
        DenormalsAreZero(before)
    }

    #[cfg(not(target_arch = "x86_64"))]
    fn on() -> Self {
        DenormalsAreZero()
    }
}

impl Drop for DenormalsAreZero {
    fn drop(&mut self) {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: writes back what `on` read.
        unsafe {
            std::arch::asm!("ldmxcsr [{}]", in(reg) &raw const self.0, options(nostack));
        }
    }
}

/// A scene of one triangle mesh.
struct Embree {
    functions: &'static Functions,
    device: Handle,
    scene: Handle,
    packet: usize,
    /// What Embree has allocated and not freed. Boxed: Embree has its address.
    allocated: Box<AtomicIsize>,
    /// Read by the scene. The vertices have one more at their end, which Embree may read from.
    _positions: Vec<[f32; 3]>,
    _triangles: Vec<[u32; 3]>,
}

impl Drop for Embree {
    fn drop(&mut self) {
        // SAFETY: both were made by `build` and are released once.
        unsafe {
            (self.functions.rtcReleaseScene)(self.scene);
            (self.functions.rtcReleaseDevice)(self.device);
        }
    }
}

unsafe extern "C" fn count_bytes(sum: *mut c_void, bytes: isize, _post: bool) -> bool {
    // SAFETY: `sum` is the `allocated` of the scene's `Embree`, which lives longer than its device.
    unsafe { &*sum.cast::<AtomicIsize>() }.fetch_add(bytes, Ordering::Relaxed);
    true
}

/// The library, loaded once and never unloaded: its threads may outlive its devices.
fn library() -> Result<&'static (PathBuf, Functions)> {
    static LIBRARY: OnceLock<(PathBuf, Functions)> = OnceLock::new();
    if let Some(library) = LIBRARY.get() {
        return Ok(library);
    }
    let library = find()?;
    Ok(LIBRARY.get_or_init(|| library))
}

/// The library that `SPLITPLANE_EMBREE` names, that of the Python package embreex, or the
/// system's.
fn find() -> Result<(PathBuf, Functions)> {
    let load = |path: &Path| {
        Functions::load(path).with_context(|| format!("{} cannot be used", path.display()))
    };
    if let Some(path) = std::env::var_os("SPLITPLANE_EMBREE") {
        let path = PathBuf::from(path);
        let path = if path.is_dir() {
            in_folder(&path).unwrap_or(path)
        } else {
            path
        };
        return Ok((path.clone(), load(&path)?));
    }
    if let Some(path) = of_python() {
        return Ok((path.clone(), load(&path)?));
    }
    for name in [
        "libembree4.so.4",
        "libembree4.so",
        "libembree4.4.dylib",
        "embree4.dll",
    ] {
        if let Ok(functions) = Functions::load(Path::new(name)) {
            return Ok((name.into(), functions));
        }
    }
    bail!(
        "Embree 4 was not found. `pip install embreex`, install your system's Embree 4, or set \
         SPLITPLANE_EMBREE to the library or its folder; or measure without it, by --contenders"
    )
}

/// Embree's library in a folder, or in one in it.
fn in_folder(folder: &Path) -> Option<PathBuf> {
    let entries = |folder: &Path| {
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        entries.map(|entry| entry.path()).collect::<Vec<_>>()
    };
    let is_embree = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        (name.starts_with("libembree4") || name.starts_with("embree4")) && path.is_file()
    };
    let here = entries(folder);
    let inner = here.iter().filter(|path| path.is_dir());
    let all = inner.flat_map(|path| entries(path)).collect::<Vec<_>>();
    here.iter()
        .chain(&all)
        .find(|path| is_embree(path))
        .cloned()
}

/// The library that comes with the Python package embreex, where there is one.
fn of_python() -> Option<PathBuf> {
    let script = "import importlib.util as u; print(u.find_spec('embreex').origin)";
    let output = Command::new("python3").args(["-c", script]).output().ok()?;
    let origin = PathBuf::from(String::from_utf8(output.stdout).ok()?.trim());
    in_folder(&origin.parent()?.parent()?.join("embreex.libs"))
}

/// The version of the library that would be used, and where it is.
pub fn version() -> Result<String> {
    let (path, functions) = library()?;
    // SAFETY: a device is made, asked and released.
    let [major, minor, patch] = unsafe {
        let device = (functions.rtcNewDevice)(c"threads=1".as_ptr());
        let numbers = [
            PROPERTY_VERSION_MAJOR,
            PROPERTY_VERSION_MINOR,
            PROPERTY_VERSION_PATCH,
        ]
        .map(|property| (functions.rtcGetDeviceProperty)(device, property));
        (functions.rtcReleaseDevice)(device);
        numbers
    };
    Ok(format!("{major}.{minor}.{patch} ({})", path.display()))
}

/// Builds `embree`, `embree-robust-packet8` or the like, with spatial splits ("high quality").
pub fn build(name: &str, geometry: &Geometry<'_>, threads: usize) -> Result<Box<dyn Contender>> {
    let mut rest = name.strip_prefix("embree").unwrap_or_default();
    let robust = rest.starts_with("-robust");
    rest = rest.strip_prefix("-robust").unwrap_or(rest);
    let packet = match rest {
        "" => 1,
        "-packet4" => 4,
        "-packet8" => 8,
        "-packet16" => 16,
        _ => bail!(
            "there is no contender \"{name}\"; there are {}",
            crate::contender::RIVALS
        ),
    };
    let (_, functions) = library()?;
    let config = CString::new(format!("threads={threads}")).unwrap_or_default();
    let mut positions = geometry.mesh.positions().to_vec();
    let vertices = positions.len();
    positions.push([0.0; 3]);
    let triangles = geometry.triangles.clone();
    let allocated = Box::new(AtomicIsize::new(0));
    let f = functions;
    // SAFETY: as the manual says: the buffers are as long as stated, padded, and live as long as
    // the scene; all handles are used once made and released once.
    let (device, scene, error) = unsafe {
        let device = (f.rtcNewDevice)(config.as_ptr());
        if device.is_null() {
            return Err(anyhow!("Embree makes no device on this machine"));
        }
        let sum = std::ptr::from_ref(&*allocated).cast_mut().cast();
        (f.rtcSetDeviceMemoryMonitorFunction)(device, Some(count_bytes), sum);
        let scene = (f.rtcNewScene)(device);
        (f.rtcSetSceneFlags)(scene, if robust { SCENE_FLAG_ROBUST } else { 0 });
        (f.rtcSetSceneBuildQuality)(scene, BUILD_QUALITY_HIGH);
        let mesh = (f.rtcNewGeometry)(device, GEOMETRY_TYPE_TRIANGLE);
        for (kind, format, data, count) in [
            (
                BUFFER_TYPE_VERTEX,
                FORMAT_FLOAT3,
                positions.as_ptr().cast::<c_void>(),
                vertices,
            ),
            (
                BUFFER_TYPE_INDEX,
                FORMAT_UINT3,
                triangles.as_ptr().cast::<c_void>(),
                triangles.len(),
            ),
        ] {
            (f.rtcSetSharedGeometryBuffer)(mesh, kind, 0, format, data, 0, 12, count);
        }
        (f.rtcCommitGeometry)(mesh);
        (f.rtcAttachGeometry)(scene, mesh);
        (f.rtcReleaseGeometry)(mesh);
        (f.rtcCommitScene)(scene);
        (device, scene, (f.rtcGetDeviceError)(device))
    };
    let embree = Embree {
        functions,
        device,
        scene,
        packet,
        allocated,
        _positions: positions,
        _triangles: triangles,
    };
    if error != 0 {
        bail!("Embree could not build the scene: error {error}");
    }
    Ok(Box::new(embree))
}

impl RayHit1 {
    #[inline(always)]
    fn of(ray: &Ray) -> Self {
        RayHit1 {
            origin: ray.origin,
            t_near: ray.t_min,
            direction: ray.direction,
            time: 0.0,
            t_far: ray.t_max,
            mask: u32::MAX,
            id: 0,
            flags: 0,
            normal: [0.0; 3],
            u: 0.0,
            v: 0.0,
            primitive: NO_ID,
            geometry: NO_ID,
            instance: NO_ID,
            instance_primitive: NO_ID,
        }
    }
}

/// The functions for packets of N rays.
type Cast<const N: usize> =
    unsafe extern "C" fn(*const c_int, Handle, *mut RayHits<N>, *const Arguments);

impl Embree {
    /// Answers rays in packets of N; where their number is no multiple of it, the last packet is
    /// not full.
    #[inline(always)]
    fn packets<const N: usize, T>(
        &self,
        cast: Cast<N>,
        coherent: bool,
        rays: &[Ray],
        answers: &mut [T],
        answer: impl Fn(&RayHits<N>, usize) -> T,
    ) {
        let _mode = DenormalsAreZero::on();
        let arguments = Arguments::new(coherent);
        for (rays, answers) in rays.chunks(N).zip(answers.chunks_mut(N)) {
            let ray = |i: usize| &rays[i.min(rays.len() - 1)];
            let valid: [c_int; N] = std::array::from_fn(|i| -c_int::from(i < rays.len()));
            // Embree wants this as aligned as its vectors are long.
            let valid = Aligned(valid);
            let mut packet = RayHits::<N> {
                origin: std::array::from_fn(|axis| std::array::from_fn(|i| ray(i).origin[axis])),
                t_near: std::array::from_fn(|i| ray(i).t_min),
                direction: std::array::from_fn(|axis| {
                    std::array::from_fn(|i| ray(i).direction[axis])
                }),
                time: [0.0; N],
                t_far: std::array::from_fn(|i| ray(i).t_max),
                mask: [u32::MAX; N],
                id: [0; N],
                flags: [0; N],
                normal: [[0.0; N]; 3],
                u: [0.0; N],
                v: [0.0; N],
                primitive: [NO_ID; N],
                geometry: [NO_ID; N],
                instance: [NO_ID; N],
                instance_primitive: [NO_ID; N],
            };
            // SAFETY: the scene is committed, the packet is one of N rays, aligned.
            unsafe {
                cast(
                    valid.0.as_ptr(),
                    self.scene,
                    &raw mut packet,
                    &raw const arguments,
                )
            };
            for (i, into) in answers.iter_mut().enumerate() {
                *into = answer(&packet, i);
            }
        }
    }
}

#[repr(align(64))]
struct Aligned<T>(T);

#[inline(always)]
fn closest_of<const N: usize>(packet: &RayHits<N>, i: usize) -> Option<Hit> {
    (packet.geometry[i] != NO_ID).then(|| Hit {
        t: packet.t_far[i],
        u: packet.u[i],
        v: packet.v[i],
        triangle: packet.primitive[i],
    })
}

/// An occluded ray's end is -∞.
#[inline(always)]
fn any_of<const N: usize>(packet: &RayHits<N>, i: usize) -> bool {
    packet.t_far[i].to_bits() == f32::NEG_INFINITY.to_bits()
}

impl Contender for Embree {
    fn closest(&self, kind: Kind, rays: &[Ray], hits: &mut [Option<Hit>]) {
        let f = self.functions;
        let coherent = kind.coherent();
        match self.packet {
            4 => self.packets(f.rtcIntersect4, coherent, rays, hits, closest_of),
            8 => self.packets(f.rtcIntersect8, coherent, rays, hits, closest_of),
            16 => self.packets(f.rtcIntersect16, coherent, rays, hits, closest_of),
            _ => {
                let _mode = DenormalsAreZero::on();
                let arguments = Arguments::new(coherent);
                each(rays, hits, |ray| {
                    let mut one = RayHit1::of(ray);
                    // SAFETY: the scene is committed, the ray is aligned.
                    unsafe {
                        (f.rtcIntersect1)(self.scene, &raw mut one, &raw const arguments);
                    }
                    (one.geometry != NO_ID).then_some(Hit {
                        t: one.t_far,
                        u: one.u,
                        v: one.v,
                        triangle: one.primitive,
                    })
                });
            }
        }
    }

    fn any(&self, kind: Kind, rays: &[Ray], hits: &mut [bool]) {
        let f = self.functions;
        let coherent = kind.coherent();
        match self.packet {
            4 => self.packets(f.rtcOccluded4, coherent, rays, hits, any_of),
            8 => self.packets(f.rtcOccluded8, coherent, rays, hits, any_of),
            16 => self.packets(f.rtcOccluded16, coherent, rays, hits, any_of),
            _ => {
                let _mode = DenormalsAreZero::on();
                let arguments = Arguments::new(coherent);
                each(rays, hits, |ray| {
                    let mut one = RayHit1::of(ray);
                    // SAFETY: the scene is committed; the ray without hit is the beginning of this.
                    unsafe {
                        (f.rtcOccluded1)(self.scene, &raw mut one, &raw const arguments);
                    }
                    one.t_far.to_bits() == f32::NEG_INFINITY.to_bits()
                });
            }
        }
    }

    fn bytes(&self) -> u64 {
        self.allocated.load(Ordering::Relaxed).max(0) as u64
    }
}
