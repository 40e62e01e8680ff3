//! `subap radio`: list and test radios, calibrate their cables and channels, convert captures.

mod calibrate;
mod convert;
mod selftest;

use serde_json::{Value, json};
use subaperture::radio::experiment::Experiment;
use subaperture::radio::plan::Plan;
use subaperture::radio::{About, Configuration, RadioError, Range, Sensors, Side, Transceiver};

use crate::args::{Probe, Radio, RadioTask};
use crate::config::Session;
use crate::{messages, text};

/// Run the requested subcommand.
pub(crate) fn run(session: &Session, typed: &Radio) -> anyhow::Result<()> {
    match &typed.task {
        RadioTask::List(typed) => list(session, typed.serial.as_deref()),
        RadioTask::Probe(typed) => probe(session, typed),
        RadioTask::Selftest(typed) => selftest::run(session, typed),
        RadioTask::Calibrate(typed) => calibrate::run(session, typed),
        RadioTask::Convert(typed) => convert::run(session, typed),
    }
}

/// Entry of `subap radio list`.
struct Listed {
    product: String,
    serial: String,
    address: String,
}

/// Print the available radios: those of UHD, and the simulated one. With a serial number, only that radio.
fn list(session: &Session, serial: Option<&str>) -> anyhow::Result<()> {
    let mut radios = connected(session, serial)?;
    if serial.is_none() {
        radios.push(Listed {
            product: "simulated B210".to_owned(),
            serial: "SIM00001".to_owned(),
            address: "device.kind = \"simulated\" of an experiment".to_owned(),
        });
    }
    if session.json() {
        let radios: Vec<Value> = radios
            .iter()
            .map(|radio| json!({ "product": radio.product, "serial": radio.serial, "address": radio.address }))
            .collect();
        return text::say_json("radios", json!({ "radios": radios }));
    }
    for radio in radios {
        text::say(format!(
            "{:<16} {}  {}",
            radio.product, radio.serial, radio.address
        ))?;
    }
    Ok(())
}

/// Radios connected by UHD. Finding none is an error only if a serial number is given.
#[cfg(feature = "uhd")]
fn connected(session: &Session, serial: Option<&str>) -> anyhow::Result<Vec<Listed>> {
    use subaperture::radio::uhd;
    let searching = session.progress("searching");
    let found = uhd::list(serial)?;
    searching.finish();
    if found.is_empty() {
        let error = uhd::none_found(serial);
        if serial.is_some() {
            return Err(error.into());
        }
        messages::note(&error.to_string());
    }
    let listed = found.into_iter().map(|radio| Listed {
        product: radio.product,
        serial: radio.serial,
        address: radio.address,
    });
    Ok(listed.collect())
}

/// Without UHD in the build no radio is found; this is reported.
#[cfg(not(feature = "uhd"))]
fn connected(_session: &Session, serial: Option<&str>) -> anyhow::Result<Vec<Listed>> {
    if serial.is_some() {
        return Err(RadioError::Driver(subaperture::radio::NO_UHD.to_owned()).into());
    }
    messages::note(subaperture::radio::NO_UHD);
    Ok(Vec::new())
}

/// Configuration of a radio and readings of its sensors.
struct Set {
    set: Configuration,
    sensors: Sensors,
    gps_locked: Option<bool>,
}

/// Radio with its response to an experiment's settings.
struct Probed {
    about: About,
    /// Applied settings and readings; or the reason why the plan does not suit the radio.
    set: Result<Set, RadioError>,
}

fn probe(session: &Session, typed: &Probe) -> anyhow::Result<()> {
    let experiment = Experiment::read_within(&typed.experiment, &typed.set, session.memory_bytes)?;
    let opening = session.progress("opening the radio");
    let probed = experiment.with_radio(session.memory_bytes, |radio| Probed {
        about: radio.about().clone(),
        set: set(radio, &experiment.plan),
    })?;
    opening.finish();
    if let Err(objection) = &probed.set {
        messages::warning(format!(
            "the plan is not possible on this radio: {objection}"
        ));
    }
    match session.json() {
        true => text::say_json("radio", probed.record()),
        false => Ok(text::say(text::facts(&probed.facts()).join("\n"))?),
    }
}

/// Configure a radio by the plan, tune it to the first carrier, and read its sensors.
fn set(radio: &mut dyn Transceiver, plan: &Plan) -> Result<Set, RadioError> {
    plan.check(&radio.about().ranges)?;
    let set = radio.configure(&plan.radio)?;
    for side in [Side::Transmit, Side::Receive] {
        radio.tune(side, plan.start_hz, None)?;
    }
    Ok(Set {
        set,
        sensors: radio.sensors()?,
        gps_locked: radio.gps_locked()?,
    })
}

impl Probed {
    fn facts(&self) -> Vec<text::Fact> {
        let About {
            product,
            serial,
            driver,
            ranges,
        } = &self.about;
        let hertz =
            |range: &Range| format!("{} to {}", text::hertz(range.from), text::hertz(range.to));
        let gains = |range: &Range| format!("{} to {} dB", range.from, range.to);
        let mut facts = vec![
            ("radio", format!("{product}, {serial}")),
            ("driver", driver.clone()),
            ("carriers", hertz(&ranges.carrier_hz)),
            ("master clock", hertz(&ranges.master_clock_hz)),
            ("sample rate", hertz(&ranges.sample_rate_hz)),
            ("bandwidth", hertz(&ranges.bandwidth_hz)),
            ("transmitter", gains(&ranges.transmit_gain_db)),
            ("receivers", gains(&ranges.receive_gain_db)),
            ("TX ports", ranges.transmit_antennas.join(", ")),
            ("RX ports", ranges.receive_antennas.join(", ")),
        ];
        let Ok(Set {
            set,
            sensors,
            gps_locked,
        }) = &self.set
        else {
            return facts;
        };
        facts.push((
            "set to",
            format!(
                "{} samples/s, master clock {}, bandwidth {}, gains: transmit {} dB, receive {} and {} dB",
                set.sample_rate_hz,
                text::hertz(set.master_clock_hz),
                text::hertz(set.bandwidth_hz),
                set.transmit_gain_db,
                set.receive_gain_db[0],
                set.receive_gain_db[1]
            ),
        ));
        let locked = |is: bool| if is { "locked" } else { "not locked" };
        facts.push((
            "synthesisers",
            format!(
                "transmitter {}, receivers {}",
                locked(sensors.transmit_locked),
                locked(sensors.receive_locked)
            ),
        ));
        if let Some(reference) = sensors.reference_locked {
            facts.push(("reference", locked(reference).to_owned()));
        }
        if let Some(satellites) = *gps_locked {
            facts.push(("GPS", locked(satellites).to_owned()));
        }
        if let Some(celsius) = sensors.temperature_c {
            facts.push(("temperature", format!("{celsius} degrees Celsius")));
        }
        facts
    }

    fn record(&self) -> Value {
        let About {
            product,
            serial,
            driver,
            ranges,
        } = &self.about;
        let range = |range: &Range| json!([range.from, range.to]);
        let set = self.set.as_ref().ok().map(|all| {
            let (set, sensors) = (&all.set, &all.sensors);
            json!({
                "master_clock_hz": set.master_clock_hz,
                "sample_rate_hz": set.sample_rate_hz,
                "bandwidth_hz": set.bandwidth_hz,
                "transmit_gain_db": set.transmit_gain_db,
                "receive_gain_db": set.receive_gain_db,
                "transmit_locked": sensors.transmit_locked,
                "receive_locked": sensors.receive_locked,
                "reference_locked": sensors.reference_locked,
                "gps_locked": all.gps_locked,
                "temperature_c": sensors.temperature_c,
            })
        });
        json!({
            "product": product,
            "serial": serial,
            "driver": driver,
            "carrier_hz": range(&ranges.carrier_hz),
            "master_clock_hz": range(&ranges.master_clock_hz),
            "sample_rate_hz": range(&ranges.sample_rate_hz),
            "bandwidth_hz": range(&ranges.bandwidth_hz),
            "transmit_gain_db": range(&ranges.transmit_gain_db),
            "receive_gain_db": range(&ranges.receive_gain_db),
            "transmit_antennas": ranges.transmit_antennas,
            "receive_antennas": ranges.receive_antennas,
            "set": set,
        })
    }
}
