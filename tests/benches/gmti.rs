//! Imaging with detection of moving targets over imaging alone: elapsed and processor time, in one run. Two threads.
//!
//! `cargo bench --bench gmti`. Imaging alone forms the images of the same channels on the same grid by the same former and bound, from the same
//! samples in memory. Both alternate, so that a change of the machine's speed affects both; times are medians.

use std::time::Instant;

use subaperture::focus::formers;
use subaperture::focus::{Numerics, Task};
use subaperture::geometry::ImageGrid;
use subaperture::gmti::detection::Settings;
use subaperture::gmti::{Alignment, Imaging, find};
use subaperture::monitor::Silent;
use subaperture::phase_history::Channels;
use subaperture::resolution::survey::Survey;
use subaperture::signal::window::Window;
use subaperture::simulate::scenario::{Scenario, examples};
use subaperture_xtask::processor::{self, Of};

/// Rounds of the small and the large scene.
const ROUNDS: [usize; 2] = [15, 7];

const ERROR_DB: f64 = -60.0;
const MEMORY_BYTES: u64 = 8 << 30;

fn main() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2);
    pool.build_global().expect("no other pool is in use");
    println!(
        "| scene | pixels | imaging (s) | images and registration | with targets | ratio | processor | ratio |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    let small = examples::text("gmti")
        .expect("the example exists")
        .to_owned();
    let large = small
        .replace("x = \"-60, 60 m\"", "x = \"-150, 150 m\"")
        .replace("y = \"-60, 60 m\"", "y = \"-260, 260 m\"")
        .replace("density = 3 ", "density = 0.5 ")
        .replace("pulses = 1040", "pulses = 4160")
        .replace("samples = 200", "samples = 600");
    for (text, rounds) in [small, large].into_iter().zip(ROUNDS) {
        measure(text, rounds);
    }
}

fn measure(scene: String, rounds: usize) {
    let channels = recorded(scene);
    let collection = channels.channel(0).collection();
    let survey = Survey::of(collection).expect("the recording has pulses");
    let grid = survey.default_grid().expect("the scene has a grid").grid;
    let former = formers::former("auto", &serde_json::json!({ "error_db": ERROR_DB }));
    let former = former.expect("the former exists");
    let imaging = Imaging {
        former: &*former,
        grid: &grid,
        windows: [Window::default(); 2],
        memory_bytes: MEMORY_BYTES,
        numerics: Numerics::default(),
        monitor: &Silent,
    };
    let settings = Settings::default();
    let alone = || images(&channels, &imaging);
    let registered = || {
        let histories = channels.iter().map(|(_, history)| history.collection());
        let alignment = Alignment::new(&histories.collect::<Vec<_>>()).expect("channels align");
        drop(imaging.form(&channels, &alignment).expect("images form"));
    };
    let detected = || {
        let found = find(&channels, &imaging, &settings, None).expect("targets are searched");
        drop(found);
    };
    let mut times: [Vec<[f64; 2]>; 3] = Default::default();
    for _ in 0..rounds {
        times[0].push(timed(alone));
        times[1].push(timed(registered));
        times[2].push(timed(detected));
    }
    let [
        [alone, alone_cpu],
        [registered, _],
        [detected, detected_cpu],
    ] = times.map(medians);
    println!(
        "| {} x {} x {} | {} x {} | {alone:.3} | {registered:.3} | {detected:.3} | {:.2} | {alone_cpu:.2}, {detected_cpu:.2} | {:.2} |",
        channels.len(),
        collection.pulses.len(),
        collection.num_samples,
        grid.columns.count,
        grid.rows.count,
        detected / alone,
        detected_cpu / alone_cpu
    );
}

/// Samples of all channels in memory.
fn recorded(scene: String) -> Channels<'static> {
    let experiment = Scenario::new("gmti.toml", scene, ".").experiment();
    let experiment = experiment.expect("the scene is valid");
    let channels = experiment
        .channels(1 << 30)
        .expect("channels are simulated");
    channels.in_memory().expect("pulses exist")
}

/// Form the image of each channel.
fn images(channels: &Channels, imaging: &Imaging) {
    let grid: &ImageGrid = imaging.grid;
    let [fast, slow] = imaging.windows;
    let mut images = Vec::new();
    for (_, history) in channels.iter() {
        let weights = imaging
            .former
            .weights(history.collection(), grid, fast, slow)
            .expect("windows apply");
        let task = Task {
            memory_bytes: imaging.memory_bytes,
            monitor: imaging.monitor,
            numerics: imaging.numerics,
            ..Task::new(history, grid, &weights)
        };
        images.push(imaging.former.form(&task).expect("images form").image);
    }
}

/// Elapsed and processor time, seconds.
fn timed(work: impl Fn()) -> [f64; 2] {
    let (began, work_s) = (Instant::now(), processor::seconds(Of::Own));
    work();
    let own = processor::seconds(Of::Own).zip(work_s);
    [
        began.elapsed().as_secs_f64(),
        own.map_or(f64::NAN, |(now, then)| now - then),
    ]
}

fn medians(times: Vec<[f64; 2]>) -> [f64; 2] {
    [0, 1].map(|i| {
        let mut values: Vec<f64> = times.iter().map(|time| time[i]).collect();
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    })
}
