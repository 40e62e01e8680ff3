//! Touchstone files of single sweeps.

use std::fmt::Write;

use super::instrument::Sweep;

/// Beginning of the comment with the time of a sweep.
const TIME: &str = "! time_s ";

/// Name of the file of a sweep. Its ports are those up to the parameter's larger one.
pub(super) fn name(sweep: u64, parameter: [usize; 2]) -> String {
    format!("sweep{sweep:05}.s{}p", ports(parameter))
}

fn ports([to, from]: [usize; 2]) -> usize {
    to.max(from)
}

/// Number of the sweep in the name of its file; `None` for other names.
pub(super) fn number(name: &str) -> Option<u64> {
    let (digits, rest) = name.strip_prefix("sweep")?.split_once(".s")?;
    let is_ports = rest.len() == 2 && rest.ends_with('p');
    (digits.len() >= 5 && is_ports)
        .then(|| digits.parse().ok())
        .flatten()
}

/// Text of a file, version 1.1. Parameters that were not measured are 0.
pub(super) fn text(sweep: &Sweep, time_s: f64, parameter: [usize; 2], identity: &str) -> String {
    let [to, from] = parameter;
    let ports = ports(parameter);
    let mut text = format!("! S{to}{from} by {identity}\n");
    if ports > 1 {
        text += "! other parameters were not measured and are 0\n";
    }
    // Writing to a string cannot fail.
    let _ = writeln!(text, "{TIME}{time_s}\n# Hz S RI R 50");
    for (hz, value) in sweep.frequencies_hz.iter().zip(&sweep.values) {
        let _ = write!(text, "{hz}");
        for row in 1..=ports {
            for column in 1..=ports {
                // Two-port data have the order 11, 21, 12, 22.
                let place = if ports == 2 {
                    [column, row]
                } else {
                    [row, column]
                };
                match place == parameter {
                    true => {
                        let _ = write!(text, " {:e} {:e}", value.re, value.im);
                    }
                    false => text += " 0 0",
                }
            }
            if ports > 2 && row < ports {
                text.push('\n');
            }
        }
        text.push('\n');
    }
    text
}

/// Time of the sweep in the first lines of its file.
pub(super) fn time_s(text: &str) -> Option<f64> {
    let mut lines = text.lines().take(10);
    let time_s: f64 = lines
        .find_map(|line| line.strip_prefix(TIME))?
        .trim()
        .parse()
        .ok()?;
    time_s.is_finite().then_some(time_s)
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

    use num_complex::Complex64;
    use subaperture_io::touchstone;

    use super::*;

    #[test]
    fn files_are_read_with_the_same_numbers() {
        let sweep = Sweep {
            frequencies_hz: vec![1e9, 1.000_000_1e9],
            values: vec![Complex64::new(0.1, -1.0 / 3.0), Complex64::new(1e-12, 2.5)],
            ended: Instant::now(),
        };
        for parameter in [[1, 1], [2, 1], [1, 2], [2, 2], [3, 1], [2, 4]] {
            let name = name(17, parameter);
            assert_eq!(number(&name), Some(17));
            let text = text(&sweep, 1.0 / 7.0, parameter, "A, B");
            assert_eq!(time_s(&text), Some(1.0 / 7.0));
            let ports = touchstone::ports_of_name(&name);
            let read = touchstone::read(&text, ports, Some(parameter)).unwrap();
            assert_eq!(read.frequencies_hz, sweep.frequencies_hz);
            assert_eq!(read.values, sweep.values, "{parameter:?}");
        }
        for other in ["sweep1.s2p", "sweep00001.csv", "a00001.s2p"] {
            assert_eq!(number(other), None);
        }
    }
}
