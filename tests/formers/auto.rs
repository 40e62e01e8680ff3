//! `auto`: choice of the fastest former, and refusals.

use std::collections::BTreeSet;

use crate::stages::model;
use glam::DVec3;
use subaperture::focus::auto::{Auto, CANDIDATES};
use subaperture::focus::formers::former;
use subaperture::focus::{
    BoundPolicy, FormError, ImageFormer, ImageSpec, Numerics, Plan, SCRATCH_BYTES, TimeModel,
};
use subaperture::geometry::{ImageGrid, SceneFrame};
use subaperture::monitor::Silent;
use subaperture::phase_history::{Collection, Pulse, Sweep, Weights};
use subaperture::signal::window::Window;

/// A slightly bent track past a scene 2 km away.
fn collection(num_pulses: usize, num_samples: usize, length_m: f64) -> Collection {
    let pulse = |n: usize| {
        let u = n as f64 / (num_pulses - 1) as f64 - 0.5;
        let antenna_m = DVec3::new(length_m * u, -1732.0 + 0.1 * (9.0 * u).sin(), 1000.0);
        Pulse {
            time_s: 1e-3 * n as f64,
            transmitter_m: antenna_m,
            receiver_m: antenna_m,
            reference_m: DVec3::ZERO,
            reference_path_m: 2.0 * antenna_m.length(),
            start_hz: 9.7e9,
            step_hz: 600e6 / num_samples as f64,
            sweep: Sweep::AT_ONCE,
            recorded_path_m: None,
        }
    };
    Collection {
        name: "auto".to_owned(),
        num_samples,
        pulses: (0..num_pulses).map(pulse).collect(),
        frame: SceneFrame::Local,
        extent: None,
        timed: true,
    }
}

fn plan(
    former: &dyn ImageFormer,
    collection: &Collection,
    grid: &str,
    bound_policy: BoundPolicy,
    model: &TimeModel,
) -> Result<Plan, FormError> {
    let grid: ImageGrid = grid.parse().unwrap();
    let weights = Weights::new(collection, Window::Hamming, Window::Hamming);
    let spec = ImageSpec {
        collection,
        grid: &grid,
        weights: &weights,
        scratch_bytes: SCRATCH_BYTES,
        numerics: Numerics {
            model,
            ..Numerics::default()
        },
    };
    Plan::new(former, &spec, bound_policy, &Silent)
}

#[test]
fn auto_picks_fastest_former_that_keeps_bound() {
    let mut taken = BTreeSet::new();
    for (pulses, samples, length_m, grid) in [
        (60, 64, 3.0, "x=-4:4:0.2,y=-4:4:0.2"),
        (300, 256, 20.0, "x=-20:20:0.2,y=-20:20:0.2"),
        (2000, 1024, 120.0, "x=-80:80:0.2,y=-80:80:0.2"),
    ] {
        let collection = collection(pulses, samples, length_m);
        let planned = |former: &dyn ImageFormer| {
            let model = &TimeModel::DEFAULT;
            plan(former, &collection, grid, BoundPolicy::Refused, model)
        };
        let own = planned(&Auto::default().error_db(-55.0)).unwrap();
        let name = own.summary["former"].as_str().unwrap().to_owned();
        let bound = serde_json::json!({ "error_db": -55.0 });
        for candidate in CANDIDATES.map(|entry| entry.name) {
            let former = former(candidate, &bound).unwrap();
            let Ok(other) = planned(&*former) else {
                continue;
            };
            assert!(own.cost.core_s() <= other.cost.core_s(), "{candidate}");
            if candidate == name {
                assert_eq!(own.cost, other.cost);
                assert_eq!(own.planned_db, other.planned_db);
            }
        }
        assert!(own.planned_db <= -55.0);
        println!("{pulses} pulses: {name}");
        taken.insert(name);
    }
    assert!(
        taken.contains("ffbp") && taken.contains("rdbp"),
        "{taken:?}"
    );
}

#[test]
fn timing_model_selects_the_former() {
    let collection = collection(300, 256, 20.0);
    let slow = model(
        "slow leaves",
        &[("leaf_group_ns", 1e6), ("map_sample_ns", 1e6)],
    );
    let grid = "x=-20:20:0.2,y=-20:20:0.2";
    let plan = plan(
        &Auto::default(),
        &collection,
        grid,
        BoundPolicy::Refused,
        &slow,
    );
    assert_eq!(plan.unwrap().summary["former"], "bp");
}

/// Intra-pulse motion restricts the choice to formers that compensate it.
#[test]
fn auto_picks_only_formers_that_handle_intra_pulse_motion() {
    let mut collection = collection(300, 256, 20.0);
    for pulse in &mut collection.pulses {
        pulse.sweep = Sweep {
            sample_s: 1e-6,
            transmitter_m_s: DVec3::new(30.0, 0.0, 0.0),
            receiver_m_s: DVec3::new(30.0, 0.0, 0.0),
            ..Sweep::AT_ONCE
        };
    }
    let grid = "x=-20:20:0.2,y=-20:20:0.2";
    let model = &TimeModel::DEFAULT;
    let plan = plan(
        &Auto::default(),
        &collection,
        grid,
        BoundPolicy::Refused,
        model,
    )
    .unwrap();
    let name = plan.summary["former"].as_str().unwrap();
    let taken = former(name, &serde_json::json!({})).unwrap();
    assert!(taken.follows_sweeps() && name != "ffbp", "{name}");
}

#[test]
fn image_that_every_candidate_refuses_is_refused() {
    let collection = collection(60, 64, 3.0);
    let grid = "x=-4:4:0.2,y=-4:4:0.2";
    let asked = Auto::default().error_db(-150.0);
    let model = &TimeModel::DEFAULT;
    let refused = plan(&asked, &collection, grid, BoundPolicy::Refused, model).unwrap_err();
    assert!(
        refused.to_string().contains("requested bound of -150 dB"),
        "{refused}"
    );
    // The best bound that any candidate reaches.
    let best = plan(&asked, &collection, grid, BoundPolicy::Allowed, model).unwrap();
    for candidate in CANDIDATES.map(|entry| entry.name) {
        let former = former(candidate, &asked.settings()).unwrap();
        let other = plan(&*former, &collection, grid, BoundPolicy::Allowed, model).unwrap();
        assert!(other.planned_db > -150.0, "{candidate}");
    }
    assert!(best.planned_db > -150.0);
}

/// A plan edited to name another former is refused.
#[test]
fn edited_plan_that_names_another_former_is_refused() {
    let collection = collection(60, 64, 3.0);
    let model = &TimeModel::DEFAULT;
    let grid = "x=-4:4:0.2,y=-4:4:0.2";
    let plan = plan(
        &Auto::default(),
        &collection,
        grid,
        BoundPolicy::Refused,
        model,
    )
    .unwrap();
    let text = plan.to_text();
    let name = plan.summary["former"].as_str().unwrap();
    let weights = plan.weights(&collection).unwrap();
    for other in ["pfa", "auto", "unknown"] {
        let changed = text.replace(
            &format!("\"former\": \"{name}\""),
            &format!("\"former\": \"{other}\""),
        );
        assert_ne!(changed, text);
        let plan = Plan::from_text(&changed).unwrap();
        let message = match plan.open(&collection, &weights) {
            Ok(_) => panic!("{other} is opened"),
            Err(error) => error.to_string(),
        };
        assert!(
            message.contains("found that of another former"),
            "{message}"
        );
    }
}
