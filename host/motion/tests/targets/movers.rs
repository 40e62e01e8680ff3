//! Tracks among moving targets, from echoes: 7.5 m of a walk that is recorded as a straight line, in 300 pulses at 30 dB.

use glam::DVec2;
use subaperture_model::monitor::Silent;
use subaperture_motion::movers::Doubt;
use subaperture_motion::targets::{Fault, Recovered, Settings, TargetsError, recover};

use crate::scene::{PERIOD_S, Radar, Reflector, Truth, l_band, moving, reflector};
use crate::tracks::{off, straight, walk, walked};

const PULSES: usize = 300;

/// Four standing reflectors; two of them cross in range.
fn standing() -> Vec<Reflector> {
    vec![
        reflector(-11.0, 8.0, 1.0),
        reflector(-6.5, 13.2, 1.3),
        reflector(-2.8, 19.1, 1.6),
        reflector(2.4, 16.3, 1.6),
    ]
}

fn of(standing: &[Reflector], moving: &[Reflector]) -> Vec<Reflector> {
    [standing, moving].concat()
}

/// Positions in metres and velocities in m/s of two movers.
const MOVER: ([f64; 2], [f64; 2]) = ([-5.0, 10.0], [0.3, 0.4]);
const OTHER: ([f64; 2], [f64; 2]) = ([3.0, 22.0], [-0.5, -0.3]);

fn unit_mover((at_m, velocity_m_s): ([f64; 2], [f64; 2])) -> Reflector {
    moving(at_m, velocity_m_s, 1.2)
}

/// Radar, its true poses, and the estimated track.
struct Walk {
    radar: Radar,
    truth: Vec<Truth>,
    found: Result<Recovered, TargetsError>,
}

impl Walk {
    fn new(receivers: usize, reflectors: &[Reflector]) -> Self {
        let mut radar = l_band();
        for r in 2..receivers {
            let x = radar.receivers_m[1].x + 0.107 * (r - 1) as f64;
            radar.receivers_m.push(DVec2::new(x, 0.0));
        }
        let (truth, recorded) = (walk(PULSES), straight(PULSES));
        let recording = walked(&radar, [&truth, &recorded], reflectors);
        let found = recover(recording.channels(), &Settings::default(), &Silent);
        Self {
            found,
            radar,
            truth,
        }
    }

    #[track_caller]
    fn found(&self) -> &Recovered {
        self.found.as_ref().unwrap()
    }

    /// Rotation from the estimated track, which is aligned with the recorded one, to the true one, radians.
    fn turn_rad(&self) -> f64 {
        let moments = &self.found().moments;
        let got = moments.iter().map(|m| m.position_m.truncate());
        let wanted = moments.iter().map(|m| self.truth[m.pulse].at_m);
        let count = moments.len() as f64;
        let a = got.clone().sum::<DVec2>() / count;
        let b = wanted.clone().sum::<DVec2>() / count;
        let both = got.zip(wanted).map(|(got, wanted)| (got - a, wanted - b));
        let (dot, cross) = both.fold((0.0, 0.0), |(dot, cross), (got, wanted)| {
            (dot + got.dot(wanted), cross + got.perp_dot(wanted))
        });
        cross.atan2(dot)
    }

    /// Assert position errors below 2 mm (a fiftieth of a wavelength of path) and velocity errors below 0.02 m/s, after alignment with the true track.
    #[track_caller]
    fn check(&self, velocities_m_s: &[[f64; 2]]) {
        let found = self.found();
        let [place_m, _] = off(found, &self.radar, &self.truth);
        let [sum, expected] = found.chi_square;
        println!(
            "{:.2} mm, misfit {:.2}, {:?}",
            1e3 * place_m,
            sum / expected,
            found.movers
        );
        found.trusted().unwrap();
        assert!(place_m < 2e-3, "{place_m}");
        assert_eq!(found.movers.len(), velocities_m_s.len());
        let turn = DVec2::from_angle(self.turn_rad());
        for wanted in velocities_m_s {
            let wanted = DVec2::from_array(*wanted);
            let off = |mover: &subaperture_motion::targets::Mover| {
                turn.rotate(mover.velocity_m_s.truncate()).distance(wanted)
            };
            let nearest = found.movers.iter().map(off).fold(f64::INFINITY, f64::min);
            assert!(nearest < 0.02, "{wanted}: {nearest} m/s off");
        }
    }

    fn doubts(&self) -> Vec<&Fault> {
        self.found().doubts().collect()
    }
}

#[test]
fn mover_does_not_bend_track_and_its_velocity_is_estimated() {
    for receivers in [2, 3, 4] {
        let walk = Walk::new(receivers, &of(&standing(), &[unit_mover(MOVER)]));
        walk.check(&[MOVER.1]);
        assert_eq!(walk.doubts(), Vec::<&Fault>::new());
        assert!(walk.found().movers[0].steady);
    }
}

#[test]
fn standing_reflectors_are_not_reported_as_movers() {
    // Two of them cross in range and are one peak while they do.
    Walk::new(2, &standing()).check(&[]);
    let walk = Walk::new(2, &of(&standing(), &[reflector(-5.0, 10.0, 1.2)]));
    walk.check(&[]);
    assert_eq!(walk.found().places.len(), 5);
    assert_eq!(walk.doubts(), Vec::<&Fault>::new());
}

#[test]
fn bright_fast_slow_and_approaching_movers_are_estimated() {
    let bright = moving(MOVER.0, MOVER.1, 6.0);
    Walk::new(2, &of(&standing(), &[bright])).check(&[MOVER.1]);
    let fast = ([-5.0, 10.0], [2.0, 3.0]);
    Walk::new(2, &of(&standing(), &[unit_mover(fast)])).check(&[fast.1]);
    let nearer = ([-9.0, 16.0], [0.0, -1.5]);
    Walk::new(2, &of(&standing(), &[unit_mover(nearer)])).check(&[nearer.1]);
    let slow = ([-5.0, 10.0], [0.03, 0.02]);
    Walk::new(2, &of(&standing(), &[unit_mover(slow)])).check(&[slow.1]);
}

#[test]
fn two_movers_are_estimated_even_if_they_cross() {
    let two = [unit_mover(MOVER), unit_mover(OTHER)];
    Walk::new(2, &of(&standing(), &two)).check(&[MOVER.1, OTHER.1]);
    // Three standing targets and two movers.
    Walk::new(2, &of(&standing()[..3], &two)).check(&[MOVER.1, OTHER.1]);
    let crossing = [([-5.0, 10.0], [0.3, 1.0]), ([-4.0, 14.0], [-0.2, -1.0])];
    let walk = Walk::new(2, &of(&standing(), &crossing.map(unit_mover)));
    walk.check(&crossing.map(|(_, velocity)| velocity));
}

#[test]
fn three_movers_are_reported_among_four_reflectors() {
    let third = ([-8.0, 21.5], [0.4, -0.3]);
    let all = [MOVER, OTHER, third];
    Walk::new(2, &of(&standing(), &all.map(unit_mover))).check(&all.map(|(_, velocity)| velocity));
}

/// The mover starts in the range cell (0.25 m) of the first reflector, 8.1 m from the radar. It leaves at once, or stays within one to four cells for most of the time. Their echoes then distort each other, and
/// no constant velocity fits: the error of the mean velocity is within three of its standard deviations.
#[test]
fn mover_in_range_cell_of_reflector_does_not_bend_track() {
    let radar_m = walk(PULSES)[0].at_m;
    for velocity_m_s in [[0.5, 2.0], [0.5, 0.9]] {
        let together = ([-8.0, 7.9], velocity_m_s);
        let [a, b] =
            [standing()[0].at_m, DVec2::from_array(together.0)].map(|at| at.distance(radar_m));
        assert!((a - b).abs() < 0.15, "{a} {b}");
        let walk = Walk::new(2, &of(&standing(), &[unit_mover(together)]));
        let found = walk.found();
        found.trusted().unwrap();
        let [place_m, _] = off(found, &walk.radar, &walk.truth);
        let [mover] = &found.movers[..] else {
            panic!("{:?}", found.movers);
        };
        let turn = DVec2::from_angle(walk.turn_rad());
        let got = turn.rotate(mover.velocity_m_s.truncate());
        let off_m_s = got.distance(DVec2::from_array(velocity_m_s));
        println!("{:.2} mm, {off_m_s:.3} m/s off, {mover:?}", 1e3 * place_m);
        assert!(place_m < 2e-3, "{place_m}");
        let allowed_m_s = if mover.steady {
            0.02
        } else {
            3.0 * mover.sigma_m_s
        };
        assert!(off_m_s < allowed_m_s, "{off_m_s} {mover:?}");
    }
}

/// From 0.2 to 1.4 m/s in 3 s: no constant velocity fits, so that the mean velocity is reported.
#[test]
fn accelerating_mover_is_omitted_and_has_mean_velocity() {
    let mut mover = moving([-5.0, 10.0], [0.0, 0.2], 1.2);
    mover.bend_m = DVec2::new(0.0, 0.4 * PERIOD_S * PERIOD_S);
    let walk = Walk::new(2, &of(&standing(), &[mover]));
    let [place_m, _] = off(walk.found(), &walk.radar, &walk.truth);
    let movers = &walk.found().movers;
    println!("{:.2} mm, {movers:?}", 1e3 * place_m);
    walk.found().trusted().unwrap();
    assert!(place_m < 2e-3, "{place_m}");
    assert!(movers.len() == 1 && !movers[0].steady, "{movers:?}");
    let turn = DVec2::from_angle(walk.turn_rad());
    let velocity = turn.rotate(movers[0].velocity_m_s.truncate());
    let mean_m_s = DVec2::new(0.0, 0.2 + 0.4 * 1.5);
    assert!(velocity.distance(mean_m_s) < 0.1, "{velocity}");
}

#[test]
fn starting_mover_is_omitted_and_has_mean_velocity() {
    let mut half = unit_mover(MOVER);
    half.goes = [150, usize::MAX];
    let walk = Walk::new(2, &of(&standing(), &[half]));
    let [place_m, _] = off(walk.found(), &walk.radar, &walk.truth);
    let movers = &walk.found().movers;
    println!("{:.2} mm, {movers:?}", 1e3 * place_m);
    assert!(place_m < 2e-3, "{place_m}");
    assert!(movers.len() == 1 && !movers[0].steady, "{movers:?}");
    // The mean over the sightings, between 0 and 0.5 m/s.
    let speed = movers[0].velocity_m_s.length();
    assert!((0.1..0.5).contains(&speed), "{speed}");
}

#[test]
fn track_of_two_standing_targets_among_movers_is_in_doubt() {
    for movers in [
        vec![unit_mover(MOVER)],
        vec![unit_mover(MOVER), unit_mover(OTHER)],
    ] {
        let walk = Walk::new(2, &of(&standing()[..2], &movers));
        walk.check(&[MOVER.1, OTHER.1][..movers.len()]);
        let left_out = movers.len();
        assert_eq!(walk.doubts(), [&Fault::TwoTargets { left_out }]);
    }
}

#[test]
fn fewer_than_two_standing_targets_give_no_track() {
    let third = ([-8.0, 15.0], [0.4, -0.3]);
    let cases = [
        of(&standing()[..1], &[unit_mover(MOVER), unit_mover(OTHER)]),
        of(
            &[],
            &[unit_mover(MOVER), unit_mover(OTHER), unit_mover(third)],
        ),
    ];
    for reflectors in cases {
        let error = Walk::new(2, &reflectors).found.unwrap_err();
        let disagree = matches!(error, TargetsError::Movers(Doubt::Disagree { .. }));
        assert!(disagree, "{error}");
    }
    // With two targets it is ambiguous which one moves; the residuals show that not both stand still.
    let cases = [
        of(&standing()[..1], &[unit_mover(MOVER)]),
        of(&[], &[unit_mover(MOVER), unit_mover(OTHER)]),
    ];
    for reflectors in cases {
        let walk = Walk::new(2, &reflectors);
        let error = walk.found().trusted().unwrap_err();
        assert!(matches!(error, TargetsError::Diverged { .. }), "{error}");
    }
    // Two standing targets give a track, which no third target confirms.
    let walk = Walk::new(2, &standing()[..2]);
    walk.check(&[]);
    assert!(walk.found().seen.faults.contains(&Fault::Unconfirmed));
}
