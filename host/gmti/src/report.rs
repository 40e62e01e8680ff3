//! Moving targets of a recording: images, detection and estimation in one call.

use std::ops::Range;

use subaperture_model::phase_history::{
    Channel, ChannelHistory, Channels, Collection, PhaseHistory, PulseRange, ReadError,
};

use crate::alignment::Alignment;
use crate::balance::shared_band;
use crate::detection::{self, Settings, StatisticMap};
use crate::error::GmtiError;
use crate::images::{ChannelImages, Imaging};
use crate::motion::{Appearance, Focus};
use crate::sensitivity::Sensitivity;
use crate::space_time::{self, Calibration};
use crate::target::{Estimator, Target};
use crate::tracker::{Detection, Scan};

/// Moving targets of a recording.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct MovingTargets {
    /// Alignment of the channels along the track.
    pub alignment: Alignment,
    /// Registered images of all channels.
    pub images: ChannelImages,
    /// Statistic of all pixels.
    pub map: StatisticMap,
    /// Detected targets, the strongest first.
    pub targets: Vec<Target>,
    /// Number of side lobes of stronger targets that were left out.
    pub side_lobes: usize,
}

/// Form registered images of all channels, detect moving targets in them, and estimate their velocities and positions. With `integration` the targets are those of
/// [`space_time::find`], which focuses each under its own motion.
///
/// # Errors
/// [`GmtiError`].
pub fn find(
    channels: &Channels,
    imaging: &Imaging,
    settings: &Settings,
    integration: Option<&space_time::Settings>,
) -> Result<MovingTargets, GmtiError> {
    let histories = channels.iter().map(|(_, history)| history.collection());
    let collections: Vec<&Collection> = histories.collect();
    let alignment = Alignment::new(&collections)?;
    if integration.is_some() {
        shared_band(channels)?;
    }
    let images = imaging.form(channels, &alignment)?;
    let map = detection::detect(&images, &alignment, settings)?;
    let estimator = Estimator {
        images: &images,
        alignment: &alignment,
        collection: collections[0],
        grid: imaging.grid,
        settings,
        windows: imaging.windows,
    };
    if let Some(integration) = integration {
        let calibration = Calibration::of(&images);
        // The images remain in memory.
        let held_bytes = imaging.held_bytes(channels.len());
        let integration = space_time::Settings {
            memory_bytes: integration.memory_bytes.saturating_sub(held_bytes),
            ..*integration
        };
        let movers = space_time::find(
            channels,
            &alignment,
            &calibration,
            imaging.grid,
            &integration,
            imaging.monitor,
        )?;
        let targets = movers
            .iter()
            .map(|mover| estimator.of_mover(mover))
            .collect();
        return Ok(MovingTargets {
            alignment,
            images,
            map,
            targets,
            side_lobes: 0,
        });
    }
    let (mut targets, side_lobes) = estimator.targets(&map)?;
    let focus = Focus {
        channels,
        imaging,
        alignment: &alignment,
        images: &images,
        settings,
        map: &map,
    };
    let strongest = targets.iter().take(settings.focused_targets);
    let places = strongest.map(|target| {
        let [row, column] = target.image_pixel.map(|place| place.round() as usize);
        Appearance {
            place_m: target.image_position_m.into(),
            extent_m: target.extent_m,
            pixel: row * map.columns + column,
        }
    });
    let cross_ranges = focus.cross_ranges(&places.collect::<Vec<_>>())?;
    for (target, cross_range) in targets.iter_mut().zip(cross_ranges) {
        target.cross_range = cross_range;
        target.velocity_m_s = estimator.velocity_m_s(target);
    }
    Ok(MovingTargets {
        alignment,
        images,
        map,
        targets,
        side_lobes,
    })
}

impl MovingTargets {
    /// Crab angle of the array to its recorded orientation from the registration of a channel, radians, right-handed about z. `None` for channel 0,
    /// and where the geometry does not observe it.
    pub fn crab_rad(&self, channel: usize) -> Option<f64> {
        let model = self.images.models.get(channel.checked_sub(1)?)?;
        // The receiver is twice as far from channel 0 as the phase centre.
        let baseline_m = -2.0 * self.alignment.lags_s()[channel] * self.alignment.speed_m_s();
        self.images.view.crab_rad(baseline_m, model.across_m)
    }
}

impl MovingTargets {
    /// Detection performance over radial velocity for a target of a radar cross-section, m^2.
    ///
    /// # Errors
    /// [`GmtiError::Adaptive`] if the image has too few cells, or `settings` too few training cells.
    pub fn sensitivity(
        &self,
        settings: &Settings,
        cross_section_m2: f64,
    ) -> Result<Sensitivity, GmtiError> {
        Sensitivity::of(
            &self.images,
            &self.alignment,
            &self.map,
            settings,
            cross_section_m2,
        )
    }

    /// Targets with a position as a scan of the tracker.
    pub fn scan(&self) -> Scan {
        Scan {
            time_s: self.alignment.centre_s(),
            sensor_m: self.images.view.antenna_m(),
            sensor_velocity_m_s: self.images.view.along() * self.alignment.speed_m_s(),
            detections: self.targets.iter().filter_map(Detection::of).collect(),
        }
    }
}

/// Divide a recording into dwells of equal length, at most `dwell_s` seconds, and find the moving targets of each. `visit` receives them in order of time.
///
/// # Errors
/// [`GmtiError`]; [`GmtiError::Unsuited`] for a dwell that is not a positive number or contains fewer than three pulses; errors of `visit`.
pub fn find_in_dwells<E: From<GmtiError>>(
    channels: &Channels,
    imaging: &Imaging,
    settings: &Settings,
    integration: Option<&space_time::Settings>,
    dwell_s: f64,
    mut visit: impl FnMut(MovingTargets) -> Result<(), E>,
) -> Result<(), E> {
    for pulses in dwells(channels.channel(0).collection(), dwell_s)? {
        let parts = Channels::new(
            channels
                .iter()
                .map(|channel| part(channel, &pulses))
                .collect(),
        )
        .map_err(ReadError::from);
        let parts = parts.map_err(GmtiError::from)?;
        visit(find(&parts, imaging, settings, integration)?)?;
    }
    Ok(())
}

/// Pulses of a channel.
fn part<'a>(
    (about, history): (&Channel, &'a dyn PhaseHistory),
    pulses: &Range<usize>,
) -> ChannelHistory<'a> {
    (
        about.clone(),
        Box::new(PulseRange::new(history, pulses.clone())),
    )
}

/// Ranges of pulses of the dwells.
fn dwells(collection: &Collection, dwell_s: f64) -> Result<Vec<Range<usize>>, GmtiError> {
    let pulses = &collection.pulses;
    let (Some(first), Some(last)) = (pulses.first(), pulses.last()) else {
        return Err(GmtiError::Track("the recording has no pulses"));
    };
    let (start_s, length_s) = (first.time_s, last.time_s - first.time_s);
    let count = (length_s / dwell_s).ceil().max(1.0);
    // The comparison is false for NaN as well.
    if !(dwell_s > 0.0 && 3.0 * count <= pulses.len() as f64) {
        return Err(GmtiError::Unsuited(format!(
            "expected a dwell of three pulses or more, found {dwell_s} s in a recording of {length_s} s and {} pulses",
            pulses.len()
        )));
    }
    let end = |i: usize| {
        let time_s = start_s + length_s * i as f64 / count;
        match i as f64 == count {
            true => pulses.len(),
            false => pulses.partition_point(|pulse| pulse.time_s < time_s),
        }
    };
    Ok((0..count as usize).map(|i| end(i)..end(i + 1)).collect())
}
