//! Speed limits in the plan of a collection.

use subaperture_describe::Description;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::Collection;
use subaperture_planner::chain::{Chain, example};
use subaperture_planner::{Parameters, PlanError, RadarPlan, Request};

const C: f64 = 299_792_458.0;

/// Pass at 1 m/s with 10 sweeps per second of 50 carriers, 1.1 GHz to 1.296 GHz.
fn pass() -> Collection {
    let parameters = Parameters {
        carrier_hz: 1.2e9,
        bandwidth_hz: 200e6,
        num_frequencies: 50,
        range_m: 50.0,
        velocity_m_s: 1.0,
        prf_hz: 10.0,
        num_pulses: 64,
        scene_m: [10.0; 2],
        ..Parameters::default()
    };
    parameters.collection().unwrap()
}

fn plan(
    collection: &Collection,
    beamwidth_rad: Option<f64>,
    chain: Option<&Chain>,
) -> Result<RadarPlan, PlanError> {
    let grid: ImageGrid = "x=-5:5:0.5,y=-5:5:0.5,z=0".parse().unwrap();
    let request = Request {
        grid: &grid,
        error_db: -40.0,
        memory_bytes: 1 << 28,
        thesis_sub_cpi: 16,
        beamwidth_rad,
        power: None,
        chain,
    };
    RadarPlan::new(collection, &request)
}

#[test]
fn sweep_of_a_recording_has_its_own_timing() {
    let simultaneous = plan(&pass(), None, None).unwrap();
    assert_eq!(simultaneous.sweep, None);
    let mut recording = pass();
    for pulse in &mut recording.pulses {
        // From the highest carrier down.
        pulse.sweep.sample_s = -1e-3;
    }
    let sweep = plan(&recording, Some(0.5), None).unwrap().sweep.unwrap();
    let near = |value: f64, expected: f64| {
        // Rounding of pulse times.
        assert!((value / expected - 1.0).abs() < 1e-9, "{value} {expected}");
    };
    near(sweep.sweep.sweep_s, 0.05);
    near(sweep.sweep.interval_s, 0.1);
    near(sweep.platform_m_s.unwrap(), 1.0);
    // Radial speeds at the edge of the beam are sin 0.25 of the platform's. Half a turn of 1.296 GHz in 0.1 s, a tenth of a turn of
    // 1.198 GHz in 0.05 s, two-way.
    let part = 0.25f64.sin();
    near(sweep.limits.followed_m_s, C / (4.0 * 1.296e9 * 0.1) / part);
    near(
        sweep.limits.in_place_m_s,
        C / (20.0 * 1.198e9 * 0.05) / part,
    );
    // 25 carriers.
    near(
        sweep.halved.in_place_m_s,
        C / (20.0 * 1.198e9 * 0.025) / part,
    );
}

#[test]
fn sweep_longer_than_the_pulse_interval_is_refused_with_its_times() {
    let chain = |carrier_time: &str| {
        let text = example::TEXT.replace("\"6 ms\"", carrier_time);
        assert_ne!(text, example::TEXT);
        Chain::describe(&Description::new("chain.toml", text, ".")).unwrap()
    };
    // 50 carriers of 2 ms are the whole interval of 100 ms.
    let planned = plan(&pass(), None, Some(&chain("\"2 ms\""))).unwrap();
    let sweep = planned.sweep.unwrap();
    assert!((sweep.sweep.sweep_s - 0.1).abs() < 1e-12);
    let levels = planned.chain.unwrap();
    // Corners at -5 m and 4.5 m. The middle pulse is 0.05 m from broadside, at 50 m: the nearest corner is (4.5, -5), the farthest (-5, 4.5).
    let between_db = levels.receive[0].nearest_dbm - levels.receive[0].farthest_dbm;
    let expected_db = 40.0 * (5.05f64.hypot(54.5) / 4.45f64.hypot(45.0)).log10();
    assert!(
        (between_db - expected_db).abs() < 1e-9,
        "{between_db} {expected_db}"
    );
    let error = plan(&pass(), None, Some(&chain("\"3 ms\""))).unwrap_err();
    let text = error.to_string();
    for part in ["sweep of 50 carriers", "100 ms", "150 ms", "carrier_time"] {
        assert!(text.contains(part), "{text}");
    }
}
