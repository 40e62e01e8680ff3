//! The benchmark program on a case so small that it takes no time: its table, a single measurement, and refusals.

use std::fs;
use std::path::Path;
use std::process::Command;

use serde_json::Value;
use subaperture_tests::subap::Ran;

/// Pulses, samples, and pixels along each side.
const TINY: &str = "40x48x24";

/// Run the program with its files kept in `folder`.
fn bench(folder: &Path, line: &str) -> Ran {
    let mut command = Command::new(env!("CARGO_BIN_EXE_bench"));
    command
        .args(line.split_whitespace())
        .env("CARGO_TARGET_DIR", folder)
        .env("RUST_BACKTRACE", "1");
    command.output().unwrap().into()
}

/// Cells of a Markdown table's rows, without its header.
fn rows(text: &str) -> Vec<Vec<&str>> {
    let lines = text.lines().filter(|line| line.starts_with("| "));
    let rows = lines.map(|line| line.trim_matches('|').split('|').map(str::trim).collect());
    rows.skip(1).collect()
}

fn number(cell: &str) -> f64 {
    cell.parse()
        .unwrap_or_else(|_| panic!("'{cell}' is not a number"))
}

#[test]
fn table_has_row_for_each_former_and_thread_count() {
    let folder = tempfile::tempdir().unwrap();
    let line = format!("{TINY} --formers exact,bp:-45,ffbp,rdbp-thesis --threads 1,2 --no-peers");
    let ran = bench(folder.path(), &line);
    let text = ran.succeeded();
    for part in [
        "Machine: ",
        "Ceilings of 1 thread:",
        "Ceilings of 2 threads:",
        "torchbp: not measured",
        "FastSAR: not measured",
    ] {
        assert!(text.contains(part), "no '{part}' in {text}");
    }
    let rows = rows(text);
    let formers: Vec<_> = rows.iter().map(|row| (row[1], row[2])).collect();
    let expected = ["2", "1"]
        .map(|threads| ["exact", "bp:-45", "ffbp", "rdbp-thesis"].map(|former| (former, threads)));
    assert_eq!(formers, expected.concat());
    for row in &rows {
        assert_eq!(row[0], TINY);
        let [seconds, rate, error_db, scaled_db] = [3, 5, 6, 7].map(|i| number(row[i]));
        assert!(seconds >= 0.0 && rate > 0.0, "{row:?}");
        // Two float64 sums in different orders agree to the float32 of the image, 1e-7: -140 dB. The thesis's mode has no bound.
        let bound_db = match row[1] {
            "exact" => -130.0,
            "bp:-45" => -45.0,
            "ffbp" => -60.0,
            _ => 20.0,
        };
        assert!(error_db <= bound_db, "{row:?}");
        // The best complex factor is not worse than 1, except for the last printed digit.
        assert!(scaled_db <= error_db + 0.11, "{row:?}");
        assert!(row[9].ends_with(" %") && row[10].ends_with(" %"), "{row:?}");
    }
}

/// The measurement of another revision: JSON, from prepared files, with times as a function of pixels and pulses.
#[test]
fn one_measurement_is_a_line_of_json() {
    let folder = tempfile::tempdir().unwrap();
    assert_eq!(
        bench(folder.path(), "protocol").succeeded(),
        "subaperture-bench-1\n"
    );
    let missing = bench(folder.path(), &format!("measure {TINY} bp 100"));
    missing.failed(1, &["judged-24.npy"]);
    assert_eq!(
        bench(folder.path(), &format!("prepare {TINY} bp")).succeeded(),
        "true\n"
    );
    let ran = bench(folder.path(), &format!("measure {TINY} bp 100"));
    let measured: Value = serde_json::from_str(ran.succeeded()).unwrap();
    assert_eq!(measured["pairs"], 24.0 * 24.0 * 40.0);
    // 8 bytes for each sample and pixel.
    assert_eq!(measured["least_bytes"], 8.0 * (40.0 * 48.0 + 24.0 * 24.0));
    assert!(measured["seconds"].as_f64().unwrap() > 0.0);
    assert!(measured["error_db"].as_f64().unwrap() < -60.0);
    assert!(measured["operations"].as_f64().unwrap() > 24.0 * 24.0 * 40.0);

    // Samples in a format for other programs: a header of 128 bytes, and 8 bytes each.
    let cases = fs::read_dir(folder.path().join("bench")).unwrap();
    let cases: Vec<_> = cases.map(|entry| entry.unwrap().path()).collect();
    assert_eq!(cases.len(), 1, "{cases:?}");
    let samples = fs::metadata(cases[0].join("samples.npy")).unwrap();
    assert_eq!(samples.len(), 128 + 8 * 40 * 48);
}

#[test]
fn bench_refuses_unsupported_requests() {
    let folder = tempfile::tempdir().unwrap();
    let said = |line: &str, parts: &[&str]| bench(folder.path(), line).failed(1, parts);
    said("40x48 --no-peers", &["'40x48'", "gotcha"]);
    said(&format!("{TINY} --formers rdbq"), &["'rdbq'", "rdbp"]);
    said(&format!("{TINY} --formers bp:fine"), &["'bp:fine'"]);
    said("--threads 0", &["'0'"]);
    said("--round 3", &["--round"]);
    said("--against no-such-revision", &["no-such-revision"]);
    // A former that refuses, here because of 1.2 MiB of pixels, has a row.
    let line = "40x48x400 --formers pfa --threads 1 --no-peers --memory-mib 1";
    let ran = bench(folder.path(), line);
    let text = ran.succeeded();
    assert!(rows(text)[0][14].starts_with("not formed: "), "{text}");
}
