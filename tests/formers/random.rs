//! Every image former on random cases: it refuses and says why, or the measured error is within the bound
//! and within 3 dB of the prediction.
//!
//! Cases are those of seeds 0, 1, ..: `SUBAPERTURE_CASES=100000` takes more of them, `SUBAPERTURE_SEED=n`
//! starts at another, `SUBAPERTURE_FORMERS=bp,pfa` takes other formers than [`CHECKED`]. A failing case is shrunk and printed with its
//! seed.

use std::collections::BTreeMap;
use std::env::var;
use std::fmt::Write as _;
use std::sync::Mutex;

use crate::random_case::{Case, draw, exact_sum, history, shrink};
use num_complex::Complex64;
use rayon::prelude::*;
use subaperture::focus::bp::Backprojection;
use subaperture::focus::exact::Exact;
use subaperture::focus::ffbp::FastFactorised;
use subaperture::focus::omega_k::OmegaK;
use subaperture::focus::pfa::PolarFormat;
use subaperture::focus::rda::RangeDopplerAlgorithm;
use subaperture::focus::rdbp::{Mode, RangeDoppler, Thesis};
use subaperture::focus::{FormError, ImageFormer, Task};
use subaperture::monitor::Silent;
use subaperture::phase_history::{InMemory, PhaseHistory, Weights};

/// The formers that are held to the contract here.
const CHECKED: &[&str] = &[
    "exact", "bp", "rdbp", "thesis", "ffbp", "omega-k", "rda", "pfa",
];

/// Formers that must take every case of a smooth track with the scene in view.
const NEVER_REFUSE: &[&str] = &["exact", "bp", "rdbp", "ffbp"];

/// Cases where nothing else is asked for.
const CASES: u64 = 600;

/// How far above its prediction a measured error may lie, dB: both are root means over pixels and terms, of
/// samples that are few in small cases.
const OPTIMISM_DB: f64 = 3.0;

/// A prediction that says that an image is worth nothing says no more.
const WORTHLESS_DB: f64 = -3.0;

/// Failing cases that are shrunk and printed.
const SHOWN: usize = 3;

fn former(name: &str, error_db: f64) -> Box<dyn ImageFormer> {
    let rdbp = |mode| RangeDoppler {
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

/// What became of a case.
enum Outcome {
    /// Refused, with a reason.
    Refused(&'static str, String),
    /// Formed: measured and predicted error, dB.
    Formed(f64, f64),
    /// Nothing to measure against: the exact image is zero.
    Zero,
}

/// A case's recording, ready to be formed.
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
        let formed = former(name, self.case.bound_db).form(&Task {
            history: &self.history,
            grid: &grid,
            weights: &self.weights,
            memory_bytes: 1 << 30,
            monitor: &Silent,
            means: Default::default(),
        });
        let formed = match formed {
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
                return Outcome::Refused(reason, error.to_string());
            }
        };
        let (mut error, mut power) = (0.0, 0.0);
        for (got, expected) in formed.image.pixels.iter().zip(&self.exact) {
            let got = Complex64::new(f64::from(got.re), f64::from(got.im));
            error += (got - expected).norm_sqr();
            power += expected.norm_sqr();
        }
        if power == 0.0 {
            return Outcome::Zero;
        }
        // Nothing at all is -300 dB.
        let measured_db = 10.0 * (error / power).max(1e-30).log10();
        Outcome::Formed(measured_db, formed.predicted_error_db)
    }

    /// Why `name` breaks the contract here, if it does.
    fn broken(&self, name: &str) -> Option<String> {
        self.judge(name, &self.form(name))
    }

    fn judge(&self, name: &str, outcome: &Outcome) -> Option<String> {
        match outcome {
            Outcome::Zero => None,
            Outcome::Refused(reason, message) => {
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

/// What a former did over all cases.
#[derive(Default)]
struct Tally {
    cases: u64,
    sane: u64,
    refused: BTreeMap<&'static str, u64>,
    sane_refused: u64,
    /// Worst measured error above the bound, and above the prediction, dB, with their seeds.
    excess_db: Option<(f64, u64)>,
    optimism_db: Option<(f64, u64)>,
    /// Sum of predictions less measured errors, dB.
    pessimism_db: f64,
    formed: u64,
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
            Outcome::Refused(reason, _) => {
                *self.refused.entry(reason).or_default() += 1;
                self.sane_refused += u64::from(case.sane);
            }
            Outcome::Formed(measured_db, predicted_db) => {
                self.formed += 1;
                self.pessimism_db += predicted_db - measured_db;
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

    fn line(&self, name: &str) -> String {
        let share = |count: u64, of: u64| 100.0 * count as f64 / (of.max(1)) as f64;
        let worst = |worst: Option<(f64, u64)>| match worst {
            None => "none".to_owned(),
            Some((db, seed)) => format!("{db:+.1} dB (seed {seed})"),
        };
        let mut line = format!(
            "{name:<8} {:>7} cases; worst excess over the bound {}, optimism {}; mean pessimism {:.1} dB; refused",
            self.cases,
            worst(self.excess_db),
            worst(self.optimism_db),
            self.pessimism_db / self.formed.max(1) as f64,
        );
        for (reason, count) in &self.refused {
            let _ = write!(line, " {reason} {:.1} %", share(*count, self.cases));
        }
        let _ = write!(
            line,
            " (of sane cases {:.1} %); broken {}",
            share(self.sane_refused, self.sane),
            self.failures.len()
        );
        line
    }
}

#[test]
fn formers_keep_what_they_promise() {
    let number = |key: &str| var(key).ok().map(|text| text.parse::<u64>().expect(key));
    let first = number("SUBAPERTURE_SEED").unwrap_or(0);
    let count = number("SUBAPERTURE_CASES").unwrap_or(if first > 0 { 1 } else { CASES });
    let chosen = var("SUBAPERTURE_FORMERS").ok();
    let names: Vec<&str> = match &chosen {
        Some(list) => list.split(',').collect(),
        None => CHECKED.to_vec(),
    };
    let tallies: Vec<Mutex<Tally>> = names.iter().map(|_| Mutex::default()).collect();
    (first..first + count).into_par_iter().for_each(|seed| {
        let bench = Bench::new(&draw(seed));
        for (name, tally) in names.iter().zip(&tallies) {
            let outcome = bench.form(name);
            tally.lock().unwrap().add(&bench, name, &outcome);
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
