//! The module: pulses in over the serial link, maps out.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod target {
    use cortex_m_rt::entry;
    use subaperture_core::Complex32;
    use subaperture_core::cfar::Column;
    use subaperture_core::link::{max_frame_bytes, max_received_bytes};
    use subaperture_core::stream::SubCpiProcessor;
    #[cfg(not(feature = "fixed"))]
    use subaperture_core::{
        Complex32 as Sample,
        stream::{FloatMap, FloatScratch as Scratch, PulseStores},
    };
    #[cfg(feature = "fixed")]
    use subaperture_core::{
        Sc16 as Sample,
        stream::{FixedMap, FixedScratch as Scratch, PulseStores},
    };
    use subaperture_firmware::board::{Board, Current};
    use subaperture_firmware::memory::Placed;
    use subaperture_firmware::products::{ChipKernel, ProductBuffers};
    use subaperture_firmware::serve::serve;
    #[cfg(feature = "fixed")]
    use subaperture_firmware::sizes::BLOCKS;
    use subaperture_firmware::sizes::{
        CHIP_PIXELS, DOPPLER_BINS, FREQUENCIES, NAME, PATCHES, PULSES, RANGE_BINS,
    };
    use subaperture_firmware::station::{LinkBuffers, Station};
    use subaperture_firmware::{fault, place};

    #[cfg(feature = "fixed")]
    type Map = FixedMap<FREQUENCIES, DOPPLER_BINS, BLOCKS>;
    #[cfg(not(feature = "fixed"))]
    type Map = FloatMap<FREQUENCIES, DOPPLER_BINS>;

    // The stores are written once a sample and read once a map: the slower, larger memory.
    place!(axi static STORES: PulseStores<Sample, PULSES, FREQUENCIES> = PulseStores::new());
    place!(sram static MAP: Map = Map::new());
    // What every piece of work goes through: the memory next to the core.
    static SCRATCH: Placed<Scratch<PULSES, FREQUENCIES, RANGE_BINS, PATCHES>> =
        Placed::new(Scratch::new());
    static RECEIVED: Placed<[u8; max_received_bytes(FREQUENCIES)]> =
        Placed::new([0; max_received_bytes(FREQUENCIES)]);
    static FRAME: Placed<[u8; max_frame_bytes(FREQUENCIES)]> =
        Placed::new([0; max_frame_bytes(FREQUENCIES)]);
    static ROW: Placed<[u8; 8 * FREQUENCIES]> = Placed::new([0; 8 * FREQUENCIES]);
    static CHIP: Placed<[Complex32; CHIP_PIXELS]> = Placed::new([Complex32::ZERO; CHIP_PIXELS]);
    static COLUMNS: Placed<[Column; FREQUENCIES]> = Placed::new([Column::EMPTY; FREQUENCIES]);

    #[entry]
    fn main() -> ! {
        let Some(mut board) = Current::take() else {
            fault::die(format_args!("the board was taken before the program began"));
        };
        board.log(format_args!(
            "subaperture {} {NAME} on {}, {} resets",
            env!("CARGO_PKG_VERSION"),
            Current::NAME,
            fault::resets()
        ));
        let kernel = ChipKernel::new();
        let (Some(stores), Some(map), Some(scratch)) =
            (STORES.try_take(), MAP.try_take(), SCRATCH.try_take())
        else {
            taken();
        };
        let (Some(received), Some(frame), Some(row), Some(chip), Some(columns)) = (
            RECEIVED.try_take(),
            FRAME.try_take(),
            ROW.try_take(),
            CHIP.try_take(),
            COLUMNS.try_take(),
        ) else {
            taken();
        };
        #[cfg(not(feature = "fixed"))]
        let processor = SubCpiProcessor::float(stores, map, scratch);
        #[cfg(feature = "fixed")]
        let Ok(processor) = SubCpiProcessor::fixed(stores, map, scratch) else {
            fault::die(format_args!("a buffer is too small"));
        };
        let buffers = LinkBuffers {
            received,
            frame,
            row,
        };
        let products = ProductBuffers {
            chip,
            kernel: &kernel,
            columns,
        };
        let version = concat!("subaperture ", env!("CARGO_PKG_VERSION"));
        serve(board, Station::new(processor, buffers, products, version))
    }

    fn taken() -> ! {
        fault::die(format_args!("a buffer was taken before the program began"))
    }
}

#[cfg(not(target_os = "none"))]
fn main() {
    println!("this program is for a board");
}
