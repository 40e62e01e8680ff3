//! `subap radio calibrate`: estimate cable and channel responses from captures of the sky and of reflectors.

use serde_json::{Value, json};
use subaperture::SPEED_OF_LIGHT_M_S;
use subaperture::io::ours::Kind;
use subaperture::io::written::{FileKind, WrittenFile};
use subaperture::radio::Reference;
use subaperture::radio::profile::{Calibration, Receiver, Reflector, Steps};
use subaperture::radio::sigmf::{Recording, Setup};

use crate::args::Calibrate;
use crate::config::Session;
use crate::failure::Usage;
use crate::{log, text};

pub(super) fn run(session: &Session, typed: &Calibrate) -> anyhow::Result<()> {
    let mut claims = session.claims(&typed.writing, &[&typed.sky, &typed.reflector]);
    claims.file(&typed.out, Kind::Record)?;
    let open = |path| Recording::open_within(path, session.memory_bytes / 2);
    let mut sky = open(&typed.sky)?;
    let mut reflector = open(&typed.reflector)?;
    let setup = reflector.setup().clone();
    let named = |setup: &Setup| Setup {
        name: String::new(),
        ..setup.clone()
    };
    if named(sky.setup()) != named(&setup) {
        return Err(Usage(format!(
            "{} and {} were captured with different carriers, gains, ports or radios: capture both with the same experiment",
            typed.sky.display(),
            typed.reflector.display()
        ))
        .into());
    }
    let sky = Steps::read(&mut sky, typed.sweep)?;
    let reflector = Steps::read(&mut reflector, typed.sweep)?;
    let date = log::now();
    let calibration = match setup.reference {
        Reference::Leakage if typed.at.is_empty() => {
            let fault = "these captures use the leakage as reference: give the position of each reflector with --at X,Y,Z";
            return Err(Usage(fault.to_owned()).into());
        }
        Reference::Leakage => {
            Calibration::measure_leakage(&date, &setup, &sky, &reflector, &typed.at, typed.search)
        }
        _ if typed.range.is_empty() => {
            let fault = "these captures use the loop as reference: give the distance of each reflector with --range METRES";
            return Err(Usage(fault.to_owned()).into());
        }
        reference => {
            let [sky, reflector] = [sky, reflector].map(|steps| steps.over(reference));
            Calibration::measure(&date, &setup, &sky, &reflector, &typed.range, typed.search)
        }
    }?;
    calibration.write(&typed.out)?;
    let receivers = setup.reference.receivers().iter();
    let found: Vec<_> = (receivers.zip(&calibration.receivers))
        .map(|(receiver, found)| Found::new(*receiver, found))
        .collect();
    if session.json() {
        return text::say_json(
            "calibration",
            json!({
                "files": [WrittenFile::new(&typed.out, FileKind::Calibration)],
                "date": calibration.date,
                "receivers": found.iter().map(Found::to_json).collect::<Vec<_>>(),
            }),
        );
    }
    if session.prints_text() {
        for one in &found {
            text::say(format!("{}: {}", typed.out.display(), one.text()))?;
        }
    }
    Ok(())
}

/// Result of one receiver, in metres and dB.
struct Found<'a> {
    receiver: usize,
    delay_m: f64,
    sigma_m: Option<f64>,
    level_db: f64,
    reflectors: &'a [Reflector],
}

impl<'a> Found<'a> {
    fn new(receiver: usize, found: &'a Receiver) -> Self {
        let metres = |delay_s: f64| 0.5 * delay_s * SPEED_OF_LIGHT_M_S;
        Self {
            receiver,
            delay_m: metres(found.delay_s),
            sigma_m: found.delay_sigma_s.map(metres),
            level_db: 20.0 * found.amplitude[0].hypot(found.amplitude[1]).log10(),
            reflectors: &found.reflectors,
        }
    }

    fn to_json(&self) -> Value {
        json!({
            "receiver": self.receiver,
            "delay_m": self.delay_m,
            "delay_sigma_m": self.sigma_m,
            "level_db": self.level_db,
            "reflectors": self.reflectors,
        })
    }

    /// The delay, and with several reflectors a line for each.
    fn text(&self) -> String {
        let sigma = self
            .sigma_m
            .map_or(String::new(), |sigma_m| format!(" +- {sigma_m:.4}"));
        let mut text = format!(
            "range bias of receiver {}: {:.4}{sigma} m; reflector level {} relative to the reference",
            self.receiver,
            self.delay_m,
            text::decibels(self.level_db)
        );
        if self.reflectors.len() > 1 {
            for one in self.reflectors {
                text += &format!(
                    "\n  reflector at {:.3} m: residual {:+.4} m, by noise +- {:.4} m",
                    one.range_m, one.residual_m, one.sigma_m
                );
            }
        }
        text
    }
}
