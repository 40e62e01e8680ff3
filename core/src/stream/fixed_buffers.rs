//! Statically sized buffers of a fixed-point processor.

use num_complex::Complex;

use super::fixed_point::{FixedSlices, PulsePhase};
use super::{BlockFloat, Capacity, FixedEngine, Patch, PulseStores, SubCpiProcessor};
use crate::{LengthError, Sc16, fft};

/// Map buffer in fixed point: `DOPPLER_BINS` rows of `FREQUENCIES` samples (or of a range gate) with their
/// exponents. `BLOCKS` must be [`BlockFloat::blocks`]`(FREQUENCIES) + 1`.
#[derive(Debug)]
pub struct FixedMap<const FREQUENCIES: usize, const DOPPLER_BINS: usize, const BLOCKS: usize> {
    cells: [[Sc16; FREQUENCIES]; DOPPLER_BINS],
    row_exponents: [[i8; BLOCKS]; DOPPLER_BINS],
    column_exponents: [i8; FREQUENCIES],
}

impl<const FREQUENCIES: usize, const DOPPLER_BINS: usize, const BLOCKS: usize>
    FixedMap<FREQUENCIES, DOPPLER_BINS, BLOCKS>
{
    /// Size in bytes.
    pub const BYTES: usize = size_of::<Self>();

    /// Create an empty map buffer. All bytes are zero, so a static is placed in `.bss`.
    pub const fn new() -> Self {
        const {
            assert!(
                DOPPLER_BINS >= 1 && DOPPLER_BINS <= 4096,
                "DOPPLER_BINS must be 1 to 4096"
            );
            assert!(
                BLOCKS == BlockFloat::blocks(FREQUENCIES) + 1,
                "BLOCKS must be FREQUENCIES / 32, rounded up, plus 1"
            );
        };
        Self {
            cells: [[Sc16::ZERO; FREQUENCIES]; DOPPLER_BINS],
            row_exponents: [[0; BLOCKS]; DOPPLER_BINS],
            column_exponents: [0; FREQUENCIES],
        }
    }
}

impl<const FREQUENCIES: usize, const DOPPLER_BINS: usize, const BLOCKS: usize> Default
    for FixedMap<FREQUENCIES, DOPPLER_BINS, BLOCKS>
{
    fn default() -> Self {
        Self::new()
    }
}

/// Work buffers of the fixed-point path other than the pulse stores and the map.
#[derive(Debug)]
pub struct FixedScratch<
    const PULSES: usize,
    const FREQUENCIES: usize,
    const RANGE_BINS: usize,
    const PATCHES: usize,
> {
    work: [Complex<i32>; RANGE_BINS],
    folded: [Complex<i32>; PULSES],
    phases: [PulsePhase; PULSES],
    weights: [f32; FREQUENCIES],
    patches: [Patch; PATCHES],
}

impl<const PULSES: usize, const FREQUENCIES: usize, const RANGE_BINS: usize, const PATCHES: usize>
    FixedScratch<PULSES, FREQUENCIES, RANGE_BINS, PATCHES>
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
        let zero = Complex { re: 0, im: 0 };
        Self {
            work: [zero; RANGE_BINS],
            folded: [zero; PULSES],
            phases: [PulsePhase::EMPTY; PULSES],
            weights: [0.0; FREQUENCIES],
            patches: [Patch::EMPTY; PATCHES],
        }
    }
}

impl<const PULSES: usize, const FREQUENCIES: usize, const RANGE_BINS: usize, const PATCHES: usize>
    Default for FixedScratch<PULSES, FREQUENCIES, RANGE_BINS, PATCHES>
{
    fn default() -> Self {
        Self::new()
    }
}

impl<'a> SubCpiProcessor<'a, FixedEngine<'a>> {
    /// Create a fixed-point processor on statically sized buffers.
    ///
    /// # Errors
    /// [`LengthError`] if a buffer is too short, which arrays of these types rule out.
    pub fn fixed<
        const PULSES: usize,
        const FREQUENCIES: usize,
        const RANGE_BINS: usize,
        const DOPPLER_BINS: usize,
        const BLOCKS: usize,
        const PATCHES: usize,
    >(
        stores: &'a mut PulseStores<Sc16, PULSES, FREQUENCIES>,
        map: &'a mut FixedMap<FREQUENCIES, DOPPLER_BINS, BLOCKS>,
        scratch: &'a mut FixedScratch<PULSES, FREQUENCIES, RANGE_BINS, PATCHES>,
    ) -> Result<Self, LengthError> {
        const {
            assert!(
                RANGE_BINS >= DOPPLER_BINS,
                "RANGE_BINS must be at least DOPPLER_BINS: columns use the scratch buffer of rows"
            );
        };
        let capacity = Capacity {
            pulses: PULSES as u16,
            frequencies: FREQUENCIES as u16,
            range_bins: RANGE_BINS as u16,
            doppler_bins: DOPPLER_BINS as u16,
            patches: PATCHES as u16,
        };
        let slices = FixedSlices {
            cells: map.cells.as_flattened_mut(),
            column_exponents: &mut map.column_exponents,
            row_exponents: map.row_exponents.as_flattened_mut(),
            work: &mut scratch.work,
            phases: &mut scratch.phases,
            folded: &mut scratch.folded,
        };
        let engine = FixedEngine::new(slices, &capacity)?;
        let (weights, patches) = (&mut scratch.weights, &mut scratch.patches);
        Ok(Self::with_buffers(
            engine,
            capacity,
            weights,
            patches,
            stores.split(),
        ))
    }
}

/// All buffers of a fixed-point processor in one value, for a device with one memory.
///
/// ```
/// use subaperture_core::stream::FixedBuffers;
/// static BUFFERS: FixedBuffers<30, 424, 1024, 41, 15, 16> = FixedBuffers::new();
/// println!("{} bytes", FixedBuffers::<30, 424, 1024, 41, 15, 16>::BYTES);
/// ```
/// A number of blocks that does not match the frequencies does not compile:
/// ```compile_fail
/// use subaperture_core::stream::FixedBuffers;
/// static BUFFERS: FixedBuffers<30, 424, 1024, 41, 14, 16> = FixedBuffers::new();
/// ```
#[derive(Debug, Default)]
pub struct FixedBuffers<
    const PULSES: usize,
    const FREQUENCIES: usize,
    const RANGE_BINS: usize,
    const DOPPLER_BINS: usize,
    const BLOCKS: usize,
    const PATCHES: usize,
> {
    stores: PulseStores<Sc16, PULSES, FREQUENCIES>,
    map: FixedMap<FREQUENCIES, DOPPLER_BINS, BLOCKS>,
    scratch: FixedScratch<PULSES, FREQUENCIES, RANGE_BINS, PATCHES>,
}

impl<
    const PULSES: usize,
    const FREQUENCIES: usize,
    const RANGE_BINS: usize,
    const DOPPLER_BINS: usize,
    const BLOCKS: usize,
    const PATCHES: usize,
> FixedBuffers<PULSES, FREQUENCIES, RANGE_BINS, DOPPLER_BINS, BLOCKS, PATCHES>
{
    /// Size in bytes.
    pub const BYTES: usize = size_of::<Self>();

    /// Create empty buffers. All bytes are zero.
    pub const fn new() -> Self {
        Self {
            stores: PulseStores::new(),
            map: FixedMap::new(),
            scratch: FixedScratch::new(),
        }
    }

    /// Borrow the buffers as a processor.
    ///
    /// # Errors
    /// [`LengthError`] if a buffer is too short, which arrays of these types rule out.
    pub fn processor(&mut self) -> Result<SubCpiProcessor<'_, FixedEngine<'_>>, LengthError> {
        SubCpiProcessor::fixed(&mut self.stores, &mut self.map, &mut self.scratch)
    }
}
