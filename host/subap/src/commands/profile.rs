//! `subap profile`: compute range profiles of a capture.

use std::collections::BTreeSet;

use serde_json::json;
use subaperture::SPEED_OF_LIGHT_M_S;
use subaperture::geometry::Axis;
use subaperture::io::together::FileSet;
use subaperture::io::written::FileKind;
use subaperture::monitor::Monitor;
use subaperture::plot::{Chart, Colours, Curve, HeatMap, Stroke, heat, lines};
use subaperture::radio::Reference;
use subaperture::radio::profile::{Calibration, Options, Profile, ProfileError, Ranging, Sweep};
use subaperture::radio::sigmf::{Recording, Setup};

use crate::config::Session;
use crate::failure::Usage;
use crate::{args, interrupt, messages, text};

/// Names of the pictures; the waterfall is drawn of two or more sweeps.
const PLOTS: [&str; 2] = ["profile.png", "waterfall.png"];
/// Dynamic range of the pictures, dB.
const SPAN_DB: f64 = 60.0;
/// Maximum number of rows of a waterfall; of more sweeps, some are skipped.
pub(super) const MAX_ROWS: usize = 512;
/// Maximum number of range cells in a waterfall: 256 MiB.
const MAX_CELLS: usize = 1 << 26;
/// Maximum number of range cells per resolution cell: 64 MiB for 65536 carriers.
const MAX_FINENESS: usize = 64;

/// Range processing of sweeps.
struct Processing<'a> {
    typed: &'a args::Profile,
    ranging: Ranging,
    /// Index of the shown receiver among those with antennas.
    receiver: usize,
    calibrated: bool,
    /// Number of range samples shown.
    places: usize,
}

impl<'a> Processing<'a> {
    fn new(typed: &'a args::Profile, setup: &Setup) -> anyhow::Result<Self> {
        let calibration = typed.calibration.as_deref().map(Calibration::read);
        let options = Options {
            reference: typed.no_reference.then_some(Reference::None),
            reach_m: typed.reach,
            calibration: calibration.transpose()?,
        };
        let calibrated = options.calibration.is_some();
        let ranging = Ranging::new(setup, options)?;
        let receivers = ranging.reference().receivers();
        let receiver = receivers.iter().position(|there| *there == typed.receiver);
        let Some(receiver) = receiver else {
            let fault = format!(
                "--receiver {} has no antenna in this capture",
                typed.receiver
            );
            return Err(Usage(fault).into());
        };
        let (band, reach_m) = (setup.band(), ranging.reach_m());
        let places = match setup.is_chirp() {
            false => band.count * typed.fineness,
            // The unambiguous range is that of the pulse interval, kilometres.
            true => {
                (reach_m / band.unambiguous_path_m() * 2.0 * (band.count * typed.fineness) as f64)
                    .ceil() as usize
                    + 1
            }
        };
        Ok(Self {
            typed,
            ranging,
            receiver,
            calibrated,
            places,
        })
    }

    fn profile(
        &mut self,
        recording: &mut Recording,
        sweep: u64,
    ) -> Result<(Sweep, Profile), ProfileError> {
        let read = self
            .ranging
            .read(recording, sweep)?
            .swap_remove(self.receiver);
        let reach_m = self.ranging.reach_m();
        let mut profile = read.profile(self.typed.window, self.typed.fineness, reach_m)?;
        profile.values.truncate(self.places);
        Ok((read, profile))
    }
}

/// Report the scatterers of a sweep, and draw the sweep and a waterfall of all sweeps.
pub(crate) fn run(session: &Session, typed: &args::Profile) -> anyhow::Result<()> {
    if typed.fineness > MAX_FINENESS {
        let fault = format!("--fineness: expected at most {MAX_FINENESS}");
        return Err(Usage(fault).into());
    }
    let mut recording = Recording::open_within(&typed.recording, session.memory_bytes / 2)?;
    if recording.interrupted() {
        messages::warning("the capture was killed or is still running: complete sweeps are shown");
    }
    let setup = recording.setup().clone();
    let band = setup.band();
    let unambiguous_m = SPEED_OF_LIGHT_M_S / (2.0 * band.step_hz);
    let mut processing = Processing::new(typed, &setup)?;
    let sweeps: BTreeSet<u64> = recording.steps().iter().map(|step| step.sweep).collect();
    let mut inputs = vec![typed.recording.clone()];
    inputs.extend(typed.calibration.clone());
    let mut claims = session.claims(&typed.writing, &inputs);
    let names = match sweeps.len() {
        1 => &PLOTS[..1],
        _ => &PLOTS[..],
    };
    if let Some(folder) = &typed.out {
        claims.folder(folder, names)?;
    }
    let (sweep, profile) = processing.profile(&mut recording, typed.sweep)?;
    let scatterers = sweep.scatterers(typed.floor, processing.ranging.reach_m())?;
    let mut files = FileSet::new();
    if let Some(folder) = &typed.out {
        let title = format!("{}, sweep {}", setup.name, typed.sweep);
        let chart = chart(&profile, title);
        let mut draw = |name: &str, picture: &[u8]| {
            files.write_bytes(&folder.join(name), FileKind::Picture, picture)
        };
        draw(PLOTS[0], &lines(&chart)?)?;
        if sweeps.len() > 1 {
            let drawn = waterfall(session, &mut processing, &mut recording, &sweeps)?;
            draw(PLOTS[1], &drawn)?;
        }
        interrupt::check()?;
    }
    let files = files.commit()?;
    let levels = |z: f64| 20.0 * z.log10();
    if session.json() {
        return text::say_json(
            "profile",
            json!({
                "recording": typed.recording.display().to_string(),
                "sweep": typed.sweep,
                "sweeps": sweeps.len(),
                "carriers": { "usable": sweep.usable(), "count": band.count },
                "resolution_m": unambiguous_m / band.count as f64,
                "unambiguous_m": unambiguous_m,
                "calibrated": processing.calibrated,
                "scatterers": scatterers.iter().map(|one| json!({
                    "range_m": one.range_m,
                    "sigma_m": one.sigma_m,
                    "level_db": levels(one.amplitude.norm()),
                })).collect::<Vec<_>>(),
                "profile": {
                    "spacing_m": profile.spacing_m,
                    "levels_db": profile.values.iter().map(|z| {
                        let level_db = levels(z.norm());
                        level_db.is_finite().then_some(level_db)
                    }).collect::<Vec<_>>(),
                },
                "files": files,
            }),
        );
    }
    let to = if processing.calibrated {
        "the reflector"
    } else {
        "the reference"
    };
    text::say(format!(
        "sweep {} of {}: {} of {} carriers, {:.3} m resolution, {unambiguous_m:.2} m unambiguous",
        typed.sweep,
        sweeps.len(),
        sweep.usable(),
        band.count,
        unambiguous_m / band.count as f64
    ))?;
    let rows: Vec<Vec<String>> = (scatterers.iter())
        .map(|one| {
            let [range, sigma] = [one.range_m, one.sigma_m].map(|metres| format!("{metres:.3} m"));
            vec![range, sigma, text::decibels(levels(one.amplitude.norm()))]
        })
        .collect();
    text::say(text::table(&["range", "+-", &format!("of {to}")], &rows))?;
    Ok(())
}

fn chart(profile: &Profile, title: String) -> Chart {
    let level_db = |z: f64| 20.0 * z.max(1e-300).log10();
    let levels = profile.values.iter().enumerate();
    let points: Vec<(f64, f64)> = levels
        .map(|(i, z)| (i as f64 * profile.spacing_m, level_db(z.norm())))
        .collect();
    let top = points.iter().map(|point| point.1).fold(-6000.0, f64::max);
    let floor = top - SPAN_DB;
    let points = points.into_iter().map(|(r, db)| (r, db.max(floor - 20.0)));
    Chart {
        title,
        across_label: "range (m)".to_owned(),
        up_label: "level (dB)".to_owned(),
        curves: vec![Curve {
            name: String::new(),
            points: points.collect(),
            stroke: Stroke::Solid,
        }],
        up: Some((floor, top + 3.0)),
        ..Chart::default()
    }
}

/// Waterfall: sweeps upwards, ranges across. Sweeps with too few carriers are left blank.
fn waterfall(
    session: &Session,
    processing: &mut Processing,
    recording: &mut Recording,
    sweeps: &BTreeSet<u64>,
) -> anyhow::Result<Vec<u8>> {
    let (name, places) = (recording.setup().name.clone(), processing.places);
    let rows = MAX_ROWS.min(MAX_CELLS / places).max(1);
    let stride = sweeps.len().div_ceil(rows);
    let shown: Vec<u64> = sweeps.iter().copied().step_by(stride).collect();
    let progress = session.progress("waterfall");
    let mut values = Vec::with_capacity(shown.len() * places);
    let mut spacing_m = 1.0;
    for (i, &sweep) in shown.iter().enumerate() {
        interrupt::check()?;
        progress.progress(i as f64 / shown.len() as f64);
        match processing.profile(recording, sweep) {
            Ok((_, profile)) => {
                spacing_m = profile.spacing_m;
                let levels = profile
                    .values
                    .iter()
                    .map(|z| 20.0 * z.norm().log10() as f32);
                values.extend(levels);
            }
            Err(ProfileError::TooFew { .. } | ProfileError::Leakage(_)) => {
                values.extend(std::iter::repeat_n(f32::NAN, places));
            }
            Err(error) => return Err(error.into()),
        }
    }
    progress.finish();
    let axis = |start: f64, step: f64, count: usize| Axis { start, step, count };
    let rows = axis(shown[0] as f64, stride as f64, shown.len());
    drawn(&values, rows, axis(0.0, spacing_m, places), name)
}

/// Picture of levels in dB over sweeps and ranges; not finite ones are left blank.
pub(super) fn drawn(
    values: &[f32],
    rows: Axis,
    columns: Axis,
    title: String,
) -> anyhow::Result<Vec<u8>> {
    let finite = values.iter().copied().filter(|db| db.is_finite());
    let top = f64::from(finite.fold(-3000f32, f32::max));
    Ok(heat(&HeatMap {
        values,
        rows,
        columns,
        title,
        across_label: "range (m)".to_owned(),
        up_label: "sweep".to_owned(),
        unit: "dB".to_owned(),
        range: (top - SPAN_DB, top),
        colours: Colours::Viridis,
        proportional: false,
    })?)
}
