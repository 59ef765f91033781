//! `splitplane scenes`.

use comfy_table::CellAlignment;
use splitplane_render::SceneError;
use splitplane_render::scene::library::{SceneEntry, list, search_path};
use splitplane_render::scene::{LoadOptions, load};

use crate::args::ScenesCommand;
use crate::failure::Failure;
use crate::numbers::grouped;
use crate::print;
use crate::progress::{self, Bar};

pub fn run(command: &ScenesCommand) -> Result<(), Failure> {
    let options = LoadOptions {
        search: command.search.scenes.clone(),
        ..LoadOptions::default()
    };
    let entries = list(&search_path(&options.search));
    let bar = Bar::new(false, 1);
    let mut unreadable = Vec::new();
    let rows = entries.iter().map(|entry| {
        let triangles = match entry.triangles {
            Some(triangles) => grouped(triangles as u64),
            None if command.uncounted => "?".to_owned(),
            None => {
                bar.spin(format!("{}: counting its triangles", entry.name));
                counted(entry, &options).unwrap_or_else(|error| {
                    unreadable.push(format!("{}: {error}", entry.name));
                    "unreadable".to_owned()
                })
            }
        };
        let place = match &entry.file {
            Some(file) => file.display().to_string(),
            None => "built in".to_owned(),
        };
        vec![
            entry.name.clone(),
            triangles,
            place,
            entry.description.clone(),
        ]
    });
    let rows: Vec<Vec<String>> = rows.collect();
    progress::clear();
    let header = ["scene", "triangles", "where", "what it is"].map(str::to_owned);
    let mut table = print::table(header.to_vec(), rows);
    for column in [0, 2, 3] {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Left);
        }
    }
    print::line(&table.trim_fmt())?;
    for reason in unreadable {
        print::line(&reason)?;
    }
    Ok(())
}

/// The scene's triangles; a scene that cannot be read does not keep the others from being listed.
fn counted(entry: &SceneEntry, options: &LoadOptions) -> Result<String, SceneError> {
    let Some(file) = &entry.file else {
        return Ok("?".to_owned());
    };
    let scene = load(&file.to_string_lossy(), options)?;
    Ok(grouped(scene.mesh.triangles().len() as u64))
}
