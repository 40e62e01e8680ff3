//! What a sub-CPI costs on the link: pulses up, maps down.
//!
//! Ten bits a byte: a start bit, eight data bits, a stop bit (8N1), both ways at once. Counted is what
//! the messages carry; framing, settings and repeats are not.

use subaperture_core::stream::BlockFloat;

use super::OnboardPlan;
use crate::maps::Arithmetic;

/// Bits on the wire for every byte.
const BITS_A_BYTE: f64 = 10.0;

/// Bytes of a pulse beside its samples: number, time, antennas, reference path, weight.
const PULSE_BYTES: u64 = 4 + 8 + 48 + 8 + 4;

/// Bytes of a map beside its samples: `MapHeader`, as it is.
const MAP_BYTES: u64 = 152;

/// Bytes and times for one sub-CPI.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct LinkBudget {
    /// The link's rate, bits a second.
    pub baud: u32,
    /// Bytes to the module.
    pub up_bytes: u64,
    /// Bytes from the module: the maps of all patches.
    pub down_bytes: u64,
    /// Bytes of the largest map.
    pub map_bytes: u64,
    /// Seconds that the bytes up take.
    pub up_s: f64,
    /// Seconds that the bytes down take.
    pub down_s: f64,
}

impl LinkBudget {
    /// For a plan over a link of `baud` bits a second.
    pub fn new(plan: &OnboardPlan, baud: u32) -> Self {
        let setup = &plan.setup;
        let sample_bytes = match plan.arithmetic {
            Arithmetic::Float => 8,
            Arithmetic::Fixed => 4,
        };
        let pulse_bytes = PULSE_BYTES + sample_bytes * u64::from(setup.num_frequencies);
        let maps = plan.patches.iter().map(|patch| {
            let exponents = match plan.arithmetic {
                Arithmetic::Float => 0,
                Arithmetic::Fixed => {
                    patch.num_doppler_bins() * BlockFloat::blocks(patch.num_range_bins())
                }
            };
            MAP_BYTES + sample_bytes * patch.map_len() as u64 + exponents as u64
        });
        let up_bytes = pulse_bytes * u64::from(setup.num_pulses);
        let down_bytes = maps.clone().sum();
        let seconds = |bytes: u64| bytes as f64 * BITS_A_BYTE / f64::from(baud);
        Self {
            baud,
            up_bytes,
            down_bytes,
            map_bytes: maps.max().unwrap_or(0),
            up_s: seconds(up_bytes),
            down_s: seconds(down_bytes),
        }
    }

    /// Whether pulses and maps of sub-CPIs that follow one another every `period_s` seconds pass.
    pub fn keeps_up(&self, period_s: f64) -> bool {
        self.up_s <= period_s && self.down_s <= period_s
    }

    /// How many patches' maps pass in `period_s` seconds; none if the pulses themselves do not.
    pub fn patches_in(&self, period_s: f64) -> u64 {
        if self.up_s > period_s || self.map_bytes == 0 {
            return 0;
        }
        let map_s = self.map_bytes as f64 * BITS_A_BYTE / f64::from(self.baud);
        (period_s / map_s) as u64
    }
}
