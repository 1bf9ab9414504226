//! No module imports, by whatever way round, one that imports it.
//!
//! A module is a file: inline modules belong to the file that they stand in. Module A depends on B when A names
//! something that B defines, be it in a `use`, in a path, in a macro's arguments or in an attribute. A name is
//! followed through `use` and `pub use` to the file that defines it.
//!
//! What does not count:
//! * that a parent declares its children with `mod`, and hands on with `pub use` what it does not name itself;
//! * code under `#[cfg(test)]`, and the body of a `macro_rules!`, which stands where it is expanded;
//! * methods and fields, which need no name of a module, and links in comments;
//! * other crates, between which Cargo allows no cycle.
//!
//! It reads tokens, not types: a local variable of the name of an imported function counts if it is called.

mod module_graph;

use std::path::{Path, PathBuf};

use module_graph::Tree;

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// Returns the root files of the libraries and of programs of more than one file.
fn crates() -> Vec<PathBuf> {
    let mut roots = vec![root().join("src/lib.rs")];
    for (directory, root_file) in [("src/bin", "main.rs"), ("crates", "src/lib.rs")] {
        let entries = std::fs::read_dir(root().join(directory));
        let found = entries.into_iter().flatten().flatten();
        roots.extend(
            found
                .map(|entry| entry.path().join(root_file))
                .filter(|path| path.is_file()),
        );
    }
    roots
}

fn read(path: &Path) -> Option<String> {
    std::fs::read_to_string(path).ok()
}

#[test]
fn no_module_depends_on_itself() {
    let mut cycles = Vec::new();
    let mut count = 0;
    for root in crates() {
        let tree = Tree::of(&root, &read);
        count += tree.0.len();
        cycles.extend(tree.cycles());
    }
    assert!(
        cycles.is_empty(),
        "{} cycles:\n{}",
        cycles.len(),
        cycles.join("\n")
    );
    assert!(count > 100, "only {count} modules were read");
}

#[test]
fn injected_cycle_is_found() {
    let geometry = root().join("src/geometry/rotation.rs");
    let injected = |path: &Path| {
        let text = read(path)?;
        let addition = "const _: fn() = || { let _ = crate::pipeline::Pipeline::reset; };";
        Some(if path == geometry {
            text + addition
        } else {
            text
        })
    };
    let cycles = Tree::of(&root().join("src/lib.rs"), &injected).cycles();
    let found = cycles.iter().any(|cycle| {
        cycle.contains("geometry::rotation -> pipeline (by crate::pipeline::Pipeline::reset)")
    });
    assert!(found, "{cycles:?}");
}

/// Returns the cycles of a crate of these files.
fn cycles_of(files: &[(&str, &str)]) -> Vec<String> {
    let read = |path: &Path| {
        let found = files.iter().find(|(name, _)| Path::new(name) == path);
        found.map(|(_, text)| (*text).to_owned())
    };
    Tree::of(Path::new("lib.rs"), &read).cycles()
}

#[test]
fn parent_that_hands_on_is_no_cycle_and_one_that_names_is() {
    let child = (
        "child.rs",
        "pub struct Item; fn f() -> super::Constant { super::Constant }",
    );
    let handing = "mod child; pub use child::Item; pub struct Constant;";
    assert_eq!(cycles_of(&[("lib.rs", handing), child]), [""; 0]);
    let naming = "mod child; pub use child::Item; pub struct Constant; fn f(_: Item) {}";
    let found = ["crate -> child (by Item), child -> crate (by super::Constant)"];
    assert_eq!(cycles_of(&[("lib.rs", naming), child]), found);
}

#[test]
fn names_are_followed_to_the_file_that_defines_them() {
    let lib = ("lib.rs", "mod a; mod b; pub use a::One; pub use b::*;");
    let a = ("a.rs", "use crate::Two; pub struct One;");
    let apart = ("b.rs", "pub struct Two;");
    assert_eq!(cycles_of(&[lib, a, apart]), [""; 0]);
    let round = ("b.rs", "pub struct Two; fn f(_: crate::One) {}");
    let found = ["a -> b (by crate::Two), b -> a (by crate::One)"];
    assert_eq!(cycles_of(&[lib, a, round]), found);
}

#[test]
fn macros_and_attributes_count_and_tests_do_not() {
    let lib = ("lib.rs", "mod a; mod b;");
    let a = ("a.rs", "use super::b::Two; pub const ONE: u8 = 1;");
    for (round, count) in [
        (
            "pub struct Two; fn f() { println!(\"{}\", crate::a::ONE); }",
            1,
        ),
        ("#[error(\"{}\", super::a::ONE)] pub struct Two;", 1),
        ("pub struct Two; fn f() { use super::{a::ONE as _}; }", 1),
        (
            "pub struct Two; #[cfg(test)] mod tests { use crate::a::ONE; }",
            0,
        ),
        (
            "pub struct Two; #[cfg(test)] pub(crate) use crate::a::{ONE}; fn f() {}",
            0,
        ),
        ("pub struct Two; fn f(x: X) { x.a; other::a::ONE }", 0),
    ] {
        assert_eq!(
            cycles_of(&[lib, a, ("b.rs", round)]).len(),
            count,
            "{round}"
        );
    }
}
