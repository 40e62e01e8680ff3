//! Every image former on random cases: it refuses with a reason, or the measured error is within the bound and within 3 dB of the
//! prediction.
//!
//! Cases are drawn from seeds 0, 1, ... `SUBAPERTURE_CASES=100000` sets their number, `SUBAPERTURE_SEED=n` the first seed, and
//! `SUBAPERTURE_FORMERS=bp,pfa` the formers instead of [`CHECKED`]. A failing case is shrunk and printed with its seed.

use std::collections::BTreeMap;
use std::env::var;
use std::fmt::Write as _;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use crate::random_case::{Case, LIGHT_M_S, draw, draw_dark, exact_sum, history, shrink};
use num_complex::Complex64;
use rayon::prelude::*;
use subaperture::focus::bp::Backprojection;
use subaperture::focus::exact::Exact;
use subaperture::focus::ffbp::FastFactorised;
use subaperture::focus::omega_k::OmegaK;
use subaperture::focus::pfa::PolarFormat;
use subaperture::focus::rda::RangeDopplerAlgorithm;
use subaperture::focus::rdbp::{Mode, RangeDopplerBackprojection, Thesis};
use subaperture::focus::{FormError, ImageFormer, Task};
use subaperture::image::Image;
use subaperture::phase_history::{InMemory, PhaseHistory, Weights};

/// Formers checked by default.
const CHECKED: &[&str] = &[
    "exact", "bp", "rdbp", "thesis", "ffbp", "omega-k", "rda", "pfa",
];

/// Formers that must form every case with a smooth track and the scene in view.
const NEVER_REFUSE: &[&str] = &["exact", "bp", "rdbp", "ffbp"];

/// Default number of cases.
const CASES: u64 = 600;

/// Default numbers of cases with dark, tiny and off-centre grids, in the quick and in the long test.
const DARK_CASES: u64 = 500;
const LONG_CASES: u64 = 100_000;

/// Formers that plan slowly in cases whose spectrum has at least [`MAX_WAVENUMBERS`] along the track: more than half of the time of all
/// formers. They form such cases in a long test of their own. Of 1e5 cases they form one in [`ONE_IN`], and no such case.
const LONG_TO_PLAN: &[&str] = &["omega-k", "rda"];
const ONE_IN: u64 = 16;
const MAX_WAVENUMBERS: f64 = 4e3;

/// Allowed excess of a measured error over its prediction, dB. Both are RMS values over pixels and terms, of few samples in small cases.
const OPTIMISM_DB: f64 = 3.0;

/// A prediction above this states only that the image is useless, dB.
const WORTHLESS_DB: f64 = -3.0;

/// Number of failing cases that are shrunk and printed.
const SHOWN: usize = 3;

fn former(name: &str, error_db: f64) -> Box<dyn ImageFormer> {
    let rdbp = |mode| RangeDopplerBackprojection {
        mode,
        error_db,
        sub_cpi: None,
        patch_m: None,
    };
    match name {
        "exact" => Box::new(Exact),
        "bp" => Box::new(Backprojection { error_db }),
        "rdbp" => Box::new(rdbp(Mode::Precise)),
        "thesis" => Box::new(rdbp(Mode::Thesis(Thesis::default()))),
        "ffbp" => Box::new(FastFactorised { error_db }),
        "pfa" => Box::new(PolarFormat {
            error_db,
            centre_m: None,
        }),
        "rda" => Box::new(RangeDopplerAlgorithm {
            error_db,
            secondary_compression: true,
        }),
        "omega-k" => Box::new(OmegaK { error_db }),
        _ => panic!("SUBAPERTURE_FORMERS: there is no former '{name}'"),
    }
}

/// Result of a case.
enum Outcome {
    /// Refused: kind, message, and whether an image formed with `BoundPolicy::Allowed` keeps the bound.
    Refused(&'static str, String, bool),
    /// Formed: measured and predicted error, dB.
    Formed(f64, f64),
    /// The exact image is zero, so that no relative error exists.
    Zero,
}

/// A case with its recording.
struct Bench {
    case: Case,
    history: InMemory,
    weights: Weights,
    exact: Vec<Complex64>,
}

impl Bench {
    fn new(case: &Case) -> Self {
        let history = history(case);
        let [fast, slow] = case.windows;
        let weights = Weights::new(history.collection(), fast, slow);
        let exact = exact_sum(case, &history, &weights);
        Self {
            case: case.clone(),
            history,
            weights,
            exact,
        }
    }

    fn form(&self, name: &str) -> Outcome {
        let grid = self.case.plane.grid();
        let former = former(name, self.case.bound_db);
        let task = Task::new(&self.history, &grid, &self.weights);
        let formed = match former.form(&task) {
            Ok(formed) => formed,
            Err(error) => {
                let reason = match error {
                    FormError::BoundMissed { ref limit, .. } if limit.why.contains("dark") => {
                        "dark"
                    }
                    FormError::BoundMissed { .. } => "bound",
                    FormError::Unsuited(_) => "unsuited",
                    FormError::Memory { .. } => "memory",
                    _ => "other",
                };
                let needless = reason == "dark" && {
                    let formed = former.form_best(&task).ok();
                    let measured_db = formed.and_then(|formed| self.measured_db(&formed.image));
                    let kept = |(db, bound_db)| db <= bound_db;
                    measured_db.zip(former.bound_db()).is_some_and(kept)
                };
                return Outcome::Refused(reason, error.to_string(), needless);
            }
        };
        match self.measured_db(&formed.image) {
            Some(measured_db) => Outcome::Formed(measured_db, formed.predicted_error_db),
            None => Outcome::Zero,
        }
    }

    /// Error against the sum, dB, at least -300 dB. `None` if the exact image is zero.
    fn measured_db(&self, image: &Image) -> Option<f64> {
        let (mut error, mut power) = (0.0, 0.0);
        for (got, expected) in image.pixels.iter().zip(&self.exact) {
            let got = Complex64::new(f64::from(got.re), f64::from(got.im));
            error += (got - expected).norm_sqr();
            power += expected.norm_sqr();
        }
        (power > 0.0).then(|| 10.0 * (error / power).max(1e-30).log10())
    }

    /// Description of the violation of the contract by `name`, if any.
    fn broken(&self, name: &str) -> Option<String> {
        self.judge(name, &self.form(name))
    }

    fn judge(&self, name: &str, outcome: &Outcome) -> Option<String> {
        match outcome {
            Outcome::Zero => None,
            Outcome::Refused(reason, message, _) => {
                let must = self.case.sane && NEVER_REFUSE.contains(&name) && *reason != "dark";
                must.then(|| format!("refuses a sane case: {message}"))
            }
            &Outcome::Formed(measured_db, predicted_db) => {
                let bound_db = former(name, self.case.bound_db).bound_db();
                let late = bound_db.is_some_and(|bound_db| measured_db > bound_db);
                let optimistic = measured_db.is_nan()
                    || (predicted_db < WORTHLESS_DB && measured_db > predicted_db + OPTIMISM_DB);
                (late || optimistic).then(|| {
                    format!("measured {measured_db:.2} dB, predicted {predicted_db:.2} dB, bound {bound_db:?}")
                })
            }
        }
    }
}

/// Statistics of a former over all cases.
#[derive(Default)]
struct Tally {
    cases: u64,
    sane: u64,
    refused: BTreeMap<&'static str, u64>,
    sane_refused: u64,
    /// Cases refused as dark although the image keeps the bound.
    needless: u64,
    /// Largest excess of a measured error over the bound and over the prediction, dB, with its seed.
    excess_db: Option<(f64, u64)>,
    optimism_db: Option<(f64, u64)>,
    /// Predictions minus measured errors of all images, dB.
    pessimism_db: Vec<f64>,
    /// Total time, and longest time of a case with its seed.
    spent: Duration,
    slowest: (Duration, u64),
    failures: Vec<(u64, String)>,
}

impl Tally {
    fn add(&mut self, bench: &Bench, name: &str, outcome: &Outcome) {
        let case = &bench.case;
        self.cases += 1;
        self.sane += u64::from(case.sane);
        let worst = |worst: &mut Option<(f64, u64)>, db: f64| {
            if worst.is_none_or(|(most, _)| db > most) {
                *worst = Some((db, case.seed));
            }
        };
        match *outcome {
            Outcome::Zero => {}
            Outcome::Refused(reason, _, needless) => {
                *self.refused.entry(reason).or_default() += 1;
                self.needless += u64::from(needless);
                self.sane_refused += u64::from(case.sane);
            }
            Outcome::Formed(measured_db, predicted_db) => {
                self.pessimism_db.push(predicted_db - measured_db);
                if predicted_db < WORTHLESS_DB {
                    worst(&mut self.optimism_db, measured_db - predicted_db);
                }
                if let Some(bound_db) = former(name, case.bound_db).bound_db() {
                    worst(&mut self.excess_db, measured_db - bound_db);
                }
            }
        }
        if let Some(why) = bench.judge(name, outcome) {
            self.failures.push((case.seed, why));
        }
    }

    /// Minimum, deciles and maximum of predictions minus measured errors.
    fn quantiles(&self) -> String {
        let mut all = self.pessimism_db.clone();
        all.sort_by(f64::total_cmp);
        let Some(last) = all.len().checked_sub(1) else {
            return "of none".to_owned();
        };
        let at = |share: f64| format!("{:.1}", all[(share * last as f64) as usize]);
        let shares = [0.0, 0.01, 0.1, 0.5, 0.9, 0.99, 1.0];
        format!(
            "{} dB (0, 1, 10, 50, 90, 99, 100 %)",
            shares.map(at).join(", ")
        )
    }

    fn line(&self, name: &str) -> String {
        let share = |count: u64, of: u64| 100.0 * count as f64 / (of.max(1)) as f64;
        let worst = |worst: Option<(f64, u64)>| match worst {
            None => "none".to_owned(),
            Some((db, seed)) => format!("{db:+.1} dB (seed {seed})"),
        };
        let mut line = format!(
            "{name:<8} {:>7} cases, {:.2} ms each, at most {:.0} (seed {}); worst excess over the bound {}, optimism {}; predicted less measured {}; refused",
            self.cases,
            1e3 * self.spent.as_secs_f64() / self.cases.max(1) as f64,
            1e3 * self.slowest.0.as_secs_f64(),
            self.slowest.1,
            worst(self.excess_db),
            worst(self.optimism_db),
            self.quantiles(),
        );
        for (reason, count) in &self.refused {
            let _ = write!(line, " {reason} {:.1} %", share(*count, self.cases));
        }
        let _ = write!(
            line,
            " (of sane cases {:.1} %; dark but within the bound {:.1} %); broken {}",
            share(self.sane_refused, self.sane),
            share(self.needless, self.cases),
            self.failures.len()
        );
        line
    }
}

/// Whether a former plans quickly in this case.
fn is_quick(name: &str, case: &Case) -> bool {
    !LONG_TO_PLAN.contains(&name) || wavenumbers(case) < MAX_WAVENUMBERS
}

#[test]
fn formers_keep_their_bound_on_random_geometries() {
    check(draw, CASES, is_quick);
}

#[test]
fn formers_keep_their_bound_on_dark_tiny_and_off_centre_grids() {
    check(draw_dark, DARK_CASES, is_quick);
}

/// The cases that the two tests above leave out.
#[test]
#[ignore = "a minute: cargo xtask long"]
fn formers_keep_their_bound_on_spectra_of_many_wavenumbers() {
    let is_slow = |name: &str, case: &Case| !is_quick(name, case);
    check(draw, CASES, is_slow);
    check(draw_dark, DARK_CASES, is_slow);
}

#[test]
#[ignore = "minutes: cargo xtask long"]
fn formers_keep_their_bound_on_1e5_dark_tiny_and_off_centre_grids() {
    check(draw_dark, LONG_CASES, |name, case| {
        let is_drawn = case.seed.is_multiple_of(ONE_IN) || !LONG_TO_PLAN.contains(&name);
        is_drawn && is_quick(name, case)
    });
}

/// Cases that exceeded their bound, or their prediction by 3 dB and more, when only 64 evenly spread pixels were compared: a scatterer
/// outside the grid affects few dark pixels, or the error is concentrated where side lobes enter.
#[test]
fn formers_keep_bound_where_error_is_concentrated_on_few_pixels() {
    let seeds: [(&str, &[u64]); 3] = [
        // From seed 278,933 on: one point, and few pulses that see it at nearly the same fraction of a bin.
        ("bp", &[798, 4090, 9275, 278_933, 293_370]),
        (
            "rdbp",
            &[
                380, 841, 1245, 1528, 2574, 2930, 3501, 3855, 4074, 4322, 5098, 7416, 7556, 8678,
                8884, 9085, 10_692,
            ],
        ),
        // From seed 34,817 on: the flank of a main lobe lies at the grid's edge, where the error of wavefront curvature is concentrated.
        (
            "pfa",
            &[
                4030, 7871, 34_817, 51_300, 54_636, 56_058, 69_080, 72_694, 89_345,
            ],
        ),
    ];
    for (name, seeds) in seeds {
        for &seed in seeds {
            let broken = Bench::new(&draw_dark(seed)).broken(name);
            assert!(broken.is_none(), "{name}, seed {seed}: {broken:?}");
        }
    }
}

/// Approximate number of wavenumbers along the track: twice the distance along the track from pulses to pixels, times twice the Doppler
/// extent over that distance.
fn wavenumbers(case: &Case) -> f64 {
    let (track, plane) = (&case.track, &case.plane);
    let [rows, columns] = plane.counts;
    let corners = [
        (0, 0),
        (0, columns - 1),
        (rows - 1, 0),
        (rows - 1, columns - 1),
    ];
    let mut along_m = [f64::INFINITY, f64::NEG_INFINITY];
    for (row, column) in corners {
        let from_middle = plane.place_m(row, column) - track.middle_m;
        let middle_m = from_middle.dot(track.along);
        for end_m in [-track.length_m / 2.0, track.length_m / 2.0] {
            along_m = [
                along_m[0].min(middle_m - end_m),
                along_m[1].max(middle_m - end_m),
            ];
        }
    }
    let reach_m = along_m[0].abs().max(along_m[1].abs());
    let range_m = track.middle_m.distance(plane.centre_m);
    let highest_hz = case.start_hz + case.step_hz * case.num_samples as f64;
    let sines = ((along_m[1] - along_m[0]) / range_m).min(2.0);
    2.0 * reach_m * 2.0 * highest_hz / LIGHT_M_S * sines
}

/// Check every selected former on the cases that `draw` makes from seeds and that `takes` accepts.
fn check(draw: fn(u64) -> Case, cases: u64, takes: fn(&str, &Case) -> bool) {
    let number = |key: &str| var(key).ok().map(|text| text.parse::<u64>().expect(key));
    let first = number("SUBAPERTURE_SEED").unwrap_or(0);
    let count = number("SUBAPERTURE_CASES").unwrap_or(if first > 0 { 1 } else { cases });
    let chosen = var("SUBAPERTURE_FORMERS").ok();
    let names: Vec<&str> = match &chosen {
        Some(list) => list.split(',').collect(),
        None => CHECKED.to_vec(),
    };
    let tallies: Vec<Mutex<Tally>> = names.iter().map(|_| Mutex::default()).collect();
    (first..first + count).into_par_iter().for_each(|seed| {
        let case = draw(seed);
        if !names.iter().any(|name| takes(name, &case)) {
            return;
        }
        let bench = Bench::new(&case);
        for (name, tally) in names.iter().zip(&tallies) {
            if !takes(name, &case) {
                continue;
            }
            let begun = Instant::now();
            let outcome = bench.form(name);
            let spent = begun.elapsed();
            let mut tally = tally.lock().unwrap();
            tally.spent += spent;
            tally.slowest = tally.slowest.max((spent, seed));
            tally.add(&bench, name, &outcome);
        }
    });
    let tallies: Vec<Tally> = tallies
        .into_iter()
        .map(|tally| tally.into_inner().unwrap())
        .collect();
    for (name, tally) in names.iter().zip(&tallies) {
        println!("{}", tally.line(name));
    }
    let mut shown = 0;
    for (name, tally) in names.iter().zip(&tallies) {
        let mut failures = tally.failures.clone();
        failures.sort();
        for (seed, why) in failures {
            println!("{name}, seed {seed}: {why}");
            if shown < SHOWN {
                shown += 1;
                let small = shrink(&draw(seed), |case| Bench::new(case).broken(name).is_some());
                println!(
                    "{}: {small}",
                    Bench::new(&small).broken(name).unwrap_or_default()
                );
            }
        }
    }
    let broken: usize = tallies.iter().map(|tally| tally.failures.len()).sum();
    assert!(
        broken == 0,
        "{broken} cases: run one again with SUBAPERTURE_SEED and SUBAPERTURE_FORMERS"
    );
}
