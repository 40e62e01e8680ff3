//! Benchmark of image formers: time, error and memory of each on fixed cases. Started by `cargo xtask bench`.
//!
//! Each measurement is a separate process of this program, so that its peak memory is that of the former.
#![forbid(unsafe_code)]

mod against;
mod case;
mod ceilings;
mod child;
mod growth;
mod machine;
mod measure;
mod options;
mod peers;
mod recording;
mod sums;
mod table;

use std::path::Path;
use std::process::ExitCode;

use case::Case;
use measure::Asked;
use options::Options;

const HELP: &str = "\
Usage: cargo xtask bench [CASE..] [OPTION..]          the table
       cargo xtask bench --against REV [CASE..]       this revision against another, interleaved

Cases: a, straight, b, c, large, large-whole, gotcha, PULSESxSAMPLESxSIDE, or growth (with pixels, pulses and range bins);
all but large-whole and growth unless named.

  --formers LIST    such as bp:-45,ffbp,rdbp-thesis: name and bound in dB, -60 unless given; all unless named
  --threads LIST    such as 1,2, the default; a former too slow on more threads is not run on fewer
  --quick           case a, all threads, 10 s at most for each: about a minute
  --limit SECONDS   stop a measurement that takes longer, and state it in its row [20]
  --memory-mib N    memory budget of formers [8192]
  --rounds N        of --against [7]
  --peers           torchbp and FastSAR too, installed into target/bench if missing (some gigabytes)
  --no-peers        not even where they are installed";

/// Version of the measurements: numbers of different versions cannot be compared.
const PROTOCOL: &str = "subaperture-bench-1";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match done(&words) {
        Ok(code) => code,
        Err(message) => {
            eprintln!("{message}");
            ExitCode::FAILURE
        }
    }
}

fn done(words: &[&str]) -> Result<ExitCode, String> {
    match *words {
        ["help" | "--help" | "-h"] => println!("{HELP}"),
        // Subcommands that this program runs itself.
        ["protocol"] => println!("{PROTOCOL}"),
        ["ceilings"] => println!("{}", serde_json::json!(ceilings::measure())),
        ["prepare", case, former] => {
            let (case, asked) = (Case::named(case)?, Asked::parse(former)?);
            let folder = recording::ready(&case)?;
            recording::judge(&case, &folder, asked.side(&case))?;
            println!("true");
        }
        ["measure", case, former, memory_mib] => {
            let memory_mib: u64 = memory_mib.parse().map_err(|_| HELP)?;
            let measured = measure::measure(
                &Case::named(case)?,
                &Asked::parse(former)?,
                memory_mib << 20,
            )?;
            println!("{}", serde_json::json!(measured));
        }
        ["sum", case, points, values] => {
            recording::sum_at(&Case::named(case)?, Path::new(points), Path::new(values))?;
        }
        _ => {
            let options = Options::parse(words)?;
            match &options.against {
                Some(revision) => return against::print(&options, revision),
                None => table::print(&options)?,
            }
        }
    }
    Ok(ExitCode::SUCCESS)
}
