//! The image formers of the list side by side on Table 4.1: time, rate and error, in one run.
//!
//! `cargo bench --bench formers`. Formers take turns, so that a change of the machine's speed meets them all;
//! the ratio to the first is the median over turns. Rates are in billions of pixel-pulses a second, for
//! the sub-CPI former the equivalent of direct backprojection.

use std::time::Instant;

use subaperture::focus::formers::FORMERS;
use subaperture::focus::rdbp::{Mode, RangeDoppler, Thesis};
use subaperture::focus::{DEFAULT_ERROR_DB, ImageFormer, Task};
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

    // The oracle is what all others are measured by; those of the list as they are, and some in other modes.
    let [oracle, others @ ..] = &FORMERS;
    let mut formers: Vec<(String, Box<dyn ImageFormer>)> = others
        .iter()
        .map(|entry| (entry.name.to_owned(), entry.within(DEFAULT_ERROR_DB)))
        .collect();
    for entry in others {
        let coarser = entry.within(-45.0);
        // Where a bound makes a difference.
        if coarser.planning_for(-45.0).is_some() {
            formers.push((format!("{}, -45 dB", entry.name), coarser));
        }
    }
    let thesis = RangeDoppler::default().mode(Mode::Thesis(Thesis::default()));
    formers.push(("rdbp, thesis".to_owned(), Box::new(thesis)));
    let exact = form(&*oracle.within(DEFAULT_ERROR_DB));
    let errors: Vec<f64> = formers
        .iter()
        .map(|(_, f)| error_db(&form(&**f), &exact))
        .collect();

    let mut seconds = vec![Vec::new(); formers.len()];
    for _ in 0..TURNS {
        for ((_, former), seconds) in formers.iter().zip(&mut seconds) {
            let start = Instant::now();
            std::hint::black_box(form(&**former));
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
