//! Images by antennas that turn against their track: against the plain sum over the pulses in which the antennas point at each block.

use glam::{DQuat, DVec3};
use num_complex::{Complex32, Complex64};
use subaperture::focus::ImageFormer;
use subaperture::focus::beam::InBeam;
use subaperture::focus::formers;
use subaperture::geometry::{ImageGrid, SceneFrame};
use subaperture::io::recording::{self, Raw};
use subaperture::monitor::Silent;
use subaperture::phase_history::{
    Beam, Collection, InMemory, NoBeam, PhaseHistory, Pulse, PulseRange, Sweep, Weights,
};
use subaperture::prelude::{Backprojection, Focusing};
use subaperture::radar::{Antenna, MountedAntennas, Pattern};
use subaperture::signal::window::Window;
use subaperture::simulate::scenario::Scenario;
use subaperture_tests::plain_history::{complex, plain_pulse, plain_sum};
use subaperture_tests::plain_sum::hamming;

const GRID: &str = "x=-24:20.6:0.6,y=297:303.1:0.75";
const WIDTH_RAD: f64 = 0.07;
const PULSES: usize = 480;

/// Angle of the antennas forward of broadside: a spotlight that slides, for it turns faster than the direction of the scene.
fn scan_rad(n: usize) -> f64 {
    0.2 - 0.4 * n as f64 / (PULSES - 1) as f64
}

/// Sine of the angle of a place forward of broadside, on a track along x.
fn sine(pulse: &Pulse, place_m: DVec3) -> f64 {
    let from = place_m - pulse.transmitter_m;
    from.x / from.length()
}

/// Points seen by antennas with a Gaussian pattern, and the beam that these antennas have.
fn spotlight() -> InMemory {
    let pulses = (0..PULSES).map(|n| {
        let antenna_m = DVec3::new(0.2 * (n as f64 - 0.5 * PULSES as f64), 0.0, 60.0);
        Pulse {
            transmitter_m: antenna_m,
            receiver_m: antenna_m,
            reference_m: DVec3::ZERO,
            reference_path_m: 0.0,
            start_hz: 9.95e9,
            step_hz: 3e6,
            time_s: 0.005 * n as f64,
            sweep: Sweep::AT_ONCE,
        }
    });
    let collection = Collection {
        name: "spotlight".to_owned(),
        frame: SceneFrame::Local,
        pulses: pulses.collect(),
        num_samples: 32,
        timed: true,
        extent: None,
    };
    let points_m = [[-15.0, 299.0, 0.0], [0.3, 301.2, 0.0], [12.0, 300.0, 0.0]];
    let mut samples = Vec::new();
    for (n, pulse) in collection.pulses.iter().enumerate() {
        let plain = plain_pulse(pulse, 1.0);
        let seen = points_m.map(|point_m| {
            let off = (sine(pulse, point_m.into()).asin() - scan_rad(n)) / WIDTH_RAD;
            (point_m, [(-4.0 * 2f64.ln() * off * off).exp(), 0.0])
        });
        for k in 0..collection.num_samples {
            let [re, im] = plain.echo(k, &seen);
            samples.push(Complex32::new(re as f32, im as f32));
        }
    }
    let antenna = |name: &str| Antenna {
        name: name.to_owned(),
        offset_m: DVec3::ZERO,
        boresight: DVec3::Y,
        up: DVec3::Z,
        pattern: Pattern::Gaussian {
            azimuth_rad: WIDTH_RAD,
            elevation_rad: 0.5,
        },
    };
    let carried = MountedAntennas {
        antennas: [antenna("transmitter"), antenna("receiver")],
        attitudes: (0..PULSES)
            .map(|n| [DQuat::from_rotation_z(-scan_rad(n)); 2])
            .collect(),
    };
    let of_pulses = collection.pulses.iter();
    let (times_s, middles_m): (Vec<f64>, Vec<DVec3>) = of_pulses
        .map(|pulse| (pulse.time_s, pulse.transmitter_m))
        .unzip();
    let stated = carried.beam(&times_s, &middles_m);
    let history = InMemory::new(collection, samples).unwrap();
    history.with_stated_beam(stated)
}

/// The plain sum at every pixel, over the pulses whose antennas point within half the width of the middle of the pixel's block, under a Hamming window.
fn expected(history: &InMemory, grid: &ImageGrid, weights: &Weights) -> Vec<Complex64> {
    let lit = weights.illumination.as_ref().unwrap();
    let columns = grid.columns.count;
    let mut values = vec![Complex64::ZERO; grid.num_pixels() as usize];
    for block in 0..lit.num_blocks() {
        let [rows, across] = lit.place(block);
        let middle = [rows.start + rows.len() / 2, across.start + across.len() / 2];
        let middle_m = grid.position_m(middle[0], middle[1]);
        let pulses = &history.collection().pulses;
        let off_rad = |n: usize| (sine(&pulses[n], middle_m).asin() - scan_rad(n)).abs();
        let sees: Vec<usize> = (0..PULSES)
            .filter(|&n| off_rad(n) <= 0.5 * WIDTH_RAD)
            .collect();
        let range = sees[0]..sees[sees.len() - 1] + 1;
        assert_eq!(range.len(), sees.len());
        // Interpolated directions are off by at most 1 % of half the width, 0.35 mrad: two pulses of 0.18 mrad.
        let found = lit.pulses(block);
        assert!(
            found.start.abs_diff(range.start) <= 2 && found.end.abs_diff(range.end) <= 2,
            "{found:?} {range:?}"
        );
        let part = PulseRange::new(history, found.clone());
        let own = Weights {
            fast: hamming(32),
            slow: hamming(found.len()),
            illumination: None,
            windows: None,
        };
        let pixels: Vec<usize> = rows
            .flat_map(|row| across.clone().map(move |column| row * columns + column))
            .collect();
        let points_m: Vec<[f64; 3]> = pixels
            .iter()
            .map(|i| grid.position_m(i / columns, i % columns).to_array())
            .collect();
        let sums = complex(&plain_sum(&part, &own).at(&points_m));
        for (pixel, sum) in pixels.into_iter().zip(sums) {
            values[pixel] = sum;
        }
    }
    values
}

#[test]
fn a_stated_pattern_turns_with_its_antennas() {
    let history = spotlight();
    let grid: ImageGrid = GRID.parse().unwrap();
    let beam = history.stated_beam().unwrap().unwrap();
    assert!(!beam.aims.is_empty() && beam.squint_rad.abs() < 1e-9);
    let image = Focusing::new(&history, &grid)
        .windows(Window::Hamming, Window::Hamming)
        .by(&Backprojection::default())
        .unwrap();
    assert!(image.warnings.is_empty(), "{:?}", image.warnings);
    assert_eq!(image.settings["beam"]["turns"], true);

    let bp = || formers::former("bp", &serde_json::json!({})).unwrap();
    let windows = [Window::Hamming; 2];
    let weights = |beam: Beam| {
        let former = InBeam::new(bp(), beam).unwrap();
        let [fast, slow] = windows;
        (former.weights(history.collection(), &grid, fast, slow)).unwrap()
    };
    let turning = weights(beam.clone());
    let expected = expected(&history, &grid, &turning);
    let (mut error, mut all) = (0.0, 0.0);
    for (formed, expected) in image.image.pixels.iter().zip(&expected) {
        let formed = Complex64::new(formed.re.into(), formed.im.into());
        error += (formed - expected).norm_sqr();
        all += expected.norm_sqr();
    }
    let error_db = 10.0 * f64::log10(error / all);
    println!("{error_db:.1} dB");
    assert!(error_db <= image.predicted_error_db);

    // A point in the middle is seen during most of the track; in a direction that does not turn, during 0.07 rad of 300 m: 21 m of 96 m.
    let longest = |weights: &Weights| {
        let lit = weights.illumination.as_ref().unwrap();
        (0..lit.num_blocks())
            .map(|block| lit.pulses(block).len())
            .max()
    };
    let fixed = Beam {
        aims: Vec::new(),
        ..beam
    };
    assert!(longest(&turning) > Some(300), "{:?}", longest(&turning));
    assert!(longest(&weights(fixed)) < Some(115));
}

#[test]
fn a_stated_pattern_of_unknown_pointing_is_named_in_a_warning() {
    let grid: ImageGrid = GRID.parse().unwrap();
    let history = spotlight().with_stated_beam(Err(NoBeam::NoAttitude));
    let image = Focusing::new(&history, &grid)
        .by(&Backprojection::default())
        .unwrap();
    assert!(image.settings.get("beam").is_none());
    assert!(
        image.warnings.len() == 1
            && image.warnings[0].contains("every pixel is formed from all pulses")
            && image.warnings[0].contains("boresight of an antenna is not defined"),
        "{:?}",
        image.warnings
    );
}

/// A strip by antennas on a platform that keeps its attitude, but for what is added to the description.
const STRIP: &str = r#"name = "strip"
[scene]
reference = "0, 300, 0 m"
x = "-20, 20 m"
y = "297, 303 m"
[scene.origin]
latitude = "47 deg"
longitude = "8 deg"
height = "400 m"
[[scene.point]]
position = "0, 300, 0 m"
[radar]
kind = "stepped"
step_time = "1 us"
pulses = 300
pri = "4 ms"
centre = "10 GHz"
bandwidth = "80 MHz"
samples = 8
[[radar.transmitter]]
pattern = "gaussian"
boresight = "0, 1, 0"
azimuth = "5 deg"
elevation = "30 deg"
[[radar.receiver]]
pattern = "gaussian"
boresight = "0, 1, 0"
azimuth = "5 deg"
elevation = "30 deg"
[platform]
kind = "linear"
position = "0, 0, 60 m"
velocity = "60, 4, 0 m/s"
at = "middle"
"#;

#[test]
fn raw_recordings_describe_no_pattern_that_a_reader_would_point_along_the_heading() {
    let wobble = "[[platform.perturbation]]\nkind = \"wobble\"\nangles = \"0, 0, 8 deg\"\nperiod = \"2.4 s\"\n";
    for (added, is_described) in [("", true), (wobble, false)] {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        std::fs::write(at.join("strip.toml"), format!("{STRIP}{added}")).unwrap();
        let scenario = Scenario::read(&at.join("strip.toml")).unwrap();
        let experiment = scenario.experiment().unwrap();
        let recorded = experiment.record(experiment.pairs()[0]).unwrap();
        let stated = recorded.stated_beam().unwrap().unwrap();
        assert_eq!(stated.aims.is_empty(), is_described, "{stated:?}");
        let raw = Raw {
            id: "1".to_owned(),
            echoes: recorded.echoes(),
            antennas: Some(recorded.echoes().carried()),
        };
        assert_eq!(recording::describes_antennas(&raw), is_described);
        recording::write(&at.join("raw"), &[raw], &Silent).unwrap();
        let read = subaperture::open(at.join("raw/recording.toml")).unwrap();
        assert_eq!(read.beam().is_some(), is_described);
    }
}
