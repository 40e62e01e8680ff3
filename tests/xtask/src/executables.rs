//! Test executables built by cargo, run in parts, several at once.
//!
//! `cargo test` runs them one after another, but many of ours wait for an emulator or a child process, so that half of the processors would
//! be idle. A folder of integration tests takes long, and its modules differ: each module is a part, run as a process with only those
//! tests. The longest parts start first.

use std::collections::{BTreeMap, VecDeque};
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use serde_json::Value;

/// Time limit of a part. None takes half of this on a slow machine; one that does waits forever.
const LIMIT: Duration = Duration::from_secs(1200);

/// Time for which the outputs of an ended process are still read.
const PATIENCE: Duration = Duration::from_secs(2);

/// Parts that start first, longest first, because a long part that starts late would run alone at the end.
const LONGEST: [&str; 40] = [
    "gallery",
    "cli::tiles",
    "cli::guide",
    "python",
    "firmware::detections",
    "firmware::cli_products",
    "recordings::orbit",
    "scene::sub_cpis",
    "cli::memory",
    "wasm::page",
    "images::table",
    "cli::failing_writes",
    "firmware::gotcha",
    "cli::cases",
    "viewer::images_page",
    "firmware::cli_link",
    "formers::random",
    "cli::run",
    "recordings::convention",
    "images::near",
    "formers::pfa_ffbp",
    "recordings::tune_certainty",
    "scene::images",
    "firmware::sessions",
    "cli::autofocus",
    "images::small",
    "cli::orbit_strip",
    "formers::tiles",
    "cli::quiet",
    "cli::overwrite",
    "cli::results",
    "cli::every_command",
    "cli::raw",
    "firmware::front_end",
    "formers::out_of_memory",
    "damage::fuzz_targets",
    "cli::truck",
    "formers::surfaces",
    "radio::selftest",
    "cli::parsed_memory",
];

/// A test executable.
#[derive(Clone, Debug)]
pub(crate) struct Executable {
    /// Name of the Cargo target.
    name: String,
    path: PathBuf,
    /// Folder of its package, where cargo starts it.
    folder: PathBuf,
    /// Whether it contains integration tests.
    is_ring: bool,
}

/// Tests run by one process.
#[derive(Clone, Debug)]
struct Part {
    /// Names of the executable and of the module.
    name: String,
    executable: Executable,
    /// Full names of the tests; all tests if empty.
    tests: Vec<String>,
}

/// Output of a part, and whether it succeeded.
pub(crate) struct Run {
    pub(crate) name: String,
    pub(crate) output: String,
    pub(crate) succeeded: bool,
    pub(crate) took: Duration,
}

/// Build by `cargo test --no-run` or similar, with messages as JSON.
///
/// # Errors
/// The last output of cargo if it fails.
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

/// The test executable in a message of cargo, if any.
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

/// One part for each module of a folder of tests; the whole executable otherwise, or if it lists no test.
fn parts(executable: Executable) -> Vec<Part> {
    let mut list = command(&executable);
    list.args(["--list", "--format", "terse"]);
    let listed = match executable.is_ring.then(|| list.output()) {
        Some(Ok(output)) if output.status.success() => output.stdout,
        _ => Vec::new(),
    };
    split(executable, &String::from_utf8_lossy(&listed))
}

/// One part for each module in the list, whose lines are `module::deeper::name: test`; tests outside of modules form another part. The
/// whole executable if the list is empty.
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

/// Command of an executable, started as by cargo.
fn command(executable: &Executable) -> Command {
    let mut command = Command::new(&executable.path);
    command.current_dir(&executable.folder).stdin(Stdio::null());
    command
}

/// Run all parts, as many at once as there are processors; `done` is called with each part when it ends, one at a time. `prepare` may
/// modify the commands.
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
    // Without it a passing test cannot report that it skipped something.
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

/// Output of `child`, whose streams are piped, and whether it succeeds. It is killed after `limit`.
fn finish(mut child: Child, limit: Duration) -> (String, bool) {
    let streams = [
        gather(child.stdout.take().expect("stdout is piped")),
        gather(child.stderr.take().expect("stderr is piped")),
    ];
    let status = wait(&mut child, limit);
    // Its own output is read at once; processes that it left behind may keep the streams open forever.
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

/// Read a stream to its end on a separate thread.
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

/// Status of the child; `None` if it was killed at the limit.
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
        // Processes left behind are not awaited.
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
    fn folder_of_tests_is_run_by_module_without_losing_any() {
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
        // Without a list the whole executable is run.
        assert_eq!(ring(""), [part("ring", &[])]);
    }
}
