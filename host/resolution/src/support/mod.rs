//! What a collection samples of the scene's spectrum, seen from one place: resolution, side lobes and the
//! sampling that an image needs follow from it and from nothing else.
//!
//! A pulse whose transmitter and receiver lie in the directions `-u_t` and `-u_r` of the place `q` (`u` unit vectors
//! from the antennas to it) samples the scene around `q`, at frequency `f`, at the spatial frequency
//!
//! ```text
//! K = f / c (u_t + u_r)     cycles a metre (monostatic: 2 f / c along the line of sight)
//! ```
//!
//! so that an image of the formers shows a unit scatterer at `q` as
//!
//! ```text
//! h(d) = sum_n sum_k a_n w_slow[n] w_fast[k] exp(+j 2 pi K_nk . d) / (sum_n w_slow[n]  sum_k w_fast[k])
//! ```
//!
//! at `q + d`, with `a_n` how strongly the antennas' beams lit it. Along a line through the peak only the
//! distribution of the weights over `K` projected on that line counts (the projection-slice theorem): a
//! [`Projection`] holds it, and its transform is the response along the line. So the shape of the support
//! counts, in any plane and at any squint, and not the box around it.
//!
//! Three lengths, which are not the same and are never mixed here:
//! - the *half-power width* of the response, with windows ([`Projection::width_3db_m`]), what
//!   `subaperture-quality` measures;
//! - the *resolution* as Rayleigh has it, from peak to null of an even band without windows, `1 / extent`; for a band
//!   that is not even, of which a null need not exist, that of the even band of the same half-power width
//!   ([`Projection::resolution_m`]): the width of the response over 0.886;
//! - the *extent* of the support, between its outermost samples ([`Support::extent`]), whatever their weight: an image
//!   with pixels farther apart than one over it folds.
//!
//! Neglected: that `K` changes over the width of the response itself (the wave front's curvature over a cell, which
//! moves all pulses' phases nearly alike). `tests/planning/support.rs` holds predicted widths to 2 % of those of the plain sum, for
//! squinted, curved, near-range, wide-band, wide-angle, stripmap and bistatic geometries and a turned plane.
//!
//! Large collections are represented by at most [`MOST_LOOKS`] pulses, each for its share, and
//! [`MOST_CELLS`] cells of the band: the midpoint rule, whose response repeats that many cells away.

mod lit;
mod projection;
mod record;

use glam::DVec3;

use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::phase_history::{Collection, Pulse, Weights};
use subaperture_signal::window::Window;

pub use lit::{GainsError, measured_gains};
pub use projection::Projection;
pub use record::RecordedLooks;

/// Pulses that a collection is represented by at most.
pub const MOST_LOOKS: usize = 8191;
/// Cells of the band that it is represented by at most.
pub const MOST_CELLS: usize = 256;

/// One pulse, or the pulses around one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Transmitting antenna, metres in the scene frame.
    pub transmitter_m: DVec3,
    /// Receiving antenna, metres in the scene frame.
    pub receiver_m: DVec3,
    /// Edges of the band, half a sample beyond the outermost, hertz.
    pub band_hz: [f64; 2],
    /// Weight: that of the slow-time window, times what the beam adds.
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

/// A collection's pulses and weights, to be seen from any place.
#[derive(Clone, Debug, PartialEq)]
pub struct Looks {
    looks: Vec<Look>,
    /// Weights over cells of the band.
    fast: Vec<f64>,
}

impl Looks {
    /// The pulses of `collection`, [`MOST_LOOKS`] of them at most, under windows over fast and slow time.
    pub fn new(collection: &Collection, fast: Window, slow: Window) -> Self {
        let indices = representatives(collection.pulses.len(), MOST_LOOKS, Share::Golden);
        Self::of(collection, fast, slow, indices)
    }

    /// Of these pulses.
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
            fast: fast.weights(num_samples.min(MOST_CELLS)),
        }
    }

    /// With each look's weight multiplied by how strongly a target was lit, `gain(fraction)` at
    /// the fraction of the pulses, 0 to 1, that lie before it.
    #[must_use]
    pub fn lit(mut self, gain: impl Fn(f64) -> f64) -> Self {
        let count = self.looks.len() as f64;
        for (i, look) in self.looks.iter_mut().enumerate() {
            look.weight *= gain((i as f64 + 0.5) / count);
        }
        self
    }

    /// The looks.
    pub fn looks(&self) -> &[Look] {
        &self.looks
    }

    /// What they sample around `place_m`, a point of the scene frame.
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

/// Which pulse stands for its share of them.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Share {
    /// The middle one: the midpoint rule, for tracks that are smooth from share to share.
    Middle,
    /// One at a place that the golden ratio moves on from share to share, so that every one of many channels
    /// in turn is met as often.
    Golden,
}

/// Pulses that stand for `count` of them, at most `most`, one for each of equal shares.
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

/// `u_t + u_r`: how the path grows with the scene point.
#[inline]
pub fn path_gradient(transmitter_m: DVec3, receiver_m: DVec3, place_m: DVec3) -> DVec3 {
    (place_m - transmitter_m).normalize_or_zero() + (place_m - receiver_m).normalize_or_zero()
}

/// A look from one place: samples from `gradient * band[0]` to `gradient * band[1]`.
#[derive(Clone, Copy, Debug)]
struct Wave {
    gradient: DVec3,
    band_cycles_m: [f64; 2],
    weight: f64,
}

/// The samples of the scene's spectrum around a place.
#[derive(Clone, Debug)]
pub struct Support<'a> {
    waves: Vec<Wave>,
    fast: &'a [f64],
}

impl Support<'_> {
    /// The weights over `K . direction`, cycles a metre (of what `direction`'s length is in); `None` if
    /// the samples do not differ along it.
    pub fn along(&self, direction: DVec3) -> Option<Projection> {
        let segments = self.waves.iter().map(|wave| {
            let across = wave.gradient.dot(direction);
            (wave.band_cycles_m.map(|k| k * across), wave.weight)
        });
        Projection::new(segments, self.fast)
    }

    /// Least and greatest `K . direction` of samples that have any weight, cycles a metre; `None` if there are none.
    pub fn extent(&self, direction: DVec3) -> Option<[f64; 2]> {
        projection::extent(self.waves.iter().map(|wave| {
            let across = wave.gradient.dot(direction);
            (wave.band_cycles_m.map(|k| k * across), wave.weight)
        }))
    }

    /// Weighted mean of `u_t + u_r`, which points away from the antennas; zero where nothing is seen.
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

    /// Unit vectors along and across the line of sight in the plane of two unit vectors at right angles: the mean
    /// gradient's projection, or that of the middle look where looks from all sides leave no mean.
    pub fn range_and_cross(&self, [x, y]: [DVec3; 2]) -> [DVec3; 2] {
        let onto = |v: DVec3| x * v.dot(x) + y * v.dot(y);
        let mean = onto(self.mean_gradient());
        let middle = self.waves.get(self.waves.len() / 2);
        let middle = middle.map_or(DVec3::ZERO, |wave| onto(wave.gradient));
        // All around, what is left of the mean is of no meaning.
        let range = match mean.length() > 0.3 * middle.length() {
            true => mean,
            false => middle,
        };
        let range = range.try_normalize().unwrap_or(x);
        let normal = x.cross(y);
        [range, normal.cross(range)]
    }
}
