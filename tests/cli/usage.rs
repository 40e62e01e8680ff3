//! Usage of `subap`: help, completions, man pages, correct and wrong options.

use std::path::Path;
use std::process::Stdio;

use subaperture_tests::subap::{command, listing, run};

#[test]
fn command_without_arguments_shows_help() {
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
            vec!["--grid", "x is given more than once"],
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
fn man_pages_have_every_option_and_unknown_commands_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let page = run(folder.path(), "man focus");
    for part in [".TH subap-focus 1", "error\\-db", ".SH OPTIONS"] {
        assert!(page.succeeded().contains(part), "{part}");
    }
    let page = run(folder.path(), "man plan radar");
    assert!(page.succeeded().contains(".TH subap-plan-radar 1"));
    run(folder.path(), "man plan fokus").failed(2, &["plan", "'fokus'", "focus"]);
}

#[test]
fn closed_output_pipe_is_not_a_failure() {
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

/// Names of all commands without subcommands, from the help.
fn commands(before: &str) -> Vec<String> {
    let ran = run(Path::new("."), &format!("{before} --help"));
    let Some((_, list)) = ran.succeeded().split_once("\nCommands:\n") else {
        return vec![before.trim().to_owned()];
    };
    let lines = list.lines().take_while(|line| !line.is_empty());
    let names = lines.filter(|line| line.starts_with("  ") && !line.starts_with("   "));
    let names = names.filter_map(|line| line.split_whitespace().next());
    let names = names.filter(|name| *name != "help");
    names
        .flat_map(|name| commands(&format!("{before} {name}")))
        .collect()
}

#[test]
fn short_help_of_every_command_fits_a_screen_and_long_help_has_an_example() {
    let commands = commands("");
    assert!(commands.len() > 25, "{commands:?}");
    let mut long = Vec::new();
    for command in &commands {
        let ran = run(Path::new("."), &format!("{command} -h"));
        let short = ran.succeeded();
        let lines = short.lines().count();
        if lines > 40 || short.lines().any(|line| line.chars().count() > 100) {
            long.push((command, lines));
        }
        assert!(short.contains("more options"), "{command}: {short}");
        let ran = run(Path::new("."), &format!("{command} --help"));
        assert!(ran.succeeded().contains("Example"), "{command}");
    }
    assert!(long.is_empty(), "{long:?}");
}

#[test]
fn help_lists_commands_by_group() {
    let ran = run(Path::new("."), "--help");
    let groups: Vec<&str> = ran
        .succeeded()
        .lines()
        .filter_map(|line| line.strip_prefix(' '))
        .filter(|line| !line.starts_with(' '))
        .collect();
    let wide = ran
        .succeeded()
        .lines()
        .filter(|line| line.chars().count() > 100);
    assert_eq!(wide.count(), 0);
    assert_eq!(
        groups,
        [
            "form", "inspect", "simulate", "radio", "motion", "export", "plan", "help"
        ]
    );
}

#[test]
fn help_is_coloured_only_where_requested() {
    for (variables, coloured) in [
        (vec![], false),
        (vec![("CLICOLOR_FORCE", "1")], true),
        (vec![("CLICOLOR_FORCE", "1"), ("NO_COLOR", "1")], false),
    ] {
        for line in ["--help", "focus --help", "focus --unknown"] {
            let mut command = command(Path::new("."), line.split_whitespace());
            for name in ["CLICOLOR", "CLICOLOR_FORCE", "NO_COLOR"] {
                command.env_remove(name);
            }
            let output = command.envs(variables.clone()).output().unwrap();
            let escapes = [output.stdout, output.stderr].concat().contains(&0x1b);
            assert_eq!(escapes, coloured, "{line}: {variables:?}");
        }
    }
}

#[test]
fn errors_are_json_objects_with_json() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("bad.toml"), "[radar]\npri = 3\n").unwrap();
    for (line, code, part, place) in [
        ("info absent --json", 1, "absent", ""),
        (
            "focus --json a.mat --out d --error-db 60",
            2,
            "--error-db",
            "--error-db",
        ),
        (
            "simulate bad.toml --json -o s.cphd",
            1,
            "bad.toml",
            "bad.toml",
        ),
    ] {
        let ran = run(folder.path(), line);
        ran.failed(code, &["error: ", part]);
        let object: serde_json::Value = serde_json::from_str(&ran.stdout).unwrap();
        assert_eq!(object["schema"], "subaperture-error", "{line}");
        assert_eq!(object["exit_status"], code, "{line}");
        assert!(
            object["error"].as_str().unwrap().contains(part),
            "{line}: {object}"
        );
        assert!(object.get("advice").is_some(), "{line}");
        let found = object["where"].as_str().unwrap_or_default();
        assert!(found.contains(place), "{line}: {object}");
    }
    assert_eq!(run(folder.path(), "info absent").stdout, "");
}

#[test]
fn jpeg_names_are_refused_with_supported_formats() {
    let folder = tempfile::tempdir().unwrap();
    for line in [
        "picture image -o a.jpg",
        "export image -o a.JPEG",
        "track a.cphd -o t.csv --picture t.jpeg",
    ] {
        run(folder.path(), line).failed(2, &["JPEG", ".png", ".tif"]);
    }
}
