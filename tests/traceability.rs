//! Every requirement of `docs/requirements.md` has a test, every test that it names exists, and no number repeats.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// A row of the page.
#[derive(Debug)]
struct Requirement<'a> {
    number: &'a str,
    /// Each `file::name`.
    tests: Vec<&'a str>,
}

fn requirements(page: &str) -> Vec<Requirement<'_>> {
    let row = |line| {
        let mut cells = str::split(line, '|').map(str::trim);
        let number = cells.nth(1)?;
        let tests = cells.nth(1)?;
        number.starts_with("REQ-").then(|| Requirement {
            number,
            tests: tests
                .split(',')
                .map(|test| test.trim().trim_matches('`'))
                .filter(|test| !test.is_empty())
                .collect(),
        })
    };
    page.lines().filter_map(row).collect()
}

/// Returns whether a file of Rust or of Python defines a test of this name.
fn has_test(file: &Path, source: &str, name: &str) -> bool {
    let is_python = file.extension().is_some_and(|extension| extension == "py");
    let keyword = if is_python { "def" } else { "fn" };
    let lines: Vec<&str> = source.lines().map(str::trim).collect();
    let begins = format!("{keyword} {name}(");
    lines.iter().enumerate().any(|(i, line)| {
        if !line.starts_with(&begins) {
            return false;
        }
        // Of Rust the attributes stand before it.
        let attributes = lines.iter().take(i).rev();
        let is_marked = attributes
            .take_while(|line| line.starts_with('#') || line.ends_with(']'))
            .any(|line| line.starts_with("#[test]"));
        is_python && name.starts_with("test_") || is_marked
    })
}

/// Returns what is wrong with a page, given the text of each file that it names.
fn faults_of(page: &str, read: impl Fn(&Path) -> Option<String>) -> Vec<String> {
    let mut faults = Vec::new();
    let mut numbers = BTreeSet::new();
    for Requirement { number, tests } in requirements(page) {
        if !numbers.insert(number) {
            faults.push(format!("{number} repeats"));
        }
        if tests.is_empty() {
            faults.push(format!("{number} has no test"));
        }
        for test in tests {
            let exists = test.split_once("::").is_some_and(|(file, name)| {
                let file = Path::new(file);
                read(file).is_some_and(|source| has_test(file, &source, name))
            });
            if !exists {
                faults.push(format!("{number} names {test}, which does not exist"));
            }
        }
    }
    faults
}

#[test]
fn every_requirement_has_tests_that_exist_and_a_number_of_its_own() {
    let page = std::fs::read_to_string(root().join("docs/requirements.md")).expect("the page");
    let read = |file: &Path| std::fs::read_to_string(root().join(file)).ok();
    assert_eq!(faults_of(&page, read), Vec::<String>::new());
    let rows = page.matches("| REQ-").count();
    assert_eq!(requirements(&page).len(), rows, "each row is read");
    assert!(rows >= 60, "{rows}");
}

#[test]
fn requirements_without_tests_with_unknown_ones_and_twice_are_found() {
    let page = "| REQ-A-01 | x | `a.rs::one`, `b.py::test_two` |\n\
                | REQ-A-01 | x | `a.rs::one` |\n\
                | REQ-A-02 | x | |\n\
                | REQ-A-03 | x | `a.rs::three`, `b.py::helper`, `c.rs::one`, `one` |";
    let read = |file: &Path| match file.to_str() {
        Some("a.rs") => {
            Some("#[test]\n#[ignore = \"x\"]\nfn one() {}\n\nfn three() {}\n".to_owned())
        }
        Some("b.py") => Some("def test_two(\n    x\n): ...\ndef helper(): ...".to_owned()),
        _ => None,
    };
    assert_eq!(
        faults_of(page, read),
        [
            "REQ-A-01 repeats",
            "REQ-A-02 has no test",
            "REQ-A-03 names a.rs::three, which does not exist",
            "REQ-A-03 names b.py::helper, which does not exist",
            "REQ-A-03 names c.rs::one, which does not exist",
            "REQ-A-03 names one, which does not exist",
        ]
    );
}
