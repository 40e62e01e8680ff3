//! Dependencies of each feature of the core: as documented and no more.

use std::collections::BTreeSet;

use subaperture_xtask::cargo;

/// Dependencies of the keystone transform alone.
const ALWAYS: [&str; 3] = ["libm", "microfft", "num-complex"];

/// Features and the dependencies they add to [`ALWAYS`]: the table in `core/src/lib.rs`.
const ADDED: [(&str, &[&str]); 8] = [
    ("", &[]),
    ("stream", &["heapless"]),
    // In addition to those of the stream.
    ("fixed", &["heapless", "fixed"]),
    // In addition to those of both.
    (
        "link",
        &["heapless", "fixed", "cobs", "crc", "postcard", "serde"],
    ),
    ("selftest", &[]),
    ("motion", &[]),
    ("sweep", &[]),
    ("defmt", &["defmt"]),
];

/// Normal dependencies with `features` only, to the given depth, without the core itself.
fn dependencies(features: &str, depth: &str) -> BTreeSet<String> {
    let output = cargo()
        .args(["tree", "--package", "subaperture-core", "--locked"])
        .args(["--no-default-features", "--features", features])
        .args(["--edges", "normal", "--depth", depth])
        .args(["--prefix", "none", "--format", "{p}"])
        .output()
        .unwrap();
    let reported = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{features}: {reported}");
    let lines = String::from_utf8(output.stdout).unwrap();
    let names = lines.lines().filter_map(|line| line.split(' ').next());
    let mut names: BTreeSet<String> = names.map(String::from).collect();
    assert!(names.remove("subaperture-core"), "{lines}");
    names
}

#[test]
fn feature_has_documented_dependencies() {
    for (feature, added) in ADDED {
        let expected = ALWAYS.iter().chain(added).map(|name| name.to_string());
        assert_eq!(dependencies(feature, "1"), expected.collect(), "{feature}");
    }
}

#[test]
fn all_features_have_union_of_dependencies() {
    let together = dependencies("stream,fixed,link,selftest,motion,sweep,defmt", "1");
    let added = ADDED.iter().flat_map(|(_, added)| *added);
    let expected = ALWAYS.iter().chain(added).map(|name| name.to_string());
    assert_eq!(together, expected.collect());
}

/// The three dependencies bring in no others indirectly, and no procedural macro compiled for the host.
#[test]
fn keystone_alone_has_few_indirect_dependencies() {
    let own = dependencies("", "100");
    let optional = ADDED.iter().flat_map(|(_, added)| *added);
    for name in optional.chain(&["syn", "thiserror", "zerocopy"]) {
        assert!(!own.contains(*name), "{name} in {own:?}");
    }
    assert_eq!(own, dependencies("selftest", "100"));
}

/// The documented features are the declared ones: a new feature needs a new line in both tables.
#[test]
fn every_feature_is_documented() {
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
