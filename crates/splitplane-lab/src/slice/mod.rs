//! Pictures of splitting: the cells of a tree, cut by a plane, as SVG.

mod frame;
mod svg;

use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;

use splitplane::{Axis, Section};
use splitplane_render::scene::Scene;

use crate::numbers::{grouped, measured};
use crate::{Built, LabError, ParamsRecord, Settings, write_whole};
use frame::Frame;
use svg::{Entry, Layer, Mark, Picture, Shape, Style};

/// What a picture of splitting shows.
#[derive(Clone, Debug, PartialEq)]
pub struct SliceSettings {
    /// The axis that the plane of the picture lies across.
    pub axis: Axis,
    /// Where along it, as a fraction of the scene's box, from 0 to 1.
    pub at: f64,
    /// Cells at this depth are not divided further; `None`: down to the leaves.
    pub max_depth: Option<u32>,
    /// The part that is drawn, `[x0, x1, y0, y1]` in fractions from the left and top.
    pub zoom: [f32; 4],
    /// Width of the picture in pixels.
    pub width: u32,
}

/// A picture of splitting, and what is in it.
#[derive(Clone, Debug, PartialEq)]
pub struct Slice {
    /// The picture.
    pub svg: String,
    /// Segments of axis-aligned planes that are drawn; of a bounding volume hierarchy, sides of
    /// boxes.
    pub kd_segments: u64,
    /// Segments of oblique planes that are drawn.
    pub oblique_segments: u64,
    /// Triangles of which a part is drawn.
    pub triangles: u64,
    /// Segments shorter than [`Slice::SHORTEST`] pixels, which are not drawn.
    pub left_out: u64,
    /// Triangle tests of a random line in the plane of the picture; see
    /// [`Section::expected_tests`].
    pub expected_tests: f64,
}

const KD: &str = "#2b6cb0";
const OBLIQUE: &str = "#dd5a13";
const TRIANGLE: &str = "#16181d";
/// The outline of the scene's box.
const BOUNDS: &str = "#9aa1ad";
/// Cells of 1, 2, 3 to 4, 5 to 8, 9 to 16, and more triangles.
const SHADES: [(&str, &str); 6] = [
    ("#f4f0d9", "1"),
    ("#ebe2b4", "2"),
    ("#dfcf8c", "3–4"),
    ("#d0b965", "5–8"),
    ("#b99d45", "9–16"),
    ("#977c2f", "17+"),
];

/// Which of [`SHADES`] a cell has; `None` for an empty one.
fn shade(triangles: u32) -> Option<usize> {
    let doublings = triangles.checked_sub(1)?.checked_ilog2();
    Some(
        doublings
            .map_or(0, |log2| log2 as usize + 1)
            .min(SHADES.len() - 1),
    )
}

/// How the segments of a depth are drawn: the deeper, the finer and the fainter. Oblique ones stay
/// wide enough to be seen beside the triangles that lie in their planes.
fn line(oblique: bool, depth: u32) -> Style {
    let fade = |from: f64, to: f64| to + (from - to) * 0.88_f64.powi(depth.min(1000) as i32);
    let (color, width, opacity) = match oblique {
        true => (OBLIQUE, fade(3.0, 1.2), fade(1.0, 0.8)),
        false => (KD, fade(2.6, 0.35), fade(1.0, 0.6)),
    };
    Style::Stroke {
        color,
        width,
        opacity,
    }
}

impl Slice {
    /// Segments shorter than this, in pixels, are not drawn.
    pub const SHORTEST: f64 = 0.3;

    /// Draws the cells of a tree over the scene. The same input gives the same picture, byte for
    /// byte.
    pub fn draw(scene: &Scene, built: &Built, settings: &Settings, slice: &SliceSettings) -> Slice {
        let bounds = scene.mesh.bounds();
        let [low, high] = [bounds.min, bounds.max].map(|p| f64::from(p[slice.axis.index()]));
        // Between the two, whatever rounding does.
        let offset = (low + (high - low) * slice.at).min(high).max(low);
        let max_depth = slice.max_depth.unwrap_or(u32::MAX);
        let section = built.tree.section(slice.axis, offset, max_depth);
        let up = scene.camera.camera_to_world.vector([0.0, 1.0, 0.0]);
        let frame = Frame::new(&section, slice, up);

        let mut content = Content::default();
        content.add(&section, &frame);
        let objects = built.tree.choice().spec.objects;
        let legend = content.legend(objects);
        let axis = frame::NAMES[slice.axis.index()];
        let subtitle = format!(
            "cut across {axis} at {} of the scene's box ({axis} = {}), {}",
            slice.at,
            measured(offset),
            match slice.max_depth {
                Some(depth) => format!("down to depth {depth}"),
                None => "down to the leaves".to_owned(),
            }
        );
        let expected_tests = section.expected_tests();
        let mut notes = vec![format!(
            "A random line in {} tests {} triangles on average.",
            match slice.zoom == [0.0, 1.0, 0.0, 1.0] {
                true => "this plane",
                false => "this plane, seen or not,",
            },
            measured(expected_tests)
        )];
        if content.left_out > 0 {
            notes.push(format!(
                "Left out: {} segments shorter than {} pixels.",
                grouped(content.left_out),
                Slice::SHORTEST
            ));
        }
        let mut slice = Slice {
            svg: String::new(),
            kd_segments: content.kd_segments,
            oblique_segments: content.oblique_segments,
            triangles: content.triangles,
            left_out: content.left_out,
            expected_tests,
        };
        slice.svg = svg::write(&Picture {
            width: frame.width,
            height: frame.height,
            title: format!("{}, {}", scene.name, built.tree.choice()),
            subtitle,
            description: format!(
                "Splitplane {}: {} parameters, {}, seed {}",
                env!("CARGO_PKG_VERSION"),
                settings.preset,
                ParamsRecord::from(&settings.params).ways(),
                settings.params.seed
            ),
            legend,
            notes,
            layers: content.layers(),
        });
        slice
    }

    /// Writes the picture to a file; it is there whole or not at all.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), LabError> {
        write_whole(path, |file| file.write_all(self.svg.as_bytes())).map_err(|source| {
            LabError::Write {
                path: path.to_owned(),
                source,
            }
        })
    }
}

/// What is drawn.
#[derive(Default)]
struct Content {
    /// Cells by their shade.
    cells: [Shape; SHADES.len()],
    /// Segments by depth, and whether their planes are oblique.
    lines: BTreeMap<(u32, bool), Shape>,
    bounds: Shape,
    outline: Shape,
    kd_segments: u64,
    oblique_segments: u64,
    triangles: u64,
    left_out: u64,
}

impl Content {
    fn add(&mut self, section: &Section, frame: &Frame) {
        let [[x0, y0], [x1, y1]] = section.bounds;
        let corners = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]];
        for i in 0..4 {
            if let Some([from, to]) = frame.segment([corners[i], corners[(i + 1) % 4]]) {
                self.bounds.segment(from, to);
            }
        }
        for cell in &section.cells {
            if let Some(shade) = shade(cell.triangles) {
                self.cells[shade].polygon(&frame.polygon(&cell.polygon));
            }
        }
        for segment in &section.segments {
            let Some([from, to]) = frame.segment([segment.from, segment.to]) else {
                continue;
            };
            if (to[0] - from[0]).hypot(to[1] - from[1]) < Slice::SHORTEST {
                self.left_out += 1;
                continue;
            }
            *(match segment.oblique {
                true => &mut self.oblique_segments,
                false => &mut self.kd_segments,
            }) += 1;
            let key = (segment.depth, segment.oblique);
            self.lines.entry(key).or_default().segment(from, to);
        }
        for &triangle in &section.triangles {
            if let Some([from, to]) = frame.segment(triangle) {
                self.triangles += 1;
                self.outline.segment(from, to);
            }
        }
    }

    fn legend(&self, objects: bool) -> Vec<Entry> {
        let line = |color, width, label: &str, count| Entry {
            mark: Mark::Line { color, width },
            label: format!("{label} ({})", grouped(count)),
        };
        let mut legend = match objects {
            true if self.oblique_segments == 0 => {
                vec![line(KD, 2.0, "sides of boxes", self.kd_segments)]
            }
            true => vec![
                line(KD, 2.0, "sides of boxes", self.kd_segments),
                line(OBLIQUE, 2.0, "of turned boxes", self.oblique_segments),
            ],
            false => vec![
                line(KD, 2.0, "kd planes", self.kd_segments),
                line(OBLIQUE, 2.0, "oblique planes", self.oblique_segments),
            ],
        };
        legend.push(line(TRIANGLE, 1.4, "triangles", self.triangles));
        let used = SHADES
            .iter()
            .zip(&self.cells)
            .filter(|(_, cells)| !cells.is_empty());
        for (i, (&(color, label), _)) in used.enumerate() {
            let cells = if i == 0 { "cells by triangles: " } else { "" };
            legend.push(Entry {
                mark: Mark::Box { color },
                label: format!("{cells}{label}"),
            });
        }
        legend
    }

    /// Bottom to top: cells, planes (the deepest first), the box, triangles.
    fn layers(self) -> Vec<Layer> {
        let cells = (SHADES.iter().zip(self.cells)).map(|(&(color, _), shape)| Layer {
            style: Style::Fill { color },
            shape,
        });
        let lines = (self.lines.into_iter().rev()).map(|((depth, oblique), shape)| Layer {
            style: line(oblique, depth),
            shape,
        });
        let stroke = |color, width, shape| Layer {
            style: Style::Stroke {
                color,
                width,
                opacity: 1.0,
            },
            shape,
        };
        let bounds = stroke(BOUNDS, 1.0, self.bounds);
        let outline = stroke(TRIANGLE, 0.9, self.outline);
        cells
            .chain(lines)
            .chain([bounds, outline])
            .filter(|layer| !layer.shape.is_empty())
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_shaded_by_doublings_of_their_triangles() {
        assert_eq!(
            [0, 1, 2, 3, 4, 5, 8, 9, 16, 17, u32::MAX].map(shade),
            [
                None,
                Some(0),
                Some(1),
                Some(2),
                Some(2),
                Some(3),
                Some(3),
                Some(4),
                Some(4),
                Some(5),
                Some(5),
            ]
        );
    }
}
