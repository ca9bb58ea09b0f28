//! OpenCV's semi-global matching, run by Python on image files.

use std::path::Path;

use serde_json::json;
use vergence_bench::ask_python;
use vergence_reproduce::{SgbmAnswer, SgbmTask};

use crate::output::write_png;

/// Writes the images of `task` to `folder`, and runs its script in `python`.
///
/// # Errors
/// A sentence that says why there is no answer.
pub fn semi_global_matching(python: &str, folder: &Path, task: &SgbmTask<'_>) -> Result<SgbmAnswer, String> {
    let file = |what: &str| folder.join(format!("{}-{what}.png", task.mode));
    let (left, right, picture) = (file("left"), file("right"), file("sgbm"));
    for (path, image) in [(&left, task.images[0]), (&right, task.images[1])] {
        write_png(path, image).map_err(|failure| failure.to_string())?;
    }
    let mut argument = task.argument.clone();
    for (name, path) in [("left", &left), ("right", &right), ("picture", &picture)] {
        argument[name] = json!(path);
    }
    let figures = ask_python(python, task.script, [argument.to_string()])?;
    let picture = image::open(&picture).map_err(|error| format!("{}: {error}", picture.display()))?.to_rgb8();
    Ok(SgbmAnswer { figures, picture })
}
