use super::*;
use num_complex::Complex64;
use subaperture_model::monitor::Silent;
use subaperture_model::phase_history::InMemory;
use subaperture_simulate::{Preset, Variation};

fn print(name: &str, report: &Report) {
    let (float, fixed) = (report.worst_float(), report.worst_fixed());
    println!(
        "{name}: float {:.1} dB in {}, fixed {:.1} dB in {} (samples {:.1} dB), rdbp {:?} in {} sub-CPIs of {}",
        float.float_db,
        float.index,
        fixed.fixed_db,
        fixed.index,
        fixed.sample_rounding_db,
        report
            .worst_image()
            .map(|(sub_cpi, image)| (sub_cpi.index, image)),
        report.sub_cpis.len(),
        report.num_sub_cpis,
    );
}

#[test]
fn core_and_rdbp_keep_bounds_on_presets() {
    for (preset, sub_cpi) in [
        (Preset::Table41, 40),
        (Preset::Table41, 131),
        (Preset::Table21, 7),
    ] {
        let history = preset.simulate(&Variation::default());
        let report = crosscheck(&history, sub_cpi, 1 << 30, &Silent).unwrap();
        print(preset.name(), &report);
        let expected = history.collection().pulses.len().div_ceil(sub_cpi);
        assert_eq!(report.num_sub_cpis, expected);
        assert_eq!(report.sub_cpis.len(), expected.min(MAX_SUB_CPIS));
        let last = &report.sub_cpis[report.sub_cpis.len() - 1];
        assert_eq!(last.pulses.end, history.collection().pulses.len());
        // The radar of Table 2.1 is stationary: no grid, and the reason.
        let still = preset.name() == Preset::Table21.name();
        let why = report.no_image.as_deref().unwrap_or_default();
        assert_eq!(why.starts_with("no default grid"), still, "{why}");
        assert_eq!(report.worst_image().is_none(), still);
        assert!(report.passes());
    }
}

/// Recording with all pulses except the first scaled down by `factor`.
fn with_a_loud_pulse(factor: f32) -> InMemory {
    let history = Preset::Table41.simulate(&Variation::default());
    let collection = history.collection().clone();
    let mut samples = vec![Complex32::ZERO; collection.pulses.len() * collection.num_samples];
    history
        .read(0..collection.pulses.len(), &mut samples)
        .unwrap();
    let width = collection.num_samples;
    samples[width..].iter_mut().for_each(|z| *z *= factor);
    InMemory::new(collection, samples).unwrap()
}

/// Sub-CPIs 70 dB below the largest sample: 16 bits cover 98 dB, so about 20 dB remain. Float32 is unaffected.
#[test]
fn weak_sub_cpi_exceeds_bound_in_fixed_point_only() {
    let report = crosscheck(&with_a_loud_pulse(3e-4), 40, 1 << 30, &Silent).unwrap();
    print("one loud pulse", &report);
    assert!(!report.passes());
    let worst = report.worst_fixed();
    assert!(worst.fixed_db > FIXED_DB && worst.index > 0);
    // The error is that of the samples' rounding alone.
    assert!((worst.fixed_db - worst.sample_rounding_db).abs() < 1.0);
    assert!(report.worst_float().float_db <= FLOAT_DB);
    assert!(
        report
            .sub_cpis
            .iter()
            .all(|sub_cpi| sub_cpi.image.unwrap().within())
    );
}

#[test]
fn error_of_one_value_is_measured() {
    let map = vec![Complex64::ONE; 100];
    let mut other = map.clone();
    assert_eq!(measure::error_db(&other, &map), f64::NEG_INFINITY);
    // One value of 100 is off by 1e-4 of its size: 1e-4 / sqrt(100) is -100 dB.
    other[50] *= 1.0 + 1e-4;
    assert!((measure::error_db(&other, &map) + 100.0).abs() < 0.1);
    assert_eq!(measure::error_db(&other[1..], &map), f64::INFINITY);
    other[0].re = f64::NAN;
    assert_eq!(measure::error_db(&other, &map), f64::INFINITY);
}

#[test]
fn sizes_beyond_core_limits_are_rejected() {
    let sizes = |count, pulses| {
        let band = subaperture_model::phase_history::Band {
            start_hz: 1e9,
            step_hz: 1e5,
            count,
        };
        streaming::sizes(&band, pulses, [0.0; 3])
    };
    assert!(sizes(4096, 2048).is_ok());
    let wide = sizes(4097, 10).unwrap_err();
    // No sub-CPI is small enough for that.
    assert_eq!(wide.remedies(), []);
    let wide = wide.to_string();
    assert!(wide.contains("4096 for the core") && wide.contains("found 4097"));
    let long = sizes(100, 2049).unwrap_err();
    assert_eq!(long.remedies(), [Remedy::Smaller(&["sub_cpi"])]);
    assert!(long.to_string().contains("2048 for the core"));
}
