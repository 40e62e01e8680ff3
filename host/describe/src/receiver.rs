//! Receiver impairments from `[radar.noise]` and related sections.

use subaperture_model::radar::{
    Clock, Converter, Interferer, LinkBudget, PhaseNoise, Receiver, ThermalNoise,
};

use crate::error::Fault;
use crate::values::Values;

/// Build the receiver of `[radar]`.
pub fn build(radar: &Values) -> Result<Receiver, Fault> {
    Ok(Receiver {
        noise: radar.optional_section("noise").map(noise),
        phase_noise: radar
            .optional_section("phase_noise")
            .map(phase_noise)
            .transpose()?,
        clock: radar.optional_section("clock").map(|values| Clock {
            offset: values.number("offset"),
            jitter_s: values.number("jitter"),
        }),
        interference: radar
            .sections("interference")
            .iter()
            .map(|values| Interferer {
                frequency_hz: values.number("frequency"),
                bandwidth_hz: values.number("bandwidth"),
                power_db: values.number("power"),
                duty: values.number("duty"),
            })
            .collect(),
        converter: radar.optional_section("converter").map(|values| Converter {
            bits: values.count("bits") as u32,
            full_scale_db: values.number("full_scale"),
        }),
    })
}

fn noise(values: &Values) -> ThermalNoise {
    if values.text("kind") == "relative" {
        return ThermalNoise::Relative {
            power_db: values.number("power"),
        };
    }
    ThermalNoise::Equation(LinkBudget {
        power_w: values.number("transmitted"),
        transmit_gain_dbi: values.number("transmit_gain"),
        receive_gain_dbi: values.number("receive_gain"),
        losses_db: values.number("losses"),
        noise_figure_db: values.number("noise_figure"),
        temperature_k: values.number("temperature"),
    })
}

fn phase_noise(values: &Values) -> Result<PhaseNoise, Fault> {
    let levels: Vec<(f64, f64)> = values
        .rows("levels")
        .iter()
        .map(|row| (row[0], row[1]))
        .collect();
    let rising = levels.windows(2).all(|pair| pair[0].0 < pair[1].0);
    if levels[0].0 <= 0.0 || !rising {
        return Err(values.fault(
            "levels",
            "expected ascending offset frequencies above 0: sort the rows by frequency",
        ));
    }
    Ok(PhaseNoise { levels })
}
