//! What a stepped-carrier radar is to do: its carriers, how long at each, in which order, how often.
//!
//! Carrier `n` of `N` is `start + n (stop - start) / N`: each stands for a band as wide as a step, and the stop is the end of the
//! last. So the resolution is `c / (2 (stop - start))` and ranges repeat after `c N / (2 (stop - start))`, exactly: Chim 2018, 5.6, with
//! 1.1 to 1.3 GHz in 50 steps has 0.75 m and 37.47 m, by steps of 4 MHz.
//!
//! Steps are even, and uneven where bands are left out ([`Plan::avoid`]) or carriers did not come: what is missing is filled by [`crate::profile::gaps`]. A synthesiser comes within hertz of any carrier,
//! so that nothing else makes steps uneven; a radio that is off by more than a thousandth of a step is refused ([`crate::capture`]).
//!
//! The text is TOML; [`reference()`] prints every key.

pub(crate) mod keys;

use std::io;
use std::path::Path;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use subaperture_describe::{Description, DescriptionError};
use subaperture_model::SPEED_OF_LIGHT_M_S;

use crate::antennas::{Antennas, Reference};
use crate::error::RadioError;
use crate::transceiver::{Configuration, Ranges};

pub use keys::reference;
pub(crate) use keys::{RADIO, TOP, configuration};

/// In which order carriers are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// Rising.
    Up,
    /// Falling.
    Down,
    /// Rising and falling in turn, sweep by sweep: no long retune between sweeps.
    UpDown,
    /// At random, anew each sweep: a motion within a sweep is not told as a range.
    Shuffled(u64),
}

/// What to do.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// A name for records.
    pub name: String,
    /// First carrier, hertz.
    pub start_hz: f64,
    /// End of the last carrier's step, hertz.
    pub stop_hz: f64,
    /// Carriers a sweep.
    pub steps: usize,
    /// Bands in which nothing is sent, from and to, hertz: carriers whose step reaches into one are left out.
    pub avoid: Vec<(f64, f64)>,
    /// Their order.
    pub order: Order,
    /// Time of a recorded burst, seconds.
    pub dwell_s: f64,
    /// The tone above its carrier, hertz; a whole number of samples a period.
    pub tone_hz: f64,
    /// Amplitude of the tone, of full scale.
    pub amplitude: f64,
    /// Sweeps; 0 for as many as there is time.
    pub sweeps: u64,
    /// From sweep to sweep, seconds; 0 for one after another.
    pub pri_s: f64,
    /// Between a command and its burst, seconds: what the command takes to the device.
    pub lead_s: f64,
    /// Most that a steady reference differs from a tone: a part of its amplitude, radians of its phase.
    pub steady: f64,
    /// Bursts at a step, at most, until the reference is steady.
    pub bursts: u32,
    /// What phases are referred to.
    pub reference: Reference,
    /// Where the antennas are; a leakage as the reference has to know it.
    pub antennas: Option<Antennas>,
    /// What the radio is set to.
    pub radio: Configuration,
}

impl Plan {
    /// Reads a plan.
    ///
    /// # Errors
    /// If the file cannot be read; then what is wrong with its text.
    pub fn read(path: &Path) -> io::Result<Result<Self, DescriptionError>> {
        Description::read(path).map(|description| Self::describe(&description))
    }

    /// The plan of a description.
    ///
    /// # Errors
    /// Everything that is wrong with it, with its lines.
    pub fn describe(description: &Description) -> Result<Self, DescriptionError> {
        keys::build(description).map_err(|faults| description.explain(faults))
    }

    /// From carrier to carrier, hertz.
    pub fn step_hz(&self) -> f64 {
        (self.stop_hz - self.start_hz) / self.steps as f64
    }

    /// Carrier `n`, hertz.
    pub fn carrier_hz(&self, n: usize) -> f64 {
        self.start_hz + n as f64 * self.step_hz()
    }

    /// Whether carrier `n` is left out.
    pub fn avoids(&self, n: usize) -> bool {
        let (from_hz, to_hz) = (self.carrier_hz(n), self.carrier_hz(n + 1));
        // A tone may be above its step.
        let to_hz = to_hz.max(from_hz + self.tone_hz);
        let within = |band: &(f64, f64)| band.0 < to_hz && from_hz < band.1;
        self.avoid.iter().any(within)
    }

    /// Carriers of a sweep that are taken.
    pub fn carriers_taken(&self) -> usize {
        (0..self.steps).filter(|&n| !self.avoids(n)).count()
    }

    /// Range resolution, metres.
    pub fn resolution_m(&self) -> f64 {
        SPEED_OF_LIGHT_M_S / (2.0 * (self.stop_hz - self.start_hz))
    }

    /// Range after which ranges repeat, metres.
    pub fn unambiguous_m(&self) -> f64 {
        SPEED_OF_LIGHT_M_S / (2.0 * self.step_hz())
    }

    /// Samples of a burst, whole periods of the tone.
    pub fn samples(&self) -> usize {
        let period = self.period();
        let periods = (self.dwell_s * self.radio.sample_rate_hz / period as f64).round();
        (periods.max(1.0) as usize).saturating_mul(period)
    }

    /// Samples a period of the tone.
    pub fn period(&self) -> usize {
        (self.radio.sample_rate_hz / self.tone_hz).round() as usize
    }

    /// What a sweep takes at the least, seconds, with a radio of these ranges: each carrier retunes two sides, waits for its
    /// command and dwells, once.
    pub fn sweep_s(&self, ranges: &Ranges) -> f64 {
        let burst_s = self.samples() as f64 / self.radio.sample_rate_hz;
        self.carriers_taken() as f64 * (2.0 * ranges.retune_s + self.lead_s + burst_s)
    }

    /// Bytes a second on disk, at the most.
    pub fn bytes_a_second(&self, ranges: &Ranges) -> f64 {
        let samples = self.carriers_taken() as f64 * self.samples() as f64;
        8.0 * samples / self.sweep_s(ranges).max(self.pri_s)
    }

    /// The carriers of a sweep in their order.
    pub fn carriers(&self, sweep: u64) -> Vec<usize> {
        let mut all: Vec<usize> = (0..self.steps).collect();
        match self.order {
            Order::Up => {}
            Order::Down => all.reverse(),
            Order::UpDown if sweep % 2 == 1 => all.reverse(),
            Order::UpDown => {}
            Order::Shuffled(seed) => {
                let mut random = ChaCha8Rng::seed_from_u64(seed);
                random.set_stream(sweep);
                // Fisher and Yates.
                for i in (1..all.len()).rev() {
                    all.swap(i, (random.next_u64() % (i as u64 + 1)) as usize);
                }
            }
        }
        all.retain(|&n| !self.avoids(n));
        all
    }

    /// Checks the plan by itself and against what a radio can do.
    ///
    /// # Errors
    /// The first thing that does not fit.
    pub fn check(&self, ranges: &Ranges) -> Result<(), RadioError> {
        let say = |what: String| Err(RadioError::Unsupported(what));
        if self.steps == 0 || self.stop_hz <= self.start_hz {
            return say("a plan without carriers; its stop is above its start, and its steps are one or more".to_owned());
        }
        ranges
            .carrier_hz
            .check("the first carrier", self.start_hz, "Hz")?;
        ranges
            .carrier_hz
            .check("the last carrier", self.carrier_hz(self.steps - 1), "Hz")?;
        let taken = self.carriers_taken();
        if 3 * taken < 2 * self.steps {
            return say(format!(
                "{} of {} carriers are in bands to avoid, and a profile needs two of three: avoid less, or move the start and the stop",
                self.steps - taken,
                self.steps
            ));
        }
        self.radio.check(ranges)?;
        let periods = self.radio.sample_rate_hz / self.tone_hz;
        if (periods - periods.round()).abs() > 1e-9 * periods || !(3.0..=65536.0).contains(&periods)
        {
            return say(format!(
                "a tone of {} Hz at {} samples a second has {periods} samples a period; it needs a whole number, 3 to 65536: choose \
                 a rate that is such a multiple",
                self.tone_hz, self.radio.sample_rate_hz
            ));
        }
        if 2.0 * self.tone_hz > self.radio.bandwidth_hz {
            return say(format!(
                "a tone {} Hz above its carrier, beyond the analog bandwidth of {} Hz: lower the one or widen the other",
                self.tone_hz, self.radio.bandwidth_hz
            ));
        }
        if self.samples() > MOST_SAMPLES {
            return say(format!(
                "bursts of {} samples; {MOST_SAMPLES} are the most: shorten the dwell or lower the rate",
                self.samples()
            ));
        }
        if self.reference == Reference::Leakage {
            self.check_leakage()?;
        }
        let least_s = self.sweep_s(ranges);
        if self.pri_s > 0.0 && self.pri_s < least_s {
            return say(format!(
                "a sweep every {} s, where one takes {least_s:.4} s: lengthen the pri, or take fewer steps or a shorter dwell",
                self.pri_s
            ));
        }
        Ok(())
    }
}

impl Plan {
    /// The direct way has to be known, and of another delay than none.
    fn check_leakage(&self) -> Result<(), RadioError> {
        let say = |what: &str| Err(RadioError::Unsupported(what.to_owned()));
        let Some(antennas) = self.antennas.filter(Antennas::is_finite) else {
            return say(
                "the leakage as the reference without the antennas' places: add [antennas], for its delay is that from the transmitter's to \
                 each receiver's",
            );
        };
        if [0, 1]
            .iter()
            .any(|&receiver| antennas.direct_s(receiver) <= 0.0)
        {
            return say(
                "an antenna that receives in the place of the one that sends: give each its own",
            );
        }
        Ok(())
    }
}

/// Samples of a burst, at most: 32 MiB for both channels.
pub const MOST_SAMPLES: usize = 1 << 22;

#[cfg(test)]
mod tests {
    use super::*;

    pub(crate) fn of(text: &str) -> Result<Plan, String> {
        Plan::describe(&Description::new("plan.toml", text, ".")).map_err(|error| error.to_string())
    }

    const CHIM: &str = "[plan]\nstart = \"1.1 GHz\"\nstop = \"1.3 GHz\"\nsteps = 50\n";

    /// C 5.6: 200 MHz in 50 steps: 0.75 m and 37.47 m as printed there.
    #[test]
    fn the_plan_of_the_thesis_has_its_resolution_and_range() {
        let plan = of(CHIM).unwrap();
        assert!((plan.resolution_m() - 0.75).abs() < 0.005);
        assert!((plan.unambiguous_m() - 37.47).abs() < 0.005);
        assert_eq!(plan.carrier_hz(49), 1.296e9);
        let ranges = Ranges::b210();
        plan.check(&ranges).unwrap();
        // 50 times twice 2 ms, 1 ms of lead and 1 ms of dwell.
        assert!(
            (plan.sweep_s(&ranges) - 0.3).abs() < 1e-9,
            "{}",
            plan.sweep_s(&ranges)
        );
    }

    #[test]
    fn every_order_takes_every_carrier_once() {
        for order in ["up", "down", "up-down", "shuffled"] {
            let plan = of(&format!("{CHIM}order = \"{order}\"\n")).unwrap();
            for sweep in 0..3 {
                let mut carriers = plan.carriers(sweep);
                if order == "shuffled" {
                    assert_ne!(carriers, plan.carriers(sweep + 1));
                }
                carriers.sort_unstable();
                assert!(carriers.into_iter().eq(0..50));
            }
        }
        let back = of(&format!("{CHIM}order = \"up-down\"\n")).unwrap();
        assert_eq!((back.carriers(0)[0], back.carriers(1)[0]), (0, 49));
    }

    /// Steps of 4 MHz: those from 1.164 and to 1.188 GHz are six, and the one whose tone is beyond its step, none here; 1.2205 GHz is in one.
    #[test]
    fn bands_to_avoid_are_left_out_in_every_order() {
        let avoid = "avoid = [\"1.164 GHz, 1.188 GHz\", \"1220.5 MHz, 1220.6 MHz\"]\n";
        for order in ["up", "shuffled"] {
            let plan = of(&format!("{CHIM}order = \"{order}\"\n{avoid}")).unwrap();
            plan.check(&Ranges::b210()).unwrap();
            let mut carriers = plan.carriers(1);
            carriers.sort_unstable();
            let kept = (0..50).filter(|n| !(16..22).contains(n) && *n != 30);
            assert!(carriers.into_iter().eq(kept));
            assert_eq!(plan.carriers_taken(), 43);
        }
        let wrong = of(&format!("{CHIM}avoid = [\"1.2 GHz, 1.1 GHz\"]\n")).unwrap_err();
        assert!(
            wrong.contains("plan.toml:5") && wrong.contains("to is above from"),
            "{wrong}"
        );
    }

    #[test]
    fn plans_that_a_radio_cannot_do_are_refused_with_the_reason() {
        let refused = |more: &str, words: &str| {
            let plan = of(&format!("{CHIM}{more}")).unwrap();
            let error = plan.check(&Ranges::b210()).unwrap_err().to_string();
            assert!(error.contains(words), "{more}: {error}");
        };
        refused("tone = \"130 kHz\"\n", "whole number");
        refused(
            "avoid = [\"1.15 GHz, 1.23 GHz\"]\n",
            "21 of 50 carriers are in bands to avoid",
        );
        // No text says so, but a program can.
        let mut endless = of(CHIM).unwrap();
        endless.dwell_s = 1e300;
        let error = endless.check(&Ranges::b210()).unwrap_err().to_string();
        assert!(error.contains("shorten the dwell"), "{error}");
        refused("pri = \"0.1 s\"\n", "a sweep every 0.1 s");
        refused(
            "[radio]\nsample_rate = \"61.44 MHz\"\n",
            "a sample rate of 61440000 Hz is out",
        );
        refused(
            "[radio]\nreceive_gain = \"90 dB\"\n",
            "receiving gain of 90 dB",
        );
        refused(
            "[radio]\nreference_antenna = \"RX9\"\n",
            "its ports are RX2, TX/RX",
        );
        refused(
            "dwell = \"9 s\"\n[radio]\nsample_rate = \"1 MHz\"\n",
            "bursts of 9000000 samples",
        );
        let below = of("[plan]\nstart = \"20 MHz\"\nstop = \"90 MHz\"\nsteps = 9").unwrap();
        let error = below.check(&Ranges::b210()).unwrap_err().to_string();
        assert!(
            error.contains(
                "the first carrier of 20000000 Hz is out of the radio's range, 70000000 to"
            ),
            "{error}"
        );
        let error = of("[plan]\nstart = \"1.3 GHz\"\nstop = \"1.1 GHz\"\nsteps = 50").unwrap_err();
        assert!(
            error.contains("plan.toml:3") && error.contains("above the start"),
            "{error}"
        );
        assert!(
            of("[plan]\nstart = \"1.3 GHz\"")
                .unwrap_err()
                .contains("stop")
        );
    }
}
