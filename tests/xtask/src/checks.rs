//! Checks other than tests: format, lints, documentation, dependencies.

use std::path::PathBuf;
use std::process::{Command, Stdio};

use subaperture_xtask::firmware::{self, TARGET};
use subaperture_xtask::{root, target_folder};

use crate::prerequisites::{Need, OLDEST_RUST, OTHER_PLATFORMS, cargo_deny, toolchain_installed};
use crate::runner::Runner;

/// The firmware's package and its target.
const FIRMWARE: [&str; 4] = ["--package", "subaperture-firmware", "--target", TARGET];

/// Features of the firmware's lints: both boards, and every feature with at least one of them.
const CLIPPY: [(&str, &str); 4] = [
    ("clippy, firmware", "board-an500,no-panic"),
    (
        "clippy, firmware, fixed, small, Ethernet",
        "board-an500,fixed,size-small,ethernet",
    ),
    (
        "clippy, firmware, STM32H743, large, USB, front end",
        "board-h743,size-large,usb,spi-front-end",
    ),
    (
        "clippy, firmware, STM32H743, fixed, no log, 12 Mbaud",
        "board-h743,fixed,no-log,serial-12m",
    ),
];

/// The core with each set of features that no other set implies. The users in this workspace enable all features and never build these.
const CORE: [(&str, &str); 8] = [
    ("clippy, core, the Keystone alone", ""),
    ("clippy, core, stream", "stream"),
    ("clippy, core, fixed", "fixed"),
    ("clippy, core, link", "link"),
    ("clippy, core, selftest", "selftest"),
    ("clippy, core, motion, selftest", "motion,selftest"),
    ("clippy, core, stream, selftest", "stream,selftest"),
    ("clippy, core, fixed, selftest", "fixed,selftest"),
];

/// The library with sets of features in which each feature occurs without every other one that it does not bring. The command enables all
/// and never builds these.
const LIBRARY: [&str; 8] = [
    "",
    "cphd,hdf5,maps,planner,plot,sicd,uhd",
    "cphd,gmti,gotcha,gpu,link,maps,navigation,planner,sicd,terrain",
    "autofocus,cphd,gpu,link,maps,plot,viewer",
    "gmti,interferometry,navigation,terrain,uhd,viewer",
    "autofocus,gpu,interferometry,maps,navigation,npz,planner,plot,sicd",
    "autofocus,gotcha,hdf5,interferometry,link,planner,simulate,terrain",
    "cphd,gmti,gotcha,gpu,hdf5,interferometry,motion,plot,sicd",
];

/// Features that need UHD.
pub(crate) const UHD: &str = "subaperture-uhd-stand-in/uhd,subap/uhd";

/// Feature of the command's tests with a GPU, which build the command.
pub(crate) const GPU: &str = "subaperture-gpu/command";

/// Packages that are not published.
const OURS_ALONE: [&str; 12] = [
    "--exclude",
    "subaperture-python",
    "--exclude",
    "subaperture-firmware",
    "--exclude",
    "subaperture-tests",
    "--exclude",
    "subaperture-fuzz",
    "--exclude",
    "subaperture-uhd-stand-in",
    "--exclude",
    "subaperture-xtask",
];

const DOC: [(&str, &str); 2] = [
    (
        "documentation, firmware",
        "board-an500,fixed,defmt,ethernet",
    ),
    ("documentation, firmware, STM32H743", "board-h743"),
];

/// The running cargo with `arguments`.
pub(crate) fn cargo(arguments: &[&str]) -> Command {
    let mut command = subaperture_xtask::cargo();
    command.args(arguments);
    command
}

pub(crate) fn fmt(runner: &mut Runner) {
    runner.check("format", &mut cargo(&["fmt", "--all", "--check"]));
}

pub(crate) fn clippy_host(runner: &mut Runner) {
    runner.check(
        "clippy, host",
        cargo(&["clippy", "--workspace", "--exclude", "subaperture-firmware"]).args([
            "--all-targets",
            // Without the fuzzer itself, which needs a C++ compiler.
            "--features",
            "subaperture-fuzz/programs",
            "--locked",
            "--",
            "-D",
            "warnings",
        ]),
    );
}

/// The radio's binding to UHD, and the stand-in for UHD in its tests.
pub(crate) fn clippy_uhd(runner: &mut Runner) {
    let mut command = cargo(&["clippy", "--workspace", "--exclude", "subaperture-firmware"]);
    let features = format!("{UHD},subap/gpu");
    command.args(["--bin", "subap", "--test", "uhd", "--test", "radio"]);
    command.args(["--features", &features, "--locked"]);
    runner.check(
        "clippy, radio and command by UHD and GPU",
        command.args(["--", "-D", "warnings"]),
    );
    let mut command = cargo(&["doc", "--package", "subaperture-radio", "--no-deps"]);
    command.args(["--features", "uhd", "--locked"]);
    runner.check(
        "documentation, radio by UHD",
        command.env("RUSTDOCFLAGS", "-D warnings"),
    );
}

pub(crate) fn clippy_core(runner: &mut Runner) {
    for (name, features) in CORE {
        runner.check(
            name,
            cargo(&["clippy", "--package", "subaperture-core", "--locked"])
                .args(["--no-default-features", "--features", features])
                .args(["--", "-D", "warnings"]),
        );
    }
}

pub(crate) fn clippy_library(runner: &mut Runner) {
    for features in LIBRARY {
        runner.check(
            "clippy, library, some features",
            cargo(&["clippy", "--package", "subaperture", "--locked"])
                .args(["--lib", "--examples"])
                .args(["--no-default-features", "--features", features])
                .args(["--", "-D", "warnings"]),
        );
    }
}

/// Compile every published package with the oldest supported Rust, if it is installed.
pub(crate) fn oldest_rust(runner: &mut Runner) {
    let name = "the oldest Rust";
    if !toolchain_installed(OLDEST_RUST) {
        let why = "rustup has no such toolchain and could not get it";
        return runner.skip(name, &format!("{why}: {OLDEST_RUST}"));
    }
    let mut command = Command::new("rustup");
    command
        .args(["run", OLDEST_RUST, "cargo", "check", "--locked"])
        .args(["--package", "subaperture", "--package", "subap"])
        .args([
            "--package",
            "subaperture-wasm",
            "--package",
            "subaperture-gpu",
        ])
        .args(["--all-features", "--target-dir"])
        .arg(target_folder().join("oldest-rust"))
        .env_remove("CARGO")
        .current_dir(root());
    runner.check(name, &mut command);
}

/// Target folder of builds for other platforms, which share macros and build scripts.
pub(crate) fn other_platforms() -> PathBuf {
    target_folder().join("platforms")
}

/// Check library and command for the platforms that no test runs on. The feature `uhd` is left out: it links a C library.
pub(crate) fn platforms(runner: &mut Runner) {
    for (name, need) in ["Windows", "macOS"].into_iter().zip(OTHER_PLATFORMS) {
        let Need::Target(target) = need else {
            continue;
        };
        if !need.is_met() {
            runner.skip(name, &format!("run: rustup target add {target}"));
            continue;
        }
        let mut command = cargo(&["check", "--locked", "--target", target]);
        command
            .args(["--package", "subaperture", "--package", "subap"])
            .args(["--features", "subaperture/full", "--target-dir"])
            .arg(other_platforms());
        runner.check(name, &mut command);
    }
}

/// Check that every published package can be packed. Packages are not compiled again.
pub(crate) fn packages(runner: &mut Runner) {
    runner.check(
        "packages",
        cargo(&["package", "--workspace"]).args(OURS_ALONE).args([
            "--no-verify",
            "--allow-dirty",
            "--offline",
        ]),
    );
}

/// Build the firmware that the tests run.
pub(crate) fn build_firmware(runner: &mut Runner) {
    runner.work("firmware, all programs", firmware::build_all);
}

pub(crate) fn clippy_firmware(runner: &mut Runner) {
    for (name, features) in CLIPPY {
        runner.check(
            name,
            cargo(&["clippy", "--locked"])
                .args(FIRMWARE)
                .args(["--bins", "--lib", "--examples"])
                .args(["--no-default-features", "--features", features])
                .args(["--", "-D", "warnings"]),
        );
    }
}

pub(crate) fn doc_host(runner: &mut Runner) {
    // Links to items of a feature. First, so that `target/doc` finally contains all features.
    for (name, package, features) in [
        (
            "documentation, core, the Keystone alone",
            "subaperture-core",
            "",
        ),
        ("documentation, core, stream", "subaperture-core", "stream"),
        ("documentation, library without features", "subaperture", ""),
    ] {
        runner.check(
            name,
            cargo(&["doc", "--package", package, "--no-deps"])
                .args(["--no-default-features", "--features", features])
                .arg("--locked")
                .env("RUSTDOCFLAGS", "-D warnings"),
        );
    }
    runner.check(
        "documentation",
        cargo(&["doc", "--workspace", "--exclude", "subaperture-firmware"])
            .args(["--no-deps", "--locked"])
            .env("RUSTDOCFLAGS", "-D warnings"),
    );
}

pub(crate) fn doc_firmware(runner: &mut Runner) {
    for (name, features) in DOC {
        runner.check(
            name,
            cargo(&["doc", "--no-deps", "--locked", "--lib"])
                .args(FIRMWARE)
                .args(["--no-default-features", "--features", features])
                .env("RUSTDOCFLAGS", "-D warnings"),
        );
    }
}

/// Instruction sets supported by Miri: machine, processor features, and tests left out. Miri does not support the look-up instructions of
/// NEON and AVX-512, nor AVX-512's permutations. These work on registers only, and the same test compares their results with plain Rust on
/// a real processor.
const MIRI: [(&str, &str, &str, &[&str]); 3] = [
    (
        "Miri, AVX2",
        "x86_64-unknown-linux-gnu",
        "-C target-feature=+avx2,+fma",
        &[],
    ),
    (
        "Miri, AVX-512",
        "x86_64-unknown-linux-gnu",
        "-C target-feature=+avx2,+fma,+avx512f,+avx512bw,+avx512dq,+avx512vl",
        &["--skip", "numbers_are_moved"],
    ),
    (
        "Miri, NEON",
        "aarch64-unknown-linux-gnu",
        "",
        &["--skip", "numbers_are_moved"],
    ),
];

/// Run all `unsafe` code outside the firmware under Miri: each operation of the kernels' lanes. Started by hand, because it builds
/// its own standard library and is slow.
pub(crate) fn miri(runner: &mut Runner) {
    for (name, target, flags, left_out) in MIRI {
        let mut command = Command::new("rustup");
        command
            .args(["run", "nightly", "cargo", "miri", "test"])
            .args(["--package", "subaperture-kernels", "--lib"])
            .args(["--target", target, "--target-dir"])
            .arg(target_folder().join("miri"))
            .args(["--", "lanes::"])
            .args(left_out)
            .env("RUSTFLAGS", flags)
            .env_remove("CARGO")
            .current_dir(root());
        runner.check(name, &mut command);
    }
}

/// Run all tests of the kernels, in all instruction sets of this processor, under AddressSanitizer, which stops at reads and writes outside
/// of allocations. Started by hand, like Miri.
pub(crate) fn address_sanitizer(runner: &mut Runner) {
    let target = "x86_64-unknown-linux-gnu";
    if !cfg!(all(target_arch = "x86_64", target_os = "linux")) {
        runner.skip("AddressSanitizer, kernels", "it is run on x86-64 Linux");
        return;
    }
    let mut command = Command::new("rustup");
    command
        .args(["run", "nightly", "cargo", "test"])
        .args(["--package", "subaperture-kernels", "--lib", "--tests"])
        .args(["--target", target, "--target-dir"])
        .arg(target_folder().join("sanitizer"))
        // Examples in documentation would need the flag separately, and call no function that the tests do not.
        .env("RUSTFLAGS", "-Zsanitizer=address")
        .env_remove("CARGO")
        .current_dir(root());
    runner.check("AddressSanitizer, kernels", &mut command);
}

pub(crate) fn deny(runner: &mut Runner) {
    // Started by its own name it takes no word "deny".
    let deny = |checks: &[&str]| {
        let mut command = Command::new(cargo_deny().unwrap_or_else(|| "cargo-deny".into()));
        command.arg("check").args(checks).current_dir(root());
        command
    };
    runner.check(
        "dependencies: bans, licences, sources",
        &mut deny(&["bans", "licenses", "sources"]),
    );
    let name = "dependencies: advisories";
    if advisories_reachable() {
        runner.check(name, &mut deny(&["advisories"]));
    } else {
        runner.skip(name, "the RustSec database on github.com cannot be reached");
    }
}

/// Whether the advisory database can be fetched: without a network the check would fail for reasons other than our dependencies.
fn advisories_reachable() -> bool {
    Command::new("git")
        .args(["ls-remote", "--exit-code"])
        .args(["https://github.com/RustSec/advisory-db", "HEAD"])
        .env("GIT_TERMINAL_PROMPT", "0")
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|status| status.success())
}

#[cfg(test)]
mod tests {
    use std::collections::{BTreeMap, BTreeSet};

    use super::*;

    /// Features of the library, each with those that it enables.
    fn features() -> BTreeMap<String, Vec<String>> {
        let manifest = std::fs::read_to_string(root().join("host/subaperture/Cargo.toml")).unwrap();
        let lines = manifest.lines().skip_while(|line| *line != "[features]");
        let lines = lines.skip(1).take_while(|line| line.contains('='));
        lines
            .map(|line| {
                let (name, brings) = line.split_once(" = ").unwrap();
                let brings = brings.trim_matches(['[', ']']).split(", ");
                let brings = brings.map(|word| word.trim_matches('"').to_owned());
                (name.to_owned(), brings.collect())
            })
            .collect()
    }

    /// Features with all that they enable.
    fn with_brought<'a>(
        names: &[&'a str],
        all: &'a BTreeMap<String, Vec<String>>,
    ) -> BTreeSet<&'a str> {
        let mut found = BTreeSet::new();
        let mut left = names.to_vec();
        while let Some(name) = left.pop() {
            if let Some(brings) = all.get(name)
                && found.insert(name)
            {
                left.extend(brings.iter().map(String::as_str));
            }
        }
        found
    }

    #[test]
    fn every_feature_is_checked_without_every_other() {
        let all = features();
        let sets = LIBRARY.map(|set| with_brought(&set.split(',').collect::<Vec<_>>(), &all));
        let single: Vec<&str> = all
            .keys()
            .map(String::as_str)
            .filter(|name| !["default", "full"].contains(name))
            .collect();
        assert!(single.len() > 8 && sets[0].is_empty(), "{single:?}");
        for &one in &single {
            let brought = with_brought(&[one], &all);
            for other in single.iter().filter(|other| !brought.contains(*other)) {
                let seen = sets
                    .iter()
                    .any(|set| set.contains(one) && !set.contains(other));
                assert!(seen, "{one} without {other}");
            }
        }
    }
}
