//! Comparison of the set-up of a calibration with that of a capture.

use crate::antennas::Antennas;
use crate::sigmf::Setup;

/// Largest shift of an antenna accepted, metres; half a degree of phase at 1.5 GHz.
const MOVED_M: f64 = 3e-4;

/// First difference between the set-up of a calibration and that of a capture, in words; `None` if they match.
pub(super) fn differs(own: &Setup, asked: &Setup) -> Option<String> {
    let numbers = [
        ("a first carrier of", own.start_hz, asked.start_hz, "Hz"),
        ("a step of", own.step_hz, asked.step_hz, "Hz"),
        (
            "a sample rate of",
            own.sample_rate_hz,
            asked.sample_rate_hz,
            "Hz",
        ),
        (
            "a transmit gain of",
            own.transmit_gain_db,
            asked.transmit_gain_db,
            "dB",
        ),
        (
            "a reference gain of",
            own.receive_gain_db[0],
            asked.receive_gain_db[0],
            "dB",
        ),
        (
            "a receive gain of",
            own.receive_gain_db[1],
            asked.receive_gain_db[1],
            "dB",
        ),
        (
            "a number of carriers of",
            own.steps as f64,
            asked.steps as f64,
            "",
        ),
        (
            "a tone period in samples of",
            own.period as f64,
            asked.period as f64,
            "",
        ),
    ];
    for (what, of, asked, unit) in numbers {
        let alike = (of - asked).abs() <= 1e-9 * of.abs();
        // A NaN differs from every number.
        if !alike {
            return Some(format!("{what} {of} {unit}, but this set-up has {asked}"));
        }
    }
    if own.hardware != asked.hardware || own.receive_antennas != asked.receive_antennas {
        let name = |setup: &Setup| {
            format!(
                "{} at {}",
                setup.hardware,
                setup.receive_antennas.join(", ")
            )
        };
        return Some(format!(
            "{}, but this set-up has {}",
            name(own),
            name(asked)
        ));
    }
    if own.reference != asked.reference {
        return Some(format!(
            "a {} reference, but this set-up has {}",
            own.reference.name(),
            asked.reference.name()
        ));
    }
    let apart_m = |own: &Antennas, asked: &Antennas| {
        let [a, b] =
            [own, asked].map(|it| [it.transmitter_m, it.receivers_m[0], it.receivers_m[1]]);
        (0..3).map(|i| a[i].distance(b[i])).fold(0.0, f64::max)
    };
    match (&own.antennas, &asked.antennas) {
        (Some(own), Some(asked)) if apart_m(own, asked) > MOVED_M => Some(format!(
            "an antenna {:.4} m away from its present position",
            apart_m(own, asked)
        )),
        (Some(_), None) | (None, Some(_)) => {
            Some("antenna positions in only one of the two plans".to_owned())
        }
        _ => None,
    }
}
