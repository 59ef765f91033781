//! The text of a scene: its files, and places in them.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::error::{SceneError, place};

/// A place in a scene's files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Span {
    /// Index into [`Sources`].
    pub(crate) file: u32,
    /// Byte in the file.
    pub(crate) offset: usize,
}

/// A file that was read.
#[derive(Debug)]
pub(crate) struct Source {
    /// The file, as messages name it.
    pub(crate) name: String,
    /// Where it was read from.
    pub(crate) path: PathBuf,
    /// Its bytes.
    pub(crate) text: Arc<[u8]>,
}

/// All files that were read, so that a [`Span`] can be told as file, line and column.
#[derive(Debug, Default)]
pub(crate) struct Sources(Vec<Source>);

impl Sources {
    pub(crate) fn add(&mut self, path: &Path, text: Arc<[u8]>) -> u32 {
        self.0.push(Source {
            name: path.display().to_string(),
            path: path.to_owned(),
            text,
        });
        (self.0.len() - 1) as u32
    }

    pub(crate) fn get(&self, file: u32) -> &Source {
        &self.0[file as usize]
    }

    /// Line and column, both from 1, the column in characters.
    fn line_and_column(&self, span: Span) -> (u32, u32) {
        let text = &self.get(span.file).text;
        let before = &text[..span.offset.min(text.len())];
        let line = before.iter().filter(|&&b| b == b'\n').count() + 1;
        let start = before
            .iter()
            .rposition(|&b| b == b'\n')
            .map_or(0, |i| i + 1);
        let column = String::from_utf8_lossy(&before[start..]).chars().count() + 1;
        (
            u32::try_from(line).unwrap_or(u32::MAX),
            u32::try_from(column).unwrap_or(u32::MAX),
        )
    }

    /// `file:line:column`.
    pub(crate) fn place(&self, span: Span) -> String {
        let (line, column) = self.line_and_column(span);
        place(&self.get(span.file).name, line, column)
    }

    pub(crate) fn error(&self, span: Span, message: impl Into<String>) -> SceneError {
        let (line, column) = self.line_and_column(span);
        SceneError {
            file: self.get(span.file).name.clone(),
            line,
            column,
            message: message.into(),
        }
    }
}
