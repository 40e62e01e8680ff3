//! Predicted and measured cost of each stage of image formation, shown with `-v`.

use subaperture::focus::Cost;
use subaperture::focus::stages::{StageTime, StageTimer, StageTimes};
use subaperture::monitor::Monitor;
use subaperture::quantity::seconds;

use crate::config::Session;

/// Show the predicted cost of each stage, by the former's timing model.
pub(crate) fn show_predicted(session: &Session, cost: &Cost) {
    for stage in &cost.stages {
        session.note(1, || {
            let (name, operations) = (&stage.name, stage.operations);
            let time = duration(stage.core_s);
            format!("stage {name:<28} {operations:.1e} operations, about {time} on one core")
        });
    }
    session.note(1, || {
        let all = duration(cost.core_s());
        let threads = session.threads;
        let each = duration(cost.core_s() / threads as f64);
        format!("all stages: about {all} on one core, {each} on {threads}, excluding reading")
    });
}

/// Form an image by `form`, which gets a monitor that forwards to `monitor`, and show the measured time of each stage.
pub(crate) fn measured<T>(
    session: &Session,
    monitor: &dyn Monitor,
    form: impl FnOnce(&dyn Monitor) -> T,
) -> T {
    if session.verbosity() == 0 {
        return form(monitor);
    }
    let times = StageTimes::default();
    let formed = form(&StageTimer {
        monitor,
        times: &times,
    });
    for StageTime {
        stage,
        threads,
        clock,
    } in times.taken()
    {
        session.note(1, || {
            let [threads, clock] = [threads, clock].map(|time| duration(time.as_secs_f64()));
            format!("stage {stage:<28} took {threads} of core time, {clock} elapsed")
        });
    }
    formed
}

/// Format a duration with two digits.
fn duration(duration_s: f64) -> String {
    let rounded = format!("{duration_s:.1e}").parse();
    seconds(rounded.unwrap_or(duration_s))
}
