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

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::path::{Path, PathBuf};

use proc_macro2::{Delimiter, TokenStream, TokenTree};

type Segments = Vec<String>;

/// What one file says of others.
#[derive(Default)]
struct File {
    /// The files below it, by the names of their modules.
    children: BTreeSet<String>,
    /// What a name that is imported here stands for.
    imports: BTreeMap<String, Segments>,
    /// Imports of all that a module has.
    globs: Vec<Segments>,
    /// What is named: private imports, and paths in code.
    named: BTreeSet<Segments>,
    /// What is handed on.
    handed_on: BTreeSet<Segments>,
    defines: BTreeSet<String>,
}

/// The files of a crate, by the path of their module: empty for the root.
struct Tree(BTreeMap<Segments, File>);

/// Where something is defined.
#[derive(Debug, PartialEq)]
enum Found {
    /// In the file of this module.
    In(Segments),
    /// In no file of the crate.
    Outside,
    /// Not known by the module that was asked.
    Unknown,
}

fn parent(module: &[String]) -> &[String] {
    module.split_last().map_or(&[], |(_, parent)| parent)
}

// ---- reading -----------------------------------------------------------------------------------

fn ident(token: Option<&TokenTree>) -> Option<String> {
    match token {
        Some(TokenTree::Ident(ident)) => Some(ident.to_string()),
        _ => None,
    }
}

fn is_punct(token: Option<&TokenTree>, wanted: char) -> bool {
    matches!(token, Some(TokenTree::Punct(punct)) if punct.as_char() == wanted)
}

fn is_path_separator(tokens: &[TokenTree], at: usize) -> bool {
    is_punct(tokens.get(at), ':') && is_punct(tokens.get(at + 1), ':')
}

fn group(token: Option<&TokenTree>, delimiter: Delimiter) -> Option<Vec<TokenTree>> {
    match token {
        Some(TokenTree::Group(group)) if group.delimiter() == delimiter => {
            Some(group.stream().into_iter().collect())
        }
        _ => None,
    }
}

impl File {
    fn read(text: &str) -> Self {
        let tokens: TokenStream = text.parse().expect("Rust that compiles");
        let mut file = Self::default();
        file.take(&tokens.into_iter().collect::<Vec<_>>());
        file
    }

    fn take(&mut self, tokens: &[TokenTree]) {
        let mut at = 0;
        let mut is_public = false;
        while at < tokens.len() {
            if is_punct(tokens.get(at), '#')
                && let Some(attribute) = group(tokens.get(at + 1), Delimiter::Bracket)
            {
                at += 2;
                if is_cfg_test(&attribute) {
                    at = end_of_item(tokens, at);
                } else {
                    self.take(&attribute);
                }
                continue;
            }
            match ident(tokens.get(at)).as_deref() {
                Some("pub") => {
                    is_public = true;
                    at += 1;
                    if group(tokens.get(at), Delimiter::Parenthesis).is_some() {
                        at += 1;
                    }
                    continue;
                }
                Some("use") => {
                    let end = at + position(&tokens[at..], ';');
                    self.take_use(&tokens[at + 1..end], &[], is_public);
                    at = end;
                }
                // Its body counts where it is used.
                Some("macro_rules") if is_punct(tokens.get(at + 1), '!') => at += 3,
                Some("mod") if is_punct(tokens.get(at + 2), ';') => {
                    let name = ident(tokens.get(at + 1)).expect("a module has a name");
                    self.children.insert(name);
                    at += 2;
                }
                Some("fn" | "struct" | "enum" | "trait" | "type" | "const" | "static") => {
                    self.defines.extend(ident(tokens.get(at + 1)));
                    // `const fn` is taken again at `fn`.
                    let is_keyword = ident(tokens.get(at + 1)).is_some_and(|word| word == "fn");
                    at += usize::from(!is_keyword);
                }
                Some(_) => at = self.take_path(tokens, at),
                None => {
                    if let Some(TokenTree::Group(group)) = tokens.get(at) {
                        self.take(&group.stream().into_iter().collect::<Vec<_>>());
                    }
                }
            }
            is_public = false;
            at += 1;
        }
    }

    /// Takes the tokens of a `use` after `prefix`.
    fn take_use(&mut self, tokens: &[TokenTree], prefix: &[String], is_public: bool) {
        let mut path = prefix.to_vec();
        let mut at = 0;
        while at < tokens.len() {
            if let Some(list) = group(tokens.get(at), Delimiter::Brace) {
                for tree in list.split(|token| is_punct(Some(token), ',')) {
                    self.take_use(tree, &path, is_public);
                }
                return;
            }
            if is_punct(tokens.get(at), '*') {
                self.globs.push(path);
                return;
            }
            match ident(tokens.get(at)).as_deref() {
                Some("as") => break,
                Some("self") if !path.is_empty() => {}
                Some(segment) => path.push(segment.to_owned()),
                None => {}
            }
            at += 1;
        }
        let Some(last) = path.last().cloned() else {
            return;
        };
        let name = if ident(tokens.get(at)).as_deref() == Some("as") {
            ident(tokens.get(at + 1)).unwrap_or(last)
        } else {
            last
        };
        self.imports.insert(name, path.clone());
        if is_public {
            self.handed_on.insert(path);
        } else {
            self.named.insert(path);
        }
    }

    /// Takes the path that begins at an identifier, and returns where it ends.
    fn take_path(&mut self, tokens: &[TokenTree], begin: usize) -> usize {
        let mut path = vec![ident(tokens.get(begin)).expect("a path begins with a name")];
        let mut at = begin;
        while is_path_separator(tokens, at + 1)
            && let Some(segment) = ident(tokens.get(at + 3))
        {
            path.push(segment);
            at += 3;
        }
        let before = begin.checked_sub(1).and_then(|before| tokens.get(before));
        let is_member =
            is_punct(before, '.') || is_punct(before, ':') && is_path_end(tokens, begin);
        let is_call = group(tokens.get(at + 1), Delimiter::Parenthesis).is_some();
        let is_lower = path[0].starts_with(char::is_lowercase);
        if !is_member && (path.len() > 1 || !is_lower || is_call) {
            self.named.insert(path);
        }
        at
    }
}

/// Whether a `::` stands before this token: its path began elsewhere.
fn is_path_end(tokens: &[TokenTree], at: usize) -> bool {
    at >= 2 && is_path_separator(tokens, at - 2)
}

fn is_cfg_test(attribute: &[TokenTree]) -> bool {
    ident(attribute.first()).as_deref() == Some("cfg")
        && group(attribute.get(1), Delimiter::Parenthesis).is_some_and(|inner| {
            inner.len() == 1 && ident(inner.first()).as_deref() == Some("test")
        })
}

/// Returns where the item that begins here ends: after its `;`, or after its body.
fn end_of_item(tokens: &[TokenTree], begin: usize) -> usize {
    let is_use = tokens[begin..]
        .iter()
        .find_map(|token| ident(Some(token)).filter(|word| word != "pub"))
        .is_some_and(|word| word == "use");
    let ends = |token: &TokenTree| {
        is_punct(Some(token), ';') || !is_use && group(Some(token), Delimiter::Brace).is_some()
    };
    tokens[begin..]
        .iter()
        .position(ends)
        .map_or(tokens.len(), |length| begin + length + 1)
}

fn position(tokens: &[TokenTree], wanted: char) -> usize {
    tokens
        .iter()
        .position(|token| is_punct(Some(token), wanted))
        .unwrap_or(tokens.len())
}

impl Tree {
    /// Returns the files of the crate whose root this is; `read` returns the text of a file, if there is one.
    fn of(root: &Path, read: &impl Fn(&Path) -> Option<String>) -> Self {
        let mut files = BTreeMap::new();
        let directory = root.parent().expect("a file stands in a directory");
        let mut waiting = vec![(Segments::new(), root.to_owned(), directory.to_owned())];
        while let Some((module, path, directory)) = waiting.pop() {
            let text = read(&path).expect("a module that is declared has a file");
            let file = File::read(&text);
            for name in &file.children {
                let inside = directory.join(name);
                let beside = directory.join(format!("{name}.rs"));
                let path = if read(&beside).is_some() {
                    beside
                } else {
                    inside.join("mod.rs")
                };
                let child = module.iter().chain([name]).cloned().collect();
                waiting.push((child, path, inside));
            }
            files.insert(module, file);
        }
        Self(files)
    }

    /// Returns where that is defined which a path in `module` names.
    fn definer(&self, module: &[String], path: &[String], hops: u8) -> Found {
        let (Some(hops), Some((first, rest))) = (hops.checked_sub(1), path.split_first()) else {
            return Found::Outside;
        };
        match first.as_str() {
            "crate" => self.below(&[], rest, hops),
            "self" => self.below(module, rest, hops),
            "super" => self.below(parent(module), rest, hops),
            _ => match self.bound(module, path, hops) {
                Found::Unknown => Found::Outside,
                found => found,
            },
        }
    }

    /// Returns where that is defined which `rest` names below `module`.
    fn below(&self, module: &[String], rest: &[String], hops: u8) -> Found {
        match rest.first().map(String::as_str) {
            None => return Found::In(module.to_vec()),
            Some("super") => return self.below(parent(module), &rest[1..], hops),
            Some(_) => {}
        }
        let has_foreign_glob = || {
            let globs = self.0.get(module).into_iter().flat_map(|file| &file.globs);
            let mut found = globs.map(|glob| self.definer(module, glob, hops));
            found.any(|found| found == Found::Outside)
        };
        match self.bound(module, rest, hops) {
            Found::Unknown if has_foreign_glob() => Found::Outside,
            // Made by a macro.
            Found::Unknown => Found::In(module.to_vec()),
            found => found,
        }
    }

    /// Returns where that is defined which `path` names, if it begins with something that `module` has.
    fn bound(&self, module: &[String], path: &[String], hops: u8) -> Found {
        let (Some(file), Some((first, rest))) = (self.0.get(module), path.split_first()) else {
            return Found::Unknown;
        };
        let is_child = file.children.contains(first);
        // A function may have the name of its module: alone, the function is meant.
        if let Some(import) = file.imports.get(first)
            && (!is_child || rest.is_empty())
            && import.as_slice() != path
        {
            let whole: Segments = import.iter().chain(rest).cloned().collect();
            return self.definer(module, &whole, hops);
        }
        if is_child {
            let child: Segments = module.iter().chain([first]).cloned().collect();
            return self.below(&child, rest, hops);
        }
        if file.defines.contains(first) {
            return Found::In(module.to_vec());
        }
        let there = file
            .globs
            .iter()
            .map(|glob| match self.definer(module, glob, hops) {
                Found::In(from) if from != *module => self.bound(&from, path, hops),
                _ => Found::Unknown,
            });
        there
            .into_iter()
            .find(|found| *found != Found::Unknown)
            .unwrap_or(Found::Unknown)
    }

    /// Returns the modules that each module depends on, with a path by which it does.
    fn edges(&self) -> BTreeMap<Segments, BTreeMap<Segments, String>> {
        let edges_of = |(module, file): (&Segments, &File)| {
            let handed_on = file.handed_on.iter().filter(|path| {
                let target = self.definer(module, path, HOPS);
                !matches!(target, Found::In(target) if target.starts_with(module))
            });
            let mut edges = BTreeMap::new();
            for path in file.named.iter().chain(handed_on).chain(&file.globs) {
                let Found::In(target) = self.definer(module, path, HOPS) else {
                    continue;
                };
                // A module that is imported as such is only a way to its items, which are named elsewhere.
                if target != *module && !self.is_module(&target, path) {
                    edges.entry(target).or_insert_with(|| path.join("::"));
                }
            }
            (module.clone(), edges)
        };
        self.0.iter().map(edges_of).collect()
    }

    /// Whether a path that leads to `target` ends with its name, and so with no item of it.
    fn is_module(&self, target: &[String], path: &[String]) -> bool {
        let Some(name) = path.last() else {
            return false;
        };
        let file = self.0.get(target);
        target.last() == Some(name) && !file.is_some_and(|file| file.defines.contains(name))
    }

    /// Returns for each module that is on a cycle the shortest one through it, each cycle once.
    fn cycles(&self) -> Vec<String> {
        let edges = self.edges();
        let mut found = BTreeMap::new();
        for start in edges.keys() {
            if let Some(cycle) = shortest_cycle(&edges, start) {
                let members: BTreeSet<Segments> = cycle.iter().cloned().collect();
                found
                    .entry(members)
                    .or_insert_with(|| in_words(&edges, &cycle));
            }
        }
        found.into_values().collect()
    }
}

/// Most imports that a name is followed through.
const HOPS: u8 = 20;

type Edges = BTreeMap<Segments, BTreeMap<Segments, String>>;

fn shortest_cycle(edges: &Edges, start: &Segments) -> Option<Vec<Segments>> {
    let mut from: BTreeMap<&Segments, &Segments> = BTreeMap::new();
    let mut waiting = VecDeque::from([start]);
    while let Some(module) = waiting.pop_front() {
        for next in edges.get(module)?.keys() {
            if next == start {
                let mut cycle = vec![module.clone()];
                let mut at = module;
                while at != start {
                    at = from.get(at)?;
                    cycle.push(at.clone());
                }
                cycle.reverse();
                return Some(cycle);
            }
            if !from.contains_key(next) {
                from.insert(next, module);
                waiting.push_back(next);
            }
        }
    }
    None
}

fn in_words(edges: &Edges, cycle: &[Segments]) -> String {
    let name = |module: &Segments| {
        if module.is_empty() {
            "crate".to_owned()
        } else {
            module.join("::")
        }
    };
    let step = |index: usize| {
        let (module, next) = (&cycle[index], &cycle[(index + 1) % cycle.len()]);
        let by = &edges[module][next];
        format!("{} -> {} (by {by})", name(module), name(next))
    };
    (0..cycle.len()).map(step).collect::<Vec<_>>().join(", ")
}

// ---- the check ---------------------------------------------------------------------------------

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
