//! Description of the recording, for `subap focus` and others.

use std::fmt::Write;

use serde_json::json;

use super::settings::{Mode, VnaExperiment};

/// Name of the copied positions.
pub(super) const POSITIONS: &str = "positions.csv";

/// Description of a recording with these files and array of times. `sweep_s` is the time of a sweep.
pub(super) fn text(experiment: &VnaExperiment, file: &str, times: &str, sweep_s: f64) -> String {
    let VnaExperiment { analyser, scan, .. } = experiment;
    let parameter = analyser.parameter_name().to_lowercase();
    let mut text = format!(
        "# Capture of a vector network analyser. [recording] file and times are renewed with each sweep; other keys may be changed.\n\
         name = {}\n\n[recording]\nformat = \"touchstone\"\nfile = \"{file}\"\nparameter = \"{parameter}\"\n",
        json!(experiment.name)
    );
    // Writing to a string cannot fail.
    let _ = match scan.mode {
        Mode::Free => write!(
            text,
            "times = \"{times}\"    # middle of each sweep, seconds\n\n[radar]\nkind = \"stepped\"\nstep_time = \"{} s\"\nmotion = \"true\"\n\n",
            sweep_s / analyser.points as f64
        ),
        _ => write!(
            text,
            "\n[radar]\nkind = \"stepped\"\npri = \"1 s\"    # the time of a stop is its number, from 0\n\n"
        ),
    };
    text += "# Extent of the scene, for default image grids:\n# [scene]\n# x = \"-4, 4 m\"\n# y = \"1, 9 m\"\n\n\
             # Offsets of the antennas from the positions below, if there are two:\n# [[radar.transmitter]]\n# offset = \"-0.15, 0, 0 m\"\n\
             # [[radar.receiver]]\n# offset = \"0.15, 0, 0 m\"\n\n";
    let row = |v: glam::DVec3| format!("{}, {}, {}", v.x, v.y, v.z);
    let line = |comment: &str, velocity: &str| {
        format!(
            "{comment}[platform]\n{comment}kind = \"linear\"\n{comment}at = \"start\"\n{comment}position = \"{} m\"\n{comment}velocity = \"{velocity} m/s\"\n",
            row(scan.first_m)
        )
    };
    text += &match (scan.step_m, &scan.track) {
        (Some(step_m), _) => line("", &row(step_m)),
        (None, Some(_)) => format!("[platform]\nkind = \"csv\"\nfile = \"{POSITIONS}\"\n"),
        (None, None) => format!(
            "# The positions are unknown: remove the signs # and write the velocity, in stop-and-go modes metres per stop; or kind = \"csv\" and\n\
             # file, with time_s, x_m, y_m, z_m.\n{}",
            line("# ", "0.025, 0, 0")
        ),
    };
    text
}
