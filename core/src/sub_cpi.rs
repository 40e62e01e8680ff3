//! Pulses in one at a time, a map out a sub-CPI.
//!
//! [`Processor`] is the code, on buffers that the caller lends; [`SubCpi`] owns such buffers in
//! arrays of sizes known to the compiler, and is made to be a static.

use core::fmt;

use num_complex::Complex32;

use crate::keystone::{ChirpZKeystone, Keystone, SincKeystone};
use crate::{LengthError, Map, ParamError, Params, Plan, Shape, Tables};

/// Collects the pulses of a sub-CPI and forms its map; then the next.
///
/// Pulses carry a running number, so that a lost or repeated one is noticed: the first after
/// [`Processor::new`] is 0, and the count goes on from one sub-CPI to the next. After a loss,
/// [`Processor::restart`] says where to go on.
#[derive(Debug)]
pub struct Processor<'a> {
    plan: Plan<'a>,
    history: &'a mut [Complex32],
    scratch: &'a mut [Complex32],
    map: &'a mut [Complex32],
    received: usize,
    next_pulse: u32,
}

/// What a sub-CPI still waits for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// More pulses.
    Filling {
        /// How many.
        missing: usize,
    },
    /// [`Processor::take_map`].
    Full,
}

/// Why a pulse was refused. Nothing has changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PushError {
    /// The pulse has too few or too many samples.
    Length {
        /// Samples a pulse.
        expected: usize,
        /// Samples given.
        got: usize,
    },
    /// Not the pulse that is due.
    Order {
        /// Number of the pulse that is due.
        expected: u32,
        /// Number given.
        got: u32,
    },
    /// The sub-CPI is full and its map has not been taken.
    Full,
}

impl<'a> Processor<'a> {
    /// Lends a plan its buffers: history of [`Shape::history_len`] samples, scratch of
    /// [`Plan::scratch_len`], map of [`Shape::map_len`].
    ///
    /// # Errors
    /// [`LengthError`] if one has another length.
    pub fn new(
        plan: Plan<'a>,
        history: &'a mut [Complex32],
        scratch: &'a mut [Complex32],
        map: &'a mut [Complex32],
    ) -> Result<Self, LengthError> {
        let shape = plan.axes().shape();
        LengthError::check("history", shape.history_len(), history.len())?;
        LengthError::check("scratch", plan.scratch_len(), scratch.len())?;
        LengthError::check("map", shape.map_len(), map.len())?;
        Ok(Self {
            plan,
            history,
            scratch,
            map,
            received: 0,
            next_pulse: 0,
        })
    }

    /// The plan.
    pub fn plan(&self) -> &Plan<'a> {
        &self.plan
    }

    /// Takes pulse number `number`: `F` samples at ascending frequencies.
    ///
    /// # Errors
    /// See [`PushError`]; the state is then what it was.
    pub fn push(&mut self, number: u32, pulse: &[Complex32]) -> Result<Status, PushError> {
        let shape = self.plan.axes().shape();
        if self.received == shape.num_pulses {
            return Err(PushError::Full);
        }
        if number != self.next_pulse {
            return Err(PushError::Order {
                expected: self.next_pulse,
                got: number,
            });
        }
        if pulse.len() != shape.num_frequencies {
            return Err(PushError::Length {
                expected: shape.num_frequencies,
                got: pulse.len(),
            });
        }
        self.plan.window(self.received, pulse, self.history);
        self.received += 1;
        self.next_pulse = number.wrapping_add(1);
        Ok(self.status())
    }

    /// What the sub-CPI waits for.
    pub fn status(&self) -> Status {
        match self.plan.axes().shape().num_pulses - self.received {
            0 => Status::Full,
            missing => Status::Filling { missing },
        }
    }

    /// Number of the pulse that is due next.
    pub fn next_pulse(&self) -> u32 {
        self.next_pulse
    }

    /// The windowed samples so far, `[frequency][pulse]`.
    pub fn history(&self) -> &[Complex32] {
        self.history
    }

    /// Forms the map of a full sub-CPI and begins the next; `None` while pulses are missing.
    pub fn take_map(&mut self) -> Option<Map<'_>> {
        if self.status() != Status::Full {
            return None;
        }
        self.plan
            .process(self.history, self.scratch, self.map)
            .ok()?;
        self.received = 0;
        Map::new(*self.plan.axes(), self.map).ok()
    }

    /// Drops the pulses collected so far and begins a sub-CPI with pulse `next_pulse`.
    pub fn restart(&mut self, next_pulse: u32) {
        self.received = 0;
        self.next_pulse = next_pulse;
    }
}

/// Every buffer of a sub-CPI, in arrays: made to be a static.
///
/// Sizes that cannot be do not compile. Doppler bins below the pulses:
///
/// ```compile_fail
/// use subaperture_core::SincSubCpi;
/// static BUFFERS: SincSubCpi<64, 64, 128, 32> = SincSubCpi::new();
/// ```
/// Range bins that are no power of two:
/// ```compile_fail
/// use subaperture_core::SincSubCpi;
/// static BUFFERS: SincSubCpi<32, 64, 100, 32> = SincSubCpi::new();
/// ```
/// A chirp transform shorter than `PULSES + DOPPLER_BINS - 1`:
/// ```compile_fail
/// use subaperture_core::ChirpZSubCpi;
/// static BUFFERS: ChirpZSubCpi<32, 64, 128, 64, 64> = ChirpZSubCpi::new();
/// ```
/// These do:
/// ```
/// use subaperture_core::{ChirpZSubCpi, SincSubCpi};
/// static SINC: SincSubCpi<32, 64, 128, 32> = SincSubCpi::new();
/// static CHIRP_Z: ChirpZSubCpi<32, 64, 128, 64, 128> = ChirpZSubCpi::new();
/// println!("{} bytes", ChirpZSubCpi::<32, 64, 128, 64, 128>::BYTES);
/// ```
#[derive(Debug)]
pub struct SubCpi<
    const PULSES: usize,
    const FREQUENCIES: usize,
    const RANGE_BINS: usize,
    const DOPPLER_BINS: usize,
    K,
> {
    fast_weights: [f32; FREQUENCIES],
    slow_weights: [f32; PULSES],
    keystone: K,
    history: [[Complex32; PULSES]; FREQUENCIES],
    map: [[Complex32; RANGE_BINS]; DOPPLER_BINS],
}

/// A sub-CPI with the thesis's sinc Keystone.
pub type SincSubCpi<
    const PULSES: usize,
    const FREQUENCIES: usize,
    const RANGE_BINS: usize,
    const DOPPLER_BINS: usize,
> = SubCpi<
    PULSES,
    FREQUENCIES,
    RANGE_BINS,
    DOPPLER_BINS,
    SincKeystone<PULSES, FREQUENCIES, DOPPLER_BINS>,
>;

/// A sub-CPI with the exact Keystone, by chirp transforms of `LENGTH` points.
pub type ChirpZSubCpi<
    const PULSES: usize,
    const FREQUENCIES: usize,
    const RANGE_BINS: usize,
    const DOPPLER_BINS: usize,
    const LENGTH: usize,
> = SubCpi<PULSES, FREQUENCIES, RANGE_BINS, DOPPLER_BINS, ChirpZKeystone<LENGTH>>;

impl<
    const PULSES: usize,
    const FREQUENCIES: usize,
    const RANGE_BINS: usize,
    const DOPPLER_BINS: usize,
    K: Keystone<PULSES, FREQUENCIES, DOPPLER_BINS>,
> SubCpi<PULSES, FREQUENCIES, RANGE_BINS, DOPPLER_BINS, K>
{
    /// Memory in bytes: `4 (F + M) + 8 F M + 8 D R` and the Keystone's.
    pub const BYTES: usize = size_of::<Self>();

    /// The sizes as values.
    pub const SHAPE: Shape = Shape {
        num_pulses: PULSES,
        num_frequencies: FREQUENCIES,
        num_range_bins: RANGE_BINS,
        num_doppler_bins: DOPPLER_BINS,
    };

    /// Empty buffers, all zero bytes.
    pub const fn new() -> Self {
        const {
            assert!(
                Self::SHAPE.is_valid(),
                "bins are powers of two from 2 to 4096, DOPPLER_BINS at least PULSES, RANGE_BINS \
                 at least FREQUENCIES, none zero"
            );
            K::CHECK
        };
        Self {
            fast_weights: [0.0; FREQUENCIES],
            slow_weights: [0.0; PULSES],
            keystone: K::EMPTY,
            history: [[Complex32::ZERO; PULSES]; FREQUENCIES],
            map: [[Complex32::ZERO; RANGE_BINS]; DOPPLER_BINS],
        }
    }

    /// Plans, and lends the buffers to a processor.
    ///
    /// # Errors
    /// [`ParamError::Band`], [`ParamError::FastWindow`] or [`ParamError::SlowWindow`].
    pub fn start(&mut self, params: &Params<'_>) -> Result<Processor<'_>, ParamError> {
        let (keystone, scratch) = self.keystone.split();
        let tables = Tables {
            fast_weights: &mut self.fast_weights,
            slow_weights: &mut self.slow_weights,
            keystone,
        };
        let plan = Plan::new(Self::SHAPE, params, tables)?;
        let history = self.history.as_flattened_mut();
        let map = self.map.as_flattened_mut();
        Ok(Processor::new(plan, history, scratch, map)?)
    }
}

impl<
    const PULSES: usize,
    const FREQUENCIES: usize,
    const RANGE_BINS: usize,
    const DOPPLER_BINS: usize,
    K: Keystone<PULSES, FREQUENCIES, DOPPLER_BINS>,
> Default for SubCpi<PULSES, FREQUENCIES, RANGE_BINS, DOPPLER_BINS, K>
{
    fn default() -> Self {
        Self::new()
    }
}

impl fmt::Display for PushError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Length { expected, got } => {
                write!(f, "a pulse has {expected} samples, not {got}")
            }
            Self::Order { expected, got } => {
                write!(
                    f,
                    "pulse {got} came where {expected} is due; restart to go on from it"
                )
            }
            Self::Full => f.write_str("the sub-CPI is full: take its map first"),
        }
    }
}

impl core::error::Error for PushError {}
