//! Image formers side by side on Table 4.1: time, rate and error, in one run.
//!
//! `cargo bench --bench formers`. Formers take turns, so that a change of the machine's speed meets them all;
//! the ratio to the first is the median over turns. Rates are in billions of pixel-pulses a second, for
//! the sub-CPI former the equivalent of direct backprojection.

use std::time::Instant;

use subaperture::focus::bp::Backprojection;
use subaperture::focus::exact::Exact;
use subaperture::focus::ffbp::FastFactorised;
use subaperture::focus::omega_k::OmegaK;
use subaperture::focus::pfa::PolarFormat;
use subaperture::focus::rda::RangeDopplerAlgorithm;
use subaperture::focus::rdbp::{Mode, RangeDoppler, Thesis};
use subaperture::focus::{ImageFormer, Task};
use subaperture::geometry::ImageGrid;
use subaperture::monitor::Silent;
use subaperture::phase_history::{InMemory, PhaseHistory, Weights};
use subaperture::signal::window::Window;
use subaperture::simulate::{Preset, Variation};
use subaperture_tests::error_db;

const TURNS: usize = 7;

fn main() {
    let simulated = Preset::Table41.simulate(&Variation::default());
    let collection = simulated.collection().clone();
    let num_pulses = collection.pulses.len();
    let mut samples = vec![Default::default(); num_pulses * collection.num_samples];
    simulated
        .read(0..num_pulses, &mut samples)
        .expect("simulated samples are finite");
    // Held in memory: the simulator's own time stays out.
    let history = InMemory::new(collection, samples).expect("simulated samples are finite");

    let grid: ImageGrid = "x=-45:45:0.25,y=-45:45:0.25".parse().expect("a grid");
    let weights = Weights::new(history.collection(), Window::None, Window::None);
    let task = Task {
        history: &history,
        grid: &grid,
        weights: &weights,
        memory_bytes: 4 << 30,
        monitor: &Silent,
    };
    let form = |former: &dyn ImageFormer| former.form_best(&task).expect("4 GiB are enough").image;

    let rdbp = |mode, error_db| RangeDoppler {
        mode,
        error_db,
        sub_cpi: None,
        patch_m: None,
    };
    let formers: [(&str, &dyn ImageFormer); 10] = [
        ("bp, -60 dB", &Backprojection { error_db: -60.0 }),
        ("bp, -45 dB", &Backprojection { error_db: -45.0 }),
        (
            "rdbp, thesis",
            &rdbp(Mode::Thesis(Thesis::default()), -60.0),
        ),
        ("rdbp, -60 dB", &rdbp(Mode::Precise, -60.0)),
        ("rdbp, -45 dB", &rdbp(Mode::Precise, -45.0)),
        ("ffbp, -60 dB", &FastFactorised { error_db: -60.0 }),
        ("ffbp, -45 dB", &FastFactorised { error_db: -45.0 }),
        (
            "pfa",
            &PolarFormat {
                error_db: -60.0,
                centre_m: None,
            },
        ),
        (
            "rda",
            &RangeDopplerAlgorithm {
                error_db: -60.0,
                secondary_compression: true,
            },
        ),
        ("omega-k", &OmegaK { error_db: -60.0 }),
    ];
    let exact = form(&Exact);
    let errors: Vec<f64> = formers
        .iter()
        .map(|(_, f)| error_db(&form(*f), &exact))
        .collect();

    let mut seconds = vec![Vec::new(); formers.len()];
    for _ in 0..TURNS {
        for ((_, former), seconds) in formers.iter().zip(&mut seconds) {
            let start = Instant::now();
            std::hint::black_box(form(*former));
            seconds.push(start.elapsed().as_secs_f64());
        }
    }
    let work = grid.num_pixels() as f64 * num_pulses as f64;
    println!("former        error dB   seconds   GBP/s   ratio to the first");
    for (i, (name, _)) in formers.iter().enumerate() {
        let ratios = seconds[0]
            .iter()
            .zip(&seconds[i])
            .map(|(first, own)| first / own);
        let time = median(seconds[i].iter().copied());
        let (rate, ratio) = (work / time * 1e-9, median(ratios));
        println!(
            "{name:<13} {:>8.1} {time:>9.3} {rate:>7.2} {ratio:>10.2}",
            errors[i]
        );
    }
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
