//! Words and numbers for people.

use std::io::{self, Write};
use std::time::Duration;

/// Why a result could not be printed.
#[derive(Debug, thiserror::Error)]
pub(crate) enum SayError {
    /// Whoever read standard output has seen enough, which is no failure.
    #[error("nobody reads standard output any more")]
    ReaderGone,
    /// The operating system refused.
    #[error("cannot write to standard output: {0}")]
    Io(io::Error),
}

impl From<io::Error> for SayError {
    fn from(error: io::Error) -> Self {
        match error.kind() {
            io::ErrorKind::BrokenPipe => Self::ReaderGone,
            _ => Self::Io(error),
        }
    }
}

/// Prints a result, a line or several, on standard output.
///
/// # Errors
/// [`SayError`].
pub(crate) fn say(line: impl AsRef<str>) -> Result<(), SayError> {
    print(format!("{}\n", line.as_ref().trim_end_matches('\n')).as_bytes())
}

/// Puts bytes on standard output as they are.
///
/// # Errors
/// [`SayError`].
pub(crate) fn print(bytes: &[u8]) -> Result<(), SayError> {
    let mut out = io::stdout().lock();
    out.write_all(bytes)?;
    Ok(out.flush()?)
}

/// Bytes in the unit that suits.
pub(crate) fn bytes(count: u128) -> String {
    let mut value = count as f64;
    for unit in ["bytes", "KiB", "MiB", "GiB"] {
        if value < 1024.0 {
            return if unit == "bytes" {
                format!("{value} {unit}")
            } else {
                format!("{value:.1} {unit}")
            };
        }
        value /= 1024.0;
    }
    format!("{value:.1} TiB")
}

/// A duration to a tenth of a second, or in minutes.
pub(crate) fn duration(taken: Duration) -> String {
    let seconds = taken.as_secs_f64();
    if seconds < 100.0 {
        format!("{seconds:.1} s")
    } else {
        format!("{} min {:.0} s", taken.as_secs() / 60, seconds % 60.0)
    }
}

/// Metres with the digits that matter, or `none`.
pub(crate) fn metres(value: Option<f64>) -> String {
    match value {
        None => "none".to_owned(),
        Some(v) if v.abs() >= 10_000.0 => format!("{:.2} km", v / 1000.0),
        Some(v) if v.abs() >= 100.0 => format!("{v:.1} m"),
        Some(v) if v.abs() >= 1.0 => format!("{v:.2} m"),
        Some(v) => format!("{v:.4} m"),
    }
}

/// Degrees to a hundredth, without a minus before zero.
pub(crate) fn degrees(value: f64) -> String {
    let rounded = (value * 100.0).round() / 100.0;
    // Adding zero turns -0 into 0.
    format!("{:.2} deg", rounded + 0.0)
}

/// Hertz in the unit that suits.
pub(crate) fn hertz(value: f64) -> String {
    match value.abs() {
        v if v >= 1e9 => format!("{:.5} GHz", value / 1e9),
        v if v >= 1e6 => format!("{:.4} MHz", value / 1e6),
        v if v >= 1e3 => format!("{:.3} kHz", value / 1e3),
        _ => format!("{value:.3} Hz"),
    }
}

/// A table with its columns aligned, the first to the left, the others to the right.
pub(crate) fn table(header: &[&str], rows: &[Vec<String>]) -> String {
    let width = |column: usize| {
        let cells = rows.iter().map(|row| row[column].chars().count());
        cells
            .chain([header[column].chars().count()])
            .max()
            .unwrap_or(0)
    };
    let widths: Vec<usize> = (0..header.len()).map(width).collect();
    let line = |cells: &[String]| {
        let padded = cells
            .iter()
            .zip(&widths)
            .enumerate()
            .map(|(column, (cell, &width))| {
                if column == 0 {
                    format!("{cell:<width$}")
                } else {
                    format!("{cell:>width$}")
                }
            });
        padded.collect::<Vec<_>>().join("  ").trim_end().to_owned()
    };
    let titles: Vec<String> = header.iter().map(|title| (*title).to_owned()).collect();
    let mut lines = vec![line(&titles)];
    lines.extend(rows.iter().map(|row| line(row)));
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_well() {
        assert_eq!(bytes(512), "512 bytes");
        assert_eq!(bytes(8_000_000_000_000), "7.3 TiB");
        assert_eq!(duration(Duration::from_millis(1234)), "1.2 s");
        assert_eq!(duration(Duration::from_secs(125)), "2 min 5 s");
        assert_eq!(metres(None), "none");
        assert_eq!(metres(Some(0.2408)), "0.2408 m");
        assert_eq!(degrees(-0.001), "0.00 deg");
        assert_eq!(hertz(9.6e9), "9.60000 GHz");
    }

    #[test]
    fn tables_are_aligned() {
        let rows = vec![
            vec!["bp".to_owned(), "-46.5".to_owned()],
            vec!["exact".to_owned(), "0".to_owned()],
        ];
        assert_eq!(
            table(&["former", "dB"], &rows),
            "former     dB\nbp      -46.5\nexact       0"
        );
    }
}
