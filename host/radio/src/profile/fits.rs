//! Whether two set-ups are one, as far as a calibration goes.

use crate::antennas::Antennas;
use crate::sigmf::Setup;

/// Farthest that an antenna may be from where it was, metres: half a degree of phase at 1.5 GHz.
const MOVED_M: f64 = 3e-4;

/// The first thing in which what a calibration was made with differs from what it is to be used with, in words.
pub(super) fn differs(own: &Setup, asked: &Setup) -> Option<String> {
    let numbers = [
        ("a first carrier of", own.start_hz, asked.start_hz, "Hz"),
        ("steps of", own.step_hz, asked.step_hz, "Hz"),
        ("a rate of", own.sample_rate_hz, asked.sample_rate_hz, "Hz"),
        (
            "a transmitting gain of",
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
            "a receiving gain of",
            own.receive_gain_db[1],
            asked.receive_gain_db[1],
            "dB",
        ),
        (
            "carriers numbering",
            own.steps as f64,
            asked.steps as f64,
            "",
        ),
        (
            "samples a period of the tone numbering",
            own.period as f64,
            asked.period as f64,
            "",
        ),
    ];
    for (what, of, asked, unit) in numbers {
        let alike = (of - asked).abs() <= 1e-9 * of.abs();
        // A number that is none is like nothing.
        if !alike {
            return Some(format!("{what} {of} {unit}, and this has {asked}"));
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
        return Some(format!("{}, and this is {}", name(own), name(asked)));
    }
    if own.reference != asked.reference {
        return Some(format!(
            "the {} as the reference, and this has the {}",
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
            "an antenna {:.4} m from where it is now",
            apart_m(own, asked)
        )),
        (Some(_), None) | (None, Some(_)) => {
            Some("antennas whose places only one of the two plans says".to_owned())
        }
        _ => None,
    }
}
