//! Any quantity per pixel, as colours with a bar that explains them.

use std::path::Path;

use colorgrad::Gradient;

use super::font::{self, CELL};
use super::{OutputError, check_size, write_rgb};

const INK: [u8; 3] = [230; 3];
const PAPER: [u8; 3] = [24; 3];
/// Of values that are not finite.
const NO_VALUE: [u8; 3] = [96; 3];
/// Around the writing, in dots of the font.
const MARGIN: usize = 4;

/// Writes `values` (row by row from the top) in false colour as a PNG, above a bar that shows what
/// the colours mean. Colours run from 0 to `scale_max`, or to the largest finite value where that
/// is `None`; larger values get the last colour, what is not finite is grey. Returns the end of the
/// scale, for other pictures to share it.
///
/// # Errors
/// `values` are not `width * height`, or the file cannot be written.
pub fn write_false_colour(
    path: &Path,
    values: &[f32],
    (width, height): (u32, u32),
    scale_max: Option<f32>,
    label: &str,
) -> Result<f32, OutputError> {
    check_size(values.len(), width, height)?;
    let largest = values
        .iter()
        .copied()
        .filter(|v| v.is_finite())
        .fold(0.0, f32::max);
    let end = scale_max.unwrap_or(largest);
    let colours = false_colours();
    let colour = |value: f32| {
        if !value.is_finite() {
            return NO_VALUE;
        }
        let part = if end > 0.0 { value / end } else { 0.0 };
        colours[(part * 256.0).clamp(0.0, 255.0) as usize]
    };

    let label: String = label.chars().take(60).collect();
    let (low, middle, high) = ("0", number(end / 2.0), number(end));
    let high = if largest > end {
        format!("{high} (most: {})", number(largest))
    } else {
        high
    };
    let writing = font::width(&label).max(font::width(&format!("{low}   {middle}   {high}")));
    // Letters grow with the picture; a narrow picture gets a canvas that holds the writing.
    let width_of_dot = width as usize / (writing + MARGIN * 2);
    let size = width_of_dot.min(width as usize / 250).clamp(2, 12);
    let margin = MARGIN * size;
    let canvas_width = (width as usize).max(writing * size + 2 * margin);
    let line = (CELL.1 + 3) * size;
    let bar = 6 * size;
    let canvas_height = height as usize + 2 * margin + 2 * line + bar;
    let mut canvas = Canvas {
        width: canvas_width,
        bytes: PAPER.repeat(canvas_width * canvas_height),
    };

    let left = (canvas_width - width as usize) / 2;
    for (row, values) in values.chunks(width.max(1) as usize).enumerate() {
        for (column, &value) in values.iter().enumerate() {
            canvas.set(left + column, row, colour(value));
        }
    }
    let mut top = height as usize + margin;
    let (start, length) = (margin, canvas_width - 2 * margin);
    canvas.write(&label, start, top, size);
    top += line;
    for x in 0..length {
        let colour = colours[x * 256 / length];
        (top..top + bar).for_each(|y| canvas.set(start + x, y, colour));
    }
    top += bar + 3 * size;
    canvas.write(low, start, top, size);
    let half = font::width(&middle) * size / 2;
    canvas.write(
        &middle,
        start + length / 2 - half.min(length / 2),
        top,
        size,
    );
    let end_width = font::width(&high) * size;
    canvas.write(&high, start + length - end_width.min(length), top, size);

    write_rgb(
        path,
        &canvas.bytes,
        canvas_width as u32,
        canvas_height as u32,
    )?;
    Ok(end)
}

/// The 256 colours of a false-colour picture, in sRGB, from 0 to the end of its scale. Inferno: even
/// steps look even, and grey copies keep the order.
pub fn false_colours() -> [[u8; 3]; 256] {
    let gradient = colorgrad::preset::inferno();
    std::array::from_fn(|i| {
        let [r, g, b, _] = gradient.at(i as f32 / 255.0).to_rgba8();
        [r, g, b]
    })
}

/// At most four digits behind the point, but all before it.
fn number(value: f32) -> String {
    if value == value.round() || value >= 1000.0 {
        format!("{value:.0}")
    } else {
        let before = if value >= 1.0 {
            value.log10() as usize + 1
        } else {
            0
        };
        let text = format!("{value:.*}", 4 - before.min(3));
        text.trim_end_matches('0').trim_end_matches('.').to_string()
    }
}

struct Canvas {
    width: usize,
    bytes: Vec<u8>,
}

impl Canvas {
    fn set(&mut self, x: usize, y: usize, colour: [u8; 3]) {
        let start = 3 * (y * self.width + x);
        if x < self.width
            && let Some(pixel) = self.bytes.get_mut(start..start + 3)
        {
            pixel.copy_from_slice(&colour);
        }
    }

    /// `size`: edge of a dot of the letters, in pixels.
    fn write(&mut self, text: &str, left: usize, top: usize, size: usize) {
        font::dots(text, |x, y| {
            for i in 0..size * size {
                self.set(left + x * size + i % size, top + y * size + i / size, INK);
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        let texts = [0.0, 7.0, 0.5, 2.5, 123.456, 1234.5, 8e6, 0.12345].map(number);
        assert_eq!(
            texts,
            ["0", "7", "0.5", "2.5", "123.5", "1234", "8000000", "0.1235"]
        );
    }
}
