//! Whether the kept networks for matching are whole.

use vergence_board::Finding;
use vergence_models::{ModelStore, intact};

/// Reads every model in `store`, where that could be opened, and compares its files with the digests on record.
#[must_use]
pub fn check_models(store: Result<ModelStore, String>) -> Vec<Finding> {
    const REMEDY: &str = "'vergence models pull' or 'vergence models add' brings it again";
    let store = match store {
        Ok(store) => store,
        Err(why) => return vec![Finding::warn("models", why, "name their folder: VERGENCE_MODELS")],
    };
    let names = match store.names() {
        Ok(names) if names.is_empty() => {
            return vec![Finding::pass("models", "no network is kept; the classical matcher needs none")];
        }
        Ok(names) => names,
        Err(error) => {
            return vec![Finding::fail("models", error.to_string(), "make the folder readable, or name another")];
        }
    };
    let judge = |name: &String| match intact(&store.path(name)) {
        Ok(files) => Finding::pass("models", format!("'{name}' is whole: {files} files with the digests on record")),
        Err(error) => Finding::fail("models", format!("'{name}': {error}"), REMEDY),
    };
    names.iter().map(judge).collect()
}

#[cfg(test)]
mod tests {
    use vergence_board::Verdict;

    use super::*;

    #[test]
    fn a_file_that_was_changed_is_found() {
        let folder = tempfile::tempdir().expect("a folder");
        let store = ModelStore::open(Some(folder.path().into())).expect("a store");
        assert_eq!(check_models(Ok(store.clone()))[0].verdict, Verdict::Pass);
        let manifest = vergence_matching::learned::Manifest::xfeat_lighterglue("one.onnx", "two.onnx");
        let source = tempfile::tempdir().expect("a folder");
        for file in ["one.onnx", "two.onnx"] {
            std::fs::write(source.path().join(file), file).expect("written");
        }
        let name = manifest.name.clone();
        let kept = store.keep(manifest, source.path()).expect("kept");
        let found = check_models(Ok(store.clone()));
        assert!(
            found.len() == 1 && found[0].verdict == Verdict::Pass && found[0].reason.contains("2 files"),
            "{found:?}"
        );
        std::fs::write(kept.join("two.onnx"), "cut").expect("written");
        let found = check_models(Ok(store));
        assert!(found[0].verdict == Verdict::Fail && found[0].reason.contains(&name), "{found:?}");
    }
}
