//! Predicted and measured cost of each stage of image formation, shown with `-v`.

use subaperture::focus::stages::{StageTime, StageTimer, StageTimes};
use subaperture::focus::{Cost, StageCost};
use subaperture::monitor::Monitor;
use subaperture::quantity::seconds;

use crate::config::Session;

/// Show the predicted cost of each stage, and of the `comparison` with the exact sum, by the timing model.
pub(crate) fn show_predicted(session: &Session, cost: &Cost, comparison: &StageCost) {
    for stage in cost.stages.iter().chain([comparison]) {
        session.note(1, || {
            let (name, operations) = (&stage.name, stage.operations);
            let time = duration(stage.core_s);
            format!("stage {name:<28} {operations:.1e} operations, about {time} on one core")
        });
    }
    session.note(1, || {
        let all_s = cost.core_s() + comparison.core_s;
        let threads = session.threads;
        let [all, each] = [all_s, all_s / threads as f64].map(duration);
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
pub(crate) fn duration(duration_s: f64) -> String {
    let rounded = format!("{duration_s:.1e}").parse();
    seconds(rounded.unwrap_or(duration_s))
}
