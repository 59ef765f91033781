//! `splitplane slice`: a picture of splitting.

use splitplane::Layout;
use splitplane_lab::{Preset, Slice, SliceSettings};
use splitplane_render::scene::Instancing;

use crate::args::SliceCommand;
use crate::failure::{Failure, writable_place, writable_places};
use crate::numbers::{bytes, grouped, measured};
use crate::progress::{self, Bar};
use crate::{print, scene};

pub fn run(command: &SliceCommand) -> Result<(), Failure> {
    let read = [command.scene.file()]
        .into_iter()
        .chain(command.tree.file());
    writable_place(&command.out, read)?;
    let quiet = command.general.quiet;
    let mut settings = command.build.settings(Preset::Default, &command.general);
    let bar = Bar::new(quiet, 1);
    bar.spin(format!("reading {}", command.scene.scene));
    let scene = scene::load(&command.scene, Instancing::Flattened, quiet)?;
    writable_places([&command.out], &scene)?;
    let built = scene::tree(
        &command.tree,
        &scene.mesh,
        &command.build,
        &mut settings,
        &bar,
    )?;
    let tree = built.tree.choice();
    scene::check_layout(&command.tree, &built, Some(Layout::Binary))?;
    let slice = SliceSettings {
        axis: command.axis.into(),
        at: command.at,
        max_depth: command.depth,
        zoom: command.zoom,
        width: command.width,
    };
    bar.spin(format!("{tree}: drawing"));
    let slice = Slice::draw(&scene, &built, &settings, &slice);
    slice.write(&command.out)?;
    progress::clear();
    let segments = if tree.spec.frames {
        format!(
            "{} sides of boxes and {} of turned ones",
            grouped(slice.kd_segments),
            grouped(slice.oblique_segments)
        )
    } else if tree.spec.objects {
        format!("{} sides of boxes", grouped(slice.kd_segments))
    } else {
        format!(
            "{} segments of kd planes and {} of oblique ones",
            grouped(slice.kd_segments),
            grouped(slice.oblique_segments)
        )
    };
    print::line(&format!(
        "{} with {tree}: {segments} around {} triangles; a random line in the plane tests {} \
         triangles",
        scene.name,
        grouped(slice.triangles),
        measured(slice.expected_tests),
    ))?;
    print::line(&format!(
        "wrote {} ({})",
        command.out.display(),
        bytes(slice.svg.len() as u64)
    ))?;
    Ok(())
}
