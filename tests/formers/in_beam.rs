//! Every former restricted to a beam: against the plain sum over the pulses that illuminate each block, in tiles, and by a stored plan.

use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

use num_complex::{Complex32, Complex64};
use subaperture::focus::beam::{Beam, BeamSource, InBeam};
use subaperture::focus::formers::{self, FORMERS};
use subaperture::focus::patch::PatchSize;
use subaperture::focus::plan::InMemory as Tiles;
use subaperture::focus::{BoundPolicy, FormError, ImageFormer, ImageSpec, Plan, Task, Work};
use subaperture::geometry::ImageGrid;
use subaperture::io::cphd::{self, WriteOptions};
use subaperture::io::recording::{self, Raw};
use subaperture::monitor::Silent;
use subaperture::phase_history::{Collection, InMemory, PhaseHistory, ReadError, Weights};
use subaperture::prelude::{Backprojection, BeamChoice, Focusing};
use subaperture::signal::window::Window;
use subaperture::simulate::scenario::Scenario;

use crate::beam_scene::{self, GRID, WIDTH_RAD};

const SQUINT_RAD: f64 = 0.03;
const PULSES: usize = 240;

/// A straight strip past points, seen by a Gaussian beam squinted a few degrees forward.
fn strip() -> InMemory {
    let (collection, samples) = beam_scene::strip("strip", PULSES, |_| SQUINT_RAD);
    InMemory::new(collection, samples).unwrap()
}

/// A recording that counts the pulses read.
struct Counted<'a>(&'a InMemory, AtomicUsize);

impl PhaseHistory for Counted<'_> {
    fn collection(&self) -> &Collection {
        self.0.collection()
    }

    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
        self.1.fetch_add(pulses.len(), Ordering::Relaxed);
        self.0.read(pulses, samples)
    }
}

fn beam() -> Beam {
    Beam::new(WIDTH_RAD, SQUINT_RAD, BeamSource::Given)
}

fn in_beam(name: &str) -> InBeam {
    let former = formers::former(name, &serde_json::json!({})).unwrap();
    InBeam::new(former, beam()).unwrap()
}

/// The plain sum over exactly the pulses whose beam covers the middle of each block.
fn expected(history: &InMemory, grid: &ImageGrid, weights: &Weights) -> Vec<Complex64> {
    beam_scene::expected(
        history,
        grid,
        weights,
        |_| SQUINT_RAD,
        |lit, sees| {
            assert_eq!(*lit, sees[0]..sees[sees.len() - 1] + 1);
        },
    )
}

fn error_db(formed: &[Complex32], expected: &[Complex64]) -> f64 {
    let (mut error, mut all) = (0.0, 0.0);
    for (formed, expected) in formed.iter().zip(expected) {
        let formed = Complex64::new(formed.re.into(), formed.im.into());
        error += (formed - expected).norm_sqr();
        all += expected.norm_sqr();
    }
    10.0 * (error / all).log10()
}

#[test]
fn every_former_keeps_bound_in_beam() {
    let history = strip();
    let grid: ImageGrid = GRID.parse().unwrap();
    let mut formed_by = 0;
    for entry in &FORMERS {
        let former = in_beam(entry.name);
        let weights = former
            .weights(
                history.collection(),
                &grid,
                Window::Hamming,
                Window::Hamming,
            )
            .unwrap();
        assert!(weights.illumination.as_ref().unwrap().num_blocks() > 4);
        let task = Task::new(&history, &grid, &weights);
        let formed = match former.form_best(&task) {
            Ok(formed) => formed,
            // A former that cannot form a block refuses.
            Err(error @ FormError::Unsuited(_)) => {
                println!("{}: {error}", entry.name);
                continue;
            }
            Err(error) => panic!("{}: {error}", entry.name),
        };
        let measured_db = error_db(&formed.image.pixels, &expected(&history, &grid, &weights));
        println!(
            "{}: {measured_db:.1} dB, predicted {:.1} dB",
            entry.name, formed.predicted_error_db
        );
        assert!(measured_db <= formed.predicted_error_db, "{}", entry.name);
        assert_eq!(
            formed.bound_missed,
            former
                .bound_db()
                .is_some_and(|bound_db| formed.predicted_error_db > bound_db)
        );
        formed_by += 1;
    }
    assert!(formed_by >= 4, "{formed_by}");
}

#[test]
fn tiles_of_stored_plan_in_beam_are_bit_identical_to_whole_image() {
    let history = strip();
    let grid: ImageGrid = GRID.parse().unwrap();
    for name in ["bp", "ffbp", "auto"] {
        let former = in_beam(name);
        let weights = former
            .weights(
                history.collection(),
                &grid,
                Window::Hamming,
                Window::Hamming,
            )
            .unwrap();
        let spec = ImageSpec::new(history.collection(), &grid, &weights);
        let task = Task::new(&history, &grid, &weights);
        let whole = former.form_planned(&task).unwrap().image.pixels;
        let text = Plan::new(&former, &spec, BoundPolicy::Allowed, &Silent)
            .unwrap()
            .to_text();
        // Tiles of several sizes, in both orders, a few in each pass; some cut blocks.
        for (tile, most_a_pass, backwards) in
            [([9, 75], 9, false), ([5, 17], 2, true), ([1, 30], 3, false)]
        {
            let mut plan = Plan::from_text(&text).unwrap();
            plan.tile = PatchSize {
                rows: tile[0],
                columns: tile[1],
            };
            let weights = plan.weights(history.collection()).unwrap();
            let opened = plan.open(history.collection(), &weights).unwrap();
            let mut indices: Vec<usize> = (0..plan.num_tiles()).collect();
            if backwards {
                indices.reverse();
            }
            let work = Work {
                history: &history,
                memory_bytes: 1 << 30,
                monitor: &Silent,
            };
            let mut image = Tiles::of(&plan);
            opened
                .form(&work, &indices, most_a_pass, &mut image)
                .unwrap();
            assert_eq!(image.image.pixels, whole, "{name} {tile:?}");
            let records: Vec<_> = image.records.into_values().collect();
            let judged = opened
                .judge_again(&records, &history, None, &Silent)
                .unwrap();
            let measured_db = error_db(&whole, &expected(&history, &grid, &weights));
            assert!(
                measured_db <= judged.predicted_db(),
                "{name}: {measured_db} {judged:?}"
            );
            // Processes of one tile each read some of the pulses, and the last one measures the same error.
            let mut parts = Tiles::of(&plan);
            let mut least = usize::MAX;
            for index in 0..plan.num_tiles() {
                let counted = Counted(&history, AtomicUsize::new(0));
                let opened = plan.open(history.collection(), &weights).unwrap();
                let work = Work {
                    history: &counted,
                    ..work
                };
                opened.form(&work, &[index], 1, &mut parts).unwrap();
                least = least.min(counted.1.into_inner());
            }
            assert_eq!(parts.image.pixels, whole, "{name} {tile:?}");
            let num_pulses = history.collection().pulses.len();
            assert!(
                plan.num_tiles() == 1 || least < num_pulses,
                "{name} {tile:?}: {least}"
            );
            let parts: Vec<_> = parts.records.into_values().collect();
            let again = opened.judge_again(&parts, &history, None, &Silent).unwrap();
            assert_eq!(again, judged, "{name} {tile:?}");
        }
    }
}

#[test]
fn weights_with_beam_and_former_without_beam_refuse_each_other() {
    let history = strip();
    let grid: ImageGrid = GRID.parse().unwrap();
    let former = in_beam("bp");
    let of_beam = former
        .weights(history.collection(), &grid, Window::None, Window::None)
        .unwrap();
    let plain = Weights::new(history.collection(), Window::None, Window::None);
    let task = |weights| Task::new(&history, &grid, weights);
    let bp = formers::former("bp", &serde_json::json!({})).unwrap();
    let refused = bp.form(&task(&of_beam)).unwrap_err().to_string();
    assert!(refused.contains("those of a beam"), "{refused}");
    let refused = former.form(&task(&plain)).unwrap_err().to_string();
    assert!(
        refused.contains("which pulses see which pixels"),
        "{refused}"
    );
    // Settings stored in a plan create the same former.
    let again = formers::former("bp", &former.settings()).unwrap();
    assert_eq!(again.beam(), Some(beam()));
    let wide = Beam::new(4.0, 0.0, BeamSource::Given);
    assert!(InBeam::new(bp, wide).is_err());
}

/// A strip with one point; antennas look 3 deg forward and down from a platform with constant attitude.
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
samples = 32

[[radar.transmitter]]
pattern = "gaussian"
boresight = "0.0524, 0.9986, -0.2"
azimuth = "5 deg"
elevation = "30 deg"

[[radar.receiver]]
pattern = "aperture"
boresight = "0.0524, 0.9986, -0.2"
azimuth = "7 deg"
elevation = "25 deg"

[platform]
kind = "linear"
position = "0, 0, 60 m"
velocity = "60, 4, 0 m/s"
at = "middle"
"#;

#[test]
fn scenario_files_contain_its_beam() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("strip.toml"), STRIP).unwrap();
    let scenario = Scenario::read(&at.join("strip.toml")).unwrap();
    let experiment = scenario.experiment().unwrap();
    let pair = experiment.pairs()[0];
    let recorded = experiment.record(pair).unwrap();
    let stated = recorded.beam().unwrap();
    // By hand: the 1 / w^2 of both antennas add, and the boresight has a horizontal length of 1 with 0.0524 along the track.
    let narrow = |deg: f64| deg.to_radians().powi(-2);
    let width_rad = (2.0 / (narrow(5.0) + narrow(7.0))).sqrt();
    let squint_rad = (0.0524f64 / (0.0524f64.powi(2) + 0.9986f64.powi(2) + 0.04).sqrt()).asin();
    assert!((stated.width_rad - width_rad).abs() < 1e-12);
    assert!((stated.squint_rad - squint_rad).abs() < 1e-9, "{stated:?}");

    let carried = recorded.echoes().carried();
    let file = at.join("strip.cphd");
    let channel = cphd::Channel::new("1", &recorded).with_antennas(carried.clone());
    assert!(cphd::describes_antennas(&channel));
    cphd::write(&file, &[channel], &WriteOptions::default(), &Silent).unwrap();
    let raw = Raw {
        id: "1".to_owned(),
        echoes: recorded.echoes(),
        antennas: Some(carried),
    };
    recording::write(&at.join("raw"), &[raw], &Silent).unwrap();
    let from_cphd = subaperture::open(&file).unwrap();
    let from_raw = subaperture::open(at.join("raw/recording.toml")).unwrap();
    // The description contains the same numbers with all digits.
    let described = from_raw.beam().unwrap();
    assert!((described.width_rad - stated.width_rad).abs() < 1e-12);
    assert!((described.squint_rad - stated.squint_rad).abs() < 1e-9);
    // The file states gain over direction cosines. The cut through boresight and heading is not at a right angle to `up`, so the width
    // differs from that in azimuth by the cosine of the elevation off boresight, below 1e-3 of 6 deg for 3 deg forward.
    let filed = from_cphd.beam().unwrap();
    println!("{stated:?}\n{filed:?}");
    assert!(
        (filed.width_rad - stated.width_rad).abs() < 1e-3 * stated.width_rad,
        "{filed:?}"
    );
    assert!(
        (filed.squint_rad - stated.squint_rad).abs() < 1e-3 * stated.width_rad,
        "{filed:?}"
    );

    // By default a former uses that beam with either file.
    let grid: ImageGrid = "x=-8:8.1:0.4,y=299:301.1:1".parse().unwrap();
    let bp = Backprojection::default();
    let beam_of = |history: &dyn PhaseHistory, choice| {
        let image = Focusing::new(history, &grid).beam(choice).by(&bp).unwrap();
        assert!(image.warnings.is_empty(), "{:?}", image.warnings);
        (image.settings.get("beam").cloned(), image.image.pixels)
    };
    for history in [&recorded as &dyn PhaseHistory, &from_cphd, &from_raw] {
        let (beam, pixels) = beam_of(history, BeamChoice::Stated);
        let beam = beam.unwrap();
        assert_eq!(beam["source"], "stated");
        let width_deg = beam["width_deg"].as_f64().unwrap();
        assert!((width_deg.to_radians() / stated.width_rad - 1.0).abs() < 1e-3);
        let given = BeamChoice::Given {
            width_rad: history.beam().unwrap().width_rad,
            squint_rad: history.beam().unwrap().squint_rad,
        };
        assert_eq!(beam_of(history, given).1, pixels);
        let (none, all) = beam_of(history, BeamChoice::None);
        assert!(none.is_none() && all != pixels);
    }
    let backwards = BeamChoice::Given {
        width_rad: 0.1,
        squint_rad: -1.2,
    };
    let refused = Focusing::new(&recorded, &grid).beam(backwards).by(&bp);
    assert!(matches!(refused, Err(FormError::Unsuited(_))));
}
