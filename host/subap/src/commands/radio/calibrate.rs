//! `subap radio calibrate`: estimate cable and channel responses from two captures.

use serde_json::json;
use subaperture::SPEED_OF_LIGHT_M_S;
use subaperture::io::ours::Kind;
use subaperture::io::written::{FileKind, WrittenFile};
use subaperture::radio::Reference;
use subaperture::radio::profile::{Calibration, Steps};
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
    let calibration = match (setup.reference, typed.range, typed.at) {
        (Reference::Leakage, _, Some(place_m)) => {
            Calibration::measure_leakage(&date, &setup, &sky, &reflector, place_m, typed.search)
        }
        (Reference::Leakage, _, None) => {
            let fault = "these captures use the leakage as reference: give the position of the reflector with --at X,Y,Z";
            return Err(Usage(fault.to_owned()).into());
        }
        (reference, Some(range_m), _) => {
            let [sky, reflector] = [sky, reflector].map(|steps| steps.over(reference));
            Calibration::measure(&date, &setup, &sky, &reflector, range_m, typed.search)
        }
        (_, None, _) => {
            let fault = "these captures use the loop as reference: give the distance of the reflector with --range METRES";
            return Err(Usage(fault.to_owned()).into());
        }
    }?;
    calibration.write(&typed.out)?;
    let receivers = setup
        .reference
        .receivers()
        .iter()
        .zip(&calibration.receivers);
    let found: Vec<_> = receivers
        .map(|(receiver, found)| {
            let delay_m = 0.5 * found.delay_s * SPEED_OF_LIGHT_M_S;
            let level_db = 20.0 * found.amplitude[0].hypot(found.amplitude[1]).log10();
            (receiver, delay_m, level_db)
        })
        .collect();
    if session.json() {
        let each = found.iter().map(|(receiver, delay_m, level_db)| {
            json!({ "receiver": receiver, "delay_m": delay_m, "level_db": level_db })
        });
        return text::say_json(
            "calibration",
            json!({
                "files": [WrittenFile::new(&typed.out, FileKind::Calibration)],
                "date": calibration.date,
                "receivers": each.collect::<Vec<_>>(),
            }),
        );
    }
    if session.prints_text() {
        for (receiver, delay_m, level_db) in found {
            text::say(format!(
                "{}: range bias of receiver {receiver}: {delay_m:.3} m; reflector level {} relative to the reference",
                typed.out.display(),
                text::decibels(level_db)
            ))?;
        }
    }
    Ok(())
}
