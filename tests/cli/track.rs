//! `subap track`, and images on the track that it wrote.

use std::fs;
use std::path::Path;

use serde_json::Value;
use subaperture_tests::subap::run;

/// A radar of the L band with two receivers, on a way that is recorded badly.
const WALK: &str = r#"name = "walk"

[scene]
reference = "0, 8, 0 m"
x = "-6, 6 m"
y = "4, 12 m"

[[scene.point]]
position = "-4, 6, 0 m"
[[scene.point]]
position = "-1.2, 9.4, 0 m"
[[scene.point]]
position = "1.9, 7.1, 0 m"
[[scene.point]]
position = "4.6, 10.2, 0 m"

[radar]
kind = "ideal"
pulses = 160
pri = "25 ms"
centre = "1.4 GHz"
bandwidth = "604 MHz"
samples = 151

[[radar.transmitter]]

[[radar.receiver]]
offset = "0.2, 0, 0 m"
[[radar.receiver]]
offset = "0.307, 0, 0 m"

[radar.noise]
power = "-15 dB"

[platform]
kind = "linear"
position = "-2, 0, 0 m"
velocity = "1, 0, 0 m/s"

[[platform.perturbation]]
kind = "vibration"
amplitude = "0, 6, 0 cm"
frequency = "0.4 Hz"

[navigation]                   # what is recorded wanders by decimetres
drift = "8, 8, 0 cm"
drift_time = "1 s"
fix_rate = "40 Hz"

"#;

fn peak_db(folder: &Path, image: &str) -> f64 {
    let text = fs::read(folder.join(image).join("image.json")).unwrap();
    let record: Value = serde_json::from_slice(&text).unwrap();
    record["brightest"]["level_db"].as_f64().unwrap()
}

#[test]
fn a_track_is_written_and_images_are_focused_on_it() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("walk.toml"), WALK).unwrap();
    run(at, "simulate walk.toml -o walk.cphd").succeeded();
    run(at, "track walk.cphd -o track.csv -v").succeeded();
    let text = fs::read_to_string(at.join("track.csv")).unwrap();
    assert_eq!(text.lines().count(), 162);
    assert!(at.join("track.png").exists());
    // Again, over its own files; as JSON.
    let told = run(at, "track walk.cphd -o track.csv --json");
    let told: Value = serde_json::from_str(told.succeeded()).unwrap();
    assert_eq!(told["schema"], "subaperture-track");
    let length_m = told["length_m"].as_f64().unwrap();
    println!("{told}");
    assert!((length_m - 4.0).abs() < 0.3, "{length_m}");
    assert_eq!(told["targets"].as_array().unwrap().len(), 4);
    let grid = "--grid x=-6:6:0.04,y=4:12:0.04 --channels all";
    run(at, &format!("focus walk.cphd {grid} --out recorded")).succeeded();
    run(
        at,
        &format!("focus walk.cphd {grid} --track track.csv --out found"),
    )
    .succeeded();
    let [recorded, found] = ["recorded", "found"].map(|image| peak_db(at, image));
    println!("recorded {recorded:.2} dB, found {found:.2} dB");
    // A unit scatterer reads 1 where the track is right.
    assert!(found > -0.7, "{found}");
    let record = fs::read_to_string(at.join("found/image.json")).unwrap();
    assert!(record.contains("track.csv"));
}

#[test]
fn what_tells_no_track_says_why_and_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("walk.toml"), WALK).unwrap();
    let simulate = "simulate walk.toml -o walk.cphd --set radar.pulses=40";
    run(at, simulate).succeeded();
    let track = |more: &str| run(at, &format!("track walk.cphd -o track.csv {more}"));
    track("--channels T1R1").failed(1, &["two receivers"]);
    track("--range 20m:30m").failed(1, &["nothing is seen", "--range"]);
    track("--range 10.5m:14m").failed(1, &["at a time at the most", "its ranges can be trusted"]);
    track("--range 7m").failed(2, &["ascending ranges"]);
    assert!(!at.join("track.csv").exists());
    fs::write(
        at.join("far.csv"),
        "time_s,x_m,y_m,z_m\n100,0,0,0\n200,1,0,0\n",
    )
    .unwrap();
    run(at, "focus walk.cphd --track far.csv --out image")
        .failed(1, &["no pulse is within", "far.csv"]);
}

/// Where the radar's origin is, as [`WALK`] has it: at x = -2 m in the middle of 160 pulses.
fn place_m(time_s: f64) -> [f64; 2] {
    let sway = 0.06 * (std::f64::consts::TAU * 0.4 * time_s).sin();
    [time_s - 0.025 * 159.0 / 2.0 - 2.0, sway]
}

/// A receiver's log: 20 places a second over 4 s of a way, each said to have noise of 4 cm an axis, and with so many times that.
fn log(times: f64, way: impl Fn(f64) -> [f64; 2]) -> String {
    let mut state = 5u64;
    // Twelve numbers of variance 1/12.
    let mut gaussian = || {
        let sum = (0..12).fold(-6.0, |sum, _| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            sum + (state >> 40) as f64 / f64::from(1 << 24)
        });
        0.04 * times * sum
    };
    let header = "time_s,x_m,y_m,z_m,sigma_x_m,sigma_y_m,sigma_z_m\n";
    let lines = (0..=80).map(|n| {
        let time_s = f64::from(n) / 20.0;
        let [x, y] = way(time_s).map(|at_m| at_m + gaussian());
        format!("{time_s:.3},{x:.4},{y:.4},0,0.04,0.04,0.04\n")
    });
    header.to_owned() + &lines.collect::<String>()
}

/// The brightest pixel within 80 cm of a reflector: how far from it, metres, and its level.
fn at_reflector(folder: &Path, track: &str, image: &str) -> [f64; 2] {
    let grid = "--grid x=1.1:2.7:0.02,y=6.3:7.9:0.02 --channels all";
    let line = format!("focus walk.cphd {grid} --track {track} --out {image}");
    run(folder, &line).succeeded();
    let text = fs::read(folder.join(image).join("image.json")).unwrap();
    let record: Value = serde_json::from_slice(&text).unwrap();
    let at = |k: usize| record["brightest"]["position_m"][k].as_f64().unwrap();
    let off_m = f64::hypot(at(0) - 1.9, at(1) - 7.1);
    [off_m, record["brightest"]["level_db"].as_f64().unwrap()]
}

/// Echoes know the track's shape and not where it lies, a receiver where it lies and not its shape: the recorded positions are half a metre
/// off. The mean of 81 places is known to 0.04 / 9 = 4 mm and their direction to 0.04 / (9 x 1.17 m) = 4 mrad, 27 mm at 7 m: the reflector is within
/// three times that, and a pixel. Without shape, phases err by 4 pi 0.04 / 0.21 = 2.4 rad, and of a mean of such phasors exp(-2.4^2 / 2) = -25 dB would be left.
#[test]
fn one_track_of_echoes_and_a_receiver_is_better_than_each() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let biased = WALK.replace("[navigation] ", "[navigation]\nbias = \"0.3, -0.4, 0 m\" ");
    fs::write(at.join("walk.toml"), biased).unwrap();
    fs::write(at.join("receiver.csv"), log(1.0, place_m)).unwrap();
    run(at, "simulate walk.toml -o walk.cphd").succeeded();
    run(at, "navigation receiver.csv -o alone.csv").succeeded();
    // The middle of the antennas is 12.675 cm ahead of the origin.
    // A tenth of a millisecond is a tenth of a millimetre, and is recorded.
    let arm = "--navigation receiver.csv --lever-arm -0.12675,0,0 --navigation-start=-0.0001";
    let both = at_reflector(at, &format!("fused {arm}"), "both");
    let echoes = at_reflector(at, "mpga", "echoes");
    let receiver = at_reflector(at, "alone.csv", "receiver");
    println!("off and level: both {both:?}, echoes {echoes:?}, receiver {receiver:?}");
    assert!(both[0] < 0.1 && both[1] > -0.7, "{both:?}");
    assert!(echoes[0] > 0.35 && echoes[1] > -0.7, "{echoes:?}");
    assert!(receiver[1] < -6.0, "{receiver:?}");
    let record = fs::read_to_string(at.join("both/image.json")).unwrap();
    assert!(record.contains("receiver.csv") && record.contains("\"fused\""));
    assert!(record.contains("\"navigation_start\": \"-0.0001\""));
    // Noise is as stated, that of some 160 numbers; increments are said to be less sure than they are, and make less than their share of chi-square.
    let told = run(at, &format!("track walk.cphd {arm} -o track.csv --json"));
    let told: Value = serde_json::from_str(told.succeeded()).unwrap();
    let told = &told["one_track"];
    let number = |key: &str| told[key].as_f64().unwrap();
    let agreement = number("chi_square") / number("chi_square_expected");
    assert!((0.5..1.3).contains(&agreement), "{told}");
    assert!(
        (number("positions_off_m") / (0.04 * 2f64.sqrt()) - 1.0).abs() < 0.3,
        "{told}"
    );
    assert_eq!(told["sources"][0]["used"], 81);
    assert!(at_reflector(at, "track.csv", "written")[0] < 0.1);
}

/// One reflector tells nobody's way, and a receiver that is good to 2 mm does.
#[test]
fn without_a_track_of_echoes_that_of_navigation_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let (before, _) = WALK.split_once("[[scene.point]]").unwrap();
    let (_, after) = WALK.split_once("[radar]\n").unwrap();
    let point = "[[scene.point]]\nposition = \"1.9, 7.1, 0 m\"\n";
    fs::write(
        at.join("walk.toml"),
        format!("{before}{point}\n[radar]\n{after}"),
    )
    .unwrap();
    fs::write(at.join("receiver.csv"), log(0.05, place_m)).unwrap();
    run(at, "simulate walk.toml -o walk.cphd").succeeded();
    let focus = |more: &str| {
        let grid = "--grid x=1.1:2.7:0.02,y=6.3:7.9:0.02 --channels all";
        run(
            at,
            &format!("focus walk.cphd {grid} --track fused --out image {more}"),
        )
    };
    focus("").failed(1, &["reflector"]);
    let ran = focus("--navigation receiver.csv --lever-arm -0.12675,0,0");
    ran.succeeded();
    assert!(
        ran.stderr.contains("the echoes tell no track"),
        "{}",
        ran.stderr
    );
    assert!(peak_db(at, "image") > -0.7, "{}", peak_db(at, "image"));
}

#[test]
fn one_track_says_what_does_not_fit() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("walk.toml"), WALK).unwrap();
    run(at, "simulate walk.toml -o walk.cphd").succeeded();
    // By the recording's own positions: no worse than by the echoes alone.
    let ran = run(
        at,
        "focus walk.cphd --channels all --grid x=1.1:2.7:0.02,y=6.3:7.9:0.02 --track fused --out own",
    );
    assert!(
        ran.succeeded().contains("the recording's own positions"),
        "{}",
        ran.stdout
    );
    assert!(peak_db(at, "own") > -0.7, "{}", peak_db(at, "own"));
    let track = |more: &str| run(at, &format!("track walk.cphd -o track.csv {more}"));
    // Twice as far as the echoes have it; and places four times as bad as they say.
    fs::write(at.join("far.csv"), log(1.0, |t| [2.0 * t, 0.0])).unwrap();
    track("--navigation far.csv")
        .failed(1, &["contradict each other", "may not be the recording's"]);
    fs::write(at.join("bad.csv"), log(4.0, place_m)).unwrap();
    let ran = track("--navigation bad.csv --json");
    let told: Value = serde_json::from_str(ran.succeeded()).unwrap();
    // Of 81 places the median tells the square to 1 / (ln 2 sqrt(81)) = 16 %, so the root to 8 %; three of that.
    let widened = told["one_track"]["widened"].as_f64().unwrap();
    assert!((widened / 4.0 - 1.0).abs() < 0.24, "{widened}");
    assert!(
        ran.stderr.contains("is off the echoes by"),
        "{}",
        ran.stderr
    );
    fs::write(at.join("late.csv"), log(1.0, place_m).replace("\n", "\n10")).unwrap();
    track("--navigation late.csv").failed(
        1,
        &["late.csv", "of the recording's clock", "--navigation-start"],
    );
    track("--navigation far.csv --navigation far.csv").failed(1, &["one log each"]);
    // One place 10 m off is left out, and does not make the others worse.
    let good = log(1.0, place_m);
    let wild = |n: usize, line: &str| {
        let mut fields: Vec<&str> = line.split(',').collect();
        if n == 40 {
            fields[1] = "8";
        }
        fields.join(",")
    };
    let wild: Vec<String> = good
        .lines()
        .enumerate()
        .map(|(n, line)| wild(n, line))
        .collect();
    fs::write(at.join("wild.csv"), wild.join("\n")).unwrap();
    let told = track("--lever-arm -0.12675,0,0 --navigation wild.csv --json");
    let told: Value = serde_json::from_str(told.succeeded()).unwrap();
    let told = &told["one_track"];
    assert!(
        told["widened"].is_null() && told["left_out"]["positions"] == 1,
        "{told}"
    );
    let off_m = told["positions_off_m"].as_f64().unwrap();
    assert!((off_m / (0.04 * 2f64.sqrt()) - 1.0).abs() < 0.3, "{told}");
    // What cannot be computed with is told for what it is.
    track("--navigation far.csv --lever-arm 2e9,0,0")
        .failed(1, &["no track can be computed", "arm_m is 2000000000"]);
    track("--lever-arm 0,0,0").failed(2, &["--navigation"]);
    run(
        at,
        "focus walk.cphd --navigation far.csv --track mpga --out image",
    )
    .failed(2, &["--track fused"]);
    // A target that moves spoils the echoes' own track, and then nobody is believed.
    let moving = WALK.replace("[radar]\n", "[[scene.mover]]\nkind = \"linear\"\nposition = \"-2, 7, 0 m\"\nvelocity = \"0.6, -0.3, 0 m/s\"\n\n[radar]\n");
    fs::write(at.join("walk.toml"), moving).unwrap();
    run(at, "simulate walk.toml -o walk.cphd").succeeded();
    track("--navigation far.csv")
        .failed(1, &["neither can be trusted", "5.", "times what it states"]);
}
