//! Links of README and guide lead to existing files or to files that the build makes.

use std::path::Path;

use subaperture_tests::subap::root;

use super::{Page, paths};

/// Made by `cargo xtask guide`.
const GENERATED: &str = "host/guide/src/reference/commands.md";

/// Folder of the guide that `cargo xtask guide` copies from the page of WebAssembly.
const PAGE: [&str; 2] = ["browser/", "host/wasm/page/"];

/// Targets of `[text](target)` outside code, with the number of their line.
fn links(text: &str) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    let mut in_code = false;
    for (number, line) in text.lines().enumerate() {
        in_code ^= line.starts_with("```");
        if in_code {
            continue;
        }
        for part in line.split("](").skip(1) {
            if let Some((target, _)) = part.split_once(')') {
                found.push((number + 1, target.to_owned()));
            }
        }
    }
    found
}

#[test]
fn every_link_leads_to_a_file() {
    let mut count = 0;
    for path in paths() {
        let page = Page::read(&path);
        let text = std::fs::read_to_string(root().join(&path)).unwrap();
        let folder = Path::new(&path).parent().unwrap();
        for (number, target) in links(&text) {
            count += 1;
            let target = target.split('#').next().unwrap();
            if target.is_empty() || target.starts_with("https://") {
                continue;
            }
            if let Some(name) = target.strip_prefix("pictures/") {
                let made = page.pictures.iter().any(|(_, made)| made == name);
                assert!(made, "{path}:{number}: no block makes {name}");
                continue;
            }
            let file = match target.strip_prefix(PAGE[0]) {
                Some(name) => Path::new(PAGE[1]).join(name),
                None => folder.join(target),
            };
            let is_generated = root().join(GENERATED) == clean(&root().join(&file));
            assert!(
                is_generated || root().join(&file).exists(),
                "{path}:{number}: {target}"
            );
        }
    }
    assert!(count > 60, "{count} links");
}

/// The path without `..`.
fn clean(path: &Path) -> std::path::PathBuf {
    let mut cleaned = std::path::PathBuf::new();
    for part in path.components() {
        match part {
            std::path::Component::ParentDir => {
                cleaned.pop();
            }
            part => cleaned.push(part),
        }
    }
    cleaned
}

#[test]
fn every_page_is_in_the_summary() {
    let summary = std::fs::read_to_string(root().join("host/guide/src/SUMMARY.md")).unwrap();
    let listed = links(&summary);
    for path in paths() {
        let Some(name) = path.strip_prefix("host/guide/src/") else {
            continue;
        };
        let is_listed = listed.iter().any(|(_, target)| target == name);
        assert!(is_listed || name == "SUMMARY.md", "{name}");
    }
}
