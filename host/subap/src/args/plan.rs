//! `subap plan`.

use std::path::PathBuf;

use clap::{ArgGroup, Args as Group, Subcommand, ValueHint};
use subaperture::geometry::ImageGrid;
use subaperture::radar::PulseShape;
use subaperture::units::Dimension;

use super::values::{above_zero, any, error_bound, from_zero, output, positive, ram_size};
use super::{Imaging, Input, Writing};

/// `subap plan`.
#[derive(Debug, Group)]
pub(crate) struct Plan {
    #[command(subcommand)]
    pub(crate) target: PlanTarget,
}

/// What to plan for.
#[derive(Debug, Subcommand)]
pub(crate) enum PlanTarget {
    /// An image: how it will be formed, for subap focus --plan, here or on other machines
    Focus(Box<PlanFocus>),
    /// A small computer that makes maps of patches and sends them over a serial link
    Module(Box<PlanModule>),
    /// This machine's times, for subap focus --model: what is chosen then is what is fastest here
    Calibrate(PlanCalibrate),
    /// A radar: resolution, sampling, sub-CPIs and their lobes, memory, sensitivity
    Radar(Box<PlanRadar>),
}

/// `subap plan focus`.
#[derive(Debug, Group)]
pub(crate) struct PlanFocus {
    #[command(flatten)]
    pub(crate) input: Input,

    /// File for the plan
    #[arg(long, short, value_name = "PLAN", value_hint = ValueHint::FilePath, value_parser = output())]
    pub(crate) out: PathBuf,

    #[command(flatten)]
    pub(crate) image: Imaging,

    #[command(flatten)]
    pub(crate) writing: Writing,
}

/// `subap plan calibrate`.
#[derive(Debug, Group)]
pub(crate) struct PlanCalibrate {
    /// File for the time model
    #[arg(long, short, value_name = "MODEL", value_hint = ValueHint::FilePath, value_parser = output())]
    pub(crate) out: PathBuf,

    /// What the model is called in plans and records [default: measured]
    #[arg(long, value_name = "NAME")]
    pub(crate) name: Option<String>,

    #[command(flatten)]
    pub(crate) writing: Writing,
}

/// `subap plan module`.
#[derive(Debug, Group)]
pub(crate) struct PlanModule {
    #[command(flatten)]
    pub(crate) input: Input,

    /// Memory for the module's buffers: bytes, or with K or M (powers of 1024)
    #[arg(long, value_name = "SIZE", value_parser = ram_size)]
    pub(crate) ram: u64,

    /// Rate of the serial link, bits a second
    #[arg(long, value_name = "BAUD", default_value_t = 921_600, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) link: u32,

    /// Pixels, as for focus [default: the scene's extent at half the resolution]
    #[arg(long, value_name = "GRID", allow_hyphen_values = true)]
    pub(crate) grid: Option<ImageGrid>,

    /// Bound on the relative RMS error of the image, in dB, -20 to -120 [default: -66]
    #[arg(long, value_name = "DB", allow_hyphen_values = true, value_parser = error_bound)]
    pub(crate) error_db: Option<f64>,

    /// The module computes on 16-bit samples
    #[arg(long)]
    pub(crate) fixed: bool,

    /// Pulses a second [default: the recording's, if it tells times]
    #[arg(long, value_name = "HZ", allow_hyphen_values = true, value_parser = above_zero(Dimension::Frequency))]
    pub(crate) pulse_rate: Option<f64>,
}

/// `subap plan radar`.
#[derive(Debug, Group)]
#[command(
    override_usage = "subap plan radar [OPTIONS] <INPUT>...\n       subap plan radar [OPTIONS] <OPTIONS OF A PASS>",
    mut_arg("files", |files| files.required(false).conflicts_with_all(PASS)),
    group(ArgGroup::new("what").required(true).multiple(true).args(["files", "beamwidth"]).args(PASS)),
)]
pub(crate) struct PlanRadar {
    #[command(flatten)]
    pub(crate) input: Input,

    #[command(flatten)]
    pub(crate) pass: Pass,

    /// Full width of the antenna's beam across the track, degrees; without a recording, --pulses or --aperture
    /// the track is as long as the beam lights the scene's centre
    #[arg(long, value_name = "DEGREES", allow_hyphen_values = true, value_parser = below_half_a_turn)]
    pub(crate) beamwidth: Option<f64>,

    /// Transmitted power, watts; needs --pulse-length
    #[arg(long, value_name = "WATTS", allow_hyphen_values = true, value_parser = above_zero(Dimension::Power), requires = "pulse_length")]
    pub(crate) power: Option<f64>,

    /// Length of a pulse, seconds
    #[arg(long, value_name = "SECONDS", allow_hyphen_values = true, value_parser = above_zero(Dimension::Time), requires = "power")]
    pub(crate) pulse_length: Option<f64>,

    /// Gain of the antenna, dBi
    #[arg(long, value_name = "DBI", allow_hyphen_values = true, value_parser = any(Dimension::Gain), default_value_t = 0.0)]
    pub(crate) gain: f64,

    /// Losses, dB
    #[arg(long, value_name = "DB", allow_hyphen_values = true, value_parser = from_zero(Dimension::Level), default_value_t = 0.0)]
    pub(crate) losses: f64,

    /// Noise figure of the receiver, dB
    #[arg(long, value_name = "DB", allow_hyphen_values = true, value_parser = from_zero(Dimension::Level), default_value_t = 1.604)]
    pub(crate) noise_figure: f64,

    /// Noise temperature of the antenna, kelvin
    #[arg(long, value_name = "KELVIN", allow_hyphen_values = true, value_parser = from_zero(Dimension::Temperature), default_value_t = 290.0)]
    pub(crate) temperature: f64,

    /// Pixels, as for focus [default: the scene's extent at half the resolution]
    #[arg(long, value_name = "GRID", allow_hyphen_values = true)]
    pub(crate) grid: Option<ImageGrid>,

    /// Bound on the relative RMS error of the image, in dB, -20 to -120 [default: -60]
    #[arg(long, value_name = "DB", allow_hyphen_values = true, value_parser = error_bound)]
    pub(crate) error_db: Option<f64>,

    /// Pulses a sub-CPI of the thesis's mode, whose grating lobes are predicted
    #[arg(long, value_name = "N", value_parser = positive, default_value_t = 40)]
    pub(crate) sub_cpi: usize,

    /// Folder for response.png: what the thesis's mode will make of a scatterer in the scene's centre; and
    /// ambiguity.png: the pulse's ambiguity function around its peak
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath, value_parser = super::output())]
    pub(crate) plots: Option<PathBuf>,

    /// The pulse of ambiguity.png: lfm:HZ:SECONDS, a linear sweep, or barker13:SECONDS, chips of that length
    /// [default: a sweep over the band in --pulse-length, or in 10 us]
    #[arg(long, value_name = "PULSE", value_parser = pulse_shape, requires = "plots")]
    pub(crate) pulse: Option<PulseShape>,

    #[command(flatten)]
    pub(crate) writing: super::Writing,
}

/// The options of [`Pass`], and those that lengthen it.
const PASS: [&str; 10] = [
    "carrier",
    "bandwidth",
    "frequencies",
    "range",
    "grazing",
    "velocity",
    "prf",
    "pulses",
    "aperture",
    "scene",
];

/// A straight broadside pass in place of a recording; what is not given is as in Table 4.1 of Schone 2020.
#[derive(Debug, Group)]
pub(crate) struct Pass {
    /// Middle of the band, hertz [default: 10e9]
    #[arg(long, value_name = "HZ", allow_hyphen_values = true, value_parser = above_zero(Dimension::Frequency), help_heading = "A pass")]
    pub(crate) carrier: Option<f64>,

    /// Bandwidth, hertz [default: 200e6]
    #[arg(long, value_name = "HZ", allow_hyphen_values = true, value_parser = above_zero(Dimension::Frequency), help_heading = "A pass")]
    pub(crate) bandwidth: Option<f64>,

    /// Frequency samples a pulse [default: 256]
    #[arg(long, value_name = "N", value_parser = positive, help_heading = "A pass")]
    pub(crate) frequencies: Option<usize>,

    /// Slant range at closest approach, metres [default: 5000]
    #[arg(long, value_name = "METRES", allow_hyphen_values = true, value_parser = above_zero(Dimension::Length), help_heading = "A pass")]
    pub(crate) range: Option<f64>,

    /// Grazing angle, degrees [default: 0]
    #[arg(long, value_name = "DEGREES", allow_hyphen_values = true, value_parser = from_zero(Dimension::Angle), help_heading = "A pass")]
    pub(crate) grazing: Option<f64>,

    /// Speed, metres a second [default: 125]
    #[arg(long, value_name = "M/S", allow_hyphen_values = true, value_parser = above_zero(Dimension::Speed), help_heading = "A pass")]
    pub(crate) velocity: Option<f64>,

    /// Pulses a second [default: 1000]
    #[arg(long, value_name = "HZ", allow_hyphen_values = true, value_parser = above_zero(Dimension::Frequency), help_heading = "A pass")]
    pub(crate) prf: Option<f64>,

    /// Pulses in all [default: 1040]
    #[arg(long, value_name = "N", value_parser = positive, conflicts_with = "aperture", help_heading = "A pass")]
    pub(crate) pulses: Option<usize>,

    /// Length of the track, metres
    #[arg(long, value_name = "METRES", allow_hyphen_values = true, value_parser = above_zero(Dimension::Length), help_heading = "A pass")]
    pub(crate) aperture: Option<f64>,

    /// Side of the scene, metres [default: 80]
    #[arg(long, value_name = "METRES", allow_hyphen_values = true, value_parser = above_zero(Dimension::Length), help_heading = "A pass")]
    pub(crate) scene: Option<f64>,
}

fn below_half_a_turn(text: &str) -> Result<f64, String> {
    above_zero(Dimension::Angle)(text)
        .ok()
        .filter(|&v| v < 180.0)
        .ok_or_else(|| "give degrees above 0 and below 180".to_owned())
}

fn pulse_shape(text: &str) -> Result<PulseShape, String> {
    let parts: Vec<&str> = text.split(':').collect();
    match parts[..] {
        ["lfm", bandwidth, duration] => Ok(PulseShape::Lfm {
            bandwidth_hz: above_zero(Dimension::Frequency)(bandwidth)?,
            duration_s: above_zero(Dimension::Time)(duration)?,
            rising: true,
        }),
        ["barker13", chip] => Ok(PulseShape::PhaseCode {
            phases_rad: "+++++--++-+-+"
                .chars()
                .map(|sign| {
                    if sign == '+' {
                        0.0
                    } else {
                        std::f64::consts::PI
                    }
                })
                .collect(),
            chip_s: above_zero(Dimension::Time)(chip)?,
        }),
        _ => Err("write lfm:HZ:SECONDS, as lfm:20MHz:5us, or barker13:SECONDS".to_owned()),
    }
}
