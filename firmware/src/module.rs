//! Static buffers of the module and the endpoint that uses them; run by the application and measured by `cycles`.

use subaperture_core::Complex32;
use subaperture_core::accumulate::ChipKernel;
use subaperture_core::cfar::Column;
use subaperture_core::link::{CHIP_PART_PIXELS, max_frame_bytes, max_received_bytes};
use subaperture_core::motion::Odometer;
use subaperture_core::stream::{PulseStores, SubCpiProcessor};
use subaperture_core::sweep::Profiler;
#[cfg(not(feature = "fixed"))]
use subaperture_core::{
    Complex32 as Sample,
    stream::{FloatEngine, FloatMap, FloatScratch as Scratch},
};
#[cfg(feature = "fixed")]
use subaperture_core::{
    Sc16 as Sample,
    stream::{FixedEngine, FixedMap, FixedScratch as Scratch},
};

use crate::endpoint::{Endpoint, LinkBuffers};
#[cfg(any(feature = "board-an500", feature = "spi-front-end"))]
use crate::front_end::{GeometryQueue, frame::frame_bytes};
use crate::memory::Placed;
use crate::place;
use crate::products::{ChannelValues, Chip, NO_VALUES, ProductBuffers};
#[cfg(feature = "fixed")]
use crate::sizes::BLOCKS;
use crate::sizes::{
    CARRIERS, CHANNELS, DOPPLER_BINS, FREQUENCIES, ODOMETER_BINS, ODOMETER_FREQUENCIES, PATCHES,
    PIXELS, PROFILER_BINS, PROFILER_PERIOD, PULSES, RANGE_BINS, SUB_CPIS, TARGETS,
};

/// Arithmetic that this program is built for.
#[cfg(feature = "fixed")]
pub type Engine<'a> = FixedEngine<'a>;
/// Arithmetic that this program is built for.
#[cfg(not(feature = "fixed"))]
pub type Engine<'a> = FloatEngine<'a>;

#[cfg(feature = "fixed")]
type Map = FixedMap<FREQUENCIES, DOPPLER_BINS, BLOCKS>;
#[cfg(not(feature = "fixed"))]
type Map = FloatMap<FREQUENCIES, DOPPLER_BINS>;

// Stores are written once per sample and read once per map: placed in the slower, larger memory.
place!(axi static STORES: PulseStores<Sample, PULSES, FREQUENCIES> = PulseStores::new());
#[cfg(not(feature = "size-large"))]
place!(axi static PIXEL_SUMS: [Complex32; PIXELS] = [Complex32::ZERO; PIXELS]);
// The stores of this size fill that memory.
#[cfg(feature = "size-large")]
static PIXEL_SUMS: Placed<[Complex32; PIXELS]> = Placed::new([Complex32::ZERO; PIXELS]);
place!(sram static MAP: Map = Map::new());
place!(sram static CHIPS: [Chip; PATCHES] = [Chip::EMPTY; PATCHES]);
// Used by every processing step: placed in the memory next to the core.
static SCRATCH: Placed<Scratch<PULSES, FREQUENCIES, RANGE_BINS, PATCHES>> =
    Placed::new(Scratch::new());
static RECEIVED: Placed<[u8; max_received_bytes(FREQUENCIES)]> =
    Placed::new([0; max_received_bytes(FREQUENCIES)]);
static FRAME: Placed<[u8; max_frame_bytes(FREQUENCIES)]> =
    Placed::new([0; max_frame_bytes(FREQUENCIES)]);
static ROW: Placed<[u8; 8 * FREQUENCIES]> = Placed::new([0; 8 * FREQUENCIES]);
static ODOMETER: Placed<Odometer<TARGETS, CHANNELS, ODOMETER_FREQUENCIES, ODOMETER_BINS>> =
    Placed::new(Odometer::new());
static PROFILER: Placed<Profiler<PROFILER_PERIOD, CARRIERS, PROFILER_BINS>> =
    Placed::new(Profiler::new());
static ACCUMULATED: Placed<[u8; SUB_CPIS / 8]> = Placed::new([0; SUB_CPIS / 8]);
static VALUES: Placed<ChannelValues> = Placed::new(NO_VALUES);
static COLUMNS: Placed<[Column; FREQUENCIES]> = Placed::new([Column::EMPTY; FREQUENCIES]);

/// Geometry of the pulses that wait for samples of the front end.
#[cfg(any(feature = "board-an500", feature = "spi-front-end"))]
pub static GEOMETRY: Placed<GeometryQueue> = Placed::new(GeometryQueue::new());
/// Buffer of the front end: a frame with the maximum number of samples.
#[cfg(any(feature = "board-an500", feature = "spi-front-end"))]
pub static FRONT_END: Placed<[u8; frame_bytes(FREQUENCIES)]> =
    Placed::new([0; frame_bytes(FREQUENCIES)]);

const _: () = assert!(
    FREQUENCIES >= CHIP_PART_PIXELS,
    "the row buffer holds a part of a chip"
);

/// Create the endpoint on all of the module's buffers. `None` if they were taken before.
pub fn endpoint(kernel: &ChipKernel) -> Option<Endpoint<'_, Engine<'_>>> {
    let (stores, map, scratch) = (STORES.try_take()?, MAP.try_take()?, SCRATCH.try_take()?);
    #[cfg(not(feature = "fixed"))]
    let processor = SubCpiProcessor::float(stores, map, scratch);
    #[cfg(feature = "fixed")]
    let processor = SubCpiProcessor::fixed(stores, map, scratch).ok()?;
    let buffers = LinkBuffers {
        received: RECEIVED.try_take()?,
        frame: FRAME.try_take()?,
        row: ROW.try_take()?,
    };
    let products = ProductBuffers {
        pixels: PIXEL_SUMS.try_take()?,
        chips: CHIPS.try_take()?,
        accumulated: ACCUMULATED.try_take()?,
        kernel,
        columns: COLUMNS.try_take()?,
        values: VALUES.try_take()?,
    };
    let version = concat!("subaperture ", env!("CARGO_PKG_VERSION"));
    let endpoint = Endpoint::new(processor, buffers, products, version);
    let endpoint = endpoint.with_odometer(ODOMETER.try_take()?);
    Some(endpoint.with_profiler(PROFILER.try_take()?))
}
