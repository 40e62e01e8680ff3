//! CPHD 1.1.0 (NGA.STND.0068): phase history with its geometry, read and written. Versions 1.0.x, which have the same
//! block layout, are also read.
//!
//! A file is a text header, an XML block, a block of per-vector parameters (PVP) and a block of
//! samples, all binary values big endian. Names in this module are the standard's: a *vector* is a
//! pulse, *SRP* the point to which its phase is compensated, *TOA* the two-way delay past the SRP.
//!
//! # Signal model
//! For a scatterer whose echo arrives `dTOA` after that of the SRP, the standard has `Phase(fx) = SGN fx dTOA`
//! cycles, so sample `k` of an FX vector is `exp(SGN j 2 pi fx dTOA)` at `fx = SC0 + k SCSS`. `SGN = -1` is the
//! convention of this crate. Samples with `SGN = +1` are conjugated when read, which is exact.
//!
//! In the TOA domain, sample `s` lies at `toa = SC0 + s SCSS` and the response of the scatterer
//! peaks at `toa = dTOA` with `Phase = SGN fx_C dTOA`, `fx_C = (FX1 + FX2) / 2`. Hence
//!
//! ```text
//! s(toa) = integral over FX1..FX2 of S(fx) exp(-SGN j 2 pi (fx - fx_C) toa) d fx / (FX2 - FX1)
//! ```
//!
//! because inserting `S(fx) = exp(SGN j 2 pi fx dTOA)` leaves `exp(SGN j 2 pi fx_C dTOA)` times a kernel with its
//! maximum at `toa = dTOA`. [`Cphd`] transforms TOA vectors into FX vectors in float64; its documentation states the
//! frequency grid. The standard does not define the scaling; here a unit scatterer has the value 1 in either domain.
//!
//! # Intra-pulse motion
//! A vector has one time and one position of each antenna, and no times of its samples. `aFRR1` and `aFRR2` describe
//! how an echo with another delay rate than the SRP's is shifted and smeared over the band, as linear frequency
//! modulation does: `aFRR2 = 2 / (c rate)`, `aFRR1 = fx_C aFRR2`, where `rate` is the sweep rate in hertz per second.
//! Sample `k` was therefore taken `(k - K/2) SCSS / rate` after the vector's time, while the antennas moved by
//! `TxVel` and `RcvVel`: [`Sweep`](subaperture_model::phase_history::Sweep). The SRP's own echo has phase 0 at every
//! frequency in spite of the motion, so phases follow the SRP. Zeros mean that the parameters are not given; samples
//! are then read as simultaneous.
//!
//! # Approximations
//! - `TDTropoSRP` and `TDIonoSRP` are the atmosphere's part of the SRP's delay. The phase is compensated to both this
//!   and the geometric delay. The delay of a scatterer contains nearly the same part, so it cancels: the reference
//!   path is `|TxPos - SRPPos| + |RcvPos - SRPPos|`. The change of that delay across the scene is neglected, about
//!   0.3 mm of path for each metre of path in air (refractivity 300e-6 at sea level).
//! - Antenna patterns as gain polynomials give the beam of the recording ([`PhaseHistory::beam`](subaperture_model::phase_history::PhaseHistory::beam)); sampled
//!   patterns, noise levels, other support arrays and dwell polynomials are not read.
//! - Times: [`subaperture_model::phase_history::Pulse::time_s`] is `TxTime`.
//!
//! # Accuracy
//! FX samples written by [`write()`] read back bit-identical, positions to 2 nm (float64 in ECF), TOA samples to a
//! relative RMS error below 1.2e-7: `tests/recordings/cphd/round_trip.rs`. The files pass sarkit's `cphdcheck`
//! without failure or warning: `tests/recordings/cphd/sarkit.rs`. Exception: for motion exactly along the line of
//! sight the standard's equations for `TwistAngle`, `SlopeAngle` and `LayoverAngle` are 0/0; these angles are written
//! as 0 and fail the check.
//!
//! # Example
//! Two pulses of a unit scatterer at the SRP, on the equator: every sample is 1.
//!
//! ```
//! use glam::DVec3;
//! use num_complex::Complex32;
//! use subaperture_model::monitor::Silent;
//! use subaperture_model::geometry::SceneFrame;
//! use subaperture_io::cphd::{Channel, Cphd, WriteOptions, write};
//! use subaperture_model::phase_history::{Collection, PhaseHistory, Pulse, InMemory, Sweep};
//!
//! let pulse = |time_s: f64| {
//!     let antenna = DVec3::new(100.0 * time_s, -4000.0, 3000.0);
//!     Pulse {
//!         time_s,
//!         transmitter_m: antenna,
//!         receiver_m: antenna,
//!         reference_m: DVec3::ZERO,
//!         reference_path_m: 2.0 * antenna.length(),
//!         start_hz: 9.6e9,
//!         step_hz: 1e6,
//!         sweep: Sweep::AT_ONCE,
//!         recorded_path_m: None,
//!     }
//! };
//! let collection = Collection {
//!     name: "example".to_owned(),
//!     num_samples: 3,
//!     pulses: vec![pulse(0.0), pulse(0.01)],
//!     frame: SceneFrame::Earth {
//!         origin_ecf_m: DVec3::new(6_378_137.0, 0.0, 0.0),
//!         x_axis_ecf: DVec3::Y,
//!         y_axis_ecf: DVec3::Z,
//!     },
//!     extent: None,
//!     timed: true,
//! };
//! let ones = InMemory::new(collection, vec![Complex32::ONE; 6])?;
//! let folder = tempfile::tempdir()?;
//! let path = folder.path().join("example.cphd");
//! write(&path, &[Channel::new("1", &ones)], &WriteOptions::default(), &Silent)?;
//!
//! let cphd = Cphd::open(&path, None, 1 << 20)?;
//! let mut samples = vec![Complex32::ZERO; 3];
//! cphd.read(1..2, &mut samples)?;
//! assert_eq!(samples, [Complex32::ONE; 3]);
//! assert!((cphd.collection().pulses[0].reference_path_m - 10_000.0).abs() < 1e-8);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod antenna;
mod antenna_fit;
mod antenna_polynomials;
mod antenna_table;
mod antenna_vectors;
mod antenna_write;
mod conventions;
mod describe;
mod entry;
mod header;
mod image_area;
pub(crate) mod metadata;
mod preamble;
mod prepare;
mod pvp;
mod read;
mod reference_geometry;
mod toa;
pub(crate) mod vectors;
mod write;
mod write_options;

pub use crate::container::{MetadataError, SignalFormat};
pub use conventions::{Domain, Polarization, Sgn};
pub use metadata::{ChannelInfo, CphdInfo, ReferenceSurface};
pub use read::Cphd;
pub use write::{add_to, describes_antennas, file_bytes, write};
pub use write_options::{Channel, WriteError, WriteOptions};
