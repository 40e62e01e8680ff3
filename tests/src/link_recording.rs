//! A recording of a few seconds of work for a module: the radar of Schone 2020's Table 4.1 with every tenth pulse, a quarter of the
//! frequencies, and five points within 6 m.

use std::path::Path;

use glam::DVec3;
use num_complex::Complex64;
use subaperture::io::cphd::{Channel, WriteOptions, write};
use subaperture::monitor::Silent;
use subaperture::phase_history::{PhaseHistory, Pulse};
use subaperture::simulate::{PointTargetHistory, Preset, Scatterer, Variation};

/// Frequencies per pulse: 200 MHz in steps that are unambiguous over 48 m.
const SAMPLES: usize = 64;

/// The recording with 104 pulses.
pub fn recording() -> PointTargetHistory {
    let table = Preset::Table41.simulate(&Variation::default());
    let mut collection = table.collection().clone();
    let step_hz = 200e6 / SAMPLES as f64;
    let pulses = collection.pulses.iter().step_by(10).map(|pulse| Pulse {
        start_hz: 10e9 - (SAMPLES / 2) as f64 * step_hz,
        step_hz,
        ..*pulse
    });
    collection.pulses = pulses.collect();
    collection.num_samples = SAMPLES;
    let points = [
        (0.0, 0.0, 1.0),
        (4.2, -3.1, 0.7),
        (-5.3, 2.4, 0.5),
        (1.7, 5.6, 0.3),
        (-2.9, -4.8, 0.8),
    ];
    let scatterers = points.map(|(x, y, amplitude)| Scatterer {
        position_m: DVec3::new(x, y, 0.0),
        amplitude: Complex64::cis(x) * amplitude,
    });
    PointTargetHistory::new(collection, scatterers.to_vec(), None)
}

/// Write it as a CPHD file.
///
/// # Panics
/// If it cannot be written.
pub fn write_recording(path: &Path) {
    let history = recording();
    let channel = Channel::new("one", &history);
    write(path, &[channel], &WriteOptions::default(), &Silent).expect("a CPHD file is written");
}
