//! Division of the aperture into sub-CPIs, and their linear path models.
//!
//! Over a sub-CPI of `M` pulses the path to a point, relative to that of a nearby centre, is approximated by
//! a straight line in slow time,
//!
//! ```text
//! path_m(p) - path_m(centre) = a(p) + b(p) u_m,   u_m = m - (M - 1) / 2
//! ```
//!
//! The line is determined at two nodes, `u = -u_g` and `u = +u_g` with `u_g^2 = mean(u_m^2) =
//! (M^2 - 1) / 12`. For a path that is quadratic in slow time, that line is the least-squares one (the
//! nodes are those of Gauss's rule for uniformly weighted pulses). The remainder has
//! no mean and no slope and is 3.5 dB below that of a Taylor expansion about the centre, which the
//! thesis uses (Schone 2020, (2.18)). The antenna positions at the nodes come from a quadratic fit to all
//! positions of the sub-CPI, so the jitter of a measured track is averaged (S 4.2). For a single pulse with intra-pulse
//! motion, the nodes are those of the sweep, `K kappa / sqrt(12)` before and after its middle.

use std::ops::Range;

use glam::DVec3;

use super::{FormError, Reason, Remedy};
use subaperture_kernels::lanes::Instructions;
use subaperture_kernels::paths::{self, Antennas, Line, Points};
use subaperture_model::phase_history::{Band, Collection, Pulse};

/// Steps of Newton's method in [`SubCpi::locate`]: each doubles the correct digits.
const NEWTON_STEPS: usize = 8;

/// Step of the numerical derivative in metres.
const NEWTON_STEP_M: f64 = 0.01;

/// Largest remaining error of a located point in metres of path.
const CLOSE_M: f64 = 1e-6;

/// Block of pulses processed as one range-Doppler map.
#[derive(Clone, Debug, PartialEq)]
pub struct SubCpi {
    /// Range of the pulse indices.
    pub pulses: Range<usize>,
    nodes: [Node; 2],
    half_spacing: f64,
}

/// Antenna positions at one node of the fitted track.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Node {
    transmitter_m: DVec3,
    receiver_m: DVec3,
    monostatic: bool,
}

impl Node {
    fn path_m(&self, point: DVec3) -> f64 {
        let out_m = (point - self.transmitter_m).length();
        if self.monostatic {
            2.0 * out_m
        } else {
            out_m + (point - self.receiver_m).length()
        }
    }
}

/// Paths from the two nodes to a patch centre, the reference of `a` and `b`.
#[derive(Clone, Copy, Debug)]
pub struct Datum([f64; 2]);

impl SubCpi {
    /// Fit the track over `pulses` (at least one).
    pub fn new(collection: &Collection, pulses: Range<usize>) -> Self {
        let track = &collection.pulses[pulses.clone()];
        let monostatic = track.iter().all(|p| p.transmitter_m == p.receiver_m);
        let transmitter = QuadraticFit::new(track, |p| p.transmitter_m);
        let receiver = QuadraticFit::new(track, |p| p.receiver_m);
        let m = track.len() as f64;
        let half_spacing = ((m * m - 1.0) / 12.0).sqrt();
        let node = |u: f64| Node {
            transmitter_m: transmitter.at(u),
            receiver_m: receiver.at(u),
            monostatic,
        };
        if let ([pulse], false) = (track, track[0].sweep.is_at_once()) {
            let half_samples = collection.num_samples as f64 / 12f64.sqrt();
            let node = |after: f64| {
                let [transmitter_m, receiver_m] = pulse.antennas_after_m(after);
                Node {
                    transmitter_m,
                    receiver_m,
                    monostatic: monostatic && transmitter_m == receiver_m,
                }
            };
            let steps = Steps::of(collection);
            let half_spacing = half_samples * steps.pulses_a_sample();
            let nodes = [node(-half_samples), node(half_samples)];
            let moved_m = (nodes[0].transmitter_m.distance(nodes[1].transmitter_m))
                .max(nodes[0].receiver_m.distance(nodes[1].receiver_m));
            // A sweep unrelated to the track has no rate in pulses; its residual error is measured.
            if moved_m > FOREIGN * 2.0 * half_spacing.abs() * steps.rms_m() {
                return Self {
                    pulses,
                    nodes: [node(0.0); 2],
                    half_spacing: 0.0,
                };
            }
            return Self {
                pulses,
                nodes,
                half_spacing,
            };
        }
        Self {
            pulses,
            nodes: [node(-half_spacing), node(half_spacing)],
            half_spacing,
        }
    }

    /// Make the model from transmitter and receiver at the early and late node of a sub-CPI of `num_pulses`, at least one.
    pub fn from_nodes(num_pulses: usize, nodes: [[DVec3; 2]; 2]) -> Self {
        let m = num_pulses as f64;
        let node = |[transmitter_m, receiver_m]: [DVec3; 2]| Node {
            transmitter_m,
            receiver_m,
            monostatic: transmitter_m == receiver_m,
        };
        Self {
            pulses: 0..num_pulses,
            nodes: nodes.map(node),
            half_spacing: ((m * m - 1.0) / 12.0).sqrt(),
        }
    }

    /// Number of pulses in the sub-CPI.
    pub fn num_pulses(&self) -> usize {
        self.pulses.len()
    }

    /// Reference paths of a patch with this centre.
    pub fn datum(&self, centre: DVec3) -> Datum {
        Datum(self.nodes.map(|node| node.path_m(centre)))
    }

    /// Path offsets `a`, metres, and rates `b`, metres per pulse, of many points.
    pub(super) fn lines(
        &self,
        instructions: Instructions,
        datum: &Datum,
        points: &Points,
        lines: &mut [Line],
    ) {
        let node = |i: usize| Antennas {
            transmitter_m: self.nodes[i].transmitter_m.to_array(),
            receiver_m: self.nodes[i].receiver_m.to_array(),
            datum_m: datum.0[i],
        };
        let between = 2.0 * self.half_spacing;
        paths::lines(instructions, &[node(0), node(1)], between, points, lines);
    }

    /// Path offset `a`, metres, and rate `b`, metres per pulse, of a point.
    pub fn line(&self, datum: &Datum, point: DVec3) -> (f64, f64) {
        self.line_through(self.nodes.map(|node| node.path_m(point)), datum.0)
    }

    /// Whole path in the middle, metres, and its rate, metres per pulse, of one point.
    pub fn path_and_rate(&self, point: DVec3) -> (f64, f64) {
        self.line_through(self.nodes.map(|node| node.path_m(point)), [0.0; 2])
    }

    /// Point of the plane through `start` along `axes` with this path in the middle, metres, and this path rate, metres per pulse, by
    /// Newton's method from `start`. `None` if there is no such point near it.
    pub fn locate(&self, start: DVec3, axes: [DVec3; 2], path_m: f64, rate: f64) -> Option<DVec3> {
        let datum = self.datum(start);
        let (start_path_m, start_rate) = self.path_and_rate(start);
        let wanted = (path_m - start_path_m, rate - start_rate);
        let mut point = start;
        for _ in 0..NEWTON_STEPS {
            let (a, b) = self.line(&datum, point);
            let slopes = axes.map(|axis| {
                let (ahead, behind) = (
                    self.line(&datum, point + axis * NEWTON_STEP_M),
                    self.line(&datum, point - axis * NEWTON_STEP_M),
                );
                let slope = |ahead: f64, behind: f64| (ahead - behind) / (2.0 * NEWTON_STEP_M);
                [slope(ahead.0, behind.0), slope(ahead.1, behind.1)]
            });
            let [[ax, bx], [ay, by]] = slopes;
            let (da, db) = (wanted.0 - a, wanted.1 - b);
            let determinant = ax * by - ay * bx;
            let step = [
                (da * by - ay * db) / determinant,
                (ax * db - da * bx) / determinant,
            ];
            point += axes[0] * step[0] + axes[1] * step[1];
            if !point.is_finite() {
                return None;
            }
        }
        let (a, _) = self.line(&datum, point);
        ((a - wanted.0).abs() <= CLOSE_M).then_some(point)
    }

    fn line_through(&self, paths_m: [f64; 2], datum_m: [f64; 2]) -> (f64, f64) {
        let early = paths_m[0] - datum_m[0];
        let late = paths_m[1] - datum_m[1];
        let rate = if self.half_spacing != 0.0 {
            (late - early) / (2.0 * self.half_spacing)
        } else {
            0.0
        };
        ((early + late) / 2.0, rate)
    }
}

/// Least-squares quadratic through positions at `u_m`, on orthogonal polynomials
/// `1, u, u^2 - mean(u^2)`.
struct QuadraticFit {
    coefficients: [DVec3; 3],
    mean_square: f64,
}

impl QuadraticFit {
    fn new(track: &[Pulse], position: impl Fn(&Pulse) -> DVec3) -> Self {
        let m = track.len() as f64;
        let mean_square = (m * m - 1.0) / 12.0;
        // Positions are relative to one of them, to keep digits far from the origin.
        let origin = position(&track[0]);
        let mut sums = [DVec3::ZERO; 3];
        let mut norms = [0.0; 3];
        for (i, pulse) in track.iter().enumerate() {
            let u = i as f64 - (m - 1.0) / 2.0;
            for (j, p) in [1.0, u, u * u - mean_square].into_iter().enumerate() {
                sums[j] += (position(pulse) - origin) * p;
                norms[j] += p * p;
            }
        }
        let mut coefficients = [DVec3::ZERO; 3];
        for j in 0..track.len().min(3) {
            coefficients[j] = sums[j] / norms[j];
        }
        coefficients[0] += origin;
        Self {
            coefficients,
            mean_square,
        }
    }

    fn at(&self, u: f64) -> DVec3 {
        let [c0, c1, c2] = self.coefficients;
        c0 + c1 * u + c2 * (u * u - self.mean_square)
    }
}

/// Position and velocity of the antennas at the centre of a block of pulses from the same fit, for
/// the thesis mode. Velocities are in metres per pulse.
pub(super) struct CentreState {
    /// Position and velocity of the transmitter.
    pub transmitter: (DVec3, DVec3),
    /// Position and velocity of the receiver.
    pub receiver: (DVec3, DVec3),
    /// Reference path, metres, and its rate, metres per pulse.
    pub reference_path: (f64, f64),
}

impl CentreState {
    /// Fit the track over `pulses` (at least one).
    pub(super) fn new(collection: &Collection, pulses: Range<usize>) -> Self {
        let track = &collection.pulses[pulses];
        let state = |position: &dyn Fn(&Pulse) -> DVec3| {
            let fit = QuadraticFit::new(track, position);
            (fit.at(0.0), fit.coefficients[1])
        };
        let reference = state(&|p| DVec3::new(p.reference_path_m, 0.0, 0.0));
        Self {
            transmitter: state(&|p| p.transmitter_m),
            receiver: state(&|p| p.receiver_m),
            reference_path: (reference.0.x, reference.1.x),
        }
    }

    /// Path of `point` relative to the reference, metres, and its rate, metres per pulse
    /// (Schone 2020, (5.1): the velocity projected on the line of sight).
    pub(super) fn path_and_rate(&self, point: DVec3) -> (f64, f64) {
        let leg = |(position, velocity): (DVec3, DVec3)| {
            let sight = position - point;
            let range = sight.length();
            // A point at the antenna position has no direction, and no rate.
            let rate = if range > 0.0 {
                sight.dot(velocity) / range
            } else {
                0.0
            };
            (range, rate)
        };
        let (out, back) = (leg(self.transmitter), leg(self.receiver));
        (
            out.0 + back.0 - self.reference_path.0,
            out.1 + back.1 - self.reference_path.1,
        )
    }
}

/// Divide `num_pulses` into sub-CPIs of `length` pulses that do not extend across any of `breaks` (indices of first
/// pulses after a gap). Remaining pulses form a shorter last sub-CPI, so every pulse is used.
pub fn cut(num_pulses: usize, breaks: &[usize], length: usize) -> Vec<Range<usize>> {
    let mut ranges = Vec::new();
    let ends = breaks.iter().copied().chain([num_pulses]);
    let mut start = 0;
    for end in ends {
        while start < end {
            let stop = (start + length.max(1)).min(end);
            ranges.push(start..stop);
            start = stop;
        }
    }
    ranges
}

/// Ratio `kappa` of the antenna motion from sample to sample to that from pulse to pulse, by least
/// squares over all steps that are not gaps; 0 for antennas at rest.
pub fn pulses_a_sample(collection: &Collection) -> f64 {
    Steps::of(collection).pulses_a_sample()
}

/// Largest ratio of sweep motion to its share of the track for which the two count as related.
const FOREIGN: f64 = 8.0;

/// Sums over steps between pulses without gaps: intra-pulse motion along them, and their squares, m^2.
struct Steps {
    product: f64,
    square: f64,
    count: usize,
}

impl Steps {
    fn of(collection: &Collection) -> Self {
        let gaps = breaks(collection);
        let (mut product, mut square, mut count) = (0.0, 0.0, 0);
        for (pair, n) in collection.pulses.windows(2).zip(1..) {
            if gaps.binary_search(&n).is_ok() {
                continue;
            }
            let [a, b] = [&pair[0], &pair[1]];
            let mut add = |step_m: DVec3, early: DVec3, late: DVec3| {
                let sample_m = 0.5 * (early * a.sweep.sample_s + late * b.sweep.sample_s);
                product += sample_m.dot(step_m);
                square += step_m.length_squared();
                count += 1;
            };
            add(
                b.transmitter_m - a.transmitter_m,
                a.sweep.transmitter_m_s,
                b.sweep.transmitter_m_s,
            );
            add(
                b.receiver_m - a.receiver_m,
                a.sweep.receiver_m_s,
                b.sweep.receiver_m_s,
            );
        }
        Self {
            product,
            square,
            count,
        }
    }

    fn pulses_a_sample(&self) -> f64 {
        match self.square > 0.0 {
            true => self.product / self.square,
            false => 0.0,
        }
    }

    /// RMS step of one antenna, metres.
    fn rms_m(&self) -> f64 {
        (self.square / self.count.max(1) as f64).sqrt()
    }
}

/// Indices of pulses whose antenna step from the preceding pulse exceeds five times the median
/// step: gaps in the track, and joints between recordings. Jitter is smaller, and smaller
/// gaps are handled by the plan, which shortens the affected sub-CPIs.
pub fn breaks(collection: &Collection) -> Vec<usize> {
    let pulses = &collection.pulses;
    let steps = |position: fn(&Pulse) -> DVec3| -> Vec<f64> {
        pulses
            .windows(2)
            .map(|pair| position(&pair[0]).distance(position(&pair[1])))
            .collect()
    };
    let mut breaks = Vec::new();
    for steps in [steps(|p| p.transmitter_m), steps(|p| p.receiver_m)] {
        let mut sorted = steps.clone();
        sorted.sort_by(f64::total_cmp);
        let Some(&median) = sorted.get(sorted.len() / 2) else {
            continue;
        };
        let far = steps
            .iter()
            .zip(1..)
            .filter(|&(&step, _)| step > 5.0 * median);
        breaks.extend(far.map(|(_, n)| n));
    }
    breaks.sort_unstable();
    breaks.dedup();
    breaks
}

/// Doppler bins per cycle per pulse, for sub-CPIs of duration `duration_pulses`: twice Nyquist's at the highest
/// frequency, where Doppler is scaled most.
pub fn bins_per_cycle(band: &Band, duration_pulses: f64) -> f64 {
    let highest = band.frequency_hz(band.count - 1) / band.centre_hz();
    2.0 * duration_pulses * highest.max(1.0)
}

/// Frequency axis common to all pulses, which both modes require.
pub fn shared_band(collection: &Collection) -> Result<Band, FormError> {
    collection.band().ok_or_else(|| {
        let why = Reason::new("the frequency axis changes from pulse to pulse");
        FormError::Unsuited(why.helped_by(&[Remedy::OtherFormer(&["bp"])]))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_pulse_is_dropped_and_no_gap_is_crossed() {
        assert_eq!(cut(10, &[], 4), [0..4, 4..8, 8..10]);
        assert_eq!(cut(10, &[5], 4), [0..4, 4..5, 5..9, 9..10]);
        assert_eq!(cut(1040, &[], 40).len(), 26);
    }

    /// Pulses one metre apart along x with antennas that move across by centimetres during a pulse, and hardly along the track: no
    /// rate in pulses describes this.
    #[test]
    fn sweep_across_track_has_no_rate() {
        use subaperture_model::geometry::SceneFrame;
        use subaperture_model::phase_history::Sweep;

        let across = DVec3::new(1e-9, 30.0, 0.0);
        let pulse = |n: usize| {
            let antenna_m = DVec3::new(n as f64, -100.0, 20.0);
            Pulse {
                transmitter_m: antenna_m,
                receiver_m: antenna_m,
                reference_m: DVec3::ZERO,
                reference_path_m: 2.0 * antenna_m.length(),
                start_hz: 9e9,
                step_hz: 1e6,
                time_s: n as f64,
                sweep: Sweep {
                    sample_s: 1e-5,
                    transmitter_m_s: across,
                    receiver_m_s: across,
                    ..Sweep::AT_ONCE
                },
                recorded_path_m: None,
            }
        };
        let collection = Collection {
            name: "across".to_owned(),
            num_samples: 64,
            pulses: (0..20).map(pulse).collect(),
            frame: SceneFrame::Local,
            extent: None,
            timed: true,
        };
        let sub_cpi = SubCpi::new(&collection, 3..4);
        let datum = sub_cpi.datum(DVec3::ZERO);
        let (_, rate) = sub_cpi.line(&datum, DVec3::new(5.0, 3.0, 0.0));
        assert_eq!(rate, 0.0);
        // Along the track the motion is that of the track.
        let mut along = collection.clone();
        for pulse in &mut along.pulses {
            let velocity = DVec3::new(1.0, 0.0, 0.0);
            (pulse.sweep.transmitter_m_s, pulse.sweep.receiver_m_s) = (velocity, velocity);
        }
        let sub_cpi = SubCpi::new(&along, 3..4);
        let datum = sub_cpi.datum(DVec3::ZERO);
        let (_, rate) = sub_cpi.line(&datum, DVec3::new(5.0, 3.0, 0.0));
        // One metre of track at a distance of 100: the path to a point 5 m along changes by 2 * 5 / 103 m less than that to the centre.
        assert!((rate + 0.1).abs() < 0.02, "{rate}");
    }
}
