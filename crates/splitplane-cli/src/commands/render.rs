//! `splitplane render`.

use std::path::PathBuf;

use splitplane::{TREES, TreeChoice};
use splitplane_lab::{Preset, RenderTime, build, record, render_with, write_records};
use splitplane_render::output::{write_exr, write_png};
use splitplane_render::scene::Scene;

use crate::args::RenderCommand;
use crate::failure::{Failure, writable_folder, writable_place};
use crate::numbers::{count, grouped, seconds};
use crate::progress::{self, Bar};
use crate::{print, scene};

pub fn run(command: &RenderCommand) -> Result<(), Failure> {
    writable_folder(&command.out.out)?;
    if let Some(json) = &command.json {
        writable_place(json)?;
    }
    let quiet = command.general.quiet;
    let mut settings = command.build.settings(Preset::Default, &command.general);
    let bar = Bar::new(quiet, 1);
    bar.spin(format!("reading {}", command.scene.scene));
    let scene = scene::load(&command.scene, quiet)?;
    command
        .picture
        .apply(&mut settings.render, (scene.film.width, scene.film.height));
    let tree = match command.tree {
        Some(tree) => tree,
        None => tree_of(&scene, quiet)?,
    };
    bar.spin(format!("{tree}: building the tree"));
    let built = build(&scene.mesh, tree, &settings, &bar)?;
    bar.spin(format!("{tree}: rendering"));
    let picture = render_with(&scene, &built, &settings, true, &bar)?;
    progress::clear();

    let path = |extension: &str| -> PathBuf {
        let name = scene::file_name(&scene.name);
        command.out.out.join(format!("{name}.{extension}"))
    };
    write_png(&path("png"), &picture)?;
    write_exr(&path("exr"), &picture)?;
    let record = record(
        &scene,
        &built,
        &settings,
        0,
        &picture,
        RenderTime {
            seconds: picture.seconds,
            counted: true,
            others_load: None,
        },
    );
    if let Some(json) = &command.json {
        write_records(json, std::slice::from_ref(&record))?;
    }
    print::line(&format!(
        "{} with {tree}: {} x {} pixels, {} per pixel, built in {}, rendered in {}",
        scene.name,
        picture.width,
        picture.height,
        count(record.spp.into(), "sample"),
        seconds(record.build_s),
        seconds(record.render_s),
    ))?;
    print::line(&format!(
        "rays: {} camera, {} bounce, {} shadow; {} triangle tests",
        grouped(record.rays.camera),
        grouped(record.rays.bounce),
        grouped(record.rays.shadow),
        grouped(record.triangle_tests.total()),
    ))?;
    print::line(&format!(
        "wrote {} and {}",
        path("png").display(),
        path("exr").display()
    ))?;
    if let Some(json) = &command.json {
        print::line(&format!("wrote {}", json.display()))?;
    }
    Ok(())
}

/// The tree that the scene names, if it is one of ours.
fn tree_of(scene: &Scene, quiet: bool) -> Result<TreeChoice, Failure> {
    if let Some(name) = &scene.accelerator {
        match name.parse() {
            Ok(tree) => return Ok(tree),
            Err(error) if !quiet => print::warning(&format!("{}: {error}", scene.name)),
            Err(_) => {}
        }
    }
    TreeChoice::new(TREES[0].name, None).map_err(Failure::input)
}
