//! Perlin's noise and its sums [Perlin2002; PBRT3, 10.6].

use glam::Vec3;

/// Perlin's permutation of 0 to 255.
const PERMUTATION: [u8; 256] = [
    151, 160, 137, 91, 90, 15, 131, 13, 201, 95, 96, 53, 194, 233, 7, 225, 140, 36, 103, 30, 69,
    142, 8, 99, 37, 240, 21, 10, 23, 190, 6, 148, 247, 120, 234, 75, 0, 26, 197, 62, 94, 252, 219,
    203, 117, 35, 11, 32, 57, 177, 33, 88, 237, 149, 56, 87, 174, 20, 125, 136, 171, 168, 68, 175,
    74, 165, 71, 134, 139, 48, 27, 166, 77, 146, 158, 231, 83, 111, 229, 122, 60, 211, 133, 230,
    220, 105, 92, 41, 55, 46, 245, 40, 244, 102, 143, 54, 65, 25, 63, 161, 1, 216, 80, 73, 209, 76,
    132, 187, 208, 89, 18, 169, 200, 196, 135, 130, 116, 188, 159, 86, 164, 100, 109, 198, 173,
    186, 3, 64, 52, 217, 226, 250, 124, 123, 5, 202, 38, 147, 118, 126, 255, 82, 85, 212, 207, 206,
    59, 227, 47, 16, 58, 17, 182, 189, 28, 42, 223, 183, 170, 213, 119, 248, 152, 2, 44, 154, 163,
    70, 221, 153, 101, 155, 167, 43, 172, 9, 129, 22, 39, 253, 19, 98, 108, 110, 79, 113, 224, 232,
    178, 185, 112, 104, 218, 246, 97, 228, 251, 34, 242, 193, 238, 210, 144, 12, 191, 179, 162,
    241, 81, 51, 145, 235, 249, 14, 239, 107, 49, 192, 214, 31, 181, 199, 106, 157, 184, 84, 204,
    176, 115, 121, 50, 45, 127, 4, 150, 254, 138, 236, 205, 93, 222, 114, 67, 29, 24, 72, 243, 141,
    128, 195, 78, 66, 215, 61, 156, 180,
];

/// Between about -1 and 1, 0 at places whose coordinates are integers, smooth.
pub(super) fn noise(p: Vec3) -> f32 {
    let cell = p.floor();
    let d = p - cell;
    let corner = [cell.x, cell.y, cell.z].map(|c| (c as i64 & 255) as usize);
    let value = |i: usize, j: usize, k: usize| {
        let hashed = |sum: usize| usize::from(PERMUTATION[sum & 255]);
        let h = hashed(corner[0] + i);
        let h = hashed(h + corner[1] + j);
        let h = hashed(h + corner[2] + k) & 15;
        let d = d - Vec3::new(i as f32, j as f32, k as f32);
        let u = if h < 8 || h == 12 || h == 13 {
            d.x
        } else {
            d.y
        };
        let v = if h < 4 || h == 12 || h == 13 {
            d.y
        } else {
            d.z
        };
        (if h & 1 == 0 { u } else { -u }) + (if h & 2 == 0 { v } else { -v })
    };
    let weight = |t: f32| 6.0 * t.powi(5) - 15.0 * t.powi(4) + 10.0 * t.powi(3);
    let (x, y, z) = (weight(d.x), weight(d.y), weight(d.z));
    let mix = |t: f32, a: f32, b: f32| (1.0 - t) * a + t * b;
    let edge = |j, k| mix(x, value(0, j, k), value(1, j, k));
    mix(
        z,
        mix(y, edge(0, 0), edge(1, 0)),
        mix(y, edge(0, 1), edge(1, 1)),
    )
}

/// How many frequencies a pixel of the picture can tell apart; `d` is how `p` moves from pixel to
/// pixel.
fn visible(d: [Vec3; 2], octaves: u32) -> f32 {
    let square = d[0].length_squared().max(d[1].length_squared());
    (-1.0 - 0.5 * square.log2()).clamp(0.0, octaves as f32)
}

fn smooth_step(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Each frequency over the last: not quite 2, so that the zeros of all do not coincide.
const STEP: f32 = 1.99;

/// Noise of many frequencies.
pub(super) fn fbm(p: Vec3, d: [Vec3; 2], roughness: f32, octaves: u32) -> f32 {
    let n = visible(d, octaves);
    let (mut sum, mut frequency, mut weight) = (0.0, 1.0, 1.0);
    for _ in 0..n as u32 {
        sum += weight * noise(frequency * p);
        frequency *= STEP;
        weight *= roughness;
    }
    sum + weight * smooth_step(0.3, 0.7, n.fract()) * noise(frequency * p)
}

/// Absolute noise of many frequencies; those that cannot be seen count with their mean.
pub(super) fn turbulence(p: Vec3, d: [Vec3; 2], roughness: f32, octaves: u32) -> f32 {
    const MEAN: f32 = 0.2;
    let n = visible(d, octaves);
    let (mut sum, mut frequency, mut weight) = (0.0, 1.0, 1.0);
    for _ in 0..n as u32 {
        sum += weight * noise(frequency * p).abs();
        frequency *= STEP;
        weight *= roughness;
    }
    let part = smooth_step(0.3, 0.7, n.fract());
    sum += weight * ((1.0 - part) * MEAN + part * noise(frequency * p).abs());
    for _ in n as u32..octaves {
        sum += weight * MEAN;
        weight *= roughness;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_a_permutation() {
        let mut seen = [false; 256];
        PERMUTATION
            .iter()
            .for_each(|&p| seen[usize::from(p)] = true);
        assert!(seen.iter().all(|&s| s));
    }

    #[test]
    fn noise_is_zero_at_integers_and_continuous_between() {
        assert_eq!(noise(Vec3::new(3.0, -5.0, 300.0)), 0.0);
        let known = noise(Vec3::new(0.5, 0.5, 0.5));
        assert!((-1.0..=1.0).contains(&known) && known != 0.0, "{known}");
        // Neighbouring cells agree on the face between them.
        let at = |x| noise(Vec3::new(x, 0.3, 0.8));
        assert!((at(2.0f32.next_down()) - at(2.0)).abs() < 1e-5);
    }

    #[test]
    fn wide_footprints_see_no_detail() {
        let p = Vec3::new(0.3, 0.7, 0.1);
        let wide = [Vec3::X * 100.0, Vec3::Y];
        assert_eq!(fbm(p, wide, 0.5, 8), 0.0);
        let expected = 0.2 * (1.0 + (0..8).map(|i| 0.5f32.powi(i)).sum::<f32>());
        assert!((turbulence(p, wide, 0.5, 8) - expected).abs() < 1e-5);
    }
}
