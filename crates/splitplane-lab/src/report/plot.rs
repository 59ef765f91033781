//! Plots: what is plotted, as Vega-Lite for the page and as SVG for papers.

use plotters::coord::Shift;
use plotters::prelude::*;
use serde_json::{Value, json};
use splitplane::{TREES, TreeSpec};

/// A plot.
#[derive(Clone, Debug)]
pub(crate) struct Plot {
    /// Its name in names of files and elements.
    pub(crate) key: String,
    pub(crate) title: String,
    /// What is plotted, for where the scene is said already.
    pub(crate) caption: String,
    pub(crate) x: String,
    pub(crate) y: String,
    pub(crate) kind: Kind,
    pub(crate) series: Vec<Series>,
}

#[derive(Clone, Debug)]
pub(crate) enum Kind {
    /// Values over a number.
    Lines,
    /// Values over these names; the x of a point is the place of its name.
    Bars(Vec<String>),
}

#[derive(Clone, Debug)]
pub(crate) struct Series {
    pub(crate) name: String,
    pub(crate) colour: Colour,
    /// Of the thesis; else ours.
    pub(crate) published: bool,
    pub(crate) points: Vec<PlotPoint>,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct PlotPoint {
    pub(crate) x: f64,
    pub(crate) y: f64,
    /// The interval that y lies in.
    pub(crate) low: f64,
    pub(crate) high: f64,
}

/// Red, green and blue.
pub(crate) type Colour = [u8; 3];

/// Three shades for each kind of split directions: without axes, with, and with cheap nodes for
/// them.
const FAMILIES: [[Colour; 3]; 8] = [
    [[165, 165, 165], [145, 145, 145], [125, 125, 125]],
    [[140, 205, 150], [80, 170, 105], [35, 125, 65]],
    [[200, 175, 230], [155, 115, 207], [112, 68, 165]],
    [[150, 195, 240], [79, 150, 220], [35, 100, 175]],
    [[250, 195, 130], [242, 142, 43], [190, 95, 5]],
    [[245, 165, 165], [225, 87, 89], [165, 40, 45]],
    [[155, 220, 215], [79, 176, 170], [30, 125, 120]],
    [[235, 175, 210], [215, 110, 170], [160, 55, 115]],
];

/// The colour of a tree: its hue says where its directions come from, its shade what is done with
/// the axes.
pub(crate) fn colour(spec: &TreeSpec) -> Colour {
    let family = |spec: &TreeSpec| (spec.directions, spec.triangle_planes, spec.objects);
    let mut families = Vec::new();
    for row in TREES {
        if !families.contains(&family(row)) {
            families.push(family(row));
        }
    }
    let at = families
        .iter()
        .position(|f| *f == family(spec))
        .unwrap_or(0);
    let shade = match (spec.axes, spec.axis_nodes) {
        (_, true) => 2,
        (true, false) => 1,
        (false, false) => 0,
    };
    FAMILIES[at % FAMILIES.len()][shade]
}

/// The colour of the `i`th of `n` steps, from violet to yellow-green.
pub(crate) fn step(i: usize, n: usize) -> Colour {
    const STEPS: [Colour; 5] = [
        [100, 60, 150],
        [60, 105, 180],
        [35, 150, 150],
        [75, 175, 90],
        [190, 180, 40],
    ];
    let at = i as f64 / (n.max(2) - 1) as f64 * (STEPS.len() - 1) as f64;
    let low = (at.floor() as usize).min(STEPS.len() - 2);
    let part = at - low as f64;
    std::array::from_fn(|c| {
        (f64::from(STEPS[low][c]) * (1.0 - part) + f64::from(STEPS[low + 1][c]) * part) as u8
    })
}

const OURS: &str = "ours";
const THESIS: &str = "thesis";

fn hex([r, g, b]: Colour) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

fn source(series: &Series) -> &'static str {
    match series.published {
        true => THESIS,
        false => OURS,
    }
}

impl Plot {
    /// The plot for the page.
    pub(crate) fn vega_lite(&self) -> Value {
        let values: Vec<Value> = (self.series.iter())
            .flat_map(|series| {
                series.points.iter().map(move |point| {
                    let x = match &self.kind {
                        Kind::Lines => json!(point.x),
                        Kind::Bars(names) => json!(names.get(point.x as usize)),
                    };
                    json!({
                        "x": x, "y": point.y, "low": point.low, "high": point.high,
                        "tree": series.name, "source": source(series),
                    })
                })
            })
            .collect();
        let mut names: Vec<&str> = Vec::new();
        let mut colours = Vec::new();
        for series in &self.series {
            if !names.contains(&series.name.as_str()) {
                names.push(&series.name);
                colours.push(hex(series.colour));
            }
        }
        let has_intervals = (self.series.iter().flat_map(|series| &series.points))
            .any(|point| point.high > point.low);
        let published = self.series.iter().any(|series| series.published);
        let tooltip = json!([
            { "field": "tree", "title": "tree" },
            { "field": "source", "title": "figure" },
            { "field": "x", "title": self.x },
            { "field": "y", "title": self.y, "format": ",.4~r" },
        ]);
        let y = json!({
            "field": "y", "type": "quantitative", "title": self.y,
            "axis": { "format": ",~r", "titleAnchor": "end" },
        });
        let mut spec = match &self.kind {
            Kind::Lines => json!({
                "encoding": {
                    "x": {
                        "field": "x", "type": "quantitative", "title": self.x,
                        "scale": { "zero": false, "nice": false },
                        "axis": { "tickMinStep": 1, "format": ",~r" },
                    },
                    "y": y,
                    "color": {
                        "field": "tree", "type": "nominal", "title": null,
                        "scale": { "domain": names, "range": colours },
                    },
                },
                "layer": [{
                    "params": [{
                        "name": "pick",
                        "select": { "type": "point", "fields": ["tree"] },
                        "bind": "legend",
                    }],
                    "mark": { "type": "line", "point": { "size": 22 } },
                    "encoding": {
                        "strokeDash": {
                            "field": "source", "type": "nominal", "title": null,
                            "scale": { "domain": [OURS, THESIS], "range": [[1, 0], [4, 4]] },
                            "legend": if published { json!({}) } else { Value::Null },
                        },
                        "opacity": { "condition": { "param": "pick", "value": 1 }, "value": 0.12 },
                        "tooltip": tooltip,
                    },
                }],
            }),
            Kind::Bars(names) => json!({
                "height": names.len() * if published { 24 } else { 18 },
                "encoding": {
                    "y": {
                        "field": "x", "type": "nominal", "title": null, "sort": names,
                        "axis": { "labelLimit": 120 },
                    },
                    "yOffset": { "field": "source", "sort": [OURS, THESIS] },
                    "x": {
                        "field": "y", "type": "quantitative", "title": self.y,
                        "axis": { "format": ",~r" },
                    },
                },
                "layer": [{
                    "mark": { "type": "bar" },
                    "encoding": {
                        "color": {
                            "field": "source", "type": "nominal", "title": null,
                            "scale": {
                                "domain": [OURS, THESIS], "range": ["#4f8fc4", "#b9b2a3"],
                            },
                            "legend": if published { json!({}) } else { Value::Null },
                        },
                        "tooltip": tooltip,
                    },
                }],
            }),
        };
        if has_intervals {
            let (low, high) = match self.kind {
                Kind::Lines => ("y", "y2"),
                Kind::Bars(_) => ("x", "x2"),
            };
            let rule = json!({
                "transform": [{ "filter": "datum.high > datum.low" }],
                "mark": { "type": "rule", "color": "currentColor" },
                "encoding": {
                    low: { "field": "low", "type": "quantitative", "title": self.y },
                    high: { "field": "high" },
                },
            });
            if let Some(layers) = spec["layer"].as_array_mut() {
                layers.push(rule);
            }
        }
        spec["$schema"] = json!("https://vega.github.io/schema/vega-lite/v6.json");
        spec["description"] = json!(self.title);
        spec["width"] = json!("container");
        spec["data"] = json!({ "values": values });
        spec
    }

    /// The plot as SVG, black on white; `None` where there is nothing to plot.
    pub(crate) fn svg(&self) -> Option<String> {
        let points = || self.series.iter().flat_map(|series| &series.points);
        let top = points()
            .map(|p| p.high)
            .filter(|y| y.is_finite())
            .fold(0.0, f64::max);
        let top = if top > 0.0 { 1.06 * top } else { 1.0 };
        let height = match &self.kind {
            Kind::Lines => 400,
            Kind::Bars(names) => 90 + 26 * names.len() as u32,
        };
        let mut text = String::new();
        {
            let area = SVGBackend::with_string(&mut text, (WIDTH, height)).into_drawing_area();
            area.fill(&WHITE).ok()?;
            match &self.kind {
                Kind::Lines => self.draw_lines(&area, top)?,
                Kind::Bars(names) => self.draw_bars(&area, names, top)?,
            }
            area.present().ok()?;
        }
        Some(text)
    }

    fn draw_lines(&self, area: &DrawingArea<SVGBackend<'_>, Shift>, top: f64) -> Option<()> {
        let points = || self.series.iter().flat_map(|series| &series.points);
        let left = points().map(|p| p.x).min_by(f64::total_cmp)?;
        let right = points().map(|p| p.x).max_by(f64::total_cmp)?;
        let right = right.max(left + 1.0);
        let (area, legend) = area.split_horizontally(WIDTH - LEGEND);
        let mut chart = ChartBuilder::on(&area)
            .caption(&self.title, (FONT, 15))
            .margin(10)
            .x_label_area_size(38)
            .y_label_area_size(58)
            .build_cartesian_2d(left..right, 0.0..top)
            .ok()?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .x_desc(&self.x)
            .y_desc(&self.y)
            .x_label_formatter(&|x| tick(*x))
            .y_label_formatter(&|y| tick(*y))
            .label_style((FONT, 12))
            .draw()
            .ok()?;
        let mut row = 0;
        for series in &self.series {
            let [r, g, b] = series.colour;
            let line = series.points.iter().map(|p| (p.x, p.y));
            let style = RGBColor(r, g, b).stroke_width(2);
            match series.published {
                true => {
                    let dashed = DashedLineSeries::new(line, 4, 4, style.stroke_width(1));
                    chart.draw_series(dashed).ok()?;
                }
                false => {
                    chart.draw_series(LineSeries::new(line, style)).ok()?;
                    let dot =
                        |p: &PlotPoint| Circle::new((p.x, p.y), 2, RGBColor(r, g, b).filled());
                    chart.draw_series(series.points.iter().map(dot)).ok()?;
                    let interval = |p: &PlotPoint| {
                        PathElement::new(vec![(p.x, p.low), (p.x, p.high)], RGBColor(r, g, b))
                    };
                    let wide = series.points.iter().filter(|p| p.high > p.low);
                    chart.draw_series(wide.map(interval)).ok()?;
                    let y = 44 + 18 * row;
                    let key = PathElement::new(vec![(4, y), (24, y)], style);
                    legend.draw(&key).ok()?;
                    let name = Text::new(series.name.clone(), (30, y - 6), (FONT, 12));
                    legend.draw(&name).ok()?;
                    row += 1;
                }
            }
        }
        if self.series.iter().any(|series| series.published) {
            let name = Text::new("dashed: the thesis", (4, 44 + 18 * row), (FONT, 12));
            legend.draw(&name).ok()?;
        }
        Some(())
    }

    fn draw_bars(
        &self,
        area: &DrawingArea<SVGBackend<'_>, Shift>,
        names: &[String],
        top: f64,
    ) -> Option<()> {
        let rows = names.len() as f64;
        let mut chart = ChartBuilder::on(area)
            .caption(&self.title, (FONT, 15))
            .margin(10)
            .margin_right(24)
            .x_label_area_size(38)
            .y_label_area_size(110)
            .build_cartesian_2d(0.0..top, rows..0.0)
            .ok()?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .disable_y_mesh()
            .y_labels(0)
            .x_desc(&self.y)
            .x_label_formatter(&|x| tick(*x))
            .label_style((FONT, 12))
            .draw()
            .ok()?;
        let both = self.series.iter().any(|series| series.published);
        for series in &self.series {
            let (from, to) = match (both, series.published) {
                (false, _) => (0.15, 0.85),
                (true, false) => (0.1, 0.5),
                (true, true) => (0.5, 0.9),
            };
            let [r, g, b] = match series.published {
                true => [185, 178, 163],
                false => [79, 143, 196],
            };
            let bar = |p: &PlotPoint| {
                let corners = [(0.0, p.x + from), (p.y, p.x + to)];
                Rectangle::new(corners, RGBColor(r, g, b).filled())
            };
            chart.draw_series(series.points.iter().map(bar)).ok()?;
            let interval = |p: &PlotPoint| {
                let y = p.x + 0.5 * (from + to);
                PathElement::new(vec![(p.low, y), (p.high, y)], BLACK)
            };
            let wide = series.points.iter().filter(|p| p.high > p.low);
            chart.draw_series(wide.map(interval)).ok()?;
        }
        for (i, name) in names.iter().enumerate() {
            let (x, y) = chart.backend_coord(&(0.0, i as f64 + 0.5));
            let style = (FONT, 12).into_text_style(area);
            let pos = plotters::style::text_anchor::Pos::new(
                plotters::style::text_anchor::HPos::Right,
                plotters::style::text_anchor::VPos::Center,
            );
            area.draw_text(name, &style.pos(pos), (x - 8, y)).ok()?;
        }
        if both {
            let style = (FONT, 12).into_text_style(area);
            area.draw_text("blue: ours, grey: the thesis", &style, (12, 12))
                .ok()?;
        }
        Some(())
    }
}

const WIDTH: u32 = 760;
/// The width of the legend beside lines.
const LEGEND: u32 = 150;
const FONT: &str = "sans-serif";

fn tick(value: f64) -> String {
    if value.fract() == 0.0 || value.abs() >= 1000.0 {
        let sign = if value < 0.0 { "-" } else { "" };
        format!(
            "{sign}{}",
            crate::numbers::grouped(value.abs().round() as u64)
        )
    } else {
        let text = format!("{value:.3}");
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    }
}
