//! What a module's buffers take: the one place that says so on the host.
//!
//! For `M` pulses of `F` frequencies, `R` range bins, patches of `2Q + 1` rows by `2G + 1` bins:
//!
//! | buffer | float | fixed |
//! |---|---|---|
//! | pulse samples, two stores | `2 * 8 M F` | `2 * 4 M F` |
//! | pulse records, two stores | `2 * 72 M` | the same |
//! | map | `8 (2Q + 1) max(F, 2G + 1)` | `4 (2Q + 1) max(F, 2G + 1)` and an exponent for every 32 |
//! | range row | `8 R` | `8 R` |
//! | phases and column | `40 M` | `40 M` |
//! | window | `4 F` | `4 F` |
//! | patch list | `32` a patch | `32` a patch |
//!
//! Code, stack and what the link buffers are not counted.

use subaperture_core::stream::{BlockFloat, Patch, Setup};

use crate::maps::Arithmetic;

/// Bytes of a pulse's record beside its samples.
const PULSE_BYTES: u64 = 72;

/// Bytes of phases and column for every pulse.
const PHASE_BYTES: u64 = 40;

/// A buffer and its size.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Buffer {
    /// What it holds.
    pub name: &'static str,
    /// Its bytes.
    pub bytes: u64,
}

/// The buffers of a module.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct RamBudget {
    /// Every buffer.
    pub buffers: Vec<Buffer>,
    /// Their sum.
    pub total_bytes: u64,
}

impl RamBudget {
    /// For a run of `setup` on `num_patches` patches, of which `largest` has the largest map in work
    /// ([`map_samples`]).
    pub fn new(setup: &Setup, largest: &Patch, num_patches: usize, arithmetic: Arithmetic) -> Self {
        let (pulses, frequencies) = (
            u64::from(setup.num_pulses),
            u64::from(setup.num_frequencies),
        );
        let sample_bytes = match arithmetic {
            Arithmetic::Float => 8,
            Arithmetic::Fixed => 4,
        };
        let rows = largest.num_doppler_bins() as u64;
        let stride = setup.row_stride(largest);
        let exponents = match arithmetic {
            Arithmetic::Float => 0,
            Arithmetic::Fixed => rows * BlockFloat::blocks(stride) as u64,
        };
        let buffers: Vec<Buffer> = [
            (
                "pulse samples, two stores",
                2 * sample_bytes * pulses * frequencies,
            ),
            ("pulse records, two stores", 2 * PULSE_BYTES * pulses),
            ("map", sample_bytes * rows * stride as u64 + exponents),
            ("range row", 8 * u64::from(setup.range_length)),
            ("phases and column", PHASE_BYTES * pulses),
            ("window", 4 * frequencies),
            ("patch list", (num_patches * size_of::<Patch>()) as u64),
        ]
        .map(|(name, bytes)| Buffer { name, bytes })
        .into();
        let total_bytes = buffers.iter().map(|buffer| buffer.bytes).sum();
        Self {
            buffers,
            total_bytes,
        }
    }
}

/// Samples of a patch's map while it is in work.
pub(super) fn map_samples(setup: &Setup, patch: &Patch) -> usize {
    patch.num_doppler_bins() * setup.row_stride(patch)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formulas_by_hand() {
        assert_eq!(PULSE_BYTES as usize, size_of::<subaperture_core::Pulse>());
        assert_eq!(size_of::<Patch>(), 32);
        let setup = Setup {
            num_pulses: 30,
            num_frequencies: 424,
            range_length: 1024,
            doppler_length: 61,
            start_hz: 9.3e9,
            step_hz: 1.5e6,
        };
        let patch = Patch {
            centre_m: [0.0; 3],
            range_reach: 80,
            doppler_reach: 20,
        };
        let bytes = |budget: &RamBudget| -> Vec<u64> {
            budget.buffers.iter().map(|buffer| buffer.bytes).collect()
        };
        let float = RamBudget::new(&setup, &patch, 16, Arithmetic::Float);
        assert_eq!(
            bytes(&float),
            [203_520, 4320, 139_072, 8192, 1200, 1696, 512]
        );
        assert_eq!(float.total_bytes, 358_512);
        let fixed = RamBudget::new(&setup, &patch, 16, Arithmetic::Fixed);
        assert_eq!(
            bytes(&fixed),
            [101_760, 4320, 69_536 + 41 * 14, 8192, 1200, 1696, 512]
        );
    }
}
