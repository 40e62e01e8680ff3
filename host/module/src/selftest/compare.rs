//! Comparison of the products of a module with those of the same core on this computer.

use std::collections::BTreeMap;

use num_complex::Complex32;
use subaperture_core::cfar::{Cfar, Column, Detection, TrainingWindow};
use subaperture_core::link::{AssembledMap, Encoding, Increment};
use subaperture_core::motion::{Antennas, Odometer, Progress};
use subaperture_core::sweep::Profiler;
use subaperture_io::selftest::Check;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::phase_history::{InMemory, PhaseHistory, ReadError};

use super::scenes;
use crate::accumulated::by_host_core;
use crate::link::{
    ChannelDetection, DetectionSink, Detector, HostCore, ImageRequest, ImageSum, LinkError,
    MapSink, MotionRun, Outcome, Profile, ProfileRun, Session, SessionObserver, SinkError,
    TransferEnd, Verified,
};

/// Capacity of the firmware's list of detections.
const DETECTIONS: usize = 32;

/// Detector with a threshold low enough for detections in every map.
const CFAR: Cfar = Cfar {
    range: TrainingWindow {
        guard: 1,
        training: 3,
    },
    doppler: TrainingWindow {
        guard: 1,
        training: 2,
    },
    false_alarm_probability: 0.1,
};

/// Product of the module compared with that of this computer.
pub(super) struct Compared {
    name: &'static str,
    /// Number of products, and of those that differ or are missing.
    expected: usize,
    wrong: usize,
    /// Error that ended the transfer, or loss on the line that was not repaired.
    error: Option<String>,
}

impl Compared {
    /// Check that all products are equal.
    pub(super) fn check(&self) -> Check {
        // An error fails the check even if all products arrived.
        let wrong = self.wrong.max(usize::from(self.error.is_some()));
        let check = Check::faults(self.name, wrong as u64, "bit-identical to this computer")
            .noted(&format!("{} compared", self.expected));
        match &self.error {
            Some(error) => check.noted(error),
            None => check,
        }
        .advised("check power supply, clock and memory of the board, and that its firmware has the version of this program")
    }
}

/// Pass on a cancellation, and keep other errors for the report.
fn kept(ending: Result<(), LinkError>) -> Result<Option<String>, LinkError> {
    match ending {
        Ok(()) => Ok(None),
        Err(LinkError::Cancelled) => Err(LinkError::Cancelled),
        Err(error) => Ok(Some(error.to_string())),
    }
}

fn ending(outcome: &mut Outcome) -> Result<(), LinkError> {
    match std::mem::replace(&mut outcome.ending, TransferEnd::Complete) {
        TransferEnd::Failed(error) => Err(error),
        TransferEnd::Complete | TransferEnd::Incomplete => Ok(()),
    }
}

/// Comparison and transfer, or an error that ends the test.
pub(super) type Tried = Result<(Compared, Outcome), LinkError>;

/// Core on this computer, on the recording of the maps.
fn core(recording: &InMemory, encoding: Encoding) -> Result<HostCore<'_>, LinkError> {
    let core = HostCore::new(scenes::job(recording, encoding)?);
    Ok(core.expect("settings of the built-in recording"))
}

/// Sink of maps that were compared before.
struct Discard;

impl MapSink for Discard {
    fn accept(&mut self, _: &AssembledMap<'_>) -> Result<(), SinkError> {
        Ok(())
    }
}

/// Transfer the maps, and compare them bit by bit.
pub(super) fn maps(
    session: &mut Session<'_>,
    recording: &InMemory,
    encoding: Encoding,
    watch: &mut dyn SessionObserver,
) -> Tried {
    let mut verified = Verified::new(Discard, core(recording, encoding)?);
    let mut job = scenes::job(recording, encoding)?;
    let mut outcome = session.transfer(&mut job, &mut verified, watch);
    let error = kept(ending(&mut outcome))?;
    let expected = job.num_sub_cpis() as usize * job.patches.len();
    let (same, _) = verified.counts();
    let compared = Compared {
        name: "maps",
        expected,
        wrong: expected - same as usize,
        error,
    };
    Ok((compared, outcome))
}

/// Transfer the accumulated image, and compare its pixels bit by bit.
pub(super) fn image(
    session: &mut Session<'_>,
    recording: &InMemory,
    encoding: Encoding,
    watch: &mut dyn SessionObserver,
) -> Tried {
    let request = ImageRequest {
        chips: &scenes::CHIPS,
        sum: ImageSum::Coherent,
        previews: 0,
    };
    let mut job = scenes::job(recording, encoding)?;
    let (mut outcome, received) = session.accumulate(&mut job, request, watch);
    let error = kept(ending(&mut outcome))?;
    let all: Vec<u32> = (0..job.num_sub_cpis()).collect();
    let own = by_host_core(&mut core(recording, encoding)?, request, &received.sub_cpis)?;
    let chips = own.chips.iter().flatten();
    let expected: usize = chips.map(Vec::len).sum();
    let pairs = own.chips.iter().flatten().zip(&received.chips);
    let same = pairs.map(|(own, received)| {
        let received = received.iter().flatten();
        own.iter().zip(received).filter(|(a, b)| same(a, b)).count()
    });
    let mut sub_cpis = received.sub_cpis.clone();
    sub_cpis.sort_unstable();
    let wrong = expected - same.sum::<usize>() + usize::from(sub_cpis != all);
    let compared = Compared {
        name: "image",
        expected,
        wrong,
        error,
    };
    Ok((compared, outcome))
}

fn same(a: &Complex32, b: &Complex32) -> bool {
    (a.re.to_bits(), a.im.to_bits()) == (b.re.to_bits(), b.im.to_bits())
}

/// Lists of detections by sub-CPI and patch.
#[derive(Default)]
struct Lists(BTreeMap<(u32, u16), Vec<ChannelDetection>>);

impl DetectionSink for Lists {
    fn accept(
        &mut self,
        sub_cpi: u32,
        patch: u16,
        detections: &[ChannelDetection],
    ) -> Result<(), SinkError> {
        self.0.insert((sub_cpi, patch), detections.to_vec());
        Ok(())
    }
}

/// Transfer the detections, and compare them bit by bit.
pub(super) fn found(
    session: &mut Session<'_>,
    recording: &InMemory,
    encoding: Encoding,
    watch: &mut dyn SessionObserver,
) -> Tried {
    let detector = Detector {
        cfar: CFAR,
        dpca: None,
    };
    let mut job = scenes::job(recording, encoding)?;
    let mut lists = Lists::default();
    let mut outcome = session.detect(&mut job, &detector, &mut lists, watch);
    let error = kept(ending(&mut outcome))?;
    let mut core = core(recording, encoding)?;
    let (mut expected, mut wrong) = (0, 0);
    for sub_cpi in 0..job.num_sub_cpis() {
        for map in core.owned_maps(sub_cpi)? {
            let map = map.view();
            let mut columns = vec![Column::EMPTY; map.header.patch.num_range_bins()];
            let mut own = heapless::Vec::<Detection, DETECTIONS>::new();
            let searched = CFAR.detect_in_map(&map, &mut columns, &mut own);
            searched.expect("settings of the built-in recording");
            let own = own.iter().map(|detection| {
                let (doppler_bin, range_bin) = detection.cell();
                ChannelDetection {
                    detection: *detection,
                    values: vec![map.at(doppler_bin, range_bin)],
                }
            });
            let key = (sub_cpi, map.header.patch_index);
            let received = lists.0.get(&key).map_or(&[][..], Vec::as_slice);
            expected += own.len();
            if !own.eq(received.iter().cloned()) {
                wrong += 1;
            }
        }
    }
    let compared = Compared {
        name: "detections",
        expected,
        wrong,
        error,
    };
    Ok((compared, outcome))
}

/// Transfer the motion increments, and compare them bit by bit.
pub(super) fn increments(
    session: &mut Session<'_>,
    watch: &mut dyn SessionObserver,
) -> Result<Compared, LinkError> {
    let recordings = scenes::channels()?;
    let channels: Vec<&dyn PhaseHistory> = recordings.iter().map(|own| own as _).collect();
    let run = MotionRun {
        setup: scenes::MOTION,
        transmitters_m: &scenes::TRANSMITTER_M,
        receivers_m: &scenes::RECEIVERS_M,
        channels: &channels,
        from_front_end: false,
    };
    let received = session.increments(&run, watch);
    let error = kept(received.ending)?;
    let own = own_increments(&channels)?;
    let same = own.iter().zip(&received.increments).filter(|(a, b)| a == b);
    Ok(Compared {
        name: "increments",
        expected: own.len(),
        wrong: own.len() - same.count(),
        error,
    })
}

/// Increments by the core on this computer.
fn own_increments(channels: &[&dyn PhaseHistory]) -> Result<Vec<Increment>, ReadError> {
    const TEXT: &str = "settings of the built-in recording";
    let setup = scenes::MOTION;
    let centre_hz = setup.start_hz + 0.5 * f64::from(setup.num_frequencies - 1) * setup.step_hz;
    let antennas = Antennas {
        transmitters_m: &scenes::TRANSMITTER_M,
        receivers_m: &scenes::RECEIVERS_M,
        wavelength_m: SPEED_OF_LIGHT_M_S / centre_hz,
    };
    let mut odometer = Box::new(Odometer::<8, 4, 64, 256>::new());
    odometer.configure(&setup, &antennas).expect(TEXT);
    odometer.start(0);
    let mut increments = Vec::new();
    for pulse in 0..channels[0].collection().pulses.len() {
        for (channel, history) in channels.iter().enumerate() {
            let mut samples = vec![Complex32::ZERO; setup.num_frequencies.into()];
            history.read(pulse..pulse + 1, &mut samples)?;
            let pushed = odometer.push(pulse as u32, channel, 0.0, samples.into_iter());
            pushed.expect(TEXT);
        }
        increments.extend(std::iter::from_fn(|| {
            loop {
                match odometer.work() {
                    Progress::Busy => {}
                    Progress::Idle => return None,
                    Progress::Step(step) => return Some(Increment::from(&step)),
                }
            }
        }));
    }
    Ok(increments)
}

/// Transfer the range profiles, and compare them bit by bit.
pub(super) fn profiles(
    session: &mut Session<'_>,
    watch: &mut dyn SessionObserver,
) -> Result<Compared, LinkError> {
    let weights = scenes::carrier_weights();
    let mut run = ProfileRun {
        setup: scenes::SWEEP,
        weights: &weights,
        source: &mut scenes::Bursts,
    };
    let mut received: Vec<Profile> = Vec::new();
    let outcome = session.profiles(&mut run, &mut |profile| received.push(profile), watch);
    let missing = received.iter().map(|profile| profile.missing).sum::<u32>();
    let lost = (missing > 0).then(|| format!("{missing} samples were lost on the line"));
    let error = kept(outcome.ending)?.or(lost);
    const TEXT: &str = "settings of the built-in recording";
    let mut profiler = Box::new(Profiler::<8, 64, 128>::new());
    profiler.configure(&scenes::SWEEP).expect(TEXT);
    let set = profiler.set_weights(0, weights.iter().copied());
    set.expect(TEXT);
    profiler.start(0);
    for carrier in 0..scenes::SWEEP.carriers {
        let samples = scenes::Bursts::at(carrier).samples;
        let pushed = profiler.push(0, carrier, 0, samples.into_iter());
        pushed.expect(TEXT);
    }
    let own = profiler.finish(0).expect(TEXT).values;
    let expected = own.len();
    let received = received.first().map_or(&[][..], |profile| &profile.values);
    let same = own.iter().zip(received).filter(|(a, b)| same(a, b)).count();
    Ok(Compared {
        name: "range profiles",
        expected,
        wrong: expected - same,
        error,
    })
}
