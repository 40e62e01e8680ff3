//! Buffer sizes of a program, selected by feature: `size-small`, `size-large`, or neither (medium).
//!
//! | | pulses | frequencies | range transform | Doppler rows | patches | for |
//! |---|---|---|---|---|---|---|
//! | `size-small` | 16 | 64 | 128 | 17 | 4 | devices with 64K of RAM |
//! | (neither) | 32 | 432 | 1024 | 45 | 16 | X-band spotlight, a 10 m patch at 0.25 m |
//! | `size-large` | 62 | 512 | 2048 | 70 | 64 | all of an STM32H743 |
//!
//! The odometer (increments instead of maps) has 4 targets, 2 channels of 64 frequencies and transforms of 256 points in
//! `size-small`, otherwise 8, 4, 256 and 1024: it uses the memory next to the core, where `size-large` leaves no more. The
//! same holds for the range profiler of a stepped-frequency radar: tones of 16 samples per period, 64 carriers and 128 bins
//! in `size-small`, otherwise 32, 256 and 512.
//!
//! `size-large` fills the memory: two stores of 62 pulses, each with 512 samples of 8 bytes and 72 bytes of geometry, take
//! 516 832 of the 524 288 bytes of AXI SRAM; 70 rows of 512 samples of 8 bytes and 64 image chips take 292 352 of the 294 912
//! bytes of SRAM1 to 3. A run may use less than the capacity of each.

use subaperture_core::stream::BlockFloat;

#[cfg(all(feature = "size-small", feature = "size-large"))]
compile_error!("conflicting sizes: choose one of size-small and size-large, or neither");

/// Pulses, frequencies, range transform length, Doppler rows, patches.
const SIZES: [usize; 5] = if cfg!(feature = "size-small") {
    [16, 64, 128, 17, 4]
} else if cfg!(feature = "size-large") {
    [62, 512, 2048, 70, 64]
} else {
    [32, 432, 1024, 45, 16]
};

/// Name of the selected size.
pub const NAME: &str = if cfg!(feature = "size-small") {
    "small"
} else if cfg!(feature = "size-large") {
    "large"
} else {
    "medium"
};

/// Maximum pulses per sub-CPI.
pub const PULSES: usize = SIZES[0];
/// Maximum frequencies per pulse.
pub const FREQUENCIES: usize = SIZES[1];
/// Maximum range transform length.
pub const RANGE_BINS: usize = SIZES[2];
/// Doppler rows of the map buffer.
pub const DOPPLER_BINS: usize = SIZES[3];
/// Maximum number of patches.
pub const PATCHES: usize = SIZES[4];
/// Exponent blocks of a fixed-point row, plus one.
pub const BLOCKS: usize = FREQUENCIES.div_ceil(BlockFloat::BLOCK) + 1;
/// Maximum number of targets and candidates of the odometer.
pub const TARGETS: usize = ODOMETER[0];
/// Maximum number of channels of the odometer.
pub const CHANNELS: usize = ODOMETER[1];
/// Maximum frequencies per pulse of the odometer.
pub const ODOMETER_FREQUENCIES: usize = ODOMETER[2];
/// Maximum range transform length of the odometer.
pub const ODOMETER_BINS: usize = ODOMETER[3];

/// Odometer: targets, channels, frequencies, range transform length.
const ODOMETER: [usize; 4] = if cfg!(feature = "size-small") {
    [4, 2, 64, 256]
} else {
    [8, 4, 256, 1024]
};

/// Maximum samples per period of a stepped-frequency radar's tone.
pub const PROFILER_PERIOD: usize = PROFILER[0];
/// Maximum carriers per sweep.
pub const CARRIERS: usize = PROFILER[1];
/// Maximum bins of a range profile.
pub const PROFILER_BINS: usize = PROFILER[2];

/// Profiler: samples per period, carriers, bins.
const PROFILER: [usize; 3] = if cfg!(feature = "size-small") {
    [16, 64, 128]
} else {
    [32, 256, 512]
};

/// Maximum number of pixels of an accumulated image. The medium size uses the rest of AXI SRAM, 262 144 bytes in float; the
/// others leave room for the stack and the stores.
pub const PIXELS: usize = if cfg!(any(feature = "size-small", feature = "size-large")) {
    1024
} else {
    32_768
};
/// Maximum number of sub-CPIs of an accumulated image: one bit each.
pub const SUB_CPIS: usize = if cfg!(feature = "size-small") {
    2048
} else {
    16_384
};
