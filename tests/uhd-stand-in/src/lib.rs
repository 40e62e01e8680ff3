//! A library with the C interface of UHD 4.3 that answers from the simulated radio: loaded in place of `libuhd.so`, it lets tests run
//! all calls of the binding without a device. What UHD refuses it refuses too, where the binding could get it wrong: a second
//! channel without its subdevice, two channels at once without a time, a burst that begins twice.
//!
//! The scene is fixed (`scene.rs`). The variable `SUBAPERTURE_STAND_IN_FAULTS` names what goes wrong: `faults`, `unplug`, `two`
//! for two radios, or `images` for a computer without UHD's images.

mod device;
mod exports;
mod scene;
