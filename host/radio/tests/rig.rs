//! Shared set-up with two receive antennas and a leakage reference, and its range profiles.

use glam::DVec3;
use subaperture_describe::Description;
use subaperture_radio::plan::Plan;
use subaperture_radio::profile::{
    Calibration, Options, Profile, ProfileError, Ranging, Reference, Steps,
};
use subaperture_radio::sigmf::Recording;
use subaperture_radio::simulated::{Analogue, SimulatedRadio, Wiring};
use subaperture_radio::{Antennas, Transceiver};
use subaperture_simulate::Experiment;
use subaperture_simulate::scenario::Scenario;
use tempfile::TempDir;

use crate::profile::WINDOW;
use crate::scene::captured;

const LIGHT_M_S: f64 = 299_792_458.0;

/// Receive antennas half a wavelength at 1.4 GHz apart, 20 cm from the transmit antenna.
pub(crate) const ANTENNAS: Antennas = Antennas {
    transmitter_m: DVec3::ZERO,
    receivers_m: [DVec3::new(0.2, 0.0, 0.0), DVec3::new(0.307, 0.0, 0.0)],
};

/// Point targets with cross sections in m²; 1 m² gives an amplitude of 1 at the initial distance from the body to (0,
/// 6). The receiver is a B210's with noise of `noise_db` per sample.
pub(crate) fn experiment(points: &[(DVec3, f64)], noise_db: f64, seed: u64) -> Experiment {
    let mut text = format!(
        r#"
        seed = {seed}
        [radar]
        kind = "ideal"
        pulses = 1
        pri = "1 s"
        centre = "1.4 GHz"
        bandwidth = "600 MHz"
        samples = 75
        spreading = true
        [[radar.transmitter]]
        offset = "0, 0, 0 m"
        [[radar.receiver]]
        offset = "0.2, 0, 0 m"
        [[radar.receiver]]
        offset = "0.307, 0, 0 m"
        [radar.noise]
        power = "{noise_db} dB"
        [radar.clock]
        offset = "2 ppm"
        [radar.converter]
        bits = 12
        full_scale = "32 dB"
        [platform]
        kind = "fixed"
        position = "0, 0, 0 m"
        [scene]
        reference = "0, 6, 0 m"
        "#
    );
    for (point, square_m) in points {
        text += &format!(
            "[[scene.point]]\nposition = \"{}, {}, {} m\"\ncross_section = \"{square_m} m^2\"\n",
            point.x, point.y, point.z
        );
    }
    Scenario::new("rig.toml", text, ".").experiment().unwrap()
}

/// Leakage amplitude of 20 (26 dB above the echo of 1 m² at 6 m), with cables of 20 ns. The second receiver's cable is
/// longer by `longer_s`, and its gain and phase differ.
pub(crate) fn radio(experiment: &Experiment, longer_s: f64) -> SimulatedRadio<'_> {
    let direct_s = [0, 1].map(|i| ANTENNAS.direct_s(i));
    let mut wiring = Wiring::leakage(direct_s, [20e-9, 20e-9 + longer_s], 20.0);
    if longer_s > 0.0 {
        wiring.receive[1].response = num_complex::Complex64::from_polar(0.8, 2.0);
    }
    SimulatedRadio::new(experiment, wiring, Analogue::b210()).unwrap()
}

/// 1.1 to 1.7 GHz: 25 cm resolution; unambiguous range 18.7 m with 75 steps, 37.5 m with 150.
pub(crate) fn plan(steps: usize, more: &str) -> Plan {
    let text = format!(
        r#"
        [plan]
        start = "1.1 GHz"
        stop = "1.7 GHz"
        steps = {steps}
        reference = "leakage"
        steady = 0.2
        lead = "0.1 ms"
        {more}
        [antennas]
        transmitter = "0, 0, 0 m"
        receiver_0 = "0.2, 0, 0 m"
        receiver_1 = "0.307, 0, 0 m"
        "#
    );
    Plan::describe(&Description::new("plan.toml", &text, ".")).unwrap()
}

/// Half of the path from the transmitter to a point and to a receiver.
fn half_path_m(place_m: DVec3, receiver: usize) -> f64 {
    0.5 * (place_m.distance(ANTENNAS.transmitter_m)
        + place_m.distance(ANTENNAS.receivers_m[receiver]))
}

fn recorded(folder: &TempDir, name: &str, points: &[DVec3], seed: u64, longer_s: f64) -> Recording {
    let path = folder.path().join(name);
    let points: Vec<(DVec3, f64)> = points.iter().map(|place| (*place, 1.0)).collect();
    let experiment = experiment(&points, -26.0, seed);
    let mut radio = radio(&experiment, longer_s);
    let summary = captured(
        &mut radio as &mut dyn Transceiver,
        &plan(75, "dwell = \"0.25 ms\""),
        &path,
    );
    assert_eq!(summary.steps, 75);
    Recording::open(&path).unwrap()
}

/// One receiver has a cable 3 ns longer than the other (45 cm of range), and another gain and phase. Without
/// calibration the leakage cannot be the reference. With calibration, range zero of both receivers is at the antennas'
/// phase centres within 2 cm, and the phase difference of an echo is that of its paths: the angle of arrival.
///
/// Error budget: noise of -26 dB per sample and leakage 26 dB above an echo leave about -45 dB per carrier and -60 dB
/// after 75 carriers. Sidelobes of this window are below -50 dB and shift peaks by less than 1.9 times that of 0.25 m,
/// 2 mm. A phase of 3 degrees between channels corresponds to -26 dB.
#[test]
fn calibrated_profiles_of_two_receivers_have_correct_range_zero_and_phase() {
    let folder = TempDir::new().unwrap();
    let longer_s = 3e-9;
    let mark_m = DVec3::new(0.0, 4.0, 0.0);
    let mut sky = recorded(&folder, "sky", &[], 31, longer_s);
    let mut mark = recorded(&folder, "mark", &[mark_m], 32, longer_s);
    let [sky_steps, mark_steps] =
        [&mut sky, &mut mark].map(|recording| Steps::read(recording, 0).unwrap());
    let calibration = Calibration::measure_leakage(
        "2026-11-23",
        sky.setup(),
        &sky_steps,
        &mark_steps,
        &[mark_m],
        0.6,
    )
    .unwrap();
    let path = folder.path().join("calibration.json");
    calibration.write(&path).unwrap();
    assert_eq!(Calibration::read(&path).unwrap(), calibration);

    let places = [DVec3::new(-1.5, 3.0, 0.0), DVec3::new(2.0, 6.0, 0.0)];
    let mut scene = recorded(&folder, "scene", &places, 33, longer_s);
    let setup = scene.setup().clone();
    let mut by = |calibration: Option<Calibration>| {
        let options = Options {
            calibration,
            ..Options::default()
        };
        Ranging::new(&setup, options)?.read(&mut scene, 0)
    };
    let error = by(None).unwrap_err();
    assert!(matches!(error, ProfileError::Leakage(_)), "{error}");
    let sweeps = by(Some(calibration.clone())).unwrap();
    assert_eq!(sweeps.len(), 2);
    let profiles: Vec<Profile> = sweeps
        .iter()
        .map(|sweep| sweep.profile(WINDOW, 24, 9.0).unwrap())
        .collect();
    for (receiver, profile) in profiles.iter().enumerate() {
        let peaks = profile.peaks(0.1);
        assert_eq!(peaks.len(), 2, "{peaks:?}");
        for (peak, place) in peaks.iter().zip(places) {
            let off_m = peak.range_m - half_path_m(place, receiver);
            let mark = 16.0 / place.length_squared();
            println!("{receiver}: {off_m:.4} m, {:.4}", peak.magnitude / mark);
            assert!(off_m.abs() < 0.02, "{receiver}: {off_m}");
            assert!((peak.magnitude / mark - 1.0).abs() < 0.05);
        }
    }
    // Phase at 1.4 GHz, in turns.
    let at = |receiver: usize, place: DVec3| {
        let half_m = half_path_m(place, receiver);
        let index = (half_m / profiles[receiver].spacing_m).round() as usize;
        let off_m = 2.0 * (index as f64 * profiles[receiver].spacing_m - half_m);
        // The middle carrier's phase depends on the position at which the profile is sampled.
        profiles[receiver].values[index]
            * num_complex::Complex64::cis(-std::f64::consts::TAU * 1.396125e9 * off_m / LIGHT_M_S)
    };
    for place in places {
        let turn = at(1, place) * at(0, place).conj();
        println!("{:.2} deg between receivers", turn.arg().to_degrees());
        assert!(turn.arg().abs().to_degrees() < 3.0);
    }

    // The antennas have moved since the calibration.
    let mut moved = setup.clone();
    if let Some(antennas) = &mut moved.antennas {
        antennas.receivers_m[1].x += 0.01;
    }
    let error = calibration.check(&moved).unwrap_err().to_string();
    assert!(
        error.contains("0.0100 m away from its present position"),
        "{error}"
    );
    moved.reference = Reference::Loopback;
    let error = calibration.check(&moved).unwrap_err().to_string();
    assert!(error.contains("a leakage reference"), "{error}");
}

#[test]
fn leakage_reference_requires_antenna_positions() {
    let text =
        "[plan]\nstart = \"1.1 GHz\"\nstop = \"1.7 GHz\"\nsteps = 75\nreference = \"leakage\"\n";
    let plan = |more: &str| {
        Plan::describe(&Description::new("plan.toml", format!("{text}{more}"), "."))
            .map_err(|error| error.to_string())
    };
    let ranges = subaperture_radio::Ranges::b210();
    let refused = plan("").unwrap().check(&ranges).unwrap_err().to_string();
    assert!(refused.contains("add [antennas]"), "{refused}");
    let one = "[antennas]\ntransmitter = \"0, 0, 0 m\"\nreceiver_1 = \"0.3, 0, 0 m\"\n";
    assert!(plan(one).unwrap_err().contains("receiver 0's antenna"));
    let both = format!("{one}receiver_0 = \"0, 0, 0 m\"\n");
    let refused = plan(&both).unwrap().check(&ranges).unwrap_err().to_string();
    assert!(
        refused.contains("coincides with the transmit antenna"),
        "{refused}"
    );
}
