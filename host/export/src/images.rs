//! Pinhole views of images in files.

use std::path::Path;

use vergence_camera::FileCamera;
use vergence_files::{make_folder, write_png};
use vergence_rig::Rig;

use crate::pinhole::faces;
use crate::recorded::check_size;
use crate::views::{describe, remarks, views};
use crate::{ExportError, Exported, Options, Stop};

/// Writes the views of a pair of images, or of each pair of two folders, as `left/front/NAME.png`.
pub fn export(images: [&Path; 2], rig: Option<Rig>, options: &Options, stop: &Stop) -> Result<Exported, ExportError> {
    let rig = rig.ok_or_else(|| ExportError::NoRig(images[0].to_owned()))?;
    let (mut cameras, unpaired) = FileCamera::open_pair(images[0], images[1])?;
    let views = views(&rig, &faces(options), options)?;
    let mut exported = Exported { warnings: remarks(&rig), ..Exported::default() };
    for file in unpaired {
        let warning = "left out: the other camera has no image of this name, number or time";
        exported.warnings.push(format!("{}: {warning}", file.display()));
    }
    loop {
        stop.check(options)?;
        let Some(taken) = FileCamera::grab_pair(&mut cameras)? else { break };
        for view in &views {
            let image = &taken[view.side.index()];
            check_size(view.side, &image.image, &rig)?;
            let folder = options.out.join(view.side.to_string()).join(view.face.name());
            make_folder(&folder)?;
            write_png(&folder.join(format!("{}.png", image.name)), &view.of(&image.image))?;
        }
        exported.pairs += 1;
    }
    describe(&views, &options.out)?;
    Ok(exported)
}
