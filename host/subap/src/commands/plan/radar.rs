//! `subap plan radar`: predicted performance and cost of a collection.

use anyhow::Context;
use subaperture::focus::bp::Backprojection;
use subaperture::focus::{ImageFormer, SCRATCH_BYTES};
use subaperture::io::together::FileSet;
use subaperture::io::written::FileKind;
use subaperture::phase_history::PhaseHistory;
use subaperture::planner::chain::{self, Chain};
use subaperture::planner::{Parameters, RadarPlan, Request, SubCpis};
use subaperture::radar::LinkBudget;
use subaperture::resolution::survey::Survey;
use subaperture::signal::window::Window;

use super::{radar_pictures, signal_chain, speed};
use crate::args::PlanRadar;
use crate::config::{DEFAULT_ERROR_DB, Session};
use crate::messages;
use crate::text::{self, Fact, bytes, metres};

/// Names of the pictures.
const PLOTS: [&str; 2] = ["response.png", "ambiguity.png"];

/// Print the plan of a collection.
pub(crate) fn run(session: &Session, typed: &PlanRadar) -> anyhow::Result<()> {
    if typed.keys {
        return Ok(text::say(chain::reference())?);
    }
    if typed.example {
        return Ok(text::say(chain::example::TEXT)?);
    }
    let chain = typed.chain.as_ref();
    let chain = chain.map(|path| Chain::read_within(path, session.memory_bytes));
    let chain = chain.transpose()?;
    let collection = if typed.input.files.is_empty() {
        parameters(typed, chain.as_ref()).collection()?
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
        chain: chain.as_ref(),
    };
    let planning = session.progress("planning");
    let plan = RadarPlan::new(&collection, &request)?;
    let mut files = FileSet::new();
    if let Some(folder) = &typed.plots {
        let mut claims = session.claims(&typed.writing, &typed.input.files);
        claims.folder(folder, PLOTS)?;
        let response = radar_pictures::response(&collection, &grid, &plan)?;
        let ambiguity = radar_pictures::ambiguity(typed, &plan)?;
        for (name, picture) in PLOTS.iter().zip([response, ambiguity]) {
            files.write_bytes(&folder.join(name), FileKind::Picture, &picture)?;
        }
    }
    let files = files.commit()?;
    planning.finish();
    if let Some(levels) = &plan.chain {
        for warning in levels.warnings() {
            messages::warning(warning);
        }
    }
    if session.json() {
        let mut plan = serde_json::to_value(&plan)?;
        plan["files"] = serde_json::json!(files);
        return text::say_json("radar-plan", plan);
    }
    text::say(to_text(&plan))?;
    Ok(())
}

/// Parameters of Table 4.1, overridden by options. Sweeps of stepped carriers are back to back unless the PRF is given.
fn parameters(typed: &PlanRadar, chain: Option<&Chain>) -> Parameters {
    let (pass, table) = (&typed.pass, Parameters::default());
    let num_frequencies = pass.frequencies.unwrap_or(table.num_frequencies);
    let carrier_s = chain.and_then(|chain| chain.carrier_s);
    let swept_hz = carrier_s.map(|carrier_s| 1.0 / (carrier_s * num_frequencies as f64));
    let mut parameters = Parameters {
        carrier_hz: pass.carrier.unwrap_or(table.carrier_hz),
        bandwidth_hz: pass.bandwidth.unwrap_or(table.bandwidth_hz),
        num_frequencies,
        range_m: pass.range.unwrap_or(table.range_m),
        grazing_rad: pass.grazing.map_or(table.grazing_rad, f64::to_radians),
        velocity_m_s: pass.velocity.unwrap_or(table.velocity_m_s),
        prf_hz: pass.prf.or(swept_hz).unwrap_or(table.prf_hz),
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

fn to_text(plan: &RadarPlan) -> String {
    let mut facts = resolution_facts(plan);
    facts.extend(sampling_facts(plan));
    facts.extend(sub_cpi_facts(plan));
    facts.extend(echo_facts(plan));
    if let Some(sweep) = &plan.sweep {
        facts.extend(speed::facts(sweep, true));
    }
    let mut lines = text::facts(&facts);
    if let Some(levels) = &plan.chain {
        lines.push(String::new());
        lines.extend(signal_chain::tables(levels));
    }
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
