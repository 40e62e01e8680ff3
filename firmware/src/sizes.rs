//! The sizes that a program is built for, by feature: `size-small`, `size-large`, or neither.
//!
//! | | pulses | frequencies | range transform | Doppler rows | patches | for |
//! |---|---|---|---|---|---|---|
//! | `size-small` | 16 | 64 | 128 | 17 | 4 | parts of 64K of RAM |
//! | (neither) | 32 | 432 | 1024 | 45 | 16 | X-band spotlight, a 10 m patch at 0.25 m |
//! | `size-large` | 62 | 512 | 2048 | 70 | 64 | all of an STM32H743 |
//!
//! An odometer, for increments instead of maps, has room for 4 targets, 2 channels of 64 frequencies and transforms of 256 points in `size-small`, 8, 4, 256 and 1024 otherwise: its memory is that
//! next to the core, where `size-large` leaves no more. Nor does it to a profiler, for range profiles of a stepped-carrier radar: tones of 16 samples a period, 64 carriers and 128 bins in `size-small`, 32, 256 and 512 otherwise.
//!
//! What `size-large` fills: two stores of 62 pulses of 512 samples of 8 bytes and 72 of geometry are
//! 516 832 of the 524 288 bytes of AXI SRAM; 70 rows of 512 samples of 8 bytes are 286 720 of the
//! 294 912 of SRAM1 to 3. (A run may use fewer of everything than there is room for.)

use subaperture_core::stream::BlockFloat;

#[cfg(all(feature = "size-small", feature = "size-large"))]
compile_error!("two sizes: choose one of size-small and size-large, or neither");

/// Pulses, frequencies, points of the range transform, Doppler rows, patches.
const SIZES: [usize; 5] = if cfg!(feature = "size-small") {
    [16, 64, 128, 17, 4]
} else if cfg!(feature = "size-large") {
    [62, 512, 2048, 70, 64]
} else {
    [32, 432, 1024, 45, 16]
};

/// Name of the sizes, for people.
pub const NAME: &str = if cfg!(feature = "size-small") {
    "small"
} else if cfg!(feature = "size-large") {
    "large"
} else {
    "medium"
};

/// Most pulses a sub-CPI.
pub const PULSES: usize = SIZES[0];
/// Most frequencies a pulse.
pub const FREQUENCIES: usize = SIZES[1];
/// Longest range transform.
pub const RANGE_BINS: usize = SIZES[2];
/// Doppler rows of the map buffer.
pub const DOPPLER_BINS: usize = SIZES[3];
/// Most patches.
pub const PATCHES: usize = SIZES[4];
/// Blocks of a fixed-point row, and one.
pub const BLOCKS: usize = FREQUENCIES.div_ceil(BlockFloat::BLOCK) + 1;
/// Most targets and candidates that an odometer follows.
pub const TARGETS: usize = ODOMETER[0];
/// Most channels of an odometer.
pub const CHANNELS: usize = ODOMETER[1];
/// Most frequencies of an odometer's pulse.
pub const ODOMETER_FREQUENCIES: usize = ODOMETER[2];
/// Longest range transform of an odometer.
pub const ODOMETER_BINS: usize = ODOMETER[3];

/// Targets, channels, frequencies, points of the range transform of an odometer.
const ODOMETER: [usize; 4] = if cfg!(feature = "size-small") {
    [4, 2, 64, 256]
} else {
    [8, 4, 256, 1024]
};

/// Most samples a period of a stepped-carrier radar's tone.
pub const PROFILER_PERIOD: usize = PROFILER[0];
/// Most carriers a sweep.
pub const CARRIERS: usize = PROFILER[1];
/// Most bins of a range profile.
pub const PROFILER_BINS: usize = PROFILER[2];

/// Samples a period, carriers, bins of a profiler.
const PROFILER: [usize; 3] = if cfg!(feature = "size-small") {
    [16, 64, 128]
} else {
    [32, 256, 512]
};

/// Most pixels of a chip.
pub const CHIP_PIXELS: usize = 1024;
