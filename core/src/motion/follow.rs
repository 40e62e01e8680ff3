//! The same target from pulse to pulse.
//!
//! **Prediction.** Range and its rate, cells a pulse, by a Kalman filter of constant rate, disturbed by white acceleration. Differences of phase between channels, which are the angle of
//! arrival, are held as they were last. **Association.** Of all echoes within the gate of a target's range, whose differences of phase are within [`MOST_TURNED_RAD`] RMS of those held, the pair that is off the
//! least is taken first, then the next of those that are left. **Birth.** Any other echo begins a candidate, which becomes a target once it is seen often enough among its first pulses, or is forgotten. **Death.** A target that is not seen for
//! longer than is bridged is forgotten, and its name is not given again before all others have been. **Crossing.** Of targets that are too near to each other nothing is told.
//!
//! That is what the host does ([`subaperture::targets`](https://docs.rs/subaperture)), but that a candidate's first echoes are not told afterwards, for increments are told at once: a target
//! counts from the pulse in which it is confirmed. Where there is no room for another candidate, the one unseen for longest gives way.

use core::f64::consts::TAU;

use super::echo::Seen;
use super::{Echo, Follow};

/// How far differences of phase may be off those last seen, radians RMS.
const MOST_TURNED_RAD: f64 = 1.2;

/// Something that is followed.
#[derive(Clone, Copy, Debug)]
struct Followed<const CHANNELS: usize> {
    /// Something is; an option would be none by a byte that is not zero, and fill memory that is read from flash.
    is_there: bool,
    name: u16,
    confirmed: bool,
    /// Pulses since its first, and since it was seen last.
    age: u32,
    unseen: u32,
    times_seen: u32,
    cells: f64,
    /// A pulse.
    rate_cells: f64,
    /// Of range and rate: both variances, and between.
    variance: [f64; 3],
    /// Of each channel, against the first.
    differences_rad: [f64; CHANNELS],
    /// Too near to another to be told apart.
    near: bool,
}

/// Follows so many targets and candidates at most.
#[derive(Clone, Debug)]
pub(super) struct Follower<const TARGETS: usize, const CHANNELS: usize> {
    all: [Followed<CHANNELS>; TARGETS],
    next: u16,
}

impl<const TARGETS: usize, const CHANNELS: usize> Follower<TARGETS, CHANNELS> {
    /// Follows nothing.
    pub(super) const fn new() -> Self {
        Self {
            all: [Followed::EMPTY; TARGETS],
            next: 0,
        }
    }

    /// Takes the echoes of the pulse `pulses` after the one before, seen by so many channels, and gives those of targets; how many those are.
    pub(super) fn push(
        &mut self,
        follow: &Follow,
        echoes: &[Seen<CHANNELS>],
        (pulses, channels): (u32, usize),
        told: &mut [Echo<CHANNELS>],
    ) -> usize {
        self.forget(follow, pulses);
        // As many as a target can be unseen, or a candidate be young: nothing is left after more.
        for _ in 0..pulses {
            if !self.all.iter().any(|own| own.is_there) {
                break;
            }
            self.predict(follow);
        }
        self.find_crossings(follow);
        let taken = self.associate(follow, echoes, channels);
        let mut count = 0;
        for (own, echo) in self.all.iter_mut().zip(&taken) {
            let echo = echo.and_then(|e| echoes.get(e));
            let Some(echo) = echo else { continue };
            own.update(follow, echo);
            own.confirmed |=
                own.age < u32::from(follow.within) && own.times_seen >= u32::from(follow.seen);
            if own.confirmed
                && !own.near
                && let Some(place) = told.get_mut(count)
            {
                *place = Echo {
                    target: own.name,
                    // Of cells, until the odometer makes metres of it.
                    range_m: echo.cells,
                    phases_rad: echo.phases_rad,
                    phase_sigma_rad: echo.phase_sigma_rad,
                };
                count += 1;
            }
        }
        for (e, echo) in echoes.iter().enumerate() {
            if !taken.contains(&Some(e)) {
                self.bear(follow, echo);
            }
        }
        self.forget(follow, 1);
        count
    }

    /// Forgets what is too old once `pulses` more have gone by, before an echo that happens to lie there is taken for it: targets unseen for longer than is bridged, candidates that cannot be
    /// confirmed any more.
    fn forget(&mut self, follow: &Follow, pulses: u32) {
        for own in &mut self.all {
            own.is_there &= match own.confirmed {
                true => own.unseen.saturating_add(pulses) <= u32::from(follow.bridge) + 1,
                false => own.age.saturating_add(pulses) < u32::from(follow.within),
            };
        }
    }

    fn predict(&mut self, follow: &Follow) {
        let noise = follow.acceleration_cells * follow.acceleration_cells;
        for own in self.all.iter_mut().filter(|own| own.is_there) {
            let [range, both, rate] = own.variance;
            own.cells += own.rate_cells;
            own.variance = [
                range + 2.0 * both + rate + 0.25 * noise,
                both + rate + 0.5 * noise,
                rate + noise,
            ];
            own.age = own.age.saturating_add(1);
            own.unseen = own.unseen.saturating_add(1);
        }
    }

    fn find_crossings(&mut self, follow: &Follow) {
        for i in 0..TARGETS {
            let own = self.all.get(i).filter(|own| own.is_there);
            let Some(own) = own else { continue };
            let near = self.is_near(follow, own.cells, Some(own.name));
            if let Some(own) = self.all.get_mut(i) {
                own.near = near;
            }
        }
    }

    /// Whether a target, not that of this name, is near.
    fn is_near(&self, follow: &Follow, cells: f64, name: Option<u16>) -> bool {
        self.all.iter().any(|other| {
            let apart = libm::fabs(other.cells - cells);
            other.is_there
                && other.confirmed
                && Some(other.name) != name
                && apart < follow.apart_cells
        })
    }

    /// The echo of each that is followed.
    fn associate(
        &self,
        follow: &Follow,
        echoes: &[Seen<CHANNELS>],
        channels: usize,
    ) -> [Option<usize>; TARGETS] {
        let mut taken = [None; TARGETS];
        loop {
            let mut best: Option<(f64, usize, usize)> = None;
            for (i, own) in self.all.iter().enumerate() {
                let free = taken.get(i).is_some_and(Option::is_none);
                if !(own.is_there && free) {
                    continue;
                }
                for (e, echo) in echoes.iter().enumerate() {
                    let off = (echo.cells - own.cells) / follow.gate_cells;
                    if libm::fabs(off) >= 1.0 || taken.contains(&Some(e)) {
                        continue;
                    }
                    let turned = own.turned_rad(echo, channels) / MOST_TURNED_RAD;
                    let sum = off * off + turned * turned;
                    if turned < 1.0 && best.is_none_or(|(least, ..)| sum < least) {
                        best = Some((sum, i, e));
                    }
                }
            }
            let Some((_, i, e)) = best else {
                return taken;
            };
            if let Some(place) = taken.get_mut(i) {
                *place = Some(e);
            }
        }
    }

    /// The next name that nothing which is followed has.
    fn name(&self) -> u16 {
        let is_taken = |name| self.all.iter().any(|own| own.is_there && own.name == name);
        // Of so many in a row one is free, for there are no more that are followed.
        (0..=TARGETS)
            .map(|step| self.next.wrapping_add(step as u16))
            .find(|name| !is_taken(*name))
            .unwrap_or(self.next)
    }

    fn bear(&mut self, follow: &Follow, echo: &Seen<CHANNELS>) {
        let near = self.is_near(follow, echo.cells, None);
        let mut place = self.all.iter().position(|own| !own.is_there);
        if place.is_none() {
            let candidates = self.all.iter().enumerate().filter_map(|(i, own)| {
                (!own.confirmed && own.unseen > 0).then_some((own.unseen, i))
            });
            place = candidates.max().map(|(_, i)| i);
        }
        let name = self.name();
        let Some(place) = place.and_then(|i| self.all.get_mut(i)) else {
            return;
        };
        self.next = name.wrapping_add(1);
        *place = Followed {
            is_there: true,
            name,
            confirmed: follow.seen <= 1,
            age: 0,
            unseen: 0,
            times_seen: 1,
            cells: echo.cells,
            rate_cells: 0.0,
            variance: [
                echo.sigma_cells * echo.sigma_cells,
                0.0,
                follow.gate_cells * follow.gate_cells,
            ],
            differences_rad: differences_rad(&echo.phases_rad),
            near,
        };
    }
}

impl<const CHANNELS: usize> Followed<CHANNELS> {
    /// What fills empty storage.
    const EMPTY: Self = Self {
        is_there: false,
        name: 0,
        confirmed: false,
        age: 0,
        unseen: 0,
        times_seen: 0,
        cells: 0.0,
        rate_cells: 0.0,
        variance: [0.0; 3],
        differences_rad: [0.0; CHANNELS],
        near: false,
    };

    fn update(&mut self, follow: &Follow, echo: &Seen<CHANNELS>) {
        let [range, both, rate] = self.variance;
        let mut noise = echo.sigma_cells * echo.sigma_cells;
        if self.near {
            // Of both together.
            noise += follow.gate_cells * follow.gate_cells;
        }
        let (gain, rate_gain) = (range / (range + noise), both / (range + noise));
        let off = echo.cells - self.cells;
        self.cells += gain * off;
        self.rate_cells += rate_gain * off;
        self.variance = [
            range - gain * range,
            both - gain * both,
            rate - rate_gain * both,
        ];
        self.unseen = 0;
        self.times_seen = self.times_seen.saturating_add(1);
        if !self.near {
            self.differences_rad = differences_rad(&echo.phases_rad);
        }
    }

    /// How far differences of phase are off those held, RMS.
    fn turned_rad(&self, echo: &Seen<CHANNELS>, channels: usize) -> f64 {
        let new = differences_rad(&echo.phases_rad);
        let mut squares = 0.0;
        for (held, new) in self.differences_rad.iter().zip(&new).take(channels) {
            let turns = (new - held) / TAU;
            let off = TAU * (turns - libm::round(turns));
            squares += off * off;
        }
        // The first differs from itself by nothing.
        libm::sqrt(squares / channels.saturating_sub(1).max(1) as f64)
    }
}

/// Of each channel, against the first.
fn differences_rad<const CHANNELS: usize>(phases_rad: &[f64; CHANNELS]) -> [f64; CHANNELS] {
    let first = phases_rad.first().copied().unwrap_or(0.0);
    phases_rad.map(|phase| phase - first)
}

#[cfg(test)]
mod tests {
    use super::*;

    const FOLLOW: Follow = Follow {
        gate_cells: 0.5,
        acceleration_cells: 0.01,
        apart_cells: 1.5,
        seen: 2,
        within: 3,
        bridge: 4,
    };

    fn echo(cells: f64) -> Seen<2> {
        Seen {
            cells,
            sigma_cells: 0.01,
            phase_sigma_rad: 0.01,
            ..Seen::EMPTY
        }
    }

    /// The first targets told after `pulses` more, of echoes at two ranges, or one.
    fn told(follower: &mut Follower<3, 2>, pulses: u32, cells: &[f64]) -> [Option<u16>; 2] {
        let seen = [cells[0], cells[cells.len() - 1]].map(echo);
        let mut told = [Echo {
            target: 0,
            range_m: 0.0,
            phases_rad: [0.0; 2],
            phase_sigma_rad: 0.0,
        }; 3];
        let count = follower.push(&FOLLOW, &seen[..cells.len()], (pulses, 2), &mut told);
        core::array::from_fn(|i| told[..count].get(i).map(|echo| echo.target))
    }

    /// A target is bridged over four pulses and not over five, a candidate counts for three: whether pulses come without it or do not come at all.
    #[test]
    fn what_is_too_old_is_forgotten_before_echoes_are_taken_for_it() {
        let known = |is_known: bool| [is_known.then_some(0), None];
        for (lost, is_known) in [(4, true), (5, false), (1000, false), (u32::MAX - 1, false)] {
            let mut follower = Follower::new();
            assert_eq!(told(&mut follower, 0, &[7.0]), known(false));
            assert_eq!(told(&mut follower, 1, &[7.0]), known(true));
            let later = told(&mut follower, lost + 1, &[7.0]);
            assert_eq!(later, known(is_known), "{lost}");
        }
        for (lost, is_known) in [(1, true), (2, false)] {
            let mut follower = Follower::new();
            assert_eq!(told(&mut follower, 0, &[7.0]), known(false));
            let later = told(&mut follower, lost + 1, &[7.0]);
            assert_eq!(later, known(is_known), "{lost}");
        }
    }

    /// The name that comes next is that of a target which has lived through all others.
    #[test]
    fn a_name_is_not_given_while_something_has_it() {
        let mut follower = Follower::new();
        follower.next = u16::MAX;
        told(&mut follower, 0, &[7.0]);
        assert_eq!(told(&mut follower, 1, &[7.0]), [Some(u16::MAX), None]);
        follower.next = u16::MAX;
        told(&mut follower, 1, &[7.0, 20.0]);
        let both = told(&mut follower, 1, &[7.0, 20.0]);
        assert_eq!(both, [Some(u16::MAX), Some(0)]);
    }
}
