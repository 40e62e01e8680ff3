//! NISAR L0B (product RRSD, HDF5), read only: raw echoes of an L-band or S-band radar in orbit, with the orbit's state
//! vectors. Reading compresses them to phase history.
//!
//! Other raw data converted to this layout, such as ALOS PALSAR, are read as well.
//!
//! # Contents that are read
//! Paths are below `/science/LSAR` or `/science/SSAR`. A channel is named by its frequency and polarisations: `A-HV` is
//! frequency A, transmitted H, received V.
//!
//! | path | use |
//! |---|---|
//! | `identification/lookDirection`, `diagnosticModeFlag`, `missionId` | side of the scene; 0 (science) is required; name |
//! | `RRSD/lowRateTelemetry/orbit/time`, `position`, `velocity`, `interpMethod` | antenna positions, ECF |
//! | `RRSD/swaths/frequencyA/txH/UTCtime`, `calType` | transmit times; pulses other than 0 are not transmitted |
//! | `.../centerFrequency`, `chirpSlope`, `chirpDuration`, `rangeBandwidth` | pulse, band |
//! | `.../slantRange`, `slantRangeSpacing` | receive window, sampling rate |
//! | `.../numberOfSubSwaths`, `validSamplesSubSwath1`, ... | samples outside transmit gaps, `[first, end)` |
//! | `.../rxV/HV`, `BFPQLUT` | samples: codes of a look-up table, or complex numbers of 16 or 32 bits |
//!
//! # Signal model
//! Slant ranges count from the pulse's leading edge: sample `i` is received at `2 slantRange[i] / c` after it. The
//! sampling rate is `c / (2 slantRangeSpacing)`. With the delay `tau`, the slope `K` and the duration `T`, an echo is
//!
//! ```text
//! s[i] = exp(-j 2 pi centerFrequency tau) exp(j pi K (t_i - tau - T / 2)^2),    t_i = 2 slantRange[i] / c
//! ```
//!
//! which [`Compressed`](crate::receive::Compressed) filters and references to the scene's origin. The band is the
//! smaller one of `rangeBandwidth` and `|K| T`. Codes that the table maps to NaN, and samples outside all sub-swaths,
//! are 0.
//!
//! # Geometry
//! The antenna is at the orbit's position at `UTCtime` when the middle of a pulse leaves, and at the position of the
//! echo's arrival when it is received; both move during the pulse
//! ([`Compressed::moving`](crate::receive::Compressed::moving)). Positions are the Hermite polynomial of degree 7 through
//! the four nearest state vectors: within 0.1 um of a circular orbit of 700 km for vectors 60 s apart. Corrections for the
//! antenna's offset from the orbit's reference point are not in the file.
//!
//! The file states no scene. The origin is the point of the WGS 84 ellipsoid (height 0) in the zero-Doppler plane at
//! the middle of the acquisition and of the range swath of the first channel; x points away from the radar along the
//! ground, y by 90 degrees to the left of x, z up. The extent is that of the echoes that the receive window contains
//! completely.
//!
//! # Limitations
//! - The receiver's position is that of the arrival of the reference point's echo. A point whose path is longer by `d`
//!   appears displaced along the track by `v d / (2 c)`: 0.13 m for 10 km and 7.6 km/s.
//! - `UTCtime` is the transmit time; the file does not state whether of the pulse's start or middle. The difference is
//!   `v T / 2` along the track: 0.1 m for 27 us.
//! - Refused: diagnostic modes (`diagnosticModeFlag` 1 and 2), whose samples are those of single receivers or of
//!   another band; layouts before 2020 (`telemetry` instead of `lowRateTelemetry`); `interpMethod` other than Hermite.
//! - Not corrected: antenna patterns, calibration (`caltone`, `chirpCorrelator`, `txPhase`), the atmosphere, and
//!   `rangeDelayAdjustment`, about which a warning is given.
//!
//! # Accuracy
//! Points simulated by an independent script are focused at their positions: `tests/recordings/l0b.rs`.

mod echoes;
mod metadata;
mod orbit;
mod read;
mod scene;
mod tree;

pub use metadata::{L0bChannel, L0bInfo};
pub use read::L0b;
pub use scene::LookSide;
pub(crate) use tree::is_nisar;
