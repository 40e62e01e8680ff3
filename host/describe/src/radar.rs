//! `[radar]`: waveform, timing and antennas.

use std::f64::consts::PI;
use std::path::PathBuf;

use subaperture_model::phase_history::Band;
use subaperture_model::quantity::{hertz, seconds};
use subaperture_model::radar::{
    Antenna, Motion, Pattern, PatternTable, PulseShape, Radar, Waveform,
};

use glam::DVec3;

use crate::declare::{Choice, Located, section};
use crate::error::Fault;
use crate::receiver::ReceiverKeys;

/// Waveform, timing and antennas of the radar.
#[section]
#[derive(Clone, Debug)]
pub struct RadarKeys {
    /// Waveform: ideal phase history by definition; pulses with a matched filter; dechirped linear sweeps (FMCW); or a stepped-frequency
    /// waveform.
    #[key(required = "ideal", select(Ideal, Pulsed, Fmcw, Stepped))]
    pub kind: WaveformKeys,
    /// Number of pulses, FMCW sweeps or sweeps over all carriers.
    #[key(required = 64, whole(1, 10_000_000))]
    pub pulses: Located<usize>,
    /// Pulse repetition interval. Give either this or prf.
    #[key(example = "1 ms", positive)]
    pub pri_s: Located<Option<f64>>,
    /// Pulse repetition frequency. Give either this or pri.
    #[key(example = "1 kHz", positive)]
    pub prf_hz: Located<Option<f64>>,
    /// Time of the first pulse on the platform's clock.
    #[key(default = "0 s")]
    pub first_pulse_s: f64,
    /// Centre frequency.
    #[key(required = "10 GHz", positive)]
    pub centre_hz: f64,
    /// Bandwidth over all samples. Range resolution is c / (2 bandwidth). For FMCW, the bandwidth swept during sampling.
    #[key(required = "200 MHz", positive, when(Ideal, Fmcw, Stepped))]
    pub bandwidth_hz: Located<f64>,
    /// Samples per pulse: frequencies, carriers, or samples of the echo.
    #[key(required = 256, whole(2, 1 << 24))]
    pub samples: Located<usize>,
    /// Complex sample rate.
    #[key(required = "250 MHz", positive, when(Pulsed, Fmcw))]
    pub sample_rate_hz: Located<f64>,
    /// Delay of sample 0 after the start of the pulse. Default: the echo of the reference at the middle of the collection lies in the middle
    /// of the receive window.
    #[key(example = "38.7 us", not_negative, when(Pulsed))]
    pub window_start_s: Option<Located<f64>>,
    /// Direction of the frequency sweep.
    #[key(default = "up", when(Fmcw))]
    pub sweep: Sweep,
    /// Delay of the transmitted copy with which the echo is mixed; 0 for a homodyne radar.
    #[key(default = "0 s", not_negative, when(Fmcw))]
    pub mixer_delay_s: f64,
    /// Time from carrier to carrier.
    #[key(required = "2 us", positive, when(Stepped))]
    pub step_time_s: f64,
    /// Dwell time over which the samples of a carrier are averaged; the noise bandwidth is its inverse. Default: step_time.
    #[key(example = "1 us", positive, when(Stepped))]
    pub dwell_s: Option<Located<f64>>,
    /// Stop-and-go approximation within a pulse, or true intra-pulse motion of radar and scatterers.
    #[key(default = "stop-and-go")]
    pub motion: IntraPulse,
    /// Apply spreading loss, (R0 / R)^2 in amplitude, with R0 the range of the reference at the middle pulse, number P/2 of P from 0.
    #[key(default = false)]
    pub spreading: bool,
    /// Shape of the pulse.
    #[section(when(Pulsed))]
    pub pulse: PulseKeys,
    /// Transmit antenna; several transmit alternately, pulse by pulse. Default: one isotropic antenna at the body's origin.
    #[section]
    pub transmitter: Vec<AntennaKeys>,
    /// Receive antenna; all of them receive every pulse. Default: one isotropic antenna at the body's origin.
    #[section]
    pub receiver: Vec<AntennaKeys>,
    /// Impairments of the receiver.
    #[keys]
    pub impairments: ReceiverKeys,
}

/// Direction of a frequency sweep.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Choice)]
pub enum Sweep {
    /// Frequency rises with time.
    Up,
    /// Frequency falls with time.
    Down,
}

/// Motion of radar and scatterers within a pulse.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Choice)]
pub enum IntraPulse {
    /// Radar and scatterers rest during a pulse.
    StopAndGo,
    /// Radar and scatterers move.
    True,
}

/// Shape of a pulse.
#[section]
#[derive(Clone, Debug)]
pub struct PulseKeys {
    /// Linear frequency modulation (chirp); a phase code with chips of equal duration; or the recorded pulse, in recordings only. Delays refer
    /// to the start of the pulse. The phase of a chirp of bandwidth B and duration T is 0 at its start, exp(j pi (B / T) t (t - T)), and
    /// -pi B T / 4 in its middle.
    #[key(required = "lfm", select(Lfm, Code, Recorded))]
    pub kind: ShapeKeys,
    /// Swept bandwidth, or the band of a recorded pulse that is used, about 0 Hz. Range resolution is c / (2 bandwidth).
    #[key(required = "200 MHz", positive, when(Lfm, Recorded))]
    pub bandwidth_hz: Located<f64>,
    /// Duration of the pulse.
    #[key(required = "500 ns", positive, when(Lfm))]
    pub duration_s: Located<f64>,
    /// Direction of the frequency sweep.
    #[key(default = "up", when(Lfm))]
    pub sweep: Sweep,
    /// Name of the phase code. Give either this or phases.
    #[key(
        example = "barker-13",
        words(
            "barker-2",
            "barker-3",
            "barker-4",
            "barker-5",
            "barker-7",
            "barker-11",
            "barker-13"
        ),
        when(Code)
    )]
    pub code: Located<Option<String>>,
    /// Phase of each chip. Give either this or code.
    #[key(example = ["0 deg", "0 deg", "180 deg"], rows(1, Angle), when(Code))]
    pub phases: Located<Option<Vec<[f64; 1]>>>,
    /// Duration of a chip.
    #[key(required = "10 ns", positive, when(Code))]
    pub chip_s: Located<f64>,
    /// ARRAY of the transmitted pulse: complex samples at the sample_rate of the radar, the first at the start of the pulse.
    #[key(required = "replica.npy", when(Recorded))]
    pub samples: Located<String>,
}

/// Name and position of an antenna.
#[section]
#[derive(Clone, Debug)]
pub struct MountKeys {
    /// Name, for channels and errors. Default: T or R, and a number from 1.
    #[key(example = "left")]
    pub name: Option<String>,
    /// Phase centre in body axes.
    #[key(default = "0, 0, 0 m")]
    pub offset_m: DVec3,
}

/// Direction and pattern of an antenna.
#[section]
#[derive(Clone, Debug)]
pub struct BeamKeys {
    /// Boresight direction in body axes; the default is to the left.
    #[key(default = "0, 1, 0")]
    pub boresight: Located<DVec3>,
    /// Elevation axis of the beam in body axes, about which azimuth is measured. Only its component orthogonal to the boresight is used.
    #[key(default = "0, 0, 1")]
    pub up: Located<DVec3>,
    /// Point of the scene to which the beam is steered in every pulse (spotlight), in place of boresight. up stays that of the body.
    #[key(example = "0, 0, 0 m")]
    pub aim_m: Option<DVec3>,
    /// Antenna pattern: isotropic, Gaussian beam, cosine power, uniformly illuminated rectangular aperture with sidelobes, or a table.
    #[key(
        default = "isotropic",
        select(Isotropic, Gaussian, Cosine, Aperture, Table)
    )]
    pub pattern: PatternKeys,
    /// CSV of gains over the lattice of azimuths and elevations from the boresight: azimuth_deg, elevation_deg (left out for a cut in azimuth),
    /// gain_db. The amplitude is relative to the largest gain, bilinear between the samples and 0 outside.
    #[key(required = "pattern.csv", when(Table))]
    pub table: Located<PathBuf>,
    /// Gains of the table: those of this antenna (one-way), or the sum in dB over transmission and reception by equal antennas (two-way). Half
    /// of that sum belongs to this antenna.
    #[key(default = "one-way", words("one-way", "two-way"), when(Table))]
    pub gains: String,
    /// Full half-power beamwidth in azimuth.
    #[key(
        required = "20 deg",
        within(1e-5, PI, "0.001 to 180 deg"),
        when(Gaussian, Cosine, Aperture)
    )]
    pub azimuth_rad: f64,
    /// Full half-power beamwidth in elevation.
    #[key(
        required = "40 deg",
        within(1e-5, PI, "0.001 to 180 deg"),
        when(Gaussian, Cosine, Aperture)
    )]
    pub elevation_rad: f64,
}

/// Reader of the table of an antenna pattern.
pub type ReadTable<'a> = dyn Fn(&Located<PathBuf>) -> Result<PatternTable, Fault> + 'a;

/// Antenna of a simulated radar.
#[section]
#[derive(Clone, Debug)]
pub struct AntennaKeys {
    /// Name and position on the body.
    #[keys]
    pub mount: MountKeys,
    /// Direction and pattern of the beam.
    #[keys]
    pub beam: BeamKeys,
}

impl RadarKeys {
    /// Build the radar. A pulsed radar without `window_start` gets an infinite window start, which the caller sets once the antennas' track
    /// is known. `read_table` reads the tables of antenna patterns. The error contains all faults.
    pub fn build(&self, read_table: &ReadTable) -> Result<Radar, Vec<Fault>> {
        let mut faults = Vec::new();
        let mut keep = |found: Fault| faults.push(found);
        let pri_s = pri_s(&self.pri_s, &self.prf_hz).map_err(&mut keep).ok();
        let waveform = self.waveform().map_err(&mut keep).ok();
        let of = |antennas: &[AntennaKeys], letter| {
            antennas_of(
                antennas
                    .iter()
                    .map(|antenna| (&antenna.mount, &antenna.beam)),
                letter,
                read_table,
            )
        };
        let transmitters = of(&self.transmitter, "T").map_err(&mut keep).ok();
        let receivers = of(&self.receiver, "R").map_err(&mut keep).ok();
        let receiver = self.impairments.build().map_err(&mut keep).ok();
        match (pri_s, waveform, transmitters, receivers, receiver) {
            (Some(pri_s), Some(waveform), Some(transmitters), Some(receivers), Some(receiver)) => {
                Ok(Radar {
                    waveform,
                    num_pulses: *self.pulses,
                    pri_s,
                    start_s: self.first_pulse_s,
                    transmitters,
                    receivers,
                    motion: match self.motion {
                        IntraPulse::True => Motion::True,
                        IntraPulse::StopAndGo => Motion::StopAndGo,
                    },
                    spreading: self.spreading,
                    receiver,
                })
            }
            _ => Err(faults),
        }
    }

    fn waveform(&self) -> Result<Waveform, Fault> {
        let (centre_hz, count) = (self.centre_hz, *self.samples);
        match &self.kind {
            WaveformKeys::Ideal(ideal) => Ok(Waveform::Ideal {
                band: band(&ideal.bandwidth_hz, centre_hz, count)?,
            }),
            WaveformKeys::Stepped(stepped) => {
                let step_s = stepped.step_time_s;
                let dwell_s = self.dwell_s.as_deref().copied().unwrap_or(step_s);
                if let Some(dwell) = &self.dwell_s
                    && dwell_s > step_s * (1.0 + 1e-9)
                {
                    return Err(dwell.fault("dwell is longer than step_time: shorten it"));
                }
                Ok(Waveform::Stepped {
                    band: band(&stepped.bandwidth_hz, centre_hz, count)?,
                    step_s,
                    dwell_s,
                })
            }
            WaveformKeys::Fmcw(fmcw) => {
                check_bandwidth(&fmcw.bandwidth_hz, centre_hz)?;
                let duration_s = sampled_s(&fmcw.sample_rate_hz, count)?;
                let swept_hz = match fmcw.sweep {
                    Sweep::Down => -*fmcw.bandwidth_hz,
                    Sweep::Up => *fmcw.bandwidth_hz,
                };
                Ok(Waveform::Fmcw {
                    start_hz: centre_hz - swept_hz / 2.0,
                    chirp_hz_s: swept_hz / duration_s,
                    sample_rate_hz: *fmcw.sample_rate_hz,
                    num_samples: count,
                    mixer_delay_s: fmcw.mixer_delay_s,
                })
            }
            WaveformKeys::Pulsed(pulsed) => {
                let sample_rate_hz = *pulsed.sample_rate_hz;
                sampled_s(&pulsed.sample_rate_hz, count)?;
                if sample_rate_hz >= 2.0 * centre_hz {
                    return Err(pulsed.sample_rate_hz.fault(
                        "the sampled band extends below 0 Hz: choose a rate below twice the centre frequency",
                    ));
                }
                Ok(Waveform::Pulsed {
                    centre_hz,
                    sample_rate_hz,
                    num_samples: count,
                    window_start_s: self
                        .window_start_s
                        .as_deref()
                        .copied()
                        .unwrap_or(f64::INFINITY),
                    shape: pulsed.pulse.shape(sample_rate_hz)?,
                })
            }
        }
    }
}

/// Pulse repetition interval from `pri` or `prf`, seconds.
pub fn pri_s(pri_s: &Located<Option<f64>>, prf_hz: &Located<Option<f64>>) -> Result<f64, Fault> {
    match (**pri_s, **prf_hz) {
        (Some(pri_s), None) => Ok(pri_s),
        (None, Some(prf_hz)) => Ok(1.0 / prf_hz),
        (Some(_), Some(_)) => Err(prf_hz.fault("give either pri or prf, not both")),
        (None, None) => Err(pri_s.fault(
            "[radar] needs 'pri', the pulse repetition interval, or 'prf': write for example pri = \"1 ms\"",
        )),
    }
}

/// Longest record of one pulse, seconds: far beyond real radars, and short enough for phases in float64.
const LONGEST_RECORD_S: f64 = 1e3;

/// Check that the band has no frequencies below 0.
fn check_bandwidth(bandwidth_hz: &Located<f64>, centre_hz: f64) -> Result<(), Fault> {
    if **bandwidth_hz >= 2.0 * centre_hz {
        return Err(bandwidth_hz.fault(
            "the band extends below 0 Hz: choose a bandwidth below twice the centre frequency",
        ));
    }
    Ok(())
}

/// Band of `count` frequencies about the centre.
fn band(bandwidth_hz: &Located<f64>, centre_hz: f64, count: usize) -> Result<Band, Fault> {
    check_bandwidth(bandwidth_hz, centre_hz)?;
    let step_hz = **bandwidth_hz / count as f64;
    Ok(Band {
        start_hz: centre_hz - (count / 2) as f64 * step_hz,
        step_hz,
        count,
    })
}

/// Duration of `count` samples, checked against the maximum; seconds.
fn sampled_s(rate_hz: &Located<f64>, count: usize) -> Result<f64, Fault> {
    let duration_s = count as f64 / **rate_hz;
    if duration_s > LONGEST_RECORD_S {
        return Err(rate_hz.fault(format!(
            "{count} samples last {}: raise the rate",
            seconds(duration_s)
        )));
    }
    Ok(duration_s)
}

/// Check that the samples contain the band of a pulse.
///
/// # Errors
/// A fault at the bandwidth.
pub fn check_sampled(bandwidth_hz: &Located<f64>, sample_rate_hz: f64) -> Result<(), Fault> {
    if **bandwidth_hz <= sample_rate_hz {
        return Ok(());
    }
    Err(bandwidth_hz.fault(format!(
        "the pulse's bandwidth exceeds the sample rate of {}: lower it, or raise [radar] sample_rate",
        hertz(sample_rate_hz)
    )))
}

/// Barker codes: the sign of each chip.
const BARKER: [(&str, &str); 7] = [
    ("barker-2", "+-"),
    ("barker-3", "++-"),
    ("barker-4", "++-+"),
    ("barker-5", "+++-+"),
    ("barker-7", "+++--+-"),
    ("barker-11", "+++---+--+-"),
    ("barker-13", "+++++--++-+-+"),
];

impl PulseKeys {
    /// Pulse shape, sampled at `sample_rate_hz`.
    ///
    /// # Errors
    /// The first invalid or inconsistent value, at its key.
    pub fn shape(&self, sample_rate_hz: f64) -> Result<PulseShape, Fault> {
        match &self.kind {
            ShapeKeys::Lfm(lfm) => {
                check_sampled(&lfm.bandwidth_hz, sample_rate_hz)?;
                if *lfm.bandwidth_hz * *lfm.duration_s < 1.0 {
                    return Err(lfm.duration_s.fault(
                        "the time-bandwidth product is below 1, too small for a chirp: lengthen the pulse",
                    ));
                }
                Ok(PulseShape::Lfm {
                    bandwidth_hz: *lfm.bandwidth_hz,
                    duration_s: *lfm.duration_s,
                    rising: lfm.sweep == Sweep::Up,
                })
            }
            ShapeKeys::Code(code) => {
                let phases_rad = self.phases_rad()?;
                if *code.chip_s * sample_rate_hz < 1.0 - 1e-9 {
                    return Err(code.chip_s.fault(format!(
                        "the chip is shorter than a sample of {:.6} ns: lengthen it or raise [radar] sample_rate",
                        1e9 / sample_rate_hz
                    )));
                }
                Ok(PulseShape::PhaseCode {
                    phases_rad,
                    chip_s: *code.chip_s,
                })
            }
            ShapeKeys::Recorded(recorded) => Err(recorded.samples.fault(
                "a recorded pulse applies to descriptions of recordings: choose kind = \"lfm\" or \"code\" here",
            )),
        }
    }

    fn phases_rad(&self) -> Result<Vec<f64>, Fault> {
        match (&*self.code, &*self.phases) {
            (Some(name), None) => {
                let signs = BARKER.iter().find(|(known, _)| known == name);
                let signs = signs.map_or("", |&(_, signs)| signs);
                let phase_rad = |sign| if sign == '+' { 0.0 } else { PI };
                Ok(signs.chars().map(phase_rad).collect())
            }
            (None, Some(rows)) => Ok(rows.iter().map(|[phase_rad]| *phase_rad).collect()),
            (Some(_), Some(_)) => Err(self.phases.fault("give either code or phases, not both")),
            (None, None) => Err(self.code.fault(
                "[radar.pulse] needs 'code' or 'phases': write for example code = \"barker-13\"",
            )),
        }
    }
}

/// Antennas of a kind; without any, a single isotropic antenna at the body's origin. Names default to `letter` and a number.
pub fn antennas_of<'k>(
    given: impl Iterator<Item = (&'k MountKeys, &'k BeamKeys)>,
    letter: &str,
    read_table: &ReadTable,
) -> Result<Vec<Antenna>, Fault> {
    let antennas = given.enumerate();
    let antennas = antennas.map(|(i, (mount, beam))| {
        let name = mount.name.clone();
        let name = name.unwrap_or_else(|| format!("{letter}{}", i + 1));
        beam.antenna(mount, name, read_table)
    });
    let mut antennas: Vec<Antenna> = antennas.collect::<Result<_, _>>()?;
    if antennas.is_empty() {
        antennas.push(Antenna {
            name: format!("{letter}1"),
            offset_m: DVec3::ZERO,
            boresight: DVec3::Y,
            up: DVec3::Z,
            pattern: Pattern::Isotropic,
            aim_m: None,
        });
    }
    Ok(antennas)
}

impl BeamKeys {
    fn antenna(
        &self,
        mount: &MountKeys,
        name: String,
        read_table: &ReadTable,
    ) -> Result<Antenna, Fault> {
        let boresight = self.boresight.direction()?;
        let up = self.up.direction()?;
        let across = up - boresight * up.dot(boresight);
        // Directions less than a thousandth of a degree apart do not define an elevation axis.
        if across.length() < 2e-5 {
            return Err(self.up.fault(
                "up is parallel to boresight, so the beam has no elevation axis: change one of them",
            ));
        }
        Ok(Antenna {
            name,
            offset_m: mount.offset_m,
            boresight,
            up: across.normalize(),
            pattern: match &self.pattern {
                PatternKeys::Isotropic => Pattern::Isotropic,
                PatternKeys::Gaussian(widths) => Pattern::Gaussian {
                    azimuth_rad: widths.azimuth_rad,
                    elevation_rad: widths.elevation_rad,
                },
                PatternKeys::Cosine(widths) => Pattern::Cosine {
                    azimuth_rad: widths.azimuth_rad,
                    elevation_rad: widths.elevation_rad,
                },
                PatternKeys::Aperture(widths) => Pattern::Aperture {
                    azimuth_rad: widths.azimuth_rad,
                    elevation_rad: widths.elevation_rad,
                },
                PatternKeys::Table(keys) => {
                    let table = read_table(&keys.table)?;
                    Pattern::Table(match &*keys.gains {
                        "two-way" => table.per_antenna(),
                        _ => table,
                    })
                }
            },
            aim_m: self.aim_m,
        })
    }
}

/// Duration of the transmission of one pulse, seconds; 0 for an ideal waveform.
pub fn transmission_s(waveform: &Waveform) -> f64 {
    match waveform {
        Waveform::Ideal { .. } => 0.0,
        Waveform::Pulsed { shape, .. } => shape.duration_s(),
        Waveform::Fmcw {
            sample_rate_hz,
            num_samples,
            ..
        } => *num_samples as f64 / sample_rate_hz,
        Waveform::Stepped { band, step_s, .. } => band.count as f64 * step_s,
    }
}
