//! STANAG 4607 packet of the targets.

use anyhow::Context;
use subaperture::geometry::{ImageGrid, SceneFrame};
use subaperture::gmti::MovingTargets;
use subaperture::gmti::stanag4607::{Dwell, Job, Mission, encode};
use subaperture::phase_history::PhaseHistory;

use crate::args::Gmti;

/// Packet with a dwell segment for each dwell.
pub(super) struct Packet {
    mission: Mission,
    start_ns: i64,
    job: Option<Job>,
    dwells: Vec<Dwell>,
}

impl Packet {
    pub(super) fn new(typed: &Gmti, history: &dyn PhaseHistory) -> anyhow::Result<Self> {
        let start_ns = history
            .start_ns()
            .context("--stanag needs the date and time of the recording, which states no start")?;
        let text = |given: &Option<String>| given.clone().unwrap_or_default();
        let exercise = typed.exercise.context("--stanag needs --exercise")?;
        let (nationality, platform) = (text(&typed.nationality), text(&typed.platform));
        Ok(Self {
            mission: Mission::new(&nationality, &platform, exercise.into(), start_ns),
            start_ns,
            job: None,
            dwells: Vec::new(),
        })
    }

    /// Add the targets of a dwell.
    pub(super) fn add(
        &mut self,
        found: &MovingTargets,
        grid: &ImageGrid,
        frame: &SceneFrame,
    ) -> anyhow::Result<()> {
        let (job, mut dwell) = Dwell::of(found, grid, frame, self.start_ns)?;
        dwell.dwell_index = u16::try_from(self.dwells.len())
            .context("a STANAG 4607 packet has at most 65536 dwells: choose a longer --dwell")?;
        if let Some(last) = self.dwells.last_mut() {
            last.is_last = false;
        }
        self.job.get_or_insert(job);
        self.dwells.push(dwell);
        Ok(())
    }

    pub(super) fn encoded(&self) -> anyhow::Result<Vec<u8>> {
        let job = self.job.as_ref().context("no dwell was processed")?;
        Ok(encode(&self.mission, job, &self.dwells)?)
    }
}
