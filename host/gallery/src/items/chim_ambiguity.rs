//! Ambiguity function of a linear FM pulse: Chim 2018, (2.10).

use std::f64::consts::PI;

use super::chim_strip::Map;
use crate::{Check, Context, Finding, Item, ItemError};
use subaperture_model::geometry::Axis;
use subaperture_model::radar::PulseShape;
use subaperture_planner::ambiguity::Around;

pub(super) const ITEMS: [Item; 1] = [Item {
    id: "c-2-10",
    source: "Chim 2018, (2.10)",
    title: "The ambiguity function of a linear sweep",
    work: 0.83,
    reproduce: ambiguity,
}];

const BANDWIDTH_HZ: f64 = 200e6;
const DURATION_S: f64 = 1e-6;

fn ambiguity(_: &Context) -> Result<Finding, ItemError> {
    let shape = PulseShape::Lfm {
        bandwidth_hz: BANDWIDTH_HZ,
        duration_s: DURATION_S,
        rising: true,
    };
    let around = Around::peak(&shape).map_err(ItemError::Measure)?;
    let (dopplers, delays) = (around.dopplers_hz, around.delays_s);
    let rate_hz_s = BANDWIDTH_HZ / DURATION_S;
    let mut largest: f64 = 0.0;
    for (i, &level_db) in around.levels_db.iter().enumerate() {
        let (doppler_hz, delay_s) = (dopplers.at(i / delays.count), delays.at(i % delays.count));
        let shared_s = DURATION_S - delay_s.abs();
        let x = PI * shared_s * (doppler_hz + rate_hz_s * delay_s);
        let sinc = if x == 0.0 { 1.0 } else { x.sin() / x };
        let closed = shared_s / DURATION_S * sinc.abs();
        largest = largest.max((10f64.powf(f64::from(level_db) / 20.0) - closed).abs());
    }
    // Peak of the cut at the largest Doppler shift.
    let last = dopplers.count - 1;
    let cut = &around.levels_db[last * delays.count..];
    let peak = (0..delays.count)
        .max_by(|&a, &b| cut[a].total_cmp(&cut[b]))
        .unwrap_or(0);
    let picture = Map {
        name: "ambiguity",
        caption: "Ambiguity function around its peak",
        labels: ["delay (us)", "Doppler (MHz)"],
        rows: scaled(&dopplers, 1e-6),
        columns: scaled(&delays, 1e6),
    };
    Ok(Finding {
        thesis: "|Phi(tau, nu)| = (T - |tau|) sinc((T - |tau|) (nu + k tau)): a target that moves is focused just \
                 as well, but elsewhere."
            .to_owned(),
        method: format!(
            "A linear sweep of {:.0} MHz in {:.0} us, sampled at 8 times its bandwidth, correlated with itself at {} Doppler \
             shifts and divided by its energy, T. The k of (2.10) is the sweep rate B / T, twice the alpha of (2.3). Scale: the \
             thesis gives a formula and no waveform; bandwidth and duration are ours.",
            BANDWIDTH_HZ / 1e6,
            DURATION_S * 1e6,
            dopplers.count
        ),
        checks: vec![
            Check::claim(
                "largest difference from (2.10), of the peak",
                "none",
                format!("{largest:.1e}"),
                largest < 1e-3,
            ),
            Check::number(
                &format!(
                    "delay at which an echo shifted by {:.0} MHz peaks, -nu / k",
                    dopplers.at(last) / 1e6
                ),
                -dopplers.at(last) / rate_hz_s * 1e9,
                delays.at(peak) * 1e9,
                delays.step * 1e9,
                1,
                "ns",
            ),
            Check::claim(
                "its level there",
                "focused as well",
                format!("{:.2} dB", cut[peak]),
                cut[peak] > -1.0,
            ),
        ],
        why: None,
        pictures: vec![picture.values(&around.levels_db, (-50.0, 0.0), "dB")?],
    })
}

fn scaled(axis: &Axis, by: f64) -> Axis {
    Axis {
        start: axis.start * by,
        step: axis.step * by,
        count: axis.count,
    }
}
