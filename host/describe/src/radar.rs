//! Radar from `[radar]`.

use std::f64::consts::PI;

use subaperture_model::phase_history::Band;
use subaperture_model::quantity::{hertz, seconds};
use subaperture_model::radar::{Antenna, Motion, Pattern, PulseShape, Radar, Waveform};

use crate::error::Fault;
use crate::receiver;
use crate::values::Values;

/// Build a radar. A pulsed radar without `window_start` gets an infinite window start, which the caller sets once the
/// antennas' track is known. The error contains all faults.
pub fn build(values: &Values) -> Result<Radar, Vec<Fault>> {
    let mut faults = Vec::new();
    let mut keep = |found: Fault| faults.push(found);
    let pri_s = pri_s(values).map_err(&mut keep).ok();
    let waveform = waveform(values).map_err(&mut keep).ok();
    let transmitters = antennas(values, "transmitter", "T").map_err(&mut keep).ok();
    let receivers = antennas(values, "receiver", "R").map_err(&mut keep).ok();
    let receiver = receiver::build(values).map_err(&mut keep).ok();
    let (start_s, motion, spreading) = (
        values.number("first_pulse"),
        match values.text("motion") {
            "true" => Motion::True,
            _ => Motion::StopAndGo,
        },
        values.flag("spreading"),
    );
    match (pri_s, waveform, transmitters, receivers, receiver) {
        (Some(pri_s), Some(waveform), Some(transmitters), Some(receivers), Some(receiver)) => {
            Ok(Radar {
                waveform,
                num_pulses: values.count("pulses") as usize,
                pri_s,
                start_s,
                transmitters,
                receivers,
                motion,
                spreading,
                receiver,
            })
        }
        _ => Err(faults),
    }
}

/// Pulse repetition interval from `pri` or `prf`, seconds.
pub fn pri_s(values: &Values) -> Result<f64, Fault> {
    match (values.optional_number("pri"), values.optional_number("prf")) {
        (Some(pri_s), None) => Ok(pri_s),
        (None, Some(prf_hz)) => Ok(1.0 / prf_hz),
        (Some(_), Some(_)) => Err(values.fault("prf", "give either pri or prf, not both")),
        (None, None) => Err(values.fault(
            "pri",
            "[radar] needs 'pri', the pulse repetition interval, or 'prf': write for example pri = \"1 ms\"",
        )),
    }
}

/// Longest record of one pulse, seconds: far beyond real radars, and short enough for phases in float64.
const LONGEST_RECORD_S: f64 = 1e3;

fn waveform(values: &Values) -> Result<Waveform, Fault> {
    let centre_hz = values.number("centre");
    let count = values.count("samples") as usize;
    match values.text("kind") {
        "ideal" => Ok(Waveform::Ideal {
            band: band(values, centre_hz, count)?,
        }),
        "stepped" => stepped(values, centre_hz, count),
        "fmcw" => fmcw(values, centre_hz, count),
        _ => pulsed(values, centre_hz, count),
    }
}

fn stepped(values: &Values, centre_hz: f64, count: usize) -> Result<Waveform, Fault> {
    let step_s = values.number("step_time");
    let dwell_s = values.optional_number("dwell").unwrap_or(step_s);
    if dwell_s > step_s * (1.0 + 1e-9) {
        return Err(values.fault("dwell", "dwell is longer than step_time: shorten it"));
    }
    Ok(Waveform::Stepped {
        band: band(values, centre_hz, count)?,
        step_s,
        dwell_s,
    })
}

fn fmcw(values: &Values, centre_hz: f64, count: usize) -> Result<Waveform, Fault> {
    let bandwidth_hz = bandwidth_hz(values, centre_hz)?;
    let sample_rate_hz = values.number("sample_rate");
    let duration_s = sampled_s(values, sample_rate_hz, count)?;
    let direction = if values.text("sweep") == "down" {
        -1.0
    } else {
        1.0
    };
    Ok(Waveform::Fmcw {
        start_hz: centre_hz - direction * bandwidth_hz / 2.0,
        chirp_hz_s: direction * bandwidth_hz / duration_s,
        sample_rate_hz,
        num_samples: count,
        mixer_delay_s: values.number("mixer_delay"),
    })
}

fn pulsed(values: &Values, centre_hz: f64, count: usize) -> Result<Waveform, Fault> {
    let sample_rate_hz = values.number("sample_rate");
    sampled_s(values, sample_rate_hz, count)?;
    if sample_rate_hz >= 2.0 * centre_hz {
        return Err(values.fault(
            "sample_rate",
            "the sampled band extends below 0 Hz: choose a rate below twice the centre frequency",
        ));
    }
    Ok(Waveform::Pulsed {
        centre_hz,
        sample_rate_hz,
        num_samples: count,
        window_start_s: values
            .optional_number("window_start")
            .unwrap_or(f64::INFINITY),
        shape: shape(values.section("pulse"), sample_rate_hz)?,
    })
}

/// Bandwidth, checked to have no frequencies below 0; hertz.
fn bandwidth_hz(values: &Values, centre_hz: f64) -> Result<f64, Fault> {
    let bandwidth_hz = values.number("bandwidth");
    if bandwidth_hz >= 2.0 * centre_hz {
        return Err(values.fault(
            "bandwidth",
            "the band extends below 0 Hz: choose a bandwidth below twice the centre frequency",
        ));
    }
    Ok(bandwidth_hz)
}

/// Band of `count` frequencies about the centre.
fn band(values: &Values, centre_hz: f64, count: usize) -> Result<Band, Fault> {
    let step_hz = bandwidth_hz(values, centre_hz)? / count as f64;
    Ok(Band {
        start_hz: centre_hz - (count / 2) as f64 * step_hz,
        step_hz,
        count,
    })
}

/// Duration of `count` samples, checked against the maximum; seconds.
fn sampled_s(values: &Values, rate_hz: f64, count: usize) -> Result<f64, Fault> {
    let duration_s = count as f64 / rate_hz;
    if duration_s > LONGEST_RECORD_S {
        return Err(values.fault(
            "sample_rate",
            format!(
                "{count} samples last {}: raise the rate",
                seconds(duration_s)
            ),
        ));
    }
    Ok(duration_s)
}

/// Barker codes: the sign of each chip.
const BARKER: [(&str, &str); 7] = [
    ("barker-2", "+-"),
    ("barker-3", "++-"),
    ("barker-4", "++-+"),
    ("barker-5", "+++-+"),
    ("barker-7", "+++--+-"),
    ("barker-11", "+++---+--+-"),
    ("barker-13", "+++++--++-+-+"),
];

/// Pulse shape from `[radar.pulse]`, sampled at `sample_rate_hz`.
///
/// # Errors
/// The first invalid or inconsistent value, at its key.
pub fn shape(values: &Values, sample_rate_hz: f64) -> Result<PulseShape, Fault> {
    if values.text("kind") == "lfm" {
        let bandwidth_hz = values.number("bandwidth");
        let duration_s = values.number("duration");
        let rising = values.text("sweep") == "up";
        if bandwidth_hz > sample_rate_hz {
            return Err(values.fault(
                "bandwidth",
                format!(
                    "the pulse's bandwidth exceeds the sample rate of {}: lower it, or raise \
                                        [radar] sample_rate",
                    hertz(sample_rate_hz)
                ),
            ));
        }
        if bandwidth_hz * duration_s < 1.0 {
            return Err(values.fault(
                "duration",
                "the time-bandwidth product is below 1, too small for a chirp: lengthen the pulse",
            ));
        }
        return Ok(PulseShape::Lfm {
            bandwidth_hz,
            duration_s,
            rising,
        });
    }
    let chip_s = values.number("chip");
    let named = values.optional_text("code");
    let listed = values.optional_rows("phases");
    let phases_rad = match (named, listed) {
        (Some(name), None) => {
            let signs = BARKER.iter().find(|(known, _)| *known == name);
            let signs = signs.map_or("", |&(_, signs)| signs);
            signs
                .chars()
                .map(|sign| if sign == '+' { 0.0 } else { PI })
                .collect()
        }
        (None, Some(rows)) => rows.iter().map(|row| row[0]).collect(),
        (Some(_), Some(_)) => {
            return Err(values.fault("phases", "give either code or phases, not both"));
        }
        (None, None) => {
            return Err(values.fault(
                "code",
                "[radar.pulse] needs 'code' or 'phases': write for example code = \"barker-13\"",
            ));
        }
    };
    if chip_s * sample_rate_hz < 1.0 - 1e-9 {
        return Err(values.fault(
            "chip",
            format!(
                "the chip is shorter than a sample of {:.6} ns: lengthen it or raise [radar] sample_rate",
                1e9 / sample_rate_hz
            ),
        ));
    }
    Ok(PulseShape::PhaseCode { phases_rad, chip_s })
}

/// Antennas of a section (`transmitter` or `receiver`); a single isotropic antenna at the body's origin if there is no
/// section. Names default to `letter` and a number.
pub fn antennas(values: &Values, section: &str, letter: &str) -> Result<Vec<Antenna>, Fault> {
    let given = values.sections(section);
    if given.is_empty() {
        return Ok(vec![Antenna {
            name: format!("{letter}1"),
            offset_m: glam::DVec3::ZERO,
            boresight: glam::DVec3::Y,
            up: glam::DVec3::Z,
            pattern: Pattern::Isotropic,
        }]);
    }
    let antennas = given.iter().enumerate();
    antennas
        .map(|(i, values)| antenna(values, format!("{letter}{}", i + 1)))
        .collect()
}

fn antenna(values: &Values, name: String) -> Result<Antenna, Fault> {
    let boresight = values.direction("boresight")?;
    let up = values.direction("up")?;
    let across = up - boresight * up.dot(boresight);
    // Directions less than a thousandth of a degree apart do not define an elevation axis.
    if across.length() < 2e-5 {
        return Err(values.fault(
            "up",
            "up is parallel to boresight, so the beam has no elevation axis: change one of them",
        ));
    }
    let name = values.optional_text("name").map_or(name, str::to_owned);
    let offset_m = values.vector("offset");
    let widths = || (values.number("azimuth"), values.number("elevation"));
    let pattern = match values.text("pattern") {
        "gaussian" => {
            let (azimuth_rad, elevation_rad) = widths();
            Pattern::Gaussian {
                azimuth_rad,
                elevation_rad,
            }
        }
        "aperture" => {
            let (azimuth_rad, elevation_rad) = widths();
            Pattern::Aperture {
                azimuth_rad,
                elevation_rad,
            }
        }
        _ => Pattern::Isotropic,
    };
    Ok(Antenna {
        name,
        offset_m,
        boresight,
        up: across.normalize(),
        pattern,
    })
}

/// Duration of the transmission of one pulse, seconds; 0 for an ideal waveform.
pub fn transmission_s(waveform: &Waveform) -> f64 {
    match waveform {
        Waveform::Ideal { .. } => 0.0,
        Waveform::Pulsed { shape, .. } => shape.duration_s(),
        Waveform::Fmcw {
            sample_rate_hz,
            num_samples,
            ..
        } => *num_samples as f64 / sample_rate_hz,
        Waveform::Stepped { band, step_s, .. } => band.count as f64 * step_s,
    }
}
