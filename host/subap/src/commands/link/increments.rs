//! `subap link --send increments`: the module estimates its motion from the echoes of each pulse, and the track is composed of its increments.

use std::io::Write as _;
use std::time::Instant;

use anyhow::{Context, bail};
use glam::{DVec2, DVec3};
use subaperture::io::atomic::write_atomically;
use subaperture::io::ours::Kind;
use subaperture::io::track_csv;
use subaperture::io::written::{FileKind, WrittenFile};
use subaperture::module::link::{self, MotionRun, Odometer, Outcome};
use subaperture::motion::{Increment, longest_chain};
use subaperture::phase_history::{Channels, PhaseHistory};
use subaperture::targets::{Arrangement, Settings};
use subaperture::track::Fix;

use super::line::{Line, with_module};
use super::outcome::{Received, report};
use super::receiving::Watching;
use crate::args::{Link, SeveralChannels};
use crate::commands::track::open;
use crate::config::Session;
use crate::failure::Usage;
use crate::{interrupt, messages};

/// Let the module estimate its motion, and write the track.
pub(super) fn run(session: &Session, typed: &Link, start: Instant) -> anyhow::Result<()> {
    let [input] = &typed.input.files[..] else {
        let fault = "--send increments: expected one recording with all channels".to_owned();
        return Err(Usage(fault).into());
    };
    let mut claims = session.claims(&typed.writing, &typed.input.files);
    claims.file(&typed.out, Kind::Text)?;
    let names = typed.input.channels.as_ref();
    let names = names.and_then(SeveralChannels::named);
    let channels = open(session, input, names, &typed.input.set)?;
    let settings = Settings {
        window: typed.windows.window,
        ranges_m: typed.range,
        ..Settings::default()
    };
    let setup = settings
        .for_module(&channels)
        .context("--send increments")?;
    let arrangement = antennas(&channels, 0)?;
    let order = arrangement.order();
    let histories: Vec<&dyn PhaseHistory> = order.iter().map(|&c| channels.channel(c)).collect();
    let plane = |all: &[DVec3]| all.iter().map(|at_m| [at_m.x, at_m.y]).collect::<Vec<_>>();
    let task = MotionRun {
        setup,
        transmitters_m: &plane(&arrangement.transmitters_m),
        receivers_m: &plane(&arrangement.receivers_m),
        channels: &histories,
        from_front_end: typed.front_end,
    };
    task.check()?;
    // From here on, an interruption keeps the increments received.
    let _keeping = interrupt::Keeping::begin();
    let samples = histories[0].collection().num_samples;
    let mut watch = Watching::new(session);
    let (found, counts) = with_module(
        session,
        Line::of(typed),
        samples,
        &mut watch,
        |module, watch| Ok((module.increments(&task, watch), module.counts())),
    )?;
    watch.bar.finish();
    let fixes = track(&channels, &found)?;
    if fixes.len() < 2 && found.ending.is_ok() {
        bail!(
            "no two neighbouring pulses have two targets in common, and no file was written: leave out ranges of clutter with \
             --range, or place reflectors"
        );
    }
    let (mut content, mut files) = (None, Vec::new());
    if fixes.len() > 1 {
        let text = track_csv::text(&fixes);
        write_atomically(&typed.out, text.len() as u64, |file| {
            file.write_all(text.as_bytes())
        })?;
        let steps = fixes.windows(2);
        let length_m: f64 = steps
            .map(|pair| pair[0].position_m.distance(pair[1].position_m))
            .sum();
        content = Some(format!(
            "{} poses of {} pulses, track length {length_m:.3} m,",
            fixes.len(),
            channels.num_pulses()
        ));
        files.push(WrittenFile::new(&typed.out, FileKind::Track));
        warn(&settings, &found, &fixes);
    }
    let numbers = [
        ("increments", found.increments.len() as u64),
        ("poses", fixes.len() as u64),
        ("pulses_unreadable", found.unreadable.into()),
        ("pulses_sent_again", found.again.into()),
    ];
    let received = Received {
        content,
        numbers: numbers.into(),
        compared: None,
        files,
    };
    let outcome = Outcome::without_maps(counts, found.ending);
    report(session, typed, &outcome, &received, start)
}

/// Antennas of all channels in pulse `n`.
fn antennas(channels: &Channels, n: usize) -> anyhow::Result<Arrangement> {
    let pulses = channels.iter().map(|(_, history)| {
        let pulse = history.collection().pulses.get(n).cloned();
        pulse.context("the recording has no pulses")
    });
    let pulses = pulses.collect::<anyhow::Result<Vec<_>>>()?;
    Ok(Arrangement::of_pulses(&pulses)?)
}

/// Poses of the longest unbroken chain of increments. It begins at the recorded pose of its first pulse.
fn track(channels: &Channels, found: &Odometer) -> anyhow::Result<Vec<Fix>> {
    let chain = longest_chain(found.increments.iter().map(|own| {
        let motion = own.motion.map(|motion| Increment {
            moved_m: DVec2::from_array(motion.moved_m),
            turn_rad: motion.turn_rad,
        });
        (own.since as usize, own.pulse as usize, motion)
    }));
    let Some(&(first, _)) = chain.first() else {
        return Ok(Vec::new());
    };
    let start = antennas(channels, first)?;
    let pulses = &channels.channel(0).collection().pulses;
    let fix = |(pulse, pose): &(usize, _)| {
        let (position_m, attitude) = start.in_scene(pose);
        Fix {
            time_s: pulses[*pulse].time_s,
            position_m,
            attitude: Some(attitude),
        }
    };
    Ok(chain.iter().map(fix).collect())
}

/// Warn of a track that covers only a part of the recording, and of possible slips.
fn warn(settings: &Settings, found: &Odometer, fixes: &[Fix]) {
    // Targets are confirmed in the first pulses, which have no pose.
    if found.increments.len() - fixes.len() > settings.follow.within {
        messages::warning(format!(
            "track: covers {:.3} s to {:.3} s, the longest time without a gap; elsewhere neighbouring pulses have fewer than two \
             targets in common",
            fixes[0].time_s,
            fixes[fixes.len() - 1].time_s
        ));
    }
    let increments = found.increments.iter();
    let doubtful = |own: &&link::Increment| own.motion.is_some_and(|motion| motion.doubtful > 0);
    let mut doubtful = increments.filter(doubtful);
    if let Some(first) = doubtful.next() {
        messages::warning(format!(
            "track: phases near half a cycle in {} pulses: half-wavelength slips are possible from pulse {} on",
            doubtful.count() + 1,
            first.pulse
        ));
    }
}
