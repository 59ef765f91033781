//! A rendering that is not finished: its picture so far, and what it takes to go on.

use glam::Vec3;
use splitplane::Counts;

use super::film::FilmTile;
use super::integrator::FirstHit;
use super::{LeafSizes, PixelCounters, PixelCounts, RayKinds, Rendered};

/// What a rendering has done so far. Tiles are done in a fixed order, pass by pass; so one that
/// goes on from here ends with the picture and the counters of one that was never interrupted.
#[derive(Clone, Debug, PartialEq)]
pub struct Checkpoint {
    /// Of the scene, the tree and the settings.
    pub(super) fingerprint: u64,
    /// The first sample of the pass at hand, and how many it takes of each pixel.
    pub(super) first_sample: u32,
    pub(super) samples: u32,
    /// Tiles of this pass that are done.
    pub(super) tiles_done: u64,
    pub(super) seconds: f64,
    pub(super) rays: RayKinds<u64>,
    pub(super) counts: RayKinds<Counts>,
    pub(super) tests_by_leaf_size: RayKinds<LeafSizes>,
    /// Sum of weight times radiance and sum of weights of each pixel.
    pub(super) sums: Vec<(Vec3, f32)>,
    pub(super) first_hits: Vec<FirstHits>,
    pub(super) pixel_counts: Option<PixelCounters>,
}

/// An unfinished picture.
#[derive(Debug)]
pub struct Partial {
    /// What is known so far; pixels that are not done are black.
    pub picture: Rendered,
    /// To go on from.
    pub checkpoint: Checkpoint,
}

/// Sums over the samples of a pixel that hit anything.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct FirstHits {
    pub(super) distance: f32,
    pub(super) normal: Vec3,
    pub(super) count: u32,
}

impl FirstHits {
    pub(super) fn add(&mut self, hit: FirstHit) {
        self.distance += hit.distance;
        self.normal += hit.normal;
        self.count += 1;
    }

    pub(super) fn merge(&mut self, other: &FirstHits) {
        self.distance += other.distance;
        self.normal += other.normal;
        self.count += other.count;
    }
}

impl Checkpoint {
    /// Nothing done yet of a film of so many pixels.
    pub(super) fn new(fingerprint: u64, samples: u32, pixels: usize, count: bool) -> Self {
        let none = vec![PixelCounts::default(); if count { pixels } else { 0 }];
        Checkpoint {
            fingerprint,
            first_sample: 0,
            samples,
            tiles_done: 0,
            seconds: 0.0,
            rays: RayKinds::default(),
            counts: RayKinds::default(),
            tests_by_leaf_size: RayKinds::default(),
            sums: vec![],
            first_hits: vec![FirstHits::default(); pixels],
            pixel_counts: count.then(|| PixelCounters {
                closest: none.clone(),
                shadow: none,
            }),
        }
    }

    pub(super) fn film_into(&mut self, film: &mut FilmTile) {
        let sums = std::mem::take(&mut self.sums);
        if !sums.is_empty() {
            film.set_sums(sums);
        }
    }

    /// The checkpoint as the bytes of a file.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        let mut word = |value: u64| bytes.extend(value.to_le_bytes());
        word(self.fingerprint);
        word(self.first_sample.into());
        word(self.samples.into());
        word(self.tiles_done);
        word(self.seconds.to_bits());
        let RayKinds {
            camera,
            bounce,
            shadow,
        } = self.rays;
        [camera, bounce, shadow].into_iter().for_each(&mut word);
        let RayKinds {
            camera,
            bounce,
            shadow,
        } = self.counts;
        for counts in [camera, bounce, shadow] {
            word(counts.triangle_tests);
            word(counts.kd_visits);
            word(counts.oblique_visits);
            word(counts.leaf_visits);
            word(counts.wide_visits);
        }
        let sizes = &self.tests_by_leaf_size;
        for LeafSizes(tests) in [&sizes.camera, &sizes.bounce, &sizes.shadow] {
            word(tests.len() as u64);
            tests.iter().copied().for_each(&mut word);
        }
        word(self.sums.len() as u64);
        word(self.pixel_counts.is_some().into());
        let mut half = |value: u32| bytes.extend(value.to_le_bytes());
        for (sum, weight) in &self.sums {
            let numbers = [sum.x, sum.y, sum.z, *weight];
            numbers.into_iter().for_each(|c| half(c.to_bits()));
        }
        for hits in &self.first_hits {
            let n = hits.normal;
            let numbers = [hits.distance, n.x, n.y, n.z];
            numbers.into_iter().for_each(|c| half(c.to_bits()));
            half(hits.count);
        }
        if let Some(counters) = &self.pixel_counts {
            for counts in counters.closest.iter().chain(&counters.shadow) {
                half(counts.triangle_tests);
                half(counts.kd_visits);
                half(counts.oblique_visits);
                half(counts.leaf_visits);
                half(counts.wide_visits);
            }
        }
        bytes
    }

    /// The checkpoint of a file; `None` where the bytes are none.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let mut rest = bytes.strip_prefix(MAGIC)?;
        let mut word = || -> Option<u64> {
            let (first, after) = rest.split_first_chunk::<8>()?;
            rest = after;
            Some(u64::from_le_bytes(*first))
        };
        let fingerprint = word()?;
        let first_sample = u32::try_from(word()?).ok()?;
        let samples = u32::try_from(word()?).ok()?;
        let tiles_done = word()?;
        let seconds = f64::from_bits(word()?);
        let rays = RayKinds {
            camera: word()?,
            bounce: word()?,
            shadow: word()?,
        };
        let mut counts = || -> Option<Counts> {
            Some(Counts {
                triangle_tests: word()?,
                kd_visits: word()?,
                oblique_visits: word()?,
                leaf_visits: word()?,
                wide_visits: word()?,
            })
        };
        let counts = RayKinds {
            camera: counts()?,
            bounce: counts()?,
            shadow: counts()?,
        };
        // Grows as words come: a length that lies asks for no memory.
        let mut sizes = || -> Option<LeafSizes> {
            let mut tests = Vec::new();
            for _ in 0..word()? {
                tests.push(word()?);
            }
            Some(LeafSizes(tests))
        };
        let tests_by_leaf_size = RayKinds {
            camera: sizes()?,
            bounce: sizes()?,
            shadow: sizes()?,
        };
        let pixels = usize::try_from(word()?).ok()?;
        let counted = word()? == 1;
        let words_a_pixel = 4 + 5 + if counted { 10 } else { 0 };
        if rest.len() != pixels.checked_mul(4 * words_a_pixel)? {
            return None;
        }
        let mut halves = rest
            .chunks_exact(4)
            .map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
        let mut half = || halves.next();
        let mut sums = Vec::with_capacity(pixels);
        for _ in 0..pixels {
            let mut float = || half().map(f32::from_bits);
            sums.push((Vec3::new(float()?, float()?, float()?), float()?));
        }
        let mut first_hits = Vec::with_capacity(pixels);
        for _ in 0..pixels {
            let mut float = || half().map(f32::from_bits);
            let (distance, normal) = (float()?, Vec3::new(float()?, float()?, float()?));
            first_hits.push(FirstHits {
                distance,
                normal,
                count: half()?,
            });
        }
        let mut list = || -> Option<Vec<PixelCounts>> {
            (0..pixels)
                .map(|_| {
                    Some(PixelCounts {
                        triangle_tests: half()?,
                        kd_visits: half()?,
                        oblique_visits: half()?,
                        leaf_visits: half()?,
                        wide_visits: half()?,
                    })
                })
                .collect()
        };
        let pixel_counts = match counted {
            true => Some(PixelCounters {
                closest: list()?,
                shadow: list()?,
            }),
            false => None,
        };
        Some(Checkpoint {
            fingerprint,
            first_sample,
            samples,
            tiles_done,
            seconds,
            rays,
            counts,
            tests_by_leaf_size,
            sums,
            first_hits,
            pixel_counts,
        })
    }
}

const MAGIC: &[u8] = b"splitplane picture 2\n";

/// Of any text, the same on every machine [FNV-1a].
pub(super) fn fingerprint(text: &str) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3)
    })
}
