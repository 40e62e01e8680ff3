//! `subap plan radar`: predicted performance and cost of a collection.

use anyhow::Context;
use glam::DVec3;
use num_complex::Complex32;
use subaperture::focus::bp::Backprojection;
use subaperture::focus::{ImageFormer, SCRATCH_BYTES};
use subaperture::geometry::{Axis, ImageGrid};
use subaperture::image::Image;
use subaperture::io::together::FileSet;
use subaperture::io::written::FileKind;
use subaperture::phase_history::{Collection, PhaseHistory};
use subaperture::planner::ambiguity::{Around, MAX_CELLS};
use subaperture::planner::grating::PointResponse;
use subaperture::planner::{Parameters, RadarPlan, Request, SubCpis};
use subaperture::plot::{Colours, HeatMap, Panel, Scale, heat, quicklook};
use subaperture::radar::{LinkBudget, PulseShape};
use subaperture::resolution::survey::Survey;
use subaperture::signal::window::Window;

use crate::args::PlanRadar;
use crate::config::{DEFAULT_ERROR_DB, Session};
use crate::text::{self, Fact, bytes, metres};

/// Names of the pictures.
const PLOTS: [&str; 2] = ["response.png", "ambiguity.png"];

/// Number of pixels along a side of the picture.
const PICTURE: usize = 401;
/// Default pulse length, seconds.
const DEFAULT_PULSE_S: f64 = 10e-6;

/// Print the plan of a collection.
pub(crate) fn run(session: &Session, typed: &PlanRadar) -> anyhow::Result<()> {
    let collection = if typed.input.files.is_empty() {
        parameters(typed).collection()?
    } else {
        session.open(&typed.input)?.collection().clone()
    };
    let survey = Survey::of(&collection).context("the input holds no pulses")?;
    let grid = session.grid(typed.grid.as_ref(), &survey)?;
    let link = |power_w| LinkBudget {
        power_w,
        transmit_gain_dbi: typed.gain,
        receive_gain_dbi: typed.gain,
        losses_db: typed.losses,
        noise_figure_db: typed.noise_figure,
        temperature_k: typed.temperature,
    };
    let request = Request {
        grid: &grid,
        error_db: typed.error_db.unwrap_or(DEFAULT_ERROR_DB),
        memory_bytes: SCRATCH_BYTES,
        thesis_sub_cpi: typed.sub_cpi,
        beamwidth_rad: typed.beamwidth.map(f64::to_radians),
        power: typed.power.map(link).zip(typed.pulse_length),
    };
    let planning = session.progress("planning");
    let plan = RadarPlan::new(&collection, &request)?;
    let mut files = FileSet::new();
    if let Some(folder) = &typed.plots {
        let mut claims = session.claims(&typed.writing, &typed.input.files);
        claims.folder(folder, PLOTS)?;
        let response = plot(&collection, &grid, &plan)?;
        let ambiguity = plot_ambiguity(&pulse(typed, &plan))?;
        for (name, picture) in PLOTS.iter().zip([response, ambiguity]) {
            files.write_bytes(&folder.join(name), FileKind::Picture, &picture)?;
        }
    }
    let files = files.commit()?;
    planning.finish();
    if session.json() {
        let mut plan = serde_json::to_value(&plan)?;
        plan["files"] = serde_json::json!(files);
        return text::say_json("radar-plan", plan);
    }
    text::say(to_text(&plan))?;
    Ok(())
}

/// Parameters of Table 4.1, overridden by options.
fn parameters(typed: &PlanRadar) -> Parameters {
    let (pass, table) = (&typed.pass, Parameters::default());
    let mut parameters = Parameters {
        carrier_hz: pass.carrier.unwrap_or(table.carrier_hz),
        bandwidth_hz: pass.bandwidth.unwrap_or(table.bandwidth_hz),
        num_frequencies: pass.frequencies.unwrap_or(table.num_frequencies),
        range_m: pass.range.unwrap_or(table.range_m),
        grazing_rad: pass.grazing.map_or(table.grazing_rad, f64::to_radians),
        velocity_m_s: pass.velocity.unwrap_or(table.velocity_m_s),
        prf_hz: pass.prf.unwrap_or(table.prf_hz),
        num_pulses: table.num_pulses,
        scene_m: pass.scene.map_or(table.scene_m, |side_m| [side_m; 2]),
    };
    let beam = typed.beamwidth.map(f64::to_radians);
    let lit_m = beam.map(|beam| parameters.aperture_of_beam_m(beam));
    parameters.num_pulses = match (pass.pulses, pass.aperture.or(lit_m)) {
        (Some(count), _) => count,
        (None, Some(aperture_m)) => parameters.pulses_over(aperture_m),
        (None, None) => table.num_pulses,
    };
    parameters
}

/// Draw `response.png`: response of thesis mode to a scatterer at the centre of `grid`.
fn plot(collection: &Collection, grid: &ImageGrid, plan: &RadarPlan) -> anyhow::Result<Vec<u8>> {
    let middle = grid.position_m(grid.rows.count / 2, grid.columns.count / 2);
    let response = PointResponse::new(collection, plan.sub_cpis.thesis_pulses, middle)
        .context("the frequency axis changes from pulse to pulse: there is no response to draw")?;
    let axis = |centre: f64, side_m: f64| Axis {
        start: centre - side_m / 2.0,
        step: side_m / (PICTURE - 1) as f64,
        count: PICTURE,
    };
    let side_m = 2.0 * plan.aperture.scene_width_m;
    let shown = ImageGrid::horizontal(axis(middle.x, side_m), axis(middle.y, side_m), middle.z);
    let value = |point: DVec3| {
        let value = response.at(point);
        Complex32::new(value.re as f32, value.im as f32)
    };
    let places = (0..PICTURE).flat_map(|row| (0..PICTURE).map(move |column| (row, column)));
    let image = Image {
        rows: PICTURE,
        columns: PICTURE,
        pixels: places
            .map(|(row, column)| value(shown.position_m(row, column)))
            .collect(),
    };
    let title = format!(
        "thesis mode, {} pulses per sub-CPI",
        plan.sub_cpis.thesis_pulses
    );
    let mut panel = Panel::new(&image, &shown, title);
    panel.scale = Scale::Fixed {
        top_db: 0.0,
        span_db: 60.0,
    };
    Ok(quicklook(&panel)?)
}

/// Pulse given by options, or a linear sweep over the band.
fn pulse(typed: &PlanRadar, plan: &RadarPlan) -> PulseShape {
    typed.pulse.clone().unwrap_or(PulseShape::Lfm {
        bandwidth_hz: plan.survey.bandwidth_hz,
        duration_s: typed
            .pulse_length
            .unwrap_or(DEFAULT_PULSE_S.min(MAX_CELLS / plan.survey.bandwidth_hz)),
        rising: true,
    })
}

/// Draw `ambiguity.png`, the ambiguity function of the pulse.
fn plot_ambiguity(shape: &PulseShape) -> anyhow::Result<Vec<u8>> {
    let around = Around::peak(shape)
        .map_err(anyhow::Error::msg)
        .context("no ambiguity.png; choose another --pulse or --pulse-length")?;
    let microseconds = Axis {
        start: around.delays_s.start * 1e6,
        step: around.delays_s.step * 1e6,
        ..around.delays_s
    };
    let kind = match shape {
        PulseShape::Lfm { .. } => "linear sweep",
        PulseShape::PhaseCode { .. } => "phase code",
    };
    Ok(heat(&HeatMap {
        values: &around.levels_db,
        rows: around.dopplers_hz,
        columns: microseconds,
        title: format!(
            "ambiguity of a {kind}, {}, {:.4} us",
            text::hertz(shape.bandwidth_hz()),
            shape.duration_s() * 1e6
        ),
        across_label: "delay (us)".to_owned(),
        up_label: "Doppler (Hz)".to_owned(),
        unit: "dB".to_owned(),
        range: (-50.0, 0.0),
        colours: Colours::default(),
        proportional: false,
    })?)
}

fn to_text(plan: &RadarPlan) -> String {
    let mut facts = resolution_facts(plan);
    facts.extend(sampling_facts(plan));
    facts.extend(sub_cpi_facts(plan));
    facts.extend(echo_facts(plan));
    let mut lines = text::facts(&facts);
    if !plan.sub_cpis.thesis_lobes.is_empty() {
        lines.push(String::new());
        lines.push(lobes_table(&plan.sub_cpis));
    }
    lines.push(String::new());
    lines.push(costs_table(plan));
    lines.push(String::new());
    lines.push(thesis_memory(plan));
    lines.join("\n")
}

/// Resolution, and unambiguous extent.
fn resolution_facts(plan: &RadarPlan) -> Vec<Fact> {
    let (survey, aperture) = (&plan.survey, &plan.aperture);
    vec![
        (
            "range",
            format!(
                "resolution {} in slant, {} on the ground (Rayleigh's); unambiguous {} in a profile{}",
                metres(Some(survey.slant_range_resolution_m)),
                metres(survey.range_resolution_m),
                metres(Some(survey.unambiguous_slant_range_m)),
                aperture.unambiguous_range_m.map_or_else(String::new, |m| {
                    format!(", {} between pulses", metres(Some(m)))
                })
            ),
        ),
        (
            "cross-range",
            format!(
                "resolution {} from {} of track; unambiguous {}",
                metres(aperture.cross_range_resolution_m),
                metres(Some(survey.aperture_length_m)),
                metres(survey.unambiguous_cross_range_m)
            ),
        ),
        (
            "half power",
            format!(
                "{} in range, {} in cross-range on the ground; {} and {} under {}",
                metres(survey.half_power.range_m),
                metres(survey.half_power.cross_range_m),
                metres(survey.half_power_windowed.range_m),
                metres(survey.half_power_windowed.cross_range_m),
                Window::default()
            ),
        ),
    ]
}

/// Pulse spacing, and the spacing required by scene and beam.
fn sampling_facts(plan: &RadarPlan) -> Vec<Fact> {
    let (survey, aperture) = (&plan.survey, &plan.aperture);
    let verdict = |sampled: Option<bool>| match sampled {
        Some(true) => ": kept",
        Some(false) => ": NOT kept, Doppler aliases",
        None => "",
    };
    let rate = |need: &subaperture::planner::sampling::Need| {
        need.doppler_band_hz
            .map_or_else(String::new, |hz| format!(", {} or more", text::hertz(hz)))
    };
    let mut facts = vec![
        (
            "pulses",
            format!(
                "every {}{}",
                metres(survey.pulse_spacing_m),
                aperture
                    .prf_hz
                    .map_or_else(String::new, |hz| format!(", {}", text::hertz(hz)))
            ),
        ),
        (
            "scene needs",
            format!(
                "pulses every {}{} for {}{}",
                metres(Some(aperture.scene.spacing_m)),
                rate(&aperture.scene),
                metres(Some(aperture.scene_width_m)),
                verdict(aperture.scene_is_sampled)
            ),
        ),
    ];
    if let Some(beam) = &aperture.beam {
        facts.push((
            "beam needs",
            format!(
                "pulses every {}{}{}; resolves {} at best",
                metres(Some(beam.spacing_m)),
                rate(beam),
                verdict(aperture.beam_is_sampled),
                metres(aperture.beam_resolution_m)
            ),
        ));
    }
    facts
}

/// Sub-CPIs of precise mode and thesis mode.
fn sub_cpi_facts(plan: &RadarPlan) -> Vec<Fact> {
    let sub_cpis = &plan.sub_cpis;
    let mut facts = Vec::new();
    facts.push((
        "sub-CPIs",
        format!(
            "{} of {} pulses, patches of {} by {} pixels, {:.1} dB predicted",
            sub_cpis.precise_count,
            sub_cpis.precise_pulses,
            sub_cpis.patch[1],
            sub_cpis.patch[0],
            sub_cpis.predicted_db
        ),
    ));
    if let Some(clear) = sub_cpis.thesis_clear_pulses {
        facts.push((
            "thesis mode",
            format!("up to {clear} pulses per sub-CPI keep grating lobes outside the scene"),
        ));
    }
    facts
}

/// Signal-to-noise ratios, if the transmit power is given.
fn echo_facts(plan: &RadarPlan) -> Vec<Fact> {
    let mut facts = Vec::new();
    if let Some(sensitivity) = &plan.sensitivity {
        facts.push((
            "1 m² echoes",
            format!(
                "SNR {:.1} dB per sample, {:.1} dB per pulse, {:.1} dB in the image",
                sensitivity.sample_snr_db, sensitivity.pulse_snr_db, sensitivity.image_snr_db
            ),
        ));
        if let Some(sigma0_db) = sensitivity.noise_equivalent_sigma0_db {
            facts.push(("noise equivalent", format!("sigma0 of {sigma0_db:.1} dB")));
        }
    }
    facts
}

/// Table of the grating lobes of thesis mode.
fn lobes_table(sub_cpis: &SubCpis) -> String {
    let rows: Vec<Vec<String>> = sub_cpis
        .thesis_lobes
        .iter()
        .map(|lobe| {
            vec![
                format!("lobe {} at {} pulses", lobe.order, sub_cpis.thesis_pulses),
                metres(Some(lobe.cross_range_m)),
                format!("{:.1}", lobe.level_db),
            ]
        })
        .collect();
    text::table(&["thesis mode", "cross-range", "dB"], &rows)
}

/// Table of the cost of each image former.
fn costs_table(plan: &RadarPlan) -> String {
    // Reference of the last column.
    let of_bp = Backprojection::default().name();
    let bp = plan.costs.iter().find(|cost| cost.algorithm == of_bp);
    let bp = bp.map_or(f64::NAN, |bp| bp.operations);
    let rows: Vec<Vec<String>> = plan
        .costs
        .iter()
        .map(|cost| {
            vec![
                cost.algorithm.clone(),
                format!("{:.1}", cost.planned_db),
                bytes(cost.total_bytes.into()),
                format!("{:.3e}", cost.operations),
                format!("{:.2}", cost.per_pixel_and_pulse),
                format!("{:.3}", cost.operations / bp),
            ]
        })
        .collect();
    let header = [
        "image former",
        "dB planned",
        "memory",
        "operations",
        "per pixel and pulse",
        "relative to bp",
    ];
    text::table(&header, &rows)
}

/// Memory by the formulas of the thesis.
fn thesis_memory(plan: &RadarPlan) -> String {
    let memory = &plan.thesis_memory;
    format!(
        "In float64 as the thesis counts: profile {}, map {}, image {}, range and Doppler {}, line of sight {}",
        bytes(memory.profile_bytes),
        bytes(memory.map_bytes),
        bytes(memory.image_bytes),
        bytes(memory.range_and_doppler_bytes),
        bytes(memory.line_of_sight_bytes)
    )
}
