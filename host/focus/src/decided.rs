//! One decision for all who ask: planning that is told before the work, and then carried out.

use std::sync::{Mutex, PoisonError};

use crate::accuracy::misses;
use crate::{Aim, Asked, Decision, FormError, Forming, ImageFormer, Misses};
use subaperture_model::monitor::Monitor;

/// A former that decides once how the image of one aim is formed, however often it is asked, and is else the former that it was
/// made of.
pub struct DecidedOnce<'a> {
    former: &'a dyn ImageFormer,
    aim: Aim<'a>,
    /// The decision, and the bound that it was made for.
    made: Mutex<Option<(Decision, Option<f64>)>>,
}

impl<'a> DecidedOnce<'a> {
    /// `former`, to form the image of `aim`.
    pub fn new(former: &'a dyn ImageFormer, aim: Aim<'a>) -> Self {
        Self {
            former,
            aim,
            made: Mutex::default(),
        }
    }

    /// Whether that is the very aim, and no other that looks like it.
    fn is_of(&self, aim: &Aim) -> bool {
        let own = &self.aim;
        std::ptr::eq(own.collection, aim.collection)
            && std::ptr::eq(own.grid, aim.grid)
            && std::ptr::eq(own.weights, aim.weights)
            && own.scratch_bytes == aim.scratch_bytes
            && own.means == aim.means
    }
}

impl ImageFormer for DecidedOnce<'_> {
    fn name(&self) -> &'static str {
        self.former.name()
    }

    fn settings(&self) -> serde_json::Value {
        self.former.settings()
    }

    fn bound_db(&self) -> Option<f64> {
        self.former.bound_db()
    }

    fn follows_sweeps(&self) -> bool {
        self.former.follows_sweeps()
    }

    fn follows_relief(&self) -> bool {
        self.former.follows_relief()
    }

    fn decide(
        &self,
        aim: &Aim,
        asked: &Asked,
        monitor: &dyn Monitor,
    ) -> Result<Decision, FormError> {
        if !self.is_of(aim) {
            return self.former.decide(aim, asked, monitor);
        }
        let mut made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((decision, bound_db)) = &*made
            && *bound_db == asked.bound_db
            // Whoever refuses a miss is to be told why, by the former.
            && (asked.misses == Misses::Allowed || !misses(decision.planned_db, asked.bound_db))
        {
            return Ok(decision.clone());
        }
        let decision = self.former.decide(aim, asked, monitor)?;
        *made = Some((decision.clone(), asked.bound_db));
        Ok(decision)
    }

    fn open<'f>(
        &self,
        aim: Aim<'f>,
        choices: &serde_json::Value,
    ) -> Result<Box<dyn Forming + 'f>, FormError> {
        self.former.open(aim, choices)
    }

    fn planning_for(&self, error_db: f64) -> Option<Box<dyn ImageFormer>> {
        self.former.planning_for(error_db)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use glam::DVec3;
    use subaperture_model::geometry::{ImageGrid, SceneFrame};
    use subaperture_model::monitor::Silent;
    use subaperture_model::phase_history::{Collection, Pulse, Sweep, Weights};
    use subaperture_signal::window::Window;

    use super::*;
    use crate::{Means, SCRATCH_BYTES, bp::Backprojection};

    /// Backprojection that counts how often it decides.
    struct Counted(Backprojection, AtomicUsize);

    impl ImageFormer for Counted {
        fn name(&self) -> &'static str {
            self.0.name()
        }
        fn settings(&self) -> serde_json::Value {
            self.0.settings()
        }
        fn bound_db(&self) -> Option<f64> {
            self.0.bound_db()
        }
        fn decide(&self, aim: &Aim, asked: &Asked, m: &dyn Monitor) -> Result<Decision, FormError> {
            self.1.fetch_add(1, Ordering::Relaxed);
            self.0.decide(aim, asked, m)
        }
        fn open<'a>(
            &self,
            aim: Aim<'a>,
            choices: &serde_json::Value,
        ) -> Result<Box<dyn Forming + 'a>, FormError> {
            self.0.open(aim, choices)
        }
    }

    #[test]
    fn an_aim_is_decided_once_and_a_refusal_is_the_formers_own() {
        let pulses = (0..32).map(|n| {
            let antenna_m = DVec3::new(f64::from(n) - 16.0, -300.0, 100.0);
            Pulse {
                transmitter_m: antenna_m,
                receiver_m: antenna_m,
                reference_m: DVec3::ZERO,
                reference_path_m: 2.0 * antenna_m.length(),
                start_hz: 9.5e9,
                step_hz: 1e6,
                time_s: 0.01 * f64::from(n),
                sweep: Sweep::AT_ONCE,
            }
        });
        let collection = Collection {
            name: "a".to_owned(),
            frame: SceneFrame::Local,
            pulses: pulses.collect(),
            num_samples: 64,
            timed: true,
            extent: None,
        };
        let grid: ImageGrid = "x=0:7:1,y=0:5:1".parse().unwrap();
        let weights = Weights::new(&collection, Window::None, Window::None);
        let aim = Aim {
            collection: &collection,
            grid: &grid,
            weights: &weights,
            scratch_bytes: SCRATCH_BYTES,
            means: Means::default(),
        };
        for (error_db, kept) in [(-60.0, true), (-160.0, false)] {
            let counted = Counted(
                Backprojection::default().error_db(error_db),
                AtomicUsize::new(0),
            );
            let once = DecidedOnce::new(&counted, aim);
            let decide = |misses| once.decide(&aim, &once.asked(misses), &Silent);
            let made = || counted.1.load(Ordering::Relaxed);
            let first = decide(Misses::Allowed).unwrap();
            assert_eq!(decide(Misses::Allowed).unwrap(), first);
            assert_eq!(made(), 1);
            let own = counted
                .0
                .decide(&aim, &once.asked(Misses::Refused), &Silent);
            match (decide(Misses::Refused), own) {
                (Ok(second), Ok(own)) => assert!(kept && second == first && own == first),
                (Err(error), Err(own)) => assert!(!kept && error.to_string() == own.to_string()),
                _ => panic!("not what the former says"),
            }
            assert_eq!(made(), if kept { 1 } else { 2 });
            // Another aim is another decision, even of a grid that is the same.
            let other = grid.clone();
            let aim = Aim {
                grid: &other,
                ..aim
            };
            once.decide(&aim, &once.asked(Misses::Allowed), &Silent)
                .unwrap();
            assert_eq!(made(), if kept { 2 } else { 3 });
        }
    }
}
