//! Cached decision of a former: planning that is reported before the work and then used for it.

use std::sync::{Mutex, PoisonError};

use crate::accuracy::misses;
use crate::{BoundPolicy, Decision, ErrorGoal, FormError, Forming, ImageFormer, ImageSpec};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::{Beam, Collection, Weights};
use subaperture_signal::window::Window;

/// Adapter that decides once how to form the image of one aim, and forwards everything else to its
/// former.
pub struct DecidedOnce<'a> {
    former: &'a dyn ImageFormer,
    spec: ImageSpec<'a>,
    /// Decision, and the bound that it was made for.
    made: Mutex<Option<(Decision, Option<f64>)>>,
}

impl<'a> DecidedOnce<'a> {
    /// Wrap `former` for the image of `spec`.
    pub fn new(former: &'a dyn ImageFormer, spec: ImageSpec<'a>) -> Self {
        Self {
            former,
            spec,
            made: Mutex::default(),
        }
    }

    /// Whether `spec` is the identical aim, by address.
    fn is_of(&self, spec: &ImageSpec) -> bool {
        let own = &self.spec;
        std::ptr::eq(own.collection, spec.collection)
            && std::ptr::eq(own.grid, spec.grid)
            && std::ptr::eq(own.weights, spec.weights)
            && own.scratch_bytes == spec.scratch_bytes
            && own.numerics == spec.numerics
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

    fn beam(&self) -> Option<Beam> {
        self.former.beam()
    }

    fn weights(
        &self,
        collection: &Collection,
        grid: &ImageGrid,
        fast: Window,
        slow: Window,
    ) -> Result<Weights, FormError> {
        self.former.weights(collection, grid, fast, slow)
    }

    fn decide(
        &self,
        spec: &ImageSpec,
        goal: &ErrorGoal,
        monitor: &dyn Monitor,
    ) -> Result<Decision, FormError> {
        if !self.is_of(spec) {
            return self.former.decide(spec, goal, monitor);
        }
        let mut made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((decision, bound_db)) = &*made
            && *bound_db == goal.bound_db
            // A caller that refuses an excessive error needs the former's own reason.
            && (goal.bound_policy == BoundPolicy::Allowed || !misses(decision.planned_db, goal.bound_db))
        {
            return Ok(decision.clone());
        }
        let decision = self.former.decide(spec, goal, monitor)?;
        *made = Some((decision.clone(), goal.bound_db));
        Ok(decision)
    }

    fn open<'f>(
        &self,
        spec: ImageSpec<'f>,
        choices: &serde_json::Value,
    ) -> Result<Box<dyn Forming + 'f>, FormError> {
        self.former.open(spec, choices)
    }

    fn planning_for(&self, error_db: f64) -> Option<Box<dyn ImageFormer>> {
        self.former.planning_for(error_db)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use glam::DVec3;
    use subaperture_model::geometry::SceneFrame;
    use subaperture_model::monitor::Silent;
    use subaperture_model::phase_history::{Pulse, Sweep};

    use super::*;
    use crate::{Numerics, SCRATCH_BYTES, bp::Backprojection};

    /// Backprojection that counts its decisions.
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
        fn decide(
            &self,
            spec: &ImageSpec,
            goal: &ErrorGoal,
            m: &dyn Monitor,
        ) -> Result<Decision, FormError> {
            self.1.fetch_add(1, Ordering::Relaxed);
            self.0.decide(spec, goal, m)
        }
        fn open<'a>(
            &self,
            spec: ImageSpec<'a>,
            choices: &serde_json::Value,
        ) -> Result<Box<dyn Forming + 'a>, FormError> {
            self.0.open(spec, choices)
        }
    }

    #[test]
    fn aim_is_decided_once_and_refusal_comes_from_former() {
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
        let spec = ImageSpec {
            collection: &collection,
            grid: &grid,
            weights: &weights,
            scratch_bytes: SCRATCH_BYTES,
            numerics: Numerics::default(),
        };
        for (error_db, kept) in [(-60.0, true), (-160.0, false)] {
            let counted = Counted(
                Backprojection::default().error_db(error_db),
                AtomicUsize::new(0),
            );
            let once = DecidedOnce::new(&counted, spec);
            let decide = |bound_policy| once.decide(&spec, &once.goal(bound_policy), &Silent);
            let made = || counted.1.load(Ordering::Relaxed);
            let first = decide(BoundPolicy::Allowed).unwrap();
            assert_eq!(decide(BoundPolicy::Allowed).unwrap(), first);
            assert_eq!(made(), 1);
            let own = counted
                .0
                .decide(&spec, &once.goal(BoundPolicy::Refused), &Silent);
            match (decide(BoundPolicy::Refused), own) {
                (Ok(second), Ok(own)) => assert!(kept && second == first && own == first),
                (Err(error), Err(own)) => assert!(!kept && error.to_string() == own.to_string()),
                _ => panic!("not what the former says"),
            }
            assert_eq!(made(), if kept { 1 } else { 2 });
            // A different aim needs a new decision, even for an equal grid.
            let other = grid.clone();
            let spec = ImageSpec {
                grid: &other,
                ..spec
            };
            once.decide(&spec, &once.goal(BoundPolicy::Allowed), &Silent)
                .unwrap();
            assert_eq!(made(), if kept { 2 } else { 3 });
        }
    }
}
