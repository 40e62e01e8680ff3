//! The test executables that cargo builds, run in parts, several at once.
//!
//! `cargo test` runs one after the other; many of ours wait for one emulated processor or one child process, so
//! that half of a machine's processors would stand idle. A ring of integration tests is long, and what it does differs from
//! module to module: each of its modules is a part, a process with those tests alone. Parts known to take longest begin first.

use std::collections::{BTreeMap, VecDeque};
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use serde_json::Value;

/// No part takes half of this on a slow machine: one that does waits for something that never comes.
const LIMIT: Duration = Duration::from_secs(1200);

/// How long the outputs of one that has ended are read on.
const PATIENCE: Duration = Duration::from_secs(2);

/// Begin first, longest first: whatever starts late and takes long is waited for alone.
const LONGEST: [&str; 18] = [
    "cli::tiles",
    "gallery",
    "recordings::tune_certainty",
    "cli::memory",
    "firmware::sessions",
    "cli::overwrite",
    "formers::random",
    "firmware::cli_link",
    "formers::pfa_ffbp",
    "firmware::budgets",
    "formers::sweep_motion",
    "firmware::gotcha",
    "formers::frequency_domain",
    "formers::backprojection",
    "damage::fuzz_targets",
    "firmware::golden",
    "firmware::selftest",
    "cli::messages",
];

/// A test executable.
#[derive(Clone, Debug)]
pub(crate) struct Executable {
    /// Name of the Cargo target.
    name: String,
    path: PathBuf,
    /// Its package's folder, where cargo would start it.
    folder: PathBuf,
    /// Whether it holds integration tests.
    is_ring: bool,
}

/// What one process runs.
#[derive(Clone, Debug)]
struct Part {
    /// The executable's name and that of the module.
    name: String,
    executable: Executable,
    /// The tests, by their full names; all if there are none.
    tests: Vec<String>,
}

/// What one part printed, and whether it succeeded.
pub(crate) struct Run {
    pub(crate) name: String,
    pub(crate) output: String,
    pub(crate) succeeded: bool,
    pub(crate) took: Duration,
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
        is_ring: message["target"]["kind"][0] == "test",
    })
}

/// The modules of a ring, or the whole of what is none or does not list its tests.
fn parts(executable: Executable) -> Vec<Part> {
    let mut list = command(&executable);
    list.args(["--list", "--format", "terse"]);
    let listed = match executable.is_ring.then(|| list.output()) {
        Some(Ok(output)) if output.status.success() => output.stdout,
        _ => Vec::new(),
    };
    split(executable, &String::from_utf8_lossy(&listed))
}

/// A part for each module of what the executable lists, a line such as `module::deeper::name: test` each; what stands in none is a
/// part too. The whole if nothing is listed.
fn split(executable: Executable, listed: &str) -> Vec<Part> {
    let mut modules = BTreeMap::<_, Vec<String>>::new();
    let names = listed
        .lines()
        .filter_map(|line| line.strip_suffix(": test"));
    for name in names {
        let module = name.split_once("::").map(|(module, _)| module.to_owned());
        modules.entry(module).or_default().push(name.to_owned());
    }
    if modules.is_empty() {
        modules.insert(None, Vec::new());
    }
    let part = |(module, tests): (Option<String>, _)| Part {
        name: match module {
            Some(module) => format!("{}::{module}", executable.name),
            None => executable.name.clone(),
        },
        executable: executable.clone(),
        tests,
    };
    modules.into_iter().map(part).collect()
}

/// An executable's command, started as cargo would.
fn command(executable: &Executable) -> Command {
    let mut command = Command::new(&executable.path);
    command.current_dir(&executable.folder).stdin(Stdio::null());
    command
}

/// Runs all, part by part, as many at once as there are processors; calls `done` with each part as it ends, one at a time.
/// `prepare` may set what a command needs.
pub(crate) fn run_all(
    executables: Vec<Executable>,
    prepare: impl Fn(&mut Command) + Sync,
    done: impl FnMut(Run) + Send,
) {
    let rank = |name: &str| LONGEST.iter().position(|known| *known == name);
    let mut all: Vec<Part> = executables.into_iter().flat_map(parts).collect();
    all.sort_by_key(|part| (rank(&part.name).unwrap_or(LONGEST.len()), part.name.clone()));
    let workers = std::thread::available_parallelism().map_or(1, usize::from);
    let waiting = Mutex::new(VecDeque::from(all));
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

fn run(one: &Part, prepare: &impl Fn(&mut Command)) -> Run {
    let mut command = command(&one.executable);
    // Without it a test that passes cannot say what it skipped.
    command.arg("--show-output");
    if !one.tests.is_empty() {
        command.arg("--exact").args(&one.tests);
    }
    prepare(&mut command);
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let start = Instant::now();
    let (output, succeeded) = match command.spawn() {
        Ok(child) => finish(child, LIMIT),
        Err(error) => (
            format!("cannot start {}: {error}\n", one.executable.path.display()),
            false,
        ),
    };
    Run {
        name: one.name.clone(),
        output,
        succeeded,
        took: start.elapsed(),
    }
}

/// What `child`, whose outputs are piped, prints, and whether it succeeds; one that takes longer than `limit` is killed.
fn finish(mut child: Child, limit: Duration) -> (String, bool) {
    let streams = [
        gather(child.stdout.take().expect("stdout is piped")),
        gather(child.stderr.take().expect("stderr is piped")),
    ];
    let status = wait(&mut child, limit);
    // All that it printed is read at once; what it started and left behind may hold the streams open for ever.
    let ended = Instant::now();
    while !streams.iter().all(|(_, reader)| reader.is_finished()) && ended.elapsed() < PATIENCE {
        std::thread::sleep(Duration::from_millis(5));
    }
    let bytes = streams.map(|(bytes, _)| bytes.lock().expect("no reader panics").clone());
    let mut text = String::from_utf8_lossy(&bytes.concat()).into_owned();
    if status.is_none() {
        text += &format!("\nkilled: not done after {} s\n", limit.as_secs());
    }
    (text, status.is_some_and(|status| status.success()))
}

/// Reads a stream to its end on a thread of its own.
fn gather(
    mut stream: impl Read + Send + 'static,
) -> (Arc<Mutex<Vec<u8>>>, std::thread::JoinHandle<()>) {
    let bytes = Arc::new(Mutex::new(Vec::new()));
    let shared = Arc::clone(&bytes);
    let reader = std::thread::spawn(move || {
        let mut part = [0; 1 << 14];
        while let Ok(count @ 1..) = stream.read(&mut part) {
            let mut bytes = shared.lock().expect("no reader panics");
            bytes.extend_from_slice(&part[..count]);
        }
    });
    (bytes, reader)
}

/// The child's status; `None` if it was killed at the limit.
fn wait(child: &mut Child, limit: Duration) -> Option<ExitStatus> {
    let start = Instant::now();
    while start.elapsed() < limit {
        if let Ok(Some(status)) = child.try_wait() {
            return Some(status);
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    let _ = child.kill();
    let _ = child.wait();
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn endless_programs_are_killed_and_reported() {
        let run = |line: &str, limit: Duration| {
            let mut command = Command::new("sh");
            let command = command.args(["-c", line]).stdin(Stdio::null());
            command.stdout(Stdio::piped()).stderr(Stdio::piped());
            finish(command.spawn().unwrap(), limit)
        };
        let (text, succeeded) = run("echo begun; sleep 60", Duration::from_millis(300));
        assert!(!succeeded && text.starts_with("begun\n") && text.contains("killed"));
        // Nor is what was left behind waited for.
        let (text, succeeded) = run("sleep 60 & echo begun", LIMIT);
        assert!(succeeded && text == "begun\n", "{text}");
        let (text, succeeded) = run("echo one; echo two >&2", LIMIT);
        assert!(succeeded && text == "one\ntwo\n", "{text}");
        assert!(!run("exit 3", LIMIT).1);
    }

    #[test]
    fn only_test_executables_are_run() {
        let artifact = |test: bool, executable: Value| {
            json!({
                "reason": "compiler-artifact",
                "manifest_path": "/w/tests/Cargo.toml",
                "target": { "name": "formers", "kind": ["test"] },
                "profile": { "test": test },
                "executable": executable,
            })
        };
        let found = executable(&artifact(true, json!("/w/target/formers-1"))).unwrap();
        assert_eq!(
            (found.name.as_str(), found.folder.to_str()),
            ("formers", Some("/w/tests"))
        );
        assert!(found.is_ring);
        assert!(executable(&artifact(false, json!("/w/target/subap"))).is_none());
        assert!(executable(&artifact(true, Value::Null)).is_none());
        assert!(executable(&json!({ "reason": "build-finished", "success": true })).is_none());
    }

    #[test]
    fn a_ring_is_run_module_by_module_and_no_test_is_lost() {
        let ring = |listed: &str| {
            let executable = Executable {
                name: "ring".to_owned(),
                path: "ring".into(),
                folder: ".".into(),
                is_ring: true,
            };
            let parts = split(executable, listed).into_iter();
            parts
                .map(|part| (part.name, part.tests))
                .collect::<Vec<_>>()
        };
        let part = |name: &str, tests: &[&str]| {
            let tests = tests.iter().map(|name| (*name).to_owned());
            (name.to_owned(), tests.collect::<Vec<_>>())
        };
        assert_eq!(
            ring("b::two: test\na::deep::one: test\nb::one: test\nalone: test\n"),
            [
                part("ring", &["alone"]),
                part("ring::a", &["a::deep::one"]),
                part("ring::b", &["b::two", "b::one"]),
            ]
        );
        // What lists nothing is run as it is.
        assert_eq!(ring(""), [part("ring", &[])]);
    }
}
