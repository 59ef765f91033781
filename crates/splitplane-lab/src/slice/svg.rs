//! Pictures of lines and polygons as SVG, kept small: a path per style, relative
//! coordinates in tenths of a pixel.

use std::fmt::Write;

/// A picture with a title above it, a legend and notes below it.
pub(super) struct Picture {
    /// Width in pixels.
    pub(super) width: f64,
    /// Height without the text, in pixels.
    pub(super) height: f64,
    pub(super) title: String,
    pub(super) subtitle: String,
    /// How the picture was made.
    pub(super) description: String,
    pub(super) legend: Vec<Entry>,
    pub(super) notes: Vec<String>,
    /// Bottom to top.
    pub(super) layers: Vec<Layer>,
}

/// A line of the legend.
pub(super) struct Entry {
    pub(super) mark: Mark,
    pub(super) label: String,
}

/// What a line of the legend explains.
pub(super) enum Mark {
    Line { color: &'static str, width: f64 },
    Box { color: &'static str },
}

pub(super) struct Layer {
    pub(super) style: Style,
    pub(super) shape: Shape,
}

/// How a shape is drawn; widths in pixels.
pub(super) enum Style {
    Fill {
        color: &'static str,
    },
    Stroke {
        color: &'static str,
        width: f64,
        opacity: f64,
    },
}

/// Segments or polygons, as data of a path in tenths of a pixel.
#[derive(Default)]
pub(super) struct Shape {
    data: String,
    /// Where the path is.
    at: [i64; 2],
}

impl Shape {
    pub(super) fn is_empty(&self) -> bool {
        self.data.is_empty()
    }

    /// Adds a segment; one that is a point at this precision is not seen.
    pub(super) fn segment(&mut self, from: [f64; 2], to: [f64; 2]) {
        let [from, to] = [from, to].map(tenths);
        if from != to {
            self.go('m', from);
            self.go('l', to);
        }
    }

    /// Adds a polygon; one without area at this precision is not seen.
    pub(super) fn polygon(&mut self, points: &[[f64; 2]]) {
        let mut points: Vec<[i64; 2]> = points.iter().map(|&p| tenths(p)).collect();
        points.dedup();
        if points.first() == points.last() {
            points.pop();
        }
        let next = points.iter().cycle().skip(1);
        let twice_area: i64 = (points.iter().zip(next))
            .map(|(p, q)| p[0] * q[1] - p[1] * q[0])
            .sum();
        if twice_area == 0 {
            return;
        }
        let first = points[0];
        self.go('m', first);
        for &point in &points[1..] {
            self.go('l', point);
        }
        self.data.push('z');
        self.at = first;
    }

    /// Appends a relative command. A first `m` is relative to the origin.
    fn go(&mut self, command: char, to: [i64; 2]) {
        let [x, y] = [to[0] - self.at[0], to[1] - self.at[1]];
        let space = if y < 0 { "" } else { " " };
        // A String takes everything.
        let _ = write!(self.data, "{command}{x}{space}{y}");
        self.at = to;
    }
}

fn tenths(point: [f64; 2]) -> [i64; 2] {
    point.map(|c| (10.0 * c).round() as i64)
}

/// Space around everything, in pixels.
const MARGIN: f64 = 16.0;
const TEXT: &str = "#16181d";
const FAINT_TEXT: &str = "#5b6270";
const TITLE_SIZE: f64 = 17.0;
const TEXT_SIZE: f64 = 13.0;
const LINE_HEIGHT: f64 = 21.0;
const GAP: f64 = 16.0;

/// About how wide a text is; fonts differ.
fn text_width(text: &str) -> f64 {
    0.52 * TEXT_SIZE * text.chars().count() as f64
}

/// The picture as a file.
pub(super) fn write(picture: &Picture) -> String {
    let mut text = String::new();
    let title_width = 1.15 * text_width(&picture.title) * TITLE_SIZE / TEXT_SIZE + GAP;
    let beside = title_width + text_width(&picture.subtitle) <= picture.width;
    let above = if beside { 34.0 } else { 34.0 + LINE_HEIGHT };
    let (rows, legend) = legend(picture);
    let full_width = picture.width + 2.0 * MARGIN;
    let full_height = MARGIN + above + picture.height + 14.0 + LINE_HEIGHT * rows as f64 + 8.0;
    let (subtitle_x, subtitle_y) = match beside {
        true => (MARGIN + title_width, MARGIN + 14.0),
        false => (MARGIN, MARGIN + 14.0 + LINE_HEIGHT),
    };
    let _ = write!(
        text,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{full_width}\" \
         height=\"{full_height}\" viewBox=\"0 0 {full_width} {full_height}\" \
         font-family=\"system-ui, 'Segoe UI', Helvetica, Arial, sans-serif\" \
         font-size=\"{TEXT_SIZE}\">\n\
         <title>{title}</title>\n<desc>{subtitle}. {description}</desc>\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n\
         <text x=\"{MARGIN}\" y=\"{title_y}\" font-size=\"{TITLE_SIZE}\" font-weight=\"600\" \
         fill=\"{TEXT}\">{title}</text>\n\
         <text x=\"{subtitle_x}\" y=\"{subtitle_y}\" fill=\"{FAINT_TEXT}\">{subtitle}</text>\n",
        title = escaped(&picture.title),
        subtitle = escaped(&picture.subtitle),
        description = escaped(&picture.description),
        title_y = MARGIN + 14.0,
    );
    let top = MARGIN + above;
    let _ = write!(
        text,
        "<clipPath id=\"seen\"><rect width=\"{w}\" height=\"{h}\"/></clipPath>\n\
         <g transform=\"translate({MARGIN} {top}) scale(.1)\" clip-path=\"url(#seen)\" \
         fill=\"none\" stroke-linecap=\"round\">\n",
        w = 10.0 * picture.width,
        h = 10.0 * picture.height,
    );
    for layer in &picture.layers {
        let style = match layer.style {
            Style::Fill { color } => format!("fill=\"{color}\""),
            Style::Stroke {
                color,
                width,
                opacity,
            } => format!(
                "stroke=\"{color}\" stroke-width=\"{:.1}\" stroke-opacity=\"{opacity:.2}\"",
                10.0 * width
            ),
        };
        let _ = writeln!(text, "<path {style} d=\"{}\"/>", layer.shape.data);
    }
    let _ = write!(
        text,
        "</g>\n<rect x=\"{MARGIN}\" y=\"{top}\" width=\"{}\" height=\"{}\" fill=\"none\" \
         stroke=\"#d9dde3\"/>\n\
         <g transform=\"translate({MARGIN} {})\" fill=\"{TEXT}\">\n{legend}</g>\n</svg>\n",
        picture.width,
        picture.height,
        top + picture.height + 14.0,
    );
    text
}

/// The legend and the notes, in as many rows as they need.
fn legend(picture: &Picture) -> (usize, String) {
    let mut text = String::new();
    let (mut x, mut row) = (0.0, 0);
    let mut place = |width: f64, new_row: bool| {
        if x > 0.0 && (new_row || x + width > picture.width) {
            x = 0.0;
            row += 1;
        }
        let at = (x, LINE_HEIGHT * f64::from(row) + 0.5 * LINE_HEIGHT);
        x += width + GAP;
        at
    };
    for entry in &picture.legend {
        // The mark's width with the space behind it.
        let indent = match entry.mark {
            Mark::Line { .. } => 29.0,
            Mark::Box { .. } => 20.0,
        };
        let (x, y) = place(indent + text_width(&entry.label), false);
        let _ = match entry.mark {
            Mark::Line { color, width } => writeln!(
                text,
                "<path d=\"M{x:.0} {y}h22\" stroke=\"{color}\" stroke-width=\"{width}\"/>"
            ),
            Mark::Box { color } => writeln!(
                text,
                "<rect x=\"{x:.0}\" y=\"{}\" width=\"14\" height=\"14\" fill=\"{color}\" \
                 stroke=\"#9aa1ad\" stroke-width=\".5\"/>",
                y - 7.0
            ),
        };
        let _ = writeln!(
            text,
            "<text x=\"{:.0}\" y=\"{}\">{}</text>",
            x + indent,
            y + 4.5,
            escaped(&entry.label)
        );
    }
    for (i, note) in picture.notes.iter().enumerate() {
        let (x, y) = place(text_width(note), i == 0);
        let _ = writeln!(
            text,
            "<text x=\"{x:.0}\" y=\"{}\" fill=\"{FAINT_TEXT}\">{}</text>",
            y + 4.5,
            escaped(note)
        );
    }
    (row as usize + 1, text)
}

/// Text as XML has it; what XML cannot hold becomes a question mark.
fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => escaped.push('?'),
            c => escaped.push(c),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_relative_and_in_tenths_of_a_pixel() {
        let mut shape = Shape::default();
        shape.segment([1.0, 2.0], [3.04, 1.0]);
        shape.segment([3.0, 1.0], [3.0, 2.0]);
        shape.segment([5.0, 5.0], [5.01, 5.01]);
        assert_eq!(shape.data, "m10 20l20-10m0 0l0 10");
        let mut shape = Shape::default();
        shape.polygon(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.01]]);
        shape.polygon(&[[1.0, 1.0], [2.0, 1.0], [2.0, 1.01]]);
        shape.polygon(&[[1.0, 1.0], [2.0, 1.0], [2.0, 2.0]]);
        assert_eq!(shape.data, "m0 0l10 0l0 10l-10 0zm10 10l10 0l0 10z");
    }

    #[test]
    fn text_that_xml_would_misread_is_escaped() {
        assert_eq!(
            escaped("a<b> & \"c\"\u{1}"),
            "a&lt;b&gt; &amp; &quot;c&quot;?"
        );
    }
}
