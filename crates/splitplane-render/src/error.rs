//! What can be wrong with a scene, and where.

/// Why a scene could not be read: what is wrong, where, and what would be accepted.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}: {message}", place(file, *line, *column))]
pub struct SceneError {
    /// The file, as it was named; a scene's name where no file is at fault.
    pub file: String,
    /// The line, from 1; 0 where the whole file is meant.
    pub line: u32,
    /// The column in characters, from 1; 0 where no column is known.
    pub column: u32,
    /// What is wrong, and what would be accepted.
    pub message: String,
}

impl SceneError {
    /// An error about a file as a whole.
    pub(crate) fn file(file: impl Into<String>, message: impl Into<String>) -> Self {
        SceneError {
            file: file.into(),
            line: 0,
            column: 0,
            message: message.into(),
        }
    }
}

/// `file:line:column`, or less where less is known.
pub(crate) fn place(file: &str, line: u32, column: u32) -> String {
    match (line, column) {
        (0, _) => file.to_owned(),
        (line, 0) => format!("{file}:{line}"),
        (line, column) => format!("{file}:{line}:{column}"),
    }
}
