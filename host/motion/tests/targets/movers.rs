//! Tracks among targets that move, from echoes: 7.5 m of a walk that is recorded as a straight line, in 300 pulses at 30 dB.

use glam::DVec2;
use subaperture_model::monitor::Silent;
use subaperture_motion::movers::Doubt;
use subaperture_motion::targets::{Fault, Recovered, Settings, TargetsError, recover};

use crate::scene::{PERIOD_S, Radar, Reflector, Truth, l_band, moving, reflector};
use crate::tracks::{off, straight, walk, walked};

const PULSES: usize = 300;

/// Four that stand; two of them cross in range.
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

/// At 0.5 m/s, of a power among that of the others, and another.
const MOVER: ([f64; 2], [f64; 2]) = ([-5.0, 10.0], [0.3, 0.4]);
const OTHER: ([f64; 2], [f64; 2]) = ([3.0, 22.0], [-0.5, -0.3]);

fn going((at_m, velocity_m_s): ([f64; 2], [f64; 2])) -> Reflector {
    moving(at_m, velocity_m_s, 1.2)
}

/// A radar of so many receivers, a way, and what was found on it.
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
        let (truth, told) = (walk(PULSES), straight(PULSES));
        let recording = walked(&radar, [&truth, &told], reflectors);
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

    /// From the track found, which lies upon the recorded one, to the true one, radians.
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

    /// Holds the shape of the track to 2 mm, a fiftieth of a wavelength of path, and each velocity to 0.02 m/s after the track's turn upon the true one.
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
fn a_mover_leaves_the_track_as_good_and_its_velocity_is_found() {
    for receivers in [2, 3, 4] {
        let walk = Walk::new(receivers, &of(&standing(), &[going(MOVER)]));
        walk.check(&[MOVER.1]);
        assert_eq!(walk.doubts(), Vec::<&Fault>::new());
        assert!(walk.found().movers[0].steady);
    }
}

#[test]
fn reflectors_that_stand_are_no_movers() {
    // Two of them cross in range, and are one peak then.
    Walk::new(2, &standing()).check(&[]);
    let walk = Walk::new(2, &of(&standing(), &[reflector(-5.0, 10.0, 1.2)]));
    walk.check(&[]);
    assert_eq!(walk.found().places.len(), 5);
    assert_eq!(walk.doubts(), Vec::<&Fault>::new());
}

#[test]
fn a_mover_may_be_the_brightest_the_fastest_or_come_nearer() {
    let bright = moving(MOVER.0, MOVER.1, 6.0);
    Walk::new(2, &of(&standing(), &[bright])).check(&[MOVER.1]);
    let fast = ([-5.0, 10.0], [2.0, 3.0]);
    Walk::new(2, &of(&standing(), &[going(fast)])).check(&[fast.1]);
    let nearer = ([-9.0, 16.0], [0.0, -1.5]);
    Walk::new(2, &of(&standing(), &[going(nearer)])).check(&[nearer.1]);
    let slow = ([-5.0, 10.0], [0.03, 0.02]);
    Walk::new(2, &of(&standing(), &[going(slow)])).check(&[slow.1]);
}

#[test]
fn several_movers_are_found_and_may_cross() {
    let two = [going(MOVER), going(OTHER)];
    Walk::new(2, &of(&standing(), &two)).check(&[MOVER.1, OTHER.1]);
    // Three stand, and two move apart from each other.
    Walk::new(2, &of(&standing()[..3], &two)).check(&[MOVER.1, OTHER.1]);
    let crossing = [([-5.0, 10.0], [0.3, 1.0]), ([-4.0, 14.0], [-0.2, -1.0])];
    let walk = Walk::new(2, &of(&standing(), &crossing.map(going)));
    walk.check(&crossing.map(|(_, velocity)| velocity));
}

#[test]
fn three_movers_are_reported_among_four_reflectors() {
    let third = ([-8.0, 21.5], [0.4, -0.3]);
    let all = [MOVER, OTHER, third];
    Walk::new(2, &of(&standing(), &all.map(going))).check(&all.map(|(_, velocity)| velocity));
}

/// The mover starts in a cell of 0.25 m with the first reflector, 8.1 m from the radar: it leaves at once, or stays within a cell or four for most of the time. Echoes of both bend each other's meanwhile, and
/// no steady velocity fits them: what is reported is within three of the standard deviations reported.
#[test]
fn a_mover_in_the_range_cell_of_a_reflector_leaves_the_track_as_good() {
    let radar_m = walk(PULSES)[0].at_m;
    for velocity_m_s in [[0.5, 2.0], [0.5, 0.9]] {
        let together = ([-8.0, 7.9], velocity_m_s);
        let [a, b] =
            [standing()[0].at_m, DVec2::from_array(together.0)].map(|at| at.distance(radar_m));
        assert!((a - b).abs() < 0.15, "{a} {b}");
        let walk = Walk::new(2, &of(&standing(), &[going(together)]));
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

/// From 0.2 to 1.4 m/s in 3 s: no velocity fits, so that the mean is reported, to its standard deviation.
#[test]
fn an_accelerating_mover_is_left_out_and_has_a_mean_velocity() {
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
fn a_mover_that_stands_at_first_is_left_out_and_has_a_mean_velocity() {
    let mut half = going(MOVER);
    half.goes = [150, usize::MAX];
    let walk = Walk::new(2, &of(&standing(), &[half]));
    let [place_m, _] = off(walk.found(), &walk.radar, &walk.truth);
    let movers = &walk.found().movers;
    println!("{:.2} mm, {movers:?}", 1e3 * place_m);
    assert!(place_m < 2e-3, "{place_m}");
    assert!(movers.len() == 1 && !movers[0].steady, "{movers:?}");
    // Of a mean between nothing and 0.5 m/s.
    let speed = movers[0].velocity_m_s.length();
    assert!((0.1..0.5).contains(&speed), "{speed}");
}

#[test]
fn two_that_stand_among_movers_are_a_track_in_doubt() {
    for movers in [vec![going(MOVER)], vec![going(MOVER), going(OTHER)]] {
        let walk = Walk::new(2, &of(&standing()[..2], &movers));
        walk.check(&[MOVER.1, OTHER.1][..movers.len()]);
        let left_out = movers.len();
        assert_eq!(walk.doubts(), [&Fault::TwoTargets { left_out }]);
    }
}

#[test]
fn where_nothing_or_one_target_stands_there_is_no_track() {
    let third = ([-8.0, 15.0], [0.4, -0.3]);
    let cases = [
        of(&standing()[..1], &[going(MOVER), going(OTHER)]),
        of(&[], &[going(MOVER), going(OTHER), going(third)]),
    ];
    for reflectors in cases {
        let error = Walk::new(2, &reflectors).found.unwrap_err();
        let disagree = matches!(error, TargetsError::Movers(Doubt::Disagree { .. }));
        assert!(disagree, "{error}");
    }
    // Of two targets nobody knows which moves; that they do not stand both is seen.
    let cases = [
        of(&standing()[..1], &[going(MOVER)]),
        of(&[], &[going(MOVER), going(OTHER)]),
    ];
    for reflectors in cases {
        let walk = Walk::new(2, &reflectors);
        let error = walk.found().trusted().unwrap_err();
        assert!(matches!(error, TargetsError::Diverged { .. }), "{error}");
    }
    // Two that do are a track, which nothing confirms.
    let walk = Walk::new(2, &standing()[..2]);
    walk.check(&[]);
    assert!(walk.found().seen.faults.contains(&Fault::Unconfirmed));
}
