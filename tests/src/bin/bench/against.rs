//! Comparison of this revision with another one: is any former slower?
//!
//! The other revision is checked out and built under `target/bench/against`, separate from this one. The comparison uses the single
//! measurement of a process (`measure`) on samples in memory, so that reading, pictures and writing by `subap` cannot hide a change. Both
//! programs read the same files. They alternate, and so does which one is first, so that a change of the machine's speed affects both; each
//! round gives a ratio of times. A former counts as slower if three quarters of its ratios exceed 1.1, which is more than their spread.
//!
//! A revision without this program cannot be measured, and the output states this.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use subaperture_tests::statistics::{is_slower, quartiles};

use crate::case::Case;
use crate::child::{self, Failure};
use crate::machine;
use crate::measure::{Asked, Measured};
use crate::options::Options;
use crate::recording::place;
use crate::{PROTOCOL, table};

/// Ratio of times up to which a slowdown is accepted.
const LIMIT: f64 = 1.1;

/// Path of this program in a revision's sources.
const SOURCE: &str = "tests/src/bin/bench/main.rs";

/// Compare and print; the exit status is a failure if any former is slower.
///
/// # Errors
/// If the other revision cannot be measured.
pub(crate) fn print(options: &Options, revision: &str) -> Result<ExitCode, String> {
    let own = std::env::current_exe().map_err(|error| error.to_string())?;
    let (commit, other) = built(revision)?;
    println!("{}", machine::described());
    println!(
        "Against {revision} ({commit}), {} rounds. Ratios are new times over old ones: quartiles and median.\n",
        options.rounds
    );
    for case in options.cases() {
        println!("- {case}");
    }
    println!(
        "\n| case | former | threads | s then | s now | ratio | spread | error dB then | now | peak MiB then | now | |\n\
         |---|---|---|---|---|---|---|---|---|---|---|---|"
    );
    let mut slower = Vec::new();
    for case in options.cases() {
        for &threads in &options.threads {
            for asked in options.formers.iter().filter(|asked| !asked.is_oracle) {
                eprintln!("case {}, {} on {threads}", case.name, asked.text);
                let pair = [&other, &own];
                let compared = compared(pair, case, asked, threads, options);
                let begin = format!("| {} | {} | {threads}", case.name, asked.text);
                match compared {
                    Err((whose, failure)) => {
                        let line = format!("{begin} | | | | | | | | | {whose}: {failure} |");
                        println!("{}", line.replace('\n', " "));
                    }
                    Ok(rounds) => {
                        let (line, is_slower) = row(&rounds);
                        println!("{begin} | {line} |");
                        if is_slower {
                            slower.push(format!("{} on case {}", asked.text, case.name));
                        }
                    }
                }
            }
        }
    }
    if slower.is_empty() {
        println!("\nNo former is slower by more than a factor of {LIMIT}.");
        return Ok(ExitCode::SUCCESS);
    }
    println!("\nSlower by more than {LIMIT}: {}.", slower.join(", "));
    Ok(ExitCode::FAILURE)
}

/// Rounds of both programs, `[then, now]`; or which process failed, and how.
fn compared(
    programs: [&PathBuf; 2],
    case: &Case,
    asked: &Asked,
    threads: usize,
    options: &Options,
) -> Result<Vec<[Measured; 2]>, (&'static str, Failure)> {
    const WHOSE: [&str; 2] = ["then", "now"];
    for (program, whose) in programs.into_iter().zip(WHOSE) {
        let mut command = child::command(program, threads);
        command.args(["prepare", &case.name, &asked.text]);
        command.env("CARGO_TARGET_DIR", subaperture_xtask::target_folder());
        child::run::<bool>(command, options.limit).map_err(|failure| (whose, failure))?;
    }
    let mut rounds = Vec::new();
    for round in 0..options.rounds {
        let mut pair = [None, None];
        for i in [round % 2, (round + 1) % 2] {
            let mut command = table::command(programs[i], case, asked, threads, options);
            command.env("CARGO_TARGET_DIR", subaperture_xtask::target_folder());
            let measured = child::run(command, options.limit);
            pair[i] = Some(measured.map_err(|failure| (WHOSE[i], failure))?);
        }
        rounds.push(pair.map(|measured| measured.expect("both took their turn")));
    }
    Ok(rounds)
}

/// The other cells of a row, and whether the former is slower.
fn row(rounds: &[[Measured; 2]]) -> (String, bool) {
    let ratios: Vec<f64> = rounds
        .iter()
        .map(|[then, now]| now.seconds / then.seconds)
        .collect();
    let shortest = |i: usize| {
        rounds
            .iter()
            .map(|pair| pair[i].seconds)
            .fold(f64::INFINITY, f64::min)
    };
    let [lower, median, upper] = quartiles(&ratios).expect("at least one round");
    let slower = is_slower(&ratios, LIMIT);
    let [then, now] = &rounds[0];
    let line = format!(
        "{:.3} | {:.3} | {median:.3} | {lower:.3} to {upper:.3} | {:.1} | {:.1} | {} | {} | {}",
        shortest(0),
        shortest(1),
        then.error_db,
        now.error_db,
        then.peak_bytes >> 20,
        now.peak_bytes >> 20,
        if slower { "slower" } else { "" }
    );
    (line, slower)
}

/// The commit of a revision, and its build of this program.
fn built(revision: &str) -> Result<(String, PathBuf), String> {
    let commit = git(&[
        "rev-parse",
        "--verify",
        "--short=12",
        &format!("{revision}^{{commit}}"),
    ])
    .map_err(|error| format!("there is no revision {revision}: {error}"))?;
    if git(&["cat-file", "-e", &format!("{commit}:{SOURCE}")]).is_err() {
        return Err(format!(
            "{revision} ({commit}) has no {SOURCE}: it is from before there was something to compare by"
        ));
    }
    let against = place().join("against");
    let (sources, target) = (against.join(&commit), against.join("target"));
    let program = against.join(format!("bench-{commit}"));
    if !program.is_file() {
        if !sources.is_dir() {
            // A worktree removed by hand is still in git's list.
            git(&["worktree", "prune"])?;
            git(&[
                "worktree",
                "add",
                "--detach",
                &sources.to_string_lossy(),
                &commit,
            ])?;
        }
        eprintln!("building {commit}");
        let mut cargo = subaperture_xtask::cargo();
        cargo
            .args(["build", "--quiet", "--release", "--locked"])
            .args(["--package", "subaperture-tests", "--bin", "bench"])
            .current_dir(&sources)
            .env("CARGO_TARGET_DIR", &target);
        match cargo.status() {
            Ok(status) if status.success() => {}
            Ok(_) => return Err(format!("{commit} does not build in {}", sources.display())),
            Err(error) => return Err(format!("cannot start cargo: {error}")),
        }
        // Builds of all revisions have the same file name.
        fs::copy(target.join("release/bench"), &program)
            .map_err(|error| format!("{}: {error}", program.display()))?;
        git(&["worktree", "remove", "--force", &sources.to_string_lossy()])?;
    }
    let spoken = speaks(&program)?;
    if spoken != PROTOCOL {
        return Err(format!(
            "{revision} ({commit}) measures as '{spoken}' says, this revision as '{PROTOCOL}' does: \
             their times cannot be compared"
        ));
    }
    Ok((commit, program))
}

fn speaks(program: &Path) -> Result<String, String> {
    let output = Command::new(program).arg("protocol").output();
    let output = output.map_err(|error| format!("{}: {error}", program.display()))?;
    Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

fn git(arguments: &[&str]) -> Result<String, String> {
    let mut command = Command::new("git");
    let output = command
        .current_dir(subaperture_xtask::root())
        .args(arguments)
        .output();
    let output = output.map_err(|error| format!("cannot start git: {error}"))?;
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).trim().to_owned();
    match output.status.success() {
        true => Ok(text(&output.stdout)),
        false => Err(text(&output.stderr)),
    }
}
