//! Every reader of bytes on its seeds and on mutations of them: no panic, at most two seconds of reading, no allocation beyond the budget,
//! and the promises of each target.
//!
//! `SUBAPERTURE_FUZZ_SECONDS` is the time for each target, 0.5 by default, and `SUBAPERTURE_FUZZ_SEED` the seed of the mutations. An input
//! that breaks a promise is kept in `target/fuzz-failures`; `SUBAPERTURE_FUZZ_INPUT` names one, which is then the only one read.

use std::time::Duration;

use subaperture_tests::fuzz::target;
use subaperture_tests::fuzz::trial::Trial;

use crate::{MEMORY, alone};

fn number<T: std::str::FromStr>(variable: &str, default: T) -> T {
    let text = std::env::var(variable).ok();
    text.and_then(|text| text.parse().ok()).unwrap_or(default)
}

/// Time for each target, seconds.
const SECONDS: f64 = 0.5;
const LONG_SECONDS: f64 = 5.0;

fn tried(name: &str, seconds: f64) {
    let _alone = alone();
    let mut trial = Trial::new(target(name), &MEMORY);
    if let Some(path) = std::env::var_os("SUBAPERTURE_FUZZ_INPUT") {
        let input = std::fs::read(path).expect("the input is read");
        println!("{name}: {}", trial.read(&input));
        return;
    }
    let time = Duration::from_secs_f64(number("SUBAPERTURE_FUZZ_SECONDS", seconds));
    let tried = trial.run(number("SUBAPERTURE_FUZZ_SEED", 1), time);
    println!("{name}: {tried:?}");
    // At least the seeds; for most targets thousands.
    assert!(tried.executions > 10, "{name}: {tried:?}");
}

/// Mutations of an unreadable seed would test only the first check.
#[test]
fn seeds_of_l0b_are_read() {
    let l0b = target("l0b");
    for seed in (l0b.seeds)() {
        let outcome = (l0b.read)(&seed);
        assert!(
            outcome.starts_with("1 channels") && !outcome.contains("expected"),
            "{outcome}"
        );
    }
}

macro_rules! targets {
    ($($name:ident)*) => {
        $(
            #[test]
            fn $name() {
                tried(stringify!($name), SECONDS);
            }
        )*

        #[test]
        #[ignore = "minutes: cargo xtask long"]
        fn every_target_keeps_its_promises_for_longer() {
            for name in [$(stringify!($name)),*] {
                tried(name, LONG_SECONDS);
            }
        }

        #[test]
        fn every_target_is_tried() {
            let here = [$(stringify!($name)),*];
            let all = subaperture_tests::fuzz::TARGETS.iter().map(|target| target.name);
            assert!(all.eq(here), "the list above is not that of the targets");
        }
    };
}

targets! {
    job plan cphd crsd l0b matlab matlab_packed gotcha_gmti npy npz array_recordings picture maps product scenario recording arguments novatel navigation track_csv phase_csv pattern_csv motive
    frames endpoint session sigmf sicd images terrain geojson touchstone scpi
}
