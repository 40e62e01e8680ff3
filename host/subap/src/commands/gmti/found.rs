//! Targets and tracks of all dwells, and their picture.

use std::time::Duration;

use glam::DVec3;
use serde::Serialize;
use serde_json::{Value, json};
use subaperture::geometry::{ImageGrid, SceneFrame};
use subaperture::gmti::detection::Settings;
use subaperture::gmti::registration::PhaseModel;
use subaperture::gmti::tracker::{self, Plane, Track, Tracker};
use subaperture::gmti::{
    Cancellation, ChannelBalance, Chip, MovingTargets, Sensitivity, Target, geojson, space_time,
};
use subaperture::image::Image;
use subaperture::phase_history::{Channel, Channels};
use subaperture::plot::{self, Mark, Orientation, Panel};

use crate::config::{Session, record_of_run};
use crate::messages;

/// Targets and tracks of all dwells.
pub(crate) struct Found {
    plane: Plane,
    pub(super) dwells: Vec<Vec<Target>>,
    pub(super) tracker: Tracker,
    /// Balance, registration and cancellation of each channel in the first dwell.
    pub(super) channels: Vec<ChannelRecord>,
    /// Image of the first channel in the first dwell.
    image: Option<Image>,
    /// Detection performance in the first dwell.
    pub(crate) sensitivity: Option<Sensitivity>,
    pub(super) side_lobes: usize,
    pub(super) cells: f64,
}

impl Found {
    pub(crate) fn new(plane: Plane) -> anyhow::Result<Self> {
        Ok(Self {
            plane,
            dwells: Vec::new(),
            tracker: Tracker::new(tracker::Settings {
                plane,
                ..tracker::Settings::default()
            })?,
            channels: Vec::new(),
            image: None,
            sensitivity: None,
            side_lobes: 0,
            cells: 0.0,
        })
    }

    /// Add the targets of a dwell, and with `follow` continue the tracks. `refocused` are put into the picture of the first dwell.
    pub(crate) fn add(
        &mut self,
        mut dwell: MovingTargets,
        channels: &Channels,
        follow: bool,
        refocused: &[Chip],
    ) {
        if self.dwells.is_empty() {
            let about = channels.about().enumerate();
            self.channels = about
                .map(|channel| ChannelRecord::of(&dwell, channel))
                .collect();
            // The other images are not drawn.
            self.image = dwell.images.images.drain(..).next();
            if let Some(image) = &mut self.image {
                refocused.iter().for_each(|chip| chip.put_into(image));
            }
        }
        // The targets remain where tracking fails.
        if follow && let Err(error) = self.tracker.scan(&dwell.scan()) {
            messages::warning(format!(
                "dwell {}: targets not tracked: {error}",
                self.dwells.len() + 1
            ));
        }
        self.side_lobes += dwell.side_lobes;
        self.cells += dwell.map.cells;
        self.dwells.push(dwell.targets);
    }

    /// Record of the targets and tracks, a GeoJSON feature collection.
    pub(crate) fn record(
        &self,
        session: &Session,
        frame: &SceneFrame,
        (settings, integration): (&Settings, Option<&space_time::Settings>),
        taken: Duration,
    ) -> Value {
        let tracks = (self.tracker.tracks(), &self.plane);
        let mut record = geojson::collection(&self.dwells, tracks, frame);
        record["run"] = record_of_run(session, taken);
        record["channels"] = json!(self.channels);
        record["sensitivity"] = json!(self.sensitivity);
        record["settings"] = json!(settings);
        record["integration"] = json!(integration);
        record["warnings"] = json!(messages::warnings());
        record
    }

    /// Number of targets of all dwells.
    pub(super) fn num_targets(&self) -> usize {
        self.dwells.iter().map(Vec::len).sum()
    }

    /// Tracks that have been confirmed.
    pub(super) fn tracks(&self) -> impl Iterator<Item = &Track> {
        let tracks = self.tracker.tracks().iter();
        tracks.filter(|track| track.is_confirmed())
    }

    /// Picture of the first channel's image with the targets of the only dwell, or the last positions of confirmed tracks.
    pub(super) fn drawn(
        &self,
        session: &Session,
        grid: &ImageGrid,
        channels: &Channels,
    ) -> anyhow::Result<Vec<u8>> {
        let collection = channels.channel(0).collection();
        let mark = |label: String, position_m: DVec3| Mark {
            at: grid.coordinates(position_m),
            label,
        };
        let marks: Vec<Mark> = match &self.dwells[..] {
            [targets] => {
                let places = targets.iter().zip(1..);
                places
                    .filter_map(|(target, i)| Some(mark(format!("{i}"), target.position_m?.into())))
                    .collect()
            }
            _ => {
                let last = |track: &Track| {
                    let mean = track.history.last()?.mean;
                    let position_m = self.plane.position_m([mean[0], mean[1]]);
                    Some(mark(format!("T{}", track.id), position_m))
                };
                self.tracks().filter_map(last).collect()
            }
        };
        let title = format!("{}: {}", collection.name, self.counted());
        let Some(image) = &self.image else {
            anyhow::bail!("no channel has an image");
        };
        let panel = Panel {
            orientation: Orientation::of(collection, grid),
            marks,
            ..Panel::new(image, grid, title)
        };
        Ok(plot::quicklook_within(
            &panel,
            session.memory.picture_bytes,
        )?)
    }

    /// Number of targets, dwells and tracks as text.
    pub(super) fn counted(&self) -> String {
        let targets = match self.num_targets() {
            1 => "1 moving target".to_owned(),
            count => format!("{count} moving targets"),
        };
        match self.dwells.len() {
            1 => targets,
            count => format!(
                "{targets} in {count} dwells, {} tracks",
                self.tracks().count()
            ),
        }
    }
}

/// Lag and balance of a channel.
#[derive(Serialize)]
pub(super) struct ChannelRecord {
    pub(super) name: String,
    pub(super) lag_s: f64,
    balance: ChannelBalance,
    /// Comparison with the first channel, absent from that channel.
    #[serde(flatten)]
    pub(super) compared: Option<Compared>,
}

/// Registration and cancellation of a channel with the first one.
#[derive(Serialize)]
pub(super) struct Compared {
    registration: PhaseModel,
    crab_deg: Option<f64>,
    pub(super) cancellation: Cancellation,
}

impl ChannelRecord {
    fn of(found: &MovingTargets, (c, about): (usize, &Channel)) -> Self {
        Self {
            name: about.name.clone(),
            lag_s: found.alignment.lags_s()[c],
            balance: found.images.balances[c],
            compared: (c > 0).then(|| Compared {
                registration: found.images.models[c - 1],
                crab_deg: found.crab_rad(c).map(f64::to_degrees),
                cancellation: found.images.cancellation(c),
            }),
        }
    }
}
