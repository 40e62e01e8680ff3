//! Faults of a recording or of a track, and what stays reliable.

use std::fmt;

/// Fault of a recording or of its track. Its text says what is affected and how.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Fault {
    /// Channel without echoes; the track leaves it out.
    Dead {
        /// Name of the channel.
        channel: String,
        /// Level of its echoes below those of the strongest channel, dB; `None` if it contains only zeros.
        below_db: Option<f64>,
    },
    /// Channel whose converter was at full scale.
    Saturated {
        /// Name of the channel.
        channel: String,
        /// Samples at full scale, as a fraction of all.
        share: f64,
    },
    /// Channel whose noise hides targets that the other channels detect.
    Weak {
        /// Name of the channel.
        channel: String,
        /// Echoes lost, as a fraction of those in all other channels.
        share: f64,
    },
    /// Pulses that could not be read, or with samples that are not finite.
    Unreadable {
        /// Number of these pulses.
        pulses: usize,
        /// Number of the first one in the recording.
        first: usize,
        /// Text of the reader's error.
        reason: String,
    },
    /// Targets approach or recede so fast that phases wrap from pulse to pulse.
    Fast {
        /// Change of path in metres a pulse.
        path_m: f64,
        /// Half a wavelength, metres.
        half_m: f64,
        /// Number of the pulse with that change.
        pulse: usize,
    },
    /// Motion changes phases between the pulses of time-multiplexed transmitters.
    Turns {
        /// Time from the first to the last transmitter of a cycle, seconds.
        apart_s: f64,
        /// Largest change of phase in that time, radians.
        phase_rad: f64,
    },
    /// Pulses with fewer than two targets: they have no pose.
    Blind {
        /// Number of these pulses.
        pulses: usize,
        /// Number of the first one in the recording.
        first: usize,
        /// Length of the longest run of these pulses.
        longest: usize,
    },
    /// Phases with ambiguous whole turns.
    Doubtful {
        /// Number of pulses with ambiguous turns.
        pulses: usize,
        /// Number of the first one in the recording.
        first: usize,
    },
    /// Residuals of the track exceed the noise.
    Misfit {
        /// Squared residuals over their expected number.
        chi_square_ratio: f64,
    },
    /// The track runs opposite to the recorded one.
    Reversed,
    /// A block of pulses fits worse than the rest.
    Uneven {
        /// Squared residuals of the block over their expected number.
        ratio: f64,
        /// Number of the block's first pulse.
        pulse: usize,
    },
    /// Only two targets are seen at a time.
    Unconfirmed,
    /// The track rests on two targets: no three targets agree with one motion.
    TwoTargets {
        /// Number of targets left out.
        left_out: usize,
    },
    /// Weak targets do not stand still nor move steadily: their phases, or those of the track's targets, may be off by whole turns.
    Wandering {
        /// Number of such targets.
        targets: usize,
        /// Number of pulses without a pose.
        blind: usize,
    },
    /// The track and the recorded positions differ in shape.
    Contradicts {
        /// RMS distance after turn and shift, metres.
        off_m: f64,
        /// RMS extent of the recorded positions, metres.
        extent_m: f64,
    },
}

impl Fault {
    /// Whether the track may be wrong by more than its covariances.
    pub fn is_doubt(&self) -> bool {
        matches!(
            self,
            Self::Misfit { .. }
                | Self::Doubtful { .. }
                | Self::Uneven { .. }
                | Self::Reversed
                | Self::Contradicts { .. }
                | Self::TwoTargets { .. }
                | Self::Wandering { .. }
        )
    }
}

/// Number of pulses, as text.
struct Pulses(usize);

impl fmt::Display for Pulses {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            1 => f.write_str("1 pulse"),
            n => write!(f, "{n} pulses"),
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Dead {
                channel,
                below_db: Some(below_db),
            } => write!(
                f,
                "channel '{channel}' is dead: its echoes are {below_db:.0} dB below those of the strongest channel; the track uses the other channels"
            ),
            Self::Dead { channel, .. } => write!(
                f,
                "channel '{channel}' is dead: it contains only zeros; the track uses the other channels"
            ),
            Self::Saturated { channel, share } => write!(
                f,
                "channel '{channel}' is saturated: {:.0} % of its samples are at full scale; ranges are reliable, phases are distorted by the strongest \
                 targets, and weak targets at sums of other ranges may be intermodulation",
                100.0 * share
            ),
            Self::Weak { channel, share } => write!(
                f,
                "channel '{channel}' is weak: {:.0} % of the echoes that the other channels have are lost in its noise; the track has more targets without this channel",
                100.0 * share
            ),
            Self::Unreadable {
                pulses,
                first,
                reason,
            } => write!(
                f,
                "{} could not be read, the first is pulse {first} ({reason}); the track omits them",
                Pulses(*pulses)
            ),
            Self::Fast {
                path_m,
                half_m,
                pulse,
            } => write!(
                f,
                "near pulse {pulse} a path changes by {path_m:.4} m per pulse, more than half a wavelength of {half_m:.4} m: phase unwrapping is reliable only while \
                 the velocity is constant"
            ),
            Self::Turns { apart_s, phase_rad } => write!(
                f,
                "time-multiplexed transmitters send up to {apart_s:.3e} s apart, in which the radar's motion changes phases by up to {phase_rad:.2} rad: the track assumes simultaneous transmission"
            ),
            Self::Blind {
                pulses,
                first,
                longest,
            } => write!(
                f,
                "the track has no pose in {}, {longest} of them in a row, the first is pulse {first}: fewer than two targets are seen there",
                Pulses(*pulses)
            ),
            Self::Doubtful { pulses, first } => write!(
                f,
                "phase near pi from the expected in {}: half-wavelength slips of the track are possible from pulse {first} on",
                Pulses(*pulses)
            ),
            Self::Misfit { chi_square_ratio } => write!(
                f,
                "residuals of the track are {:.1} times the noise: targets are extended or move, or antennas are not at their recorded positions; covariances are \
                 enlarged by the square of that",
                chi_square_ratio.sqrt()
            ),
            Self::Uneven { ratio, pulse } => write!(
                f,
                "residuals of the track near pulse {pulse} are {:.1} times the noise: a target may be mistaken for another, or its phase may be off by whole turns",
                ratio.sqrt()
            ),
            Self::Unconfirmed => f.write_str(
                "the track rests on two targets at a time: it assumes that both stand still, and no third target confirms it",
            ),
            Self::TwoTargets { left_out } => write!(
                f,
                "the track rests on the two targets that fit one motion best: {left_out} other targets contradict that motion, and no third target confirms it"
            ),
            Self::Wandering { targets, blind } => write!(
                f,
                "{targets} targets fit neither the track nor a steady velocity, and {} have no pose: phases may be off by whole turns, and the track by more than its errors",
                Pulses(*blind)
            ),
            Self::Contradicts { off_m, extent_m } => write!(
                f,
                "the track is {off_m:.3} m RMS off the recorded positions, whose extent is {extent_m:.3} m RMS: one of the two is wrong"
            ),
            Self::Reversed => f.write_str(
                "the track runs opposite to the recorded one along the array: receivers may be swapped, and the track mirrored",
            ),
        }
    }
}
