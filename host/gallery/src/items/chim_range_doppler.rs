//! Steps of the range-Doppler algorithm: Chim 2018, Figs 3.1 and 3.2.

use num_complex::Complex32;

use super::chim_strip::{
    Map, band, centre_wavenumber, cycles, error_db, focused, l_band, profiles, ridge, rms,
    transposed, with_task,
};
use super::forming::{ERROR_DB, grid_about};
use crate::{Check, Context, Finding, Item, ItemError, Picture};
use subaperture_focus::frequency_domain::StageKind;
use subaperture_focus::rda::RangeDopplerAlgorithm;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::{Axis, ImageGrid};
use subaperture_model::image::{Image, power};
use subaperture_model::phase_history::{Band, PhaseHistory};
use subaperture_quality::response::{Settings, Target, measure};
use subaperture_signal::window::Window;
use subaperture_simulate::PointTargetHistory;

pub(super) const ITEMS: [Item; 2] = [
    Item {
        id: "c-3-1",
        source: "Chim 2018, Fig. 3.1",
        title: "The range-Doppler algorithm, step by step",
        work: 3.9,
        reproduce: long_aperture,
    },
    Item {
        id: "c-3-2",
        source: "Chim 2018, Fig. 3.2",
        title: "The azimuth FFT of a short aperture all but focuses",
        work: 0.97,
        reproduce: short_aperture,
    },
];

const FORMER: RangeDopplerAlgorithm = RangeDopplerAlgorithm {
    error_db: ERROR_DB,
    secondary_compression: true,
};
/// Closest range of the scene centre, metres.
const RANGE_M: f64 = 30.0;
const SPACING_M: f64 = 0.05;
/// Largest sine off broadside at which lines are measured; the aperture of 30 m ends at 0.447.
const MAX_SINE: f64 = 0.4;
/// Search half-width about a line, metres: three cells.
const REACH_M: f64 = 1.5;

/// Intermediate arrays of the algorithm.
struct Stages {
    band: Band,
    /// Wavenumbers along the track, rad/m.
    along: Axis,
    /// Before range cell migration correction, `[along][range]`.
    curved: (Vec<f32>, Axis),
    /// After range cell migration correction.
    straight: (Vec<f32>, Axis),
    image: Image,
}

impl Stages {
    fn of(
        context: &Context,
        history: &PointTargetHistory,
        grid: &ImageGrid,
        shown_m: (f64, f64),
    ) -> Result<Self, ItemError> {
        let band = band(history)?;
        let mut along = grid.rows;
        let mut curved = None;
        let mut straight = None;
        let formed = with_task(context, history, grid, Window::Hamming, |task| {
            FORMER.form_observed(task, &mut |stage| match stage.kind {
                StageKind::Spectrum => {
                    along = stage.columns;
                    let rows = transposed(stage.values, stage.columns.count);
                    curved = Some(profiles(&rows, &band, Window::None, 0.0, shown_m));
                }
                StageKind::RangeDoppler => {
                    let powers = stage.values.iter().map(Complex32::norm_sqr).collect();
                    straight = Some((powers, stage.columns));
                }
                StageKind::Image => {}
            })
        })?;
        let (Some(curved), Some(straight)) = (curved, straight) else {
            return Err(ItemError::Measure("the former showed nothing".to_owned()));
        };
        Ok(Self {
            band,
            along,
            curved,
            straight,
            image: formed.image,
        })
    }

    /// Lines of a scatterer at closest range `range_m` before and after correction: sine off broadside and measured
    /// ranges.
    fn lines(&self, range_m: f64, most_sine: f64) -> Vec<(f64, [f64; 2])> {
        let centre = centre_wavenumber(&self.band);
        let row = |(powers, axis): &(Vec<f32>, Axis), q: usize, near: f64| {
            ridge(
                &powers[q * axis.count..(q + 1) * axis.count],
                axis,
                near,
                REACH_M,
            )
        };
        (0..self.along.count)
            .map(|q| (q, self.along.at(q) / centre))
            .filter(|(_, sine)| sine.abs() <= most_sine)
            .map(|(q, sine)| {
                let curved = range_m / (1.0 - sine * sine).sqrt();
                let found = [
                    row(&self.curved, q, curved),
                    row(&self.straight, q, range_m),
                ];
                (sine, found)
            })
            .collect()
    }

    fn map(&self, after: bool, name: &str, caption: &str) -> Result<Picture, ItemError> {
        let (powers, columns) = match after {
            true => &self.straight,
            false => &self.curved,
        };
        let map = Map {
            name,
            caption,
            labels: ["range (m)", "azimuth frequency (1/m)"],
            rows: cycles(&self.along),
            columns: *columns,
        };
        Ok(map.levels(powers)?)
    }
}

/// Range profiles of all pulses.
fn compressed(history: &PointTargetHistory, shown_m: (f64, f64)) -> Result<Picture, ItemError> {
    let band = band(history)?;
    let pulses = &history.collection().pulses;
    let mut samples = vec![Complex32::ZERO; pulses.len() * band.count];
    history.read(0..pulses.len(), &mut samples)?;
    let (powers, columns) = profiles(&samples, &band, Window::Hamming, RANGE_M, shown_m);
    let map = Map {
        name: "compressed",
        caption: "Range profiles along the track",
        labels: ["range (m)", "place along the track (m)"],
        rows: Axis {
            start: pulses[0].transmitter_m.x,
            step: SPACING_M,
            count: pulses.len(),
        },
        columns,
    };
    Ok(map.levels(&powers)?)
}

/// Deviations of the line of the scatterer at [`RANGE_M`], metres.
struct Migration {
    /// Largest deviation from that range before and after correction.
    migration_m: f64,
    left_m: f64,
    /// RMS deviation from the exact hyperbola.
    from_exact_m: f64,
    /// Largest deviation from the parabola of (3.6) within the beam, and overall.
    in_beam_m: f64,
    wide_m: f64,
}

impl Migration {
    fn of(stages: &Stages) -> Self {
        let lines = stages.lines(RANGE_M, MAX_SINE);
        let largest =
            |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, |a, b| f64::max(a, b.abs()));
        let migration_m = largest(&mut lines.iter().map(|(_, [before, _])| before - RANGE_M));
        let left_m = largest(&mut lines.iter().map(|(_, [_, after])| after - RANGE_M));
        let from_exact_m = rms(lines
            .iter()
            .map(|(sine, [before, _])| before - RANGE_M / (1.0 - sine * sine).sqrt()));
        // (lambda f_x)^2 / 8 with f_x = 2 sine / lambda is sine^2 / 2.
        let parabola =
            |(sine, [before, _]): &(f64, [f64; 2])| before - RANGE_M * (1.0 + sine * sine / 2.0);
        let beam = 6.65f64.to_radians().sin();
        let in_beam_m = largest(
            &mut lines
                .iter()
                .filter(|(sine, _)| sine.abs() <= beam)
                .map(parabola),
        );
        let wide_m = largest(&mut lines.iter().map(parabola));
        Self {
            migration_m,
            left_m,
            from_exact_m,
            in_beam_m,
            wide_m,
        }
    }
}

fn long_aperture(context: &Context) -> Result<Finding, ItemError> {
    let places = [(0.0, 0.0), (-3.0, -4.0), (3.0, 4.0)];
    let history = l_band(RANGE_M, 30.0, SPACING_M, &places)?;
    let grid = grid_about(glam::DVec3::ZERO, 6.0, 7.0, 0.1);
    let shown_m = (24.0, 40.0);
    let stages = Stages::of(context, &history, &grid, shown_m)?;
    let cell_m = SPEED_OF_LIGHT_M_S / (2.0 * stages.band.bandwidth_hz());
    let Migration {
        migration_m,
        left_m,
        from_exact_m,
        in_beam_m,
        wide_m,
    } = Migration::of(&stages);

    let small = grid_about(glam::DVec3::ZERO, 1.5, 1.5, 0.05);
    let alone = l_band(RANGE_M, 30.0, SPACING_M, &places[..1])?;
    let error_db = error_db(context, &alone, &small, &FORMER)?;
    Ok(Finding {
        thesis: "After the azimuth FFT targets are curved lines, R0 (1 + lambda^2 f_x^2 / 8), (3.6), whatever \
                 their place along the track; after range cell migration correction straight ones; after \
                 azimuth compression points. The figure is a sketch of a long aperture."
            .to_owned(),
        method: format!(
            "Three unit scatterers at 26, 30 and 34 m from a track of 30 m, 1.7 to 2.0 GHz; the intermediate arrays of \
             Subaperture's range-Doppler algorithm, whose range cell migration correction is R0 / cos(theta). The line at \
             30 m is measured out to {:.1} degrees, where (3.6) is off by {:.2} m, {:.2} of a range cell. Scale: the \
             thesis's figure is a sketch without numbers; the band is that of 4.5, ranges and track are ours.",
            MAX_SINE.asin().to_degrees(),
            wide_m,
            wide_m / cell_m
        ),
        checks: vec![
            Check::claim(
                "curvature after the azimuth FFT",
                "curved",
                format!("{migration_m:.2} m, {:.1} cells", migration_m / cell_m),
                migration_m > 3.0 * cell_m,
            ),
            Check::claim(
                "deviation of the line from R0 / cos(theta), RMS",
                "the exact hyperbola",
                format!("{:.3} m, {:.3} of a cell", from_exact_m, from_exact_m / cell_m),
                from_exact_m < 0.05 * cell_m,
            ),
            Check::claim(
                "the line against (3.6) within 6.65 degrees, half the beam of 4.5, at most",
                "R0 (1 + lambda^2 f_x^2 / 8)",
                format!("{:.3} m, {:.3} of a cell", in_beam_m, in_beam_m / cell_m),
                in_beam_m < 0.1 * cell_m,
            ),
            Check::claim(
                "curvature after correction",
                "straight",
                format!("{left_m:.3} m, {:.3} of a cell", left_m / cell_m),
                left_m < 0.1 * cell_m,
            ),
            Check::claim(
                "the image's error against the exact matched filter",
                "focused",
                format!("{error_db:.1} dB"),
                error_db < -25.0,
            ),
        ],
        why: None,
        pictures: vec![
            compressed(&history, shown_m)?,
            stages.map(false, "transformed", "After the azimuth FFT")?,
            stages.map(true, "corrected", "After migration correction")?,
            focused(&stages.image, &grid, "After azimuth compression")?,
        ],
    })
}

fn short_aperture(context: &Context) -> Result<Finding, ItemError> {
    const APERTURE_M: f64 = 1.0;
    let places = [(0.0, 0.0), (-8.0, -4.0), (10.0, 4.0)];
    let history = l_band(RANGE_M, APERTURE_M, SPACING_M, &places)?;
    let grid = grid_about(glam::DVec3::ZERO, 12.0, 6.0, 0.5);
    let stages = Stages::of(context, &history, &grid, (24.0, 40.0))?;
    let (powers, ranges) = &stages.curved;
    let map = Image {
        rows: stages.along.count,
        columns: ranges.count,
        pixels: powers
            .iter()
            .map(|p| Complex32::new(p.sqrt(), 0.0))
            .collect(),
    };
    let wavelength_m = SPEED_OF_LIGHT_M_S / stages.band.centre_hz();
    let frequency = cycles(&stages.along);
    let as_grid = ImageGrid::horizontal(*ranges, frequency, 0.0);
    let mut checks = Vec::new();
    for (x, y) in places {
        let range_m = x.hypot(y + RANGE_M);
        let sine = x / range_m;
        let (row, column) = strongest(&map, &as_grid, range_m, 2.0 * sine / wavelength_m);
        let found_deg = (row * wavelength_m / 2.0).asin().to_degrees();
        checks.push(Check::claim(
            &format!(
                "angle and range of the scatterer at ({x}, {}) m",
                y + RANGE_M
            ),
            "approximately focused at its angle of arrival",
            format!(
                "{found_deg:.2} degrees for {:.2}, {column:.2} m for {range_m:.2}",
                sine.asin().to_degrees()
            ),
            // A tenth of the angular resolution lambda / 2L, 4.6 degrees; a fifth of a cell.
            (found_deg - sine.asin().to_degrees()).abs() < 0.46 && (column - range_m).abs() < 0.1,
        ));
    }
    let settings = Settings::default();
    let target = Target::Near {
        column_value: RANGE_M,
        row_value: 0.0,
    };
    let response = measure(&map, &as_grid, target, &settings)
        .map_err(|error| ItemError::Measure(error.to_string()))?;
    let width = response.cuts[1].width_3db.unwrap_or(f64::NAN);
    let long = 2.0 * 2.0 * MAX_SINE / wavelength_m;
    let pulses = history.collection().pulses.len() as f64;
    checks.push(Check::number(
        "3 dB width over azimuth frequency, 0.886 / L in theory",
        0.886 / (pulses * SPACING_M),
        width,
        0.1,
        2,
        "1/m",
    ));
    checks.push(Check::claim(
        "the same for the long aperture of Fig. 3.1",
        "a line",
        format!("{long:.1} 1/m and more"),
        long > 5.0 * width,
    ));
    Ok(Finding {
        thesis: "Over a short aperture a target keeps its angle, so the azimuth FFT makes a point of it, at \
                 its angle of arrival and its range."
            .to_owned(),
        method: format!(
            "Unit scatterers at 30 m, at broadside and at -17 and +16 degrees; a track of {APERTURE_M} m, at whose ends \
             the quadratic phase is {:.2} rad; 1.7 to 2.0 GHz. Scale: the thesis's figure is a sketch without numbers; \
             the band is that of 4.5, ranges and track are ours.",
            std::f64::consts::TAU * (APERTURE_M / 2.0).powi(2) / (wavelength_m * RANGE_M)
        ),
        checks,
        why: None,
        pictures: vec![
            compressed(&history, (24.0, 40.0))?,
            stages.map(false, "transformed", "After the azimuth FFT: points at their angles")?,
        ],
    })
}

/// Row and column value of the strongest pixel within one metre of a range and 1/m of a frequency.
fn strongest(map: &Image, grid: &ImageGrid, range_m: f64, frequency: f64) -> (f64, f64) {
    let place = |i: usize| {
        (
            grid.rows.at(i / map.columns),
            grid.columns.at(i % map.columns),
        )
    };
    let near = |&i: &usize| {
        let (row, column) = place(i);
        (row - frequency).abs() < 1.0 && (column - range_m).abs() < 1.0
    };
    (0..map.pixels.len())
        .filter(near)
        .max_by(|&a, &b| power(map.pixels[a]).total_cmp(&power(map.pixels[b])))
        .map_or((f64::NAN, f64::NAN), place)
}
