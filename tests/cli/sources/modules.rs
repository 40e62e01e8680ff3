//! Modules of a crate: the items that each defines, and the paths that it names.

use std::collections::{BTreeMap, BTreeSet};

/// Module path from the crate's root, which is empty.
pub(super) type Module = Vec<String>;

/// Module of the file `name`, a path below `src`.
pub(super) fn module(name: &str) -> Module {
    let path = name.strip_suffix(".rs").unwrap();
    let path = path.strip_suffix("/mod").unwrap_or(path);
    match path {
        "lib" | "main" => Vec::new(),
        _ => path.split('/').map(str::to_owned).collect(),
    }
}

/// Words and symbols of a source, without comments, strings and characters.
fn tokens(text: &str) -> Vec<&str> {
    let mut tokens = Vec::new();
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let is_word = |c: char| c.is_alphanumeric() || c == '_';
        let hashes = |s: &str| s.len() - s.trim_start_matches('#').len();
        let raw = rest
            .strip_prefix('r')
            .filter(|after| after.trim_start_matches('#').starts_with('"'));
        let length = if rest.starts_with("//") {
            rest.find('\n').unwrap_or(rest.len())
        } else if rest.starts_with("/*") {
            rest.find("*/").map_or(rest.len(), |end| end + 2)
        } else if let Some(after) = raw {
            let start = 2 + hashes(after);
            let end = format!("\"{}", "#".repeat(hashes(after)));
            start + rest[start..].find(&end).unwrap() + end.len()
        } else if first == '"' {
            quoted(rest, '"')
        } else if first == '\'' && is_character(rest) {
            quoted(rest, '\'')
        } else {
            let length = match first {
                _ if is_word(first) => rest.find(|c| !is_word(c)).unwrap_or(rest.len()),
                _ if rest.starts_with("::") => 2,
                _ => first.len_utf8(),
            };
            if !first.is_whitespace() {
                tokens.push(&rest[..length]);
            }
            length
        };
        rest = &rest[length..];
    }
    tokens
}

/// Whether a `'` begins a character rather than a lifetime.
fn is_character(text: &str) -> bool {
    let mut after = text.chars().skip(1);
    after.next() == Some('\\') || after.next() == Some('\'')
}

/// Length in bytes of a literal that begins and ends with `mark`.
fn quoted(text: &str, mark: char) -> usize {
    let mut is_escaped = false;
    let end = text[1..].find(|c| {
        let is_end = c == mark && !is_escaped;
        is_escaped = c == '\\' && !is_escaped;
        is_end
    });
    end.unwrap() + 2
}

/// Leave out code that is compiled only for tests: the item or statement after `#[cfg(test)]`.
fn without_tests<'a>(tokens: &[&'a str]) -> Vec<&'a str> {
    const FOR_TESTS: [&str; 7] = ["#", "[", "cfg", "(", "test", ")", "]"];
    let mut kept = Vec::new();
    let mut i = 0;
    while i < tokens.len() {
        if !tokens[i..].starts_with(&FOR_TESTS) {
            kept.push(tokens[i]);
            i += 1;
            continue;
        }
        let mut depth = 0;
        loop {
            depth += i32::from(tokens[i] == "{") - i32::from(tokens[i] == "}");
            let is_last = depth == 0 && matches!(tokens[i], ";" | "}");
            i += 1;
            if is_last || i == tokens.len() {
                break;
            }
        }
    }
    kept
}

/// Path of a `use`, and the name that it gives to its item.
struct Import<'a> {
    path: Vec<&'a str>,
    name: &'a str,
    is_reexport: bool,
}

/// Add the imports of a use tree after `prefix`. Returns the tokens behind it.
fn expand<'a, 't>(
    prefix: &[&'a str],
    mut tree: &'t [&'a str],
    is_reexport: bool,
    imports: &mut Vec<Import<'a>>,
) -> &'t [&'a str] {
    let mut path = prefix.to_vec();
    let mut alias = None;
    loop {
        match tree {
            ["{", rest @ ..] => {
                tree = rest;
                while !matches!(tree, [] | ["}", ..]) {
                    tree = expand(&path, tree, is_reexport, imports);
                    tree = tree.strip_prefix(&[","]).unwrap_or(tree);
                }
                return tree.get(1..).unwrap_or(&[]);
            }
            ["::", rest @ ..] => tree = rest,
            ["as", name, rest @ ..] => (alias, tree) = (Some(*name), rest),
            [] | ["," | "}" | ";", ..] => break,
            [word, rest @ ..] => {
                path.push(*word);
                tree = rest;
            }
        }
    }
    let last = path.iter().rev().find(|word| **word != "self");
    let name = alias.or(last.copied()).unwrap_or_default();
    imports.push(Import {
        path,
        name,
        is_reexport,
    });
    tree
}

fn is_name(token: &str) -> bool {
    token.starts_with(|c: char| c.is_alphabetic() || c == '_')
}

/// Imports of a source, and the paths in its code.
fn paths<'a>(tokens: &[&'a str]) -> (Vec<Import<'a>>, Vec<Vec<&'a str>>) {
    let (mut imports, mut paths) = (Vec::new(), Vec::new());
    let mut rest = tokens;
    let mut before = "";
    while let [word, after @ ..] = rest {
        rest = match (*word, after) {
            // In `impl Trait + use<'a>` a bracket follows.
            ("use", [next, ..]) if *next != "<" => {
                // After `pub` or `pub(crate)`.
                let is_reexport = matches!(before, "pub" | ")");
                expand(&[], after, is_reexport, &mut imports)
            }
            (word, ["::", ..]) if is_name(word) => {
                let mut path = vec![word];
                let mut tail = after;
                while let ["::", name, behind @ ..] = tail {
                    path.push(*name);
                    tail = behind;
                }
                paths.push(path);
                tail
            }
            _ => after,
        };
        before = word;
    }
    (imports, paths)
}

/// Names of the items that a source defines outside all braces.
fn defined<'a>(tokens: &[&'a str]) -> BTreeSet<&'a str> {
    const KEYWORDS: [&str; 7] = ["struct", "enum", "trait", "fn", "type", "static", "const"];
    let mut defined = BTreeSet::new();
    let mut depth = 0;
    for pair in tokens.windows(2) {
        depth += i32::from(pair[0] == "{") - i32::from(pair[0] == "}");
        if depth == 0 && KEYWORDS.contains(&pair[0]) && is_name(pair[1]) {
            defined.insert(pair[1]);
        }
    }
    defined
}

/// File of a crate, without comments and tests.
struct Source<'a> {
    tokens: Vec<&'a str>,
    defined: BTreeSet<&'a str>,
    imports: Vec<Import<'a>>,
    /// Paths outside of imports.
    paths: Vec<Vec<&'a str>>,
}

/// Files of a crate by their modules.
pub(super) struct Modules<'a>(BTreeMap<Module, Source<'a>>);

fn within(module: &[String], child: &str) -> Module {
    module.iter().cloned().chain([child.to_owned()]).collect()
}

impl<'a> Modules<'a> {
    /// Modules of files, `(path below src, text)`.
    pub(super) fn of(files: &'a [(String, String)]) -> Self {
        let source = |text: &'a str| {
            let tokens = without_tests(&tokens(text));
            let (imports, paths) = paths(&tokens);
            Source {
                defined: defined(&tokens),
                tokens,
                imports,
                paths,
            }
        };
        let sources = files
            .iter()
            .map(|(name, text)| (module(name), source(text)));
        Self(sources.collect())
    }

    pub(super) fn names(&self) -> impl Iterator<Item = &Module> {
        self.0.keys()
    }

    /// Module that `path` in `from` leads to, and the names left after it; `None` for other crates.
    fn locate<'p>(&self, path: &'p [&'a str], from: &Module) -> Option<(Module, &'p [&'a str])> {
        let mut module = from.clone();
        let mut rest = path;
        match path {
            ["crate", ..] => module.clear(),
            ["self", ..] => {}
            ["super", ..] => {
                while let ["super", after @ ..] = rest {
                    module.pop();
                    rest = after;
                }
            }
            [child, ..] if self.0.contains_key(&within(from, child)) => {}
            _ => return None,
        }
        if let ["crate" | "self", after @ ..] = rest {
            rest = after;
        }
        Some(self.descend(module, rest))
    }

    /// Submodule of `module` that `path` leads to, and the names left after it.
    fn descend<'p>(&self, mut module: Module, mut path: &'p [&'a str]) -> (Module, &'p [&'a str]) {
        while let [name, after @ ..] = path {
            let deeper = within(&module, name);
            if !self.0.contains_key(&deeper) {
                break;
            }
            module = deeper;
            path = after;
        }
        (module, path.strip_prefix(&["self"]).unwrap_or(path))
    }

    /// Module that defines the item `name` of `module`, which may import it. `None` if unknown.
    fn definer(&self, module: &Module, name: &str, depth: usize) -> Option<Module> {
        const MAX_DEPTH: usize = 8;
        let source = self.0.get(module)?;
        if source.defined.contains(name) {
            return Some(module.clone());
        }
        let imports = source.imports.iter().filter(|_| depth < MAX_DEPTH);
        let mut imports = imports.filter(|import| import.name == name || import.name == "*");
        imports.find_map(|import| {
            let (to, rest) = self.locate(&import.path, module)?;
            let original = match rest {
                ["*", ..] => name,
                [original, ..] => original,
                [] => return None,
            };
            self.definer(&to, original, depth + 1)
        })
    }

    /// Modules that `from` depends on by naming `rest` of the module `to`: that module, and one around `from` that defines the item.
    fn targets(&self, from: &Module, to: Module, rest: &[&str]) -> BTreeSet<Module> {
        let is_around = from.starts_with(&to);
        let names = match rest {
            // An item of the glob that the file names.
            ["*", ..] if is_around => &self.0[from].tokens,
            rest => &rest[..rest.len().min(1)],
        };
        let definers = names.iter().filter_map(|name| self.definer(&to, name, 0));
        let mut targets: BTreeSet<Module> = definers
            .filter(|definer| from.starts_with(definer))
            .collect();
        if !is_around {
            targets.insert(to);
        }
        targets.remove(from);
        targets
    }

    /// Modules that `from` depends on, each with the paths that lead to it.
    pub(super) fn dependencies(&self, from: &Module) -> BTreeMap<Module, BTreeSet<String>> {
        let source = &self.0[from];
        let aliases = source.imports.iter().filter_map(|import| {
            let (module, rest) = self.locate(&import.path, from)?;
            rest.is_empty().then_some((import.name, module))
        });
        let aliases: BTreeMap<&str, Module> = aliases.collect();
        let imported = source
            .imports
            .iter()
            .map(|import| (&import.path, import.is_reexport));
        let in_code = source.paths.iter().map(|path| (path, false));
        let mut dependencies: BTreeMap<Module, BTreeSet<String>> = BTreeMap::new();
        for (path, is_reexport) in imported.chain(in_code) {
            let located = match aliases.get(path[0]) {
                Some(module) => Some(self.descend(module.clone(), &path[1..])),
                None => self.locate(path, from),
            };
            let Some((to, rest)) = located else {
                continue;
            };
            let targets = self.targets(from, to, rest).into_iter();
            for target in targets.filter(|to| !(is_reexport && to.starts_with(from))) {
                let paths = dependencies.entry(target).or_default();
                paths.insert(path.join("::"));
            }
        }
        dependencies
    }
}
