//! Description of the machine.

use std::fs;
use std::process::Command;

use subaperture::focus::{instructions, machine};

/// Processor, instruction sets, memory and the build of the program, in a line or two of Markdown.
pub(crate) fn described() -> String {
    let processor = fs::read_to_string("/proc/cpuinfo").ok().and_then(|text| {
        let line = text.lines().find(|line| line.starts_with("model name"))?;
        Some(line.split_once(':')?.1.trim().to_owned())
    });
    let family = fs::read_to_string("/proc/cpuinfo").ok().and_then(|text| {
        let number = |label: &str| {
            let line = text
                .lines()
                .find(|line| line.split('\t').next() == Some(label))?;
            Some(line.split_once(':')?.1.trim().to_owned())
        };
        Some(format!(
            "family {}, model {}",
            number("cpu family")?,
            number("model")?
        ))
    });
    let processor = processor.unwrap_or_else(|| std::env::consts::ARCH.to_owned());
    let family = family.map_or_else(String::new, |family| format!(" ({family})"));
    let count = std::thread::available_parallelism().map_or(1, usize::from);
    format!(
        "Machine: {processor}{family}, {count} logical processors, {}, {} GiB of memory, {}.\nRevision {}.",
        instructions(),
        machine::memory_bytes(count) >> 30,
        std::env::consts::OS,
        revision(),
    )
}

/// The checked-out revision, and whether files differ from it.
fn revision() -> String {
    let git = |arguments: &[&str]| {
        let mut command = Command::new("git");
        let output = command
            .current_dir(subaperture_xtask::root())
            .args(arguments)
            .output()
            .ok()?;
        output
            .status
            .success()
            .then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    let commit = git(&["rev-parse", "--short", "HEAD"]);
    let changed = git(&["status", "--porcelain", "--untracked-files=no"]);
    match (commit, changed) {
        (Some(commit), Some(changed)) if changed.is_empty() => commit,
        (Some(commit), _) => format!("{commit}, changed"),
        (None, _) => "unknown".to_owned(),
    }
}

/// Load by other work, where the system reports it: mean number of processes that wait for a processor.
pub(crate) fn load() -> Option<f64> {
    let text = fs::read_to_string("/proc/loadavg").ok()?;
    text.split_whitespace().next()?.parse().ok()
}
