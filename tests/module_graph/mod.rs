//! The files of a crate and the dependencies between them.

mod file;

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::path::Path;

use self::file::{File, Segments};

/// The files of a crate, by the path of their module: empty for the root.
pub struct Tree(pub BTreeMap<Segments, File>);

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

impl Tree {
    /// Returns the files of the crate whose root this is; `read` returns the text of a file, if there is one.
    pub fn of(root: &Path, read: &impl Fn(&Path) -> Option<String>) -> Self {
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
    pub fn cycles(&self) -> Vec<String> {
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
