//! Statically sized buffers of a float32 processor, suitable for statics.

use super::{Capacity, FloatEngine, Patch, PulsePhase, PulseStores, SubCpiProcessor};
use crate::{Complex32, fft};

/// Map buffer in float32: `DOPPLER_BINS` rows of `FREQUENCIES` samples, or of a range gate.
#[derive(Debug)]
pub struct FloatMap<const FREQUENCIES: usize, const DOPPLER_BINS: usize> {
    cells: [[Complex32; FREQUENCIES]; DOPPLER_BINS],
}

impl<const FREQUENCIES: usize, const DOPPLER_BINS: usize> FloatMap<FREQUENCIES, DOPPLER_BINS> {
    /// Size in bytes.
    pub const BYTES: usize = size_of::<Self>();

    /// Create an empty map buffer. All bytes are zero, so a static is placed in `.bss`.
    pub const fn new() -> Self {
        const {
            assert!(
                DOPPLER_BINS >= 1 && DOPPLER_BINS <= 4096,
                "DOPPLER_BINS must be 1 to 4096"
            );
        };
        Self {
            cells: [[Complex32::ZERO; FREQUENCIES]; DOPPLER_BINS],
        }
    }
}

impl<const FREQUENCIES: usize, const DOPPLER_BINS: usize> Default
    for FloatMap<FREQUENCIES, DOPPLER_BINS>
{
    fn default() -> Self {
        Self::new()
    }
}

/// Work buffers of the float32 path other than the pulse stores and the map.
#[derive(Debug)]
pub struct FloatScratch<
    const PULSES: usize,
    const FREQUENCIES: usize,
    const RANGE_BINS: usize,
    const PATCHES: usize,
> {
    row: [Complex32; RANGE_BINS],
    column: [Complex32; PULSES],
    phases: [PulsePhase; PULSES],
    weights: [f32; FREQUENCIES],
    patches: [Patch; PATCHES],
}

impl<const PULSES: usize, const FREQUENCIES: usize, const RANGE_BINS: usize, const PATCHES: usize>
    FloatScratch<PULSES, FREQUENCIES, RANGE_BINS, PATCHES>
{
    /// Size in bytes.
    pub const BYTES: usize = size_of::<Self>();

    /// Create empty work buffers. All bytes are zero.
    pub const fn new() -> Self {
        const {
            assert!(
                fft::supports(RANGE_BINS) && RANGE_BINS >= FREQUENCIES,
                "RANGE_BINS must be a power of two from 2 to 4096 and at least FREQUENCIES"
            );
            assert!(PATCHES >= 1 && PATCHES <= 4096, "PATCHES must be 1 to 4096");
        };
        Self {
            row: [Complex32::ZERO; RANGE_BINS],
            column: [Complex32::ZERO; PULSES],
            phases: [PulsePhase::EMPTY; PULSES],
            weights: [0.0; FREQUENCIES],
            patches: [Patch::EMPTY; PATCHES],
        }
    }
}

impl<const PULSES: usize, const FREQUENCIES: usize, const RANGE_BINS: usize, const PATCHES: usize>
    Default for FloatScratch<PULSES, FREQUENCIES, RANGE_BINS, PATCHES>
{
    fn default() -> Self {
        Self::new()
    }
}

impl<'a> SubCpiProcessor<'a, FloatEngine<'a>> {
    /// Create a float32 processor on statically sized buffers.
    pub fn float<
        const PULSES: usize,
        const FREQUENCIES: usize,
        const RANGE_BINS: usize,
        const DOPPLER_BINS: usize,
        const PATCHES: usize,
    >(
        stores: &'a mut PulseStores<Complex32, PULSES, FREQUENCIES>,
        map: &'a mut FloatMap<FREQUENCIES, DOPPLER_BINS>,
        scratch: &'a mut FloatScratch<PULSES, FREQUENCIES, RANGE_BINS, PATCHES>,
    ) -> Self {
        let capacity = Capacity {
            pulses: PULSES as u16,
            frequencies: FREQUENCIES as u16,
            range_bins: RANGE_BINS as u16,
            doppler_bins: DOPPLER_BINS as u16,
            patches: PATCHES as u16,
        };
        let engine = FloatEngine::new(
            map.cells.as_flattened_mut(),
            &mut scratch.row,
            &mut scratch.column,
            &mut scratch.phases,
        );
        let (weights, patches) = (&mut scratch.weights, &mut scratch.patches);
        Self::with_buffers(engine, capacity, weights, patches, stores.split())
    }
}

/// All buffers of a float32 processor in one value, for a device with one memory.
///
/// Invalid sizes do not compile. A number of range bins that is not a power of two:
///
/// ```compile_fail
/// use subaperture_core::stream::FloatBuffers;
/// static BUFFERS: FloatBuffers<30, 424, 1000, 41, 16> = FloatBuffers::new();
/// ```
/// Fewer range bins than frequencies:
/// ```compile_fail
/// use subaperture_core::stream::FloatBuffers;
/// static BUFFERS: FloatBuffers<30, 424, 256, 41, 16> = FloatBuffers::new();
/// ```
/// Zero pulses:
/// ```compile_fail
/// use subaperture_core::stream::FloatBuffers;
/// static BUFFERS: FloatBuffers<0, 424, 1024, 41, 16> = FloatBuffers::new();
/// ```
/// Valid sizes:
/// ```
/// use subaperture_core::stream::FloatBuffers;
/// static BUFFERS: FloatBuffers<30, 424, 1024, 41, 16> = FloatBuffers::new();
/// println!("{} bytes", FloatBuffers::<30, 424, 1024, 41, 16>::BYTES);
/// ```
#[derive(Debug, Default)]
pub struct FloatBuffers<
    const PULSES: usize,
    const FREQUENCIES: usize,
    const RANGE_BINS: usize,
    const DOPPLER_BINS: usize,
    const PATCHES: usize,
> {
    stores: PulseStores<Complex32, PULSES, FREQUENCIES>,
    map: FloatMap<FREQUENCIES, DOPPLER_BINS>,
    scratch: FloatScratch<PULSES, FREQUENCIES, RANGE_BINS, PATCHES>,
}

impl<
    const PULSES: usize,
    const FREQUENCIES: usize,
    const RANGE_BINS: usize,
    const DOPPLER_BINS: usize,
    const PATCHES: usize,
> FloatBuffers<PULSES, FREQUENCIES, RANGE_BINS, DOPPLER_BINS, PATCHES>
{
    /// Size in bytes.
    pub const BYTES: usize = size_of::<Self>();

    /// Create empty buffers. All bytes are zero.
    pub const fn new() -> Self {
        Self {
            stores: PulseStores::new(),
            map: FloatMap::new(),
            scratch: FloatScratch::new(),
        }
    }

    /// Borrow the buffers as a processor.
    pub fn processor(&mut self) -> SubCpiProcessor<'_, FloatEngine<'_>> {
        SubCpiProcessor::float(&mut self.stores, &mut self.map, &mut self.scratch)
    }
}
