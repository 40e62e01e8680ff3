//! Decimated looks for an image's record.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::{Look, Looks, MAX_CELLS, Projection, Share, representatives};
use crate::phase_history::Collection;
use subaperture_signal::window::Window;

/// Candidate numbers of looks; primes, so that they are not commensurate with a cycle of channels.
const COUNTS: [usize; 5] = [61, 127, 257, 509, 1021];
/// Largest deviation of the response from that of all looks, relative to the peak, out to [`REACH_CELLS`].
const TOLERANCE: f64 = 5e-3;
/// Extent of the comparison, cells; that of a point measurement.
const REACH_CELLS: f64 = 15.0;

/// Antenna positions and bands of a few pulses that represent a collection's support.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RecordedLooks {
    /// Number of cells of the band.
    pub band_cells: usize,
    /// Band edges, hertz: one pair for all looks, or one per look.
    pub bands_hz: Vec<[f64; 2]>,
    /// Transmitter positions, metres, scene frame.
    pub transmitters_m: Vec<[f64; 3]>,
    /// Receiver positions, metres, scene frame; empty for a monostatic radar.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub receivers_m: Vec<[f64; 3]>,
}

impl RecordedLooks {
    /// Fewest pulses of `collection` that reproduce the response at `place_m` along and across the
    /// line of sight in the plane of `axes`. `None` if 1021 pulses do not suffice, which is
    /// possible with many interleaved channels.
    pub fn of(collection: &Collection, place_m: DVec3, axes: [DVec3; 2]) -> Option<Self> {
        let all = Looks::new(collection, Window::None, Window::None);
        let directions = all.at(place_m).range_and_cross(axes);
        let support = all.at(place_m);
        // Positions and magnitudes of the response of all looks; `None` if it is not resolved.
        let magnitudes = |whole: &Projection| {
            let cell_m = whole.resolution_m()?;
            let places_m = (1..=(REACH_CELLS * 4.0) as usize).map(|i| i as f64 / 4.0 * cell_m);
            let each = places_m.map(|s_m| (s_m, whole.power(s_m).sqrt()));
            Some(each.collect::<Vec<_>>())
        };
        let whole = directions.map(|direction| support.along(direction).map(|w| magnitudes(&w)));
        let alike = |few: &Looks| {
            directions.iter().zip(&whole).all(|(&direction, whole)| {
                let few = few.at(place_m).along(direction);
                let (Some(whole), Some(few)) = (whole, &few) else {
                    return whole.is_none() && few.is_none();
                };
                let near = |&(s_m, magnitude): &(f64, f64)| {
                    (magnitude - few.power(s_m).sqrt()).abs() < TOLERANCE
                };
                whole.as_ref().is_some_and(|whole| whole.iter().all(near))
            })
        };
        let count = collection.pulses.len();
        // Interleaved channels of one cycle together, so that a window over their order is a window over time.
        let turns = collection.num_turns();
        let channels = count / turns.max(1);
        let in_turn = move |m: usize| (m % channels) * turns + m / channels;
        let chosen = |most: usize| representatives(count, most, Share::Middle).map(in_turn);
        let most = COUNTS.into_iter().find(|&most| {
            let few = Looks::of(collection, Window::None, Window::None, chosen(most));
            few.looks.len() == all.looks.len() || alike(&few)
        })?;
        let pulses: Vec<_> = chosen(most).map(|n| collection.pulses[n]).collect();
        let band = |pulse| Look::of(pulse, collection.num_samples, 1.0).band_hz;
        let apart = pulses.iter().any(|p| p.transmitter_m != p.receiver_m);
        let mut bands_hz: Vec<[f64; 2]> = pulses.iter().map(band).collect();
        if collection.band().is_some() {
            bands_hz.truncate(1);
        }
        Some(Self {
            band_cells: collection.num_samples.min(MAX_CELLS),
            bands_hz,
            transmitters_m: pulses.iter().map(|p| p.transmitter_m.to_array()).collect(),
            receivers_m: match apart {
                true => pulses.iter().map(|p| p.receiver_m.to_array()).collect(),
                false => Vec::new(),
            },
        })
    }

    /// Looks with windows over fast and slow time; `None` if the record is inconsistent.
    pub fn looks(&self, fast: Window, slow: Window) -> Option<Looks> {
        let count = self.transmitters_m.len();
        let fits = |len: usize, other: usize| len == count || len == other;
        let finite = |v: &[f64]| v.iter().all(|v| v.is_finite());
        let sound = count > 0
            && (1..=MAX_CELLS).contains(&self.band_cells)
            && fits(self.bands_hz.len(), 1)
            && fits(self.receivers_m.len(), 0)
            && self.bands_hz.iter().all(|band| finite(band))
            && self.transmitters_m.iter().all(|v| finite(v))
            && self.receivers_m.iter().all(|v| finite(v));
        if !sound {
            return None;
        }
        let weights = slow.weights(count);
        let looks = weights.into_iter().enumerate().map(|(i, weight)| {
            let transmitter_m = DVec3::from(self.transmitters_m[i]);
            Look {
                transmitter_m,
                receiver_m: self
                    .receivers_m
                    .get(i)
                    .map_or(transmitter_m, |&v| DVec3::from(v)),
                band_hz: *self.bands_hz.get(i).unwrap_or(&self.bands_hz[0]),
                weight,
            }
        });
        Some(Looks {
            looks: looks.collect(),
            fast: fast.weights(self.band_cells),
        })
    }
}
