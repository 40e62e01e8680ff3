//! Motion compensation of the truck-borne radar by its navigation log: Chim 2018, Figs 4.4 to 4.6.

use std::path::Path;

use glam::{DQuat, DVec2, DVec3};

use super::forming::{ERROR_DB, experiment, form, pixel_at, record, side_by_side_at};
use crate::{Check, Context, Finding, Item, ItemError, NOT_GIVEN};
use subaperture_focus::ImageFormer;
use subaperture_focus::beam::InBeam;
use subaperture_focus::bp::Backprojection;
use subaperture_focus::rda::RangeDopplerAlgorithm;
use subaperture_model::geometry::{Axis, ImageGrid};
use subaperture_model::image::{Comparison, Image};
use subaperture_model::phase_history::{OnTrack, PhaseHistory};
use subaperture_model::track::{Fix, Linear, SampledTrack, TrackError, Trajectory};
use subaperture_navigation::{Kind, Log, Options};
use subaperture_plot::Scale;
use subaperture_simulate::scenario::examples;
use subaperture_simulate::{Experiment, Pair};

pub(super) const ITEMS: [Item; 1] = [Item {
    id: "c-4-4",
    source: "Chim 2018, Figs 4.4 to 4.6",
    title: "Image of a truck-borne radar on the track of its navigation log",
    work: 40.0,
    reproduce: motion_compensation,
}];

/// Part of the scene shown, metres.
const SHOWN_X_M: (f64, f64) = (-10.0, 9.0);
const SHOWN_Y_M: (f64, f64) = (18.0, 43.0);
/// Pixel spacing, metres; the resolution is 0.5 m in range and in azimuth.
const PIXEL_M: f64 = 0.1;
/// Largest distance of the brightest pixel of a reflector from its place, metres.
const REACH_M: f64 = 1.5;
/// Error bound of the range-Doppler algorithm, dB: its migration correction is of the first order.
const STRIP_ERROR_DB: f64 = -30.0;

fn failed(error: impl std::fmt::Display) -> ItemError {
    ItemError::Measure(error.to_string())
}

/// Fixes of the middle of the antennas during the collection, by the log and its lever arm.
fn logged(truck: &Experiment) -> Result<Vec<Fix>, ItemError> {
    let mut bytes = Vec::new();
    truck.write_log(0, "gallery", &mut bytes).map_err(failed)?;
    let log = Log::read_from(&bytes[..], Path::new("truck.log"), &Options::default());
    let about = &truck.logs[0];
    let fixes = log
        .map_err(failed)?
        .fixes(Kind::Inspvax, &truck.frame, about.start);
    let mut fixes = fixes.map_err(failed)?;
    for fix in &mut fixes {
        let attitude = fix.attitude.unwrap_or(DQuat::IDENTITY);
        fix.position_m -= attitude * about.lever_arm_m;
    }
    Ok(fixes)
}

/// Motion at constant velocity that fits the fixes by least squares.
fn steady(fixes: &[Fix]) -> Linear {
    let count = fixes.len() as f64;
    let at_s = fixes.iter().map(|fix| fix.time_s).sum::<f64>() / count;
    let position_m = fixes.iter().map(|fix| fix.position_m).sum::<DVec3>() / count;
    let spread_s2: f64 = fixes.iter().map(|fix| (fix.time_s - at_s).powi(2)).sum();
    let products = fixes
        .iter()
        .map(|fix| (fix.position_m - position_m) * (fix.time_s - at_s));
    Linear {
        position_m,
        velocity_m_s: products.sum::<DVec3>() / spread_s2,
        at_s,
    }
}

/// Fixes moved to the line of the steady motion: the along-track positions are those of the log.
fn along_only(fixes: &[Fix], line: &Linear) -> Result<SampledTrack, TrackError> {
    let direction = line.velocity_m_s.normalize();
    let on_line = fixes.iter().map(|fix| Fix {
        position_m: line.position_m + direction * direction.dot(fix.position_m - line.position_m),
        ..*fix
    });
    SampledTrack::new(&on_line.collect::<Vec<_>>())
}

fn motion_compensation(context: &Context) -> Result<Finding, ItemError> {
    let text = examples::text("truck").unwrap_or_default();
    let truck = experiment("truck", text)?;
    let recorded = record(context, &truck)?;
    let axis = |(from, to): (f64, f64)| Axis {
        start: from,
        step: PIXEL_M,
        count: ((to - from) / PIXEL_M).round() as usize + 1,
    };
    let grid = ImageGrid::horizontal(axis(SHOWN_X_M), axis(SHOWN_Y_M), 0.0);
    let fixes = logged(&truck)?;
    let line = steady(&fixes);
    let along = along_only(&fixes, &line).map_err(failed)?;
    let whole = SampledTrack::new(&fixes).map_err(failed)?;

    let arms_m = [
        truck.radar.transmitters[0].offset_m,
        truck.radar.receivers[0].offset_m,
    ];
    let pair = Pair {
        transmitter: 0,
        receiver: 0,
    };
    let beam = truck.record(pair)?.stated_beam().map_err(failed)?;
    let beam = beam.ok_or_else(|| failed("the antennas have no beam"))?;
    let strip = RangeDopplerAlgorithm {
        error_db: STRIP_ERROR_DB,
        secondary_compression: true,
    };
    let strip = InBeam::new(Box::new(strip), beam.clone())?;
    let exact = Backprojection { error_db: ERROR_DB };
    let exact = InBeam::new(Box::new(exact), beam)?;
    let cases: [(&dyn Trajectory, &dyn ImageFormer); 5] = [
        (&line, &strip),
        (&along, &strip),
        (&whole, &strip),
        (&whole, &exact),
        (&*truck.track, &exact),
    ];
    let mut images: Vec<Image> = Vec::with_capacity(cases.len());
    for (n, (track, former)) in cases.iter().enumerate() {
        let placed = OnTrack::new(
            Box::new(&recorded),
            *track,
            arms_m,
            (f64::NEG_INFINITY, f64::INFINITY),
        )?;
        images.push(form(context, [n, cases.len()], &placed, &grid, *former)?);
    }
    let [uniform, resampled, ranges, backprojected, on_truth] = &images[..] else {
        return Err(failed("an image is missing"));
    };
    let places: Vec<DVec2> = truck
        .scene
        .corners
        .iter()
        .map(|c| c.position_m.truncate())
        .collect();
    // Least level of a reflector relative to that on the true track.
    let least_db = |image: &Image| {
        let losses = places.iter().map(|&place| {
            let [found, best] = [image, on_truth].map(|image| brightest(image, &grid, place).0);
            20.0 * (found / best).log10()
        });
        losses.fold(f64::INFINITY, f64::min)
    };
    let away = places
        .iter()
        .map(|&place| brightest(backprojected, &grid, place).1);
    let away_m = away.fold(0.0, f64::max);
    let rms_m = |axis: DVec3| {
        let square = |fix: &Fix| {
            let steady_m = line.pose(fix.time_s).position_m;
            axis.dot(fix.position_m - steady_m).powi(2)
        };
        (fixes.iter().map(square).sum::<f64>() / fixes.len() as f64).sqrt()
    };
    let comparison = Comparison::between(ranges, backprojected).map_err(failed)?;
    let difference_db = comparison.error_db.unwrap_or(f64::NAN);
    let [uniform_db, resampled_db, ranges_db, backprojected_db] =
        [uniform, resampled, ranges, backprojected].map(least_db);
    let checks = vec![
        Check::claim(
            "deviation from constant velocity, RMS along the track and across",
            "not perfectly uniform",
            format!("{:.3} m, {:.4} m", rms_m(DVec3::X), rms_m(DVec3::Y)),
            true,
        ),
        Check::claim(
            "weakest reflector at constant velocity, relative to the true track",
            NOT_GIVEN,
            format!("{uniform_db:.2} dB"),
            uniform_db < -3.0,
        ),
        Check::claim(
            "with along-track positions of the log",
            "variation in speed was compensated",
            format!("{resampled_db:.2} dB"),
            resampled_db > uniform_db,
        ),
        Check::claim(
            "with motion compensation in range too",
            "does not work for ground-based systems",
            format!("{ranges_db:.2} dB"),
            ranges_db < resampled_db,
        ),
        Check::claim(
            "with backprojection on the log's track",
            "to consider instead of range-Doppler",
            format!("{backprojected_db:.2} dB"),
            backprojected_db > -1.5,
        ),
        Check::claim(
            "difference of the range-Doppler image from it",
            NOT_GIVEN,
            format!("{difference_db:.1} dB"),
            difference_db < STRIP_ERROR_DB,
        ),
        Check::claim(
            "largest distance of a reflector from its place on the Earth",
            "overlay on Google Earth",
            format!("{away_m:.3} m"),
            // Half a pixel in both axes, and a tenth of the resolution.
            away_m < PIXEL_M * 0.5f64.sqrt() + 0.05,
        ),
    ];
    Ok(Finding {
        thesis: "The recorded track was not perfectly uniform: range profiles were interpolated to even positions along the track by the GNSS/INS \
                 log, then focused by the range-Doppler algorithm. Methods that compensate range motion do not work for a ground-based system \
                 whose scene begins at range zero; backprojection should be considered."
            .to_owned(),
        method: format!(
            "Scaled down: the example scenario 'truck', four corner reflectors at 20 to 41 m instead of the parking lot and the open area, whose \
             recordings are not public; 1.7 to 2.0 GHz, beams of 13.3 degrees, {} sweeps over 36 m, sway of 3 cm across. The log of the simulated \
             truck (INSPVAX, 20 per second, 4 mm) is read back, and its lever arm is undone. Range-Doppler images at constant velocity, with the log's \
             along-track positions only, and with compensation in range; backprojection on the same track and on the true one.",
            truck.radar.num_pulses
        ),
        why: Finding::unless_all_agree(
            &checks,
            "Compensation in range shifts each range profile by the deviation seen at its range, envelope and phase, fitted over the directions of \
             the scene. The residual depends on the direction within the beam of 13.3 degrees, and is small for a sway of centimetres, although \
             the scene begins at 18 m.",
        ),
        checks,
        pictures: vec![side_by_side_at(
            "images",
            "Range-Doppler images: constant velocity, along-track positions of the log, and compensation in range",
            Scale::Fixed {
                top_db: 8.0,
                span_db: 50.0,
            },
            &[
                ("constant velocity", uniform, &grid),
                ("along the track", resampled, &grid),
                ("in range too", ranges, &grid),
            ],
        )?],
    })
}

/// Largest magnitude near a place, and its distance from there, metres.
fn brightest(image: &Image, grid: &ImageGrid, place: DVec2) -> (f64, f64) {
    let reach = (REACH_M / PIXEL_M) as i64;
    let steps = (-reach..=reach).flat_map(|i| (-reach..=reach).map(move |j| (i, j)));
    let near = steps.filter_map(|(i, j)| {
        let at = DVec2::new(i as f64, j as f64) * PIXEL_M;
        let pixel = pixel_at(grid, place + at)?;
        Some((f64::from(image.pixels[pixel].norm()), at.length()))
    });
    near.fold(
        (0.0, f64::NAN),
        |best, one| if one.0 > best.0 { one } else { best },
    )
}
