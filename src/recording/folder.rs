//! A bag of rosbag2: a folder of files, and metadata.yaml that lists them.

use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::damage::OpenError;
use crate::text_file;

/// The file that describes a bag.
const METADATA: &str = "metadata.yaml";

#[derive(Deserialize)]
struct Metadata {
    rosbag2_bagfile_information: Information,
}

#[derive(Deserialize)]
struct Information {
    #[serde(default)]
    relative_file_paths: Vec<String>,
    #[serde(default)]
    compression_mode: String,
}

/// Returns the files of the recording at this path, in their order: the path itself unless it is a folder.
///
/// # Errors
/// [`OpenError`] when the folder cannot be read, is no bag, or is packed.
pub(super) fn files(path: &Path) -> Result<Vec<PathBuf>, OpenError> {
    let unreadable = |path: &Path| {
        let path = path.to_owned();
        move |source| OpenError::Unreadable { path, source }
    };
    let kind = std::fs::metadata(path).map_err(unreadable(path))?;
    if !kind.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let description = path.join(METADATA);
    if description.is_file() {
        let text = text_file::read(&description).map_err(unreadable(&description))?;
        let metadata: Metadata = crate::yaml::read(&text, &crate::text::path(&description))?;
        let bag = metadata.rosbag2_bagfile_information;
        if !["", "NONE"].contains(&bag.compression_mode.to_uppercase().as_str()) {
            return Err(OpenError::Compressed {
                path: path.to_owned(),
                mode: bag.compression_mode,
            });
        }
        let listed = bag.relative_file_paths;
        if !listed.is_empty() {
            // Older bags list the folder too.
            let within = |file: String| match path.join(&file) {
                found if found.exists() => found,
                missing => Path::new(&file)
                    .file_name()
                    .map_or(missing, |name| path.join(name)),
            };
            return Ok(listed.into_iter().map(within).collect());
        }
    }
    // A recorder that was killed leaves no metadata.
    let mut found: Vec<PathBuf> = std::fs::read_dir(path)
        .map_err(unreadable(path))?
        .filter_map(|entry| entry.ok().map(|entry| entry.path()))
        .filter(|file| {
            file.extension()
                .is_some_and(|end| end == "mcap" || end == "db3")
        })
        .collect();
    found.sort_by_key(|file| natural(file));
    if found.is_empty() {
        return Err(OpenError::Empty(path.to_owned()));
    }
    Ok(found)
}

/// Returns a key by which `bag_10` comes after `bag_9`.
fn natural(path: &Path) -> (usize, String) {
    let name = path
        .file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned();
    (name.len(), name)
}
