//! A library with the C interface of UHD 4.3 backed by the simulated radio. Loaded in place of `libuhd.so`, it lets tests run all calls of
//! the binding without a device. It refuses the mistakes of a binding that UHD refuses: a second channel without its subdevice, two
//! channels at once without a time, a burst that begins twice.
//!
//! The scene is fixed (`scene.rs`). The variable `SUBAPERTURE_STAND_IN_FAULTS` selects faults: `faults`, `unplug`, `two` for two radios, or
//! `images` for a computer without UHD's images.

mod device;
mod exports;
mod scene;
