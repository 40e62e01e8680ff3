//! Import cycles among the files of a crate.
//!
//! A file imports another if a `use`, or a path that begins with `crate`, `self` or `super`, leads to it. A module
//! and its submodules count as one: re-exports by a parent are no cycle. Tests and comments are ignored.

use std::collections::{BTreeMap, BTreeSet};

/// Module path from the crate's root, which is empty.
type Module = Vec<String>;

/// Imports of each module, with the paths used.
type Imports = BTreeMap<Module, BTreeMap<Module, BTreeSet<String>>>;

/// Module of the file `name`, a path below `src`.
fn module(name: &str) -> Module {
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

/// Paths of a use tree after `prefix`, and the rest behind it.
fn expand<'a, 't>(
    prefix: &[&'a str],
    mut tree: &'t [&'a str],
    paths: &mut Vec<Vec<&'a str>>,
) -> &'t [&'a str] {
    let mut path = prefix.to_vec();
    loop {
        match tree {
            ["{", rest @ ..] => {
                tree = rest;
                while !matches!(tree, [] | ["}", ..]) {
                    tree = expand(&path, tree, paths);
                    tree = tree.strip_prefix(&[","]).unwrap_or(tree);
                }
                return tree.get(1..).unwrap_or(&[]);
            }
            ["::", rest @ ..] => tree = rest,
            ["as", _, rest @ ..] => tree = rest,
            [] | ["," | "}" | ";", ..] => break,
            [word, rest @ ..] => {
                path.push(*word);
                tree = rest;
            }
        }
    }
    paths.push(path);
    tree
}

/// Every path that a source imports or names.
fn paths<'a>(tokens: &[&'a str]) -> Vec<Vec<&'a str>> {
    let mut paths = Vec::new();
    let mut rest = tokens;
    while let [word, after @ ..] = rest {
        rest = match (*word, after) {
            // In `impl Trait + use<'a>` a bracket follows.
            ("use", [next, ..]) if *next != "<" => expand(&[], after, &mut paths),
            ("crate" | "self" | "super", ["::", ..]) => {
                let mut path = vec![*word];
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
    }
    paths
}

/// Module that `path` in `from` leads to; `None` for other crates.
fn resolve(path: &[&str], from: &Module, modules: &BTreeSet<Module>) -> Option<Module> {
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
        [child, ..] if modules.contains(&within(from, child)) => {}
        _ => return None,
    }
    if let ["crate" | "self", after @ ..] = rest {
        rest = after;
    }
    for name in rest {
        let deeper = within(&module, name);
        if !modules.contains(&deeper) {
            break;
        }
        module = deeper;
    }
    Some(module)
}

fn within(module: &Module, child: &str) -> Module {
    module.iter().cloned().chain([child.to_owned()]).collect()
}

/// Imports among the files of a crate, `(path below src, text)`.
fn imports(files: &[(String, String)]) -> Imports {
    let modules: BTreeSet<Module> = files.iter().map(|(name, _)| module(name)).collect();
    let mut imports = Imports::new();
    for (name, text) in files {
        let from = module(name);
        for path in paths(&without_tests(&tokens(text))) {
            let Some(to) = resolve(&path, &from, &modules) else {
                continue;
            };
            if !from.starts_with(&to) && !to.starts_with(&from) {
                let to = imports.entry(from.clone()).or_default().entry(to);
                to.or_default().insert(path.join("::"));
            }
        }
    }
    imports
}

/// All modules imported from `start`, directly or indirectly.
fn reached<'a>(start: &'a Module, imports: &'a Imports) -> BTreeSet<&'a Module> {
    let mut reached = BTreeSet::new();
    let mut left = vec![start];
    while let Some(module) = left.pop() {
        let further = imports.get(module).into_iter().flat_map(BTreeMap::keys);
        left.extend(further.filter(|module| reached.insert(*module)));
    }
    reached
}

/// Import cycles among the files of a crate, `(path below src, text)`, each as a list of arrows.
pub(super) fn cycles(files: &[(String, String)]) -> Vec<Vec<String>> {
    let imports = imports(files);
    let reached: BTreeMap<&Module, BTreeSet<&Module>> = imports
        .keys()
        .map(|module| (module, reached(module, &imports)))
        .collect();
    // Modules that reach each other form a cycle.
    let cycles: BTreeSet<Vec<&Module>> = reached
        .iter()
        .filter(|(module, all)| all.contains(*module))
        .map(|(module, all)| {
            let mutual = all.iter().filter(|other| {
                let back = reached.get(**other);
                back.is_some_and(|back| back.contains(module))
            });
            mutual.copied().collect()
        })
        .collect();
    let arrows = |cycle: Vec<&Module>| -> Vec<String> {
        let from = cycle.iter().flat_map(|from| {
            let to = imports[*from].iter();
            let to = to.filter(|(to, _)| cycle.contains(to));
            to.map(|(to, paths)| arrow(from, to, paths))
        });
        from.collect()
    };
    cycles.into_iter().map(arrows).collect()
}

fn arrow(from: &Module, to: &Module, paths: &BTreeSet<String>) -> String {
    let paths: Vec<&str> = paths.iter().map(String::as_str).collect();
    let (from, to) = (from.join("::"), to.join("::"));
    format!("{from} -> {to}: {}", paths.join(", "))
}

/// Crate whose modules `a`, `b` and `c` import each other, and `d` all of them, with the given source of `b`.
fn made_up(b: &str) -> Vec<(String, String)> {
    let files = [
        (
            "lib.rs",
            "mod a; mod b; mod c; mod d; pub use a::f; use c::*;",
        ),
        (
            "a.rs",
            "use std::fmt;\nuse super::{b::{self, B}, Other as Else};\npub fn f<'a>() {}",
        ),
        ("b.rs", b),
        (
            "c/mod.rs",
            "mod leaf; use self::leaf::Leaf;\nfn g() -> char { crate::a::f(); '\"' }",
        ),
        ("c/leaf.rs", "pub struct Leaf;"),
        ("d.rs", "use crate::{a, b, c::leaf::Leaf};"),
    ];
    files
        .map(|(name, text)| (name.to_owned(), text.to_owned()))
        .to_vec()
}

#[test]
fn cycle_of_three_files_is_detected() {
    let found = cycles(&made_up("pub use super::{c::{leaf::Leaf as L, C, D}};"));
    // The leaf is a separate file that imports nothing.
    let arrows = [
        "a -> b: super::b::B, super::b::self",
        "b -> c: super::c::C, super::c::D",
        "c -> a: crate::a::f",
    ];
    assert_eq!(found, [arrows.map(str::to_owned)]);
}

#[test]
fn comments_strings_and_tests_make_no_cycle() {
    let sources = [
        "// use super::c::C;\n/* use super::c::C; */",
        "const A: &str = \"use super::c::C; \\\" crate::c::C\";",
        "const A: &str = r#\"\" use super::c::C;\"#;",
        "#[cfg(test)]\nmod tests { fn f() {} use super::super::c::C; }",
        "fn f() { #[cfg(test)] super::c::counted(); }",
        "use super::c::leaf::Leaf;",
        "use subaperture_core::c::C;",
    ];
    for source in sources {
        assert_eq!(cycles(&made_up(source)), [[""; 0]; 0], "{source}");
    }
    // Imports after them count.
    for source in sources {
        let source = format!("{source}\nfn g(c: crate::c::C) {{}}");
        assert_eq!(cycles(&made_up(&source)).len(), 1, "{source}");
    }
}
