//! A system that allows few threads: the program refuses with an error or uses fewer, and never panics.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{self, Command};

use subaperture_tests::subap::{program, write_thesis_experiment};

/// The test whose user runs the program. The limit counts all threads of a user, so each test of each run has its own.
#[derive(Clone, Copy)]
enum User {
    Workers,
    Capture,
}

impl User {
    /// A user without other processes; not root, for whom the limit does not hold.
    fn id(self) -> u32 {
        20_000 + 2 * (process::id() % 20_000) + self as u32
    }
}

/// Run `line` in `at` as `user` with at most `most` threads in all: its exit status and standard error; `None` where this machine does not allow it.
fn with_threads(user: User, at: &Path, most: usize, line: &str) -> Option<(Option<i32>, String)> {
    let ran = Command::new("setpriv")
        .args([
            &format!("--reuid={}", user.id()),
            "--clear-groups",
            "prlimit",
            &format!("--nproc={most}"),
        ])
        .arg(at.join("subap"))
        .args(line.split_whitespace())
        .current_dir(at)
        .output()
        .ok()?;
    let stderr = String::from_utf8_lossy(&ran.stderr).into_owned();
    let refused = stderr.starts_with("setpriv:") || stderr.starts_with("prlimit:");
    (!refused).then_some((ran.status.code(), stderr))
}

fn names(at: &Path, begin: &str) -> Vec<String> {
    let entries = fs::read_dir(at).unwrap();
    let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    names.filter(|name| name.contains(begin)).collect()
}

/// Copy the program to `at`, where the other user may read and write.
fn open_to_others(at: &Path) {
    fs::copy(program(), at.join("subap")).unwrap();
    for (path, mode) in [(at.to_owned(), 0o777), (at.join("subap"), 0o755)] {
        fs::set_permissions(path, fs::Permissions::from_mode(mode)).unwrap();
    }
}

#[test]
fn refused_worker_threads_are_reported_with_their_number_and_its_source() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    open_to_others(at);
    let processors = std::thread::available_parallelism().unwrap();
    for (line, parts, not) in [
        (
            "info no-file",
            [
                format!("cannot start {processors} worker threads, one per processor"),
                "with --threads".to_owned(),
            ],
            "(--threads",
        ),
        (
            "--threads 7 info no-file",
            [
                "cannot start 7 worker threads (--threads 7)".to_owned(),
                "os error".to_owned(),
            ],
            "one per processor",
        ),
    ] {
        let Some((code, stderr)) = with_threads(User::Workers, at, 1, line) else {
            println!("skipped: no right to run as another user");
            return;
        };
        assert_eq!(code, Some(1), "{stderr}");
        assert!(parts.iter().all(|part| stderr.contains(part)), "{stderr}");
        assert!(!stderr.contains(not), "{stderr}");
    }
}

#[test]
fn capture_without_disk_thread_is_an_error_and_leaves_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    write_thesis_experiment(at);
    open_to_others(at);
    let mut errors = Vec::new();
    for most in 1..=8 {
        let out = format!("few{most}");
        let line = format!("--threads 2 capture thesis.toml -o {out} --set plan.sweeps=1");
        let Some((code, stderr)) = with_threads(User::Capture, at, most, &line) else {
            println!("skipped: no right to run as another user");
            return;
        };
        assert!(!stderr.contains("panicked"), "{most}: {stderr}");
        match code {
            Some(0) => assert_eq!(names(at, &out).len(), 2, "{most}"),
            Some(1) => {
                assert!(stderr.contains("thread"), "{most}: {stderr}");
                assert!(names(at, &out).is_empty(), "{most}: {stderr}");
                errors.push(stderr);
            }
            _ => panic!("{most}: {code:?}: {stderr}"),
        }
    }
    // Three threads are the main one and two workers: the next, that of the disk, is refused.
    assert!(errors.len() >= 3, "{errors:?}");
    assert!(
        errors[2].contains("cannot start the disk thread"),
        "{errors:?}"
    );
}
