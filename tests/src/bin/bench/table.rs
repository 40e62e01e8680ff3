//! The table: every former on every case with every number of threads, and other programs.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;

use crate::case::Case;
use crate::ceilings::Ceilings;
use crate::child::{self, Failure};
use crate::machine;
use crate::measure::{Asked, Measured};
use crate::options::Options;
use crate::peers::{self, Peer};
use crate::recording;

/// Measure and print all rows.
///
/// # Errors
/// Faults of the cases' files. The refusal of a former is a row.
pub(crate) fn print(options: &Options) -> Result<(), String> {
    println!("{}", machine::described());
    if let Some(load) = machine::load() {
        println!("Processes that wanted a processor in the last minute: {load:.1}.");
    }
    if !child::pins() {
        println!("Threads are not kept to processors: there is no taskset.");
    }
    let ceilings: BTreeMap<usize, Ceilings> = options
        .threads
        .iter()
        .map(|&threads| Ok((threads, ceilings(threads)?)))
        .collect::<Result<_, String>>()?;
    for (threads, ceilings) in &ceilings {
        println!(
            "Ceilings of {threads} thread{}: {:.0} Gflop/s in float32 products with sums, {:.1} GB/s read and written by copying.",
            if *threads == 1 { "" } else { "s" },
            ceilings.operations * 1e-9,
            ceilings.bytes * 1e-9
        );
    }
    println!();
    for case in &options.cases {
        println!("- {case}");
    }
    let peer = peers::find(options.peers);
    if let Err(why) = &peer {
        println!("\ntorchbp: not measured, {why}.");
    }
    println!("\n{HEAD}");
    for case in &options.cases {
        let folder = recording::ready(case)?;
        let mut late = BTreeSet::new();
        for &threads in &options.threads {
            let Some(ceilings) = ceilings.get(&threads) else {
                continue;
            };
            for asked in &options.formers {
                recording::judge(case, &folder, asked.side(case))?;
                let measured = match late.contains(&asked.text) {
                    true => Err(Failure::Late(options.limit)),
                    false => {
                        eprintln!("case {}, {} on {threads}", case.name, asked.text);
                        own(case, asked, threads, options)
                    }
                };
                if let Err(Failure::Late(_)) = measured {
                    late.insert(asked.text.clone());
                }
                println!("{}", row(case, &asked.text, threads, &measured, ceilings));
            }
            if let Ok(peer) = &peer {
                for method in peers::METHODS.iter().filter(|_| Peer::takes(case)) {
                    eprintln!("case {}, torchbp {method} on {threads}", case.name);
                    let measured = peer.measure(case, &folder, method, threads, options.limit);
                    println!(
                        "{}",
                        row(
                            case,
                            &format!("torchbp {method}"),
                            threads,
                            &measured,
                            ceilings
                        )
                    );
                }
            }
        }
    }
    Ok(())
}

const HEAD: &str = "\
| case | former | threads | s | processor s | GBP/s | error dB | scaled | peak MiB | arithmetic | memory | |
|---|---|---|---|---|---|---|---|---|---|---|---|";

fn row(
    case: &Case,
    former: &str,
    threads: usize,
    measured: &Result<Measured, Failure>,
    ceilings: &Ceilings,
) -> String {
    let begin = format!("| {} | {former} | {threads}", case.name);
    match measured {
        Err(failure) => format!("{begin} | | | | | | | | | {failure} |").replace('\n', " "),
        Ok(measured) => {
            // An unknown share is printed as unknown, not as 0.
            let share = |did: f64, ceiling: f64| match did > 0.0 {
                true => format!("{:.1} %", 100.0 * did / measured.seconds / ceiling),
                false => String::new(),
            };
            let peak = match measured.peak_bytes {
                0 => String::new(),
                bytes => (bytes >> 20).to_string(),
            };
            format!(
                "{begin} | {:.3} | {:.2} | {} | {:.1} | {:.1} | {peak} | {} | {} | {} |",
                measured.seconds,
                measured.processor_s,
                three_digits(measured.rate()),
                measured.error_db,
                measured.scaled_db,
                share(measured.operations, ceilings.operations),
                share(measured.least_bytes, ceilings.bytes),
                measured.note,
            )
        }
    }
}

/// Measure in a separate process.
fn own(case: &Case, asked: &Asked, threads: usize, options: &Options) -> Result<Measured, Failure> {
    let program = std::env::current_exe().map_err(|error| Failure::Said(error.to_string()))?;
    child::run(
        command(&program, case, asked, threads, options),
        options.limit,
    )
}

/// Command for a measurement by `program`, of this revision or another.
pub(crate) fn command(
    program: &Path,
    case: &Case,
    asked: &Asked,
    threads: usize,
    options: &Options,
) -> Command {
    let mut command = child::command(program, threads);
    command.args(["measure", &case.name, &asked.text]);
    command.arg((options.memory_bytes >> 20).to_string());
    command
}

fn ceilings(threads: usize) -> Result<Ceilings, String> {
    let program = std::env::current_exe().map_err(|error| error.to_string())?;
    let mut command = child::command(&program, threads);
    command.arg("ceilings");
    let limit = std::time::Duration::from_secs(60);
    child::run(command, limit).map_err(|failure| format!("ceilings {failure}"))
}

/// A number with three significant digits.
fn three_digits(x: f64) -> String {
    let decimals = 2 - x.abs().max(1e-9).log10().floor() as i32;
    format!("{x:.*}", decimals.max(0) as usize)
}
