//! The table: every former on every series of cases with every number of threads, and other programs.
//!
//! A series of growing cases is measured on the smallest number of threads, because threads that wait for each other would distort its
//! growth. Its cells list the values of its cases.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;

use subaperture_tests::statistics::{exponent, fastest_within};

use crate::case::Case;
use crate::ceilings::Ceilings;
use crate::child::{self, Failure};
use crate::growth::Series;
use crate::machine;
use crate::measure::{Asked, Measured};
use crate::options::Options;
use crate::peers;
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
    for series in &options.series {
        println!("- {}", series.description);
    }
    let mut peers = Vec::new();
    for (name, peer) in peers::find(options.peers) {
        match peer {
            Ok(peer) => peers.push(peer),
            Err(why) => println!("\n{name}: not measured, {why}."),
        }
    }
    println!("\n{HEAD}");
    for series in &options.series {
        for case in &series.cases {
            let folder = recording::ready(case)?;
            recording::judge(case, &folder, case.side)?;
        }
        let mut late = BTreeSet::new();
        let fewest = options.threads.last().copied();
        for (&threads, ceilings) in ceilings.iter().rev() {
            if series.grows() && Some(threads) != fewest {
                continue;
            }
            let mut ours = Vec::new();
            for asked in &options.formers {
                if asked.is_oracle && series.grows() {
                    continue;
                }
                let row = match late.contains(&asked.text) {
                    true => Row::late(options),
                    false => Row::measured(series, |case| own(case, asked, threads, options)),
                };
                if let Some(Failure::Late(_)) = row.failure {
                    late.insert(asked.text.clone());
                }
                let text = &asked.text;
                println!("{}", row.line(series, text, threads, ceilings, None));
                if !asked.is_oracle {
                    ours.push((text.clone(), row));
                }
            }
            for peer in &peers {
                for method in peer.methods().iter().filter(|_| peer.takes(series)) {
                    let row = Row::measured(series, |case| {
                        peer.measure(case, method, threads, options.limit)
                    });
                    let name = format!("{} {method}", peer.name());
                    let compared = Some(row.compared(&ours));
                    println!("{}", row.line(series, &name, threads, ceilings, compared));
                }
            }
        }
    }
    Ok(())
}

const HEAD: &str = "\
| case | former | threads | s | processor s | GBP/s | error dB | scaled | peak MiB | arithmetic | memory | exponent | ours | ratio | |
|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|";

/// Measurements of a former on the cases of a series, up to the first failure.
struct Row {
    measured: Vec<Measured>,
    failure: Option<Failure>,
}

impl Row {
    fn measured(series: &Series, measure: impl Fn(&Case) -> Result<Measured, Failure>) -> Self {
        let mut row = Self {
            measured: Vec::new(),
            failure: None,
        };
        for case in &series.cases {
            match measure(case) {
                Ok(measured) => row.measured.push(measured),
                Err(failure) => {
                    row.failure = Some(failure);
                    break;
                }
            }
        }
        row
    }

    fn late(options: &Options) -> Self {
        Self {
            measured: Vec::new(),
            failure: Some(Failure::Late(options.limit)),
        }
    }

    /// For each measurement of another program, our fastest former by processor time whose error is at most that of the program after
    /// its best complex factor; and the ratio of processor times.
    fn compared(&self, ours: &[(String, Self)]) -> [String; 2] {
        let each = self.measured.iter().enumerate().map(|(i, peer)| {
            let rows = ours
                .iter()
                .filter_map(|(name, row)| Some((name, row.measured.get(i)?)));
            let rows: Vec<_> = rows.collect();
            let times: Vec<_> = rows
                .iter()
                .map(|(_, m)| (m.error_db, m.processor_s))
                .collect();
            match fastest_within(peer.scaled_db, &times) {
                None => [String::new(), String::new()],
                Some(i) => [
                    rows[i].0.clone(),
                    three_digits(peer.processor_s / times[i].1),
                ],
            }
        });
        let (names, ratios): (Vec<_>, Vec<_>) = each.map(|[name, ratio]| (name, ratio)).unzip();
        [names, ratios].map(listed)
    }

    /// Exponent of processor time, if a quantity grows.
    fn exponent(&self, series: &Series) -> Option<f64> {
        let times = self.measured.iter().map(|measured| measured.processor_s);
        let points: Vec<_> = series.sizes.iter().copied().zip(times).collect();
        exponent(&points)
    }

    /// Line of the table; `compared` are the cells of other programs.
    fn line(
        &self,
        series: &Series,
        former: &str,
        threads: usize,
        ceilings: &Ceilings,
        compared: Option<[String; 2]>,
    ) -> String {
        let cell =
            |text: &dyn Fn(&Measured) -> String| listed(self.measured.iter().map(text).collect());
        // An unknown share is printed as unknown, not as 0.
        let share = |did: f64, measured: &Measured, ceiling: f64| match did > 0.0 {
            true => format!("{:.1} %", 100.0 * did / measured.seconds / ceiling),
            false => String::new(),
        };
        let [ours, ratio] = compared.unwrap_or_default();
        let exponent = self.exponent(series);
        let note = match &self.failure {
            Some(failure) => failure.to_string(),
            None => self
                .measured
                .last()
                .map_or_else(String::new, |m| m.note.clone()),
        };
        let cells = [
            series.name.clone(),
            former.to_owned(),
            threads.to_string(),
            cell(&|m| format!("{:.3}", m.seconds)),
            cell(&|m| format!("{:.3}", m.processor_s)),
            cell(&|m| three_digits(m.rate())),
            cell(&|m| format!("{:.1}", m.error_db)),
            cell(&|m| format!("{:.1}", m.scaled_db)),
            cell(&|m| match m.peak_bytes {
                0 => String::new(),
                bytes => (bytes >> 20).to_string(),
            }),
            cell(&|m| share(m.operations, m, ceilings.operations)),
            cell(&|m| share(m.least_bytes, m, ceilings.bytes)),
            exponent.map_or_else(String::new, |exponent| format!("{exponent:.2}")),
            ours,
            ratio,
            note,
        ];
        format!("| {} |", cells.join(" | ")).replace('\n', " ")
    }
}

/// Cells of a series' cases as one: a common value once.
fn listed(mut cells: Vec<String>) -> String {
    if cells.windows(2).all(|pair| pair[0] == pair[1]) {
        cells.truncate(1);
    }
    cells.join(", ")
}

/// Measure in a separate process.
fn own(case: &Case, asked: &Asked, threads: usize, options: &Options) -> Result<Measured, Failure> {
    eprintln!("case {}, {} on {threads}", case.name, asked.text);
    let said = |error: String| Failure::Said(error);
    let folder = recording::ready(case).map_err(said)?;
    recording::judge(case, &folder, asked.side(case)).map_err(said)?;
    let program = std::env::current_exe().map_err(|error| said(error.to_string()))?;
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
