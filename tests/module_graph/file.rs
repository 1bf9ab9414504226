//! What one source file defines, imports and names, from its tokens.

use std::collections::{BTreeMap, BTreeSet};

use proc_macro2::{Delimiter, TokenStream, TokenTree};

/// The names of a path.
pub type Segments = Vec<String>;

/// What one file says of others.
#[derive(Default)]
pub struct File {
    /// The files below it, by the names of their modules.
    pub children: BTreeSet<String>,
    /// What a name that is imported here stands for.
    pub imports: BTreeMap<String, Segments>,
    /// Imports of all that a module has.
    pub globs: Vec<Segments>,
    /// What is named: private imports, and paths in code.
    pub named: BTreeSet<Segments>,
    /// What is handed on.
    pub handed_on: BTreeSet<Segments>,
    pub defines: BTreeSet<String>,
}

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
    pub fn read(text: &str) -> Self {
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
