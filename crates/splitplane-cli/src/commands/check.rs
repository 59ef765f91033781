//! `splitplane check`.

use std::collections::BTreeMap;

use serde_json::json;
use splitplane_render::scene::{Instancing, Note, Scene};

use crate::args::CheckCommand;
use crate::failure::Failure;
use crate::numbers::{count, grouped};
use crate::{print, scene};

pub fn run(command: &CheckCommand) -> Result<(), Failure> {
    // The notes are part of what is printed.
    let scene = scene::load(&command.scene, Instancing::Kept, true)?;
    if command.json {
        print::line(&format!("{:#}", as_json(&scene)))?;
        return Ok(());
    }
    for line in lines(&scene) {
        print::line(&line)?;
    }
    Ok(())
}

fn lines(scene: &Scene) -> Vec<String> {
    let contents = &scene.contents;
    let mut lines = vec![match contents.format.as_str() {
        "" => scene.name.clone(),
        format => format!("{}: {format}", scene.name),
    }];
    let total = scene.triangles();
    let mut triangles = format!("triangles: {}", grouped(total));
    if contents.instances > 0 {
        triangles += &format!(
            ", of which {} in {}; {} without copies",
            grouped(contents.instanced_triangles),
            count(contents.instances, "instance"),
            grouped(contents.unique_triangles)
        );
    }
    let skipped = skipped(scene);
    if skipped > 0 {
        triangles += &format!(
            "; {} without area or with numbers that are not finite",
            grouped(skipped)
        );
    }
    lines.push(triangles);
    let bounds = scene.bounds();
    let point = |p: [f32; 3]| format!("({})", p.map(|c| c.to_string()).join(", "));
    if !bounds.is_empty() {
        lines.push(format!(
            "bounds: {} to {}",
            point(bounds.min),
            point(bounds.max)
        ));
    }
    let film = &scene.film;
    lines.push(format!(
        "picture: {} x {} pixels, {} per pixel",
        film.width,
        film.height,
        count(scene.sampler.samples_per_pixel.into(), "sample")
    ));
    let mut by_group: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    for ((group, kind), number) in &contents.kinds {
        let kind = if kind.is_empty() { "none" } else { kind };
        by_group
            .entry(group)
            .or_default()
            .push(format!("{} {kind}", grouped(*number)));
    }
    for (group, kinds) in by_group {
        lines.push(format!("{group}: {}", kinds.join(", ")));
    }
    if !contents.images.is_empty() {
        lines.push(format!(
            "{} read",
            count(contents.images.len() as u64, "image")
        ));
    }
    let told = |note: &Note| format!("  {}: {}", note.place, note.text);
    for (heading, warning) in [("approximated or missing:", true), ("also:", false)] {
        let notes: Vec<_> = scene
            .notes
            .iter()
            .filter(|note| note.warning == warning)
            .map(told)
            .collect();
        if !notes.is_empty() {
            lines.push(heading.to_owned());
            lines.extend(notes);
        } else if warning {
            lines.push("nothing is approximated or missing".to_owned());
        }
    }
    lines
}

/// Triangles that no ray can hit, those of objects once.
fn skipped(scene: &Scene) -> u64 {
    scene
        .meshes()
        .map(|mesh| mesh.skipped().total() as u64)
        .sum()
}

fn as_json(scene: &Scene) -> serde_json::Value {
    let contents = &scene.contents;
    let mut kinds = serde_json::Map::new();
    for ((group, kind), number) in &contents.kinds {
        let group = kinds.entry(*group).or_insert_with(|| json!({}));
        group[kind] = json!(number);
    }
    let bounds = scene.bounds();
    json!({
        "scene": scene.name,
        "format": contents.format,
        "triangles": scene.triangles(),
        "triangles_unique": contents.unique_triangles,
        "triangles_instanced": contents.instanced_triangles,
        "triangles_skipped": skipped(scene),
        "instances": contents.instances,
        "bounds": { "min": bounds.min, "max": bounds.max },
        "kinds": kinds,
        "images": contents.images,
        "notes": scene.notes.iter().map(|note| json!({
            "place": note.place,
            "text": note.text,
            "warning": note.warning,
        })).collect::<Vec<_>>(),
    })
}
