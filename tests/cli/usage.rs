//! `subap` typed rightly and wrongly.

use std::process::Stdio;

use subaperture_tests::subap::{command, listing, run};

#[test]
fn alone_it_shows_help() {
    let folder = tempfile::tempdir().unwrap();
    let ran = run(folder.path(), "");
    for command in [
        "focus",
        "simulate",
        "crosscheck",
        "info",
        "compare",
        "demo",
        "completions",
    ] {
        assert!(
            ran.succeeded().contains(command),
            "{command} is not in the help"
        );
    }
    assert_eq!(run(folder.path(), "--help").code, Some(0));
    assert!(
        run(folder.path(), "--version")
            .succeeded()
            .starts_with("subap ")
    );
    assert!(
        run(folder.path(), "focus --help")
            .succeeded()
            .contains("--error-db")
    );
    assert!(listing(folder.path()).is_empty());
}

#[test]
fn wrong_usage_exits_with_2_and_names_the_option() {
    let folder = tempfile::tempdir().unwrap();
    for (line, parts) in [
        ("fokus", vec!["fokus", "focus"]),
        ("focus", vec!["INPUT", "--out"]),
        ("focus a.mat", vec!["--out"]),
        (
            "focus a.mat --out d --grid x=0:1:0.1",
            vec!["--grid", "give x and y"],
        ),
        (
            "focus a.mat --out d --grid x=1:0:1,y=0:1:1",
            vec!["--grid", "start < stop"],
        ),
        (
            "focus a.mat --out d --grid x=0:1:-1,y=0:1:1",
            vec!["--grid", "positive step"],
        ),
        (
            "focus a.mat --out d --grid x=0:1e15:1,y=0:1:1",
            vec!["--grid", "at most 1e9 m"],
        ),
        (
            "focus a.mat --out d --window blackman",
            vec!["--window", "kaiser:BETA"],
        ),
        (
            "focus a.mat --out d --error-db 60",
            vec!["--error-db", "-60"],
        ),
        (
            "focus a.mat --out d --algorithm omega-k --no-src",
            vec!["--no-src", "omega-k"],
        ),
        (
            "focus a.mat --out d --algorithm bp --patch 3",
            vec!["--patch", "bp"],
        ),
        (
            "focus a.mat --out d --algorithm exact --error-db -60",
            vec!["--error-db", "exact"],
        ),
        (
            "focus a.mat --out d --mode thesis --patch 3",
            vec!["--patch", "--mode thesis"],
        ),
        (
            "focus a.mat --out d --threads 100000",
            vec!["--threads", "1024"],
        ),
        (
            "focus a.mat --out d --grid x=0:1:1,y=0:1:1,x=0:2:1",
            vec!["--grid", "x is given twice"],
        ),
        (
            "focus a.mat --out d --memory lots",
            vec!["--memory", "512M"],
        ),
        ("focus a.mat --out d -q -v", vec!["--quiet", "--verbose"]),
        (
            "focus a.mat --out d --surface dem",
            vec!["--surface", "dem:FILE"],
        ),
        (
            "focus a.mat --out d --surface hae --geoid 43",
            vec!["--geoid", "--surface dem:FILE"],
        ),
        (
            "focus a.mat --out d --troposphere 400",
            vec!["--troposphere", "exponential:313"],
        ),
        (
            "simulate --preset table-4-1 -o f --reference-surface round",
            vec!["--reference-surface", "hae"],
        ),
        ("info", vec!["INPUT"]),
        (
            "simulate --preset table-9 -o f",
            vec!["--preset", "table-4-1"],
        ),
        (
            "simulate --preset table-4-1 -o f --sgn 0",
            vec!["--sgn", "-1"],
        ),
    ] {
        run(folder.path(), line).failed(2, &parts);
    }
    assert!(listing(folder.path()).is_empty());
}

#[test]
fn completions_for_every_shell() {
    let folder = tempfile::tempdir().unwrap();
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let ran = run(folder.path(), &format!("completions {shell}"));
        assert!(ran.succeeded().contains("error-db"), "{shell}");
    }
}

#[test]
fn a_reader_that_goes_away_is_no_failure() {
    let folder = tempfile::tempdir().unwrap();
    for line in ["completions bash", "focus --help", ""] {
        let mut child = command(folder.path(), line.split_whitespace())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{line}: {output:?}");
        assert!(output.stderr.is_empty(), "{line}: {output:?}");
    }
}
