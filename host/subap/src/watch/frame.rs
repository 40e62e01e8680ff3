//! One frame of the terminal view as text, limited to the terminal's width and height.

use subaperture::quantity::bytes;
use subaperture::radio::live::{Level, Row, Status};

use crate::terminal::printable;

/// Width of the level labels left of the curve, columns.
const LEFT: usize = 8;
/// Dynamic range of the curve, dB.
const SPAN_DB: f32 = 60.0;
/// Dynamic range of a level's bar, dB.
const BAR_DB: f64 = 90.0;
/// Number of lines in addition to the curve's.
const OTHER_LINES: usize = 9;
/// Block characters filled by eighths from below.
const EIGHTHS: [char; 9] = [' ', '▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
/// Block characters filled by eighths from the left.
const LEFT_EIGHTHS: [char; 8] = [' ', '▏', '▎', '▍', '▌', '▋', '▊', '▉'];

const FLAGS: [&str; 5] = ["late", "lost", "unsteady", "clipped", "unlocked"];
const EVENTS: [&str; 5] = [
    "overflows",
    "underflows",
    "late commands",
    "lost packets",
    "gone",
];

/// State in one line, for output that is not a terminal.
pub(super) fn line(status: &Status, row: Option<&Row>) -> String {
    let mut words = vec![sweeps(status)];
    if let Some((range_m, level_db)) = row.and_then(|row| strongest(status, row)) {
        words.push(format!("strongest {range_m:.2} m at {level_db:.1} dB"));
    }
    let [reference, echo] = status.levels.map(|level| decibels(level.rms));
    words.push(format!("reference {reference}, echo {echo} of full scale"));
    words.extend(wrong(status));
    words.join(", ")
}

/// State as a picture of characters.
pub(super) fn frame(
    status: &Status,
    row: Option<&Row>,
    columns: usize,
    rows: usize,
) -> Vec<String> {
    // Some terminals wrap after the last column.
    let width = columns.saturating_sub(1).max(LEFT + 8);
    let height = rows.saturating_sub(OTHER_LINES + 1).clamp(3, 16);
    let mut lines = vec![
        format!(
            "{}: {}",
            printable(&status.name).replace(['\n', '\t'], " "),
            sweeps(status)
        ),
        [
            room(status),
            format!("{} of {} carriers", status.usable, status.steps),
        ]
        .join(", "),
    ];
    match row {
        Some(row) => lines.extend(curve(status, row, width, height)),
        None => lines.push("no profile yet".to_owned()),
    }
    for (name, level) in ["reference", "echo"].into_iter().zip(status.levels) {
        lines.push(bar(name, level, width));
    }
    let wrong = wrong(status);
    lines.push(match wrong.is_empty() {
        true => "no losses".to_owned(),
        false => wrong.join(", "),
    });
    let cut = |line: String| -> String { line.chars().take(width).collect() };
    lines.into_iter().map(cut).take(rows.max(1)).collect()
}

fn sweeps(status: &Status) -> String {
    let taken = status.sweep.map_or(0, |sweep| sweep + 1);
    let of = match status.sweeps {
        0 => String::new(),
        all => format!(" of {all}"),
    };
    let rate = status
        .rate_hz
        .map_or_else(String::new, |rate| format!(", {rate:.2} per second"));
    format!("sweep {taken}{of}{rate}")
}

fn room(status: &Status) -> String {
    let counts = &status.counts;
    let queue = format!("queue {} of {}", counts.queue, counts.queue_holds);
    let Some(free) = status.free_bytes else {
        return queue;
    };
    let lasts = status.disk_lasts_s.map_or_else(String::new, |lasts_s| {
        let hours = lasts_s / 3600.0;
        match hours < 2.0 {
            true => format!(" for {:.0} min", (60.0 * hours).floor()),
            false => format!(" for {:.0} h", hours.floor()),
        }
    });
    format!("{queue}, disk {} free{lasts}", bytes(free.into()))
}

/// Counts of all faults so far.
fn wrong(status: &Status) -> Vec<String> {
    let counts = &status.counts;
    let named = FLAGS
        .iter()
        .zip(counts.flagged)
        .chain(EVENTS.iter().zip(counts.events))
        .map(|(name, count)| (*name, count));
    let others = [
        ("samples lost", counts.lost_samples),
        ("late sweeps", counts.late_sweeps),
        ("waits for the disk", counts.waits),
        ("steps not shown", counts.not_shown),
    ];
    let all = named.chain(others).filter(|(_, count)| *count > 0);
    all.map(|(name, count)| format!("{count} {name}")).collect()
}

fn decibels(part: f64) -> String {
    match part > 0.0 {
        true => format!("{:.1} dB", 20.0 * part.log10()),
        false => "silent".to_owned(),
    }
}

/// Range and level of the strongest range cell.
fn strongest(status: &Status, row: &Row) -> Option<(f64, f32)> {
    let places = row.levels_db.iter().copied().enumerate();
    let (place, level_db) = places.max_by(|a, b| a.1.total_cmp(&b.1))?;
    Some((range_m(status, place, row.levels_db.len()), level_db))
}

fn range_m(status: &Status, place: usize, places: usize) -> f64 {
    let [from_m, to_m] = status.ranges_m;
    from_m + (to_m - from_m) * place as f64 / places.saturating_sub(1).max(1) as f64
}

/// Range profile as block characters with its axis and the strongest range cell.
fn curve(status: &Status, row: &Row, width: usize, height: usize) -> Vec<String> {
    let across = width - LEFT;
    let places = row.levels_db.len();
    // Each column shows the maximum of its range cells.
    let mut highest = vec![f32::NEG_INFINITY; across];
    for (place, level_db) in row.levels_db.iter().enumerate() {
        let column = place * across / places;
        highest[column] = highest[column].max(*level_db);
    }
    // More columns than range cells: each shows the cell in which it lies.
    for (column, level_db) in highest.iter_mut().enumerate() {
        if *level_db == f32::NEG_INFINITY {
            *level_db = row.levels_db[(column * places / across).min(places - 1)];
        }
    }
    let most = highest.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let top = 5.0 * (most / 5.0 + 0.2).ceil();
    let eighths = |level_db: f32| {
        let part = ((level_db - (top - SPAN_DB)) / SPAN_DB).clamp(0.0, 1.0);
        (part * (8 * height) as f32).round() as usize
    };
    let filled: Vec<usize> = highest.iter().map(|level_db| eighths(*level_db)).collect();
    let mut lines = Vec::with_capacity(height + 3);
    for line in 0..height {
        let below = 8 * (height - 1 - line);
        let label = match line % 4 {
            0 => format!("{:>5.0}", top - SPAN_DB * line as f32 / height as f32),
            _ => " ".repeat(5),
        };
        let unit = if line == 0 { "dB" } else { "  " };
        let blocks = filled
            .iter()
            .map(|all| EIGHTHS[all.saturating_sub(below).min(8)]);
        lines.push(format!("{label}{unit}│{}", blocks.collect::<String>()));
    }
    lines.push(format!("{}└{}", " ".repeat(LEFT - 1), "─".repeat(across)));
    let [from_m, to_m] = status.ranges_m;
    let middle = format!("{:.1}", 0.5 * (from_m + to_m));
    let last = format!("{to_m:.1} m");
    let first = format!("{from_m:.1}");
    let room = across.saturating_sub(first.len() + middle.len() + last.len());
    let gaps = [room / 2, room - room / 2].map(|gap| " ".repeat(gap));
    lines.push(format!(
        "{}{first}{}{middle}{}{last}",
        " ".repeat(LEFT),
        gaps[0],
        gaps[1]
    ));
    if let Some((range_m, level_db)) = strongest(status, row) {
        let of = match status.calibrated {
            true => "the calibration's reflector",
            false => "the reference",
        };
        lines.push(format!(
            "strongest at {range_m:.2} m, {level_db:.1} dB of {of}"
        ));
    }
    lines
}

/// Level as a bar with its peak.
fn bar(name: &str, level: Level, width: usize) -> String {
    let clipped = match level.clipped {
        0 => String::new(),
        count => format!(", {count} clipped"),
    };
    let text = format!(
        " {} RMS, {} peak{clipped}",
        decibels(level.rms),
        decibels(level.peak)
    );
    let across = width.saturating_sub(12 + text.chars().count()).clamp(4, 60);
    let db = 20.0 * level.rms.max(1e-9).log10();
    let eighths = ((1.0 + db / BAR_DB).clamp(0.0, 1.0) * (8 * across) as f64).round() as usize;
    let mut blocks = "█".repeat(eighths / 8);
    if !eighths.is_multiple_of(8) {
        blocks.push(LEFT_EIGHTHS[eighths % 8]);
    }
    format!("{name:<10}▕{blocks:<across$}▏{text}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use subaperture::radio::live::Counts;

    fn status() -> Status {
        let level = |rms, peak, clipped| Level { rms, peak, clipped };
        Status {
            name: "a\u{1b}[2J\nname".to_owned(),
            steps: 50,
            sweeps: 20,
            sweep: Some(11),
            usable: 49,
            levels: [level(0.1, 0.2, 0), level(0.5, 1.0, 17)],
            rate_hz: Some(3.25),
            counts: Counts {
                flagged: [0, 3, 0, 2, 0],
                events: [3, 0, 0, 0, 0],
                lost_samples: 400,
                queue: 5,
                queue_holds: 64,
                ..Counts::default()
            },
            free_bytes: Some(5_000_000_000),
            disk_lasts_s: Some(7200.0),
            ranges_m: [0.0, 25.5],
            ..Status::default()
        }
    }

    /// Triangular profile with a slope of 1 dB per cell and its top at cell 102 of 256: 10.2 m.
    fn row() -> Row {
        let level = |place: i32| -12.0 - (place - 102).abs() as f32;
        Row {
            sweep: 11,
            levels_db: (0..256).map(level).collect(),
        }
    }

    /// The maximum is in the column of cell 102: of 256 cells in 92 columns, the 36th.
    #[test]
    fn a_frame_fits_the_terminal_and_shows_the_state() {
        let lines = frame(&status(), Some(&row()), 101, 24);
        assert!(lines.len() <= 24 && lines.iter().all(|line| line.chars().count() <= 100));
        let all = lines.join("\n");
        println!("{all}");
        for text in [
            "sweep 12 of 20, 3.25 per second",
            "queue 5 of 64, disk 4.7 GiB free for 2 h",
            "49 of 50 carriers",
            "strongest at 10.20 m, -12.0 dB of the reference",
            "-20.0 dB RMS, -14.0 dB peak",
            "17 clipped",
            "3 lost, 2 clipped, 3 overflows, 400 samples lost",
            "25.5 m",
        ] {
            assert!(all.contains(text), "{text}");
        }
        assert!(!all.contains('\u{1b}'));
        let curve: Vec<&String> = lines.iter().filter(|line| line.contains('│')).collect();
        let columns: Vec<Vec<char>> = curve
            .iter()
            .map(|line| line.chars().skip(LEFT).collect())
            .collect();
        let height = |column: usize| -> usize {
            let of = |line: &Vec<char>| {
                EIGHTHS
                    .iter()
                    .position(|block| *block == line[column])
                    .unwrap()
            };
            columns.iter().map(of).sum()
        };
        let top = (0..columns[0].len()).max_by_key(|column| (height(*column), usize::MAX - column));
        assert_eq!(top, Some(102 * 92 / 256));
        // -12 dB below a top of -10 dB, of 60 dB in 14 lines of eighths.
        assert_eq!(height(36), (58.0f64 / 60.0 * 112.0).round() as usize);
        // Empty where the level is 60 dB below the top.
        assert_eq!(height(91), 0);
    }

    #[test]
    fn frame_fits_small_terminals_and_empty_states() {
        for (columns, rows) in [(0, 0), (1, 1), (20, 5), (300, 100)] {
            for row in [
                None,
                Some(row()),
                Some(Row {
                    sweep: 0,
                    levels_db: vec![-3.0],
                }),
            ] {
                let lines = frame(&Status::default(), row.as_ref(), columns, rows);
                assert!(!lines.is_empty() && lines.len() <= rows.max(1));
                let widest = columns.saturating_sub(1).max(LEFT + 8);
                assert!(lines.iter().all(|line| line.chars().count() <= widest));
            }
        }
        let text = line(&status(), Some(&row()));
        assert!(
            text.starts_with("sweep 12 of 20") && text.contains("strongest 10.20 m at -12.0 dB"),
            "{text}"
        );
        assert!(line(&Status::default(), None).contains("reference silent, echo silent"));
    }
}
