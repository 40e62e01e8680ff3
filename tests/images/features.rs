//! Dependencies of each cargo feature of the library, as documented.

use std::collections::BTreeSet;

use subaperture_xtask::cargo;

/// Packages that forming images from arrays does not need, with the features that enable each.
const OPTIONAL: [(&str, &[&str]); 27] = [
    ("roxmltree", &["cphd", "sicd"]),
    (
        "flate2",
        &[
            "gotcha", "npz", "hdf5", "plot", "simulate", "maps", "radio", "uhd", "viewer",
            "terrain",
        ],
    ),
    ("zip", &["npz", "hdf5", "maps"]),
    ("hdf5-pure", &["hdf5"]),
    (
        "toml",
        &[
            "recording",
            "simulate",
            "planner",
            "autofocus",
            "radio",
            "uhd",
            "viewer",
        ],
    ),
    (
        "png",
        &["plot", "simulate", "maps", "radio", "uhd", "viewer"],
    ),
    ("ab_glyph", &["plot", "viewer"]),
    ("dejavu", &["plot", "viewer"]),
    ("rand_chacha", &["simulate", "radio", "uhd", "viewer"]),
    ("serial2", &["link"]),
    (
        "subaperture-core",
        &["link", "motion", "radio", "uhd", "viewer"],
    ),
    ("subaperture-sicd", &["sicd"]),
    ("tiff", &["terrain"]),
    ("subaperture-planner", &["planner"]),
    (
        "subaperture-quality",
        &["quality", "autofocus", "viewer", "interferometry"],
    ),
    ("subaperture-autofocus", &["autofocus"]),
    ("subaperture-maps", &["maps", "terrain"]),
    ("subaperture-motion", &["motion", "radio", "uhd", "viewer"]),
    (
        "subaperture-navigation",
        &[
            "navigation",
            "recording",
            "simulate",
            "autofocus",
            "radio",
            "uhd",
            "viewer",
        ],
    ),
    ("subaperture-radio", &["radio", "uhd", "viewer"]),
    ("subaperture-viewer", &["viewer"]),
    ("tokio", &["viewer"]),
    ("axum", &["viewer"]),
    ("subaperture-gpu", &["gpu"]),
    ("subaperture-gmti", &["gmti"]),
    ("subaperture-interferometry", &["interferometry"]),
    ("wgpu", &["gpu"]),
];

/// Packages that no feature of the library enables.
const NEVER: [&str; 5] = [
    "clap",
    "anyhow",
    "indicatif",
    "ctrlc",
    "subaperture-gallery",
];

/// Every feature with its own dependencies.
const FEATURES: [&str; 22] = [
    "cphd",
    "gotcha",
    "npz",
    "hdf5",
    "recording",
    "simulate",
    "quality",
    "plot",
    "planner",
    "autofocus",
    "motion",
    "navigation",
    "maps",
    "link",
    "radio",
    "uhd",
    "viewer",
    "sicd",
    "terrain",
    "gpu",
    "gmti",
    "interferometry",
];

/// All packages compiled into a program that uses the library with `features` only.
fn dependencies(features: &str) -> BTreeSet<String> {
    let output = cargo()
        .args(["tree", "--package", "subaperture", "--locked"])
        .args(["--no-default-features", "--features", features])
        .args(["--edges", "normal"])
        .args(["--prefix", "none", "--format", "{p}"])
        .output()
        .unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{features}: {stderr}");
    let lines = String::from_utf8(output.stdout).unwrap();
    let names = lines.lines().filter_map(|line| line.split(' ').next());
    names.map(String::from).collect()
}

#[test]
fn no_features_brings_no_format_plot_or_terminal_dependency() {
    let own = dependencies("");
    let optional = OPTIONAL.iter().map(|(name, _)| *name);
    for name in optional.chain(NEVER) {
        assert!(!own.contains(name), "{name} in {own:?}");
    }
    assert!(own.contains("subaperture-focus") && own.contains("rustfft"));
}

#[test]
fn feature_brings_documented_dependencies() {
    for feature in FEATURES {
        let found = dependencies(feature);
        for (name, features) in OPTIONAL {
            let expected = features.contains(&feature);
            assert_eq!(found.contains(name), expected, "{feature}: {name}");
        }
        assert!(NEVER.iter().all(|name| !found.contains(*name)), "{feature}");
    }
}

#[test]
fn all_features_together_bring_no_other_dependencies() {
    // Excluded: the page enables a server, a USRP's driver has another licence, and a GPU needs a driver.
    let each = FEATURES
        .iter()
        .filter(|name| !["viewer", "uhd", "gpu"].contains(name));
    let union: BTreeSet<String> = each.copied().flat_map(dependencies).collect();
    assert_eq!(dependencies("full"), union);
}

/// Documented and declared features are the same.
#[test]
fn every_feature_is_documented() {
    let read = |path| std::fs::read_to_string(subaperture_xtask::root().join(path)).unwrap();
    let manifest = read("host/subaperture/Cargo.toml");
    let documentation = read("host/subaperture/src/lib.rs");
    let (_, declared) = manifest.split_once("[features]\n").unwrap();
    let (declared, _) = declared.split_once("\n\n[").unwrap();
    let declared = declared.lines().filter_map(|line| line.split_once(" = "));
    let declared: BTreeSet<_> = declared.map(|(name, _)| name).collect();
    let known = BTreeSet::from(FEATURES);
    assert_eq!(declared, &known | &BTreeSet::from(["default", "full"]));
    for name in FEATURES {
        let cell = format!("| `{name}` |");
        assert!(documentation.contains(&cell), "no cell {cell}");
    }
}
