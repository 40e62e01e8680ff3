//! Spectral support of a collection at a scene point, from which resolution, sidelobes and image
//! sampling follow.
//!
//! A pulse whose transmitter and receiver are in the directions `-u_t` and `-u_r` of the point `q` (`u` unit vectors
//! from the antennas to it) samples the scene spectrum at frequency `f` at the spatial frequency
//!
//! ```text
//! K = f / c (u_t + u_r)     cycles per metre (monostatic: 2 f / c along the line of sight)
//! ```
//!
//! so that the impulse response of a unit scatterer at `q` is
//!
//! ```text
//! h(d) = sum_n sum_k a_n w_slow[n] w_fast[k] exp(+j 2 pi K_nk . d) / (sum_n w_slow[n]  sum_k w_fast[k])
//! ```
//!
//! at `q + d`, with the antenna gains `a_n`. Along a line through the peak only the
//! distribution of the weights over `K` projected on that line matters (projection-slice theorem): a
//! [`Projection`] holds it, and its Fourier transform is the response along the line. The true shape of the support
//! determines the response, in any plane and at any squint, and not its bounding box.
//!
//! Three measures are distinguished:
//! - *half-power (3 dB) width* of the response, with windows ([`Projection::width_3db_m`]), as
//!   `subaperture-quality` measures it;
//! - *Rayleigh resolution*, peak to null of a uniform band without windows, `1 / extent`. For a non-uniform
//!   band, which may have no null, that of the uniform band of equal half-power width
//!   ([`Projection::resolution_m`]): the width over 0.886;
//! - *extent* of the support between its outermost samples ([`Support::extent`]), whatever their weight: an image
//!   with a pixel spacing above one over the extent is aliased.
//!
//! Neglected: the change of `K` over the width of the response (wavefront curvature over a cell, which
//! affects all pulses nearly alike). `tests/planning/support.rs` holds predicted widths to 2 % of the plain sum, for
//! squinted, curved, near-range, wide-band, wide-angle, stripmap and bistatic geometries and a rotated plane.
//!
//! Large collections are represented by at most [`MAX_LOOKS`] pulses, each with the weight of its share, and
//! [`MAX_CELLS`] cells of the band (midpoint rule, whose response repeats after that many cells).

mod gains;
mod projection;
mod record;

use glam::DVec3;

use crate::SPEED_OF_LIGHT_M_S;
use crate::phase_history::{Collection, Pulse, Weights};
use subaperture_signal::window::Window;

pub use gains::{GainsError, measured_gains};
pub use projection::Projection;
pub use record::RecordedLooks;

/// Largest number of pulses that represent a collection.
pub const MAX_LOOKS: usize = 8191;
/// Largest number of band cells that represent a collection.
pub const MAX_CELLS: usize = 256;

/// Look: one pulse, or a group of pulses represented by one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Transmitter position, metres, scene frame.
    pub transmitter_m: DVec3,
    /// Receiver position, metres, scene frame.
    pub receiver_m: DVec3,
    /// Band edges, half a sample beyond the outermost samples, hertz.
    pub band_hz: [f64; 2],
    /// Weight: slow-time window times antenna gain.
    pub weight: f64,
}

impl Look {
    fn of(pulse: &Pulse, num_samples: usize, weight: f64) -> Self {
        let edge = |k: f64| pulse.start_hz + k * pulse.step_hz;
        Self {
            transmitter_m: pulse.transmitter_m,
            receiver_m: pulse.receiver_m,
            band_hz: [edge(-0.5), edge(num_samples as f64 - 0.5)],
            weight,
        }
    }
}

/// Pulses and weights of a collection, independent of the scene point.
#[derive(Clone, Debug, PartialEq)]
pub struct Looks {
    looks: Vec<Look>,
    /// Fast-time window over cells of the band.
    fast: Vec<f64>,
}

impl Looks {
    /// At most [`MAX_LOOKS`] pulses of `collection`, with windows over fast and slow time.
    pub fn new(collection: &Collection, fast: Window, slow: Window) -> Self {
        let indices = representatives(collection.pulses.len(), MAX_LOOKS, Share::Golden);
        Self::of(collection, fast, slow, indices)
    }

    /// Looks of these pulses.
    fn of(
        collection: &Collection,
        fast: Window,
        slow: Window,
        indices: impl Iterator<Item = usize>,
    ) -> Self {
        let weights = Weights::new(collection, fast, slow).slow;
        let num_samples = collection.num_samples;
        Self {
            looks: indices
                .map(|n| Look::of(&collection.pulses[n], num_samples, weights[n]))
                .collect(),
            fast: fast.weights(num_samples.min(MAX_CELLS)),
        }
    }

    /// Multiply each look's weight by the antenna gain `gain(fraction)`, at
    /// the fraction of pulses, 0 to 1, before it.
    #[must_use]
    pub fn with_gain(mut self, gain: impl Fn(f64) -> f64) -> Self {
        let count = self.looks.len() as f64;
        for (i, look) in self.looks.iter_mut().enumerate() {
            look.weight *= gain((i as f64 + 0.5) / count);
        }
        self
    }

    /// Looks in order of pulses.
    pub fn looks(&self) -> &[Look] {
        &self.looks
    }

    /// Spectral support at `place_m`, a point in metres in the scene frame.
    pub fn at(&self, place_m: DVec3) -> Support<'_> {
        let wave = |look: &Look| Wave {
            gradient: path_gradient(look.transmitter_m, look.receiver_m, place_m),
            band_cycles_m: look.band_hz.map(|hz| hz / SPEED_OF_LIGHT_M_S),
            weight: look.weight,
        };
        Support {
            waves: self.looks.iter().map(wave).collect(),
            fast: &self.fast,
        }
    }
}

/// Selection of the pulse that represents a share.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Share {
    /// Middle pulse (midpoint rule), for smooth tracks.
    Middle,
    /// Position shifted by the golden ratio from share to share, so that interleaved channels are sampled
    /// equally often.
    Golden,
}

/// Indices of at most `most` representatives of `count` pulses, one per equal share.
fn representatives(count: usize, most: usize, share: Share) -> impl Iterator<Item = usize> {
    let shares = count.min(most);
    (0..shares).map(move |i| {
        let part = match share {
            Share::Golden if shares < count => (i as f64 * 0.618_033_988_749_895).fract(),
            _ => 0.5,
        };
        (((i as f64 + part) * count as f64 / shares as f64) as usize).min(count - 1)
    })
}

/// Gradient of the two-way path over the scene point, `u_t + u_r`.
#[inline]
pub fn path_gradient(transmitter_m: DVec3, receiver_m: DVec3, place_m: DVec3) -> DVec3 {
    (place_m - transmitter_m).normalize_or_zero() + (place_m - receiver_m).normalize_or_zero()
}

/// Look at a scene point: samples from `gradient * band[0]` to `gradient * band[1]`.
#[derive(Clone, Copy, Debug)]
struct Wave {
    gradient: DVec3,
    band_cycles_m: [f64; 2],
    weight: f64,
}

/// Spectral support at a scene point.
#[derive(Clone, Debug)]
pub struct Support<'a> {
    waves: Vec<Wave>,
    fast: &'a [f64],
}

impl Support<'_> {
    /// Projection of the weights on `direction`, cycles per metre (per unit of `direction`'s length); `None` if
    /// the support has no extent along it.
    pub fn along(&self, direction: DVec3) -> Option<Projection> {
        let segments = self.waves.iter().map(|wave| {
            let across = wave.gradient.dot(direction);
            (wave.band_cycles_m.map(|k| k * across), wave.weight)
        });
        Projection::new(segments, self.fast)
    }

    /// Smallest and largest `K . direction` of samples with weight, cycles per metre; `None` if there are none.
    pub fn extent(&self, direction: DVec3) -> Option<[f64; 2]> {
        projection::extent(self.waves.iter().map(|wave| {
            let across = wave.gradient.dot(direction);
            (wave.band_cycles_m.map(|k| k * across), wave.weight)
        }))
    }

    /// Weighted mean of `u_t + u_r`, which points away from the antennas; zero without weight.
    pub fn mean_gradient(&self) -> DVec3 {
        let (mut sum, mut weight) = (DVec3::ZERO, 0.0);
        for wave in &self.waves {
            sum += wave.gradient * wave.weight;
            weight += wave.weight;
        }
        match weight > 0.0 {
            true => sum / weight,
            false => DVec3::ZERO,
        }
    }

    /// Unit vectors along and across the line of sight in the plane of two orthogonal unit vectors: projection of the mean
    /// gradient, or of the middle look's gradient for a circular aperture, whose mean vanishes.
    pub fn range_and_cross(&self, [x, y]: [DVec3; 2]) -> [DVec3; 2] {
        let onto = |v: DVec3| x * v.dot(x) + y * v.dot(y);
        let mean = onto(self.mean_gradient());
        let middle = self.waves.get(self.waves.len() / 2);
        let middle = middle.map_or(DVec3::ZERO, |wave| onto(wave.gradient));
        // For a circular aperture the remaining mean has no meaning.
        let range = match mean.length() > 0.3 * middle.length() {
            true => mean,
            false => middle,
        };
        let range = range.try_normalize().unwrap_or(x);
        let normal = x.cross(y);
        [range, normal.cross(range)]
    }
}
