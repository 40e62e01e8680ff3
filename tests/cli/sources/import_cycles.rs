//! Import cycles among the files of a crate.
//!
//! A file imports another if a `use`, or a path in its code, leads to an item of the other. An item that a module only re-exports
//! belongs to the file that defines it. Parents and children are files like any others: a parent imports its children, or
//! they import it. Tests and comments are ignored.

use std::collections::{BTreeMap, BTreeSet};

use super::modules::{Module, Modules};

/// Imports of each module of a crate, with the paths used.
pub(super) struct Imports(BTreeMap<Module, BTreeMap<Module, BTreeSet<String>>>);

impl Imports {
    /// Imports among the files of a crate, `(path below src, text)`.
    pub(super) fn of(files: &[(String, String)]) -> Self {
        let modules = Modules::of(files);
        let imports = modules
            .names()
            .map(|from| (from.clone(), modules.dependencies(from)));
        Self(imports.collect())
    }

    /// All modules imported from `start`, directly or indirectly.
    fn reached<'a>(&'a self, start: &'a Module) -> BTreeSet<&'a Module> {
        let mut reached = BTreeSet::new();
        let mut left = vec![start];
        while let Some(module) = left.pop() {
            let further = self.0.get(module).into_iter().flat_map(BTreeMap::keys);
            left.extend(further.filter(|module| reached.insert(*module)));
        }
        reached
    }

    /// Import cycles, each as a list of arrows.
    pub(super) fn cycles(&self) -> Vec<Vec<String>> {
        let reached: BTreeMap<&Module, BTreeSet<&Module>> = self
            .0
            .keys()
            .map(|module| (module, self.reached(module)))
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
                let to = self.0[*from].iter();
                let to = to.filter(|(to, _)| cycle.contains(to));
                to.map(|(to, paths)| arrow(from, to, paths))
            });
            from.collect()
        };
        cycles.into_iter().map(arrows).collect()
    }
}

fn arrow(from: &Module, to: &Module, paths: &BTreeSet<String>) -> String {
    let paths: Vec<&str> = paths.iter().map(String::as_str).collect();
    let (from, to) = (from.join("::"), to.join("::"));
    format!("{from} -> {to}: {}", paths.join(", "))
}

fn cycles(files: &[(String, String)]) -> Vec<Vec<String>> {
    Imports::of(files).cycles()
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

/// Sources of a parent and its child, and the circle that they form.
#[test]
fn circle_of_parent_and_child_is_detected() {
    let circle = |parent: &str, child: &str, lib: &str| {
        let files = [
            ("lib.rs", lib),
            ("parent.rs", parent),
            ("parent/child.rs", child),
            ("parent/other.rs", "pub struct Other;"),
        ];
        let files = files.map(|(name, text)| (name.to_owned(), text.to_owned()));
        !cycles(&files).is_empty()
    };
    let (lib, child) = ("mod parent;", "use super::Shared; pub fn run() {}");
    let uses = "mod child; struct Shared; fn f() { child::run() }";
    for (parent, child) in [
        (uses, child),
        ("mod child; use child::run; struct Shared;", child),
        (
            "mod child; use self::child as c; struct Shared; fn f() { c::run() }",
            child,
        ),
        (uses, "use super::*; fn f(_: Shared) {}"),
        (uses, "fn f(_: super::Shared) {}"),
        (uses, "use crate::parent; fn f(_: parent::Shared) {}"),
        (
            "mod child; use child::run; pub const Shared: u8 = 1;",
            child,
        ),
    ] {
        assert!(circle(parent, child, lib), "{parent} {child}");
    }
    // An item that a module around both re-exports belongs to the parent.
    let through = "use crate::Shared;";
    assert!(circle(uses, through, "mod parent; pub use parent::Shared;"));
    for (parent, child) in [
        // The parent only re-exports.
        (
            "mod child; pub(crate) use child::run; struct Shared;",
            child,
        ),
        // The child only implements the parent's trait for others to call.
        ("mod child; trait Shared {}", child),
        // The item of a sibling, which the parent re-exports.
        (
            "mod child; mod other; pub use other::Other as Shared; use child::run;",
            child,
        ),
        (uses, "fn f() { struct Shared; }"),
        (uses, "#[cfg(test)] use super::Shared;"),
    ] {
        assert!(!circle(parent, child, lib), "{parent} {child}");
    }
}
