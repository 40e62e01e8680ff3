//! What each of the core's features costs in dependencies: as its documentation says, and no more.

use std::collections::BTreeSet;

use subaperture_xtask::cargo;

/// What the Keystone alone needs.
const ALWAYS: [&str; 3] = ["libm", "microfft", "num-complex"];

/// Features and what they add to [`ALWAYS`]: the table at the head of `core/src/lib.rs`.
const ADDED: [(&str, &[&str]); 8] = [
    ("", &[]),
    ("stream", &["heapless"]),
    // With the stream.
    ("fixed", &["heapless", "fixed"]),
    // With both.
    (
        "link",
        &["heapless", "fixed", "cobs", "crc", "postcard", "serde"],
    ),
    ("selftest", &[]),
    ("motion", &[]),
    ("sweep", &[]),
    ("defmt", &["defmt"]),
];

/// Normal dependencies with `features` alone, as deep as `depth` says; the core itself is not one.
fn dependencies(features: &str, depth: &str) -> BTreeSet<String> {
    let output = cargo()
        .args(["tree", "--package", "subaperture-core", "--locked"])
        .args(["--no-default-features", "--features", features])
        .args(["--edges", "normal", "--depth", depth])
        .args(["--prefix", "none", "--format", "{p}"])
        .output()
        .unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{features}: {told}");
    let lines = String::from_utf8(output.stdout).unwrap();
    let names = lines.lines().filter_map(|line| line.split(' ').next());
    let mut names: BTreeSet<String> = names.map(String::from).collect();
    assert!(names.remove("subaperture-core"), "{lines}");
    names
}

#[test]
fn a_feature_takes_the_dependencies_that_are_written_of_it() {
    for (feature, added) in ADDED {
        let expected = ALWAYS.iter().chain(added).map(|name| name.to_string());
        assert_eq!(dependencies(feature, "1"), expected.collect(), "{feature}");
    }
}

#[test]
fn all_features_take_what_each_takes() {
    let together = dependencies("stream,fixed,link,selftest,motion,sweep,defmt", "1");
    let added = ADDED.iter().flat_map(|(_, added)| *added);
    let expected = ALWAYS.iter().chain(added).map(|name| name.to_string());
    assert_eq!(together, expected.collect());
}

/// Nor do the three bring another of them by the back door, or a macro that is compiled for the host.
#[test]
fn the_keystone_alone_takes_little_indirectly() {
    let own = dependencies("", "100");
    let optional = ADDED.iter().flat_map(|(_, added)| *added);
    for name in optional.chain(&["syn", "thiserror", "zerocopy"]) {
        assert!(!own.contains(*name), "{name} in {own:?}");
    }
    assert_eq!(own, dependencies("selftest", "100"));
}

/// What is documented is what is declared: a new feature is a new line of both tables.
#[test]
fn every_feature_is_written_of() {
    let read = |path| std::fs::read_to_string(subaperture_xtask::root().join(path)).unwrap();
    let (manifest, documentation) = (read("core/Cargo.toml"), read("core/src/lib.rs"));
    let (_, declared) = manifest.split_once("[features]\n").unwrap();
    let (declared, _) = declared.split_once("\n[").unwrap();
    let declared = declared.lines().filter_map(|line| line.split_once(" = "));
    let declared: BTreeSet<_> = declared.map(|(name, _)| name).collect();
    let tested = ADDED.iter().map(|(name, _)| *name);
    let tested: BTreeSet<_> = tested.filter(|name| !name.is_empty()).collect();
    assert_eq!(declared, &tested | &BTreeSet::from(["default"]));
    for name in tested {
        let row = format!("//! | `{name}` |");
        assert!(documentation.contains(&row), "no row {row}");
    }
}
