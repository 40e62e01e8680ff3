//! Error of an estimated track by the jackknife, and the test whether the track is better than the recorded one.
//!
//! An estimated track `f = x + e` has the error `e` about the true displacement `x`, and is better than the recorded one if `|e|^2 < |x|^2`.
//! As `|f|^2 = |x|^2 + |e|^2` in the mean, that is `|e|^2 < |f|^2 / 2`. Shrinkage of `f` towards zero makes the test stricter. The error is estimated from
//! `K` tracks `f_k`, each estimated without one group of the data (delete-a-group jackknife):
//!
//! ```text
//! |e|^2 = (K - 1) / K sum_k |f_k - m|^2 + |m - f|^2,     m = mean of f_k
//! ```
//!
//! The first term is the variance. The second is zero for an estimate that is linear in the data. The estimate has `v = (K + 1) r - 2` degrees of freedom,
//! `r = (sum p)^2 / sum p^2` with the power `p` of `f_k - m` in each mode of a cosine transform over the aperture (Satterthwaite, with the bias of
//! squared estimates removed): errors of a track are smooth, and few modes hold most of their power. The probability that an error with
//! `|e|^2 = |f|^2 / 2` gives an estimate as small as the observed one is that of a chi-square below `v |e|^2 / (|f|^2 / 2)`.
//!
//! Not covered: errors that all groups share.

use glam::DVec3;

use super::chance::chi_square_below;
use super::correction::Correction;

/// Blocks of the aperture that the cosine transform of a track is taken over.
const BLOCKS: usize = 256;

/// Jackknife error of a track.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TrackError {
    /// Estimate of the rms error, metres.
    pub(crate) error_m: f64,
    /// Probability of at most this estimate for a track that is no better than the recorded one.
    pub(crate) p_value: f64,
}

impl TrackError {
    /// Error of `whole` from the tracks estimated `without` each group of data; `None` if one of them is missing, or if `whole` is not a track.
    pub(crate) fn of(whole: &Correction, without: &[Option<Correction>]) -> Option<Self> {
        let Correction::Track {
            displacement_m: whole,
        } = whole
        else {
            return None;
        };
        let tracks: Vec<&[DVec3]> = without
            .iter()
            .map(|correction| match correction {
                Some(Correction::Track { displacement_m }) => Some(displacement_m.as_slice()),
                _ => None,
            })
            .collect::<Option<_>>()?;
        let (folds, turns) = (tracks.len() as f64, whole.len());
        if tracks.len() < 2 {
            return None;
        }
        let centre = |track: &[DVec3]| -> Vec<DVec3> {
            let middle = track.iter().sum::<DVec3>() / turns as f64;
            track.iter().map(|at| *at - middle).collect()
        };
        let whole = centre(whole);
        let tracks: Vec<Vec<DVec3>> = tracks.into_iter().map(centre).collect();
        let mean: Vec<DVec3> = (0..turns)
            .map(|n| tracks.iter().map(|track| track[n]).sum::<DVec3>() / folds)
            .collect();
        let power = |track: &[DVec3]| {
            track.iter().map(|at| at.length_squared()).sum::<f64>() / turns as f64
        };
        let less = |track: &[DVec3]| -> Vec<DVec3> {
            track.iter().zip(&mean).map(|(a, b)| *a - *b).collect()
        };
        let apart: Vec<Vec<DVec3>> = tracks.iter().map(|track| less(track)).collect();
        let spread: f64 = apart.iter().map(|track| power(track)).sum();
        let variance = (folds - 1.0) / folds * spread + power(&less(&whole));
        let half_moved = 0.5 * power(&whole);
        let freedom = degrees_of_freedom(&apart);
        Some(Self {
            error_m: variance.sqrt(),
            p_value: match half_moved > 0.0 {
                true => chi_square_below(freedom * variance / half_moved, freedom),
                false => 1.0,
            },
        })
    }
}

/// Degrees of freedom of the power of deviations from their mean.
fn degrees_of_freedom(apart: &[Vec<DVec3>]) -> f64 {
    let folds = apart.len() as f64;
    let turns = apart[0].len();
    let blocks = turns.min(BLOCKS);
    let mut powers = vec![0.0; 3 * blocks];
    for track in apart {
        let block = |i: usize| {
            let turns = &track[i * turns / blocks..(i + 1) * turns / blocks];
            turns.iter().sum::<DVec3>() / turns.len() as f64
        };
        let means: Vec<DVec3> = (0..blocks).map(block).collect();
        for mode in 1..blocks {
            let step = std::f64::consts::PI * mode as f64 / blocks as f64;
            let sum: DVec3 = means
                .iter()
                .enumerate()
                .map(|(i, at)| *at * libm::cos(step * (i as f64 + 0.5)))
                .sum();
            for (axis, value) in sum.to_array().into_iter().enumerate() {
                powers[3 * mode + axis] += value * value;
            }
        }
    }
    let all: f64 = powers.iter().sum();
    let squares: f64 = powers.iter().map(|p| p * p).sum();
    match squares > 0.0 {
        true => ((folds + 1.0) * all * all / squares - 2.0).max(1.0),
        false => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chance::gauss;

    const TURNS: usize = 24;
    const GROUPS: usize = 8;

    /// Waves of random amplitude, one cosine mode each for both axes, of a mean power of `power`.
    fn smooth(power: f64, modes: usize, state: &mut u64) -> Vec<DVec3> {
        let scale = (power / modes as f64).sqrt();
        let amplitudes: Vec<[f64; 2]> = (0..modes)
            .map(|_| [scale * gauss(state), scale * gauss(state)])
            .collect();
        (0..TURNS)
            .map(|n| {
                let u = std::f64::consts::PI * (n as f64 + 0.5) / TURNS as f64;
                let waves = amplitudes.iter().zip(1..);
                waves
                    .map(|(&[x, y], mode)| DVec3::new(x, y, 0.0) * (f64::from(mode) * u).cos())
                    .sum()
            })
            .collect()
    }

    /// A track of true power `power` estimated as the mean of the tracks of all groups, with errors of unit power in
    /// `modes` modes; and its true squared error.
    fn estimated(power: f64, modes: usize, state: &mut u64) -> (TrackError, f64) {
        let truth = smooth(power, modes, state);
        let errors: Vec<Vec<DVec3>> = (0..GROUPS)
            .map(|_| smooth(GROUPS as f64, modes, state))
            .collect();
        let mean_without = |left_out: Option<usize>| -> Vec<DVec3> {
            let kept: Vec<_> = (0..GROUPS).filter(|&g| Some(g) != left_out).collect();
            (0..TURNS)
                .map(|n| {
                    let sum: DVec3 = kept.iter().map(|&g| errors[g][n]).sum();
                    truth[n] + sum / kept.len() as f64
                })
                .collect()
        };
        let track = |displacement_m| Correction::Track { displacement_m };
        let whole = mean_without(None);
        let squares = whole
            .iter()
            .zip(&truth)
            .map(|(a, b)| a.distance_squared(*b));
        let error = squares.sum::<f64>() / TURNS as f64;
        let without: Vec<_> = (0..GROUPS)
            .map(|g| Some(track(mean_without(Some(g)))))
            .collect();
        (TrackError::of(&track(whole), &without).unwrap(), error)
    }

    #[test]
    fn jackknife_refuses_tracks_of_noise() {
        // No true displacement: the track is its error. Of 2000 tests at 1 % 20 pass, with a standard deviation of 4.5; Satterthwaite's
        // approximation is not exact, so twice as many are allowed.
        let mut state = 3;
        for modes in [1, 3, 8] {
            let kept = (0..2000)
                .filter(|_| estimated(0.0, modes, &mut state).0.p_value < 0.01)
                .count();
            println!("{modes} modes: {kept} of 2000 kept");
            assert!(kept <= 40, "{modes}: {kept}");
        }
    }

    #[test]
    fn jackknife_keeps_tracks_well_above_their_errors() {
        let mut state = 5;
        let (mut kept, mut worse) = (0, 0);
        let mut ratios = 0.0;
        for _ in 0..1000 {
            let (found, error) = estimated(30.0, 3, &mut state);
            kept += usize::from(found.p_value < 0.01);
            worse += usize::from(found.p_value < 0.01 && error > 30.0);
            ratios += found.error_m.powi(2) / 1000.0;
        }
        println!("{kept} kept, {worse} of them worse; estimate over truth {ratios:.3}");
        assert!(kept > 900, "{kept}");
        assert_eq!(worse, 0);
        // Both axes have unit power halved by the cosine's mean square, 1 in all. The mean of 1000 estimates with 21 degrees of freedom
        // or more has a standard deviation of at most 1 %.
        assert!((0.95..1.05).contains(&ratios), "{ratios}");
    }
}
