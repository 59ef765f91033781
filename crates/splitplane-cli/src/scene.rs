//! Scenes, as the command line names them.

use std::path::Path;

use miette::{LabeledSpan, NamedSource, Report};
use splitplane::{Layout, Mesh, Progress};
use splitplane_lab::{Built, Settings, build, build_scene, load_tree};
use splitplane_render::SceneError;
use splitplane_render::scene::{Instancing, LoadOptions, Scene, load as load_scene};

use crate::args::{BuildArgs, LoadArgs, SceneArgs, TreeSource};
use crate::failure::Failure;
use crate::print;
use crate::progress::Bar;

/// Reads a scene, and tells what it says of itself.
pub fn load(args: &SceneArgs, instances: Instancing, quiet: bool) -> Result<Scene, Failure> {
    load_with(&args.scene, &args.load, instances, quiet)
}

/// Reads the scene of that name or file, flattened.
pub fn load_named(name: &str, args: &LoadArgs, quiet: bool) -> Result<Scene, Failure> {
    load_with(name, args, Instancing::Flattened, quiet)
}

fn load_with(
    name: &str,
    args: &LoadArgs,
    instances: Instancing,
    quiet: bool,
) -> Result<Scene, Failure> {
    let options = LoadOptions {
        defines: args.definitions.iter().cloned().collect(),
        search: args.search.scenes.clone(),
        subdivision_levels: args.subdivide,
        instances,
    };
    let scene = load_scene(name, &options).map_err(|error| Failure::Input(report(&error)))?;
    if !quiet {
        for note in &scene.notes {
            let text = format!("{}: {}", note.place, note.text);
            if note.warning {
                print::warning(&text);
            } else {
                print::note(&text);
            }
        }
    }
    Ok(scene)
}

/// Builds the trees of a scene, or loads that of its mesh, as [`tree`].
pub fn trees(
    source: &TreeSource,
    scene: &Scene,
    args: &BuildArgs,
    settings: &mut Settings,
    bar: &Bar,
) -> Result<Built, Failure> {
    match source {
        TreeSource::Built(choice) if !scene.instances.is_empty() => {
            bar.spin(format!("{choice}: building the trees"));
            Ok(build_scene(scene, *choice, settings, bar)?)
        }
        _ => tree(source, &scene.mesh, args, settings, bar),
    }
}

/// Builds the tree over a mesh, or loads it; then the settings are those that it was built with.
pub fn tree(
    source: &TreeSource,
    mesh: &Mesh,
    args: &BuildArgs,
    settings: &mut Settings,
    bar: &Bar,
) -> Result<Built, Failure> {
    watched_tree(source, mesh, args, settings, (bar, "", bar))
}

/// As [`tree`], with the bar saying which one of several builds it is, and `progress` told of it.
pub fn watched_tree(
    source: &TreeSource,
    mesh: &Mesh,
    args: &BuildArgs,
    settings: &mut Settings,
    (bar, which, progress): (&Bar, &str, &dyn Progress),
) -> Result<Built, Failure> {
    match source {
        TreeSource::Built(choice) => {
            bar.spin(format!("{choice}: building the tree{which}"));
            Ok(build(mesh, *choice, settings, progress)?)
        }
        TreeSource::Saved(path) => {
            if args.say_how() {
                return Err(Failure::input(format!(
                    "the tree in {} has the parameters that it was built with; leave out --preset, \
                     --ties, --clip, --pricing and --seed",
                    path.display()
                )));
            }
            bar.spin(format!("{}: loading the tree", path.display()));
            Ok(load_tree(path, mesh, settings, |path, mesh| {
                splitplane::Tree::load(path, mesh)
            })?)
        }
    }
}

/// Whether the tree is in the layout that was asked for; a built one is brought there. Nothing
/// leads from the wide one, that a saved tree may be in, to the binary one.
pub fn check_layout(
    source: &TreeSource,
    built: &Built,
    asked: Option<Layout>,
) -> Result<(), Failure> {
    match (asked, built.tree.layout()) {
        (Some(Layout::Binary), Layout::Wide) => Err(Failure::input(format!(
            "{source} is in the wide layout, which has no split planes; save the tree with \
             --layout binary"
        ))),
        _ => Ok(()),
    }
}

/// The error, with the lines of the file that it speaks of where they can be shown.
pub fn report(error: &SceneError) -> Report {
    match place(error) {
        Some((source, at)) => {
            let label = LabeledSpan::new(None, at, 1);
            Report::from(miette::MietteDiagnostic::new(error.to_string()).with_label(label))
                .with_source_code(source)
        }
        None => miette::miette!("{error}"),
    }
}

/// The text of the file that an error speaks of, and where in it, in bytes.
fn place(error: &SceneError) -> Option<(NamedSource<String>, usize)> {
    if error.line == 0 || error.column == 0 {
        return None;
    }
    let path = Path::new(&error.file);
    let size = path.metadata().ok()?;
    // More than anybody writes by hand, and than is worth reading for a few lines.
    if !size.is_file() || size.len() > 16 << 20 {
        return None;
    }
    let text = std::fs::read_to_string(path).ok()?;
    // A terminal would obey them.
    let is_control = |c: char| c.is_control() && !matches!(c, '\n' | '\r' | '\t');
    if text.contains(is_control) {
        return None;
    }
    let line = text.split_inclusive('\n').nth(error.line as usize - 1)?;
    // A line too long for a screen shows nothing.
    if line.len() > 500 {
        return None;
    }
    let line_at = line.as_ptr() as usize - text.as_ptr() as usize;
    let (in_line, _) = line.char_indices().nth(error.column as usize - 1)?;
    Some((
        NamedSource::new(&error.file, text.clone()),
        line_at + in_line,
    ))
}

/// A scene's or tree's name as part of a file's: what a file system or a shell may not like
/// becomes a hyphen.
pub fn file_name(name: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || matches!(c, '.' | '_' | '+' | '-');
    name.chars()
        .map(|c| if plain(c) { c } else { '-' })
        .collect()
}
