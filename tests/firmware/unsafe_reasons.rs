//! `unsafe` occurs only in the firmware, the kernels' SIMD, the binding to UHD and one array of the Python module, and every use states why it is sound.

use std::fs;
use std::path::{Path, PathBuf};

use subaperture_tests::subap::root;

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() && !path.ends_with("target") {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

/// Code of a line without its comment; string literals contain no slashes here.
fn code(line: &str) -> &str {
    line.split("//").next().unwrap_or_default()
}

/// Whether the line, or the comment directly above it, states a reason.
fn has_reason(lines: &[&str], n: usize) -> bool {
    let above = lines[..=n]
        .iter()
        .rev()
        .take_while(|line| !line.trim().is_empty());
    // The reason of a block within an expression is above the expression; further up it belongs to other code.
    above.take(6).any(|line| line.contains("SAFETY:"))
}

#[test]
fn every_unsafe_has_its_reason() {
    let mut files = Vec::new();
    for folder in [
        "firmware",
        "host/kernels/src/lanes",
        "host/radio/src/uhd",
        "host/python/src",
    ] {
        sources(&root().join(folder), &mut files);
    }
    let mut sites = 0;
    for path in files {
        let text = fs::read_to_string(&path).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        for (n, line) in lines.iter().enumerate() {
            let is_site = code(line)
                .split(|c: char| !c.is_alphanumeric() && c != '_')
                .any(|word| word == "unsafe");
            if is_site {
                sites += 1;
                assert!(
                    has_reason(&lines, n),
                    "{}:{}: no reason for {line}",
                    path.display(),
                    n + 1
                );
            }
        }
    }
    println!("{sites} places");
    assert!(sites > 40, "the search is broken");
}

/// The compiler refuses `unsafe` elsewhere.
#[test]
fn unsafe_is_forbidden_elsewhere() {
    let mut crates = vec!["core/src/lib.rs".to_owned(), "tests/src/lib.rs".to_owned()];
    for entry in fs::read_dir(root().join("host")).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        if !root().join("host").join(&name).join("Cargo.toml").exists() {
            continue;
        }
        crates.push(format!("host/{name}/src/lib.rs"));
    }
    for path in crates {
        let text = fs::read_to_string(root().join(&path)).unwrap();
        // In the kernels it is allowed by name in some modules; in the radio, in three modules of the binding; in the Python module, for one
        // array.
        let (refused, allowed) = match path.as_str() {
            "host/kernels/src/lib.rs" => ("deny", 1),
            "host/radio/src/lib.rs" | "host/python/src/lib.rs" => ("deny", 0),
            _ => ("forbid", 0),
        };
        assert!(
            text.contains(&format!("\n#![{refused}(unsafe_code)]\n")),
            "{path}"
        );
        assert_eq!(text.matches("allow(unsafe_code").count(), allowed, "{path}");
    }
    let mut files = Vec::new();
    for folder in ["host/radio/src", "host/python/src"] {
        sources(&root().join(folder), &mut files);
    }
    for path in files {
        let text = fs::read_to_string(&path).unwrap();
        let allowed = match () {
            () if path.ends_with("uhd/mod.rs") => 3,
            () if path.ends_with("python/src/image.rs") => 1,
            () => 0,
        };
        let found = text.matches("allow(unsafe_code").count();
        assert_eq!(found, allowed, "{}", path.display());
    }
}
