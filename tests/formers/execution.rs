//! Execution of plans by tiles. A stricter plan replaces one whose image exceeds the bound, as for an image formed in memory.

use std::error::Error;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use subaperture::focus::ffbp::FastFactorised;
use subaperture::focus::patch::PatchSize;
use subaperture::focus::plan::{ImageSink, InMemory, Sink};
use subaperture::focus::{
    BoundPolicy, Decision, ErrorGoal, Execution, FormError, FormerChoices, Forming, ImageFormer,
    ImageSpec, Plan, Task, Tile, TileRecord,
};
use subaperture::geometry::ImageGrid;
use subaperture::image::ImageSource;
use subaperture::monitor::{Monitor, Silent};
use subaperture::phase_history::{PhaseHistory, Weights};
use subaperture::signal::window::Window;
use subaperture::simulate::{Preset, Variation};

/// Nearly all energy of the recording comes from scatterers outside this grid, so that a plan from the geometry alone is insufficient.
const GRID: &str = "x=-8:8:0.4,y=-8:8:0.4";

/// Image in memory that records its plans and the order of its tiles.
struct Recorded {
    image: InMemory,
    /// Selects the tiles that this process forms, by number.
    own: fn(usize) -> bool,
    plans: Vec<Plan>,
    taken: Vec<usize>,
}

impl Recorded {
    fn new(own: fn(usize) -> bool) -> Self {
        Self {
            image: InMemory::new(),
            own,
            plans: Vec::new(),
            taken: Vec::new(),
        }
    }
}

impl Sink for Recorded {
    fn take(
        &mut self,
        index: usize,
        tile: Tile,
        record: TileRecord,
    ) -> Result<(), Box<dyn Error + Send + Sync>> {
        self.taken.push(index);
        self.image.take(index, tile, record)
    }
}

impl ImageSink for Recorded {
    fn begin(&mut self, plan: &Plan) -> Result<Vec<usize>, Box<dyn Error + Send + Sync>> {
        self.plans.push(plan.clone());
        let mut indices = self.image.begin(plan)?;
        indices.retain(|&index| (self.own)(index));
        Ok(indices)
    }

    fn max_tiles_a_pass(&self, _: &Plan) -> usize {
        3
    }

    fn records(&mut self) -> Result<Option<Vec<TileRecord>>, Box<dyn Error + Send + Sync>> {
        self.image.records()
    }

    fn image(&self) -> Option<&dyn ImageSource> {
        self.image.image()
    }
}

/// A bound that the plan from the geometry keeps but its image exceeds, and that plan in tiles of 7 x 9 pixels.
fn case(spec: &ImageSpec, task: &Task) -> (FastFactorised, Plan) {
    let bounds = [-40.0, -45.0, -50.0, -60.0];
    let replans = |former: &FastFactorised| {
        let formed = former.form_best(task).unwrap();
        formed.settings.contains_key("planned_for_db")
    };
    let formers = bounds.map(|error_db| FastFactorised { error_db });
    let former = formers.into_iter().find(replans).expect("a second plan");
    let mut plan = Plan::new(&former, spec, BoundPolicy::Refused, &Silent).unwrap();
    plan.tile = PatchSize {
        rows: 7,
        columns: 9,
    };
    (former, plan)
}

fn with_case(check: impl FnOnce(&FastFactorised, &Plan, &Execution<FastFactorised>, &Task)) {
    let history = Preset::Table41.simulate(&Variation::default());
    let grid: ImageGrid = GRID.parse().unwrap();
    let weights = Weights::new(history.collection(), Window::None, Window::None);
    let spec = ImageSpec::new(history.collection(), &grid, &weights);
    let task = Task {
        memory_bytes: 1 << 28,
        ..Task::new(&history, &grid, &weights)
    };
    let (former, plan) = case(&spec, &task);
    let execution = Execution {
        former: &former,
        spec,
        work: task.work(),
        may_replan: true,
    };
    check(&former, &plan, &execution, &task);
}

#[test]
fn tiles_are_planned_again_like_a_whole_image() {
    with_case(|former, plan, execution, task| {
        let mut sink = Recorded::new(|_| true);
        let executed = execution.run(plan, &mut sink).unwrap().unwrap();
        assert_eq!(sink.plans.len(), 2);
        assert_eq!(&sink.plans[0], plan);
        assert_eq!(&sink.plans[1], &*executed.plan);
        let whole = executed.plan.form(former, task).unwrap();
        assert_eq!(sink.image.image.pixels, whole.image.pixels);
        // The pixels drawn for the comparison differ, and with them the target of the second plan.
        let alone = former.form(task).unwrap();
        let [by_tiles, alone] = [
            executed.plan.planned_for_db,
            alone.settings["planned_for_db"].as_f64(),
        ];
        assert!((by_tiles.unwrap() - alone.unwrap()).abs() < 0.5);
        assert!(executed.judgement.predicted_db() <= former.error_db);
    });
}

#[test]
fn shared_plan_is_not_replaced() {
    with_case(|former, plan, execution, _| {
        let mut sink = Recorded::new(|_| true);
        let execution = Execution {
            may_replan: false,
            ..*execution
        };
        match execution.run(plan, &mut sink) {
            Err(FormError::BoundMissed {
                predicted_db,
                bound_db,
                ..
            }) => assert!(predicted_db > bound_db && bound_db == former.error_db),
            other => panic!("{other:?}"),
        }
        // The sink keeps the image.
        assert_eq!(sink.plans.len(), 1);
        assert_eq!(sink.taken, (0..plan.num_tiles()).collect::<Vec<_>>());
    });
}

#[test]
fn incomplete_image_has_no_error() {
    with_case(|_, plan, execution, _| {
        let mut sink = Recorded::new(|index| index % 2 == 1);
        assert!(execution.run(plan, &mut sink).unwrap().is_none());
        let odd: Vec<usize> = (0..plan.num_tiles()).filter(|i| i % 2 == 1).collect();
        assert_eq!(sink.taken, odd);
        assert_eq!(sink.plans.len(), 1);
    });
}

/// Fast factorised backprojection whose second plan falls short of its request by 8 dB.
struct Hesitant {
    error_db: f64,
    num_plans: Arc<AtomicUsize>,
}

impl Hesitant {
    fn former(&self) -> FastFactorised {
        FastFactorised {
            error_db: self.error_db,
        }
    }
}

impl ImageFormer for Hesitant {
    fn name(&self) -> &'static str {
        "ffbp"
    }

    fn settings(&self) -> serde_json::Value {
        ImageFormer::settings(&self.former())
    }

    fn bound_db(&self) -> Option<f64> {
        Some(self.error_db)
    }

    fn decide(
        &self,
        spec: &ImageSpec,
        goal: &ErrorGoal,
        monitor: &dyn Monitor,
    ) -> Result<Decision, FormError> {
        let short_db = match self.num_plans.fetch_add(1, Ordering::Relaxed) {
            1 => 8.0,
            _ => 0.0,
        };
        let error_db = self.error_db + short_db;
        ImageFormer::decide(&FastFactorised { error_db }, spec, goal, monitor)
    }

    fn open<'a>(
        &self,
        spec: ImageSpec<'a>,
        choices: &FormerChoices,
    ) -> Result<Box<dyn Forming + 'a>, FormError> {
        ImageFormer::open(&self.former(), spec, choices)
    }

    fn planning_for(&self, error_db: f64) -> Option<Box<dyn ImageFormer>> {
        Some(Box::new(Self {
            error_db,
            num_plans: Arc::clone(&self.num_plans),
        }))
    }
}

#[test]
fn image_is_planned_again_until_the_bound_is_kept() {
    with_case(|former, plan, execution, _| {
        let hesitant = Hesitant {
            error_db: former.error_db,
            // The first plan is the given one.
            num_plans: Arc::new(AtomicUsize::new(1)),
        };
        let execution = Execution {
            former: &hesitant,
            spec: execution.spec,
            work: execution.work,
            may_replan: true,
        };
        let mut sink = Recorded::new(|_| true);
        let executed = execution.run(plan, &mut sink).unwrap().unwrap();
        let planned: Vec<f64> = sink.plans.iter().map(|plan| plan.planned_db).collect();
        assert_eq!(planned.len(), 3, "{planned:?}");
        assert!(
            planned[1] < planned[0] && planned[2] < planned[1] - 7.0,
            "{planned:?}"
        );
        assert!(executed.judgement.predicted_db() <= former.error_db);
    });
}
