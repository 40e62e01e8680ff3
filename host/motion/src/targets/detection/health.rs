//! Health of channels, from some pulses of a recording.

use num_complex::{Complex32, Complex64};
use subaperture_model::phase_history::{ChannelHistory, Channels};

use crate::targets::fault::Fault;

/// Level below the strongest channel at which only leakage remains, dB.
const DEAD_DB: f64 = 40.0;
/// Median SNR below which a channel contains noise alone, if the median SNR of another channel is above [`SEEN`].
const SILENT: f64 = 4.0;
const SEEN: f64 = 100.0;
/// Least share of samples at the largest value of a saturated channel: 0.2 % of an unsaturated steady tone are within [`RAIL`] of it.
const SATURATED: f64 = 0.01;
const RAIL: f64 = 2e-6;

/// Statistics of a channel.
#[derive(Clone, Default)]
pub(super) struct Health {
    power: f64,
    samples: usize,
    /// Largest real or imaginary part so far and the number of samples at it, as recorded and without compensation.
    rails: [(f64, usize); 2],
    /// SNR of the echoes.
    pub(super) echoes: Vec<f64>,
}

impl Health {
    /// Median SNR of the echoes.
    fn snr(&self) -> Option<f64> {
        let mut all = self.echoes.clone();
        all.sort_by(f64::total_cmp);
        all.get(all.len() / 2).copied()
    }

    pub(super) fn take(&mut self, samples: &[Complex32]) {
        let each = |z: &Complex32| f64::from(z.norm_sqr());
        self.power += samples.iter().map(each).sum::<f64>();
        self.samples += samples.len();
        for z in samples {
            self.rail(0, z.re.into());
            self.rail(0, z.im.into());
        }
    }

    pub(super) fn take_echoes(&mut self, samples: &[Complex64]) {
        for z in samples {
            self.rail(1, z.re);
            self.rail(1, z.im);
        }
    }

    fn rail(&mut self, which: usize, part: f64) {
        let (largest, count) = &mut self.rails[which];
        let size = part.abs();
        if size > *largest * (1.0 + RAIL) {
            (*largest, *count) = (size, 1);
        } else if size >= *largest * (1.0 - RAIL) && size > 0.0 {
            *count += 1;
        }
    }

    /// Largest share of samples with a part at the largest value.
    fn at_rails(&self) -> f64 {
        let most = self.rails.iter().map(|(_, count)| *count).max();
        most.unwrap_or(0) as f64 / self.samples.max(1) as f64
    }
}

/// Statistics of all channels.
pub(super) struct ChannelStatistics {
    pub(super) of: Vec<Health>,
}

impl ChannelStatistics {
    pub(super) fn most_power(&self) -> f64 {
        self.of.iter().fold(0.0, |most, own| most.max(own.power))
    }

    pub(super) fn saturated(&self, channels: &Channels) -> Vec<Fault> {
        let each = self.of.iter().zip(channels.about());
        each.map(|(own, about)| (own.at_rails(), about))
            .filter(|(share, _)| *share > SATURATED)
            .map(|(share, about)| Fault::Saturated {
                channel: about.name.clone(),
                share: share.min(1.0),
            })
            .collect()
    }

    /// Channels with echoes, and the names of the others with their level below the strongest; `None` for zeros only.
    pub(super) fn split<'a>(&self, channels: Channels<'a>) -> Split<'a> {
        let most = self.most_power();
        let best = self.of.iter().filter_map(Health::snr).fold(0.0, f64::max);
        let (mut alive, mut dead) = (Vec::new(), Vec::new());
        for (own, (about, history)) in self.of.iter().zip(channels.into_inner()) {
            let by_power_db = 10.0 * libm::log10(most / own.power);
            // Noise alone, while another channel has echoes.
            let silent = own.snr().filter(|snr| *snr < SILENT && best > SEEN);
            let by_echoes_db = silent.map(|snr| 10.0 * libm::log10(best / snr));
            let below_db = by_echoes_db.unwrap_or(by_power_db);
            match below_db > DEAD_DB || silent.is_some() {
                true => dead.push((about.name, (own.power > 0.0).then_some(below_db))),
                false => alive.push((about, history)),
            }
        }
        (alive, dead)
    }
}

/// Channels with echoes, and names of those without.
pub(super) type Split<'a> = (Vec<ChannelHistory<'a>>, Vec<(String, Option<f64>)>);
