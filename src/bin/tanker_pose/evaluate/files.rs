//! Where reports are written.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use tanker_pose::evaluation::{Evaluation, FORMAT, FleetReport, Report, fleet_page, page};
use tanker_pose::text_file;

/// Why a report cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    #[error("cannot write {}: {source}", path.display())]
    Unwritable {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("cannot write figures as JSON: {0}")]
    Json(#[from] serde_json::Error),
}

/// The page of a recording.
pub const PAGE: &str = "evaluation.html";
/// The figures of a recording.
const FIGURES: &str = "evaluation.json";
/// Why a recording has no report, in words: written by who distributes recordings over machines.
const FAILURE: &str = "failure.txt";
/// The page of several.
pub const SUMMARY_PAGE: &str = "summary.html";

/// A recording, and where its report goes.
pub struct Job {
    pub recording: PathBuf,
    /// Unique among the recordings of a call.
    pub name: String,
    pub folder: PathBuf,
}

/// Returns what is to be done for each recording.
pub fn folders(recordings: &[PathBuf], output: &Path) -> Vec<Job> {
    let mut taken = BTreeSet::new();
    let mut job = |recording: &PathBuf| {
        let stem = recording.file_stem().unwrap_or_default().to_string_lossy();
        let stem = if stem.is_empty() { "bag".into() } else { stem };
        let mut name = stem.to_string();
        let mut number = 1;
        while !taken.insert(name.clone()) {
            number += 1;
            name = format!("{stem}_{number}");
        }
        let folder = if recordings.len() == 1 {
            output.to_owned()
        } else {
            output.join(&name)
        };
        Job {
            recording: recording.clone(),
            name,
            folder,
        }
    };
    recordings.iter().map(&mut job).collect()
}

/// Writes all files of a report; those that exist are overwritten.
pub fn write(evaluation: &Evaluation, folder: &Path) -> Result<(), WriteError> {
    let json = serde_json::to_string_pretty(&evaluation.report)? + "\n";
    for (name, text) in [
        (PAGE, page(evaluation)),
        (FIGURES, json),
        ("estimate.tum", evaluation.estimate_tum()),
        ("truth.tum", evaluation.truth_tum()),
        (
            "velocity_and_covariance.csv",
            evaluation.velocity_and_covariance_csv(),
        ),
    ] {
        put(&folder.join(name), &text)?;
    }
    Ok(())
}

/// Writes the summary over several recordings, with links to the pages that are beside it.
pub fn write_summary(fleet: &FleetReport, folder: &Path) -> Result<(), WriteError> {
    let json = serde_json::to_string_pretty(fleet)? + "\n";
    put(&folder.join("summary.json"), &json)?;
    let link = |bag: &str| {
        let is_there = folder.join(bag).join(PAGE).is_file();
        is_there.then(|| format!("{}/{PAGE}", encoded(bag)))
    };
    put(&folder.join(SUMMARY_PAGE), &fleet_page(fleet, link))
}

/// Returns a name of a folder as a part of an address.
fn encoded(name: &str) -> String {
    let mut text = String::new();
    for byte in name.bytes() {
        if byte.is_ascii_alphanumeric() || b"-_.~".contains(&byte) {
            text.push(char::from(byte));
        } else {
            let escaped = format!("%{byte:02X}");
            text.push_str(&escaped);
        }
    }
    text
}

/// Returns the reports at these paths: files, and of folders those in them and one level below, by name.
///
/// A folder below with a [`FAILURE`] stands for a recording without a report.
pub fn reports(paths: &[PathBuf]) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for path in paths {
        if !path.is_dir() {
            found.push(path.clone());
            continue;
        }
        let entries = std::fs::read_dir(path).into_iter().flatten().flatten();
        let mut folders: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
        folders.push(path.clone());
        folders.sort_unstable();
        let within = |folder: &PathBuf| {
            let names = [FIGURES, FAILURE].into_iter();
            names
                .map(|name| folder.join(name))
                .find(|file| file.is_file())
        };
        found.extend(folders.iter().filter_map(within));
    }
    found
}

/// Returns the name that a report has among others: that of its folder.
pub fn name_of(path: &Path) -> String {
    let folder = path.parent().and_then(Path::file_name);
    folder.unwrap_or_default().to_string_lossy().into_owned()
}

/// Returns a report that was written before, under the name of its folder.
///
/// # Errors
/// In words; those of a [`FAILURE`] are its text.
pub fn read(path: &Path) -> Result<Report, String> {
    let text = text_file::read(path).map_err(|error| error.to_string())?;
    if path.file_name().is_some_and(|name| name == FAILURE) {
        return Err(text.trim().to_owned());
    }
    let report: Report = serde_json::from_str(&text)
        .map_err(|error| format!("expected the figures of an evaluation: {error}"))?;
    if report.format != FORMAT {
        return Err(format!(
            "expected figures of format {FORMAT}, got {}: evaluate the recording again",
            report.format
        ));
    }
    Ok(Report {
        bag: name_of(path),
        ..report
    })
}

/// Writes a file and the folders above it.
fn put(path: &Path, text: &str) -> Result<(), WriteError> {
    let folder = path.parent().map_or(Ok(()), std::fs::create_dir_all);
    folder
        .and_then(|()| std::fs::write(path, text))
        .map_err(|source| WriteError::Unwritable {
            path: path.to_owned(),
            source,
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn recordings_of_one_name_get_folders_of_their_own() {
        let paths = ["a/flight.mcap", "b/flight.mcap", "flight_2"].map(PathBuf::from);
        let jobs = folders(&paths, Path::new("out"));
        let names: Vec<&str> = jobs.iter().map(|job| job.name.as_str()).collect();
        assert_eq!(names, ["flight", "flight_2", "flight_2_2"]);
        assert!(
            jobs.iter()
                .all(|job| job.folder == Path::new("out").join(&job.name))
        );
        assert_eq!(
            folders(&paths[..1], Path::new("out"))[0].folder,
            Path::new("out")
        );
    }
}
