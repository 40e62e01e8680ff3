//! The arithmetics as the link sees them.

use subaperture_core::Pulse;
use subaperture_core::link::{Arithmetic, Encoding, complex32s, sc16s};
use subaperture_core::stream::{
    Engine, FixedEngine, FloatEngine, PulseError, Sample, SubCpiProcessor,
};

/// An engine that can be fed from the wire.
pub trait WireEngine: Engine<Sample: Sample> + Sized {
    /// What the host is told.
    const ARITHMETIC: Arithmetic;
    /// How its maps are sent.
    const MAP_ENCODING: Encoding;

    /// Pushes a pulse; none if this arithmetic takes no such samples: it is then counted as one that could
    /// not be used.
    fn push(
        processor: &mut SubCpiProcessor<'_, Self>,
        pulse: &Pulse,
        encoding: Encoding,
        samples: &[u8],
    ) -> Option<Result<(), PulseError>>;
}

impl WireEngine for FloatEngine<'_> {
    const ARITHMETIC: Arithmetic = Arithmetic::Float;
    const MAP_ENCODING: Encoding = Encoding::Complex32;

    fn push(
        processor: &mut SubCpiProcessor<'_, Self>,
        pulse: &Pulse,
        encoding: Encoding,
        samples: &[u8],
    ) -> Option<Result<(), PulseError>> {
        Some(match encoding {
            Encoding::Complex32 => processor.push(pulse, complex32s(samples)),
            Encoding::Sc16 => processor.push(pulse, sc16s(samples).map(|z| z.to_complex32())),
        })
    }
}

impl WireEngine for FixedEngine<'_> {
    const ARITHMETIC: Arithmetic = Arithmetic::Fixed;
    const MAP_ENCODING: Encoding = Encoding::Sc16;

    fn push(
        processor: &mut SubCpiProcessor<'_, Self>,
        pulse: &Pulse,
        encoding: Encoding,
        samples: &[u8],
    ) -> Option<Result<(), PulseError>> {
        match encoding {
            Encoding::Complex32 => {
                // Without samples it is refused, and its number is used up.
                let _ = processor.push(pulse, core::iter::empty());
                None
            }
            Encoding::Sc16 => Some(processor.push(pulse, sc16s(samples))),
        }
    }
}
