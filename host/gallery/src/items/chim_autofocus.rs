//! Stock and modified phase gradient autofocus (PGA) in the near range: Chim 2018, Figs 6.6 to 6.9.

use std::sync::Mutex;

use glam::DVec3;
use num_complex::Complex64;

use super::chim_rail::{REFLECTORS_M, room_grid};
use super::forming::{backprojection, form_weighted, grid_about, hold, side_by_side};
use super::measure::peak_db;
use crate::{Check, Context, Finding, Item, ItemError};
use subaperture_autofocus::{
    Corrected, Correction, Estimator, Measure, Method, ModifiedPhaseGradient, PhaseGradient,
    RoundInput, SharpenError, Sharpened, Stopping, Subject, sharpen,
};
use subaperture_model::geometry::{ImageGrid, SceneFrame};
use subaperture_model::image::Image;
use subaperture_model::phase_history::{Collection, InMemory, PhaseHistory, Pulse, Sweep};
use subaperture_quality::statistics::{Region, Statistics};
use subaperture_signal::window::Window;
use subaperture_simulate::{PointTargetHistory, Scatterer};

pub(super) const ITEMS: [Item; 1] = [Item {
    id: "c-6-6",
    source: "Chim 2018, Figs 6.6 to 6.9",
    title: "Autofocus of a room, by one phase for all and by the track",
    work: 60.0,
    reproduce: room,
}];

const PULSES: usize = 800;
const APERTURE_M: f64 = 1.0;
/// RMS track error along the rail, metres, and the ratio of the error across: the carriage is driven unevenly, and the rail guides it. An error along the
/// rail has opposite phase for reflectors to the left and to the right.
const ERROR_M: f64 = 1.5e-3;
const ACROSS: f64 = 0.25;
const ROUNDS: usize = 4;

fn room(context: &Context) -> Result<Finding, ItemError> {
    let recorded: Vec<DVec3> = (0..PULSES)
        .map(|n| DVec3::new(APERTURE_M * n as f64 / (PULSES - 1) as f64, 0.0, 0.0))
        .collect();
    let truth: Vec<DVec3> = recorded
        .iter()
        .enumerate()
        .map(|(n, &at)| at + error_m(n))
        .collect();
    let known = simulated(context, &truth)?;
    let mut samples = vec![Default::default(); PULSES * known.collection().num_samples];
    known.read(0..PULSES, &mut samples)?;
    let history = InMemory::new(collection(&recorded), samples)?;

    let grid = room_grid();
    let former = backprojection();
    let image_of = |place: usize, history: &dyn PhaseHistory, grid: &ImageGrid| {
        form_weighted(
            context,
            [place, 20],
            history,
            grid,
            &former,
            Window::default(),
        )
    };
    let perfect = image_of(0, &known, &grid)?;
    let stock = PhaseGradient {
        estimator: Estimator::Gradient,
        ..PhaseGradient::default()
    };
    let stock = sharpened(context, &history, &grid, &stock)?;
    let watched = Watched {
        method: ModifiedPhaseGradient::default(),
        context,
        seen: Mutex::default(),
    };
    let modified = sharpened(context, &history, &grid, &watched)?;
    let [by_stock, by_modified] = [
        corrected(&history, &stock)?,
        corrected(&history, &modified)?,
    ];
    let recordings: [&dyn PhaseHistory; 4] = [&known, &history, &by_stock, &by_modified];
    let mut peaks_db = [[0.0; 4]; 4];
    for (i, peaks_db) in peaks_db.iter_mut().enumerate() {
        for (j, (level_db, place_m)) in peaks_db.iter_mut().zip(REFLECTORS_M).enumerate() {
            let near = grid_about(place_m, 0.1, 0.1, 0.002);
            let image = image_of(4 + 4 * i + j, recordings[i], &near)?;
            *level_db = peak_db(&image);
        }
    }
    // Image on the true track.
    let [best, before, stock_db, modified_db] = peaks_db;
    let below = |peaks: [f64; 4]| [0, 1, 2, 3].map(|i| peaks[i] - best[i]);
    let gained = |peaks: [f64; 4]| [0, 1, 2, 3].map(|i| peaks[i] - before[i]);
    let formatted = |values: [f64; 4]| values.map(|v| format!("{v:.2}")).join(", ");
    let seen = watched
        .seen
        .into_inner()
        .unwrap_or_else(|held| held.into_inner());
    let shown = near_first();
    let rounds: Vec<(String, Image)> = seen
        .into_iter()
        .enumerate()
        .map(|(round, image)| match round {
            0 => ("as recorded".to_owned(), image),
            1 => ("after 1 round".to_owned(), image),
            more => (format!("after {more} rounds"), image),
        })
        .collect();
    let of_rounds = rounds.iter().map(|(_, image)| peak_db(image) - best[0]);
    let of_rounds: Vec<String> = of_rounds.map(|db| format!("{db:.2}")).collect();
    let perfect_entropy = Statistics::of(&perfect, &Region::whole(&perfect))
        .entropy
        .unwrap_or(f64::NAN);
    let third = modified
        .rounds
        .iter()
        .take(3)
        .map(|round| round.figures.entropy);
    let third = third.fold(modified.before.entropy, f64::min);
    Ok(Finding {
        thesis: "Four reflectors in a room of 6 by 4 m, a radar of 77 GHz on a rail of 1 m whose track errs. Stock PGA \
                 \"shows little sign of improvement, and is even worse in some areas\"; modified PGA, which finds the radar's \
                 displacements in range and azimuth, sharpens all reflectors, with \"an acceptable convergence at around \
                 iteration 3\". No numbers are given."
            .to_owned(),
        method: format!(
            "77 to 80 GHz, {PULSES} pulses, four unit scatterers, no noise; a track error of {:.1} mm rms along the rail and a quarter of that across, \
             with periods of a fifth of the aperture and longer. Both algorithms use the phase histories of the brightest points; the first reflector is imaged after \
             each of {ROUNDS} rounds; image entropy is that of {} x {} pixels. The gain of stock PGA depends on the direction of the error: with as much across the \
             rail as along it, each peak gains 5 to 11 dB. Scaled down: {ROUNDS} rounds instead of the thesis's 10, because the image does not change after the third; \
             ideal scatterers without walls, because the recording is not public. The thesis gives the positions of two reflectors, (0.6, 3) and (0.1, 4); the other \
             two, the pulse count and the track error are ours.",
            1e3 * ERROR_M,
            grid.columns.count,
            grid.rows.count
        ),
        checks: vec![
            Check::claim(
                "peaks before autofocus relative to the true track, dB",
                "blurred",
                formatted(below(before)),
                below(before).iter().all(|&db| db < -3.0),
            ),
            Check::claim(
                "gain of the peaks by stock PGA, dB",
                "little, or even worse",
                formatted(gained(stock_db)),
                gained(stock_db).iter().any(|&db| db < 1.0),
            ),
            Check::claim(
                "peaks after modified PGA relative to the true track, dB",
                "sharpened",
                formatted(below(modified_db)),
                below(modified_db).iter().all(|&db| db.abs() < 0.5),
            ),
            Check::claim(
                "entropy before autofocus, by stock PGA, by modified PGA, on the true track",
                "the modified one's is the sharper",
                format!(
                    "{:.2}, {:.2}, {:.2}, {perfect_entropy:.2}",
                    stock.before.entropy, stock.after.entropy, modified.after.entropy
                ),
                modified.after.entropy < stock.after.entropy
                    // Equal where the correction is refused: it is not sharper on held-out range cells.
                    && stock.after.entropy <= stock.before.entropy,
            ),
            Check::claim(
                "peak at (0.6, 3) before autofocus and after 1, 2 and 3 rounds relative to the true track, dB",
                "converging",
                of_rounds.join(", "),
                rounds.last().is_some_and(|(_, image)| peak_db(image) > best[0] - 0.5),
            ),
            Check::claim(
                "entropy after three rounds of modified PGA minus that after the last",
                "converged at around iteration 3",
                format!("{:.3}", third - modified.after.entropy),
                third - modified.after.entropy < 0.02,
            ),
        ],
        why: None,
        pictures: vec![
            side_by_side(
            "images",
            "on the track as recorded (Fig. 6.6), by stock PGA (6.7), by modified PGA (6.8), and on the true track",
            &[
                ("as recorded", &stock.image_before, &grid),
                ("stock PGA", &stock.image_after, &grid),
                ("modified PGA", &modified.image_after, &grid),
                ("true track", &perfect, &grid),
            ],
        )?,
            side_by_side(
                "rounds",
                "modified PGA round by round about (0.6, 3) (Fig. 6.9)",
                &rounds
                    .iter()
                    .map(|(title, image)| (title.as_str(), image, &shown))
                    .collect::<Vec<_>>(),
            )?,
        ],
    })
}

/// Grid about the reflector of Fig. 6.9.
fn near_first() -> ImageGrid {
    grid_about(REFLECTORS_M[0], 0.16, 0.1, 0.002)
}

/// Method that records the image about the first reflector in each round.
struct Watched<'a> {
    method: ModifiedPhaseGradient,
    context: &'a Context<'a>,
    seen: Mutex<Vec<Image>>,
}

impl Method for Watched<'_> {
    fn name(&self) -> &'static str {
        self.method.name()
    }

    fn first_rounds(&self, turns: usize) -> usize {
        self.method.first_rounds(turns)
    }

    fn propose(&self, look: &RoundInput) -> Result<Option<Correction>, SharpenError> {
        if look.holds_out() {
            return self.method.propose(look);
        }
        let window = Window::default();
        let (grid, former) = (near_first(), backprojection());
        let image = form_weighted(
            self.context,
            [look.round, 20],
            look.history,
            &grid,
            &former,
            window,
        )?;
        if let Ok(mut seen) = self.seen.lock() {
            seen.push(image);
        }
        self.method.propose(look)
    }
}

/// Track error of a pulse: five sinusoids of equal power per axis.
fn error_m(n: usize) -> DVec3 {
    let u = std::f64::consts::TAU * n as f64 / PULSES as f64;
    let waves = |first: f64| -> f64 {
        let wave = |w: u32| (f64::from(w) * (u + first) + first * f64::from(w * w)).sin();
        ERROR_M * (2.0f64 / 5.0).sqrt() * (1..=5).map(wave).sum::<f64>()
    };
    DVec3::new(waves(0.7), ACROSS * waves(2.1), 0.0)
}

/// Collection with pulses from these positions, not phase-compensated.
fn collection(places_m: &[DVec3]) -> Collection {
    let pulse = |(n, &at_m): (usize, &DVec3)| Pulse {
        time_s: n as f64 * 1e-3,
        transmitter_m: at_m,
        receiver_m: at_m,
        reference_m: DVec3::ZERO,
        reference_path_m: 0.0,
        start_hz: 77e9,
        step_hz: 3e9 / 256.0,
        sweep: Sweep::AT_ONCE,
        recorded_path_m: None,
    };
    Collection {
        name: "room".to_owned(),
        num_samples: 256,
        pulses: places_m.iter().enumerate().map(pulse).collect(),
        frame: SceneFrame::Local,
        extent: None,
        timed: true,
    }
}

fn simulated(context: &Context, places_m: &[DVec3]) -> Result<InMemory, ItemError> {
    let scatterers = REFLECTORS_M.map(|position_m| Scatterer {
        position_m,
        amplitude: Complex64::ONE,
    });
    hold(
        context,
        &PointTargetHistory::new(collection(places_m), scatterers.to_vec(), None),
    )
}

fn sharpened(
    context: &Context,
    history: &dyn PhaseHistory,
    grid: &ImageGrid,
    method: &dyn Method,
) -> Result<Sharpened, ItemError> {
    let subject = Subject {
        history,
        grid,
        former: &backprojection(),
        windows: [Window::default(); 2],
        measure: Measure::Entropy,
        memory_bytes: context.memory_bytes,
        monitor: context.monitor,
    };
    let stopping = Stopping {
        rounds: ROUNDS,
        ..Stopping::default()
    };
    sharpen(&subject, method, stopping).map_err(|error| match error {
        SharpenError::Form(error) => error.into(),
        other => ItemError::Measure(other.to_string()),
    })
}

/// Recording after autofocus, unchanged if there is no correction.
fn corrected<'a>(
    history: &'a dyn PhaseHistory,
    found: &Sharpened,
) -> Result<Corrected<'a>, ItemError> {
    let none = Correction::Phase {
        error_rad: vec![0.0; PULSES],
    };
    Corrected::new(history, found.correction.as_ref().unwrap_or(&none))
        .map_err(|misfit| ItemError::Measure(misfit.to_string()))
}
