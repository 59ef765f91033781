//! `splitplane render`.

use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use splitplane::{TREES, TreeChoice};
use splitplane_lab::{LabError, Layouts, Preset, RenderTime, record, write_records};
use splitplane_render::output::{write_bytes, write_exr, write_png};
use splitplane_render::render::{Checkpoint, Partial, Progress, RenderError, render_from};
use splitplane_render::scene::{Instancing, Scene};

use crate::args::{RenderCommand, TreeSource, layout};
use crate::failure::{Failure, writable_folder, writable_place, writable_places};
use crate::numbers::{count, grouped, seconds};
use crate::progress::{self, Bar};
use crate::{print, scene};

pub fn run(command: &RenderCommand) -> Result<(), Failure> {
    writable_folder(&command.out.out)?;
    if let Some(json) = &command.json {
        let tree = command.tree.as_ref().and_then(TreeSource::file);
        writable_place(json, tree.into_iter().chain([command.scene.file()]))?;
    }
    let quiet = command.general.quiet;
    let mut settings = command.build.settings(Preset::Default, &command.general);
    settings.layouts = Layouts::both(layout(command.layout, settings.traversal));
    let bar = Bar::new(quiet, 1);
    bar.spin(format!("reading {}", command.scene.scene));
    let instances = match command.tree {
        // A saved tree is that of one mesh.
        Some(TreeSource::Saved(_)) => Instancing::Flattened,
        _ => command.instances.how(),
    };
    let scene = scene::load(&command.scene, instances, quiet)?;
    let path = |extension: &str| -> PathBuf {
        let name = scene::file_name(&scene.name);
        command.out.out.join(format!("{name}.{extension}"))
    };
    let [png, exr, unfinished] = ["png", "exr", "unfinished"].map(path);
    writable_places(
        [&png, &exr, &unfinished].into_iter().chain(&command.json),
        &scene,
    )?;
    command
        .picture
        .apply(&mut settings.render, (scene.film.width, scene.film.height));
    let source = match &command.tree {
        Some(tree) => tree.clone(),
        None => TreeSource::Built(tree_of(&scene, quiet)?),
    };
    let built = scene::trees(&source, &scene, &command.build, &mut settings, &bar)?;
    scene::check_layout(&source, &built, command.layout)?;
    let tree = built.tree.choice();
    let made = match source {
        TreeSource::Built(_) => "built",
        TreeSource::Saved(_) => "loaded",
    };
    bar.spin(format!("{tree}: rendering"));
    settings.render.time = command.time;
    settings.render.count = true;
    let from = match command.resume {
        true => checkpoint(&unfinished, quiet)?,
        false => None,
    };
    let writing = Writing {
        bar: &bar,
        places: [png.clone(), exr.clone(), unfinished.clone()],
        last: Mutex::new(Instant::now()),
    };
    let trees = built.in_layout(settings.layouts.counted);
    let picture = render_from(&scene, trees, &settings.render, from, &writing).map_err(
        |error| match error {
            RenderError::OtherCheckpoint => {
                Failure::input(format!("{}: {error}", unfinished.display()))
            }
            error => LabError::from(error).into(),
        },
    )?;
    progress::clear();

    write_png(&png, &picture)?;
    write_exr(&exr, &picture)?;
    // Nothing to go on from is left; where there never was, nothing is removed.
    let _ = std::fs::remove_file(&unfinished);
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
        "{} with {tree}: {} x {} pixels, {} per pixel, {made} in {}, rendered in {}",
        scene.name,
        picture.width,
        picture.height,
        count(record.spp.into(), "sample"),
        seconds(record.build_s),
        seconds(record.render_s),
    ))?;
    print::line(&format!(
        "rays: {} camera, {} bounce, {} shadow; {} triangle tests in the {} layout",
        grouped(record.rays.camera),
        grouped(record.rays.bounce),
        grouped(record.rays.shadow),
        grouped(record.triangle_tests.total()),
        record.counts_layout,
    ))?;
    print::line(&format!("wrote {} and {}", png.display(), exr.display()))?;
    if let Some(json) = &command.json {
        print::line(&format!("wrote {}", json.display()))?;
    }
    Ok(())
}

/// The unfinished picture of an earlier run; `None`, with a word about it, where there is none.
fn checkpoint(path: &Path, quiet: bool) -> Result<Option<Checkpoint>, Failure> {
    let bytes = match std::fs::read(path) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            if !quiet {
                print::note(&format!(
                    "there is no {}; the picture begins anew",
                    path.display()
                ));
            }
            return Ok(None);
        }
        Err(error) => {
            return Err(Failure::input(format!(
                "cannot read {}: {error}",
                path.display()
            )));
        }
    };
    match Checkpoint::from_bytes(&bytes) {
        Some(checkpoint) => Ok(Some(checkpoint)),
        None => Err(Failure::input(format!(
            "{} is not an unfinished picture, or one that was cut short; remove it to begin anew",
            path.display()
        ))),
    }
}

/// Writes the picture every ten seconds while it is rendered.
struct Writing<'b> {
    bar: &'b Bar,
    /// PNG, EXR, and what a later run goes on from.
    places: [PathBuf; 3],
    last: Mutex<Instant>,
}

impl Writing<'_> {
    const EVERY: Duration = Duration::from_secs(10);

    fn last(&self) -> std::sync::MutexGuard<'_, Instant> {
        self.last
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}

impl splitplane::Progress for Writing<'_> {
    fn advanced(&self, done: u64, total: u64) {
        self.bar.advanced(done, total);
    }
}

impl Progress for Writing<'_> {
    fn wants_partial(&self) -> bool {
        self.last().elapsed() >= Self::EVERY
    }

    fn partial(&self, partial: &Partial) {
        let [png, exr, unfinished] = &self.places;
        let written = write_png(png, &partial.picture)
            .and_then(|()| write_exr(exr, &partial.picture))
            .and_then(|()| write_bytes(unfinished, &partial.checkpoint.to_bytes()));
        match written {
            Ok(()) => progress::advise(format!(
                "{} is what there was a moment ago; --resume goes on from it",
                png.display()
            )),
            Err(error) => print::warning(&error.to_string()),
        }
        *self.last() = Instant::now();
    }
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
