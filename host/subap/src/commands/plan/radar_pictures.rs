//! Pictures of `subap plan radar`: response of the thesis mode, ambiguity function of the pulse.

use anyhow::Context;
use glam::DVec3;
use num_complex::Complex32;
use subaperture::geometry::{Axis, ImageGrid};
use subaperture::image::Image;
use subaperture::phase_history::Collection;
use subaperture::planner::RadarPlan;
use subaperture::planner::ambiguity::{Around, MAX_CELLS};
use subaperture::planner::grating::PointResponse;
use subaperture::plot::{Colours, HeatMap, Panel, Scale, heat, quicklook};
use subaperture::radar::PulseShape;

use crate::args::PlanRadar;
use crate::text;

/// Number of pixels along a side of the picture.
const PICTURE: usize = 401;
/// Default pulse length, seconds.
const DEFAULT_PULSE_S: f64 = 10e-6;

/// Draw `response.png`: response of thesis mode to a scatterer at the centre of `grid`.
pub(super) fn response(
    collection: &Collection,
    grid: &ImageGrid,
    plan: &RadarPlan,
) -> anyhow::Result<Vec<u8>> {
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
pub(super) fn ambiguity(typed: &PlanRadar, plan: &RadarPlan) -> anyhow::Result<Vec<u8>> {
    let shape = &pulse(typed, plan);
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
        PulseShape::Recorded { .. } => "recorded pulse",
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
