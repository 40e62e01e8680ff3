//! Checks of a finished archive: its files, and `subap demo`, in a root folder that has nothing else or under emulation.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use super::{DOCUMENTS, LICENCES, SHELLS, at, create, run};
use crate::guide::subcommands;

/// Commands that change the root folder, in order of preference: as root, then in a user namespace.
const CHANGE_ROOT: [&[&str]; 2] = [&["chroot"], &["unshare", "-r", "chroot"]];

/// Exit status of `chroot` if the system refuses it.
const REFUSED: i32 = 125;

/// Pixels of the demo under emulation, which is many times slower: few.
const EMULATED_GRID: &str = "x=-5:5:0.5,y=-5:5:0.5";

/// An archive unpacked in a folder of its own, which is removed when dropped.
pub(super) struct Unpacked {
    root: PathBuf,
}

impl Unpacked {
    /// Unpack `archive` into the new folder `root`.
    pub(super) fn new(archive: &Path, root: PathBuf) -> Result<Self, String> {
        create(&root)?;
        let unpacked = Self { root };
        let mut tar = Command::new("tar");
        tar.arg("-xzf").arg(archive).arg("--strip-components=1");
        run(tar.arg("-C").arg(&unpacked.root))?;
        Ok(unpacked)
    }

    /// Check that the archive has a man page of every command, completions, documents and licences. Returns the number of man pages.
    pub(super) fn check_files(&self, native: &Path) -> Result<usize, String> {
        let pages = pages(native, &[])?;
        let man = pages.iter().map(|page| (format!("man/man1/{page}"), ".TH"));
        let scripts = SHELLS.map(|(_, file)| (format!("completions/{file}"), "subap"));
        let documents = DOCUMENTS.map(|name| (name.to_owned(), "\n"));
        let licences = [(LICENCES.to_owned(), "Apache License")];
        for (name, part) in man.chain(scripts).chain(documents).chain(licences) {
            let path = self.root.join(&name);
            let text = fs::read_to_string(&path).map_err(|error| at(&path, &error))?;
            if !text.contains(part) {
                return Err(format!("{name} in the archive: expected '{part}' in it"));
            }
        }
        Ok(pages.len())
    }

    /// Run `subap demo` with the archive's files as the whole file system and an empty environment. Returns its output, or `None` where this
    /// user may not change the root folder.
    pub(super) fn demo(&self) -> Result<Option<String>, String> {
        let Some(before) = self.change_root()? else {
            return Ok(None);
        };
        self.checked_demo(self.command(before, &["demo"])).map(Some)
    }

    /// Run `subap demo` of an AArch64 archive on few pixels under `qemu-aarch64`, with an empty environment. Returns its output.
    pub(super) fn demo_emulated(&self) -> Result<String, String> {
        let mut command = Command::new("qemu-aarch64");
        command.arg(self.root.join("subap"));
        command.args(["demo", "--grid", EMULATED_GRID]);
        command.current_dir(&self.root);
        self.checked_demo(bare(&mut command).output())
    }

    /// Check the exit status of `subap demo` and its overview in the root folder. Returns its standard output.
    fn checked_demo(&self, output: std::io::Result<Output>) -> Result<String, String> {
        let output = output.map_err(|error| format!("subap demo: {error}"))?;
        let overview = self.root.join("subap-demo/overview.png");
        if !output.status.success() || !overview.is_file() {
            let stderr = String::from_utf8_lossy(&output.stderr);
            return Err(format!(
                "subap demo of the archive: {}, overview.png {}: {stderr}",
                output.status,
                if overview.is_file() {
                    "written"
                } else {
                    "missing"
                }
            ));
        }
        Ok(String::from_utf8_lossy(&output.stdout).into_owned())
    }

    /// The first command that changes the root folder and starts `subap` there.
    fn change_root(&self) -> Result<Option<&'static [&'static str]>, String> {
        for before in CHANGE_ROOT {
            // The system may lack the command.
            let Ok(output) = self.command(before, &["--version"]) else {
                continue;
            };
            let stderr = String::from_utf8_lossy(&output.stderr);
            if output.status.success() {
                return Ok(Some(before));
            }
            if output.status.code() != Some(REFUSED) && !stderr.starts_with("unshare:") {
                return Err(format!(
                    "subap with the archive as root folder: {}: {stderr}",
                    output.status
                ));
            }
        }
        Ok(None)
    }

    fn command(&self, before: &[&str], arguments: &[&str]) -> std::io::Result<Output> {
        let mut command = Command::new(before[0]);
        command.args(&before[1..]).arg(&self.root).arg("/subap");
        bare(command.args(arguments)).output()
    }
}

/// Give the command an empty environment, except for the folders of chroot, unshare and qemu-aarch64, which the archive lacks.
fn bare(command: &mut Command) -> &mut Command {
    command
        .env_clear()
        .env("PATH", "/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin")
}

impl Drop for Unpacked {
    fn drop(&mut self) {
        // If this fails, the folder remains next to the archives.
        let _ = fs::remove_dir_all(&self.root);
    }
}

/// File names of the man pages of a command and of all below it, by their help.
fn pages(program: &Path, words: &[&str]) -> Result<Vec<String>, String> {
    let name = [&["subap"], words].concat().join("-");
    let help = run(Command::new(program).args(words).arg("--help"))?;
    let mut all = vec![format!("{name}.1")];
    for command in subcommands(&String::from_utf8_lossy(&help)) {
        all.extend(pages(program, &[words, &[command]].concat())?);
    }
    Ok(all)
}
