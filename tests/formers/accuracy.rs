//! The accuracy contract: bounds that are missed are refused, before the work where that can be known, or
//! recorded; dark grids are told; what is not finite is no image.

use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use subaperture::focus::bp::Backprojection;
use subaperture::focus::exact::Exact;
use subaperture::focus::ffbp::FastFactorised;
use subaperture::focus::pfa::PolarFormat;
use subaperture::focus::rdbp::{Mode, RangeDoppler, Thesis};
use subaperture::focus::{FormError, Formed, ImageFormer, Misses, Task};
use subaperture::geometry::ImageGrid;
use subaperture::monitor::Silent;
use subaperture::phase_history::{Collection, PhaseHistory, ReadError, Weights};
use subaperture::signal::window::Window;
use subaperture::simulate::{Preset, Scatterer, Simulated, Variation};
use subaperture_tests::error_db;
use subaperture_tests::subap::{listing, run};

/// A history that counts its pulses as they are read.
struct Counted(Simulated, AtomicUsize);

impl PhaseHistory for Counted {
    fn collection(&self) -> &Collection {
        self.0.collection()
    }

    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
        self.1.fetch_add(pulses.len(), Ordering::Relaxed);
        self.0.read(pulses, samples)
    }
}

/// Table 4.1 with scatterers of these places and amplitudes.
fn table_4_1(scatterers: &[(f64, f64, f64)]) -> Simulated {
    let preset = Preset::Table41.simulate(&Variation::default());
    let scatterers = scatterers
        .iter()
        .map(|&(x, y, amplitude)| Scatterer {
            position_m: DVec3::new(x, y, 0.0),
            amplitude: Complex64::new(amplitude, 0.0),
        })
        .collect();
    Simulated::new(preset.collection().clone(), scatterers, None)
}

fn form(
    former: &dyn ImageFormer,
    history: &dyn PhaseHistory,
    grid: &str,
    misses: Misses,
) -> Result<Formed, FormError> {
    let grid: ImageGrid = grid.parse().unwrap();
    let weights = Weights::new(history.collection(), Window::None, Window::None);
    former.form_asked(
        &Task {
            history,
            grid: &grid,
            weights: &weights,
            memory_bytes: 1 << 28,
            monitor: &Silent,
            means: Default::default(),
        },
        misses,
    )
}

fn rdbp(mode: Mode, sub_cpi: Option<usize>) -> RangeDoppler {
    RangeDoppler {
        mode,
        error_db: -60.0,
        sub_cpi,
        patch_m: None,
    }
}

#[test]
fn a_plan_that_misses_the_bound_is_refused_before_anything_is_read() {
    let polar = PolarFormat {
        error_db: -60.0,
        centre_m: None,
    };
    let long = rdbp(Mode::Precise, Some(1040));
    let thesis = rdbp(
        Mode::Thesis(Thesis {
            error_db: Some(-60.0),
            ..Thesis::default()
        }),
        None,
    );
    let fine = Backprojection { error_db: -140.0 };
    let grid = "x=-40:40:2.37,y=-40:40:2.31";
    for former in [&polar as &dyn ImageFormer, &long, &thesis, &fine] {
        let history = Counted(table_4_1(&[(0.0, 0.0, 1.0)]), AtomicUsize::new(0));
        let error = form(former, &history, grid, Misses::Refused).unwrap_err();
        let FormError::BoundMissed {
            predicted_db,
            bound_db,
            ref limit,
        } = error
        else {
            panic!("{}: {error}", former.name())
        };
        println!("{}: {error}", former.name());
        assert!(predicted_db > bound_db && Some(bound_db) == former.bound_db());
        assert!(!limit.remedies.is_empty(), "{limit}");
        assert_eq!(history.1.load(Ordering::Relaxed), 0, "{}", former.name());
        // Allowed, it is formed, and the record says so.
        let formed = form(former, &history, grid, Misses::Allowed).unwrap();
        assert!(formed.bound_missed && formed.predicted_error_db >= predicted_db);
        assert_eq!(formed.settings["bound_missed"], true);
        assert!(history.1.load(Ordering::Relaxed) > 0);
    }
}

#[test]
fn a_dark_grid_is_told_from_a_bright_one() {
    // A scatterer of 1 at (60, -50), of a millionth in the grid: its side lobes are all that the grid shows.
    let history = table_4_1(&[(60.0, -50.0, 1.0), (0.0, 0.0, 1e-6)]);
    let formers: [&dyn ImageFormer; 3] = [
        &Backprojection { error_db: -60.0 },
        &rdbp(Mode::Precise, None),
        &FastFactorised { error_db: -60.0 },
    ];
    let (dark, bright) = ("x=-60:-50:0.37,y=40:49:0.31", "x=55:65:0.37,y=-55:-45:0.31");
    for former in formers {
        let bright = form(former, &history, bright, Misses::Refused).unwrap();
        assert!(!bright.bound_missed);
        let formed = form(former, &history, dark, Misses::Allowed).unwrap();
        let exact = form(&Exact, &history, dark, Misses::Refused).unwrap();
        let measured = error_db(&formed.image, &exact.image);
        let predicted = formed.predicted_error_db;
        println!(
            "{}: {measured:.1} dB, predicted {predicted:.1} dB",
            former.name()
        );
        // Neither hidden nor exaggerated.
        assert!(measured <= predicted + 3.0 && measured >= predicted - 14.0);
        assert_eq!(formed.bound_missed, predicted > -60.0);
        // Histories of patches err most, and more than asked, where side lobes cancel.
        assert!(formed.bound_missed || former.name() != "ffbp");
        let strict = form(former, &history, dark, Misses::Refused);
        match strict {
            Ok(_) => assert!(!formed.bound_missed),
            Err(error) => {
                println!("{}: {error}", former.name());
                assert!(formed.bound_missed && error.to_string().contains("dark"));
            }
        }
    }
}

#[test]
fn the_thesiss_mode_says_what_it_does() {
    let history = Preset::Table41.simulate(&Variation::default());
    let grid = "x=-40:40:1.37,y=-40:40:1.31";
    let exact = form(&Exact, &history, grid, Misses::Refused).unwrap();
    for pulses in [20, 40, 65, 130] {
        let former = rdbp(Mode::Thesis(Thesis::default()), Some(pulses));
        let formed = form(&former, &history, grid, Misses::Refused).unwrap();
        let measured = error_db(&formed.image, &exact.image);
        let predicted = formed.predicted_error_db;
        println!("{pulses} pulses: {measured:.1} dB, predicted {predicted:.1} dB");
        // The worst pixel and sub-CPI decide: of an error that grows as the product of both offsets from a patch's
        // middle, the mean square is 1/9 of the corner's, -9.5 dB.
        assert!(measured <= predicted + 1.0 && measured >= predicted - 9.6);
    }
}

#[test]
fn what_is_not_finite_is_refused() {
    // Sums of 1e38 over 200 000 samples are beyond float32 on the way, or at the end.
    let history = table_4_1(&[(0.0, 0.0, 3e38), (0.5, 0.0, 3e38), (0.3, 0.2, 3e38)]);
    let former = Backprojection { error_db: -60.0 };
    match form(&former, &history, "x=-1:1:0.2,y=-1:1:0.2", Misses::Allowed) {
        Err(error) => println!("{error}"),
        Ok(formed) => assert!(formed.image.pixels.iter().all(|z| z.is_finite())),
    }
    let mut collection = table_4_1(&[]).collection().clone();
    collection.pulses[7].receiver_m.z = f64::INFINITY;
    let lost = Simulated::new(collection, Vec::new(), None);
    let error = form(&former, &lost, "x=-1:1:0.2,y=-1:1:0.2", Misses::Allowed).unwrap_err();
    assert!(error.to_string().contains("pulse 7"), "{error}");
}

#[test]
fn the_command_refuses_or_says_with_status_3() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    run(path, "simulate --preset table-4-1 -o s.cphd").succeeded();
    let focus = "focus s.cphd --grid x=-30:30:2,y=-30:30:2";
    let before = listing(path);
    run(path, &format!("{focus} -a pfa --out a"))
        .failed(1, &["predicted error", "-60 dB", "--grid"]);
    run(
        path,
        &format!("{focus} --mode thesis --error-db -60 --out a"),
    )
    .failed(1, &["predicted error", "-60 dB", "--mode precise"]);
    assert_eq!(listing(path), before);
    let allowed = run(path, &format!("{focus} -a pfa --out a --allow-error"));
    allowed.failed(3, &["predicted error", "above the -60 dB asked"]);
    let record = std::fs::read(path.join("a/image.json")).unwrap();
    let record: serde_json::Value = serde_json::from_slice(&record).unwrap();
    let resolved = &record["settings"]["resolved"];
    assert_eq!(resolved["bound_missed"], true);
    assert!(resolved["predicted_error_db"].as_f64().unwrap() > -60.0);
    // The thesis's method has no bound of its own, and still says what it expects.
    run(path, &format!("{focus} --mode thesis --out b")).succeeded();
    let record = std::fs::read(path.join("b/image.json")).unwrap();
    let record: serde_json::Value = serde_json::from_slice(&record).unwrap();
    assert!(record["settings"]["resolved"]["predicted_error_db"].is_f64());
    // A bound that is kept needs no permission, and gives status 0.
    run(path, &format!("{focus} --out c --allow-error")).succeeded();
}
