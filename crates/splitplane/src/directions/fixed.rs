//! The direction sets of restricted BSP trees [KammajeMora2007].

use super::canonical;

/// `count` directions for the whole tree. 3, 7, 9 and 13 are Klosowski's [Klosowski1998]: the
/// axes, the four diagonals of a cube, the six of its faces, and all of them. Other counts are
/// spread evenly over the hemisphere along a spiral; `axes_first` puts the axes before them.
///
/// **Differs from the paper:** Klosowski counts the two half-spaces of a direction apart.
pub(crate) fn directions(count: usize, axes_first: bool) -> Vec<[f32; 3]> {
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let diagonals = [
        [1.0, 1.0, 1.0],
        [1.0, 1.0, -1.0],
        [1.0, -1.0, 1.0],
        [1.0, -1.0, -1.0],
    ];
    let face_diagonals = [
        [1.0, 1.0, 0.0],
        [1.0, -1.0, 0.0],
        [1.0, 0.0, 1.0],
        [1.0, 0.0, -1.0],
        [0.0, 1.0, 1.0],
        [0.0, 1.0, -1.0],
    ];
    let set: Vec<[f64; 3]> = match count {
        3 => axes.to_vec(),
        7 => [&axes[..], &diagonals].concat(),
        9 => [&axes[..], &face_diagonals].concat(),
        13 => [&axes[..], &diagonals, &face_diagonals].concat(),
        _ if axes_first => axes
            .into_iter()
            .chain(spiral(count.saturating_sub(3)))
            .collect(),
        _ => spiral(count).collect(),
    };
    set.into_iter()
        .map(|d| {
            let length = d.iter().map(|c| c * c).sum::<f64>().sqrt();
            canonical(d.map(|c| (c / length) as f32))
        })
        .collect()
}

/// Points on the hemisphere z > 0 whose heights are evenly spaced and whose azimuths advance by
/// the golden angle.
fn spiral(count: usize) -> impl Iterator<Item = [f64; 3]> {
    // The cosine and sine of the golden angle, π (3 - √5): written out, since sines differ from
    // machine to machine.
    let (cos, sin) = (-0.737_368_878_078_319_7_f64, 0.675_490_294_261_523_8_f64);
    let (mut x, mut y) = (0.6, 0.8);
    (0..count).map(move |i| {
        let z = (i as f64 + 0.5) / count as f64;
        let radius = (1.0 - z * z).sqrt();
        (x, y) = (x * cos - y * sin, x * sin + y * cos);
        [radius * x, radius * y, z]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_have_their_size_and_unit_directions_that_differ() {
        for count in 1..=64 {
            for axes_first in [false, true] {
                if axes_first && count < 3 {
                    continue;
                }
                let set = directions(count, axes_first);
                assert_eq!(set.len(), count);
                for (i, a) in set.iter().enumerate() {
                    assert_eq!(*a, canonical(*a));
                    let length: f32 = a.iter().map(|c| c * c).sum();
                    assert!((length - 1.0).abs() < 1e-6);
                    for b in &set[..i] {
                        let cosine: f32 = a.iter().zip(b).map(|(a, b)| a * b).sum();
                        assert!(cosine.abs() < 0.9999, "{count}: {a:?} and {b:?}");
                    }
                }
                if axes_first {
                    assert_eq!(
                        set[..3],
                        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
                    );
                }
            }
        }
    }
}
