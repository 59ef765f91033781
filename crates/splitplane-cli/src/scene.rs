//! Scenes, as the command line names them.

use splitplane_render::scene::Scene;

use crate::args::SceneArgs;
use crate::failure::Failure;

pub fn load(args: &SceneArgs, _quiet: bool) -> Result<Scene, Failure> {
    Err(Failure::input(format!("{}: no loader", args.scene)))
}

/// A scene's or tree's name as part of a file's: what a file system or a shell may not like
/// becomes a hyphen.
pub fn file_name(name: &str) -> String {
    name.chars()
        .map(|c| {
            if c.is_alphanumeric() || matches!(c, '.' | '_' | '+' | '-') {
                c
            } else {
                '-'
            }
        })
        .collect()
}
