//! `subap focus --beam`: a long strip without the ghosts from pulses whose beam does not cover the position.

use std::fs;
use std::path::Path;

use subaperture::image::{Image, power};
use subaperture::io::cphd::{self, Channel, WriteOptions};
use subaperture::io::npy;
use subaperture::monitor::Silent;
use subaperture::simulate::scenario::Scenario;
use subaperture_tests::subap::{run, write_recording};

/// Half-power width of each antenna, degrees.
const WIDTH_DEG: f64 = 2.0;
const RANGE_M: f64 = 1000.0;
pub(crate) const SPEED_M_S: f64 = 100.0;
const PRI_S: f64 = 1.0 / 300.0;
pub(crate) const WAVELENGTH_M: f64 = 299_792_458.0 / 10e9;

/// A strip of 240 m past one point, by an antenna whose beam covers 35 m.
fn strip() -> String {
    strip_looking("0, 1, 0", "kind = \"ideal\"")
}

/// The same strip by antennas with this boresight, body axes, and kind of radar.
pub(crate) fn strip_looking(boresight: &str, radar: &str) -> String {
    format!(
        r#"name = "strip"

[scene]
reference = "0, 1000, 0 m"
x = "-60, 60 m"
y = "997, 1003 m"

[[scene.point]]
position = "0, 1000, 0 m"

[radar]
{radar}
pulses = 721
pri = "{} ms"
centre = "10 GHz"
bandwidth = "50 MHz"
samples = 48

[[radar.transmitter]]
pattern = "gaussian"
boresight = "{boresight}"
azimuth = "{WIDTH_DEG} deg"
elevation = "40 deg"

[[radar.receiver]]
pattern = "gaussian"
boresight = "{boresight}"
azimuth = "{WIDTH_DEG} deg"
elevation = "40 deg"

[platform]
kind = "linear"
position = "0, 0, 0 m"
velocity = "{SPEED_M_S}, 0, 0 m/s"
at = "middle"
"#,
        1e3 * PRI_S
    )
}

/// Write `strip.cphd` from a scenario, without its antenna patterns.
fn write_without_antennas(at: &Path, scenario: &str) {
    let experiment = Scenario::new("strip", scenario, at).experiment().unwrap();
    let recorded = experiment.record(experiment.pairs()[0]).unwrap();
    let channel = [Channel::new("1", &recorded)];
    let file = at.join("strip.cphd");
    cphd::write(file, &channel, &WriteOptions::default(), &Silent).unwrap();
}

const COLUMNS: usize = 481;
const STEP_M: f64 = 0.25;

fn focused(at: &Path, options: &str) -> Image {
    let line = format!(
        "focus strip.cphd --grid x=-60:60.1:{STEP_M},y=999:1001.1:1 --window none --slow-window none -a bp --out image {options}"
    );
    run(at, &line).succeeded();
    npy::read(&at.join("image/image.npy")).unwrap()
}

/// Largest level between two positions along x at the point's range, dB.
fn level_db(image: &Image, from_m: f64, to_m: f64) -> f64 {
    assert_eq!((image.rows, image.columns), (3, COLUMNS));
    let column = |x_m: f64| ((x_m + 60.0) / STEP_M).round() as usize;
    let line = &image.pixels[COLUMNS..2 * COLUMNS];
    let most = line[column(from_m)..=column(to_m)]
        .iter()
        .map(|&z| power(z))
        .fold(0.0, f64::max);
    10.0 * most.log10()
}

/// Amplitude of the two-way pattern at an angle from the beam's middle, degrees: half the power one way at half the width.
fn two_way(angle_deg: f64) -> f64 {
    (-4.0 * std::f64::consts::LN_2 * (angle_deg / WIDTH_DEG).powi(2)).exp()
}

/// Mean two-way amplitude over the beam's width about an angle.
fn mean(angle_deg: f64) -> f64 {
    let count = 2001;
    let at = |i: i32| angle_deg + WIDTH_DEG * (f64::from(i) / f64::from(count - 1) - 0.5);
    (0..count).map(|i| two_way(at(i))).sum::<f64>() / f64::from(count)
}

/// An echo is sampled at the pulse repetition frequency, so it also fits a position `lambda R / (2 v T)` further along the track. With all
/// pulses this ghost is as strong as the point except for its range, off by a metre and a half of three. With the pulses whose beam covers
/// the ghost's position, the point is on the flank of the antenna pattern.
#[test]
fn beam_suppresses_azimuth_ambiguities_and_keeps_the_scale() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    write_recording(at, "strip", strip());
    let ghost_m = WAVELENGTH_M * RANGE_M / (2.0 * SPEED_M_S * PRI_S);
    let ghost_deg = (ghost_m / RANGE_M).asin().to_degrees();
    let ghosts = |image: &Image| {
        let right = level_db(image, ghost_m - 4.0, ghost_m + 4.0);
        right.max(level_db(image, -ghost_m - 4.0, -ghost_m + 4.0))
    };
    let all = focused(at, "--beam none");
    let before_db = ghosts(&all) - level_db(&all, -1.0, 1.0);
    let one = focused(at, "--beam 2deg");
    let point_db = level_db(&one, -1.0, 1.0);
    let after_db = ghosts(&one) - point_db;
    println!(
        "ghost at {ghost_m:.1} m: {before_db:.1} dB of all pulses, {after_db:.1} dB in the beam"
    );
    assert!(before_db > -8.0, "{before_db}");
    // Upper limit by coherent addition: the mean amplitude of the point in pulses whose beam covers the ghost, shifted towards it by half an eighth of the
    // aperture, the largest offset of a block's aperture, and by the 4 m within which the ghost is searched; relative to the point's own.
    let nearest_deg = ghost_deg - WIDTH_DEG / 16.0 - (4.0 / RANGE_M).to_degrees();
    let bound_db = 20.0 * (mean(nearest_deg) / mean(WIDTH_DEG / 16.0)).log10();
    assert!(after_db < bound_db, "{after_db} {bound_db}");
    assert!(after_db < before_db - 15.0, "{after_db} {before_db}");
    // A unit scatterer has the mean of its amplitude over its aperture: between that of an aperture about it and of a shifted one.
    let [least_db, most_db] = [WIDTH_DEG / 16.0, 0.0].map(|off| 20.0 * mean(off).log10());
    assert!(
        point_db > least_db - 0.05 && point_db < most_db + 0.05,
        "{point_db}"
    );
    // Another former gives the same image; each is within -60 dB of its sum.
    let line = "focus strip.cphd --grid x=-60:60.1:0.25,y=999:1001.1:1 --window none --slow-window none -a ffbp --beam 2deg --out other";
    run(at, line).succeeded();
    let compared = run(at, "compare other image --error-db -54");
    compared.succeeded();
}

#[test]
fn pixels_outside_the_beam_are_zero_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    write_recording(at, "strip", strip());
    let grid = "--grid x=100:160:1,y=999:1001.1:1 -a bp --out edge";
    let edge = run(at, &format!("focus strip.cphd {grid} --beam 2deg"));
    edge.succeeded();
    assert!(edge.stderr.contains("illuminated by no pulse"), "{edge:?}");
    let grid = "--grid x=1000:1060:1,y=999:1001.1:1 -a bp --out away";
    run(at, &format!("focus strip.cphd {grid} --beam 2deg")).failed(1, &["no pulse sees the grid"]);
    run(
        at,
        &format!("focus strip.cphd {grid} --beam 100deg --squint 60deg"),
    )
    .failed(2, &["--beam", "along the track"]);
}

/// Width and squint of a printed beam, degrees.
fn beam_line(stderr: &str) -> [f64; 2] {
    let (_, line) = stderr
        .split_once("note: beam: ")
        .unwrap_or_else(|| panic!("no beam: {stderr}"));
    let number = |text: &str| text.trim().parse::<f64>().unwrap();
    let (width, rest) = line.split_once(" deg wide,").unwrap();
    let (squint, _) = rest.split_once(" deg forward").unwrap();
    [number(width), number(squint)]
}

fn record(at: &Path, image: &str) -> serde_json::Value {
    let text = fs::read_to_string(at.join(image).join("image.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

/// A tenth of the beam width. The spectrum of one point that passes through the whole Gaussian beam is the pattern itself, over angles that
/// the track limits to 3 widths, where the power is below 1e-20 of the maximum, weighted by `d theta / d x = cos^2 theta / R`, which varies
/// by 1 %. The 48 frequencies differ by 0.5 %. A tenth is far more.
const TOLERANCE_DEG: f64 = 0.1 * WIDTH_DEG;

/// Positions are seen within 13.7 deg, and the pulses sample 2.6 deg without ambiguity: without an option the beam is estimated, used as
/// weight, and reported.
#[test]
fn strip_is_weighted_by_its_doppler_spectrum_by_default() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    write_without_antennas(at, &strip());
    let ghost_m = WAVELENGTH_M * RANGE_M / (2.0 * SPEED_M_S * PRI_S);
    let grid = "--grid x=-60:60.1:0.25,y=999:1001.1:1 --window none --slow-window none -a bp";
    let by_default = run(at, &format!("focus strip.cphd {grid} --out image"));
    by_default.succeeded();
    let [width_deg, squint_deg] = beam_line(&by_default.stderr);
    assert!((width_deg - WIDTH_DEG).abs() < TOLERANCE_DEG, "{width_deg}");
    assert!(squint_deg.abs() < TOLERANCE_DEG, "{squint_deg}");
    let image = npy::read(&at.join("image/image.npy")).unwrap();
    assert!(
        !by_default.stderr.contains("ghosts"),
        "{}",
        by_default.stderr
    );
    let ghost_db = level_db(&image, ghost_m - 4.0, ghost_m + 4.0) - level_db(&image, -1.0, 1.0);
    println!("estimated {width_deg} deg, ghost {ghost_db:.1} dB");
    assert!(ghost_db < -20.0, "{ghost_db}");
    let beam = record(at, "image")["settings"]["resolved"]["beam"].clone();
    assert_eq!(beam["source"], "estimated");
    assert!((beam["width_deg"].as_f64().unwrap() - width_deg).abs() < 1e-3);
    // The measured error against the float64 sum of the same pulses is within the bound.
    let checked = run(
        at,
        &format!("focus strip.cphd {grid} --check 200 --out checked"),
    );
    checked.succeeded();
    let check = record(at, "checked")["check"].clone();
    assert!(
        check["relative_to_image_db"].as_f64().unwrap() < -60.0,
        "{check}"
    );
    // Tiles, an executed plan and a dry run use the same beam.
    run(at, &format!("focus strip.cphd {grid} --tiled --out tiled")).succeeded();
    run(at, "compare image tiled --error-db -120").succeeded();
    run(at, &format!("plan focus strip.cphd {grid} --out plan.json")).succeeded();
    run(at, "focus strip.cphd --plan plan.json --out planned").succeeded();
    run(at, "compare image planned --error-db -120").succeeded();
    assert_eq!(record(at, "planned")["settings"]["resolved"]["beam"], beam);
    let rehearsed = run(at, &format!("focus strip.cphd {grid} --dry-run --out none"));
    rehearsed.succeeded();
    assert_eq!(beam_line(&rehearsed.stderr), [width_deg, squint_deg]);
    // A stationary target is one with velocity 0.
    run(
        at,
        &format!("focus strip.cphd {grid} --velocity 0,0 --beam auto --out still"),
    )
    .succeeded();
    run(at, "compare image still --error-db -100").succeeded();
}

/// At 5 deg forward, 1.94 cycles per pulse, the squint is ambiguous with a spacing of 2.6 deg.
#[test]
fn squinted_beam_is_estimated_near_given_squint() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let boresight = format!(
        "{}, {}, 0",
        5f64.to_radians().sin(),
        5f64.to_radians().cos()
    );
    write_without_antennas(at, &strip_looking(&boresight, "kind = \"ideal\""));
    let grid = "--grid x=-20:20.1:0.25,y=999:1001.1:1 --window none --slow-window none -a bp";
    let said = run(
        at,
        &format!("focus strip.cphd {grid} --beam auto --squint 4.4 --out image"),
    );
    said.succeeded();
    let [width_deg, squint_deg] = beam_line(&said.stderr);
    println!("{width_deg} deg at {squint_deg} deg");
    assert!((width_deg - WIDTH_DEG).abs() < TOLERANCE_DEG, "{width_deg}");
    assert!((squint_deg - 5.0).abs() < TOLERANCE_DEG, "{squint_deg}");
    // The level of the point is the mean amplitude of the beam, as at broadside.
    let image = npy::read(&at.join("image/image.npy")).unwrap();
    let brightest = image.pixels.iter().map(|&z| power(z)).fold(0.0, f64::max);
    let [least_db, most_db] =
        [WIDTH_DEG / 16.0 + TOLERANCE_DEG, 0.0].map(|off| 20.0 * mean(off).log10());
    let level_db = 10.0 * brightest.log10();
    assert!(
        level_db > least_db - 0.5 && level_db < most_db + 0.5,
        "{level_db}"
    );
    // Without an option the samples decide, or the image is not weighted; a wrong ambiguity is never used.
    let unstated = run(at, &format!("focus strip.cphd {grid} --out unstated"));
    unstated.succeeded();
    if unstated.stderr.contains("note: beam: ") {
        let [_, squint_deg] = beam_line(&unstated.stderr);
        assert!((squint_deg - 5.0).abs() < TOLERANCE_DEG, "{squint_deg}");
    }
}

/// Isotropic antennas on the same track: all pulses contribute to all pixels, and a request for the beam from the spectrum is refused.
#[test]
fn recording_without_a_beam_is_not_weighted() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let isotropic: Vec<String> = strip()
        .lines()
        .filter(|line| {
            !["pattern", "boresight", "azimuth", "elevation"]
                .iter()
                .any(|key| line.starts_with(key))
        })
        .map(str::to_owned)
        .collect();
    write_recording(at, "all", isotropic.join("\n"));
    let grid = "--grid x=-60:60.1:0.5,y=999:1001.1:1 -a bp";
    let plain = run(at, &format!("focus all.cphd {grid} --out image"));
    plain.succeeded();
    assert!(!plain.stderr.contains("note: beam"), "{}", plain.stderr);
    let all = record(at, "image");
    assert!(all["settings"]["resolved"]["beam"].is_null());
    // Pulses a third of a metre apart: lambda R / (2 d) is 45 m, on a grid of 120 m. Output and record warn of ghosts; a narrower grid has
    // no warning.
    let ghosts = "ghosts of targets are possible about 45 m from them";
    plain.reports(ghosts);
    assert!(
        all["warnings"].to_string().contains(ghosts),
        "{}",
        all["warnings"]
    );
    let narrow = "--grid x=-20:20.1:0.5,y=999:1001.1:1 -a bp";
    let narrow = run(at, &format!("focus all.cphd {narrow} --out narrow"));
    narrow.succeeded();
    assert!(!narrow.stderr.contains("ghosts"), "{}", narrow.stderr);
    assert_eq!(record(at, "narrow")["warnings"], serde_json::json!([]));
    run(
        at,
        &format!("focus all.cphd {grid} --beam auto --out other"),
    )
    .failed(1, &["Doppler spectrum", "shows no beam"]);
}

/// Files of a scenario contain beam widths and boresights, which are used without an option.
#[test]
fn simulated_files_state_the_beam_of_their_antennas() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let radar = "kind = \"stepped\"\nstep_time = \"10 us\"";
    fs::write(at.join("strip.toml"), strip_looking("0, 1, 0", radar)).unwrap();
    run(at, "simulate strip.toml --echoes raw -o strip.cphd").succeeded();
    let grid = "--grid x=-60:60.1:0.25,y=999:1001.1:1 --window none --slow-window none -a bp";
    for (input, image) in [("raw/recording.toml", "raw-image"), ("strip.cphd", "image")] {
        let described = run(at, &format!("info {input}"));
        let line = "beam             2.000 deg wide, ";
        assert!(described.succeeded().contains(line), "{described:?}");
        let described = run(at, &format!("info {input} --json"));
        let json: serde_json::Value = serde_json::from_str(described.succeeded()).unwrap();
        assert_eq!(json["beam"]["source"], "stated");
        let stated = run(at, &format!("focus {input} {grid} --out {image}"));
        stated.succeeded();
        let [width_deg, squint_deg] = beam_line(&stated.stderr);
        assert!(
            (width_deg - WIDTH_DEG).abs() < 1e-3 && squint_deg.abs() < 1e-3,
            "{}",
            stated.stderr
        );
        let resolved = record(at, image)["settings"]["resolved"]["beam"].clone();
        assert_eq!(resolved["source"], "stated");
        // A rounding error of a width of 2 deg shifts no block by a pulse.
        run(
            at,
            &format!("focus {input} {grid} --beam 2deg --out {image}-given"),
        )
        .succeeded();
        run(
            at,
            &format!("compare {image} {image}-given --error-db -120"),
        )
        .succeeded();
    }
    // Isotropic antennas are not described.
    let plain = strip().replace("\"gaussian\"", "\"isotropic\"");
    let without = |line: &&str| {
        !["azimuth", "elevation"]
            .iter()
            .any(|key| line.starts_with(key))
    };
    let plain: Vec<&str> = plain.lines().filter(without).collect();
    fs::write(at.join("plain.toml"), plain.join("\n")).unwrap();
    run(at, "simulate plain.toml -o plain.cphd --echoes plain").succeeded();
    for input in ["plain.cphd", "plain/recording.toml"] {
        let described = run(at, &format!("info {input} --json"));
        let json: serde_json::Value = serde_json::from_str(described.succeeded()).unwrap();
        assert!(json["beam"].is_null(), "{json}");
    }
}
