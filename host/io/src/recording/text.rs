//! Text description of echoes, for [`super::RecordingFile`].

use std::fmt::Write;

use glam::{DQuat, DVec3, EulerRot};

use super::earth::FROM_CENTRE_M;
use crate::receive::{EchoCollection, EchoPulse};
use subaperture_model::geometry::{Geodetic, SceneFrame};
use subaperture_model::radar::{Antenna, MountedAntennas, Pattern, PulseShape, Waveform};
use subaperture_model::track::{Fix, SampledTrack, Trajectory};

/// Parameters not contained in the waveform.
pub(super) struct Facts<'a> {
    /// Names of the arrays: samples, times of pulses, times of track positions, transmitter, and receiver if it is separate.
    pub(super) samples: &'a str,
    pub(super) times: &'a str,
    pub(super) track_times: &'a str,
    pub(super) transmitter: &'a str,
    pub(super) receiver: Option<&'a str>,
    /// Whether the radar moves during a sweep.
    pub(super) moves: bool,
    /// Antennas that the text describes.
    pub(super) antennas: Option<&'a MountedAntennas>,
    /// Names of the tables of their patterns.
    pub(super) tables: [&'a str; 2],
}

/// Largest allowed difference between a reference path and its point's, metres: rounding at 1000 km.
const SAME_PATH_M: f64 = 1e-8;

/// Text of the description. Numbers are written with all digits. An error states why the echoes cannot be described.
pub(super) fn describe(collection: &EchoCollection, facts: &Facts) -> Result<String, String> {
    let mut text = format!(
        "name = {}\n\n[recording]\nformat = \"npy\"\nfile = \"{}\"\ntimes = \"{}\"\nphase = \"minus\"\n\n[scene]\n",
        quoted(&collection.name),
        facts.samples,
        facts.times
    );
    text += &reference(collection)?;
    if let Some(extent) = collection.extent {
        for (key, (from, to)) in [("x", extent.x_m), ("y", extent.y_m)] {
            text += &format!("{key} = \"{from}, {to} m\"\n");
        }
    }
    text += &origin(collection.frame)?;
    text += "\n[radar]\n";
    if let Waveform::Pulsed {
        shape: PulseShape::Recorded { .. },
        ..
    } = collection.waveform
    {
        return Err("its pulse is a recorded one, whose samples are not written".to_owned());
    }
    radar(&mut text, &collection.waveform, facts.moves);
    if let Some(carried) = facts.antennas {
        for (i, section) in ["transmitter", "receiver"].into_iter().enumerate() {
            antenna(&mut text, section, &carried.antennas[i], facts.tables[i]);
        }
    }
    text += &format!(
        "\n[platform]\nkind = \"arrays\"\ntimes = \"{}\"\npositions = \"{}\"\n",
        facts.track_times, facts.transmitter
    );
    if let Some(receiver) = facts.receiver {
        text += &format!("receiver_positions = \"{receiver}\"\n");
    }
    // Far from the origin, positions without a statement could be in ECEF.
    let far = |place: DVec3| place.length() >= FROM_CENTRE_M[0];
    if (collection.pulses.iter()).any(|pulse| far(pulse.transmitter_m) || far(pulse.receiver_m)) {
        text += "frame = \"scene\"\n";
    }
    if let Some([roll, pitch, yaw]) = facts.antennas.and_then(attitude) {
        text += &format!("attitude = \"{roll}, {pitch}, {yaw} rad\"\n");
    }
    Ok(text)
}

/// Section of an antenna whose position is given by the track.
fn antenna(text: &mut String, section: &str, antenna: &Antenna, table: &str) {
    let vector = |v: DVec3| format!("{}, {}, {}", v.x, v.y, v.z);
    let (kind, widths) = match antenna.pattern {
        Pattern::Isotropic => ("isotropic", None),
        Pattern::Gaussian {
            azimuth_rad,
            elevation_rad,
        } => ("gaussian", Some([azimuth_rad, elevation_rad])),
        Pattern::Cosine {
            azimuth_rad,
            elevation_rad,
        } => ("cosine", Some([azimuth_rad, elevation_rad])),
        Pattern::Aperture {
            azimuth_rad,
            elevation_rad,
        } => ("aperture", Some([azimuth_rad, elevation_rad])),
        Pattern::Table(_) => ("table", None),
    };
    text.push_str(&format!(
        "\n[[radar.{section}]]\nname = {}\nboresight = \"{}\"\nup = \"{}\"\n",
        quoted(&antenna.name),
        vector(antenna.boresight),
        vector(antenna.up)
    ));
    if let Some(aim_m) = antenna.aim_m {
        text.push_str(&format!("aim = \"{} m\"\n", vector(aim_m)));
    }
    text.push_str(&format!("pattern = \"{kind}\"\n"));
    if let Some([azimuth, elevation]) = widths {
        text.push_str(&format!(
            "azimuth = \"{azimuth} rad\"\nelevation = \"{elevation} rad\"\n"
        ));
    }
    if let Pattern::Table(_) = antenna.pattern {
        text.push_str(&format!("table = \"{table}\"\n"));
    }
}

/// Largest change of an attitude described as constant, relative to the smallest half-power width.
const SAME_ATTITUDE: f64 = 0.01;

/// Constant roll, pitch and yaw of the body, radians; `None` if the body rotates: its attitude is then read as its heading.
fn attitude(carried: &MountedAntennas) -> Option<[f64; 3]> {
    let kept = carried.attitudes.get(carried.attitudes.len() / 2)?[0];
    let tolerance_rad = tolerance_rad(carried);
    let turned = |other: &DQuat| kept.angle_between(*other) > tolerance_rad;
    if carried.attitudes.iter().flatten().any(turned) {
        return None;
    }
    let (yaw, pitch, roll) = kept.to_euler(EulerRot::ZYX);
    Some([roll, pitch, yaw])
}

/// Whether a description can state the attitude of the bodies: it is constant, or the heading of the described track.
pub(super) fn describes_attitude(carried: &MountedAntennas, pulses: &[EchoPulse]) -> bool {
    if attitude(carried).is_some() {
        return true;
    }
    let tolerance_rad = tolerance_rad(carried);
    let heads = |antenna: usize, at_m: fn(&EchoPulse) -> DVec3| {
        let fixes: Vec<Fix> = pulses
            .iter()
            .map(|pulse| Fix {
                time_s: pulse.time_s,
                position_m: at_m(pulse),
                attitude: None,
            })
            .collect();
        SampledTrack::new(&fixes).is_ok_and(|track| {
            let mut pulses = pulses.iter().zip(&carried.attitudes);
            pulses.all(|(pulse, attitudes)| {
                let heading = track.pose(pulse.time_s).attitude;
                heading.angle_between(attitudes[antenna]) <= tolerance_rad
            })
        })
    };
    carried.attitudes.len() == pulses.len()
        && heads(0, |pulse| pulse.transmitter_m)
        && heads(1, |pulse| pulse.receiver_m)
}

/// Largest permitted error of a described attitude, radians.
fn tolerance_rad(carried: &MountedAntennas) -> f64 {
    let narrowest_rad = (carried.antennas.iter())
        .filter_map(Antenna::narrowest_rad)
        .fold(f64::INFINITY, f64::min);
    SAME_ATTITUDE * narrowest_rad
}

/// TOML's basic strings equal JSON's, except for DEL.
fn quoted(text: &str) -> String {
    let json = serde_json::Value::from(text).to_string();
    json.replace('\u{7f}', "\\u007F")
}

/// Reference: one point, or one range for all pulses.
fn reference(collection: &EchoCollection) -> Result<String, String> {
    let Some(first) = collection.pulses.first() else {
        return Err("it has no pulses".to_owned());
    };
    let point = first.reference_m;
    let to_point = collection.pulses.iter().all(|pulse| {
        let path_m = pulse.transmitter_m.distance(point) + pulse.receiver_m.distance(point);
        pulse.reference_m == point && (path_m - pulse.reference_path_m).abs() < SAME_PATH_M
    });
    if to_point {
        let DVec3 { x, y, z } = point;
        return Ok(format!("reference = \"{x}, {y}, {z} m\"\n"));
    }
    let path_m = first.reference_path_m;
    let mut paths = collection.pulses.iter().map(|pulse| pulse.reference_path_m);
    if paths.all(|other_m| other_m == path_m) {
        return Ok(format!("reference_range = \"{} m\"\n", 0.5 * path_m));
    }
    Err("its phases are not referred to one point or one range for all pulses".to_owned())
}

fn origin(frame: SceneFrame) -> Result<String, String> {
    let SceneFrame::Earth { origin_ecf_m, .. } = frame else {
        return Ok(String::new());
    };
    let place = Geodetic::from_ecf_m(origin_ecf_m);
    let [east, north, _] = place.east_north_up();
    let described = SceneFrame::Earth {
        origin_ecf_m: place.to_ecf_m(),
        x_axis_ecf: east,
        y_axis_ecf: north,
    };
    if !described.agrees_with(&frame) {
        return Err("its scene's x and y axes do not point east and north".to_owned());
    }
    Ok(format!(
        "\n[scene.origin]\nlatitude = \"{} deg\"\nlongitude = \"{} deg\"\nheight = \"{} m\"\n",
        place.latitude_deg, place.longitude_deg, place.height_m
    ))
}

fn radar(text: &mut String, waveform: &Waveform, moves: bool) {
    let kind = match waveform {
        Waveform::Fmcw { .. } => "fmcw",
        Waveform::Pulsed { .. } => "pulsed",
        Waveform::Ideal { .. } | Waveform::Stepped { .. } => "stepped",
    };
    // Writing to a string cannot fail.
    let _ = writeln!(text, "kind = \"{kind}\"");
    let mut line = |key: &str, value: f64, unit: &str| {
        let _ = writeln!(text, "{key} = \"{value} {unit}\"");
    };
    match waveform {
        Waveform::Fmcw {
            start_hz,
            chirp_hz_s,
            sample_rate_hz,
            mixer_delay_s,
            ..
        } => {
            line("start", *start_hz, "Hz");
            line("slope", *chirp_hz_s, "Hz/s");
            line("sample_rate", *sample_rate_hz, "Hz");
            line("mixer_delay", *mixer_delay_s, "s");
        }
        Waveform::Pulsed {
            centre_hz,
            sample_rate_hz,
            window_start_s,
            ..
        } => {
            line("centre", *centre_hz, "Hz");
            line("sample_rate", *sample_rate_hz, "Hz");
            line("window_start", *window_start_s, "s");
        }
        Waveform::Ideal { band } => {
            line("start", band.start_hz, "Hz");
            line("step", band.step_hz, "Hz");
        }
        Waveform::Stepped { band, step_s, .. } => {
            line("start", band.start_hz, "Hz");
            line("step", band.step_hz, "Hz");
            line("step_time", *step_s, "s");
        }
    }
    if moves {
        text.push_str("motion = \"true\"\n");
    }
    if let Waveform::Pulsed { shape, .. } = waveform {
        pulse(text, shape);
    }
}

fn pulse(text: &mut String, shape: &PulseShape) {
    text.push_str("\n[radar.pulse]\n");
    match shape {
        PulseShape::Recorded { .. } => {}
        PulseShape::Lfm {
            bandwidth_hz,
            duration_s,
            rising,
        } => {
            let sweep = if *rising { "up" } else { "down" };
            text.push_str(&format!(
                "kind = \"lfm\"\nbandwidth = \"{bandwidth_hz} Hz\"\nduration = \"{duration_s} s\"\nsweep = \"{sweep}\"\n"
            ));
        }
        PulseShape::PhaseCode { phases_rad, chip_s } => {
            let phases: Vec<String> = phases_rad.iter().map(|p| format!("\"{p} rad\"")).collect();
            text.push_str(&format!(
                "kind = \"code\"\nchip = \"{chip_s} s\"\nphases = [{}]\n",
                phases.join(", ")
            ));
        }
    }
}
