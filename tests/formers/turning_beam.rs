//! Images by antennas that turn against their track: against the plain sum over the pulses in which the antennas point at each block.

use glam::{DQuat, DVec3};
use num_complex::Complex64;
use subaperture::focus::ImageFormer;
use subaperture::focus::beam::InBeam;
use subaperture::focus::formers;
use subaperture::geometry::ImageGrid;
use subaperture::io::recording::{self, Raw};
use subaperture::monitor::Silent;
use subaperture::phase_history::{Beam, InMemory, NoBeam, PhaseHistory, Weights};
use subaperture::prelude::{Backprojection, Focusing};
use subaperture::radar::{Antenna, MountedAntennas, Pattern};
use subaperture::signal::window::Window;
use subaperture::simulate::scenario::Scenario;

use crate::beam_scene::{self, GRID, WIDTH_RAD};

const PULSES: usize = 480;

/// Angle of the antennas forward of broadside: a spotlight that slides, for it turns faster than the direction of the scene.
fn scan_rad(n: usize) -> f64 {
    0.2 - 0.4 * n as f64 / (PULSES - 1) as f64
}

/// Points seen by antennas with a Gaussian pattern, and the beam that these antennas have.
fn spotlight() -> InMemory {
    let (collection, samples) = beam_scene::strip("spotlight", PULSES, scan_rad);
    let antenna = |name: &str| Antenna {
        name: name.to_owned(),
        offset_m: DVec3::ZERO,
        boresight: DVec3::Y,
        up: DVec3::Z,
        pattern: Pattern::Gaussian {
            azimuth_rad: WIDTH_RAD,
            elevation_rad: 0.5,
        },
        aim_m: None,
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

/// The plain sum over the pulses that illuminate each block.
fn expected(history: &InMemory, grid: &ImageGrid, weights: &Weights) -> Vec<Complex64> {
    beam_scene::expected(history, grid, weights, scan_rad, |lit, sees| {
        let range = sees[0]..sees[sees.len() - 1] + 1;
        assert_eq!(range.len(), sees.len());
        // Interpolated directions are off by at most 1 % of half the width, 0.35 mrad: two pulses of 0.18 mrad.
        assert!(
            lit.start.abs_diff(range.start) <= 2 && lit.end.abs_diff(range.end) <= 2,
            "{lit:?} {range:?}"
        );
    })
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

/// Strip by antennas on a platform that keeps its attitude, apart from additions to the description.
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
