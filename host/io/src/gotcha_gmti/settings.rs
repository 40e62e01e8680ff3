//! Values that the files of a collection do not state.

use super::CHANNELS;
use subaperture_model::units::Dimension;

/// Largest displacement of a receiver, metres: longer than an aircraft.
const MAX_OFFSET_M: f64 = 100.0;

/// Values that the files do not state.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Settings {
    /// Displacement of each channel's receiver from `APCpos` along the track, metres, positive forwards.
    pub receiver_offsets_m: Option<[f64; CHANNELS.len()]>,
    /// Pulse repetition frequency, hertz, in place of the recorded one.
    pub prf_hz: Option<f64>,
}

impl Settings {
    /// Settings of keys and values: `receiver_offset` of three lengths separated by commas, `prf` of a frequency.
    ///
    /// # Errors
    /// Description of an unknown key or of a value, with the expected form.
    pub fn of(pairs: &[(String, String)]) -> Result<Self, String> {
        let mut settings = Self::default();
        for (key, value) in pairs {
            let at_key = |fault: String| format!("{key}: {fault}");
            match key.as_str() {
                "receiver_offset" => {
                    let offsets = Dimension::Length
                        .parse_list(value, CHANNELS.len())
                        .map_err(at_key)?;
                    if let Some(offset) = offsets.iter().find(|m| m.abs() > MAX_OFFSET_M) {
                        return Err(at_key(format!(
                            "expected at most {MAX_OFFSET_M} m, found {offset} m"
                        )));
                    }
                    let mut all = [0.0; CHANNELS.len()];
                    all.copy_from_slice(&offsets);
                    settings.receiver_offsets_m = Some(all);
                }
                "prf" => {
                    let hz = Dimension::Frequency.parse(value).map_err(at_key)?;
                    settings.prf_hz = Some(plausible_prf(hz).map_err(at_key)?);
                }
                _ => {
                    return Err(format!(
                        "unknown setting '{key}': expected receiver_offset or prf"
                    ));
                }
            }
        }
        Ok(settings)
    }
}

/// Check a pulse repetition frequency.
pub(super) fn plausible_prf(hz: f64) -> Result<f64, String> {
    match (1e-3..=1e7).contains(&hz) {
        true => Ok(hz),
        false => Err(format!(
            "expected a pulse repetition frequency from 1e-3 to 1e7 Hz, found {hz} Hz"
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(pairs: &[(&str, &str)]) -> Result<Settings, String> {
        let owned = pairs
            .iter()
            .map(|(k, v)| ((*k).to_owned(), (*v).to_owned()));
        Settings::of(&owned.collect::<Vec<_>>())
    }

    #[test]
    fn settings_have_units_and_refuse_unknown_keys() {
        let settings = of(&[("receiver_offset", "-12cm, 0m, 0.12m"), ("prf", "2kHz")]).unwrap();
        assert_eq!(settings.receiver_offsets_m, Some([-0.12, 0.0, 0.12]));
        assert_eq!(settings.prf_hz, Some(2000.0));
        for (key, value, part) in [
            ("receiver_offset", "1m, 2m", "receiver_offset: "),
            ("receiver_offset", "0m, 0m, 1km", "at most 100 m"),
            ("prf", "0Hz", "from 1e-3 to 1e7 Hz"),
            ("prf", "2", "prf: "),
            ("radar.pri", "1ms", "expected receiver_offset or prf"),
        ] {
            let text = of(&[(key, value)]).unwrap_err();
            assert!(text.contains(part), "{text}");
        }
    }
}
