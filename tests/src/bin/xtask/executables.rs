//! The test executables that cargo builds, run several at once.
//!
//! `cargo test` runs one after the other; many of ours wait for one emulated processor or one child process, so
//! that half of a machine's processors would stand idle. Those known to take longest begin first.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;

use serde_json::Value;

/// Begin first, longest first: whatever starts late and takes long is waited for alone.
const LONGEST: [&str; 12] = [
    "golden",
    "random_formers",
    "cli_link",
    "link_gotcha",
    "firmware",
    "module_budgets",
    "fuzz_targets",
    "cli_bad_input",
    "cli_memory",
    "link_emulated",
    "more_formers",
    "formers",
];

/// A test executable.
#[derive(Clone, Debug)]
pub(crate) struct Executable {
    /// Its target's name.
    name: String,
    path: PathBuf,
    /// Its package's folder, where cargo would start it.
    folder: PathBuf,
}

/// What one executable printed, and whether it succeeded.
pub(crate) struct Run {
    pub(crate) name: String,
    pub(crate) output: String,
    pub(crate) succeeded: bool,
}

/// Builds with `cargo test --no-run` and the like, whose messages are asked for as JSON.
///
/// # Errors
/// What cargo said last, if it fails.
pub(crate) fn build(command: &mut Command) -> Result<Vec<Executable>, String> {
    let mut child = command
        .stdout(Stdio::piped())
        .spawn()
        .map_err(|error| format!("cannot start cargo: {error}"))?;
    let output = child.stdout.take().expect("stdout is piped");
    let mut found = Vec::new();
    for line in BufReader::new(output).lines().map_while(Result::ok) {
        let Ok(message) = serde_json::from_str::<Value>(&line) else {
            println!("{line}");
            continue;
        };
        found.extend(executable(&message));
    }
    match child.wait() {
        Ok(status) if status.success() => Ok(found),
        _ => Err("the tests do not build".to_owned()),
    }
}

/// The test executable that a message of cargo's tells of.
fn executable(message: &Value) -> Option<Executable> {
    let is_test = message["profile"]["test"] == true;
    let path = message["executable"].as_str().filter(|_| is_test)?;
    let manifest = Path::new(message["manifest_path"].as_str()?);
    Some(Executable {
        name: message["target"]["name"].as_str()?.to_owned(),
        path: path.into(),
        folder: manifest.parent()?.to_owned(),
    })
}

/// Runs all, as many at once as there are processors; calls `done` with each as it ends, one at a time.
/// `prepare` may set what a command needs.
pub(crate) fn run_all(
    mut executables: Vec<Executable>,
    prepare: impl Fn(&mut Command) + Sync,
    done: impl FnMut(Run) + Send,
) {
    let rank = |name: &str| LONGEST.iter().position(|known| *known == name);
    executables.sort_by_key(|one| (rank(&one.name).unwrap_or(LONGEST.len()), one.name.clone()));
    let workers = std::thread::available_parallelism().map_or(1, usize::from);
    let waiting = Mutex::new(VecDeque::from(executables));
    let done = Mutex::new(done);
    std::thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|| {
                loop {
                    let next = waiting.lock().expect("no worker panics").pop_front();
                    let Some(one) = next else { break };
                    let run = run(&one, &prepare);
                    (done.lock().expect("no worker panics"))(run);
                }
            });
        }
    });
}

fn run(one: &Executable, prepare: &impl Fn(&mut Command)) -> Run {
    let mut command = Command::new(&one.path);
    command
        .current_dir(&one.folder)
        // Without it a test that passes cannot say what it skipped.
        .arg("--show-output")
        .stdin(Stdio::null());
    prepare(&mut command);
    let (output, succeeded) = match command.output() {
        Ok(done) => {
            let text = [done.stdout, done.stderr].concat();
            (
                String::from_utf8_lossy(&text).into_owned(),
                done.status.success(),
            )
        }
        Err(error) => (
            format!("cannot start {}: {error}\n", one.path.display()),
            false,
        ),
    };
    Run {
        name: one.name.clone(),
        output,
        succeeded,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn only_test_executables_are_run() {
        let artifact = |test: bool, executable: Value| {
            json!({
                "reason": "compiler-artifact",
                "manifest_path": "/w/tests/Cargo.toml",
                "target": { "name": "formers" },
                "profile": { "test": test },
                "executable": executable,
            })
        };
        let found = executable(&artifact(true, json!("/w/target/formers-1"))).unwrap();
        assert_eq!(
            (found.name.as_str(), found.folder.to_str()),
            ("formers", Some("/w/tests"))
        );
        assert!(executable(&artifact(false, json!("/w/target/subap"))).is_none());
        assert!(executable(&artifact(true, Value::Null)).is_none());
        assert!(executable(&json!({ "reason": "build-finished", "success": true })).is_none());
    }
}
