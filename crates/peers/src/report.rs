//! Rows as tables.

use comfy_table::{CellAlignment, LineStyle, Table, TableStyle};

use crate::rays::Kind;
use crate::record::Row;

/// A number in three digits; a dash where there is none.
pub fn number(value: f64) -> String {
    match value {
        v if !v.is_finite() => "–".to_owned(),
        v if v.abs() < 10.0 => format!("{v:.2}"),
        v if v.abs() < 100.0 => format!("{v:.1}"),
        v => format!("{v:.0}"),
    }
}

fn optional(value: Option<f64>) -> String {
    value.map_or("–".to_owned(), number)
}

/// "0", or what is wrong.
fn wrong(row: &Row) -> String {
    let parts = [
        (row.missed, "missed"),
        (row.extra, "extra"),
        (row.elsewhere, "elsewhere"),
        (row.inexact, "inexact"),
    ];
    let list: Vec<String> = parts
        .iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, what)| format!("{count} {what}"))
        .collect();
    if list.is_empty() {
        "0".to_owned()
    } else {
        list.join(", ")
    }
}

/// A scene's rows as a table for the terminal.
pub fn table(rows: &[Row]) -> String {
    let mut table = Table::new();
    table.load_style(TableStyle::new().header_separator(LineStyle::none().fill('─').junction('─')));
    table.set_header([
        "rays",
        "contender",
        "× base",
        "spread",
        "Mray/s",
        "wall",
        "visits",
        "blocks",
        "tests",
        "wrong",
        "B/tri",
        "build s",
    ]);
    let mut last = None;
    for row in rows {
        let set = if last == Some(row.set) {
            ""
        } else {
            row.set.name()
        };
        last = Some(row.set);
        table.add_row([
            set.to_owned(),
            row.contender.clone(),
            number(row.ratio),
            format!("{}–{}", number(row.ratio_min), number(row.ratio_max)),
            number(row.mrays_cpu),
            number(row.mrays_wall),
            optional(row.visits_per_ray),
            optional(row.blocks_per_ray),
            optional(row.tests_per_ray),
            wrong(row),
            number(row.bytes_per_triangle),
            number(row.build_cpu),
        ]);
    }
    for column in table.column_iter_mut().skip(2) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table.to_string()
}

/// What the rows have, each once, in the order in which it comes.
pub fn in_order<T: PartialEq + Clone>(rows: &[Row], of: impl Fn(&Row) -> T) -> Vec<T> {
    rows.iter().fold(Vec::new(), |mut list, row| {
        let item = of(row);
        if !list.contains(&item) {
            list.push(item);
        }
        list
    })
}

/// Not a number where there are none.
pub fn geometric_mean(values: &[f64]) -> f64 {
    (values.iter().map(|value| value.ln()).sum::<f64>() / values.len() as f64).exp()
}

/// All rows as tables of a Markdown page: a summary, then each scene.
pub fn markdown(rows: &[Row]) -> String {
    let scenes = in_order(rows, |row| row.scene.clone());
    let contenders = in_order(rows, |row| row.contender.clone());
    let mut out = String::new();
    out += "### Geometric mean over the scenes\n\n";
    out += "| contender | scenes | primary | AO | bounce | random |\n|---|--:|--:|--:|--:|--:|\n";
    for contender in &contenders {
        let of = |set: Kind| {
            rows.iter()
                .filter(move |r| r.contender == *contender && r.set == set)
        };
        let mean = |set: Kind| {
            number(geometric_mean(
                &of(set).map(|row| row.ratio).collect::<Vec<_>>(),
            ))
        };
        let count = of(Kind::Primary).count();
        let means = Kind::ALL.map(mean).join(" | ");
        out += &format!("| {contender} | {count} | {means} |\n");
    }
    for scene in scenes {
        let of_scene: Vec<&Row> = rows.iter().filter(|row| row.scene == scene).collect();
        out += &format!("\n### {scene}, {} triangles\n\n", of_scene[0].triangles);
        out += "| contender | primary | AO | bounce | random | Mray/s | visits, blocks, tests a ray \
                | wrong | bytes a triangle | build, s |\n";
        out += "|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n";
        for contender in &contenders {
            let row = |set: Kind| {
                let mut found = of_scene.iter();
                found.find(|row| row.contender == *contender && row.set == set)
            };
            let sets = Kind::ALL.map(row);
            let Some(any) = sets.iter().flatten().next() else {
                continue;
            };
            let each = |text: &dyn Fn(&Row) -> String, between: &str| {
                sets.map(|row| row.map_or("–".to_owned(), |row| text(row)))
                    .join(between)
            };
            let ratios = each(
                &|row| {
                    let (low, high) = (number(row.ratio_min), number(row.ratio_max));
                    format!("**{}** ({low}–{high})", number(row.ratio))
                },
                " | ",
            );
            let speeds = each(&|row| number(row.mrays_cpu), " / ");
            let count = |row: &Row| {
                let counts = [row.visits_per_ray, row.blocks_per_ray, row.tests_per_ray];
                counts.map(optional).join(", ")
            };
            let counts = if any.tests_per_ray.is_some() {
                each(&count, " / ")
            } else {
                "–".to_owned()
            };
            let wrong = each(&wrong, " / ");
            out += &format!(
                "| {contender} | {ratios} | {speeds} | {counts} | {} | {} | {} |\n",
                if wrong == "0 / 0 / 0 / 0" {
                    "0"
                } else {
                    &wrong
                },
                number(any.bytes_per_triangle),
                number(any.build_cpu),
            );
        }
    }
    out
}
