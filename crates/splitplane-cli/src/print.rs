//! Standard output and standard error. Nothing here panics when nobody reads.

use std::io::{self, IsTerminal, Write};

use comfy_table::{CellAlignment, ContentArrangement, LineStyle, Table, TableStyle};
use miette::{GraphicalReportHandler, GraphicalTheme, Report};

/// A line to standard output.
pub fn line(text: &str) -> io::Result<()> {
    let mut out = io::stdout().lock();
    out.write_all(text.as_bytes())?;
    out.write_all(b"\n")?;
    out.flush()
}

/// A warning to standard error.
pub fn warning(text: &str) {
    to_stderr(&format!("warning: {text}\n"));
}

/// A note to standard error.
pub fn note(text: &str) {
    to_stderr(&format!("note: {text}\n"));
}

/// An error to standard error: one line, and the place in the file where one is known.
pub fn error(report: Report) {
    let mut text = format!("error: {report}\n");
    if report.source_code().is_some() {
        let terminal = io::stderr().is_terminal();
        let theme = match (terminal, std::env::var_os("NO_COLOR")) {
            (true, None) => GraphicalTheme::unicode(),
            (true, Some(_)) => GraphicalTheme::unicode_nocolor(),
            (false, _) => GraphicalTheme::none(),
        };
        let handler = GraphicalReportHandler::new_themed(theme).with_wrap_lines(false);
        let mut picture = String::new();
        // Should the picture of the place fail, the line above says all. Its own first line says
        // the same again.
        if handler.render_report(&mut picture, report.as_ref()).is_ok() {
            let lines = picture
                .lines()
                .skip(1)
                .filter(|line| !line.trim().is_empty());
            text.extend(lines.flat_map(|line| [line, "\n"]));
        }
    }
    to_stderr(&text);
}

fn to_stderr(text: &str) {
    crate::progress::suspend(|| {
        // Standard error is where this would be told.
        let _ = io::stderr().lock().write_all(text.as_bytes());
    });
}

/// A table: the first column to the left, all others to the right.
pub fn table(header: Vec<String>, rows: Vec<Vec<String>>) -> Table {
    let mut table = Table::new();
    table
        .load_style(TableStyle::new().header_separator(LineStyle::none().fill('─').junction('─')))
        .set_content_arrangement(ContentArrangement::Dynamic)
        .set_header(header)
        .add_rows(rows);
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

/// The same in Markdown.
pub fn markdown(header: &[String], rows: &[Vec<String>]) -> String {
    let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
    let mut rule = vec!["--:".to_owned(); header.len()];
    rule[0] = ":--".to_owned();
    let mut text = line(header) + &line(&rule);
    rows.iter().for_each(|row| text += &line(row));
    text.trim_end().to_owned()
}
