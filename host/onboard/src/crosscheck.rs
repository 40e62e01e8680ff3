//! Host against core: every sub-CPI through both, maps compared.
//!
//! The host's way ([`RangeDopplerMapper`]: rustfft, tables from float64, its own windows) and the
//! core's (`subaperture_core`: microfft, integer chirps, its own windows) share no code. Both keep
//! to -120 dB of the defining sum, so a relative RMS difference above [`LIMIT_DB`] means that one of
//! them is wrong for this input.

use num_complex::Complex32;
use subaperture_core as core;
use subaperture_core::keystone::KeystoneTable;

use crate::range_doppler::RangeDopplerMapper;
use subaperture_focus::budget::Budget;
use subaperture_focus::{FormError, Reason, Remedy};
use subaperture_model::image::power;
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::PhaseHistory;
use subaperture_signal::scaled_dft::ScaledDft;
use subaperture_signal::window::Window;

/// Largest relative RMS difference that passes, dB.
pub const LIMIT_DB: f64 = -100.0;

/// Pulses a sub-CPI unless asked otherwise.
pub const SUB_CPI: usize = 40;

/// Largest transform of the core.
const CORE_LARGEST: usize = 4096;

/// What was compared, and how it came out.
#[derive(Clone, Debug)]
pub struct Report {
    /// Sizes of the maps.
    pub shape: core::Shape,
    /// Relative RMS difference of each sub-CPI's maps, dB; minus infinity where both are equal.
    pub differences_db: Vec<f64>,
}

impl Report {
    /// The sub-CPI that differs most, and by how much, dB.
    pub fn worst(&self) -> (usize, f64) {
        let all = self.differences_db.iter().copied().enumerate();
        all.max_by(|a, b| a.1.total_cmp(&b.1))
            .expect("there is at least one sub-CPI")
    }

    /// Whether every difference is within [`LIMIT_DB`].
    pub fn passes(&self) -> bool {
        self.worst().1 <= LIMIT_DB
    }
}

/// Runs every sub-CPI of `sub_cpi` pulses through host and core. The last one ends at the last pulse,
/// and overlaps the one before it if the pulses do not divide evenly.
///
/// # Errors
/// [`FormError::Unsuited`] if the pulses do not share one band, or do not fit the core's largest
/// sizes; [`FormError::Memory`]; [`FormError::Read`]; [`FormError::Cancelled`].
pub fn crosscheck(
    history: &dyn PhaseHistory,
    sub_cpi: usize,
    memory_bytes: u64,
    monitor: &dyn Monitor,
) -> Result<Report, FormError> {
    let collection = history.collection();
    let band = collection.band().ok_or_else(|| {
        FormError::unsuited("the frequency axis changes from pulse to pulse".to_owned())
    })?;
    let num_pulses = sub_cpi.min(collection.pulses.len());
    if num_pulses == 0 {
        return Err(FormError::unsuited(
            "a sub-CPI needs at least one pulse".to_owned(),
        ));
    }
    let shape = shape(band.count, num_pulses)?;
    let chirp_length = shape.chirp_length();

    take_memory(history, &shape, memory_bytes)?;

    let window = Window::Hamming;
    let (fast, slow) = (window.weights(band.count), window.weights(num_pulses));
    let mut mapper = RangeDopplerMapper::new(
        &band,
        &fast,
        &slow,
        shape.num_range_bins,
        shape.num_doppler_bins,
    );
    let mut host_map = vec![Complex32::ZERO; shape.map_len()];

    let params = core::Params {
        start_hz: band.start_hz,
        step_hz: band.step_hz,
        fast_window: core::Window::Hamming,
        slow_window: core::Window::Hamming,
    };
    let (mut fast, mut slow) = (vec![0.0; band.count], vec![0.0; num_pulses]);
    let tables = core::Tables {
        fast_weights: &mut fast,
        slow_weights: &mut slow,
        keystone: KeystoneTable::ChirpZ {
            length: chirp_length,
        },
    };
    let refused = |error: &dyn std::fmt::Display| FormError::unsuited(format!("core: {error}"));
    let plan = core::Plan::new(shape, &params, tables).map_err(|e| refused(&e))?;
    let mut core_history = vec![Complex32::ZERO; shape.history_len()];
    let mut scratch = vec![Complex32::ZERO; plan.scratch_len()];
    let mut core_map = vec![Complex32::ZERO; shape.map_len()];

    let mut samples = vec![Complex32::ZERO; shape.history_len()];
    let count = collection.pulses.len().div_ceil(num_pulses);
    let mut differences_db = Vec::with_capacity(count);
    for index in 0..count {
        let first = (index * num_pulses).min(collection.pulses.len() - num_pulses);
        history.read(first..first + num_pulses, &mut samples)?;
        mapper.map(&samples, &mut host_map);
        for (m, pulse) in samples.chunks_exact(band.count).enumerate() {
            plan.window(m, pulse, &mut core_history);
        }
        plan.process(&core_history, &mut scratch, &mut core_map)
            .map_err(|e| refused(&e))?;
        differences_db.push(difference_db(&core_map, &host_map));
        if monitor.cancelled() {
            return Err(FormError::Cancelled);
        }
        monitor.progress((index + 1) as f64 / count as f64);
    }
    Ok(Report {
        shape,
        differences_db,
    })
}

/// Checks that the budget has room for the recording and for a map by either side.
fn take_memory(
    history: &dyn PhaseHistory,
    shape: &core::Shape,
    memory_bytes: u64,
) -> Result<(), FormError> {
    let mut budget = Budget::new(memory_bytes);
    let held_bytes = u128::from(history.held_bytes());
    budget.take("the recording", held_bytes, &[Remedy::MoreMemory])?;
    let remedies = &[Remedy::Smaller(&["sub_cpi"]), Remedy::MoreMemory];
    let tables = ScaledDft::table_bytes(
        shape.num_frequencies,
        shape.num_pulses,
        shape.num_doppler_bins,
    );
    let values = 2 * shape.history_len() + 2 * shape.map_len() + 3 * shape.chirp_length();
    budget.take(
        "a pair of maps",
        u128::from(tables) + 8 * values as u128,
        remedies,
    )
}

/// Map sizes: twice the data's, as far as the core goes.
fn shape(num_frequencies: usize, num_pulses: usize) -> Result<core::Shape, FormError> {
    let bins = |count: usize| (2 * count).next_power_of_two().clamp(2, CORE_LARGEST);
    let mut shape = core::Shape {
        num_pulses,
        num_frequencies,
        num_range_bins: bins(num_frequencies),
        num_doppler_bins: bins(num_pulses),
    };
    if shape.chirp_length() > CORE_LARGEST {
        shape.num_doppler_bins = num_pulses.next_power_of_two();
    }
    if num_frequencies > CORE_LARGEST {
        return Err(FormError::unsuited(format!(
            "the core takes at most {CORE_LARGEST} frequencies a pulse, and this recording has \
             {num_frequencies}: it cannot be cross-checked"
        )));
    }
    if shape.chirp_length() > CORE_LARGEST {
        let why = format!(
            "the core takes at most {} pulses a sub-CPI, not {num_pulses}",
            CORE_LARGEST / 2
        );
        let remedies = [Remedy::Smaller(&["sub_cpi"])];
        return Err(FormError::Unsuited(Reason::new(why).helped_by(&remedies)));
    }
    Ok(shape)
}

/// Relative RMS difference, dB.
fn difference_db(got: &[Complex32], reference: &[Complex32]) -> f64 {
    let error: f64 = got.iter().zip(reference).map(|(a, b)| power(a - b)).sum();
    if error == 0.0 {
        return f64::NEG_INFINITY;
    }
    let reference: f64 = reference.iter().map(|&z| power(z)).sum();
    10.0 * (error / reference).log10()
}

#[cfg(test)]
mod tests {
    use super::*;
    use subaperture_model::monitor::Silent;
    use subaperture_simulate::{Preset, Variation};

    #[test]
    fn host_and_core_agree_on_the_presets() {
        for (preset, sub_cpi) in [
            (Preset::Table41, 40),
            (Preset::Table41, 131),
            (Preset::Table21, 7),
        ] {
            let history = preset.simulate(&Variation::default());
            let report = crosscheck(&history, sub_cpi, 1 << 30, &Silent).unwrap();
            println!("{} at {sub_cpi}: {:?}", preset.name(), report.worst());
            let expected = history.collection().pulses.len().div_ceil(sub_cpi);
            assert_eq!(report.differences_db.len(), expected);
            assert!(report.passes());
        }
    }

    #[test]
    fn a_wrong_map_is_noticed() {
        let map = vec![Complex32::ONE; 100];
        let mut other = map.clone();
        assert_eq!(difference_db(&other, &map), f64::NEG_INFINITY);
        // One value of 100 off by 1e-4 of its size: 1e-4 / sqrt(100) is -100 dB.
        other[50] *= 1.0 + 1e-4;
        assert!((difference_db(&other, &map) + 100.0).abs() < 0.1);
    }

    #[test]
    fn sizes_past_the_core_are_refused() {
        assert!(shape(4096, 2048).is_ok());
        let wide = shape(4097, 10).unwrap_err();
        // No sub-CPI is small enough for that.
        assert_eq!(wide.remedies(), []);
        let wide = wide.to_string();
        assert!(wide.contains("4096 frequencies") && wide.contains("has 4097"));
        let long = shape(100, 2049).unwrap_err();
        assert_eq!(long.remedies(), [Remedy::Smaller(&["sub_cpi"])]);
        assert!(long.to_string().contains("2048 pulses"));
    }
}
