//! The module: pulses in over the serial link, maps out.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod target {
    use cortex_m_rt::entry;
    use subaperture_core::Complex32;
    use subaperture_core::link::{max_frame_bytes, max_received_bytes};
    use subaperture_core::stream::{FloatMap, FloatScratch, PulseStores, SubCpiProcessor};
    use subaperture_firmware::board::{Board, Current};
    use subaperture_firmware::memory::Placed;
    use subaperture_firmware::serve::serve;
    use subaperture_firmware::sizes::{
        DOPPLER_BINS, FREQUENCIES, NAME, PATCHES, PULSES, RANGE_BINS,
    };
    use subaperture_firmware::station::{LinkBuffers, Station};
    use subaperture_firmware::{fault, place};

    // The stores are written once a sample and read once a map: the slower, larger memory.
    place!(axi static STORES: PulseStores<Complex32, PULSES, FREQUENCIES> = PulseStores::new());
    place!(sram static MAP: FloatMap<FREQUENCIES, DOPPLER_BINS> = FloatMap::new());
    // What every piece of work goes through: the memory next to the core.
    static SCRATCH: Placed<FloatScratch<PULSES, FREQUENCIES, RANGE_BINS, PATCHES>> =
        Placed::new(FloatScratch::new());
    /// The most bytes that the samples of a pulse, or of a row of a map, take.
    const SAMPLE_BYTES: usize = 8 * FREQUENCIES;
    static RECEIVED: Placed<[u8; max_received_bytes(FREQUENCIES)]> =
        Placed::new([0; max_received_bytes(FREQUENCIES)]);
    static FRAME: Placed<[u8; max_frame_bytes(FREQUENCIES)]> =
        Placed::new([0; max_frame_bytes(FREQUENCIES)]);
    static ROW: Placed<[u8; SAMPLE_BYTES]> = Placed::new([0; SAMPLE_BYTES]);

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
        let (Some(stores), Some(map), Some(scratch), Some(received), Some(frame), Some(row)) = (
            STORES.try_take(),
            MAP.try_take(),
            SCRATCH.try_take(),
            RECEIVED.try_take(),
            FRAME.try_take(),
            ROW.try_take(),
        ) else {
            fault::die(format_args!("a buffer was taken before the program began"));
        };
        let buffers = LinkBuffers {
            received,
            frame,
            row,
        };
        let processor = SubCpiProcessor::float(stores, map, scratch);
        let version = concat!("subaperture ", env!("CARGO_PKG_VERSION"));
        serve(board, Station::new(processor, buffers, version))
    }
}

#[cfg(not(target_os = "none"))]
fn main() {
    println!("this program is for a board");
}
