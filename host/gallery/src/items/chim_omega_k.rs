//! Steps of the Omega-K algorithm: Chim 2018, Fig. 3.3.

use std::f64::consts::PI;

use glam::DVec3;
use num_complex::{Complex32, Complex64};

use super::chim_strip::{Map, band, cycles, error_db, focused, l_band, rms, with_task};
use super::forming::{ERROR_DB, grid_about};
use crate::{Check, Context, Finding, Item, ItemError, Picture};
use subaperture_focus::frequency_domain::{Stage, StageKind};
use subaperture_focus::omega_k::OmegaK;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::{Axis, ImageGrid};
use subaperture_model::image::Image;
use subaperture_model::phase_history::PhaseHistory;
use subaperture_signal::phase::widen;
use subaperture_signal::window::Window;

pub(super) const ITEMS: [Item; 1] = [Item {
    id: "c-3-3",
    source: "Chim 2018, Fig. 3.3",
    title: "The Omega-K algorithm, step by step",
    work: 3.5,
    reproduce: omega_k,
}];

const FORMER: OmegaK = OmegaK { error_db: ERROR_DB };
/// Reference range of the spectrum: closest range of the scene centre, metres.
const REFERENCE_M: f64 = 30.0;
/// Closest range of the scatterer, metres.
const RANGE_M: f64 = 33.0;
/// Largest sine off broadside at which phases are measured; the aperture of 30 m ends at 0.41.
const MAX_SINE: f64 = 0.3;
/// Number of range wavenumbers shown.
const SHOWN: usize = 256;

/// Spectrum `[wavenumber][along]`.
struct Spectrum {
    values: Vec<Complex64>,
    rows: Axis,
    columns: Axis,
}

impl Spectrum {
    /// Unwrapped phase along the row nearest to `wavenumber` for `|kx|` up to `most`,
    /// relative to broadside.
    fn phases_rad(&self, wavenumber: f64, most: f64) -> Vec<(f64, f64)> {
        let row = ((wavenumber - self.rows.start) / self.rows.step).round() as usize;
        let line = &self.values[row * self.columns.count..(row + 1) * self.columns.count];
        let middle = (-self.columns.start / self.columns.step).round() as usize;
        let mut phase_rad = 0.0;
        let mut phases = vec![(0.0, 0.0)];
        for i in middle + 1..self.columns.count {
            let along = self.columns.at(i) - self.columns.at(middle);
            if along > most {
                break;
            }
            phase_rad += (line[i] * line[i - 1].conj()).arg();
            phases.push((along, phase_rad));
        }
        phases
    }

    /// The wavenumber of the row nearest to `wavenumber`, rad/m.
    fn nearest(&self, wavenumber: f64) -> f64 {
        let row = ((wavenumber - self.rows.start) / self.rows.step).round();
        self.rows.start + row * self.rows.step
    }

    /// Cosine of the phase times relative magnitude: stripes of equal phase.
    fn stripes(&self) -> Vec<f32> {
        let largest = self.values.iter().map(|z| z.norm()).fold(0.0, f64::max);
        self.values
            .iter()
            .map(|z| (z.re / largest) as f32)
            .collect()
    }
}

/// Intermediate spectra before and after Stolt mapping, and the image.
struct Observed {
    before: Spectrum,
    after: Spectrum,
    image: Image,
}

fn observed(
    context: &Context,
    history: &dyn PhaseHistory,
    grid: &ImageGrid,
) -> Result<Observed, ItemError> {
    let first_pulse_m = history.collection().pulses[0].transmitter_m.x;
    let (mut before, mut after) = (None, None);
    let formed = with_task(context, history, grid, Window::None, |task| {
        FORMER.form_observed(task, &mut |stage| match stage.kind {
            StageKind::Spectrum => {
                let referred = |(i, &z): (usize, &Complex32)| {
                    let kappa = stage.rows.at(i / stage.columns.count);
                    let kx = stage.columns.at(i % stage.columns.count);
                    let kr = (kappa * kappa - kx * kx).max(0.0).sqrt();
                    widen(z) * Complex64::cis(REFERENCE_M * kr - kx * first_pulse_m)
                };
                before = Some(Spectrum {
                    values: stage.values.iter().enumerate().map(referred).collect(),
                    rows: stage.rows,
                    columns: stage.columns,
                });
            }
            StageKind::RangeDoppler => {
                after = Some(over_range_wavenumber(stage));
            }
            StageKind::Image => {}
        })
    })?;
    let (Some(before), Some(after)) = (before, after) else {
        return Err(ItemError::Measure("the former showed nothing".to_owned()));
    };
    Ok(Observed {
        before,
        after,
        image: formed.image,
    })
}

/// Picture of a spectrum's stripes of equal phase.
fn stripes(spectrum: &Spectrum, name: &str, caption: &str, up: &str) -> Result<Picture, ItemError> {
    let columns = cycles(&spectrum.columns);
    let map = Map {
        name,
        caption,
        labels: ["azimuth frequency (1/m)", up],
        rows: spectrum.rows,
        columns,
    };
    Ok(map.values(&spectrum.stripes(), (-1.0, 1.0), "real part")?)
}

fn omega_k(context: &Context) -> Result<Finding, ItemError> {
    let history = l_band(REFERENCE_M, 30.0, 0.05, &[(0.0, RANGE_M - REFERENCE_M)])?;
    let band = band(&history)?;
    let grid = grid_about(DVec3::ZERO, 5.0, 5.0, 0.1);
    let Observed {
        before,
        after,
        image,
    } = observed(context, &history, &grid)?;

    let offset_m = RANGE_M - REFERENCE_M;
    let kappa = before.nearest(4.0 * PI * band.centre_hz() / SPEED_OF_LIGHT_M_S);
    let most = MAX_SINE * kappa;
    let bent = before.phases_rad(kappa, most);
    let closed = |kx: f64| offset_m * (kappa - (kappa * kappa - kx * kx).sqrt());
    let (edge, bend_rad) = bent[bent.len() - 1];
    let from_closed_rad = rms(bent.iter().map(|&(kx, phase)| phase - closed(kx)));
    // Range wavenumber inside the band at all these angles.
    let straight = after.phases_rad(kappa * 0.96, most);
    let left_rad = rms(straight.iter().map(|&(_, phase)| phase));
    let small = grid_about(DVec3::new(0.0, offset_m, 0.0), 1.5, 1.5, 0.05);
    let error_db = error_db(context, &history, &small, &FORMER)?;

    Ok(Finding {
        thesis: "2-D FFT, multiplication with the reference's phase, Stolt mapping sqrt((f0 + f)^2 - c^2 f_x^2 / \
                 4) -> f0 + f', 2-D inverse FFT: after the mapping the phase is linear, -4 pi (R0 - Rref) (f0 + \
                 f') / c, (3.11), and the image well focused."
            .to_owned(),
        method: format!(
            "A unit scatterer {RANGE_M} m from a track of 30 m, 1.7 to 2.0 GHz, its spectrum referred to {REFERENCE_M} m; \
             the arrays of Subaperture's Omega-K algorithm before and after Stolt mapping, the latter transformed back \
             over range. Phases are unwrapped from broadside to {:.1} degrees. Scale: the thesis's figure is a sketch \
             without numbers; the band is that of 4.5, ranges and track are ours.",
            (edge / kappa).asin().to_degrees()
        ),
        checks: vec![
            Check::claim(
                "phase across azimuth before the mapping, at the end: closed form (3.9), measured",
                &format!("{:.2} rad", closed(edge)),
                format!("{bend_rad:.2} rad"),
                (bend_rad - closed(edge)).abs() < 0.3,
            ),
            Check::claim(
                "deviation from the closed form, RMS",
                "none",
                format!("{from_closed_rad:.3} rad"),
                from_closed_rad < 0.15,
            ),
            Check::claim(
                "phase across azimuth after the mapping, RMS",
                "none",
                format!("{left_rad:.3} rad"),
                left_rad < 0.15,
            ),
            Check::claim(
                "the image's error against the exact matched filter",
                "well focused",
                format!("{error_db:.1} dB"),
                error_db < -60.0,
            ),
        ],
        why: None,
        pictures: vec![
            stripes(
                &before,
                "before",
                "Spectrum referred to 30 m: bent stripes of equal phase",
                "two-way wavenumber (rad/m)",
            )?,
            stripes(
                &after,
                "after",
                "After Stolt mapping: straight ones",
                "range wavenumber (rad/m)",
            )?,
            focused(&image, &grid, "The image")?,
        ],
    })
}

/// Transform `[along][range]` over range, relative to the reference range: `[range wavenumber][along]`.
fn over_range_wavenumber(stage: &Stage) -> Spectrum {
    let (ranges, along, carrier) = (stage.columns, stage.rows, stage.carriers[1]);
    // Values lie within half of the unambiguous extent.
    let width = PI / ranges.step;
    let rows = Axis {
        start: carrier - width / 2.0,
        step: width / (SHOWN - 1) as f64,
        count: SHOWN,
    };
    let mut values = vec![Complex64::ZERO; rows.count * along.count];
    for (i, line) in values.chunks_exact_mut(along.count).enumerate() {
        let turns: Vec<Complex64> = (0..ranges.count)
            .map(|j| Complex64::cis(-(ranges.at(j) - REFERENCE_M) * (rows.at(i) - carrier)))
            .collect();
        for (value, profile) in line.iter_mut().zip(stage.values.chunks_exact(ranges.count)) {
            *value = profile
                .iter()
                .zip(&turns)
                .map(|(&z, turn)| widen(z) * turn)
                .sum();
        }
    }
    Spectrum {
        values,
        rows,
        columns: along,
    }
}
