//! The same target from pulse to pulse.
//!
//! **Prediction.** A target's range and its rate, metres a pulse, are followed by a Kalman filter of constant rate, disturbed by an acceleration of
//! [`Follow::acceleration_cells`] a pulse squared, white. Differences of phase between its channels, which are its angle of arrival, are held as
//! they were last.
//!
//! **Association.** An echo may be a target's if its range is within [`Follow::gate_cells`] of the predicted, and the differences of phase
//! within [`MOST_TURNED_RAD`] RMS of those held. Of all such pairs the one that is off the least, as the sum of squares of both over their limits, is
//! taken first, then the next of those that are left.
//!
//! **Birth.** An echo that is no target's begins a candidate. A candidate that is seen in [`Follow::seen`] of its first [`Follow::within`] pulses
//! is a target, else it is forgotten. What is told of a pulse waits for that long, so that a target is told from its first echo on.
//!
//! **Gaps and death.** A target that is not seen goes on at its rate; after more than [`Follow::bridge`] pulses in a row it has died. What comes after is
//! another target: whole turns of phase between would be a guess.
//!
//! **Crossing.** Targets whose ranges are predicted within [`Follow::apart_cells`] of each other are one peak, or two that bend each other's
//! phases. They are followed as well as they can be, and nothing is told of them until they are apart, when angles of arrival tell which is which; one that was
//! not found again until then is another target, until the track says that both lie at one place ([`crate::recover()`]). A target that is born so near to another has split from it, or lay hidden by it: that is reported.
//!
//! **Crowds.** Measured with 6 to 24 reflectors at random over 20 m by 12 m, in cells of 0.25 m, by 240 pulses of 1.1 to 1.7 GHz: of a pulse's echoes this follows about as many as
//! somebody who knows all places could name without doubt (2.5 where 2.4 can be named of 8, 3.6 of 3.6 with a lower rank of detection, 5.8 of 5.0 of 24), so that regions of directions and motion
//! (C 7.3.4) have nothing to gain here: wraps between channels are told by `subaperture_motion::arrival` one baseline after another, which are its target regions. What fails in
//! crowds is detection: with 12 training cells on either side, most of them other targets, 2 to 78 % of the targets that stand apart are seen; with 40 cells and rank 0.4, 82 to 98 %.
//! Where two or three are left in a pulse tracks are lost, and their chi-square tells it: 6 to 1e5 times what is expected. (One of six crowds by default, none of them well
//! with 40 cells, is followed to its noise: what bends echoes in between, targets nearer than 1.5 cells, is not measured.)

use std::collections::VecDeque;
use std::f64::consts::TAU;

use subaperture_motion::Sighting;

use crate::echo::Echo;

/// How far differences of phase may be off those last seen, radians RMS.
pub const MOST_TURNED_RAD: f64 = 1.2;

/// Settings of the follower; cells are those of a range resolution `c / (2 B)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Follow {
    /// How far an echo may be from where its target is predicted.
    pub gate_cells: f64,
    /// Standard deviation of a target's acceleration, cells a pulse squared.
    pub acceleration_cells: f64,
    /// Nearer targets disturb each other.
    pub apart_cells: f64,
    /// In so many of a candidate's first pulses it has to be seen.
    pub seen: usize,
    /// How many those are.
    pub within: usize,
    /// Pulses in a row in which a target may be unseen.
    pub bridge: usize,
}

impl Default for Follow {
    fn default() -> Self {
        Self {
            gate_cells: 0.5,
            acceleration_cells: 0.01,
            apart_cells: 1.5,
            seen: 5,
            within: 8,
            bridge: 30,
        }
    }
}

impl Follow {
    /// What is wrong with the settings.
    pub(crate) fn fault(&self) -> Option<&'static str> {
        let positive = |x: f64| x > 0.0 && x.is_finite();
        let lengths = [self.gate_cells, self.acceleration_cells, self.apart_cells];
        if !lengths.into_iter().all(positive) {
            return Some("gate, acceleration and distance of targets must be above 0");
        }
        if self.seen == 0 || self.seen > self.within || self.within > 1000 {
            return Some("a candidate must be seen in 1 to all of its first pulses, 1000 at most");
        }
        None
    }
}

/// What became of targets.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Event {
    /// A target was confirmed.
    Born {
        /// Its number.
        target: usize,
        /// The pulse in which it was first seen.
        pulse: usize,
        /// Where, metres.
        range_m: f64,
    },
    /// A target was seen no more.
    Lost {
        /// Its number.
        target: usize,
        /// The last pulse in which it was seen.
        pulse: usize,
    },
    /// Two targets came too near to be told apart.
    Crossed {
        /// Their numbers.
        targets: [usize; 2],
        /// The first pulse of it.
        pulse: usize,
    },
    /// Beside a target another appeared, too near to have been told from it before.
    Split {
        /// The target.
        target: usize,
        /// The new one.
        into: usize,
        /// The pulse in which that was first seen.
        pulse: usize,
    },
}

/// Something that is followed.
struct Followed {
    number: usize,
    confirmed: bool,
    born: usize,
    born_range_m: f64,
    last_seen: usize,
    times_seen: usize,
    range_m: f64,
    /// Metres a pulse.
    rate_m: f64,
    /// Of range and rate: both variances, and between.
    variance: [f64; 3],
    /// Of each channel but the first, against the first.
    differences_rad: Vec<f64>,
    /// Beside which other it is too near to be told apart.
    near: Vec<usize>,
    /// The other from which it was born too near.
    split_from: Option<usize>,
}

/// Follows targets over pulses.
pub struct Follower {
    follow: Follow,
    cell_m: f64,
    all: Vec<Followed>,
    next: usize,
    pulse: usize,
    /// What waits, oldest first.
    waiting: VecDeque<Vec<Sighting>>,
    events: Vec<Event>,
    /// The fastest change of range so far, metres a pulse, of a target and at a pulse.
    fastest: Option<(f64, usize, usize)>,
}

impl Follower {
    /// With range resolution `cell_m`.
    ///
    /// # Errors
    /// What is wrong with the settings.
    pub fn new(follow: Follow, cell_m: f64) -> Result<Self, &'static str> {
        if !(cell_m > 0.0 && cell_m.is_finite()) {
            return Err("the range resolution must be above 0");
        }
        match follow.fault() {
            Some(what) => Err(what),
            None => Ok(Self {
                follow,
                cell_m,
                all: Vec::new(),
                next: 0,
                pulse: 0,
                waiting: VecDeque::new(),
                events: Vec::new(),
                fastest: None,
            }),
        }
    }

    /// Takes the next pulse's echoes, and tells what was seen [`Follow::within`] pulses before, if there was one.
    pub fn push(&mut self, echoes: &[Echo]) -> Option<Vec<Sighting>> {
        self.predict();
        self.find_crossings();
        let taken = self.associate(echoes);
        let mut told = Vec::new();
        for (i, echo) in taken.iter().enumerate() {
            let Some(echo) = echo else { continue };
            let echo = &echoes[*echo];
            self.update(i, echo);
            if self.all[i].near.is_empty() {
                told.push(sighting(self.all[i].number, echo));
            }
        }
        let new = echoes.iter().enumerate();
        for (_, echo) in new.filter(|(e, _)| !taken.contains(&Some(*e))) {
            if let Some(sighting) = self.bear(echo) {
                told.push(sighting);
            }
        }
        self.confirm();
        self.bury();
        self.waiting.push_back(told);
        self.pulse += 1;
        match self.waiting.len() > self.follow.within {
            true => self.release(),
            false => None,
        }
    }

    /// What waits still, pulse by pulse, and the end of all targets.
    pub fn finish(&mut self) -> Vec<Vec<Sighting>> {
        std::iter::from_fn(|| self.release()).collect()
    }

    /// What became of targets since this was asked for.
    pub fn events(&mut self) -> Vec<Event> {
        std::mem::take(&mut self.events)
    }

    /// The fastest change of a confirmed target's range so far, metres a pulse, with its number and the pulse.
    pub fn fastest(&self) -> Option<(f64, usize, usize)> {
        self.fastest
    }

    /// The oldest that waits, of targets alone.
    fn release(&mut self) -> Option<Vec<Sighting>> {
        let mut told = self.waiting.pop_front()?;
        let is_target = |number: usize| {
            let own = self.all.iter().find(|own| own.number == number);
            own.is_some_and(|own| own.confirmed)
        };
        told.retain(|sighting| is_target(sighting.target));
        // The dead are kept for as long as anything is to be told of them.
        let oldest = self.pulse - self.waiting.len();
        let (bridge, within) = (self.follow.bridge, self.follow.within);
        self.all
            .retain(|own| own.last_seen + bridge.max(within) + 1 >= oldest);
        Some(told)
    }

    fn is_alive(&self, own: &Followed) -> bool {
        self.pulse - own.last_seen <= self.follow.bridge + 1
    }

    fn predict(&mut self) {
        let noise = (self.follow.acceleration_cells * self.cell_m).powi(2);
        for own in &mut self.all {
            let [range, both, rate] = own.variance;
            own.range_m += own.rate_m;
            own.variance = [
                range + 2.0 * both + rate + 0.25 * noise,
                both + rate + 0.5 * noise,
                rate + noise,
            ];
        }
    }

    fn find_crossings(&mut self) {
        let apart_m = self.follow.apart_cells * self.cell_m;
        for i in 0..self.all.len() {
            let own = &self.all[i];
            let others = self.all.iter().enumerate().filter(|(j, other)| {
                *j != i && other.confirmed && self.is_alive(other) && self.is_alive(own)
            });
            let near = others.filter(|(_, other)| (other.range_m - own.range_m).abs() < apart_m);
            let near: Vec<usize> = near.map(|(_, other)| other.number).collect();
            let new = near.iter().filter(|number| !own.near.contains(number));
            for &other in new.filter(|&&other| own.confirmed && own.number < other) {
                self.events.push(Event::Crossed {
                    targets: [own.number, other],
                    pulse: self.pulse,
                });
            }
            self.all[i].near = near;
        }
    }

    /// The echo of each that is followed.
    fn associate(&self, echoes: &[Echo]) -> Vec<Option<usize>> {
        let gate_m = self.follow.gate_cells * self.cell_m;
        let expected = self.all.iter().map(|own| {
            let alive = self.is_alive(own);
            alive.then_some((own.range_m, own.differences_rad.as_slice()))
        });
        associate(expected, echoes, gate_m)
    }

    fn update(&mut self, i: usize, echo: &Echo) {
        let own = &mut self.all[i];
        let [range, both, rate] = own.variance;
        let mut noise = echo.range_sigma_m.powi(2);
        if !own.near.is_empty() {
            // Of both together.
            noise += (self.follow.gate_cells * self.cell_m).powi(2);
        }
        let (gain, rate_gain) = (range / (range + noise), both / (range + noise));
        let off_m = echo.range_m - own.range_m;
        own.range_m += gain * off_m;
        own.rate_m += rate_gain * off_m;
        own.variance = [
            range - gain * range,
            both - gain * both,
            rate - rate_gain * both,
        ];
        own.last_seen = self.pulse;
        own.times_seen += 1;
        if own.near.is_empty() {
            own.differences_rad = differences_rad(&echo.phases_rad);
            let settled = own.confirmed && own.variance[2].sqrt() < 0.05 * own.rate_m.abs();
            if settled
                && self
                    .fastest
                    .is_none_or(|(most, ..)| own.rate_m.abs() > most)
            {
                self.fastest = Some((own.rate_m.abs(), own.number, self.pulse));
            }
        }
    }

    /// A candidate, and what is seen of it if no other is near.
    fn bear(&mut self, echo: &Echo) -> Option<Sighting> {
        let apart_m = self.follow.apart_cells * self.cell_m;
        let near = self.all.iter().filter(|own| {
            own.confirmed && self.is_alive(own) && (own.range_m - echo.range_m).abs() < apart_m
        });
        let near: Vec<usize> = near.map(|own| own.number).collect();
        let gate_m = self.follow.gate_cells * self.cell_m;
        self.all.push(Followed {
            number: self.next,
            confirmed: false,
            born: self.pulse,
            born_range_m: echo.range_m,
            last_seen: self.pulse,
            times_seen: 1,
            range_m: echo.range_m,
            rate_m: 0.0,
            variance: [echo.range_sigma_m.powi(2), 0.0, gate_m * gate_m],
            differences_rad: differences_rad(&echo.phases_rad),
            split_from: near.first().copied(),
            near,
        });
        self.next += 1;
        let own = &self.all[self.all.len() - 1];
        own.near.is_empty().then(|| sighting(own.number, echo))
    }

    fn confirm(&mut self) {
        for own in self.all.iter_mut().filter(|own| !own.confirmed) {
            let in_time = self.pulse - own.born < self.follow.within;
            if !(in_time && own.times_seen >= self.follow.seen) {
                continue;
            }
            own.confirmed = true;
            self.events.push(Event::Born {
                target: own.number,
                pulse: own.born,
                range_m: own.born_range_m,
            });
            if let Some(target) = own.split_from {
                self.events.push(Event::Split {
                    target,
                    into: own.number,
                    pulse: own.born,
                });
            }
        }
    }

    fn bury(&mut self) {
        let (within, bridge, pulse) = (self.follow.within, self.follow.bridge, self.pulse);
        let events = &mut self.events;
        self.all.retain(|own| {
            // Candidates have their first pulses.
            own.confirmed || pulse - own.born < within
        });
        for own in self.all.iter().filter(|own| own.confirmed) {
            if pulse - own.last_seen == bridge + 1 {
                events.push(Event::Lost {
                    target: own.number,
                    pulse: own.last_seen,
                });
            }
        }
    }
}

/// The echo of each whose range and differences of phase are expected.
pub(crate) fn associate<'a>(
    expected: impl Iterator<Item = Option<(f64, &'a [f64])>>,
    echoes: &[Echo],
    gate_m: f64,
) -> Vec<Option<usize>> {
    let mut pairs = Vec::new();
    let mut taken = Vec::new();
    for (i, expected) in expected.enumerate() {
        taken.push(None);
        let Some((range_m, differences_rad)) = expected else {
            continue;
        };
        for (e, echo) in echoes.iter().enumerate() {
            let off = (echo.range_m - range_m) / gate_m;
            let turned = turned_rad(differences_rad, &echo.phases_rad) / MOST_TURNED_RAD;
            if off.abs() < 1.0 && turned < 1.0 {
                pairs.push((off * off + turned * turned, i, e));
            }
        }
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    for (_, i, e) in pairs {
        if taken[i].is_none() && !taken.contains(&Some(e)) {
            taken[i] = Some(e);
        }
    }
    taken
}

pub(crate) fn sighting(target: usize, echo: &Echo) -> Sighting {
    Sighting {
        target,
        range_m: echo.range_m,
        range_sigma_m: echo.range_sigma_m,
        phases_rad: echo.phases_rad.clone(),
        phase_sigma_rad: echo.phase_sigma_rad,
    }
}

/// Of each channel but the first, against the first.
pub(crate) fn differences_rad(phases_rad: &[f64]) -> Vec<f64> {
    let (first, rest) = phases_rad.split_first().unwrap_or((&0.0, &[]));
    rest.iter().map(|phase| phase - first).collect()
}

/// How far differences of phase are off those held, RMS.
fn turned_rad(held: &[f64], phases_rad: &[f64]) -> f64 {
    let new = differences_rad(phases_rad);
    let squares = held.iter().zip(&new).map(|(held, new)| {
        let turns = (new - held) / TAU;
        (TAU * (turns - turns.round())).powi(2)
    });
    (squares.sum::<f64>() / held.len().max(1) as f64).sqrt()
}
