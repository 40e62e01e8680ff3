//! `subap info`: what recordings hold.

mod stored;

use std::fmt::Write;
use std::path::PathBuf;

use anyhow::Context;
use serde_json::{Value, json};
use subaperture::focus::rdbp::{Plan, Request};
use subaperture::io::cphd::CphdInfo;
use subaperture::io::open::cphd_info;
use subaperture::phase_history::{PhaseHistory, TrackError};
use subaperture::resolution::survey::{DefaultGrid, Side, Survey, Widths};
use subaperture::signal::window::Window;

use crate::args::Info;
use crate::config::Session;
use crate::failure::Usage;
use crate::text::{self, Fact, bytes, degrees, hertz, metres};
use stored::Kind;

/// Prints the survey of the inputs as one aperture.
pub(crate) fn run(session: &Session, typed: &Info) -> anyhow::Result<()> {
    let kinds = typed.input.paths.iter().map(|path| (path, Kind::of(path)));
    let kinds: Vec<(&PathBuf, Kind)> = kinds.collect();
    if kinds.iter().any(|(_, kind)| *kind != Kind::Recording) {
        return of_stored(session, &kinds);
    }
    let history = session.open(&typed.input)?;
    let survey = match typed.at {
        None => Survey::of(history.collection()),
        Some(place_m) => Survey::at(history.collection(), place_m),
    };
    let survey = survey.context("the input holds no pulses")?;
    let advice = Advice::of(session, &history, &survey);
    let track_error = TrackError::of(&history);
    let containers = containers(&typed.input.paths)?;
    if session.json() {
        let mut value = serde_json::to_value(&survey)?;
        value["sub_cpi_advice"] = advice.to_json();
        value["track_error"] = serde_json::to_value(track_error)?;
        value["ambiguity"] = json!(survey.ambiguity());
        value["containers"] = containers.iter().map(Container::to_json).collect();
        value["default_grid"] = match survey.default_grid() {
            Ok(DefaultGrid { grid, cropped }) => json!({
                "x": grid.columns, "y": grid.rows, "z": grid.origin_m.z, "cropped": cropped
            }),
            Err(why) => json!({ "none": why.to_string() }),
        };
        text::say_json("info", value)?;
    } else {
        let files: String = containers.iter().map(Container::describe).collect();
        let mut report = files + &describe(session, &survey, &advice);
        if let Some(error) = track_error {
            let _ = writeln!(
                report,
                "{:<16} held by the file; positions recorded are {} RMS and {} at most off it",
                "true track",
                text::metres(Some(error.rms_m)),
                text::metres(Some(error.max_m))
            );
        }
        text::say(report)?;
    }
    Ok(())
}

/// Images and maps, one after the other.
fn of_stored(session: &Session, paths: &[(&PathBuf, Kind)]) -> anyhow::Result<()> {
    if let Some((path, _)) = paths.iter().find(|(_, kind)| *kind == Kind::Recording) {
        return Err(Usage(format!(
            "{} is a recording, and others are images or maps: ask for them apart",
            path.display()
        ))
        .into());
    }
    let found: Vec<stored::Description> = paths
        .iter()
        .map(|(path, kind)| stored::describe(path, *kind))
        .collect::<anyhow::Result<_>>()?;
    if session.json() {
        let stored: Vec<&Value> = found.iter().map(|found| &found.json).collect();
        return text::say_json("info-stored", json!({ "stored": stored }));
    }
    let texts: Vec<&str> = found.iter().map(|found| found.text.as_str()).collect();
    text::say(texts.join("\n"))?;
    Ok(())
}

/// A file that says more of itself than its pulses do.
struct Container {
    path: PathBuf,
    info: CphdInfo,
}

fn containers(paths: &[PathBuf]) -> anyhow::Result<Vec<Container>> {
    let mut containers = Vec::new();
    for path in paths {
        if let Some(info) = cphd_info(path)? {
            containers.push(Container {
                path: path.clone(),
                info,
            });
        }
    }
    Ok(containers)
}

impl Container {
    fn describe(&self) -> String {
        let info = &self.info;
        let mut text = format!(
            "{:<16} CPHD {}, {} domain, SGN {}, {}\n",
            self.path.display(),
            info.version,
            info.domain,
            info.sgn,
            info.classification
                .as_deref()
                .unwrap_or("classification not given"),
        );
        for channel in &info.channels {
            let reference = if channel.id == info.ref_channel {
                " (reference)"
            } else {
                ""
            };
            let _ = writeln!(
                text,
                "{:<16} {}: {} vectors of {} samples{reference}",
                "  channel", channel.id, channel.num_vectors, channel.num_samples
            );
        }
        text
    }

    fn to_json(&self) -> Value {
        let info = &self.info;
        json!({
            "path": self.path.to_string_lossy(),
            "format": format!("CPHD {}", info.version),
            "domain": info.domain.to_string(),
            "sgn": info.sgn.to_string(),
            "classification": info.classification,
            "collector": info.collector_name,
            "collection_start": info.collection_start,
            "reference_channel": info.ref_channel,
            "channels": info.channels.iter().map(|channel| json!({
                "id": channel.id,
                "vectors": channel.num_vectors,
                "samples": channel.num_samples,
            })).collect::<Vec<_>>(),
        })
    }
}

/// Error bound that sub-CPIs are planned for, dB.
const BOUND_DB: f64 = -60.0;

/// The longest sub-CPIs that serve, in either mode of range-Doppler backprojection.
struct Advice {
    /// Sub-CPI and patch that the planner takes in precise mode.
    precise: Option<Planned>,
    /// Longest sub-CPI whose first grating lobes lie outside the declared extent, thesis mode.
    thesis_pulses: Option<usize>,
    /// Cross-range distance of the first grating lobe, thesis mode, times pulses a sub-CPI.
    grating_lobe_m: Option<f64>,
}

/// What the planner of range-Doppler backprojection chose for the default grid.
struct Planned {
    pulses: usize,
    patch_m: [f64; 2],
    predicted_db: f64,
}

impl Planned {
    fn of(session: &Session, history: &dyn PhaseHistory, survey: &Survey) -> Option<Self> {
        let grid = survey.default_grid().ok()?.grid;
        let request = Request {
            error_db: BOUND_DB,
            sub_cpi: None,
            patch_m: None,
            memory_bytes: session.memory_bytes / 2,
        };
        let plan = Plan::new(history.collection(), &grid, &request).ok()?;
        Some(Self {
            pulses: plan.sub_cpi_length,
            patch_m: [
                plan.patch.columns as f64 * grid.columns.step,
                plan.patch.rows as f64 * grid.rows.step,
            ],
            predicted_db: plan.predicted_db,
        })
    }
}

impl Advice {
    fn of(session: &Session, history: &dyn PhaseHistory, survey: &Survey) -> Self {
        let thesis_pulses = survey.declared_extent_m.and_then(|[x_m, y_m]| {
            let (x, y) = (x_m.1 - x_m.0, y_m.1 - y_m.0);
            // The scene's width across the line of sight, corner to corner at the worst.
            let turn = survey.azimuth_deg.to_radians();
            let width_m = x * turn.sin().abs() + y * turn.cos().abs();
            let pulses = (survey.unambiguous_cross_range_m? / width_m).floor() as usize;
            Some(pulses.clamp(1, survey.num_pulses))
        });
        Self {
            precise: Planned::of(session, history, survey),
            thesis_pulses,
            grating_lobe_m: survey.grating_lobe_m(1),
        }
    }

    fn to_json(&self) -> Value {
        json!({
            "precise": self.precise.as_ref().map(|plan| json!({
                "error_bound_db": BOUND_DB,
                "predicted_error_db": plan.predicted_db,
                "pulses": plan.pulses,
                "patch_m": plan.patch_m,
            })),
            "thesis": {
                "first_grating_lobe_m_times_pulses": self.grating_lobe_m,
                "longest_outside_declared_extent": self.thesis_pulses,
            },
        })
    }
}

fn describe(session: &Session, survey: &Survey, advice: &Advice) -> String {
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

/// What can be told apart, and how large a scene is unambiguous.
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

/// Aperture, times and where the antenna is.
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

/// The grid that an image is formed on unless another is given.
fn default_grid(session: &Session, survey: &Survey) -> String {
    match survey.default_grid() {
        Ok(DefaultGrid { grid, cropped }) => {
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
                cropped.map_or_else(String::new, |why| format!("\n{:17}{why}", ""))
            )
        }
        Err(why) => why.to_string(),
    }
}

/// The sub-CPIs of the precise mode.
fn precise(advice: &Advice) -> String {
    match &advice.precise {
        Some(plan) => format!(
            "{} pulses on patches of {} by {}: {:.1} dB predicted, {BOUND_DB} dB asked",
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
        "; it differs from pulse to pulse"
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
        None => "no side of a track",
    };
    let squint = match survey.squint_deg {
        Some(squint_deg) => format!("squint {}", degrees(squint_deg)),
        None => "squint none".to_owned(),
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
        return "none: there is no cross-range to have grating lobes in".to_owned();
    };
    let longest = match advice.thesis_pulses {
        Some(pulses) => format!("; outside the declared extent up to {pulses} pulses"),
        None => String::new(),
    };
    format!(
        "first grating lobe {} / pulses away in cross-range, {} at 40 pulses{longest}",
        metres(Some(one_m)),
        metres(Some(forty_m))
    )
}
