//! Link load of one sub-CPI: pulses to the module, maps from it.
//!
//! A byte takes ten bits: a start bit, eight data bits, a stop bit (8N1), in both directions at once. Only the content of the
//! messages is counted, not framing, settings and repetitions.

use subaperture_core::stream::BlockFloat;

use super::ModulePlan;
use crate::maps::Arithmetic;

/// Bits on the line per byte.
const BITS_A_BYTE: f64 = 10.0;

/// Bytes of a pulse without its samples: number, time, antennas, reference path, weight.
const PULSE_BYTES: u64 = 4 + 8 + 48 + 8 + 4;

/// Bytes of a map without its samples: `MapHeader` in memory layout.
const MAP_BYTES: u64 = 152;

/// Bytes and transfer times of one sub-CPI.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct LinkBudget {
    /// Bit rate of the link in bits per second.
    pub baud: u32,
    /// Bytes to the module.
    pub up_bytes: u64,
    /// Bytes from the module: the maps of all patches.
    pub down_bytes: u64,
    /// Bytes of the largest map.
    pub map_bytes: u64,
    /// Transfer time to the module in seconds.
    pub up_s: f64,
    /// Transfer time from the module in seconds.
    pub down_s: f64,
}

impl LinkBudget {
    /// Compute the load of a plan on a link of `baud` bits per second.
    pub fn new(plan: &ModulePlan, baud: u32) -> Self {
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

    /// Whether the link sustains one sub-CPI every `period_s` seconds.
    pub fn keeps_up(&self, period_s: f64) -> bool {
        self.up_s <= period_s && self.down_s <= period_s
    }

    /// Number of patches whose maps can be transferred in `period_s` seconds; 0 if the pulses alone take longer.
    pub fn patches_in(&self, period_s: f64) -> u64 {
        if self.up_s > period_s || self.map_bytes == 0 {
            return 0;
        }
        let map_s = self.map_bytes as f64 * BITS_A_BYTE / f64::from(self.baud);
        (period_s / map_s) as u64
    }
}
