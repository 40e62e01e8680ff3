//! Capture plan of a stepped-frequency radar: carriers, dwell time, order, repetition.
//!
//! Carrier `n` of `N` is `start + n (stop - start) / N`. Each carrier represents a band one step wide, and `stop` is
//! the upper edge of the last band. The range resolution is therefore exactly `c / (2 (stop - start))`, and the
//! unambiguous range `c N / (2 (stop - start))`: Chim 2018, 5.6, with 1.1 to 1.3 GHz in 50 steps of 4 MHz has 0.75 m
//! and 37.47 m.
//!
//! Steps are even except for avoided bands ([`Plan::avoid`]) and lost carriers, which are interpolated by
//! [`crate::profile::gaps`]. Synthesisers tune to within hertz of any carrier; a radio that is off by more than a
//! thousandth of a step is refused ([`crate::capture`]).
//!
//! Plans are TOML files; [`reference()`] prints every key.

pub(crate) mod keys;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use subaperture_describe::declare::{Choice, section};
use subaperture_model::SPEED_OF_LIGHT_M_S;

use crate::antennas::{Antennas, Reference};
use crate::error::RadioError;
use crate::transceiver::{Configuration, Ranges};

pub use keys::reference;

/// Order of the carriers within a sweep.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Choice)]
pub enum Order {
    /// From the lowest carrier to the highest.
    Up,
    /// From the highest carrier to the lowest.
    Down,
    /// Ascending and descending in alternate sweeps; avoids a long retune between sweeps.
    UpDown,
    /// Random, new in each sweep. Motion within a sweep then spreads as noise instead of shifting ranges.
    Shuffled,
}

/// Plan of a stepped-frequency capture.
#[section]
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Name, written to the metadata of the recording.
    #[skip]
    pub name: String,
    /// First carrier.
    #[key(required = "1.1 GHz", positive)]
    pub start_hz: f64,
    /// Upper edge of the last carrier's step. Range resolution is c / (2 (stop - start)).
    #[key(required = "1.3 GHz", positive)]
    pub stop_hz: f64,
    /// Carriers per sweep. The unambiguous range is this many times the resolution.
    #[key(required = 50, whole(1, 1 << 16))]
    pub steps: usize,
    /// Bands without transmission, each as lower and upper edge. Carriers whose step overlaps a band are skipped, at most a third of all, and
    /// interpolated in range profiles.
    #[key(example = ["1.164 GHz, 1.188 GHz"], rows(1, Frequency, Frequency))]
    pub avoid: Vec<(f64, f64)>,
    /// Order of the carriers. up-down alternates from sweep to sweep; shuffled is a new random order each sweep.
    #[key(default = "up")]
    pub order: Order,
    /// Seed of the shuffled order.
    #[key(default = 0, whole(0, i64::MAX as u64))]
    pub seed: u64,
    /// Recording time at each carrier.
    #[key(default = "1 ms", positive)]
    pub dwell_s: f64,
    /// Offset of the tone above its carrier (IF). The sample rate must be a whole multiple of it, at least 3 times.
    #[key(default = "125 kHz", positive)]
    pub tone_hz: f64,
    /// Amplitude of the tone, relative to the converter's full scale.
    #[key(default = 0.7, within(1e-6, 1.0, "0.000001 to 1"))]
    pub amplitude: f64,
    /// Number of sweeps; 0 runs until stopped.
    #[key(default = 1)]
    pub sweeps: u64,
    /// Sweep repetition interval; 0 for back-to-back sweeps.
    #[key(default = "0 s", not_negative)]
    pub pri_s: f64,
    /// Lead time from a burst's command to its start, for the command to reach the device.
    #[key(default = "1 ms", positive)]
    pub lead_s: f64,
    /// Settling threshold of the reference tone: largest relative deviation of its amplitude, and largest deviation of its phase from a
    /// straight line in radians.
    #[key(default = 0.02, positive)]
    pub steady: f64,
    /// Maximum number of bursts at a carrier until the reference is steady. If it never is, the last burst is kept and flagged.
    #[key(default = 8, whole(1, 1000))]
    pub bursts: u32,
    /// Phase reference: a loopback cable from the transmitter to receiver 0, or the direct leakage received by both antennas.
    #[key(default = "loopback")]
    pub reference: Reference,
    /// Antenna positions; required with a leakage reference.
    #[skip]
    pub antennas: Option<Antennas>,
    /// Clock, gains and ports of the radio.
    #[skip]
    pub radio: Configuration,
}

impl Plan {
    /// Carrier spacing, hertz.
    pub fn step_hz(&self) -> f64 {
        (self.stop_hz - self.start_hz) / self.steps as f64
    }

    /// Frequency of carrier `n`, hertz.
    pub fn carrier_hz(&self, n: usize) -> f64 {
        self.start_hz + n as f64 * self.step_hz()
    }

    /// Whether carrier `n` is skipped.
    pub fn avoids(&self, n: usize) -> bool {
        let (from_hz, to_hz) = (self.carrier_hz(n), self.carrier_hz(n + 1));
        // The tone may lie above its step.
        let to_hz = to_hz.max(from_hz + self.tone_hz);
        let within = |band: &(f64, f64)| band.0 < to_hz && from_hz < band.1;
        self.avoid.iter().any(within)
    }

    /// Number of carriers per sweep that are not skipped.
    pub fn carriers_taken(&self) -> usize {
        (0..self.steps).filter(|&n| !self.avoids(n)).count()
    }

    /// Range resolution `c / (2 B)` of the swept bandwidth `B`, metres.
    pub fn resolution_m(&self) -> f64 {
        SPEED_OF_LIGHT_M_S / (2.0 * (self.stop_hz - self.start_hz))
    }

    /// Unambiguous range `c / (2 step)`, metres.
    pub fn unambiguous_m(&self) -> f64 {
        SPEED_OF_LIGHT_M_S / (2.0 * self.step_hz())
    }

    /// Samples of a burst: whole periods of the tone.
    pub fn samples(&self) -> usize {
        let period = self.period();
        let periods = (self.dwell_s * self.radio.sample_rate_hz / period as f64).round();
        (periods.max(1.0) as usize).saturating_mul(period)
    }

    /// Samples per period of the tone.
    pub fn period(&self) -> usize {
        (self.radio.sample_rate_hz / self.tone_hz).round() as usize
    }

    /// Minimum duration of a sweep, seconds, with a radio of these limits: each carrier takes two retunes, one command
    /// lead and one dwell.
    pub fn sweep_s(&self, ranges: &Ranges) -> f64 {
        let burst_s = self.samples() as f64 / self.radio.sample_rate_hz;
        self.carriers_taken() as f64 * (2.0 * ranges.retune_s + self.lead_s + burst_s)
    }

    /// Maximum data rate to disk, bytes per second.
    pub fn bytes_a_second(&self, ranges: &Ranges) -> f64 {
        let samples = self.carriers_taken() as f64 * self.samples() as f64;
        8.0 * samples / self.sweep_s(ranges).max(self.pri_s)
    }

    /// Carriers of a sweep in capture order.
    pub fn carriers(&self, sweep: u64) -> Vec<usize> {
        let mut all: Vec<usize> = (0..self.steps).collect();
        match self.order {
            Order::Up => {}
            Order::Down => all.reverse(),
            Order::UpDown if sweep % 2 == 1 => all.reverse(),
            Order::UpDown => {}
            Order::Shuffled => {
                let mut random = ChaCha8Rng::seed_from_u64(self.seed);
                random.set_stream(sweep);
                // Fisher-Yates shuffle.
                for i in (1..all.len()).rev() {
                    all.swap(i, (random.next_u64() % (i as u64 + 1)) as usize);
                }
            }
        }
        all.retain(|&n| !self.avoids(n));
        all
    }

    /// Check the plan's consistency, and check it against the limits of a radio.
    ///
    /// # Errors
    /// The first value that does not fit.
    pub fn check(&self, ranges: &Ranges) -> Result<(), RadioError> {
        let say = |what: String| Err(RadioError::Unsupported(what));
        if self.steps == 0 || self.stop_hz <= self.start_hz {
            return say("plan without carriers: expected a stop frequency above the start, and one step or more".to_owned());
        }
        ranges
            .carrier_hz
            .check("first carrier", self.start_hz, "Hz")?;
        ranges
            .carrier_hz
            .check("last carrier", self.carrier_hz(self.steps - 1), "Hz")?;
        let taken = self.carriers_taken();
        if 3 * taken < 2 * self.steps {
            return say(format!(
                "{} of {} carriers are in bands to avoid: expected at most a third. Avoid less, or move the start and stop frequencies",
                self.steps - taken,
                self.steps
            ));
        }
        self.radio.check(ranges)?;
        let periods = self.radio.sample_rate_hz / self.tone_hz;
        if (periods - periods.round()).abs() > 1e-9 * periods || !(3.0..=65536.0).contains(&periods)
        {
            return say(format!(
                "tone of {} Hz at {} samples per second: period of {periods} samples, expected a whole number from 3 to 65536. Choose \
                 another tone or sample rate",
                self.tone_hz, self.radio.sample_rate_hz
            ));
        }
        if 2.0 * self.tone_hz > self.radio.bandwidth_hz {
            return say(format!(
                "tone {} Hz above its carrier lies outside the analog bandwidth of {} Hz: lower the tone or raise the bandwidth",
                self.tone_hz, self.radio.bandwidth_hz
            ));
        }
        if self.samples() > MAX_SAMPLES {
            return say(format!(
                "burst of {} samples: expected at most {MAX_SAMPLES}. Shorten the dwell or lower the sample rate",
                self.samples()
            ));
        }
        if self.reference == Reference::Leakage {
            self.check_leakage()?;
        }
        let least_s = self.sweep_s(ranges);
        if self.pri_s > 0.0 && self.pri_s < least_s {
            return say(format!(
                "sweep interval of {} s is shorter than a sweep of {least_s:.4} s: lengthen the pri, or take fewer steps or a shorter dwell",
                self.pri_s
            ));
        }
        Ok(())
    }
}

impl Plan {
    /// Check that the delay of the direct wave is known and positive for both receivers.
    fn check_leakage(&self) -> Result<(), RadioError> {
        let say = |what: &str| Err(RadioError::Unsupported(what.to_owned()));
        let Some(antennas) = self.antennas.filter(Antennas::is_finite) else {
            return say(
                "a leakage reference needs the antenna positions: add [antennas], since the leakage delay is that from the transmit antenna to \
                 each receive antenna",
            );
        };
        if [0, 1]
            .iter()
            .any(|&receiver| antennas.direct_s(receiver) <= 0.0)
        {
            return say(
                "a receive antenna coincides with the transmit antenna: give different positions",
            );
        }
        Ok(())
    }
}

/// Maximum number of samples of a burst; 32 MiB for both channels.
pub const MAX_SAMPLES: usize = 1 << 22;

#[cfg(test)]
mod tests {
    use subaperture_describe::Description;

    use super::*;

    pub(crate) fn parse(text: &str) -> Result<Plan, String> {
        Plan::describe(&Description::new("plan.toml", text, ".")).map_err(|error| error.to_string())
    }

    const CHIM: &str = "[plan]\nstart = \"1.1 GHz\"\nstop = \"1.3 GHz\"\nsteps = 50\n";

    /// C 5.6: 200 MHz in 50 steps give 0.75 m and 37.47 m, as printed there.
    #[test]
    fn thesis_plan_has_printed_resolution_and_unambiguous_range() {
        let plan = parse(CHIM).unwrap();
        assert!((plan.resolution_m() - 0.75).abs() < 0.005);
        assert!((plan.unambiguous_m() - 37.47).abs() < 0.005);
        assert_eq!(plan.carrier_hz(49), 1.296e9);
        let ranges = Ranges::b210();
        plan.check(&ranges).unwrap();
        // 50 times: two retunes of 2 ms, 1 ms of lead and 1 ms of dwell.
        assert!(
            (plan.sweep_s(&ranges) - 0.3).abs() < 1e-9,
            "{}",
            plan.sweep_s(&ranges)
        );
    }

    #[test]
    fn every_order_takes_every_carrier_once() {
        for order in ["up", "down", "up-down", "shuffled"] {
            let plan = parse(&format!("{CHIM}order = \"{order}\"\n")).unwrap();
            for sweep in 0..3 {
                let mut carriers = plan.carriers(sweep);
                if order == "shuffled" {
                    assert_ne!(carriers, plan.carriers(sweep + 1));
                }
                carriers.sort_unstable();
                assert!(carriers.into_iter().eq(0..50));
            }
        }
        let back = parse(&format!("{CHIM}order = \"up-down\"\n")).unwrap();
        assert_eq!((back.carriers(0)[0], back.carriers(1)[0]), (0, 49));
    }

    /// Steps of 4 MHz: six overlap 1.164 to 1.188 GHz, and one contains 1.2205 GHz. No tone reaches beyond its step
    /// here.
    #[test]
    fn avoided_bands_are_skipped_in_every_order() {
        let avoid = "avoid = [\"1.164 GHz, 1.188 GHz\", \"1220.5 MHz, 1220.6 MHz\"]\n";
        for order in ["up", "shuffled"] {
            let plan = parse(&format!("{CHIM}order = \"{order}\"\n{avoid}")).unwrap();
            plan.check(&Ranges::b210()).unwrap();
            let mut carriers = plan.carriers(1);
            carriers.sort_unstable();
            let kept = (0..50).filter(|n| !(16..22).contains(n) && *n != 30);
            assert!(carriers.into_iter().eq(kept));
            assert_eq!(plan.carriers_taken(), 43);
        }
        let wrong = parse(&format!("{CHIM}avoid = [\"1.2 GHz, 1.1 GHz\"]\n")).unwrap_err();
        assert!(
            wrong.contains("plan.toml:5") && wrong.contains("upper edge is above the lower"),
            "{wrong}"
        );
    }

    #[test]
    fn plans_outside_radio_limits_are_refused_with_reason() {
        let refused = |more: &str, words: &str| {
            let plan = parse(&format!("{CHIM}{more}")).unwrap();
            let error = plan.check(&Ranges::b210()).unwrap_err().to_string();
            assert!(error.contains(words), "{more}: {error}");
        };
        refused("tone = \"130 kHz\"\n", "whole number");
        refused(
            "avoid = [\"1.15 GHz, 1.23 GHz\"]\n",
            "21 of 50 carriers are in bands to avoid",
        );
        // Only a program can set such a dwell; the TOML keys do not allow it.
        let mut endless = parse(CHIM).unwrap();
        endless.dwell_s = 1e300;
        let error = endless.check(&Ranges::b210()).unwrap_err().to_string();
        assert!(error.contains("Shorten the dwell"), "{error}");
        refused("pri = \"0.1 s\"\n", "sweep interval of 0.1 s");
        refused(
            "[radio]\nsample_rate = \"61.44 MHz\"\n",
            "sample rate of 61440000 Hz is out",
        );
        refused(
            "[radio]\nreceive_gain = \"90 dB\"\n",
            "receive gain of 90 dB",
        );
        refused(
            "[radio]\nreference_antenna = \"RX9\"\n",
            "expected one of RX2, TX/RX",
        );
        refused(
            "dwell = \"9 s\"\n[radio]\nsample_rate = \"1 MHz\"\n",
            "burst of 9000000 samples",
        );
        let below = parse("[plan]\nstart = \"20 MHz\"\nstop = \"90 MHz\"\nsteps = 9").unwrap();
        let error = below.check(&Ranges::b210()).unwrap_err().to_string();
        assert!(
            error.contains(
                "first carrier of 20000000 Hz is outside the radio's range: expected 70000000 to"
            ),
            "{error}"
        );
        let error =
            parse("[plan]\nstart = \"1.3 GHz\"\nstop = \"1.1 GHz\"\nsteps = 50").unwrap_err();
        assert!(
            error.contains("plan.toml:3") && error.contains("above the start"),
            "{error}"
        );
        assert!(
            parse("[plan]\nstart = \"1.3 GHz\"")
                .unwrap_err()
                .contains("stop")
        );
    }
}
