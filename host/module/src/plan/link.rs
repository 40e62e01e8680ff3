//! Link load of one sub-CPI: pulses to the module, maps from it; and of the whole recording with each product, increments
//! and range profiles included.
//!
//! A byte takes ten bits: a start bit, eight data bits, a stop bit (8N1), in both directions at once. Only the content of the
//! messages is counted, not framing, settings and repetitions.

use subaperture_core::link::{Encoding, detection_bytes};
use subaperture_core::stream::BlockFloat;
use subaperture_core::sweep;

use subaperture_model::phase_history::Channels;

use super::{ModulePlan, ModuleProduct};
use crate::maps::Arithmetic;

/// Bits on the line per byte.
const BITS_A_BYTE: f64 = 10.0;

/// Bytes of a pulse without its samples: number, time, antennas, reference path, weight.
const PULSE_BYTES: u64 = 4 + 8 + 48 + 8 + 4;

/// Bytes of a map without its samples: `MapHeader` in memory layout.
const MAP_BYTES: u64 = 152;

/// Bytes of the list of detections on a map without the detections.
const LIST_BYTES: u64 = 18;

/// Maximum number of detections that a module sends per map.
const DETECTIONS_A_MAP: u64 = 32;

/// Bytes of an image chip without its pixels: grid and counters.
const CHIP_BYTES: u64 = 110;

/// Bytes of a channel of a pulse without its samples: number, channel, reference path.
const CHANNEL_BYTES: u64 = 4 + 2 + 8;

/// Bytes of an increment: two pulse numbers, counts of targets and echoes, motion.
const INCREMENT_BYTES: u64 = 2 * 4 + 2 * 2 + 1 + 24 + 4 + 2 * 2;

/// Bytes of a sample of both channels of a stepped-frequency radar.
const PAIR_BYTES: u64 = 8;

/// Load of a product of the whole recording on the link.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct ProductLoad {
    /// Product, as in `subap link --send`.
    pub product: &'static str,
    /// Fewest and most bytes from the module. They differ for detections: none, or 32 on every map.
    pub down_bytes: [u64; 2],
    /// The same for each byte to the module.
    pub down_up_ratio: [f64; 2],
    /// Transfer time of both directions at once in seconds, with the most bytes.
    pub transfer_s: f64,
}

impl ProductLoad {
    /// Loads of maps, image and detections of a plan on a link of `baud` bits per second.
    pub fn of_each(plan: &ModulePlan, baud: u32) -> [Self; 3] {
        let link = LinkBudget::new(plan, baud);
        let channels = plan.setup.num_channels;
        let up_bytes = link.pulse_bytes * plan.num_pulses as u64 * u64::from(channels);
        let pixel_bytes = plan.arithmetic.encoding().sample_bytes() as u64;
        let detection_bytes = detection_bytes(channels.into()) as u64;
        let lists = |detections: u64| plan.num_maps() * (LIST_BYTES + detection_bytes * detections);
        let image = pixel_bytes * plan.num_pixels + CHIP_BYTES * plan.patches.len() as u64;
        let load = |product: ModuleProduct, down_bytes| {
            Self::new(product.name(), up_bytes, down_bytes, baud)
        };
        [
            load(
                ModuleProduct::Maps,
                [plan.num_sub_cpis as u64 * link.down_bytes; 2],
            ),
            load(ModuleProduct::Image, [image; 2]),
            load(
                ModuleProduct::Detections,
                [lists(0), lists(DETECTIONS_A_MAP)],
            ),
        ]
    }

    /// Load of the motion increments of a recording with several channels.
    pub fn of_increments(channels: &Channels<'_>, arithmetic: Arithmetic, baud: u32) -> Self {
        let samples = channels.channel(0).collection().num_samples;
        let channel_bytes = arithmetic.encoding().sample_bytes() * samples;
        let pulses = channels.num_pulses() as u64;
        let up_bytes = channels.len() as u64 * (CHANNEL_BYTES + channel_bytes as u64) * pulses;
        Self::new("increments", up_bytes, [INCREMENT_BYTES * pulses; 2], baud)
    }

    /// Load of the range profiles of this many sweeps of a stepped-frequency radar, with two channels of 16-bit samples.
    pub fn of_profiles(setup: &sweep::Setup, sweeps: u64, baud: u32) -> Self {
        let samples = u64::from(setup.carriers) * u64::from(setup.samples);
        let profile_bytes = Encoding::Complex32.sample_bytes() as u64 * u64::from(setup.bins);
        let up_bytes = PAIR_BYTES * samples * sweeps;
        Self::new("profiles", up_bytes, [profile_bytes * sweeps; 2], baud)
    }

    fn new(product: &'static str, up_bytes: u64, down_bytes: [u64; 2], baud: u32) -> Self {
        Self {
            product,
            down_bytes,
            down_up_ratio: down_bytes.map(|bytes| bytes as f64 / up_bytes as f64),
            transfer_s: seconds(up_bytes.max(down_bytes[1]), baud),
        }
    }
}

fn seconds(bytes: u64, baud: u32) -> f64 {
    bytes as f64 * BITS_A_BYTE / f64::from(baud)
}

/// Bytes and transfer times of one sub-CPI.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct LinkBudget {
    /// Bit rate of the link in bits per second.
    pub baud: u32,
    /// Bytes of a pulse to the module.
    pub pulse_bytes: u64,
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
        let sample_bytes = plan.arithmetic.encoding().sample_bytes() as u64;
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
        let up_bytes = pulse_bytes * u64::from(setup.numbers_per_sub_cpi());
        let down_bytes = maps.clone().sum();
        Self {
            baud,
            pulse_bytes,
            up_bytes,
            down_bytes,
            map_bytes: maps.max().unwrap_or(0),
            up_s: seconds(up_bytes, baud),
            down_s: seconds(down_bytes, baud),
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
