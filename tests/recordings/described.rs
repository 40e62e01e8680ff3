//! Raw recordings described in TOML: invalid descriptions, a simulated recording against direct evaluation, tuning of wrong descriptions,
//! and public recordings if present.

use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use glam::DVec3;
use num_complex::Complex32;
use subaperture::SPEED_OF_LIGHT_M_S;
use subaperture::autofocus::{Axis, Measure, Order, Search, Sight, Tuned, merit, search};
use subaperture::focus::bp::Backprojection;
use subaperture::focus::{ImageFormer, Task};
use subaperture::geometry::ImageGrid;
use subaperture::image::Image;
use subaperture::io::open::{Options, open};
use subaperture::io::recording::{RecordingFile, examples};
use subaperture::monitor::Silent;
use subaperture::phase_history::{InMemory, PhaseHistory, Weights};
use subaperture::quality::response::{Settings, Target, measure};
use subaperture::signal::window::Window;
use subaperture_tests::numpy;

/// A folder of real files; `None` with a message if it is missing.
fn real_folder(name: &str, file: &str) -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../shared/data")
        .join(name);
    if folder.join(file).exists() {
        return Some(folder);
    }
    println!("skipped: {} not found", folder.join(file).display());
    None
}

fn example(name: &str, folder: &Path) -> RecordingFile {
    RecordingFile::new(
        format!("{name}.toml"),
        examples::text(name).unwrap(),
        folder,
    )
}

fn form(history: &dyn PhaseHistory, grid: &ImageGrid, window: Window) -> Image {
    let weights = Weights::new(history.collection(), window, window);
    let task = Task {
        memory_bytes: u64::MAX,
        ..Task::new(history, grid, &weights)
    };
    let former = Backprojection { error_db: -50.0 };
    former.form(&task).unwrap().image
}

pub(crate) fn axis(start: f64, stop: f64, step: f64) -> Axis {
    let count = ((stop - start) / step + 1e-9).floor() as usize + 1;
    Axis { start, step, count }
}

pub(crate) fn tune(
    file: &RecordingFile,
    keys: &[(&str, &str, Axis)],
    sight: &Sight,
    order: Order,
) -> Tuned {
    let intervals: Vec<Axis> = keys.iter().map(|key| key.2).collect();
    let wanted = Search {
        order,
        refinements: 3,
    };
    search(&intervals, wanted, &Silent, |values| {
        let texts: Vec<String> = keys
            .iter()
            .zip(values)
            .map(|(key, value)| format!("{value} {}", key.1))
            .collect();
        let settings = keys
            .iter()
            .zip(&texts)
            .map(|(key, text)| (key.0, text.as_str()));
        let history = file.with(settings).unwrap().history(u64::MAX).unwrap();
        merit(&history, sight, [Window::default(); 2], u64::MAX, &Silent)
    })
    .unwrap()
}

// ---- a recording made here by the test's own formulas

const POINTS_M: [DVec3; 3] = [
    DVec3::new(0.4, 3.2, 0.0),
    DVec3::new(-0.7, 4.1, 0.0),
    DVec3::new(0.1, 4.8, 0.0),
];
const SWEEPS: usize = 161;
const SAMPLES: usize = 192;
const START_HZ: f64 = 24e9;
const SLOPE_HZ_S: f64 = 8e12;
const RATE_HZ: f64 = 1.2e6;
const RADIUS_M: f64 = 0.31;
const BIAS_M: f64 = 0.14;

/// Position of the arm in sweep `n`: from 20 to 160 degrees.
fn arm_m(n: usize) -> DVec3 {
    let angle = (20.0 + 140.0 * n as f64 / (SWEEPS - 1) as f64) / 180.0 * PI;
    DVec3::new(angle.cos(), angle.sin(), 0.0) * RADIUS_M
}

/// Beat of a rising sweep with a delay `tau`: `exp(+j 2 pi (start tau + slope tau t - slope tau^2 / 2))`.
fn beat(n: usize, k: usize) -> [f64; 2] {
    let t = k as f64 / RATE_HZ;
    let mut sum = [0.0; 2];
    for point in POINTS_M {
        let tau = 2.0 * (arm_m(n).distance(point) + BIAS_M) / SPEED_OF_LIGHT_M_S;
        let turns = START_HZ * tau + SLOPE_HZ_S * tau * t - 0.5 * SLOPE_HZ_S * tau * tau;
        let (sin, cos) = (TAU * turns.rem_euclid(1.0)).sin_cos();
        sum[0] += cos;
        sum[1] += sin;
    }
    sum
}

/// The file as a DCA1000 writes it; the samples are of the second of two receivers.
fn dca1000() -> Vec<u8> {
    let mut bytes = Vec::new();
    for n in 0..SWEEPS {
        bytes.extend(vec![0x55; SAMPLES * 4]);
        for k in (0..SAMPLES).step_by(2) {
            let pair = [beat(n, k), beat(n, k + 1)];
            for part in 0..2 {
                for sample in pair {
                    bytes.extend(((sample[part] * 8000.0).round() as i16).to_le_bytes());
                }
            }
        }
    }
    bytes
}

const ARM: &str = r#"
[recording]
format = "dca1000"
file = "arm.bin"
samples = 192
receivers = 2
receiver = 2
phase = "plus"
range_bias = "14 cm"

[radar]
kind = "fmcw"
start = "24 GHz"
slope = "8 MHz/us"
sample_rate = "1.2 MHz"

[platform]
kind = "arc"
pivot = "0, 0, 0 m"
radius = "31 cm"
from_angle = "20 deg"
to_angle = "160 deg"
"#;

fn arm_folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("arm.bin"), dca1000()).unwrap();
    std::fs::write(folder.path().join("arm.toml"), ARM).unwrap();
    folder
}

#[test]
fn recorded_sweep_has_phase_history_of_its_scene() {
    let folder = arm_folder();
    let history = open(&folder.path().join("arm.toml"), &Options::default()).unwrap();
    let collection = history.collection();
    assert_eq!(collection.pulses.len(), SWEEPS);
    let width = collection.num_samples;
    let mut samples = vec![Complex32::ZERO; SWEEPS * width];
    history.read(0..SWEEPS, &mut samples).unwrap();
    let (mut error, mut power) = (0.0, 0.0);
    for (n, row) in samples.chunks_exact(width).enumerate() {
        let pulse = &collection.pulses[n];
        assert!(pulse.transmitter_m.distance(arm_m(n)) < 1e-12);
        for (k, z) in row.iter().enumerate() {
            let frequency_hz = pulse.start_hz + k as f64 * pulse.step_hz;
            let (mut re, mut im) = (0.0, 0.0);
            for point in POINTS_M {
                let path_m = 2.0 * arm_m(n).distance(point) - pulse.reference_path_m;
                let phase = -TAU * (frequency_hz * path_m / SPEED_OF_LIGHT_M_S).rem_euclid(1.0);
                re += 8000.0 * phase.cos();
                im += 8000.0 * phase.sin();
            }
            error += (f64::from(z.re) - re).powi(2) + (f64::from(z.im) - im).powi(2);
            power += re * re + im * im;
        }
    }
    // The ends of a sweep spread in the de-skewing filter (Fresnel ripple): 4 / sqrt(slope) from an end the amplitude is 1 / (8 pi),
    // inversely proportional to the distance; over a sweep of 450 / sqrt(slope) the RMS of both ends is some -45 dB. Rounding to integers
    // of 8000 is below -80 dB.
    let error_db = 10.0 * (error / power).log10();
    println!("phase history against its definition: {error_db:.1} dB");
    assert!(error_db < -38.0, "{error_db}");
    assert_eq!(history.inputs().unwrap().len(), 2);
}

#[test]
fn wrong_radius_and_range_bias_are_tuned() {
    let folder = arm_folder();
    let mut file = RecordingFile::read(&folder.path().join("arm.toml")).unwrap();
    file.set("platform.radius", "20 cm").unwrap();
    let grid: ImageGrid = "x=-1.2:1.2:0.06,y=2.6:5.4:0.06".parse().unwrap();
    let sight = Sight::Grid(grid, Measure::Entropy);
    let radius = [("platform.radius", "m", axis(0.2, 0.4, 0.01))];
    let found = tune(&file, &radius, &sight, Order::Product);
    println!("radius {:?}, width {:?}", found.best, found.scans[0].width);
    // An error d of the radius rotates the phase at the aperture's edges, 70 degrees from the middle, by (1 - cos 70) 2 d / lambda cycles:
    // a quarter of a cycle at 2.4 mm.
    assert!((found.best[0] - RADIUS_M).abs() < 2.4e-3, "{found:?}");
    assert!(!found.scans[0].at_end);

    file.set("platform.radius", "31 cm").unwrap();
    file.set("recording.range_bias", "0 m").unwrap();
    let bias = [("recording.range_bias", "m", axis(0.0, 0.4, 0.02))];
    let points = Sight::Points(POINTS_M.to_vec());
    let found = tune(&file, &bias, &points, Order::Product);
    println!("bias {:?}, width {:?}", found.best, found.scans[0].width);
    // The resolution is c / (2 * 1.28 GHz) = 12 cm; three noiseless points at given positions determine the bias to better than a tenth of
    // it.
    assert!((found.best[0] - BIAS_M).abs() < 0.012, "{found:?}");
}

// ---- descriptions

#[test]
fn each_error_states_its_line() {
    let folder = arm_folder();
    let refuse = |text: &str| {
        let file = RecordingFile::new("r.toml", text, folder.path());
        match file.history(u64::MAX) {
            Ok(_) => panic!("taken:\n{text}"),
            Err(error) => error.to_string(),
        }
    };
    let changed = |from: &str, to: &str| {
        assert!(ARM.contains(from), "{from}");
        ARM.replace(from, to)
    };
    for (from, to, line, part) in [
        ("file = \"arm.bin\"", "file = \"no.bin\"", 4, "cannot read"),
        (
            "samples = 192",
            "samples = 100",
            5,
            "check samples and receivers",
        ),
        ("samples = 192", "samples = \"192\"", 5, "whole number"),
        ("receiver = 2", "receiver = 3", 7, "there are 2 receivers"),
        (
            "phase = \"plus\"",
            "phase = \"pluss\"",
            8,
            "did you mean \"plus\"?",
        ),
        (
            "range_bias = \"14 cm\"",
            "range_bias = \"14 ms\"",
            9,
            "expected a length",
        ),
        (
            "range_bias = \"14 cm\"",
            "times = \"t.npy\"",
            9,
            "cannot read",
        ),
        (
            "range_bias = \"14 cm\"",
            "times = \"t\"",
            9,
            "not in an archive",
        ),
        (
            "range_bias = \"14 cm\"",
            "first = 161",
            9,
            "the last pulse is 160",
        ),
        (
            "range_bias = \"14 cm\"",
            "pulses = \"moving\"\nmoving_above = \"1 km/s\"",
            9,
            "does not move in any pulse",
        ),
        (
            "range_bias = \"14 cm\"",
            "background = \"mean\"\nbackground_first = 170",
            9,
            "fewer than two",
        ),
        (
            "range_bias = \"14 cm\"",
            "layout = \"pulses-samples\"",
            9,
            "does not apply to format",
        ),
        ("start = \"24 GHz\"", "", 11, "needs 'start'"),
        (
            "slope = \"8 MHz/us\"",
            "slope = \"0 MHz/us\"",
            11,
            "expected a non-zero chirp rate",
        ),
        (
            "slope = \"8 MHz/us\"",
            "slope = \"8 MHz\"",
            14,
            "expected a sweep rate, found a frequency",
        ),
        ("radius = \"31 cm\"", "radius = \"-1 cm\"", 20, "above 0"),
        (
            "radius = \"31 cm\"",
            "radios = \"31 cm\"",
            20,
            "did you mean 'radius'?",
        ),
        ("kind = \"arc\"", "kind = \"arrays\"", 17, "needs 'times'"),
        (
            "kind = \"arc\"\npivot = \"0, 0, 0 m\"\nradius = \"31 cm\"\nfrom_angle = \"20 deg\"\nto_angle = \"160 deg\"\n",
            "kind = \"circular\"\ncentre = \"0, 0, 0 m\"\nradius = \"31 cm\"\n",
            17,
            "needs 'speed'",
        ),
        (
            "kind = \"fmcw\"\nstart = \"24 GHz\"\nslope = \"8 MHz/us\"\n",
            "kind = \"pulsed\"\nwindow_start = \"0 s\"\npulse = { kind = \"code\", code = \"barker-2\", chip = \"2 us\" }\n",
            12,
            "give 'centre'",
        ),
    ] {
        let text = changed(from, to);
        let error = refuse(&text);
        assert!(
            error.contains(&format!("r.toml:{line}:")) && error.contains(part),
            "{to}: {error}"
        );
    }
    let error = RecordingFile::new("r.toml", ARM, folder.path()).history(1 << 20);
    assert!(error.unwrap_err().to_string().contains("allow more"));
    let mut file = RecordingFile::new("r.toml", ARM, folder.path());
    let error = file.set("platform.radios", "1 m").unwrap_err().to_string();
    assert!(error.contains("did you mean 'platform.radius'?"), "{error}");
}

// ---- range profiles with a clock offset

/// A NumPy file of float64.
fn npy(shape: &str, values: impl Iterator<Item = f64>) -> Vec<u8> {
    let bytes: Vec<u8> = values.flat_map(f64::to_le_bytes).collect();
    numpy::array("<f8", shape, &bytes)
}

#[test]
fn wrong_clock_and_range_bias_of_profiles_are_tuned() {
    const BINS: usize = 400;
    const PULSES: usize = 150;
    let folder = tempfile::tempdir().unwrap();
    let put = |name: &str, bytes: Vec<u8>| std::fs::write(folder.path().join(name), bytes).unwrap();
    let reflectors = [DVec3::new(-0.3, 3.0, 0.0), DVec3::new(0.4, 3.6, 0.0)];
    // A push along x: at rest, 2 s from -0.9 to 0.9 m, at rest. Pulses begin 3.17 s later on the track's clock.
    let place = |t: f64| {
        let gone = ((t - 4.0) / 2.0).clamp(0.0, 1.0);
        DVec3::new(-0.9 + 1.8 * (0.5 - 0.5 * (PI * gone).cos()), 0.0, 0.0)
    };
    let track: Vec<f64> = (0..900).map(|i| f64::from(i) * 0.01).collect();
    put("t.npy", npy("(900,)", track.iter().copied()));
    put(
        "p.npy",
        npy("(900, 3)", track.iter().flat_map(|&t| place(t).to_array())),
    );
    put(
        "ms.npy",
        npy("(150,)", (0..PULSES).map(|n| 5e8 + n as f64 * 23.0)),
    );
    let waveform = (0..PULSES).flat_map(|n| {
        let from = place(3.17 + n as f64 * 0.023);
        (0..BINS).map(move |i| {
            let range_m = 1.5 + i as f64 * 0.01;
            // A constant leak, and a Gaussian pulse at 4 GHz from each reflector, 25 cm too far.
            let leak = 30.0 * (-(range_m - 1.9).powi(2) / 0.02).exp();
            let echoes = reflectors.map(|p| {
                let late_s = 2.0 * (range_m - from.distance(p) - 0.25) / SPEED_OF_LIGHT_M_S;
                (-0.5 * (TAU * 0.5e9 * late_s).powi(2)).exp() * (TAU * 4e9 * late_s).cos()
            });
            leak + echoes.iter().sum::<f64>()
        })
    });
    put("scan.npy", npy("(150, 400)", waveform));
    let mut text = String::new();
    write!(
        text,
        "[recording]\nformat = \"npy\"\nfile = \"scan.npy\"\ntimes = \"ms.npy\"\ntimes_unit = \"ms\"\n\
         pulses = \"moving\"\nbackground = \"mean-moving\"\n\
         [radar]\nkind = \"profiles\"\nfirst_range = \"1.5 m\"\nrange_step = \"1 cm\"\nband = \"3, 5 GHz\"\n\
         first_pulse = \"0 s\"\n\
         [platform]\nkind = \"arrays\"\ntimes = \"t.npy\"\npositions = \"p.npy\"\n"
    )
    .unwrap();
    let file = RecordingFile::new("rail.toml", text, folder.path());
    let keys = [
        ("recording.range_bias", "m", axis(0.0, 0.5, 0.1)),
        ("radar.first_pulse", "s", axis(2.0, 4.5, 0.05)),
    ];
    let points = Sight::Points(reflectors.to_vec());
    let grid = Sight::Grid(
        "x=-1:1:0.08,y=2.6:4:0.08".parse().unwrap(),
        Measure::Sharpness,
    );
    let sharp = tune(&file, &keys, &grid, Order::InTurn);
    println!("by sharpness {:?}", sharp.best);
    // Focus determines the clock where the platform accelerates: 5 cm at 1.4 m/s are 35 ms.
    assert!((sharp.best[1] - 3.17).abs() < 0.035, "{sharp:?}");
    let near = |value: f64, step: f64| axis(value - 4.0 * step, value + 4.0 * step, step);
    let keys = [
        ("recording.range_bias", "m", axis(0.0, 0.5, 0.05)),
        ("radar.first_pulse", "s", near(sharp.best[1], 0.02)),
    ];
    let known = tune(&file, &keys, &points, Order::Product);
    println!("by known points {:?}", known.best);
    // The resolution is 7.5 cm in range and 6 cm across; noiseless points determine the bias to a tenth of it.
    assert!((known.best[0] - 0.25).abs() < 0.0075, "{known:?}");
    assert!((known.best[1] - 3.17).abs() < 0.006, "{known:?}");
}

// ---- public recordings

#[test]
fn arc_sar_is_sharpest_with_arm_of_21_to_22_cm() {
    for (name, grid) in [
        ("arcsar-8", "r=1.5:8:0.05,theta=40:140:0.5"),
        ("arcsar-10", "r=1.5:8:0.05,theta=40:140:0.5"),
    ] {
        let data = format!("Prova_Esterna_{}.bin", name.trim_start_matches("arcsar-"));
        let Some(folder) = real_folder("arcsar-awr1642", &data) else {
            continue;
        };
        let mut file = example(name, &folder);
        file.set("recording.every", "2").unwrap();
        let sight = Sight::Grid(grid.parse().unwrap(), Measure::Entropy);
        let radius = [("platform.radius", "m", axis(0.18, 0.25, 0.01))];
        let found = tune(&file, &radius, &sight, Order::Product);
        println!("{name}: radius {:?}, {:?}", found.best, found.scans[0]);
        assert!((0.207..0.223).contains(&found.best[0]), "{found:?}");

        // One bright point at 3.74 m, focused by its own peak and measured without a window.
        file.set("recording.every", "1").unwrap();
        let near: ImageGrid = "r=3.6:3.9:0.02,theta=100:109:0.2".parse().unwrap();
        let radius = [("platform.radius", "m", axis(0.207, 0.223, 0.002))];
        let found = tune(
            &file,
            &radius,
            &Sight::Grid(near, Measure::Peak),
            Order::Product,
        );
        let grid: ImageGrid = "r=3.2:4.4:0.01,theta=97:113:0.1".parse().unwrap();
        let widths = |radius_m: f64| {
            let radius = format!("{radius_m} m");
            let varied = file.with([("platform.radius", radius.as_str())]).unwrap();
            let history = varied.history(u64::MAX).unwrap();
            let image = form(&history, &grid, Window::None);
            let response = measure(&image, &grid, Target::Brightest, &Settings::default()).unwrap();
            let pulse = history.collection().pulses[0];
            let bandwidth_hz = pulse.step_hz * history.collection().num_samples as f64;
            let [across, along] = [0, 1].map(|i: usize| response.cuts[i].width_3db.unwrap());
            (across, along, bandwidth_hz)
        };
        let (across_rad, along_m, bandwidth_hz) = widths(found.best[0]);
        // In range 0.886 c / (2 B), 3.58 cm; a tenth of tolerance for neighbouring scatterers.
        let expected_m = 0.886 * SPEED_OF_LIGHT_M_S / (2.0 * bandwidth_hz);
        // Across, the whole chord of the arm would give 0.886 lambda / (2 * 2 radius). An antenna that illuminates a point over 40 degrees
        // two-way (half power) gives 0.44 lambda / (2 * 0.15 m), 5.6 mrad. Twice that is allowed for deviations of the arm from a circle.
        let narrowest_rad = 0.886 * SPEED_OF_LIGHT_M_S / 78.9e9 / (4.0 * found.best[0]);
        let (described_rad, ..) = widths(0.20);
        println!(
            "{name}: point sharpest at {:.4} m; {along_m:.4} m in range (theory {expected_m:.4} m), \
             {across_rad:.5} rad across, {described_rad:.5} rad at 0.20 m",
            found.best[0]
        );
        assert!((along_m / expected_m - 1.0).abs() < 0.1, "{along_m}");
        assert!(
            (narrowest_rad..2.0 * 5.6e-3).contains(&across_rad),
            "{across_rad}"
        );
        assert!(across_rad < 0.5 * described_rad, "{described_rad}");
    }
}

#[test]
fn rail_reflector_is_imaged_at_surveyed_position() {
    let Some(folder) = real_folder("pulson440-rail", "rail_trial6.npz") else {
        return;
    };
    let mut file = example("pulson-rail", &folder);
    // Wide intervals, by the sharpness of a patch, from every third pulse.
    file.set("recording.every", "3").unwrap();
    let patch: ImageGrid = "x=1.6:2.8:0.06,y=-4.5:-3.3:0.06,z=0.04".parse().unwrap();
    let sight = Sight::Grid(patch, Measure::Sharpness);
    let keys = [
        ("recording.range_bias", "m", axis(0.0, 1.0, 0.2)),
        ("radar.first_pulse", "s", axis(5.0, 15.0, 0.05)),
    ];
    let found = tune(&file, &keys, &sight, Order::InTurn);
    println!(
        "by sharpness: {:?}, widths {:?}",
        found.best,
        found.scans.iter().map(|s| s.width).collect::<Vec<_>>()
    );
    assert!((found.best[1] - 9.22).abs() < 0.1, "{:?}", found.best);
    // Then by the power at the surveyed reflector.
    let survey = DVec3::new(2.203_936, -3.873_749, 0.037_515);
    let keys = [
        ("recording.range_bias", "m", axis(0.0, 1.0, 0.05)),
        (
            "radar.first_pulse",
            "s",
            axis(found.best[1] - 0.15, found.best[1] + 0.15, 0.03),
        ),
    ];
    let found = tune(&file, &keys, &Sight::Points(vec![survey]), Order::Product);
    println!("by the survey: {:?}", found.best);
    assert!((0.42..0.48).contains(&found.best[0]), "{:?}", found.best);
    let settings = [
        ("recording.range_bias", format!("{} m", found.best[0])),
        ("radar.first_pulse", format!("{} s", found.best[1])),
        ("recording.every", "1".to_owned()),
    ];
    let settings = settings.iter().map(|(key, value)| (*key, value.as_str()));
    let history: InMemory = file.with(settings).unwrap().history(u64::MAX).unwrap();
    let grid: ImageGrid = "x=1.2:3.2:0.02,y=-4.8:-2.8:0.02,z=0.0375".parse().unwrap();
    let image = form(&history, &grid, Window::default());
    let peak = image.peak().unwrap();
    let place = grid.position_m(peak.row, peak.column);
    println!("brightest point at {place}, surveyed at {survey}");
    let response = measure(&image, &grid, Target::Brightest, &Settings::default()).unwrap();
    let fine = DVec3::from_array(response.position_m);
    println!("to a fraction of a pixel: {fine}");
    assert!(fine.distance(survey) < 0.05, "{fine}");
}
