//! Listed frequencies of a file, fitted by a straight line.

/// Lowest plausible start of a band. Lower values are assumed to be in another unit than hertz.
pub(crate) const MIN_FREQUENCY_HZ: f64 = 1e6;

/// Start and step in hertz of the least-squares line through equally spaced frequencies. An error describes the
/// fault, for use after a name.
pub(crate) fn fit_line(hz: &[f64]) -> Result<(f64, f64), String> {
    let mean_index = (hz.len() - 1) as f64 / 2.0;
    let mean_hz = hz.iter().sum::<f64>() / hz.len() as f64;
    let (mut slope, mut spread) = (0.0, 0.0);
    for (k, f) in hz.iter().enumerate() {
        let d = k as f64 - mean_index;
        slope += d * (f - mean_hz);
        spread += d * d;
    }
    let step_hz = slope / spread;
    let start_hz = mean_hz - mean_index * step_hz;
    if !(step_hz > 0.0 && start_hz > 0.0) {
        return Err(format!(
            "expected positive, ascending frequencies in hertz, found a start of {start_hz} Hz and a step of {step_hz} Hz"
        ));
    }
    if start_hz < MIN_FREQUENCY_HZ {
        return Err(format!(
            "expected hertz, at least {MIN_FREQUENCY_HZ}, found a start of {start_hz}: multiply them if they are in \
             GHz or MHz"
        ));
    }
    let residual = |(k, f): (usize, &f64)| (f - (start_hz + k as f64 * step_hz)).abs();
    let residuals = hz.iter().enumerate().map(residual);
    let worst = residuals.fold(0.0, |a: f64, b| a.max(b));
    let most = max_residual_hz(hz.iter().fold(0.0, |a: f64, &b| a.max(b)), step_hz);
    if worst > most {
        return Err(format!(
            "expected equal spacing within {most:.0} Hz, found a sample {worst:.0} Hz off the straight line"
        ));
    }
    Ok((start_hz, step_hz))
}

/// Maximum deviation of a recorded frequency from the fitted line: four float32 steps at the highest frequency (4096
/// Hz at 9.6 GHz), and at most a quarter of the line's step.
fn max_residual_hz(largest_hz: f64, step_hz: f64) -> f64 {
    let largest = largest_hz as f32;
    let float_step_hz = f64::from(largest.next_up()) - f64::from(largest);
    (4.0 * float_step_hz).min(step_hz / 4.0)
}
