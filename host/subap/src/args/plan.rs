//! `subap plan`.

use std::path::PathBuf;

use clap::builder::{EnumValueParser, TypedValueParser};
use clap::{ArgGroup, Args as Group, Subcommand, ValueHint};
use subaperture::geometry::ImageGrid;
use subaperture::module::plan::ModuleProduct;
use subaperture::radar::PulseShape;
use subaperture::units::Dimension;

use super::values::{above_zero, any, error_bound, from_zero, output, positive, ram_size};
use super::{Imaging, Input, Sent, Writing};

/// `subap plan`.
#[derive(Debug, Group)]
pub(crate) struct Plan {
    #[command(subcommand)]
    pub(crate) target: PlanTarget,
}

/// Product of a module for which maps are planned.
fn planned() -> impl TypedValueParser<Value = ModuleProduct> {
    EnumValueParser::<Sent>::new().try_map(|sent| {
        let fault = "expected maps, image or detections: other products need no plan";
        sent.planned().ok_or(fault)
    })
}

/// Subject of a plan.
#[derive(Debug, Subcommand)]
pub(crate) enum PlanTarget {
    /// Plan an image for subap focus --plan, on this or other machines
    Focus(Box<PlanFocus>),
    /// Plan an embedded module that computes maps of patches and sends them over a serial link
    Module(Box<PlanModule>),
    /// Measure the timing model of this machine for subap focus --model
    Calibrate(PlanCalibrate),
    /// Plan a radar: resolution, sampling, sub-CPIs and their grating lobes, memory, sensitivity
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

    /// Name of the model in plans and records [default: measured]
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

    /// Memory for the buffers of the module: bytes, or with K or M (powers of 1024)
    #[arg(long, value_name = "SIZE", value_parser = ram_size)]
    pub(crate) ram: u64,

    /// Rate of the serial link, bits per second
    #[arg(long, value_name = "BAUD", default_value_t = 921_600, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) link: u32,

    /// Pixels, as for focus [default: the scene's extent at half the resolution]
    #[arg(long, value_name = "GRID", allow_hyphen_values = true)]
    pub(crate) grid: Option<ImageGrid>,

    /// Bound on the relative RMS error of the image, in dB, -20 to -120 [default: -66,
    /// for detections -40]
    #[arg(long, value_name = "DB", allow_hyphen_values = true, value_parser = error_bound)]
    pub(crate) error_db: Option<f64>,

    /// Product that the module sends, as for link
    #[arg(long, value_name = "PRODUCT", default_value = "maps", value_parser = planned())]
    pub(crate) send: ModuleProduct,

    /// Plan for 16-bit fixed point [default: float32]
    #[arg(long)]
    pub(crate) fixed: bool,

    /// Pulse repetition frequency, hertz [default: that of the recording, if it has times]
    #[arg(long, value_name = "HZ", allow_hyphen_values = true, value_parser = above_zero(Dimension::Frequency))]
    pub(crate) pulse_rate: Option<f64>,
}

/// `subap plan radar`.
#[derive(Debug, Group)]
#[command(
    override_usage = "subap plan radar [OPTIONS] <INPUT>...\n       subap plan radar [OPTIONS] <OPTIONS OF A PASS>",
    mut_arg("files", |files| files.required(false).conflicts_with_all(PASS)),
    group(ArgGroup::new("radar").required(true).multiple(true).args(["files", "beamwidth", "chain", "keys", "example"]).args(PASS)),
    after_help = "Signal chain:\n  \
    subap plan radar --example > chain.toml\n  \
    subap plan radar --chain chain.toml --carrier 1.2GHz --bandwidth 200MHz --frequencies 50 --range 16 --scene 20 --velocity 0.1",
)]
pub(crate) struct PlanRadar {
    #[command(flatten)]
    pub(crate) input: Input,

    #[command(flatten)]
    pub(crate) pass: Pass,

    /// Full azimuth width of the antenna's beam, degrees. Without a recording, --pulses or --aperture it sets the length of the track, along
    /// which the beam illuminates the scene centre
    #[arg(long, value_name = "DEGREES", allow_hyphen_values = true, value_parser = below_half_a_turn)]
    pub(crate) beamwidth: Option<f64>,

    /// Transmitted power, watts; needs --pulse-length
    #[arg(long, value_name = "WATTS", allow_hyphen_values = true, value_parser = above_zero(Dimension::Power), requires = "pulse_length")]
    pub(crate) power: Option<f64>,

    /// Pulse length, seconds; needs --power
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

    /// Signal chain in TOML, in place of power, pulse length, gain, losses, noise figure and temperature: levels, noise figure and margin
    /// to compression of every stage, dynamic range, SNR, and the speed limits of stepped carriers; see --keys and --example
    #[arg(long, value_name = "CHAIN", value_hint = ValueHint::FilePath,
        conflicts_with_all = ["power", "pulse_length", "gain", "losses", "noise_figure", "temperature"])]
    pub(crate) chain: Option<PathBuf>,

    /// Print every key of a signal chain with its unit, default and meaning
    #[arg(long, conflicts_with_all = ["files", "chain", "example"])]
    pub(crate) keys: bool,

    /// Print an example signal chain
    #[arg(long, conflicts_with_all = ["files", "chain"])]
    pub(crate) example: bool,

    /// Pixels, as for focus [default: the scene's extent at half the resolution]
    #[arg(long, value_name = "GRID", allow_hyphen_values = true)]
    pub(crate) grid: Option<ImageGrid>,

    /// Bound on the relative RMS error of the image, in dB, -20 to -120 [default: -60]
    #[arg(long, value_name = "DB", allow_hyphen_values = true, value_parser = error_bound)]
    pub(crate) error_db: Option<f64>,

    /// Number of pulses per sub-CPI of rdbp's mode thesis, whose grating lobes are predicted
    #[arg(long, value_name = "N", value_parser = positive, default_value_t = 40)]
    pub(crate) sub_cpi: usize,

    /// Folder for response.png, the predicted response of rdbp's mode thesis to a scatterer in the scene centre, and ambiguity.png, the
    /// ambiguity function of the pulse around its peak
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath, value_parser = super::output())]
    pub(crate) plots: Option<PathBuf>,

    /// Pulse of ambiguity.png: lfm:HZ:SECONDS, a linear sweep, or barker13:SECONDS, with the length of a chip [default: a sweep over
    /// the bandwidth in --pulse-length, or in 10 us]
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

/// Straight broadside pass in place of a recording; defaults are those of Table 4.1 of Schone 2020.
#[derive(Debug, Group)]
pub(crate) struct Pass {
    /// Centre frequency, hertz [default: 10e9]
    #[arg(long, value_name = "HZ", allow_hyphen_values = true, value_parser = above_zero(Dimension::Frequency), help_heading = "A pass")]
    pub(crate) carrier: Option<f64>,

    /// Bandwidth, hertz [default: 200e6]
    #[arg(long, value_name = "HZ", allow_hyphen_values = true, value_parser = above_zero(Dimension::Frequency), help_heading = "A pass")]
    pub(crate) bandwidth: Option<f64>,

    /// Frequency samples per pulse [default: 256]
    #[arg(long, value_name = "N", value_parser = positive, help_heading = "A pass")]
    pub(crate) frequencies: Option<usize>,

    /// Slant range at closest approach, metres [default: 5000]
    #[arg(long, value_name = "METRES", allow_hyphen_values = true, value_parser = above_zero(Dimension::Length), help_heading = "A pass")]
    pub(crate) range: Option<f64>,

    /// Grazing angle, degrees [default: 0]
    #[arg(long, value_name = "DEGREES", allow_hyphen_values = true, value_parser = from_zero(Dimension::Angle), help_heading = "A pass")]
    pub(crate) grazing: Option<f64>,

    /// Speed, m/s [default: 125]
    #[arg(long, value_name = "M/S", allow_hyphen_values = true, value_parser = above_zero(Dimension::Speed), help_heading = "A pass")]
    pub(crate) velocity: Option<f64>,

    /// Pulse repetition frequency, hertz [default: 1000]
    #[arg(long, value_name = "HZ", allow_hyphen_values = true, value_parser = above_zero(Dimension::Frequency), help_heading = "A pass")]
    pub(crate) prf: Option<f64>,

    /// Number of pulses [default: 1040]
    #[arg(long, value_name = "N", value_parser = positive, conflicts_with = "aperture", help_heading = "A pass")]
    pub(crate) pulses: Option<usize>,

    /// Length of the track, metres [default: from --pulses]
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
