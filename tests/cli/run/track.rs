//! `subap run` with a track that is estimated or read from a file.

use std::fs;

use subaperture::io::product;
use subaperture_tests::subap::{run, write_recording};

use super::{done, record};

const JOB: &str = r#"
[input]
files = "../walk.cphd"
channel = "T1R1"

[track]
source = "mpga"

[grid]
pixels = "x=-3:3:0.1,y=2:8:0.1"

[former]
algorithm = "bp"
window = "hamming"

[check]
pixels = 0

[picture]
top = "-10 dB"
span = "45 dB"

[quality]
points = 0
"#;

#[test]
fn job_focuses_on_the_track_that_it_estimates_or_reads() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let example = run(at, "simulate --example walk");
    write_recording(at, "walk", example.succeeded());
    fs::create_dir(at.join("jobs")).unwrap();
    let at = at.join("jobs");
    fs::write(at.join("job.toml"), JOB).unwrap();
    let stages = ["track", "focus", "picture", "quality", "report"];
    assert_eq!(done(&run(&at, "run job.toml --json")), stages);
    assert_eq!(done(&run(&at, "run job.toml --json")), [""; 0]);
    run(
        &at,
        "focus ../walk.cphd --channel T1R1 --track job/track.csv -a bp --window hamming --grid x=-3:3:0.1,y=2:8:0.1 --out direct",
    )
    .succeeded();
    let direct = product::read(&at.join("direct")).unwrap();
    let own = product::read(&at.join("job")).unwrap();
    assert_eq!(own.image.pixels, direct.image.pixels);
    run(
        &at,
        "picture direct --top -10 --span 45 -o direct-picture.png",
    )
    .succeeded();
    assert_eq!(
        fs::read(at.join("direct-picture.png")).unwrap(),
        fs::read(at.join("job/picture.png")).unwrap()
    );

    // The same track from a file: no stage estimates it, and the file is a dependency of focusing.
    fs::copy(at.join("job/track.csv"), at.join("known.csv")).unwrap();
    let from_file = JOB.replace("\"mpga\"", "\"file\"\nfile = \"known.csv\"");
    fs::write(at.join("file.toml"), from_file).unwrap();
    assert_eq!(done(&run(&at, "run file.toml --json")), stages[1..]);
    let read = product::read(&at.join("file")).unwrap();
    assert_eq!(read.image.pixels, direct.image.pixels);
    let settings = &record(&at.join("file/job.json"))["stages"]["focus"]["basis"]["settings"];
    assert_eq!(settings["track.source"], "file");
    let text = fs::read_to_string(at.join("known.csv")).unwrap();
    fs::write(at.join("known.csv"), text.replacen('#', "# ", 1)).unwrap();
    let again = run(&at, "run file.toml --json");
    assert!(again.succeeded().contains("input files have changed"));
    assert_eq!(done(&again), stages[1..]);
}
