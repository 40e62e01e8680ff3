//! Phase history of the range and Doppler cells about a place, in few frequencies and pulses.
//!
//! The samples are compensated to the place, multiplied by the weights, and averaged over blocks of `B` frequencies and `M` pulses. A scatterer `d` cells of range and `f` hertz of
//! Doppler from the place keeps the amplitude `sinc(d B / K) sinc(f M T)`, `T` the pulse interval: 0.06 dB less at two cells of [`CELLS`], at most 0.33 dB less at the largest Doppler
//! ([`TURN`]). Other ranges and Dopplers are folded onto these cells, noise with its own density: the ratio of signal to noise at the place does not change.

use std::ops::Range;

use glam::DVec3;
use num_complex::Complex32;
use rayon::prelude::*;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::phase_history::{
    Collection, InMemory, PhaseHistory, Pulse, ReadError, Weights,
};

use crate::turns::rotate;

/// Range cells that are kept about a place.
const CELLS: usize = 32;

/// Largest change of phase over the pulses of a group, cycles.
const TURN: f64 = 0.15;

/// Smallest number of groups of pulses.
const LEAST_GROUPS: usize = 128;

/// Pulses that are read at once.
const PULSES: usize = 64;

/// Division of pulses into groups, and of their samples into blocks.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gate {
    samples: Division,
    pulses: Division,
}

/// Division of items into parts of equal length; the remainder is left out at both ends.
#[derive(Clone, Copy, Debug)]
struct Division {
    first: usize,
    length: usize,
    count: usize,
}

impl Division {
    fn new(items: usize, length: usize) -> Self {
        Self {
            first: items % length / 2,
            length,
            count: items / length,
        }
    }

    fn items(&self, parts: Range<usize>) -> Range<usize> {
        let at = |part: usize| self.first + part * self.length;
        at(parts.start)..at(parts.end)
    }
}

/// Collection with other pulses.
pub(crate) fn with_pulses(own: &Collection, pulses: Vec<Pulse>, num_samples: usize) -> Collection {
    Collection {
        name: own.name.clone(),
        num_samples,
        pulses,
        frame: own.frame,
        extent: own.extent,
        timed: own.timed,
    }
}

impl Gate {
    /// Gate of a collection for Dopplers up to `doppler_hz`. `None` where samples are taken in the course of the motion, or are too few to be averaged.
    pub(crate) fn of(collection: &Collection, doppler_hz: f64) -> Option<Self> {
        let pulses = &collection.pulses;
        let (count, width) = (pulses.len(), collection.num_samples);
        let interval_s = (pulses[count - 1].time_s - pulses[0].time_s) / (count - 1) as f64;
        let still = pulses.iter().all(|pulse| pulse.sweep.sample_s == 0.0);
        let longest = ((TURN / (doppler_hz * interval_s)) as usize).min(count / LEAST_GROUPS);
        // An odd number: its middle pulse stands for the group.
        let group = (longest + longest % 2).max(2) - 1;
        let block = (width / CELLS).max(1);
        (still && block * group > 1).then(|| Self {
            samples: Division::new(width, block),
            pulses: Division::new(count, group),
        })
    }

    /// Weights of the gated samples of a channel.
    pub(crate) fn weights(&self, own: &Weights) -> Weights {
        let group = |i: usize| own.slow[self.pulses.items(i..i + 1)].iter().sum();
        Weights {
            fast: vec![1.0; self.samples.count],
            slow: (0..self.pulses.count).map(group).collect(),
            illumination: None,
            windows: None,
        }
    }

    /// Phase history about each of `places_m`, by one pass over `history` with its weights.
    pub(crate) fn read(
        &self,
        history: &dyn PhaseHistory,
        weights: &Weights,
        places_m: &[DVec3],
    ) -> Result<Vec<InMemory>, ReadError> {
        let at_once = (PULSES / self.pulses.length).max(1);
        let starts: Vec<usize> = (0..self.pulses.count).step_by(at_once).collect();
        let totals = &self.weights(weights).slow;
        let parts = starts.into_par_iter().map(|start| {
            let groups = start..(start + at_once).min(self.pulses.count);
            self.part(history, (weights, totals), places_m, groups)
        });
        let parts: Vec<Vec<Vec<Complex32>>> = parts.collect::<Result<_, ReadError>>()?;
        let collection = history.collection();
        let of_place = |(i, &place_m): (usize, &DVec3)| {
            let middle = |group| self.pulses.items(group..group + 1).start + self.pulses.length / 2;
            let groups = 0..self.pulses.count;
            let pulses =
                groups.map(|group| self.changed(&collection.pulses[middle(group)], place_m));
            let gated = with_pulses(collection, pulses.collect(), self.samples.count);
            let samples = parts.iter().flat_map(|part| part[i].iter().copied());
            InMemory::new(gated, samples.collect())
        };
        places_m.par_iter().enumerate().map(of_place).collect()
    }

    /// Blocks of some groups of pulses for each place, with the weights of pulses and the `totals` of groups.
    fn part(
        &self,
        history: &dyn PhaseHistory,
        (weights, totals): (&Weights, &[f64]),
        places_m: &[DVec3],
        groups: Range<usize>,
    ) -> Result<Vec<Vec<Complex32>>, ReadError> {
        let collection = history.collection();
        let count = collection.num_samples;
        let pulses = self.pulses.items(groups.clone());
        let mut samples = vec![Complex32::ZERO; pulses.len() * count];
        history.read(pulses.clone(), &mut samples)?;
        let used = self.samples.items(0..self.samples.count);
        let own = &weights.fast[used.clone()];
        let mean = own.iter().sum::<f64>() / own.len() as f64;
        let fast: Vec<f32> = own.iter().map(|&w| (w / mean) as f32).collect();
        let mut line = vec![Complex32::ZERO; used.len()];
        let of_place = |&place_m: &DVec3| {
            let mut blocks = vec![Complex32::ZERO; groups.len() * self.samples.count];
            for (i, samples) in samples.chunks_exact(count).enumerate() {
                let (n, group) = (pulses.start + i, i / self.pulses.length);
                let weight = weights.slow[n] / totals[groups.start + group];
                // Pulses outside of the section have no weight.
                if !weight.is_normal() {
                    continue;
                }
                for ((z, sample), weight) in line.iter_mut().zip(&samples[used.clone()]).zip(&fast)
                {
                    *z = sample * weight;
                }
                let pulse = &collection.pulses[n];
                let cycles_a_hz = pulse.relative_path_m(place_m) / SPEED_OF_LIGHT_M_S;
                let turns = [pulse.frequency_hz(self.samples.first), pulse.step_hz];
                let scale = weight / self.samples.length as f64;
                rotate(&mut line, turns.map(|hz| hz * cycles_a_hz), scale);
                let sums = &mut blocks[group * self.samples.count..];
                for (sum, block) in sums.iter_mut().zip(line.chunks_exact(self.samples.length)) {
                    *sum += block.iter().sum::<Complex32>();
                }
            }
            blocks
        };
        Ok(places_m.iter().map(of_place).collect())
    }

    /// Pulse with the frequencies of the blocks and the place as its reference.
    fn changed(&self, pulse: &Pulse, place_m: DVec3) -> Pulse {
        let middle_hz = 0.5 * (self.samples.length - 1) as f64 * pulse.step_hz;
        Pulse {
            start_hz: pulse.frequency_hz(self.samples.first) + middle_hz,
            step_hz: pulse.step_hz * self.samples.length as f64,
            reference_m: place_m,
            reference_path_m: pulse.path_m(place_m),
            ..*pulse
        }
    }

    /// Memory of a place in one channel, bytes.
    pub(crate) fn bytes(&self) -> u64 {
        let a_pulse = self.samples.count * size_of::<Complex32>() + size_of::<Pulse>();
        (self.pulses.count * a_pulse) as u64
    }
}
