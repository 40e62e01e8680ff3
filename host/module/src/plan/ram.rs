//! Memory of a module's buffers. This is the only place on the host that computes it.
//!
//! For the sizes of a [`Capacity`]: `M` pulses, `F` frequencies, `R` range bins, `rows` Doppler bins, `P` patches, and `B`
//! blocks of 32 frequencies (or part thereof). Sizes in bytes, as declared by the firmware
//! ([`subaperture_core::stream`]):
//!
//! | buffer | float | fixed |
//! |---|---|---|
//! | pulse samples, two stores | `16 M F` | `8 M F` |
//! | pulse records, two stores | `144 M` | the same |
//! | map | `8 F rows` | `(4 F + B + 1) rows + F`, up to a multiple of 2 |
//! | range row | `8 R` | the same |
//! | phases and column | `40 M` | `48 M` |
//! | window | `4 F`, up to a multiple of 8 | the same |
//! | patch list | `32 P` | the same |
//! | link, received | `8 F + 201` | the same |
//! | link, sent | the received size, plus one per 254 bytes or part thereof, plus one | the same |
//! | link, row | `8 F` | the same |
//!
//! This is all static memory of a firmware of these sizes except for its options: `32 F + 1024` for detections
//! ([`RamBudget::detections_bytes`]), `8 (rows + 1) F` for the map that a clutter cancellation keeps ([`RamBudget::dpca_bytes`]), and
//! [`image_bytes`] for an image that the module accumulates. The kept map and the pixels of the image share a buffer. Code and stack are
//! not counted.
//!
//! **Accuracy**: exact, verified by `tests/stream/memory.rs` against the types that the firmware declares.

use subaperture_core::cfar::Column;
use subaperture_core::link::{max_frame_bytes, max_received_bytes};
use subaperture_core::stream::{BlockFloat, Capacity, Patch, PulsePhase, Setup};
use subaperture_core::{Pulse, Sc16, fixed_point};

use crate::maps::Arithmetic;

/// Bytes of a complex number of two float32 or two 32-bit integers.
const COMPLEX_BYTES: usize = 8;

/// Bytes of the description of an image chip: grid, first pixel, counter.
const CHIP_BYTES: u64 = 88;

/// Bytes of the values of up to 4 channels at up to 32 detections.
const VALUES_BYTES: u64 = 32 * 4 * COMPLEX_BYTES as u64;

/// Memory for accumulating an image of `pixels` pixels in `patches` patches over `sub_cpis` sub-CPIs: 8 bytes per pixel, 88 per
/// patch, and one bit per sub-CPI.
pub fn image_bytes(pixels: u64, patches: u64, sub_cpis: u64) -> u64 {
    COMPLEX_BYTES as u64 * pixels + CHIP_BYTES * patches + sub_cpis.div_ceil(8)
}

/// Buffer of a module.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Buffer {
    /// Content of the buffer.
    pub name: &'static str,
    /// Size in bytes.
    pub bytes: u64,
}

/// Memory of a module's buffers.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct RamBudget {
    /// All buffers needed to form and send maps.
    pub buffers: Vec<Buffer>,
    /// Sum of the buffer sizes in bytes.
    pub total_bytes: u64,
    /// Additional bytes for detections.
    pub detections_bytes: u64,
    /// Additional bytes for detections after clutter cancellation of two channels: the map of the first channel and a row of ratios, in
    /// complex float32. A firmware with [`image_bytes`] of as many pixels has them already.
    pub dpca_bytes: u64,
}

impl RamBudget {
    /// Compute the memory of a module built with the sizes of `capacity`.
    pub fn new(capacity: &Capacity, arithmetic: Arithmetic) -> Self {
        let [pulses, frequencies, range_bins, rows, patches] = [
            capacity.pulses,
            capacity.frequencies,
            capacity.range_bins,
            capacity.doppler_bins,
            capacity.patches,
        ]
        .map(usize::from);
        let (sample_bytes, phase_bytes) = match arithmetic {
            Arithmetic::Float => (8, size_of::<PulsePhase>()),
            Arithmetic::Fixed => (4, size_of::<fixed_point::PulsePhase>()),
        };
        let exponents = match arithmetic {
            Arithmetic::Float => 0,
            Arithmetic::Fixed => rows * (BlockFloat::blocks(frequencies) + 1) + frequencies,
        };
        let map = sample_bytes * rows * frequencies + exponents;
        let buffers: Vec<Buffer> = [
            (
                "pulse samples, two stores",
                2 * sample_bytes * pulses * frequencies,
            ),
            ("pulse records, two stores", 2 * size_of::<Pulse>() * pulses),
            ("map", map.next_multiple_of(align_of::<Sc16>())),
            ("range row", COMPLEX_BYTES * range_bins),
            ("phases and column", (phase_bytes + COMPLEX_BYTES) * pulses),
            ("window", (4 * frequencies).next_multiple_of(8)),
            ("patch list", patches * size_of::<Patch>()),
            ("link, received", max_received_bytes(frequencies)),
            ("link, sent", max_frame_bytes(frequencies)),
            ("link, row", COMPLEX_BYTES * frequencies),
        ]
        .map(|(name, bytes)| Buffer {
            name,
            bytes: bytes as u64,
        })
        .into();
        Self {
            total_bytes: buffers.iter().map(|buffer| buffer.bytes).sum(),
            buffers,
            detections_bytes: (size_of::<Column>() * frequencies) as u64 + VALUES_BYTES,
            dpca_bytes: (COMPLEX_BYTES * (rows + 1) * frequencies) as u64,
        }
    }
}

/// Smallest capacity that passes the checks for a run of `setup` on `patches`: a row holds a pulse and the widest gate, and
/// there are as many rows as in the tallest map.
pub(crate) fn least_capacity(setup: &Setup, patches: &[Patch], arithmetic: Arithmetic) -> Capacity {
    let most = |count: fn(&Patch) -> usize| -> u16 {
        let most = patches.iter().map(count).max().unwrap_or(1);
        u16::try_from(most).unwrap_or(u16::MAX)
    };
    let doppler_bins = most(Patch::num_doppler_bins);
    let range_bins = match arithmetic {
        Arithmetic::Float => setup.range_length,
        // The work buffer of rows also holds a column, and its length is a power of two.
        Arithmetic::Fixed => doppler_bins
            .checked_next_power_of_two()
            .unwrap_or(u16::MAX)
            .max(setup.range_length),
    };
    Capacity {
        pulses: u16::try_from(setup.numbers_per_sub_cpi()).unwrap_or(u16::MAX),
        frequencies: most(Patch::num_range_bins).max(setup.num_frequencies),
        range_bins,
        doppler_bins,
        patches: u16::try_from(patches.len()).unwrap_or(u16::MAX),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SETUP: Setup = Setup {
        num_pulses: 30,
        num_channels: 1,
        num_frequencies: 424,
        range_length: 1024,
        doppler_length: 61,
        start_hz: 9.3e9,
        step_hz: 1.5e6,
    };

    fn patch(range_reach: u16, doppler_reach: u16) -> Patch {
        Patch {
            centre_m: [0.0; 3],
            range_reach,
            doppler_reach,
        }
    }

    #[test]
    fn ram_budget_matches_hand_computed_sizes() {
        let capacity = Capacity {
            pulses: 30,
            frequencies: 424,
            range_bins: 1024,
            doppler_bins: 41,
            patches: 16,
        };
        let bytes = |budget: &RamBudget| -> Vec<u64> {
            budget.buffers.iter().map(|buffer| buffer.bytes).collect()
        };
        // Received: 8 * 424 + 9 + 192; sent: that, 15 COBS codes and a zero.
        let link = [3593, 3609, 3392];
        let float = RamBudget::new(&capacity, Arithmetic::Float);
        let engine = [203_520, 4320, 139_072, 8192, 1200, 1696, 512];
        assert_eq!(bytes(&float), [&engine[..], &link].concat());
        assert_eq!(float.total_bytes, 358_512 + 10_594);
        assert_eq!(float.detections_bytes, 32 * 424 + 1024);
        assert_eq!(float.dpca_bytes, 8 * 42 * 424);
        assert_eq!(image_bytes(1000, 4, 9), 8000 + 352 + 2);
        // 14 blocks and one; 41 * (1696 + 15) + 424 = 70 575, rounded up.
        let fixed = RamBudget::new(&capacity, Arithmetic::Fixed);
        let engine = [101_760, 4320, 70_576, 8192, 1440, 1696, 512];
        assert_eq!(bytes(&fixed), [&engine[..], &link].concat());
        assert_eq!(fixed.total_bytes, 188_496 + 10_594);
    }

    #[test]
    fn least_capacity_passes_and_smaller_ones_fail() {
        // A tall narrow map and a flat one wider than a pulse: neither has the maximum of both.
        let patches = [patch(80, 25), patch(220, 3)];
        let sizes = least_capacity(&SETUP, &patches, Arithmetic::Float);
        assert_eq!((sizes.frequencies, sizes.doppler_bins), (441, 51));
        let passes = |sizes: &Capacity| {
            SETUP.check(sizes).is_ok()
                && patches
                    .iter()
                    .all(|patch| SETUP.check_patch(patch, sizes).is_ok())
        };
        assert!(passes(&sizes));
        let smaller: [fn(&mut Capacity); 4] = [
            |sizes| sizes.pulses -= 1,
            |sizes| sizes.frequencies -= 1,
            |sizes| sizes.range_bins -= 1,
            |sizes| sizes.doppler_bins -= 1,
        ];
        for make in smaller {
            let mut sizes = sizes;
            make(&mut sizes);
            assert!(!passes(&sizes), "{sizes:?}");
        }
        // More rows than range bins: in fixed point the work buffer of rows holds a column.
        let sizes = least_capacity(&SETUP, &[patch(1, 600)], Arithmetic::Fixed);
        assert_eq!((sizes.range_bins, sizes.doppler_bins), (2048, 1201));
    }
}
