//! Radial velocities beyond the interval without ambiguity.

use subaperture_gmti::tracker::{Settings, Status, Tracker};

use crate::world::{Random, closing_m_s, displaced, folded, quadratic, scan, sensor};

const AMBIGUITY_M_S: f64 = 7.5;

/// Track of a target that accelerates from 2 to 14 m/s towards the radar. Returns the number of tracks, and the NEES after the last scan with the last mean.
fn follow(ambiguity_m_s: Option<f64>, seed: u64) -> (usize, f64, [f64; 4]) {
    let mut random = Random::new(seed);
    let mut tracker = Tracker::new(Settings::default()).unwrap();
    let mut truth = [0.0, 300.0, 5.0, -2.0];
    for i in 0..40 {
        let time_s = f64::from(i);
        let from = sensor(time_s);
        if i > 0 {
            let change = if (10..34).contains(&i) { -0.5 } else { 0.0 };
            truth[0] += truth[2];
            truth[1] += truth[3] + 0.5 * change;
            truth[3] += change;
        }
        let mut detection = folded(&random.detection(&truth, from), AMBIGUITY_M_S, from);
        detection.velocity_ambiguity_m_s = ambiguity_m_s;
        tracker.scan(&scan(time_s, vec![detection])).unwrap();
    }
    let track = &tracker.tracks()[0];
    let last = track.history.last().unwrap();
    let error = std::array::from_fn(|k| last.mean[k] - truth[k]);
    let nees = quadratic(last.covariance, error);
    let count = tracker.tracks().len();
    if count == 1 {
        assert!(matches!(track.status, Status::Confirmed { .. }));
    }
    (count, nees, last.mean)
}

#[test]
fn track_follows_velocities_through_two_folds() {
    for seed in 0..20 {
        let (tracks, nees, mean) = follow(Some(AMBIGUITY_M_S), seed);
        assert_eq!(tracks, 1, "seed {seed}");
        // Chi-square of 4 degrees of freedom exceeds 23.5 with a probability of 1e-4.
        assert!(nees < 23.5, "seed {seed}: {nees}");
        assert!((mean[3] + 14.0).abs() < 2.0, "seed {seed}: {mean:?}");
    }
}

#[test]
fn track_without_ambiguity_is_lost_at_the_first_fold() {
    let (tracks, nees, _) = follow(None, 1);
    assert!(tracks > 1 && nees > 100.0, "{tracks} {nees}");
}

/// Targets of 9 to 15 m/s along the line of sight, one fold to two, start at a wrong fold. Their tracks are continuous, with velocities and
/// positions of that fold.
#[test]
fn fast_targets_have_continuous_tracks_at_a_fold() {
    for seed in 0..100 {
        let mut random = Random::new(1000 + seed);
        // 2000 detections: all are in the gate.
        let settings = Settings {
            gate_probability: 1.0 - 1e-9,
            ..Settings::default()
        };
        let mut tracker = Tracker::new(settings).unwrap();
        let speed = random.uniform(9.0, 15.0) * if seed % 2 == 0 { 1.0 } else { -1.0 };
        let mut truth = [
            random.uniform(-300.0, 300.0),
            random.uniform(-100.0, 100.0),
            8.0 * random.normal(),
            speed,
        ];
        let mut change_m_s = 0.0;
        for i in 0..20 {
            let time_s = f64::from(20 + i);
            let from = sensor(time_s);
            random.moved(&mut truth, 1.0, 0.3);
            let detection = folded(&random.detection(&truth, from), AMBIGUITY_M_S, from);
            if i == 0 {
                let folds =
                    (detection.radial_velocity_m_s - closing_m_s(&truth, from)) / AMBIGUITY_M_S;
                change_m_s = folds.round() * AMBIGUITY_M_S;
                assert!(change_m_s != 0.0);
            }
            tracker.scan(&scan(time_s, vec![detection])).unwrap();
            let [track] = tracker.tracks() else {
                panic!("seed {seed}: {:?}", tracker.tracks());
            };
            let last = track.history.last().unwrap();
            let place = displaced([truth[0], truth[1]], from, change_m_s);
            let error = [last.mean[0] - place[0], last.mean[1] - place[1]];
            let [[xx, xy], [_, yy]] =
                [0, 1].map(|k| [last.covariance[k][0], last.covariance[k][1]]);
            // Chi-square of 2 degrees of freedom exceeds 27.6 with a probability of 1e-6.
            let distance = quadratic([[xx, xy], [xy, yy]], error);
            assert!(distance < 27.6, "seed {seed}, scan {i}: {distance}");
            let closing = closing_m_s(&last.mean, from) - closing_m_s(&truth, from);
            assert!((closing - change_m_s).abs() < 1.5, "seed {seed}: {closing}");
        }
    }
}
