//! Description of a recording's capabilities as text lines.

use subaperture::resolution::survey::{DefaultGrid, Side, Survey, Widths};
use subaperture::signal::window::Window;

use super::advice::{Advice, BOUND_DB};
use crate::config::{OTHER_GRID, Session};
use crate::text::{self, Fact, bytes, degrees, hertz, metres};

/// Format the description of a surveyed recording.
pub(super) fn describe(session: &Session, survey: &Survey, advice: &Advice) -> String {
    let mut facts = band_facts(survey);
    facts.extend(resolution_facts(survey));
    facts.extend(geometry_facts(survey));
    facts.push(("default grid", default_grid(session, survey)));
    facts.push(("sub-CPI, precise", precise(advice)));
    facts.push(("sub-CPI, thesis", thesis(survey, advice)));
    text::facts(&facts).join("\n") + "\n"
}

fn band_facts(survey: &Survey) -> Vec<Fact> {
    let mut facts = Vec::new();
    facts.push(("collection", survey.name.clone()));
    let samples_bytes = survey.num_pulses as u128 * survey.num_samples as u128 * 8;
    facts.push((
        "size",
        format!(
            "{} pulses of {} frequencies, {} as complex64",
            survey.num_pulses,
            survey.num_samples,
            bytes(samples_bytes)
        ),
    ));
    facts.push(("band", band(survey)));
    facts.push(("wavelength", metres(Some(survey.wavelength_m))));
    facts
}

/// Resolution, and unambiguous extent.
fn resolution_facts(survey: &Survey) -> Vec<Fact> {
    let mut facts = Vec::new();
    facts.push((
        "resolution",
        format!(
            "{} in slant range; in the plane {} in range, {} in cross-range (Rayleigh's; no window, no beam)",
            metres(Some(survey.slant_range_resolution_m)),
            metres(survey.range_resolution_m),
            metres(survey.cross_range_resolution_m),
        ),
    ));
    let widths = |widths: &Widths| {
        format!(
            "{} in slant range; in the plane {} in range, {} in cross-range",
            metres(widths.slant_range_m),
            metres(widths.range_m),
            metres(widths.cross_range_m)
        )
    };
    facts.push((
        "half power",
        format!("{} without windows", widths(&survey.half_power)),
    ));
    facts.push((
        "",
        format!(
            "{} under {}",
            widths(&survey.half_power_windowed),
            Window::default()
        ),
    ));
    let [x, y, z] = survey.scene_centre_m;
    if (x, y, z) != (0.0, 0.0, 0.0) {
        facts.push(("", format!("seen from x {x:.3} m, y {y:.3} m, z {z:.3} m")));
    }
    facts.push((
        "unambiguous",
        format!(
            "{} in slant range; in the plane {} in range, {} in cross-range",
            metres(Some(survey.unambiguous_slant_range_m)),
            metres(survey.unambiguous_range_m),
            metres(survey.unambiguous_cross_range_m),
        ),
    ));
    if let Some(ambiguity) = survey.ambiguity() {
        facts.push(("", ambiguity));
    }
    facts
}

/// Aperture, timing and position of the antenna.
fn geometry_facts(survey: &Survey) -> Vec<Fact> {
    let mut facts = Vec::new();
    facts.push((
        "aperture",
        format!(
            "{} long, {:.3} deg wide, {:.3} deg of azimuth",
            metres(Some(survey.aperture_length_m)),
            survey.aperture_angle_deg,
            survey.aperture_azimuth_deg
        ),
    ));
    facts.push(("pulse spacing", metres(survey.pulse_spacing_m)));
    facts.push((
        "timing",
        match (survey.pri_s, survey.duration_s) {
            (Some(pri_s), Some(duration_s)) => {
                format!("PRI {:.4} ms, {duration_s:.4} s in all", pri_s * 1e3)
            }
            _ => "unknown".to_owned(),
        },
    ));
    facts.push((
        "geometry",
        format!(
            "slant range {}, grazing angle {}, antenna at {} from x towards y",
            metres(Some(survey.slant_range_m)),
            degrees(survey.grazing_angle_deg),
            degrees(survey.azimuth_deg)
        ),
    ));
    facts.push(("looking", looking(survey)));
    facts.push((
        "scene frame",
        match survey.origin {
            Some(origin) => format!(
                "origin at {:.6} deg north, {:.6} deg east, {:.1} m above WGS 84",
                origin.latitude_deg, origin.longitude_deg, origin.height_m
            ),
            None => "the recording's own axes, not tied to the Earth".to_owned(),
        },
    ));
    facts
}

/// Default grid of an image.
fn default_grid(session: &Session, survey: &Survey) -> String {
    match survey.default_grid() {
        Ok(DefaultGrid { grid, cropped, .. }) => {
            let (x, y) = (grid.columns, grid.rows);
            let image_bytes = u128::from(grid.num_pixels()) * 8;
            let fits = image_bytes <= u128::from(session.memory_bytes);
            format!(
                "x={:.6}:{:.6}:{},y={:.6}:{:.6}:{},z=0 ({} x {} pixels, {}{}){}",
                x.start,
                x.at(x.count),
                x.step,
                y.start,
                y.at(y.count),
                y.step,
                x.count,
                y.count,
                bytes(image_bytes),
                if fits {
                    ""
                } else {
                    ", more than --memory allows"
                },
                cropped.map_or_else(String::new, |why| format!("\n{:17}{why}: {OTHER_GRID}", ""))
            )
        }
        Err(why) => why.to_string(),
    }
}

/// Sub-CPI of precise mode.
fn precise(advice: &Advice) -> String {
    match &advice.precise {
        Some(plan) => format!(
            "{} pulses on patches of {} by {}: {:.1} dB predicted, bound {BOUND_DB} dB",
            plan.pulses,
            metres(Some(plan.patch_m[0])),
            metres(Some(plan.patch_m[1])),
            plan.predicted_db
        ),
        None => "none: there is no default grid to plan for".to_owned(),
    }
}

fn band(survey: &Survey) -> String {
    let shared = if survey.band_is_shared {
        ""
    } else {
        "; varies between pulses"
    };
    format!(
        "{} to {}, {} in steps of {}{shared}",
        hertz(survey.lowest_hz),
        hertz(survey.highest_hz),
        hertz(survey.bandwidth_hz),
        hertz(survey.step_hz),
    )
}

fn looking(survey: &Survey) -> String {
    let side = match survey.side {
        Some(Side::Left) => "left of the track",
        Some(Side::Right) => "right of the track",
        None => "no side (no straight track)",
    };
    let squint = match survey.squint_deg {
        Some(squint_deg) => format!("squint {}", degrees(squint_deg)),
        None => "no squint".to_owned(),
    };
    let bistatic = if survey.bistatic_angle_deg > 1e-6 {
        format!(", bistatic angle {:.3} deg", survey.bistatic_angle_deg)
    } else {
        ", monostatic".to_owned()
    };
    format!("{side}, {squint}{bistatic}")
}

fn thesis(survey: &Survey, advice: &Advice) -> String {
    let (Some(one_m), Some(forty_m)) = (survey.grating_lobe_m(1), survey.grating_lobe_m(40)) else {
        return "none: the recording has no cross-range resolution".to_owned();
    };
    let longest = match advice.thesis_pulses {
        Some(pulses) => format!("; outside the declared extent for up to {pulses} pulses"),
        None => String::new(),
    };
    format!(
        "first grating lobe {} / pulses away in cross-range, {} at 40 pulses{longest}",
        metres(Some(one_m)),
        metres(Some(forty_m))
    )
}
