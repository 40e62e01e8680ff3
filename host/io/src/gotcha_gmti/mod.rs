//! AFRL's *Gotcha GMTI challenge*: phase history of an airborne X-band radar with three channels, read only.
//!
//! Sources: Scarborough et al., "A challenge problem for SAR-based GMTI in urban environments", Proc. SPIE 7337, 2009; Gorham and Moore,
//! "SAR image formation toolbox for MATLAB", Proc. SPIE 7669, 2010, whose script for these data states the fields and formulas below. The reader
//! was written from this description and tested on files of an independent script (`tests/recordings/gotcha_gmti.rs`). The original files
//! were not available.
//!
//! # Files
//! A collection is named `PREFIX` and `SET`, such as `durangoChallenge` and `mis2`. `N` is the channel, 1 to 3. The path of a recording is that of
//! the samples of one channel; the other files are in the same folder ([`Files`]).
//!
//! | file | content |
//! |---|---|
//! | `PREFIX_chanN_SET_PH` | samples: float32, big endian, real and imaginary part in turn, 384 of a pulse, pulse after pulse |
//! | `PREFIX_chanN_SET_PH_auxSaveData.mat` | structure `aux_SPIE` |
//! | `PREFIX_SET_PAUX.mat` | structure `paux`, common to the channels |
//!
//! The layout of AFRL's file `PREFIX_SET_PAUX` is not published. AFRL's `readPAUXData.m` reads it. Two lines of MATLAB convert it:
//!
//! ```text
//! paux = readPAUXData('durangoChallenge_mis2_PAUX');
//! save('durangoChallenge_mis2_PAUX.mat', 'paux', '-v6')
//! ```
//!
//! The recorded positions of the vehicle, `PREFIX_GPStruth.mat`, are not read.
//!
//! # Fields and formulas
//! With `N` pulses, `c` the speed of light, and 5400 samples of a pulse before the decimation to 384:
//!
//! | field | symbol | size, unit |
//! |---|---|---|
//! | `aux_SPIE.readPrm.Fsamp` | `fs` | 1, Hz |
//! | `aux_SPIE.readPrm.deltaRbin` | `b` | `N`, range bins |
//! | `aux_SPIE.circshiftFloorPHradius` | `m` | `N`, samples |
//! | `aux_SPIE.PHradius_sampleError` | `e` | 1 or `N`, samples |
//! | `aux_SPIE.PRF` | `prf` | 1, Hz; may be absent |
//! | `paux.APCpos` | `a` | 3 x `N`, metres |
//! | `paux.APCMag` | `R` | `N`, metres |
//! | `paux.Gamma` | `gamma` | first value, Hz/s |
//! | `paux.PHradius` | `f0` | `N`, Hz |
//!
//! ```text
//! df    = gamma / fs                                frequency step before decimation
//! step  = df 5400 / 384
//! start = f0 + (e - m + 1) df                       first frequency of a pulse
//! R0    = R + b c / (2 5400 df)                     range to which the phase is compensated
//! phase of a scatterer = -4 pi f (|a - p| - R0) / c
//! ```
//!
//! which is this library's convention with the reference path `2 R0`. The frame is local; the scene's extent is not recorded. As in
//! [`gotcha`](crate::gotcha), `R` is replaced by `|a|` if both agree within the rounding of their storage in every pulse.
//!
//! The first frequency differs from pulse to pulse. Each pulse keeps its own, as in CPHD.
//!
//! # Values that the files do not state
//! [`Settings`] states them.
//!
//! - `receiver_offset`: three lengths, the displacement of the receivers of channels 1 to 3 from `APCpos` along the track, positive forwards. The transmitter
//!   remains at `APCpos`, so that the phase centre is displaced by half of it. Without it all channels have the same positions, and moving targets cannot be detected.
//! - `prf`: pulse repetition frequency, in place of `aux_SPIE.PRF`. Without either the recording has no times ([`Collection::timed`]).
//!
//! [`Collection::timed`]: subaperture_model::phase_history::Collection::timed

#[cfg(all(feature = "cphd", feature = "gotcha"))]
mod geometry;
mod names;
#[cfg(all(feature = "cphd", feature = "gotcha"))]
mod parameters;
#[cfg(all(feature = "cphd", feature = "gotcha"))]
mod read;
#[cfg(all(feature = "cphd", feature = "gotcha"))]
mod settings;

pub use names::{CHANNELS, Files};
#[cfg(all(feature = "cphd", feature = "gotcha"))]
pub use read::GotchaGmti;
#[cfg(all(feature = "cphd", feature = "gotcha"))]
pub use settings::Settings;
