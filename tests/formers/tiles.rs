//! For every former, the bits of a pixel follow from plan and samples alone. Threads, memory, tiles and their order change no bit.

use glam::DVec3;
use num_complex::Complex32;
use subaperture::focus::formers::FORMERS;
use subaperture::focus::patch::PatchSize;
use subaperture::focus::plan::{InMemory, PlanError};
use subaperture::focus::{
    BoundPolicy, DEFAULT_ERROR_DB, ImageSpec, Plan, SCRATCH_BYTES, Task, Work,
};
use subaperture::geometry::ImageGrid;
use subaperture::monitor::Silent;
use subaperture::phase_history::{self, PhaseHistory, Weights};
use subaperture::signal::window::Window;
use subaperture::simulate::{Noise, PointTargetHistory, Preset, Variation};

/// A grid without symmetry: 71 columns, 53 rows.
const GRID: &str = "x=-40:37.4:1.09,y=-38:39.9:1.47";

fn history() -> PointTargetHistory {
    Preset::Table41.simulate(&Variation {
        noise: Some(Noise {
            power_db: -20.0,
            seed: 4,
        }),
        ..Variation::default()
    })
}

fn plan(
    name: &str,
    settings: &serde_json::Value,
    history: &PointTargetHistory,
    scratch_bytes: u64,
) -> Plan {
    let grid: ImageGrid = GRID.parse().unwrap();
    plan_on(&grid, name, settings, history, scratch_bytes)
}

fn plan_on(
    grid: &ImageGrid,
    name: &str,
    settings: &serde_json::Value,
    history: &dyn PhaseHistory,
    scratch_bytes: u64,
) -> Plan {
    let former = subaperture::focus::formers::former(name, settings).unwrap();
    let weights = Weights::new(history.collection(), Window::Hamming, Window::default());
    let spec = ImageSpec {
        scratch_bytes,
        ..ImageSpec::new(history.collection(), grid, &weights)
    };
    Plan::new(&*former, &spec, BoundPolicy::Allowed, &Silent).unwrap()
}

/// Parameters of an execution that must not affect the image.
pub(crate) struct Run {
    pub(crate) threads: usize,
    pub(crate) memory_bytes: u64,
    pub(crate) tile: Option<[usize; 2]>,
    pub(crate) most_a_pass: usize,
    pub(crate) backwards: bool,
}

pub(crate) const WHOLE: Run = Run {
    threads: 2,
    memory_bytes: 2 << 30,
    tile: None,
    most_a_pass: usize::MAX,
    backwards: false,
};

/// Pixels of a plan that is read from its text.
pub(crate) fn execute(plan: &Plan, history: &dyn PhaseHistory, run: &Run) -> Vec<Complex32> {
    let mut plan = Plan::from_text(&plan.to_text()).unwrap();
    if let Some([rows, columns]) = run.tile {
        plan.tile = PatchSize { rows, columns };
    }
    let weights = plan.weights(history.collection()).unwrap();
    let opened = plan.open(history.collection(), &weights).unwrap();
    let work = Work {
        history,
        memory_bytes: run.memory_bytes,
        monitor: &Silent,
    };
    let mut indices: Vec<usize> = (0..plan.num_tiles()).collect();
    if run.backwards {
        indices.reverse();
    }
    let mut image = InMemory::of(&plan);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(run.threads);
    pool.build()
        .unwrap()
        .install(|| opened.form(&work, &indices, run.most_a_pass, &mut image))
        .unwrap();
    assert_eq!(image.records.len(), plan.num_tiles());
    image.image.pixels
}

#[test]
fn bits_follow_from_plan_and_samples_alone() {
    let history = history();
    // Memory for the largest array of a former here, the spectrum of omega-k and rda, 10 MB.
    let little = history.held_bytes() + (16 << 20);
    let runs = [
        Run {
            threads: 1,
            memory_bytes: 64 << 20,
            ..WHOLE
        },
        Run {
            threads: 7,
            tile: Some([53, 19]),
            most_a_pass: 2,
            ..WHOLE
        },
        Run {
            memory_bytes: little,
            tile: Some([17, 23]),
            most_a_pass: 1,
            backwards: true,
            ..WHOLE
        },
        Run {
            tile: Some([1, 71]),
            most_a_pass: 5,
            ..WHOLE
        },
        Run {
            tile: Some([11, 3]),
            most_a_pass: 1000,
            backwards: true,
            ..WHOLE
        },
    ];
    for entry in &FORMERS {
        let both = match entry.name {
            "rdbp" => vec![
                serde_json::json!({}),
                serde_json::json!({ "mode": { "thesis": {} } }),
            ],
            _ => vec![serde_json::json!({})],
        };
        for settings in both {
            // The thesis's mode has maps of the whole scene and takes 0.3 s in each pass.
            let runs = match settings["mode"].is_null() {
                true => &runs[..],
                false => &runs[..2],
            };
            let plan = plan(entry.name, &settings, &history, SCRATCH_BYTES);
            let whole = execute(&plan, &history, &WHOLE);
            assert!(whole.iter().any(|z| z.norm_sqr() > 0.5), "{}", entry.name);
            for (index, run) in runs.iter().enumerate() {
                // Each pass of `exact` takes as long as a whole image.
                if entry.name == "exact" && index > 1 {
                    continue;
                }
                let image = execute(&plan, &history, run);
                assert!(image == whole, "{} {settings}, run {index}", entry.name);
            }
        }
    }
}

/// The same scene in Earth-fixed coordinates, where float64 resolves a nanometre. An image in two parts is bit-identical to the whole, so
/// the position of a pixel must not depend on its tile's origin.
#[test]
fn bits_far_from_origin_follow_from_plan_and_samples_alone() {
    let near = history();
    let away = DVec3::new(4.1e6, -1.3e6, 4.7e6);
    let mut collection = near.collection().clone();
    let mut samples = vec![Complex32::ZERO; collection.pulses.len() * collection.num_samples];
    near.read(0..collection.pulses.len(), &mut samples).unwrap();
    for pulse in &mut collection.pulses {
        pulse.transmitter_m += away;
        pulse.receiver_m += away;
        pulse.reference_m += away;
    }
    let history = phase_history::InMemory::new(collection, samples).unwrap();
    let mut grid: ImageGrid = GRID.parse().unwrap();
    grid.origin_m += away;
    let halves = Run {
        tile: Some([53, 29]),
        ..WHOLE
    };
    for name in ["bp", "rdbp", "ffbp", "pfa"] {
        let plan = plan_on(&grid, name, &serde_json::json!({}), &history, SCRATCH_BYTES);
        let whole = execute(&plan, &history, &WHOLE);
        assert!(whole.iter().any(|z| z.norm_sqr() > 0.5), "{name}");
        let image = execute(&plan, &history, &halves);
        assert!(image == whole, "{name}");
    }
}

/// The image of a task equals that of a plan with the task's windows and scratch memory.
#[test]
fn task_and_plan_give_same_image() {
    let history = history();
    let grid: ImageGrid = GRID.parse().unwrap();
    let weights = Weights::new(history.collection(), Window::Hamming, Window::default());
    for entry in &FORMERS {
        let settings = serde_json::json!({});
        let former = (entry.of)(&settings).unwrap();
        assert_eq!(former.name(), entry.name);
        assert_eq!(
            former.bound_db().unwrap_or(DEFAULT_ERROR_DB),
            DEFAULT_ERROR_DB
        );
        let task = Task {
            memory_bytes: 2 << 30,
            ..Task::new(&history, &grid, &weights)
        };
        let formed = former.form_best(&task).unwrap();
        if !formed.settings["planned_error_db"].is_null()
            && formed.settings.contains_key("planned_for_db")
        {
            // These formers plan a second time.
            continue;
        }
        let plan = plan(entry.name, &settings, &history, SCRATCH_BYTES);
        let image = execute(&plan, &history, &WHOLE);
        assert!(image == formed.image.pixels, "{}", entry.name);
    }
}

/// A plan for little scratch memory makes other choices (blocks of pulses, smaller maps) and keeps its bound.
#[test]
fn plan_with_little_scratch_memory_keeps_bound() {
    let history = history();
    let settings = serde_json::json!({});
    for (name, scratch_bytes) in [("bp", 200_000), ("ffbp", 600_000), ("rdbp", 150_000)] {
        let ample = plan(name, &settings, &history, SCRATCH_BYTES);
        let little = plan(name, &settings, &history, scratch_bytes);
        assert_ne!(ample.summary, little.summary, "{name}");
        assert!(little.planned_db <= -60.0, "{name}");
        let exact = execute(
            &plan("exact", &settings, &history, SCRATCH_BYTES),
            &history,
            &WHOLE,
        );
        let image = execute(&little, &history, &WHOLE);
        let (mut error, mut power) = (0.0, 0.0);
        for (a, b) in image.iter().zip(&exact) {
            error += f64::from((a - b).norm_sqr());
            power += f64::from(b.norm_sqr());
        }
        let error_db = 10.0 * (error / power).log10();
        println!("{name}: {error_db:.1} dB by {}", little.summary);
        assert!(error_db <= -60.0, "{name}: {error_db}");
    }
}

#[test]
fn plans_of_other_recordings_and_edited_plans_are_refused() {
    let history = history();
    let plan = plan("bp", &serde_json::json!({}), &history, SCRATCH_BYTES);
    let mut other = history.collection().clone();
    other.pulses[7].receiver_m.z += 1e-9;
    let weights = plan.weights(&other).unwrap();
    let error = plan.open(&other, &weights).err().unwrap();
    assert!(matches!(error, PlanError::Recording { .. }), "{error}");

    let text = plan.to_text();
    let refused = |from: &str, to: &str| {
        assert!(text.contains(from), "{from} in {text}");
        let text = text.replace(from, to);
        let plan = Plan::from_text(&text)?;
        plan.weights(history.collection())?;
        plan.open(history.collection(), &weights)?;
        Ok(())
    };
    let message = |from: &str, to: &str| {
        let error: Result<(), PlanError> = refused(from, to);
        error.expect_err(to).to_string()
    };
    let error = message("subaperture-plan-2", "subaperture-plan-9");
    assert!(error.contains("subaperture-plan-9"), "{error}");
    let error = message("\"bp\"", "\"bq\"");
    assert!(error.contains("no former 'bq'"), "{error}");
    let error = message("\"error_db\"", "\"eror_db\"");
    assert!(error.contains("eror_db"), "{error}");
    let error = message("\"oversampling\": ", "\"oversampling\": \"x\", \"x\": ");
    assert!(error.contains("was not made by bp"), "{error}");
    let error = message("\"hamming\"", "\"hammer\"");
    assert!(error.contains("hammer"), "{error}");
}

/// A plan whose kernel is missing, unknown, or does not keep the bound is refused: histories would not be decimated, or beyond the bound.
#[test]
fn factorised_plans_with_another_kernel_are_refused() {
    let history = history();
    let plan = plan("ffbp", &serde_json::json!({}), &history, SCRATCH_BYTES);
    let weights = plan.weights(history.collection()).unwrap();
    let text = plan.to_text();
    let with = |kernel: Option<serde_json::Value>| {
        let mut json: serde_json::Value = serde_json::from_str(&text).unwrap();
        let choices = json["choices"].as_object_mut().unwrap();
        let own = choices.remove("kernel").unwrap();
        assert!(own["taps"].is_u64(), "{own}");
        if let Some(kernel) = kernel {
            choices.insert("kernel".to_owned(), kernel);
        }
        let plan = Plan::from_text(&json.to_string())?;
        plan.open(history.collection(), &weights).map(drop)
    };
    let kernel = |taps: usize, band: f64, decimations: usize, first: usize| {
        serde_json::json!({
            "taps": taps, "band": band, "decimations": [decimations, decimations], "first": [first, first],
        })
    };
    for kernel in [
        None,
        Some(serde_json::json!(null)),
        Some(kernel(7, 0.2, 4, 2)),
        Some(kernel(6, 0.42, 4, 2)),
        Some(kernel(12, 1e300, 4, 2)),
        Some(kernel(12, 0.3, 0, 2)),
        Some(kernel(12, 0.3, 4, 4)),
    ] {
        let error: PlanError = with(kernel.clone()).expect_err("refused");
        let message = error.to_string();
        assert!(message.contains("kernel"), "{kernel:?}: {message}");
    }
}
