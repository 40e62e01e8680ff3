//! What is wrong with a recording, and what can be trusted all the same.

use std::fmt;

/// What was found wrong. As text: what it is, and what it does to the track.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Fault {
    /// A channel without echoes; it is left out.
    Dead {
        /// Its name.
        channel: String,
        /// Its echoes below those of the strongest channel, dB; none if it holds nothing but zeros.
        below_db: Option<f64>,
    },
    /// A channel whose converter was at its end.
    Saturated {
        /// Its name.
        channel: String,
        /// Samples at the end, as a fraction of all.
        share: f64,
    },
    /// A channel in which targets that others see are lost in noise.
    Weak {
        /// Its name.
        channel: String,
        /// Echoes lost, as a fraction of those that all other channels have.
        share: f64,
    },
    /// Pulses with values that are no numbers, or that could not be read.
    Unreadable {
        /// How many.
        pulses: usize,
        /// The first.
        first: usize,
        /// Where, and what to do about it.
        what: String,
    },
    /// Targets come or go so fast that phases wrap from pulse to pulse.
    Fast {
        /// Change of path, metres a pulse.
        path_m: f64,
        /// Half a wavelength.
        half_m: f64,
        /// The pulse.
        pulse: usize,
    },
    /// Pulses of a turn are not of one moment.
    Turns {
        /// Between the first and the last of a turn, seconds.
        apart_s: f64,
        /// The path that may change in that time as targets were seen to move, radians of phase.
        phase_rad: f64,
    },
    /// Pulses in which fewer than two targets are seen.
    Blind {
        /// How many.
        pulses: usize,
        /// The first.
        first: usize,
        /// The longest run of them.
        longest: usize,
    },
    /// Phases that may have wrapped.
    Doubtful {
        /// In how many pulses.
        pulses: usize,
        /// The first.
        first: usize,
    },
    /// What is measured lies farther from the track and targets found than its noise.
    Misfit {
        /// Squared errors over what they should be.
        chi_square_ratio: f64,
    },
    /// The track found goes the other way than the recorded one.
    Reversed,
}

/// A number of pulses.
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
                "channel '{channel}' is dead: its echoes are {below_db:.0} dB below those of the others; it is left out, and the track is that of the others"
            ),
            Self::Dead { channel, .. } => write!(
                f,
                "channel '{channel}' is dead: it holds nothing but zeros; it is left out, and the track is that of the others"
            ),
            Self::Saturated { channel, share } => write!(
                f,
                "channel '{channel}' is saturated: {:.0} % of its samples are at its largest value; ranges can be trusted, phases are bent by the \
                 strongest targets, and weak targets at sums of others' ranges may not be there",
                100.0 * share
            ),
            Self::Weak { channel, share } => write!(
                f,
                "channel '{channel}' is weak: {:.0} % of the echoes that the others have are lost in its noise; without it there would be more targets",
                100.0 * share
            ),
            Self::Unreadable {
                pulses,
                first,
                what,
            } => write!(
                f,
                "{} could not be read, the first of them pulse {first} ({what}); they tell nothing, the others can be trusted",
                Pulses(*pulses)
            ),
            Self::Fast {
                path_m,
                half_m,
                pulse,
            } => write!(
                f,
                "about pulse {pulse} a path changes by {path_m:.4} m a pulse, and phases tell half a wavelength, {half_m:.4} m: the track holds only while \
                 the motion is even"
            ),
            Self::Turns { apart_s, phase_rad } => write!(
                f,
                "transmitters take turns within {apart_s:.3e} s, in which phases change by up to {phase_rad:.2} rad as the radar moves: they are taken as if of one moment"
            ),
            Self::Blind {
                pulses,
                first,
                longest,
            } => write!(
                f,
                "in {}, {longest} of them in a row and the first of them pulse {first}, fewer than two targets are seen: the track has no place for them",
                Pulses(*pulses)
            ),
            Self::Doubtful { pulses, first } => write!(
                f,
                "in {}, the first of them pulse {first}, phases are near half a turn from what was expected and may have wrapped: from there on the track may \
                 be off by half wavelengths",
                Pulses(*pulses)
            ),
            Self::Misfit { chi_square_ratio } => write!(
                f,
                "ranges and phases are off those of the track found by {:.1} times their noise: targets that are no points or move, or antennas that are \
                 not where the recording has them; covariances are too small by the square of that",
                chi_square_ratio.sqrt()
            ),
            Self::Reversed => f.write_str(
                "the track goes the other way than the recorded one along the array: receivers may be swapped, and the track mirrored",
            ),
        }
    }
}
