//! Hash of a recording's geometry, to match a plan with its recording.

use serde::{Deserialize, Serialize};

use subaperture_model::phase_history::Collection;

/// Identity of the geometry of a recording.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Fingerprint {
    /// Number of pulses.
    pub pulses: usize,
    /// Frequency samples per pulse.
    pub samples: usize,
    /// FNV-1a hash of all positions, reference paths, frequencies and intra-pulse motions, hexadecimal.
    pub geometry: String,
}

impl Fingerprint {
    /// Compute the fingerprint of a collection.
    pub fn of(collection: &Collection) -> Self {
        let mut hash = 0xcbf2_9ce4_8422_2325u64;
        let mut add = |value: f64| {
            for byte in value.to_bits().to_le_bytes() {
                hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
            }
        };
        for pulse in &collection.pulses {
            let places = [pulse.transmitter_m, pulse.receiver_m, pulse.reference_m];
            places.iter().flat_map(|p| p.to_array()).for_each(&mut add);
            let numbers = [pulse.reference_path_m, pulse.start_hz, pulse.step_hz];
            numbers.into_iter().for_each(&mut add);
            // Recordings that state no interval keep the fingerprints of older plans.
            pulse
                .recorded_path_m
                .into_iter()
                .flatten()
                .for_each(&mut add);
            let sweep = &pulse.sweep;
            let motions = [
                sweep.transmitter_m_s,
                sweep.transmitter_m_s2,
                sweep.receiver_m_s,
                sweep.receiver_m_s2,
                sweep.reference_m_s.unwrap_or_default(),
            ];
            add(sweep.sample_s);
            motions.iter().flat_map(|v| v.to_array()).for_each(&mut add);
        }
        Self {
            pulses: collection.pulses.len(),
            samples: collection.num_samples,
            geometry: format!("{hash:016x}"),
        }
    }
}
