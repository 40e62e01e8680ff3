//! Detection performance of all methods against theory.

use std::sync::Arc;

use subaperture_gmti::evaluation::{Evaluation, Method, Plan, Report, Setup, TestTarget};
use subaperture_gmti::{GmtiError, detection, space_time};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::monitor::Silent;
use subaperture_model::track::Linear;
use subaperture_simulate::scene::Mover;

use crate::recording::{THREE, Uniform, imaging, number_of_scenes, recorded, scene_of_seed};

/// Performance with 10 targets in each recording.
fn evaluated(recordings: usize) -> Report {
    let grid: ImageGrid = "x=-60:60:0.35,y=-60:60:0.5,z=0".parse().unwrap();
    let setup = Setup {
        imaging: imaging(&grid),
        detection: detection::Settings::default(),
        integration: space_time::Settings::default(),
        cross_section_m2: 3.0,
    };
    let plan = Plan {
        recordings,
        targets: 10,
        absent: 500,
        speeds_m_s: [0.003, 20.0],
    };
    let mut random = Uniform(9);
    let simulate = |number: u64, targets: &[TestTarget]| {
        let mut experiment = scene_of_seed(number, &[], &THREE, 10.0);
        experiment.scene.movers = targets.iter().map(mover).collect();
        Ok::<_, GmtiError>(recorded(&experiment))
    };
    let uniform = || random.between(0.0, 1.0);
    let evaluation = Evaluation::run(&setup, &plan, &Silent, uniform, simulate);
    evaluation.unwrap().report(1e-6)
}

fn mover(target: &TestTarget) -> Mover {
    Mover {
        motion: Arc::new(Linear {
            position_m: target.motion.position_m,
            velocity_m_s: target.motion.velocity_m_s,
            at_s: target.motion.epoch_s,
        }),
        amplitude: target.amplitude,
    }
}

/// Number of recordings: `SUBAPERTURE_SCENES`, 2 if it is not set.
#[test]
fn measured_detections_and_false_alarms_agree_with_theory() {
    let report = evaluated(number_of_scenes(2) as usize);
    for method in &report.methods {
        println!(
            "{}: MDV {:.3?} m/s, predicted {:.3?} m/s",
            method.method, method.mdv_m_s, method.predicted_mdv_m_s
        );
        let (mut detected, mut mean, mut variance, mut all) = (0.0, 0.0, 0.0, 0.0);
        for at in &method.curve {
            println!("    {at:.3?}");
            let targets = at.targets as f64;
            all += targets;
            detected += targets * at.detected;
            if let Some(predicted) = at.predicted {
                mean += targets * predicted;
                variance += targets * predicted * (1.0 - predicted);
            }
        }
        for alarms in &method.false_alarms {
            println!("    {alarms:?}: {:.2}", alarms.ratio());
        }
        // Interferometry has more false alarms than the density of the clutter gives: errors of registration grow with the amplitude of a pixel. The bound of the
        // maximum over velocities leaves fewer.
        let most = if method.method == Method::Ati {
            2.0
        } else {
            1.3
        };
        let [alarms, ..] = &method.false_alarms[..] else {
            panic!("no false alarms were counted");
        };
        let expected = alarms.tested as f64 * alarms.requested;
        let (found, sigma) = (alarms.found as f64, expected.sqrt());
        assert!(
            found > 0.6 * expected - 4.0 * sigma,
            "{}: {alarms:?}",
            method.method
        );
        assert!(
            found < most * expected + 4.0 * sigma,
            "{}: {alarms:?}",
            method.method
        );
        if method.method != Method::Ati {
            // Four standard deviations, and 5 % for targets between pixels.
            let error = (detected - mean).abs();
            println!(
                "    {detected} of {all} detected, {mean:.1} +- {:.1} predicted",
                variance.sqrt()
            );
            assert!(
                error < 4.0 * variance.sqrt() + 0.05 * all,
                "{}: {error}",
                method.method
            );
        }
    }
    let mdv = |method: Method| {
        let own = report.methods.iter().find(|own| own.method == method);
        own.unwrap().predicted_mdv_m_s.unwrap()
    };
    let [one, all] = [Method::Efa { bins: 3 }, Method::Integrated { bins: 3 }].map(mdv);
    assert!(all < 0.5 * one, "{all} of {one}");
}
