//! Every decoder, given mutants of real inputs: the promises of `fuzz/` hold, and work and memory stay in proportion.
//!
//! The mutants are drawn with a fixed seed, so a failure comes back on the next run; its input is saved too. `fuzz/` has
//! the same targets for libFuzzer.

#[path = "../fuzz/src/lib.rs"]
mod fuzz;
mod mutants;

use std::io::Write as _;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use mutants::Mutator;

const SEED: u64 = 20_260_801;

/// What a decoder may use for an input: a part that every input costs, and one in proportion to its length.
struct Limit {
    /// Mutants of each seed.
    mutants: usize,
    /// Most bytes that are held at a time.
    bytes: u64,
    bytes_per_byte: u64,
    /// Most allocations, which stand for steps: unlike time they are the same on every machine.
    allocations: u64,
    allocations_per_byte: u64,
}

/// Returns the files of a folder in the order of their names.
fn files(folder: &str) -> Vec<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
    let entries = std::fs::read_dir(&path).expect("a folder of seeds");
    let mut found: Vec<PathBuf> = entries
        .map(|entry| entry.expect("a readable folder").path())
        .filter(|path| path.is_file())
        .collect();
    found.sort();
    found
}

fn seeds(places: &[&str]) -> Vec<Vec<u8>> {
    let mut seeds = Vec::new();
    for place in places {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(place);
        let paths = if path.is_dir() {
            files(place)
        } else {
            vec![path]
        };
        for path in paths {
            seeds.push(std::fs::read(path).expect("a seed"));
        }
    }
    seeds
}

/// Runs a target on one input; returns why it fails.
fn failure(target: &str, input: &[u8], limit: &Limit) -> Option<String> {
    let mut result = Ok(());
    let used = allocation_counter::measure(|| {
        result = catch_unwind(AssertUnwindSafe(|| fuzz::run(target, input)));
    });
    if let Err(panic) = result {
        let words = panic.downcast_ref::<String>().map(String::as_str);
        let words = words.or_else(|| panic.downcast_ref::<&str>().copied());
        return Some(words.unwrap_or("a panic").to_owned());
    }
    let length = input.len() as u64;
    let most = limit.bytes + limit.bytes_per_byte * length;
    if used.bytes_max > most {
        let got = used.bytes_max;
        return Some(format!(
            "{got} bytes held for {length}, at most {most} are in proportion"
        ));
    }
    let most = limit.allocations + limit.allocations_per_byte * length;
    if used.count_total > most {
        let got = used.count_total;
        return Some(format!(
            "{got} allocations for {length} bytes, at most {most} are in proportion"
        ));
    }
    None
}

/// Runs a target on all seeds and their mutants.
fn fuzzed(target: &str, places: &[&str], limit: &Limit) {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let seeds = seeds(places);
    assert!(!seeds.is_empty());
    let mutator = Mutator::new(&seeds);
    let (mut executions, mut failures) = (0, Vec::new());
    let mut run = |input: &[u8]| {
        executions += 1;
        let Some(reason) = failure(target, input, limit) else {
            return;
        };
        let name = format!("{target}_{}", failures.len());
        let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
        std::fs::write(&path, input).expect("the folder of the tests is writable");
        failures.push(format!("{}: {reason}", path.display()));
    };
    for seed in &seeds {
        run(seed);
        for _ in 0..limit.mutants {
            run(&mutator.mutant(seed, &mut rng));
        }
    }
    // Past the capture of passing tests: how much was tried belongs to the result.
    let _ = writeln!(
        std::io::stderr(),
        "{target}: {executions} executions of {} seeds",
        seeds.len()
    );
    let shown = failures.len().min(5);
    assert!(
        failures.is_empty(),
        "{} failures\n{}",
        failures.len(),
        failures[..shown].join("\n")
    );
}

/// Memory and allocations of decoders of text and messages.
const TEXT: Limit = Limit {
    mutants: 700,
    bytes: 1 << 21,
    bytes_per_byte: 256,
    allocations: 5_000,
    allocations_per_byte: 32,
};

#[test]
fn messages_of_any_bytes_are_refused_or_keep_their_promises() {
    fuzzed("cdr", &["fuzz/corpus/cdr"], &TEXT);
}

#[test]
fn parameter_files_of_any_bytes_are_refused_or_keep_their_promises() {
    let places = ["config/tanker_pose.yaml", "fuzz/corpus/parameter_file"];
    fuzzed("parameter_file", &places, &TEXT);
}

#[test]
fn marker_maps_of_any_bytes_are_refused_or_keep_their_promises() {
    fuzzed(
        "marker_map",
        &["config/tankers", "fuzz/corpus/marker_map"],
        &TEXT,
    );
}

#[test]
fn camera_files_of_any_bytes_are_refused_or_keep_their_promises() {
    let places = [
        "config/cameras/paper.yaml",
        "tests/harness/fixtures/field/camera_as_ros_writes_it.yaml",
        "tests/harness/fixtures/field/camera_d_as_column.yaml",
        "tests/harness/fixtures/field/camera_two_documents.yaml",
        "tests/harness/fixtures/field/camera_without_model.yaml",
        "tests/harness/fixtures/field/camera_yaml_directive.yaml",
        "fuzz/corpus/camera_file",
    ];
    fuzzed("camera_file", &places, &TEXT);
}

#[test]
fn calibration_budgets_of_any_bytes_are_refused_or_keep_their_promises() {
    let places = [
        "config/cameras/budget_example.yaml",
        "fuzz/corpus/calibration_budget",
    ];
    fuzzed("calibration_budget", &places, &TEXT);
}

#[test]
fn refuelling_setups_of_any_bytes_are_refused_or_keep_their_promises() {
    fuzzed(
        "refuelling_setup",
        &["config/refuelling", "fuzz/corpus/refuelling_setup"],
        &TEXT,
    );
}

#[test]
fn lines_of_solve_of_any_bytes_are_refused_or_keep_their_promises() {
    let places = [
        "tests/harness/fixtures/field/plumb_bob_trailing_zeros.json",
        "tests/harness/fixtures/field/rational_five_coefficients.json",
        "tests/harness/fixtures/field/rational_nearly_cancelling.json",
        "fuzz/corpus/solve_line",
    ];
    fuzzed("solve_line", &places, &TEXT);
}

#[test]
fn arguments_of_any_words_are_refused_or_keep_their_promises() {
    fuzzed("arguments", &["fuzz/corpus/arguments"], &TEXT);
}

/// A chunk may be packed a thousandfold, and readers of zstd and MCAP hold buffers of their own.
const RECORDING: Limit = Limit {
    mutants: 300,
    bytes: 1 << 25,
    bytes_per_byte: 4096,
    allocations: 20_000,
    allocations_per_byte: 64,
};

#[test]
fn recordings_of_any_bytes_are_read_to_their_end_in_bounded_steps() {
    fuzzed("recording", &["fuzz/corpus/recording"], &RECORDING);
}

#[test]
fn recordings_of_any_bytes_are_answered_frame_by_frame() {
    let limit = Limit {
        mutants: 60,
        allocations: 200_000,
        ..RECORDING
    };
    fuzzed("replay", &["fuzz/corpus/recording"], &limit);
}
