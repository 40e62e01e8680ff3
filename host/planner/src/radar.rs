//! Plan of one collection: resolution, sampling, sub-CPIs, grating lobes, cost, sensitivity.
//!
//! Input is a [`Collection`], recorded or generated from [`super::parameters::Parameters`]. Geometry is that of the
//! survey ([`Survey`]), sub-CPIs those of the range-Doppler former's plan ([`rdbp::Plan`]); the other modules
//! of this crate compute the rest.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};
use serde::Serialize;

use super::chain::{Chain, ChainLevels};
use super::cost::{FormerCost, ThesisMemory, Work};
use super::grating::{self, Lobe};
use super::radar_equation::{Illumination, Sensitivity};
use super::sampling::{self, Need};
use super::stepped::{SteppedSweep, SweepPlan};
use subaperture_focus::formers::FORMERS;
use subaperture_focus::rdbp::{self, Mode, RangeDopplerBackprojection, Thesis};
use subaperture_focus::{FormError, ImageFormer, ImageSpec};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::{Collection, Weights};
use subaperture_model::quantity::seconds;
use subaperture_model::radar::LinkBudget;
use subaperture_model::resolution::survey::Survey;
use subaperture_signal::window::Window;

/// Largest number of grating lobes listed.
const MAX_LOBES: usize = 8;

/// Request for a plan.
#[derive(Clone, Debug)]
pub struct Request<'a> {
    /// Image grid.
    pub grid: &'a ImageGrid,
    /// Bound on the relative RMS error of the image, dB.
    pub error_db: f64,
    /// Memory limit for tables and one thread's buffers of an image former, bytes ([`ImageSpec::scratch_bytes`]).
    pub memory_bytes: u64,
    /// Pulses per sub-CPI of the thesis's mode.
    pub thesis_sub_cpi: usize,
    /// Full beamwidth of the antenna, radians; `None` if unknown.
    pub beamwidth_rad: Option<f64>,
    /// Link budget, and pulse duration in seconds; `None` if unknown, or to be taken from the chain.
    pub power: Option<(LinkBudget, f64)>,
    /// Signal chain; `None` if unknown.
    pub chain: Option<&'a Chain>,
}

/// Plan of a collection.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RadarPlan {
    /// Survey: band, resolution, extents and geometry.
    pub survey: Survey,
    /// Resolution and sampling by textbook formulas.
    pub aperture: Aperture,
    /// Sub-CPIs of range-Doppler backprojection.
    pub sub_cpis: SubCpis,
    /// Problem size.
    pub work: Work,
    /// Cost of each registered image former that can form this image, and of the thesis's mode.
    pub costs: Vec<FormerCost>,
    /// Memory by the thesis's count, with the Doppler axis of its sub-CPIs padded 16 times.
    pub thesis_memory: ThesisMemory,
    /// Signal-to-noise ratios; `None` if the power is unknown.
    pub sensitivity: Option<Sensitivity>,
    /// Levels along the signal chain; `None` without a chain.
    pub chain: Option<ChainLevels>,
    /// Speed limits of the sweep; `None` if the samples of a pulse are simultaneous.
    pub sweep: Option<SweepPlan>,
}

/// Resolution and sampling of the aperture.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Aperture {
    /// Cross-range resolution of the aperture flown, metres.
    pub cross_range_resolution_m: Option<f64>,
    /// Cross-range resolution of an aperture limited by the beam, metres.
    pub beam_resolution_m: Option<f64>,
    /// Unambiguous range between pulses, `c / (2 PRF)`, metres.
    pub unambiguous_range_m: Option<f64>,
    /// Pulse repetition frequency, hertz.
    pub prf_hz: Option<f64>,
    /// Width of the grid across the line of sight, metres.
    pub scene_width_m: f64,
    /// Sampling needed to image this width without ambiguity.
    pub scene: Need,
    /// Sampling needed for the beam.
    pub beam: Option<Need>,
    /// Whether the pulse spacing suffices for the scene.
    pub scene_is_sampled: Option<bool>,
    /// Whether the pulse spacing suffices for the beam.
    pub beam_is_sampled: Option<bool>,
}

/// Sub-CPI lengths.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SubCpis {
    /// Pulses per sub-CPI of the precise mode within the error bound.
    pub precise_pulses: usize,
    /// Number of sub-CPIs of the precise mode.
    pub precise_count: usize,
    /// Patch size of the precise mode, rows and columns.
    pub patch: [usize; 2],
    /// Predicted relative RMS error of the precise mode, dB.
    pub predicted_db: f64,
    /// Longest sub-CPI of the thesis's mode whose first grating lobe is outside the scene, pulses.
    pub thesis_clear_pulses: Option<usize>,
    /// Sub-CPI length of `thesis_lobes`, pulses.
    pub thesis_pulses: usize,
    /// Grating lobes of a scatterer at the scene centre, up to the scene's width.
    pub thesis_lobes: Vec<Lobe>,
}

/// Error of planning a collection.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlanError {
    /// The collection has no pulses.
    #[error("expected at least one pulse, found none in the collection")]
    Empty,
    /// A sweep takes longer than the time from pulse to pulse.
    #[error(
        "sweep of {carriers} carriers: expected at most the time of {} from pulse to pulse, found {}; lower the PRF, shorten carrier_time of the chain, or use fewer carriers",
        seconds(*interval_s),
        seconds(*sweep_s)
    )]
    Sweep {
        /// Carriers of a sweep.
        carriers: usize,
        /// Duration of a sweep, seconds.
        sweep_s: f64,
        /// Time from pulse to pulse, seconds.
        interval_s: f64,
    },
    /// Range-Doppler backprojection cannot form the image.
    #[error(transparent)]
    Form(#[from] FormError),
}

impl RadarPlan {
    /// Plan `request` for `collection`.
    ///
    /// # Errors
    /// [`PlanError`] if there are no pulses, a sweep of the chain takes longer than the time from pulse to pulse, or range-Doppler
    /// backprojection cannot form the image.
    pub fn new(collection: &Collection, request: &Request) -> Result<Self, PlanError> {
        let survey = Survey::of(collection).ok_or(PlanError::Empty)?;
        let sweep = sweep(collection, &survey, request)?;
        let grid = request.grid;
        let plan = rdbp::Plan::new(
            collection,
            grid,
            &rdbp::Request {
                error_db: request.error_db,
                sub_cpi: None,
                patch_m: None,
                memory_bytes: request.memory_bytes,
            },
        )?;
        let aperture = Aperture::new(&survey, request);
        let work = Work {
            frequencies: collection.num_samples,
            pulses: collection.pulses.len(),
            pixels: grid.num_pixels(),
        };

        let centre = grid.position_m(grid.rows.count / 2, grid.columns.count / 2);
        let clear = survey
            .unambiguous_cross_range_m
            .map(|whole_m| ((whole_m / aperture.scene_width_m) as usize).min(work.pulses));
        let sub_cpis = SubCpis {
            precise_pulses: plan.sub_cpi_length,
            precise_count: plan.sub_cpis.len(),
            patch: [plan.patch.rows, plan.patch.columns],
            predicted_db: plan.predicted_db,
            thesis_clear_pulses: clear,
            thesis_pulses: request.thesis_sub_cpi,
            thesis_lobes: grating::lobes(
                collection,
                request.thesis_sub_cpi,
                centre,
                aperture.scene_width_m,
                MAX_LOBES,
            ),
        };
        let from_chain = request.chain.map(|chain| (chain.link(), chain.pulse_s));
        let sensitivity = request
            .power
            .or(from_chain)
            .map(|(link, pulse_s)| sensitivity(collection, &survey, &link, pulse_s, centre));
        Ok(Self {
            thesis_memory: ThesisMemory::new(
                work.frequencies,
                16 * request.thesis_sub_cpi.min(work.pulses),
                work.pixels,
            ),
            costs: costs(collection, request),
            aperture,
            sub_cpis,
            work,
            sensitivity,
            chain: request
                .chain
                .map(|chain| chain_levels(chain, collection, &survey, grid)),
            sweep,
            survey,
        })
    }
}

/// Timing of the sweeps by the chain or the recording, with its speed limits.
fn sweep(
    collection: &Collection,
    survey: &Survey,
    request: &Request,
) -> Result<Option<SweepPlan>, PlanError> {
    let interval_s = survey.pri_s;
    let carrier_s = request.chain.and_then(|chain| chain.carrier_s);
    let sweep = match carrier_s {
        Some(carrier_s) => SteppedSweep::new(collection, carrier_s, interval_s),
        None => SteppedSweep::of(collection, interval_s),
    };
    let Some(sweep) = sweep else {
        return Ok(None);
    };
    // Rounding of pulse times, and of an interval that was computed from the duration.
    if carrier_s.is_some() && sweep.interval_s < sweep.sweep_s * (1.0 - 1e-6) {
        return Err(PlanError::Sweep {
            carriers: sweep.carriers,
            sweep_s: sweep.sweep_s,
            interval_s: sweep.interval_s,
        });
    }
    let platform_m_s = survey
        .pulse_spacing_m
        .zip(interval_s)
        .map(|(spacing_m, interval_s)| spacing_m / interval_s);
    let angle_rad = request.beamwidth_rad.unwrap_or(PI);
    Ok(Some(SweepPlan::new(sweep, angle_rad, platform_m_s)))
}

/// Levels of targets at the nearest corner, the centre and the farthest corner of the grid, seen from the middle pulse.
fn chain_levels(
    chain: &Chain,
    collection: &Collection,
    survey: &Survey,
    grid: &ImageGrid,
) -> ChainLevels {
    let middle = &collection.pulses[collection.pulses.len() / 2];
    let ranges_m = |row, column| {
        let at = grid.position_m(row, column);
        [middle.transmitter_m, middle.receiver_m].map(|antenna_m| antenna_m.distance(at))
    };
    let (rows, columns) = (grid.rows.count, grid.columns.count);
    let corners = [0, rows - 1].map(|row| [0, columns - 1].map(|column| ranges_m(row, column)));
    // Spreading loss increases with the product of the ranges.
    let product = |ranges_m: &[f64; 2]| ranges_m[0] * ranges_m[1];
    let (mut nearest, mut farthest) = (corners[0][0], corners[0][0]);
    for ranges_m in corners.as_flattened() {
        if product(ranges_m) < product(&nearest) {
            nearest = *ranges_m;
        }
        if product(ranges_m) > product(&farthest) {
            farthest = *ranges_m;
        }
    }
    let centre = ranges_m(rows / 2, columns / 2);
    let ranges_m = [nearest, centre, farthest];
    chain.levels(survey.wavelength_m, ranges_m, survey.num_pulses)
}

impl Aperture {
    fn new(survey: &Survey, request: &Request) -> Self {
        let range_m = survey.slant_range_m;
        let shortest_m = SPEED_OF_LIGHT_M_S / survey.highest_hz;
        let prf_hz = survey.pri_s.map(f64::recip);
        let velocity_m_s = prf_hz
            .zip(survey.pulse_spacing_m)
            .map(|(prf_hz, spacing_m)| prf_hz * spacing_m);
        let grid = request.grid;
        let scene_width_m = width_across(survey, grid, [grid.rows.count, grid.columns.count]);
        let scene_angle = 2.0 * sampling::half_angle_rad(scene_width_m, range_m);
        let scene = Need::new(scene_angle, shortest_m, velocity_m_s);
        let beam = request
            .beamwidth_rad
            .map(|angle| Need::new(angle, shortest_m, velocity_m_s));
        let sampled = |need: Need| survey.pulse_spacing_m.map(|d| d <= need.spacing_m);
        Self {
            cross_range_resolution_m: survey.cross_range_resolution_m,
            beam_resolution_m: request
                .beamwidth_rad
                .map(|beam| sampling::cross_range_resolution_m(survey.wavelength_m, beam / 2.0)),
            unambiguous_range_m: prf_hz.map(sampling::unambiguous_range_m),
            prf_hz,
            scene_width_m,
            scene,
            beam,
            scene_is_sampled: sampled(scene),
            beam_is_sampled: beam.and_then(sampled),
        }
    }
}

/// Cost of the registered formers that can form the image, and of the thesis's mode.
fn costs(collection: &Collection, request: &Request) -> Vec<FormerCost> {
    let weights = Weights::new(collection, Window::default(), Window::default());
    let spec = ImageSpec {
        scratch_bytes: request.memory_bytes,
        ..ImageSpec::new(collection, request.grid, &weights)
    };
    let listed = FORMERS.iter().filter_map(|entry| {
        let former = entry.within(request.error_db);
        FormerCost::of(&*former, &spec, entry.name.to_owned()).ok()
    });
    let thesis = RangeDopplerBackprojection::default()
        .mode(Mode::Thesis(Thesis::default()))
        .sub_cpi(request.thesis_sub_cpi);
    let name = format!("{}, thesis", thesis.name());
    listed
        .chain(FormerCost::of(&thesis, &spec, name).ok())
        .collect()
}

/// Extent across the line of sight of `rows` by `columns` pixels from the grid's first, metres.
fn width_across(survey: &Survey, grid: &ImageGrid, [rows, columns]: [usize; 2]) -> f64 {
    let across = DVec2::from_angle(survey.azimuth_deg.to_radians()).perp();
    let corners = [(0, 0), (rows, 0), (0, columns), (rows, columns)];
    let places = corners.map(|(row, column)| grid.position_m(row, column).truncate().dot(across));
    let (low, high) = places
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &place| {
            (low.min(place), high.max(place))
        });
    high - low
}

fn sensitivity(
    collection: &Collection,
    survey: &Survey,
    link: &LinkBudget,
    pulse_s: f64,
    centre: DVec3,
) -> Sensitivity {
    let middle = &collection.pulses[collection.pulses.len() / 2];
    let lit = Illumination {
        wavelength_m: survey.wavelength_m,
        ranges_m: [middle.transmitter_m, middle.receiver_m].map(|at| at.distance(centre)),
        bandwidth_hz: survey.bandwidth_hz,
        pulse_s,
        num_pulses: survey.num_pulses,
        cell_m: survey
            .range_resolution_m
            .zip(survey.cross_range_resolution_m)
            .map(|(range_m, cross_m)| [range_m, cross_m]),
    };
    Sensitivity::new(link, &lit)
}
