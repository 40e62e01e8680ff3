//! Growth of time with pixels, pulses and range bins.
//!
//! One of the three is doubled some times while the others have the middle values of the table; the exponent is the slope of the
//! least-squares line through the logarithms of times. More pixels are a larger scene, more pulses a denser track, more samples a longer
//! swath; resolution and aperture stay constant. An exponent of 1 is linear growth; work that does not depend on the size lowers it towards
//! 0.

use crate::case::Case;
use crate::child::{self, Failure};
use crate::machine;
use crate::measure::Measured;
use crate::options::Options;
use crate::{recording, table};

use subaperture_tests::statistics::exponent;

/// Pulses, samples and pixels along each side, while not varied.
const MIDDLE: [usize; 3] = [1024, 1024, 512];

/// Varied quantity: name, index in a case's name, values, and the power of it in the count (pixels are a square).
const VARIED: [(&str, usize, [usize; 4], i32); 3] = [
    ("pixels", 2, [192, 384, 768, 1536], 2),
    ("pulses", 0, [512, 1024, 2048, 4096], 1),
    ("range bins", 1, [512, 1024, 2048, 4096], 1),
];

/// Measure and print exponents.
///
/// # Errors
/// Faults of the cases' files.
pub(crate) fn print(options: &Options) -> Result<(), String> {
    let program = std::env::current_exe().map_err(|error| error.to_string())?;
    // Growth is measured on the smallest number of threads, because threads that wait for each other would distort it.
    let threads = options.threads.iter().copied().min().unwrap_or(1);
    println!("{}", machine::described());
    println!(
        "Times in seconds on {threads} thread; exponents are slopes of log time over log size.\n"
    );
    let [pulses, samples, side] = MIDDLE;
    println!("Otherwise {pulses} pulses x {samples} samples, {side} x {side} pixels of 0.2 m.\n");
    println!("| former | varied | sizes | s | exponent |\n|---|---|---|---|---|");
    for asked in options.formers.iter().filter(|asked| !asked.is_oracle) {
        for (name, place, values, power) in VARIED {
            let mut points = Vec::new();
            let mut failed = None;
            for value in values {
                let mut sizes = MIDDLE;
                sizes[place] = value;
                let case = Case::named(&sizes.map(|n| n.to_string()).join("x"))?;
                let folder = recording::ready(&case)?;
                recording::judge(&case, &folder, asked.side(&case))?;
                eprintln!("case {}, {}", case.name, asked.text);
                let command = table::command(&program, &case, asked, threads, options);
                match child::run::<Measured>(command, options.limit) {
                    Ok(measured) => points.push(((value as f64).powi(power), measured.seconds)),
                    Err(failure) => {
                        failed = Some(failure);
                        break;
                    }
                }
            }
            println!("{}", row(&asked.text, name, &points, failed));
        }
    }
    Ok(())
}

fn row(former: &str, name: &str, points: &[(f64, f64)], failed: Option<Failure>) -> String {
    let sizes: Vec<String> = points.iter().map(|(size, _)| format!("{size}")).collect();
    let times: Vec<String> = points.iter().map(|(_, s)| format!("{s:.3}")).collect();
    let found = match (failed, exponent(points)) {
        (Some(failure), _) => failure.to_string().replace('\n', " "),
        (None, Some(exponent)) => format!("{exponent:.2}"),
        (None, None) => "not measured".to_owned(),
    };
    format!(
        "| {former} | {name} | {} | {} | {found} |",
        sizes.join(", "),
        times.join(", ")
    )
}
