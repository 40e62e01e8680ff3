//! Forecast stages of formers against the stages that they report, and plans by other timing models.

use std::time::Instant;

use num_complex::Complex32;
use subaperture::focus::formers::{FORMERS, former};
use subaperture::focus::plan::{InMemory, PlanError};
use subaperture::focus::stages::{READING, SAMPLES, StageTime, StageTimer, StageTimes};
use subaperture::focus::{BoundPolicy, ImageSpec, Numerics, Plan, TimeModel, Work};
use subaperture::geometry::ImageGrid;
use subaperture::monitor::Silent;
use subaperture::phase_history::{PhaseHistory, Weights};
use subaperture::signal::window::Window;
use subaperture::simulate::{PointTargetHistory, Preset, Variation};

fn plan(
    name: &str,
    settings: &serde_json::Value,
    history: &PointTargetHistory,
    model: &TimeModel,
) -> Plan {
    let numerics = Numerics {
        model,
        ..Numerics::default()
    };
    plan_by(name, settings, history, numerics)
}

fn plan_by(
    name: &str,
    settings: &serde_json::Value,
    history: &PointTargetHistory,
    numerics: Numerics,
) -> Plan {
    let former = former(name, settings).unwrap();
    let grid: ImageGrid = "x=-40:40:0.4,y=-40:40:0.4".parse().unwrap();
    let weights = Weights::new(history.collection(), Window::Hamming, Window::default());
    let spec = ImageSpec {
        numerics,
        ..ImageSpec::new(history.collection(), &grid, &weights)
    };
    Plan::new(&*former, &spec, BoundPolicy::Allowed, &Silent).unwrap()
}

/// The image of a plan read from its text, and the times of its stages.
fn formed(plan: &Plan, history: &PointTargetHistory) -> (Vec<Complex32>, Vec<StageTime>) {
    let plan = Plan::from_text(&plan.to_text()).unwrap();
    let weights = plan.weights(history.collection()).unwrap();
    let opened = plan.open(history.collection(), &weights).unwrap();
    let times = StageTimes::default();
    let work = Work {
        history,
        memory_bytes: 1 << 30,
        monitor: &StageTimer {
            monitor: &Silent,
            times: &times,
        },
    };
    let mut image = InMemory::of(&plan);
    let all: Vec<usize> = (0..plan.num_tiles()).collect();
    let begun = Instant::now();
    opened.form(&work, &all, usize::MAX, &mut image).unwrap();
    let elapsed = begun.elapsed();
    let taken = times.taken();
    for stage in &taken {
        assert!(
            stage.clock <= elapsed && stage.clock <= stage.threads,
            "{stage:?}"
        );
    }
    (image.image.pixels, taken)
}

#[test]
fn formers_report_the_stages_of_their_forecast() {
    let history = Preset::Table41.simulate(&Variation::default());
    let thesis = serde_json::json!({ "mode": { "thesis": {} } });
    let plain = FORMERS.map(|entry| (entry.name, serde_json::json!({})));
    for (name, settings) in plain.into_iter().chain([("rdbp", thesis)]) {
        if name == "exact" {
            // The single stage of `exact` takes half a minute here, and the comparison has the same loop.
            continue;
        }
        let plan = plan(name, &settings, &history, &TimeModel::DEFAULT);
        let cost = &plan.cost;
        let stages = cost.stages.iter();
        let sum: f64 = stages.clone().map(|stage| stage.operations).sum();
        assert_eq!(sum, cost.operations, "{name}");
        let shared = stages.clone().filter(|stage| stage.shared);
        let shared: f64 = shared.map(|stage| stage.operations).sum();
        assert_eq!(shared, cost.shared_operations, "{name}");
        let (_, taken) = formed(&plan, &history);
        let own = taken
            .iter()
            .filter(|taken| ![READING, SAMPLES].contains(&taken.stage));
        let reported: Vec<&str> = own.map(|taken| taken.stage).collect();
        let forecast: Vec<&str> = stages.clone().map(|stage| &*stage.name).collect();
        assert_eq!(reported, forecast, "{name}");
        assert_eq!(taken.len(), reported.len() + 2, "{name}: {taken:?}");
        for stage in stages {
            let took = taken
                .iter()
                .find(|taken| taken.stage == stage.name)
                .unwrap();
            let took_s = took.threads.as_secs_f64();
            println!(
                "{name} {}: {:.2e} operations, {:.3} s forecast, {took_s:.3} s taken",
                stage.name, stage.operations, stage.core_s
            );
            // The machine may be busy, and slower than the model: only the sign of times is checked.
            assert!(stage.core_s > 0.0 && took_s > 0.0);
            assert!(
                took_s < 1000.0 * stage.core_s && stage.core_s < 100.0 * took_s,
                "{name}"
            );
        }
    }
}

/// Default timing model with some constants replaced, ns.
pub(crate) fn model(name: &str, times_ns: &[(&str, f64)]) -> TimeModel {
    let mut json: serde_json::Value = serde_json::from_str(&TimeModel::DEFAULT.to_text()).unwrap();
    json["name"] = name.into();
    for &(entry, ns) in times_ns {
        assert!(json[entry].is_f64(), "{entry}");
        json[entry] = ns.into();
    }
    TimeModel::from_value(json).unwrap()
}

/// Any timing constants change the choices only: the image keeps its bound.
#[test]
fn plan_by_absurd_timing_model_keeps_bound() {
    let history = Preset::Table41.simulate(&Variation::default());
    let defaults = serde_json::json!({});
    let exact = plan("exact", &defaults, &history, &TimeModel::DEFAULT);
    let (exact, _) = formed(&exact, &history);
    let models = [
        model(
            "free leaves",
            &[
                ("leaf_group_ns", 1e-6),
                ("leaf_pulse_ns", 1e-6),
                ("leaf_piece_ns", 1e-6),
                ("transform_ns", 1e-6),
                ("tile_pulse_ns", 1e12),
                ("compensation_ns", 1e-6),
                ("doppler_tap_ns", 1e-6),
                ("map_sample_ns", 1e-6),
                ("column_transform_ns", 1e-6),
            ],
        ),
        model(
            "free histories",
            &[
                ("turn_ns", 1e-6),
                ("pulse_tap_ns", 1e-6),
                ("sample_tap_ns", 1e-6),
                ("patch_ns", 1e-6),
                ("transform_ns", 1e12),
                ("piece_ns", 1e12),
                ("compensation_ns", 1e-6),
                ("map_transform_ns", 1e9),
                ("map_sample_ns", 1e9),
            ],
        ),
    ];
    let single_level = serde_json::json!({ "patch_m": 10.0 });
    // On so few pixels, nested patches with maps have one fastest size by any model.
    for (name, settings, changes) in [
        ("bp", &defaults, true),
        ("ffbp", &defaults, true),
        ("rdbp", &single_level, true),
        ("rdbp", &defaults, false),
    ] {
        let default = plan(name, settings, &history, &TimeModel::DEFAULT);
        let others = models
            .each_ref()
            .map(|model| plan(name, settings, &history, model));
        let choice = |plan: &Plan| {
            let mut choice = plan.summary.clone();
            choice.as_object_mut().unwrap().remove("time_model");
            choice
        };
        let changed = others
            .iter()
            .filter(|other| choice(other) != choice(&default));
        let changed = changed.count();
        assert!(!changes || changed > 0, "{name}: {}", default.summary);
        for (other, model) in others.iter().zip(&models) {
            assert_eq!(other.time_model, *model);
            assert_eq!(other.summary["time_model"], serde_json::json!(model));
            let (image, _) = formed(other, &history);
            let (mut error, mut power) = (0.0, 0.0);
            for (a, b) in image.iter().zip(&exact) {
                error += f64::from((a - b).norm_sqr());
                power += f64::from(b.norm_sqr());
            }
            let error_db = 10.0 * (error / power).log10();
            println!(
                "{name}, {}: {error_db:.1} dB by {}",
                model.name(),
                choice(other)
            );
            assert!(other.planned_db <= -60.0 && error_db <= -60.0, "{name}");
        }
    }
}

/// Choices by the default timing model do not depend on the machine.
#[test]
fn default_plan_is_independent_of_machine() {
    let history = Preset::Table41.simulate(&Variation::default());
    let model = TimeModel::measured("here".to_owned());
    assert_ne!(model, TimeModel::DEFAULT);
    for entry in &FORMERS {
        let defaults = serde_json::json!({});
        let default = plan_by(entry.name, &defaults, &history, Numerics::default());
        assert_eq!(default.time_model, TimeModel::DEFAULT);
        assert_eq!(default.summary["time_model"], "default");
        // A measured timing model of this machine changes no default plan.
        assert_eq!(
            default,
            plan(entry.name, &defaults, &history, &TimeModel::DEFAULT)
        );
        let own = plan(entry.name, &defaults, &history, &model);
        assert_eq!(own.summary["time_model"]["name"], "here");
        assert_eq!(own.cost.operations > 0.0, default.cost.operations > 0.0);
    }
}

#[test]
fn plans_with_invalid_timing_models_are_refused() {
    let history = Preset::Table41.simulate(&Variation::default());
    let plan = plan("bp", &serde_json::json!({}), &history, &TimeModel::DEFAULT);
    let text = plan.to_text();
    for wrong in ["-9.0", "0.0", "1e13", "1e-9"] {
        let other = text.replace("\"point_ns\": 9.0", &format!("\"point_ns\": {wrong}"));
        assert_ne!(other, text);
        let error = Plan::from_text(&other).unwrap_err();
        assert!(matches!(error, PlanError::Model(_)), "{error}");
        assert!(
            error
                .to_string()
                .contains("point_ns of the time model 'default'"),
            "{error}"
        );
    }
}
