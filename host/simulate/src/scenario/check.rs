//! Consistency checks of a scenario: timing, receive window and track of the radar against the scene.
//!
//! The geometry is checked at up to 257 pulses, the first and last among them, for every antenna.

use glam::DVec3;

use crate::experiment::Experiment;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::quantity::{hertz, metres};
use subaperture_model::radar::{Radar, Reference, Waveform};
use subaperture_model::track::Trajectory;

use super::error::Fault;
use super::keys::{PlatformKeys, PlatformMotion, ScenarioKeys};
use subaperture_describe::radar::{RadarKeys, WaveformKeys, transmission_s};

/// Number of intervals between checked pulses.
const CHECKED_PULSES: usize = 256;

/// Largest distance of the radar from the scene's origin, metres: there float64 still resolves 1e-7 m.
const FARTHEST_M: f64 = 1e9;

/// Antenna positions at one pulse.
struct Snapshot {
    pulse: usize,
    transmitters_m: Vec<DVec3>,
    receivers_m: Vec<DVec3>,
}

impl Snapshot {
    fn antennas_m(&self) -> impl Iterator<Item = DVec3> {
        self.transmitters_m.iter().chain(&self.receivers_m).copied()
    }

    /// Smallest and largest delay of the reference over all antenna pairs, seconds.
    fn reference_delays_s(&self, reference: Reference) -> (f64, f64) {
        let point = match reference {
            Reference::Range(range_m) => {
                let delay_s = 2.0 * range_m / SPEED_OF_LIGHT_M_S;
                return (delay_s, delay_s);
            }
            Reference::Point(point) => point,
        };
        let ends = |antennas: &[DVec3]| {
            let ranges = antennas.iter().map(|antenna| antenna.distance(point));
            ranges.fold((f64::INFINITY, 0.0f64), |(least, most), range| {
                (least.min(range), most.max(range))
            })
        };
        let (out, back) = (ends(&self.transmitters_m), ends(&self.receivers_m));
        (
            (out.0 + back.0) / SPEED_OF_LIGHT_M_S,
            (out.1 + back.1) / SPEED_OF_LIGHT_M_S,
        )
    }
}

fn snapshot(radar: &Radar, track: &dyn Trajectory, pulse: usize) -> Snapshot {
    let pose = track.pose(radar.start_s + pulse as f64 * radar.pri_s);
    let places = |antennas: &[subaperture_model::radar::Antenna]| {
        let offsets = antennas.iter().map(|antenna| antenna.offset_m);
        offsets.map(|offset| pose.point_m(offset)).collect()
    };
    Snapshot {
        pulse,
        transmitters_m: places(&radar.transmitters),
        receivers_m: places(&radar.receivers),
    }
}

fn snapshots(radar: &Radar, track: &dyn Trajectory) -> Vec<Snapshot> {
    let last = radar.num_pulses - 1;
    let count = last.min(CHECKED_PULSES);
    (0..=count)
        .map(|i| snapshot(radar, track, (i * last).checked_div(count).unwrap_or(0)))
        .collect()
}

/// Place a receive window without a given start so that the reference's echo of the middle pulse is in its middle.
pub(super) fn place_window(radar: &mut Radar, track: &dyn Trajectory, reference: Reference) {
    let middle = snapshot(radar, track, radar.num_pulses / 2);
    let (least, most) = middle.reference_delays_s(reference);
    if let Waveform::Pulsed {
        sample_rate_hz,
        num_samples,
        window_start_s,
        shape,
        ..
    } = &mut radar.waveform
        && window_start_s.is_infinite()
    {
        let echo_middle_s = (least + most + shape.duration_s()) / 2.0;
        *window_start_s = (echo_middle_s - *num_samples as f64 / *sample_rate_hz / 2.0).max(0.0);
    }
}

/// All inconsistencies, the first of each kind.
pub(super) fn check(top: &ScenarioKeys, experiment: &Experiment) -> Vec<Fault> {
    let (keys, platform) = (&top.radar, &top.platform);
    let radar = &experiment.radar;
    let mut faults = Vec::new();
    let taken_s = transmission_s(&radar.waveform);
    if taken_s > radar.pri_s * (1.0 + 1e-9) {
        let key = match keys.prf_hz.is_some() {
            true => keys.prf_hz.at(),
            false => keys.pri_s.at(),
        };
        faults.push(Fault::new(
            key,
            format!(
                "the pulse repetition interval of {} is shorter than a pulse of {}: lengthen pri or shorten the pulse",
                time(radar.pri_s),
                time(taken_s)
            ),
        ));
    }
    if radar.num_pulses < radar.transmitters.len() {
        faults.push(keys.pulses.fault(format!(
            "{} transmitters alternate over {} pulses, so that some never transmit: raise pulses",
            radar.transmitters.len(),
            radar.num_pulses
        )));
    }
    let looks = snapshots(radar, &*experiment.track);
    let far = |look: &&Snapshot| {
        look.antennas_m()
            .any(|a| a.length().is_nan() || a.length() > FARTHEST_M)
    };
    if let Some(look) = looks.iter().find(far) {
        faults.push(Fault::new(
            &platform.header,
            format!(
                "at pulse {} the radar is more than 1e9 m from the scene: shorten its track",
                look.pulse
            ),
        ));
        return faults;
    }
    faults.extend(window(keys, experiment, &looks));
    faults.extend(inside(platform, experiment, &looks));
    faults.extend(aperture(platform, experiment, &looks));
    faults
}

/// Check that the receive window or the sampled beat frequencies contain the reference.
fn window(keys: &RadarKeys, experiment: &Experiment, looks: &[Snapshot]) -> Option<Fault> {
    let delays = looks
        .iter()
        .map(|look| (look.pulse, look.reference_delays_s(experiment.reference)));
    for (pulse, (least_s, most_s)) in delays {
        match &experiment.radar.waveform {
            Waveform::Pulsed {
                sample_rate_hz,
                num_samples,
                window_start_s,
                shape,
                ..
            } => {
                let end_s = window_start_s + *num_samples as f64 / sample_rate_hz;
                let echo_end_s = most_s + shape.duration_s();
                let slack_s = 1e-9 * echo_end_s;
                if least_s < window_start_s - slack_s || echo_end_s > end_s + slack_s {
                    let missed = format!(
                        "in pulse {pulse} the reference's echo extends from {} to {}, but the receive \
                                                window only from {} to {}",
                        time(least_s),
                        time(echo_end_s),
                        time(*window_start_s),
                        time(end_s)
                    );
                    let middle = looks[looks.len() / 2].reference_delays_s(experiment.reference);
                    let middle_is_seen = middle.0 >= window_start_s - slack_s
                        && middle.1 + shape.duration_s() <= end_s + slack_s;
                    return Some(match (&travel(experiment, looks), middle_is_seen) {
                        // The radar travels too far; the window itself is well placed.
                        (Some(travel), true) => keys.pulses.fault(format!("{missed}: {travel}")),
                        _ => Fault::new(
                            match &keys.window_start_s {
                                Some(window_start_s) => window_start_s.at(),
                                None => keys.samples.at(),
                            },
                            format!("{missed}: move or lengthen the window"),
                        ),
                    });
                }
            }
            Waveform::Fmcw {
                chirp_hz_s,
                sample_rate_hz,
                mixer_delay_s,
                ..
            } => {
                let late_s = (least_s - mixer_delay_s)
                    .abs()
                    .max((most_s - mixer_delay_s).abs());
                let beat_hz = chirp_hz_s.abs() * late_s;
                if let WaveformKeys::Fmcw(fmcw) = &keys.kind
                    && beat_hz > sample_rate_hz / 2.0
                {
                    return Some(fmcw.sample_rate_hz.fault(
                        format!(
                            "in pulse {pulse} the reference's beat frequency is {}, beyond half the sample rate: \
                             raise it, sweep slower or set mixer_delay to about {}",
                            hertz(beat_hz),
                            time(least_s)
                        ),
                    ));
                }
            }
            Waveform::Ideal { .. } | Waveform::Stepped { .. } => return None,
        }
    }
    None
}

/// Distance travelled by the radar during its pulses, with advice, as a message; `None` if it does not move.
fn travel(experiment: &Experiment, looks: &[Snapshot]) -> Option<String> {
    let antenna = |look: &Snapshot| look.antennas_m().next();
    let ends = |pair: &[Snapshot]| Some(antenna(&pair[0])?.distance(antenna(&pair[1])?));
    let travel_m: f64 = looks.windows(2).filter_map(ends).sum();
    (travel_m > 0.0).then(|| {
        let num_pulses = experiment.radar.num_pulses;
        format!(
            "over {num_pulses} pulses the radar travels {}; use fewer pulses, or lengthen the window (samples)",
            metres(travel_m)
        )
    })
}

/// Check that the radar is outside of the scene.
fn inside(platform: &PlatformKeys, experiment: &Experiment, looks: &[Snapshot]) -> Option<Fault> {
    let wavelength_m = SPEED_OF_LIGHT_M_S / experiment.radar.waveform.centre_hz();
    let (point, ground_m) = match experiment.reference {
        Reference::Point(point) => (Some(point), point.z),
        Reference::Range(_) => (None, 0.0),
    };
    let within = |antenna: DVec3| {
        let at_point = point.is_some_and(|point| antenna.distance(point) < wavelength_m);
        let in_extent = experiment.extent.is_some_and(|extent| {
            (extent.x_m.0..=extent.x_m.1).contains(&antenna.x)
                && (extent.y_m.0..=extent.y_m.1).contains(&antenna.y)
                && (antenna.z - ground_m).abs() < wavelength_m
        });
        at_point || in_extent
    };
    let look = looks.iter().find(|look| look.antennas_m().any(within))?;
    let antenna = look.antennas_m().find(|&antenna| within(antenna))?;
    Some(Fault::new(
        &platform.header,
        format!(
            "at pulse {} the radar is inside the scene, at {:.3}, {:.3}, {:.3} m: move the platform out \
             of [scene] x and y and away from the reference",
            look.pulse, antenna.x, antenna.y, antenna.z
        ),
    ))
}

/// Check that radar or scene move, so that there is an aperture.
fn aperture(platform: &PlatformKeys, experiment: &Experiment, looks: &[Snapshot]) -> Option<Fault> {
    let still = looks.iter().all(|look| {
        look.antennas_m()
            .zip(looks[0].antennas_m())
            .all(|(now, first)| now.distance(first) < 1e-9)
    });
    let meant = matches!(platform.kind, PlatformMotion::Fixed { .. });
    let sees_motion = !experiment.scene.movers.is_empty();
    (still && !meant && !sees_motion && looks.len() > 1).then(|| {
        Fault::new(
            &platform.header,
            "the radar does not move from the first pulse to the last, so there is no aperture: give it \
             speed, or set kind = \"fixed\" for a stationary radar",
        )
    })
}

/// Time in a suitable unit.
fn time(seconds: f64) -> String {
    let (factor, unit) = match seconds.abs() {
        s if s >= 1.0 => (1.0, "s"),
        s if s >= 1e-3 => (1e3, "ms"),
        s if s >= 1e-6 => (1e6, "us"),
        _ => (1e9, "ns"),
    };
    format!("{:.6} {unit}", seconds * factor)
}
