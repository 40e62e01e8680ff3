//! Conversion of a collection to vectors of a CPHD channel: all checks, and all numbers of the file except the
//! samples.

use glam::DVec3;

use super::conventions::Domain;
use super::pvp::{Record, record_bytes};
use super::reference_geometry;
use super::toa::Bins;
use super::write_options::WriteError;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::{Extent, SceneFrame};
use subaperture_model::phase_history::{Collection, Pulse};
use subaperture_signal::fast_length::fast_length;

/// Fraction of the unambiguous delay `1 / SCSS` within which the default scene lies.
const SWATH: f64 = 0.8;

/// Largest fraction of the unambiguous delay between TOA1 and TOA2. The standard requires an oversampling of at least
/// 1.1, and recommends 1.2.
const LARGEST_SWATH: f64 = 0.833;

/// Minimum oversampling of TOA samples.
const TOA_OVERSAMPLING: f64 = 1.25;

/// Minimum deviation in metres of a reference path from that through the reference point for which the SRP is moved.
/// Above the rounding of ECF positions, far below any wavelength.
const PATH_TOLERANCE_M: f64 = 2e-8;

/// Channel ready to be described and written.
pub(super) struct Prepared {
    pub(super) records: Vec<Record>,
    /// Samples per vector as stored.
    pub(super) stored_samples: usize,
    pub(super) bins: Bins,
    pub(super) bistatic: bool,
    /// Index of the reference vector.
    pub(super) reference: usize,
    /// Whether all pulses refer to one point of the scene.
    pub(super) spotlight: bool,
    pub(super) extent: Extent,
}

impl Prepared {
    /// `truth` are the true positions of the antennas, if they are to be written.
    pub(super) fn new(
        collection: &Collection,
        truth: Option<&[[DVec3; 2]]>,
        domain: Domain,
    ) -> Result<Self, WriteError> {
        let name = &collection.name;
        let unsuited = |what: String| WriteError::Unsuited(format!("{name}: {what}"));
        let pulses = &collection.pulses;
        let num_samples = collection.num_samples;
        if pulses.is_empty() || num_samples == 0 {
            return Err(unsuited(format!(
                "{} pulses of {num_samples} samples: expected at least one sample",
                pulses.len()
            )));
        }
        check_frame(&collection.frame).map_err(unsuited)?;
        check_pulses(pulses).map_err(unsuited)?;
        check_truth(pulses, truth).map_err(unsuited)?;
        let stored_samples = match domain {
            Domain::Fx => num_samples,
            Domain::Toa => fast_length((num_samples as f64 * TOA_OVERSAMPLING).ceil() as usize),
        };
        let bins = Bins::of_count(num_samples);
        let largest_step_hz = pulses.iter().fold(0.0, |a: f64, p| a.max(p.step_hz));
        let extent = match collection.extent {
            Some(extent) => check_area(extent).map_err(unsuited)?,
            None => covered_square(0.5 * SWATH / largest_step_hz, pulses),
        };
        let mut records = Vec::with_capacity(pulses.len());
        for (index, pulse) in pulses.iter().enumerate() {
            let reference_m = reference_point(index, pulse).map_err(unsuited)?;
            let ecf = |position| collection.frame.to_ecf_m(position);
            let (tx_pos, rcv_pos) = (ecf(pulse.transmitter_m), ecf(pulse.receiver_m));
            let srp_pos = ecf(reference_m);
            let path_m = (tx_pos - srp_pos).length() + (rcv_pos - srp_pos).length();
            let [toa1, toa2] = recorded_toa(pulse);
            let axis = sample_axis(pulse, num_samples, stored_samples, domain);
            records.push(Record {
                tx_time: pulse.time_s,
                tx_pos,
                tx_vel: DVec3::ZERO,
                rcv_time: pulse.time_s + path_m / SPEED_OF_LIGHT_M_S,
                rcv_pos,
                rcv_vel: DVec3::ZERO,
                srp_pos,
                a_fdop: 0.0,
                a_frr2: 2.0 * pulse.sweep.sample_s / (SPEED_OF_LIGHT_M_S * pulse.step_hz),
                fx1: axis.fx1,
                fx2: axis.fx2,
                toa1,
                toa2,
                sc0: axis.sc0,
                scss: axis.scss,
                true_antennas: truth.map(|truth| truth[index].map(ecf)),
            });
        }
        set_velocities(&mut records, pulses, &collection.frame);
        let bistatic = !reference_geometry::is_monostatic(&records);
        Ok(Self {
            stored_samples,
            bins,
            bistatic,
            reference: reference_geometry::choose(&records, bistatic),
            spotlight: pulses
                .iter()
                .all(|p| p.reference_m == pulses[0].reference_m),
            extent,
            records,
        })
    }

    /// Whether records have true positions.
    pub(super) fn with_truth(&self) -> bool {
        self.records[0].true_antennas.is_some()
    }

    /// Length of the PVP array.
    pub(super) fn pvp_bytes(&self) -> u64 {
        self.records.len() as u64 * record_bytes(self.with_truth())
    }

    /// Smallest and largest of a parameter over the vectors.
    pub(super) fn range(&self, parameter: impl Fn(&Record) -> f64) -> (f64, f64) {
        self.records
            .iter()
            .map(parameter)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
                (low.min(v), high.max(v))
            })
    }

    /// Centre and duration of the interval in which the scene is illuminated.
    pub(super) fn dwell(&self) -> (f64, f64) {
        let first = self.records[0].reference_time();
        let last = self.records[self.records.len() - 1].reference_time();
        (0.5 * (first + last), (last - first).max(0.0))
    }

    pub(super) fn srp_fixed(&self) -> bool {
        let first = self.records[0].srp_pos;
        self.records.iter().all(|r| r.srp_pos == first)
    }
}

/// TOA1 and TOA2 of a pulse: the interval of its recorded paths, shortened about its middle to the largest swath that
/// the standard permits.
fn recorded_toa(pulse: &Pulse) -> [f64; 2] {
    let half = 0.5 * LARGEST_SWATH / pulse.step_hz;
    let Some(paths_m) = pulse.recorded_path_m else {
        return [-half, half];
    };
    let toa = paths_m.map(|path_m| (path_m - pulse.reference_path_m) / SPEED_OF_LIGHT_M_S);
    let middle = 0.5 * (toa[0] + toa[1]);
    [toa[0].max(middle - half), toa[1].min(middle + half)]
}

/// Square within the circle that a swath up to `toa2` covers at any aspect angle, around the mean reference point.
fn covered_square(toa2: f64, pulses: &[Pulse]) -> Extent {
    let half_m = toa2 * SPEED_OF_LIGHT_M_S / 2.0 / std::f64::consts::SQRT_2;
    let first_m = pulses[0].reference_m;
    let apart = pulses.iter().map(|pulse| pulse.reference_m - first_m);
    let middle_m = first_m + apart.sum::<DVec3>() / pulses.len() as f64;
    let around = |middle: f64| (middle - half_m, middle + half_m);
    Extent {
        x_m: around(middle_m.x),
        y_m: around(middle_m.y),
    }
}

/// Scene point that pulse `index` is compensated to. An error if a CPHD vector cannot represent it.
fn reference_point(index: usize, pulse: &Pulse) -> Result<DVec3, String> {
    let reference_m = compensated_point(pulse).ok_or_else(|| {
        format!(
            "pulse {index} is compensated to a path of {:?} m, which no point near its \
             reference point has: compensate it to a point of the scene",
            pulse.reference_path_m
        )
    })?;
    if !pulse.sweep.is_at_once() && pulse.sweep.reference_m_s != Some(DVec3::ZERO) {
        return Err(format!(
            "the antennas move from sample to sample of pulse {index}, and its phases do not follow a \
             stationary reference point, as required by CPHD: refer them to a point"
        ));
    }
    Ok(reference_m)
}

fn check_frame(frame: &SceneFrame) -> Result<(), String> {
    let SceneFrame::Earth {
        origin_ecf_m,
        x_axis_ecf,
        y_axis_ecf,
    } = frame
    else {
        return Err(
            "its scene frame is local, and CPHD holds positions on the Earth: give the collection \
             an Earth frame (an origin and two axes in ECF) first"
                .to_owned(),
        );
    };
    // Conditions that the reader requires of a file.
    let unit = |v: &DVec3| (v.length() - 1.0).abs() <= 1e-6;
    if !(unit(x_axis_ecf) && unit(y_axis_ecf) && x_axis_ecf.dot(*y_axis_ecf).abs() <= 1e-6) {
        return Err(format!(
            "the axes {x_axis_ecf} and {y_axis_ecf} of its scene frame are not orthogonal unit \
             vectors"
        ));
    }
    if !(origin_ecf_m.is_finite() && origin_ecf_m.length() > 1e6) {
        return Err(format!(
            "the origin {origin_ecf_m} of its scene frame is not a place near the Earth's surface"
        ));
    }
    Ok(())
}

fn check_pulses(pulses: &[Pulse]) -> Result<(), String> {
    let mut before = f64::NEG_INFINITY;
    for (index, p) in pulses.iter().enumerate() {
        let finite = [
            ("time_s", p.time_s.is_finite()),
            ("transmitter_m", p.transmitter_m.is_finite()),
            ("receiver_m", p.receiver_m.is_finite()),
            ("reference_m", p.reference_m.is_finite()),
            ("reference_path_m", p.reference_path_m.is_finite()),
            ("start_hz", p.start_hz.is_finite() && p.start_hz > 0.0),
            ("step_hz", p.step_hz.is_finite() && p.step_hz > 0.0),
        ];
        if let Some((field, _)) = finite.iter().find(|(_, ok)| !ok) {
            return Err(format!(
                "pulse {index}: {field} is not finite, or a frequency not positive"
            ));
        }
        if p.time_s < 0.0 {
            return Err(format!(
                "pulse {index}: its time is {:?} s; CPHD counts from the start of the collection, \
                 so times cannot be negative",
                p.time_s
            ));
        }
        if p.time_s <= before {
            return Err(format!(
                "pulse {index}: its time {:?} s is not after {before:?} s of the one before; CPHD \
                 wants pulses in the order of time",
                p.time_s
            ));
        }
        before = p.time_s;
    }
    Ok(())
}

fn check_truth(pulses: &[Pulse], truth: Option<&[[DVec3; 2]]>) -> Result<(), String> {
    let Some(truth) = truth else { return Ok(()) };
    let finite = |antennas: &[DVec3; 2]| antennas.iter().all(|p| p.is_finite());
    if truth.len() == pulses.len() && truth.iter().all(finite) {
        return Ok(());
    }
    Err(format!(
        "the true positions of {} pulses are {}, or not all finite",
        pulses.len(),
        truth.len()
    ))
}

fn check_area(extent: Extent) -> Result<Extent, String> {
    let rising = |(low, high): (f64, f64)| low.is_finite() && high.is_finite() && low < high;
    if rising(extent.x_m) && rising(extent.y_m) {
        Ok(extent)
    } else {
        Err(format!("its extent {extent:?} is empty or not finite"))
    }
}

/// Point that a pulse is compensated to: its reference point, or a point on the bisector through it whose path is
/// `reference_path_m`, since CPHD has no path apart from the SRP's. Newton's method; the path is convex along the
/// line, and linear if transmitter and receiver coincide.
fn compensated_point(pulse: &Pulse) -> Option<DVec3> {
    let mut point = pulse.reference_m;
    let mut outward = None;
    for _ in 0..50 {
        let (tx, rcv) = (point - pulse.transmitter_m, point - pulse.receiver_m);
        if tx.length() < 1e-6 || rcv.length() < 1e-6 {
            return None; // at an antenna: no direction, no slant range
        }
        let excess_m = pulse.relative_path_m(point);
        if excess_m.abs() <= PATH_TOLERANCE_M {
            return Some(point);
        }
        let gradient = tx.normalize() + rcv.normalize();
        let along: DVec3 = *outward.get_or_insert(gradient.try_normalize()?);
        let slope = gradient.dot(along);
        if slope < 1e-3 {
            return None; // between the antennas, where no path is shorter
        }
        point -= along * (excess_m / slope);
    }
    None
}

/// Frequencies and sample axis of one vector.
struct SampleAxis {
    fx1: f64,
    fx2: f64,
    sc0: f64,
    scss: f64,
}

fn sample_axis(pulse: &Pulse, count: usize, stored: usize, domain: Domain) -> SampleAxis {
    match domain {
        // The band is that of the samples. A single sample counts as a band of one step.
        Domain::Fx => SampleAxis {
            fx1: pulse.start_hz,
            fx2: pulse.frequency_hz((count - 1).max(1)),
            sc0: pulse.start_hz,
            scss: pulse.step_hz,
        },
        // A band of `count` steps around the sample `count / 2`, and a window of one period of the
        // delay around the SRP's: see `toa`.
        Domain::Toa => {
            let centre = pulse.frequency_hz(count / 2);
            let half = 0.5 * count as f64 * pulse.step_hz;
            let scss = 1.0 / (stored as f64 * pulse.step_hz);
            SampleAxis {
                fx1: centre - half,
                fx2: centre + half,
                sc0: -((stored / 2) as f64) * scss,
                scss,
            }
        }
    }
}

/// Set the velocities: those of sweeps if given, otherwise central differences of the positions (one-sided at the
/// ends). Set aFDOP from them. A single vector without a sweep has zero velocity.
fn set_velocities(records: &mut [Record], pulses: &[Pulse], frame: &SceneFrame) {
    let last = records.len() - 1;
    let slope = |p: fn(&Record) -> (f64, DVec3), a: &Record, b: &Record| {
        let ((t0, p0), (t1, p1)) = (p(a), p(b));
        if t1 > t0 {
            (p1 - p0) / (t1 - t0)
        } else {
            DVec3::ZERO // receive times that do not rise: far apart paths, refused by checkers
        }
    };
    for i in 0..=last {
        let (before, after) = (records[i.saturating_sub(1)], records[(i + 1).min(last)]);
        let record = &mut records[i];
        let sweep = &pulses[i].sweep;
        if sweep.sample_s == 0.0 {
            record.tx_vel = slope(|r| (r.tx_time, r.tx_pos), &before, &after);
            record.rcv_vel = slope(|r| (r.rcv_time, r.rcv_pos), &before, &after);
        } else {
            record.tx_vel = frame.direction_to_ecf(sweep.transmitter_m_s);
            record.rcv_vel = frame.direction_to_ecf(sweep.receiver_m_s);
        }
        let range_rate = |position: DVec3, velocity: DVec3| {
            (position - record.srp_pos)
                .normalize_or_zero()
                .dot(velocity)
        };
        let mean = 0.5
            * (range_rate(record.tx_pos, record.tx_vel)
                + range_rate(record.rcv_pos, record.rcv_vel));
        record.a_fdop = -2.0 / SPEED_OF_LIGHT_M_S * mean;
    }
}
