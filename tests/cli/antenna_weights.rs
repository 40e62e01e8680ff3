//! `subap focus --antenna-weights`: points at the edge of the beam read their amplitude, from a scenario with a table to the image.

use std::fs;
use std::path::Path;

use subaperture::image::Image;
use subaperture::io::npy;
use subaperture_tests::subap::run;

use crate::beam::strip_looking;

/// Points along the strip: in the middle, and 17 m beyond the end of the track, where the beam is 35 m wide.
const POINTS_M: [f64; 2] = [0.0, -67.0];
const STEP_M: f64 = 0.25;

/// The strip of the tests of beams with a track of 100 m and both points.
fn scenario(pattern: &str) -> String {
    let radar = "kind = \"stepped\"\nstep_time = \"10 us\"";
    let text = strip_looking("0, 1, 0", radar)
        .replace("pulses = 721", "pulses = 301")
        .replace("x = \"-60, 60 m\"", "x = \"-80, 20 m\"")
        .replace(
            "[[scene.point]]",
            "[[scene.point]]\nposition = \"-67, 1000, 0 m\"\n\n[[scene.point]]",
        );
    let gaussian = "pattern = \"gaussian\"\n";
    let widths = "azimuth = \"2 deg\"\nelevation = \"40 deg\"\n";
    assert!(text.contains(gaussian) && text.contains(widths), "{text}");
    match pattern {
        "gaussian" => text,
        _ => text.replace(gaussian, pattern).replace(widths, ""),
    }
}

/// Amplitudes of both points.
fn focused(at: &Path, input: &str, options: &str) -> [f64; 2] {
    let grid = format!("--grid x=-80:20.1:{STEP_M},y=999:1001.1:1");
    run(
        at,
        &format!("focus {input} {grid} -a bp --error-db -50 --out image {options}"),
    )
    .succeeded();
    let image: Image = npy::read(&at.join("image/image.npy")).unwrap();
    POINTS_M.map(|x_m| {
        let column = ((x_m + 80.0) / STEP_M).round() as usize;
        f64::from(image.pixels[image.columns + column].norm())
    })
}

fn assert_reads_one(amplitudes: [f64; 2]) {
    for amplitude in amplitudes {
        // Side lobes of the other point, 67 m or 150 resolutions away, are below -45 dB with the Taylor windows; its ghosts, 45 m from it, lie elsewhere.
        assert!((20.0 * amplitude.log10()).abs() < 0.1, "{amplitudes:?}");
    }
}

#[test]
fn points_at_edge_of_beam_read_their_amplitude_from_scenario_with_table() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    // Two-way gains of a Gaussian of 2 degrees, with the peak at 30 dB, by its dB: -12.04 (azimuth / width)^2 an antenna.
    let mut table = "azimuth_deg,gain_db\n".to_owned();
    for n in -80..=80 {
        let azimuth = 0.05 * f64::from(n);
        let gain = 30.0 - 2.0 * 12.041_199_826_559_248 * (azimuth / 2.0f64).powi(2);
        table.push_str(&format!("{azimuth},{gain}\n"));
    }
    fs::write(at.join("pattern.csv"), table).unwrap();
    let keys = "pattern = \"table\"\ntable = \"pattern.csv\"\ngains = \"two-way\"\n";
    fs::write(at.join("strip.toml"), scenario(keys)).unwrap();
    let simulated = run(at, "simulate strip.toml --echoes raw -o strip.cphd");
    simulated.succeeded();
    simulated.reports("a pattern is a table");
    assert!(at.join("raw/transmitter-pattern.csv").exists());
    assert_reads_one(focused(
        at,
        "raw/recording.toml",
        "--antenna-weights matched",
    ));
    let record = fs::read_to_string(at.join("image/image.json")).unwrap();
    let record: serde_json::Value = serde_json::from_str(&record).unwrap();
    let resolved = &record["settings"]["resolved"]["antenna_weights"];
    assert_eq!(resolved["floor_db"], -20.0, "{record}");
    // Without the weights, the point beyond the track has the mean of a flank.
    let [middle, edge] = focused(at, "raw/recording.toml", "--beam none");
    assert!(edge < 0.3 * middle, "{middle} {edge}");
    // The CPHD has no table.
    run(at, "focus strip.cphd --antenna-weights matched --out image").failed(
        1,
        &["expected antenna patterns with attitudes at all pulses"],
    );
    // A table whose directions form no lattice.
    fs::write(
        at.join("pattern.csv"),
        "azimuth_deg,elevation_deg,gain_db\n0,0,0\n1,1,0\n",
    )
    .unwrap();
    run(at, "simulate strip.toml -o other.cphd").failed(
        1,
        &["pattern.csv, line 3: azimuth 1 deg, elevation 1 deg: expected the same 1 azimuths"],
    );
}

#[test]
fn points_at_edge_of_beam_read_their_amplitude_from_cphd_and_tiles() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("strip.toml"), scenario("gaussian")).unwrap();
    run(at, "simulate strip.toml --echoes raw -o strip.cphd").succeeded();
    assert_reads_one(focused(at, "strip.cphd", "--antenna-weights matched"));
    // The same image in tiles by a stored plan.
    let grid =
        "--grid x=-80:20.1:0.25,y=999:1001.1:1 -a bp --error-db -50 --antenna-weights matched";
    run(at, &format!("plan focus strip.cphd {grid} --out plan.json")).succeeded();
    run(at, "focus strip.cphd --plan plan.json --out tiled").succeeded();
    run(at, "compare image tiled --error-db -120").succeeded();
    assert_reads_one(focused(
        at,
        "raw/recording.toml",
        "--antenna-weights matched",
    ));
}
