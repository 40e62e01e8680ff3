//! Speed limits of stepped carriers, for plans of radars and captures.

use std::f64::consts::PI;

use subaperture::planner::stepped::{DISPLACED_CELLS, SweepPlan};
use subaperture::quantity::{metres_per_second, seconds};

use crate::text::Fact;

/// Speed limits as lines of text. `displaces` is false for a shuffled order, which displaces no range profile.
pub(in crate::commands) fn facts(plan: &SweepPlan, displaces: bool) -> Vec<Fact> {
    let (sweep, limits) = (&plan.sweep, &plan.limits);
    let within = match plan.angle_rad < PI {
        true => format!(" within a beam of {:.4} deg", plan.angle_rad.to_degrees()),
        false => " in any direction".to_owned(),
    };
    let verdict = |limit_m_s: f64| match plan.platform_m_s {
        Some(speed_m_s) if speed_m_s <= limit_m_s => ": kept",
        Some(_) => ": NOT kept",
        None => "",
    };
    let mut facts = vec![
        (
            "sweep",
            format!(
                "{} carriers in {}, every {}",
                sweep.carriers,
                seconds(sweep.sweep_s),
                seconds(sweep.interval_s)
            ),
        ),
        (
            "fastest",
            format!(
                "{}{within}, half a turn of phase from sweep to sweep{}",
                metres_per_second(limits.followed_m_s),
                verdict(limits.followed_m_s)
            ),
        ),
    ];
    if displaces {
        facts.push((
            "profile",
            format!(
                "displaced by {DISPLACED_CELLS} cells at {} without motion compensation{}",
                metres_per_second(limits.in_place_m_s),
                verdict(limits.in_place_m_s)
            ),
        ));
    }
    facts.push((
        "fewer",
        format!(
            "half of the carriers, or two interleaved passes: {} from sweep to sweep",
            metres_per_second(plan.halved.followed_m_s),
        ),
    ));
    facts.push((
        "compensated",
        format!(
            "at a predicted speed: error of the speed up to {}, acceleration up to {:.3} m/s^2; half a turn from carrier to carrier at {}",
            metres_per_second(limits.followed_m_s),
            limits.predicted_m_s2,
            metres_per_second(limits.unwrapped_m_s)
        ),
    ));
    facts
}
