//! Release archives: `cargo xtask dist` writes one `.tar.gz` for each target, and their SHA-256 sums, to `target/dist`.
//!
//! An archive holds the static command, man pages, shell completions, licences (those of every dependency included), README and CHANGELOG. Man
//! pages and completions are written by the command itself, by the build for this machine's processor. Finished archives are unpacked and checked,
//! and `subap demo` runs in the one for this machine, without any other file, and in the one for AArch64 on few pixels under
//! `qemu-aarch64`, which is installed if possible.

mod check;

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;
use subaperture_xtask::{link_alone, root, target_folder};

use crate::checks::cargo;
use crate::guide::subcommands;
use crate::prerequisites::{Need, Talk, ensure, ensure_if_possible};
use check::Unpacked;

/// Static Linux builds, linked by Rust's own linker and musl: no cross toolchain is needed.
const TARGETS: [&str; 2] = ["x86_64-unknown-linux-musl", "aarch64-unknown-linux-musl"];

const SHELLS: [(&str, &str); 3] = [
    ("bash", "subap.bash"),
    ("zsh", "_subap"),
    ("fish", "subap.fish"),
];

/// Copied from the repository's root.
pub(crate) const DOCUMENTS: [&str; 5] = [
    "README.md",
    "CHANGELOG.md",
    "LICENSE-MIT",
    "LICENSE-APACHE",
    "LICENSE-FONTS",
];

/// Licences of the dependencies.
pub(crate) const LICENCES: &str = "LICENSES-DEPENDENCIES.txt";

/// Build and check every archive.
///
/// # Errors
/// The command that failed, or the file that could not be written.
pub(crate) fn build() -> Result<(), String> {
    let targets = TARGETS.map(Need::Target);
    ensure(&targets, Talk::Shown)?;
    ensure_if_possible(&[Need::QemuUser], Talk::OfFailure);
    let place = target_folder().join("dist");
    if place.exists() {
        fs::remove_dir_all(&place).map_err(|error| at(&place, &error))?;
    }
    create(&place)?;
    let metadata = metadata()?;
    let version = version(&metadata)?;
    let mut builds = Vec::new();
    for target in TARGETS {
        builds.push((target, compile(target)?));
    }
    let arch = std::env::consts::ARCH;
    let native = builds.iter().find(|(target, _)| target.starts_with(arch));
    let (_, native) = native.ok_or(format!(
        "man pages need a build for {arch}: it is not among {TARGETS:?}"
    ))?;
    let mut archives = Vec::new();
    for (target, program) in &builds {
        let name = format!("subaperture-{version}-{target}");
        let folder = place.join(&name);
        create(&folder)?;
        copy(program, &folder.join("subap"))?;
        for document in DOCUMENTS {
            copy(&root().join(document), &folder.join(document))?;
        }
        let licences = third_party_licences(&metadata, "subap", target)?;
        write(&folder.join(LICENCES), licences.as_bytes())?;
        let man = folder.join("man/man1");
        create(&man)?;
        man_pages(native, &[], &man)?;
        let completions = folder.join("completions");
        create(&completions)?;
        for (shell, file) in SHELLS {
            let script = run(Command::new(native).args(["completions", shell]))?;
            write(&completions.join(file), &script)?;
        }
        let archive = format!("{name}.tar.gz");
        let mut tar = Command::new("tar");
        tar.args([
            "--sort=name",
            "--owner=0",
            "--group=0",
            "--numeric-owner",
            "-czf",
        ]);
        run(tar.args([&archive, &name]).current_dir(&place))?;
        let is_native = program == native;
        check(&place, &archive, native, is_native)?;
        archives.push(archive);
    }
    let sums = run(Command::new("sha256sum")
        .args(&archives)
        .current_dir(&place))?;
    write(&place.join("SHA256SUMS"), &sums)?;
    for archive in archives {
        println!("{}", place.join(archive).display());
    }
    Ok(())
}

/// Unpack an archive in `place` and check it; `native` is the program for this machine.
fn check(place: &Path, archive: &str, native: &Path, is_native: bool) -> Result<(), String> {
    let unpacked = Unpacked::new(&place.join(archive), place.join("root"))?;
    let pages = unpacked.check_files(native)?;
    println!("{archive}: {pages} man pages, completions, documents and licences are complete");
    if !is_native {
        match Need::QemuUser.is_met() {
            true => println!(
                "{archive}: subap demo on few pixels under qemu-aarch64:\n{}",
                unpacked.demo_emulated()?
            ),
            false => println!("{archive}: subap demo SKIPPED: qemu-aarch64 is not installed"),
        }
        return Ok(());
    }
    match unpacked.demo()? {
        Some(output) => println!("{archive}: subap demo without any other file:\n{output}"),
        None => println!(
            "{archive}: subap demo SKIPPED: this user may change the root folder neither with chroot nor with unshare -r"
        ),
    }
    Ok(())
}

/// Write the man page of the command with these words, and those of its subcommands.
fn man_pages(program: &Path, words: &[&str], folder: &Path) -> Result<(), String> {
    let page = run(Command::new(program).arg("man").args(words))?;
    let name = [&["subap"], words].concat().join("-");
    write(&folder.join(format!("{name}.1")), &page)?;
    let help = run(Command::new(program).args(words).arg("--help"))?;
    for command in subcommands(&String::from_utf8_lossy(&help)) {
        man_pages(program, &[words, &[command]].concat(), folder)?;
    }
    Ok(())
}

/// Compile the command for `target` without debug information.
fn compile(target: &str) -> Result<PathBuf, String> {
    let mut command = cargo(&["build", "--release", "--locked", "--package", "subap"]);
    command
        .args(["--target", target, "--target-dir"])
        .arg(target_folder())
        .env("CARGO_PROFILE_RELEASE_DEBUG", "none")
        .env("CARGO_PROFILE_RELEASE_STRIP", "symbols");
    link_alone(&mut command, target);
    let status = command
        .status()
        .map_err(|error| format!("cargo: {error}"))?;
    if !status.success() {
        return Err(format!("subap does not build for {target}"));
    }
    Ok(target_folder().join(target).join("release/subap"))
}

fn metadata() -> Result<Value, String> {
    let output = run(&mut cargo(&[
        "metadata",
        "--format-version",
        "1",
        "--locked",
    ]))?;
    serde_json::from_slice(&output).map_err(|error| format!("cargo metadata: {error}"))
}

fn version(metadata: &Value) -> Result<String, String> {
    let subap =
        package(metadata, |p| p["name"] == "subap").ok_or("cargo metadata lists no subap")?;
    Ok(text(&subap["version"]).to_owned())
}

/// Licences of the packages that a build of `of` for `target` links.
///
/// # Errors
/// The command that failed, or the file that could not be read.
pub(crate) fn licences(of: &str, target: &str) -> Result<String, String> {
    third_party_licences(&metadata()?, of, target)
}

/// Name, version, licence expression and licence files of each package that the build of `of` for `target` links.
fn third_party_licences(metadata: &Value, of: &str, target: &str) -> Result<String, String> {
    let mut tree = cargo(&["tree", "--locked", "--package", of, "--target", target]);
    tree.args(["--edges", "normal", "--prefix", "none", "--format", "{p}"]);
    let tree = run(&mut tree)?;
    let tree = String::from_utf8_lossy(&tree);
    let mut packages = BTreeSet::new();
    for line in tree.lines() {
        let mut words = line.split(' ');
        if let (Some(name), Some(version)) = (words.next(), words.next())
            && !name.starts_with("suba")
        {
            packages.insert((name, version.trim_start_matches('v')));
        }
    }
    let mut licences = format!("Licences of the packages that {of} is linked with\n");
    for (name, version) in packages {
        let found = package(metadata, |p| p["name"] == name && p["version"] == version);
        let found = found.ok_or_else(|| format!("cargo metadata lists no {name} {version}"))?;
        let rule = "=".repeat(80);
        let _ = writeln!(
            licences,
            "\n{rule}\n{name} {version}: {}",
            text(&found["license"])
        );
        let folder = Path::new(text(&found["manifest_path"])).parent();
        for file in licence_files(folder.ok_or("a manifest lies in a folder")?)? {
            let words = fs::read(&file).map_err(|error| at(&file, &error))?;
            let _ = writeln!(licences, "\n{}", String::from_utf8_lossy(&words).trim());
        }
    }
    Ok(licences)
}

fn licence_files(folder: &Path) -> Result<Vec<PathBuf>, String> {
    let entries = fs::read_dir(folder).map_err(|error| at(folder, &error))?;
    let mut files: Vec<PathBuf> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            let name = name.to_uppercase();
            let known = ["LICENSE", "LICENCE", "COPYING", "COPYRIGHT", "NOTICE"];
            path.is_file() && known.iter().any(|known| name.starts_with(known))
        })
        .collect();
    files.sort();
    Ok(files)
}

fn package(metadata: &Value, is_wanted: impl Fn(&Value) -> bool) -> Option<&Value> {
    metadata["packages"]
        .as_array()?
        .iter()
        .find(|p| is_wanted(p))
}

fn text(value: &Value) -> &str {
    value.as_str().unwrap_or("not stated")
}

/// Standard output of a command that must succeed.
fn run(command: &mut Command) -> Result<Vec<u8>, String> {
    let output = command
        .output()
        .map_err(|error| format!("cannot start {command:?}: {error}"))?;
    if output.status.success() {
        Ok(output.stdout)
    } else {
        let stderr = String::from_utf8_lossy(&output.stderr);
        Err(format!("{command:?} failed: {}", stderr.trim()))
    }
}

fn create(folder: &Path) -> Result<(), String> {
    fs::create_dir_all(folder).map_err(|error| at(folder, &error))
}

fn copy(from: &Path, to: &Path) -> Result<(), String> {
    fs::copy(from, to).map_err(|error| at(from, &error))?;
    Ok(())
}

fn write(path: &Path, bytes: &[u8]) -> Result<(), String> {
    fs::write(path, bytes).map_err(|error| at(path, &error))
}

fn at(path: &Path, error: &std::io::Error) -> String {
    format!("{}: {error}", path.display())
}
