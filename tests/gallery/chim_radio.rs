//! Expected values of the items of Chim 2018 on software-defined radio.

use crate::chim::three_objects;
use crate::figures::{About, Figure, Within, at_most, figure};

/// Expected checks of an item.
pub(crate) fn figures(id: &str) -> Option<Vec<Figure>> {
    Some(match id {
        "c-5-8" => chirps(),
        "c-5-13-radio" => through_the_radio(),
        "c-5-13-module" => by_the_module(),
        _ => return None,
    })
}

/// 2 cm of standard deviation by noise of -20 dB per sample with 3 pulses (`host/radio/tests/chirp.rs`); here 7 pulses at less noise.
fn chirps() -> Vec<Figure> {
    vec![
        figure(
            "range by the slope of the phase, 6.300 m simulated",
            "not given",
            "{} m",
            [About(6.3, 0.01)],
            "where the reflector was put",
        ),
        figure(
            "deviation of the phase from a straight line over 0.8 of the band, RMS",
            "a delay alone",
            "{} rad",
            [at_most(0.05)],
            "noise of a line: the chirp cancels in the ratio",
        ),
    ]
}

/// The module's values are float32 over sums of 50 carriers and at most 16 blocks: -115 dB (`tests/stream/sweep.rs`).
fn by_the_module() -> Vec<Figure> {
    vec![
        figure(
            "module - host, RMS over RMS",
            "not given",
            "{} dB",
            [Within(-170.0, -110.0)],
            "float32",
        ),
        figure(
            "values bit-identical to the core on this computer",
            "not given",
            "yes",
            [],
            "the same operations in the same order",
        ),
        figure(
            "bytes from the module for each byte to it",
            "not given",
            "{}",
            // 128 values of 8 bytes of 50 bursts of 8 bytes a sample, and the frames around them.
            [Within(0.0025, 0.005)],
            "sizes of the messages",
        ),
    ]
}

/// With a Hamming window the side lobes of one object at another are below -40 dB, an error of less than a tenth of a cell.
fn through_the_radio() -> Vec<Figure> {
    let from = "where it was put, to a fifth of a cell: walls have a width";
    let mut figures = three_objects(0.2, from);
    figures.push(figure(
        "largest over mean magnitude, before calibration: with the reference, without",
        "the reference removes the phases of each retune",
        "{}, {}",
        [Within(6.0, 50.0), Within(1.5, 4.0)],
        "one strong echo in 50 cells; Rayleigh magnitudes, whose largest of 50 exceeds 4 means in one of 4000",
    ));
    figures
}
