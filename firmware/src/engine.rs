//! Interface between the link and the core's arithmetic engines.

use subaperture_core::Pulse;
use subaperture_core::link::{Arithmetic, Encoding, complex32s, sc16s};
use subaperture_core::stream::{
    Engine, FixedEngine, FloatEngine, PulseError, Sample, SubCpiProcessor,
};

/// Engine that accepts samples in the link's encodings.
pub trait WireEngine: Engine<Sample: Sample> + Sized {
    /// Arithmetic reported to the host.
    const ARITHMETIC: Arithmetic;
    /// Encoding of the maps sent.
    const MAP_ENCODING: Encoding;

    /// Push a pulse. `None` if this arithmetic does not accept the encoding; the pulse is then counted as refused.
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
                // Without samples it is refused and its number is consumed.
                let _ = processor.push(pulse, core::iter::empty());
                None
            }
            Encoding::Sc16 => Some(processor.push(pulse, sc16s(samples))),
        }
    }
}
