//! Arguments of all commands, with their help. [`crate::config`] resolves those of every command.

mod autofocus;
mod displacement;
mod export;
mod focus;
mod formers;
mod front;
mod global;
mod gmti;
mod logs;
mod look;
mod maps;
mod navigation;
mod pair;
mod plan;
mod quality;
mod radio;
mod run;
mod settings;
mod shell;
mod surface;
mod tiled;
mod track;
mod tune;
mod values;
#[cfg(feature = "page")]
mod view;
mod watching;

use std::path::{Path, PathBuf};

use clap::{Args as Group, Parser, Subcommand, ValueEnum, ValueHint};
use glam::DVec3;
use serde::{Deserialize, Deserializer};
use subaperture::geometry::{Geodetic, ImageGrid};
use subaperture::module::link::ModuleAddress;
use subaperture::module::plan::ModuleProduct;
use subaperture::simulate::{Preset, scenario};
use subaperture_core::link::Level;

use crate::failure::Usage;
pub(crate) use autofocus::{Autofocus, AutofocusSettings, Method};
pub(crate) use displacement::Displacement;
pub(crate) use export::{Export, ImageFormat, Producing};
pub(crate) use focus::{
    AntennaWeighting, BeamWidth, DeviceChoice, Focus, Forming, Imaging, TargetMotion, Velocity,
    Windows,
};
pub(crate) use formers::{FormerOptions, key as former_key, options as former_options};
pub(crate) use front::{command, parse};
pub(crate) use global::Global;
pub(crate) use gmti::{CROSS_SECTION_M2, Gmti};
pub(crate) use logs::Logs;
pub(crate) use look::{ColourMap, Look, Picture};
pub(crate) use maps::{MapLayout, MapProjection, Mapping, RemapName};
pub(crate) use navigation::Navigation;
pub(crate) use pair::{Pair, PairFormat};
pub(crate) use plan::{Plan, PlanCalibrate, PlanFocus, PlanModule, PlanRadar, PlanTarget};
pub(crate) use quality::{Points, Quality};
pub(crate) use radio::{
    Calibrate, Capture, Convert, Probe, Profile, Radio, RadioSelftest, RadioTask,
};
pub(crate) use run::Run;
pub(crate) use settings::defaults;
pub(crate) use shell::{Completions, Man};
use subaperture::units::Dimension;
pub(crate) use surface::GridSettings;
pub(crate) use tiled::{Part, Tiled};
pub(crate) use track::{Track, TrackSource};
pub(crate) use tune::{Recording, Tune, Vary};
pub(crate) use values::{At, SeveralChannels, several_channels};
use values::{
    above_zero, any, error_bound, finite, from_zero, geodetic, output, positive, probability,
    ranges, setting, sign, vector,
};
#[cfg(feature = "page")]
pub(crate) use view::View;
pub(crate) use watching::{Live, Watching};

/// The whole command line.
#[derive(Debug, Parser)]
#[command(
    name = "subap",
    version,
    about = "Radar image formation: from phase history to a focused image",
    after_help = "First steps:\n  \
        subap demo                       simulate, focus, compare; writes subap-demo/\n  \
        subap info FILE                  describe a recording\n  \
        subap focus FILE... --out DIR    form its image\n\n\
        Exit status:\n  \
        0    done\n  \
        1    failed; outputs are complete or absent\n  \
        2    wrong usage\n  \
        3    done, but an error bound is exceeded: by the prediction where that is allowed, in focus\n       \
        --check, compare --error-db, crosscheck or demo; or an estimated track is doubtful\n  \
        130  interrupted (by Ctrl-C, or the signals TERM or HUP)"
)]
pub(crate) struct Args {
    #[command(flatten)]
    pub(crate) global: Global,
    #[command(subcommand)]
    pub(crate) command: Option<Command>,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Form an image from one or more recordings
    Focus(Box<Focus>),
    /// Form the velocity image of a moving target
    Velocity(Velocity),
    /// Detect moving targets in several channels (GMTI): velocity, position, picture
    Gmti(Gmti),
    /// Compute range-Doppler maps or an image on an embedded module, and store them
    Link(Link),
    /// Test an embedded module
    Module(Module),
    /// Simulate a scene: phase history as CPHD 1.1, or raw echoes
    Simulate(Simulate),
    /// Compare the embedded core (float32, fixed point) and the maps of rdbp with the float64 sum
    Crosscheck(Crosscheck),
    /// Describe recordings, images and other files
    Info(Info),
    /// Print keys and examples of descriptions of raw recordings
    Recording(Recording),
    /// Calibrate unknown geometry parameters of a raw recording by maximising image sharpness
    Tune(Tune),
    /// Estimate the radar's track from its own echoes (MPGA)
    Track(Track),
    /// Estimate phase errors or the track by autofocus, judged on held-out data
    Autofocus(Autofocus),
    /// Describe a navigation log and its gaps, and write its track
    Navigation(Navigation),
    /// Compare two complex images
    Compare(Compare),
    /// Form interferogram, coherence and change map (CCD) of two coherent images
    Pair(Pair),
    /// Measure the displacement of persistent points over repeat passes of a ground-based SAR
    Displacement(Displacement),
    /// Measure an image: point responses, levels, contrast, differences from another image
    Quality(Quality),
    /// Draw a picture of an image, with other levels or colours
    Picture(Picture),
    /// View images of any size in a web browser
    #[cfg(feature = "page")]
    View(View),
    /// Capture echoes of a stepped-frequency radar with a software-defined radio, as SigMF
    Capture(Capture),
    /// Capture, and form the image sweep by sweep meanwhile
    Live(Live),
    /// List, probe and calibrate radios; convert captures to CPHD
    Radio(Radio),
    /// Compute range profiles of a capture
    Profile(Profile),
    /// Export an image as SICD, SIDD, GeoTIFF, KMZ, PNG or Zarr
    Export(Export),
    /// Run a processing pipeline from one TOML file; unchanged stages are reused
    Run(Run),
    /// Plan an image, an embedded module or a radar; calibrate the timing model
    Plan(Plan),
    /// Simulate Table 4.1 of Schone 2020, focus it with every former, and report errors and pictures
    Demo(Demo),
    /// Reproduce the figures of both theses, with the theses' numbers, as a web page
    Reproduce(Reproduce),
    /// Print shell completions
    Completions(Completions),
    /// Print the man page of subap or of a command
    Man(Man),
}

/// Replacement of existing files.
#[derive(Clone, Copy, Debug, Group)]
pub(crate) struct Writing {
    /// Replace files that other programs wrote; never an input of the same run [default: replace only files written by subap]
    #[arg(long)]
    pub(crate) force: bool,
}

/// Forecast in place of the work.
#[derive(Clone, Copy, Debug, Default, Group)]
pub(crate) struct Rehearsal {
    /// Print the expected time, memory and disk space, from a short measured part of the work, and write no files
    #[arg(long)]
    pub(crate) dry_run: bool,
}

/// Recordings.
#[derive(Clone, Debug, Default, Group, Deserialize)]
#[serde(default)]
pub(crate) struct Input {
    /// Recordings: CPHD, CRSD, NISAR L0B, GOTCHA .mat, Gotcha GMTI challenge (PREFIX_chanN_SET_PH), arrays, or descriptions of raw samples (.toml, see
    /// subap recording). Several make one aperture,
    /// ordered by time or, without times, by angle
    #[arg(required = true, value_name = "INPUT", value_hint = ValueHint::FilePath)]
    pub(crate) files: Vec<PathBuf>,

    /// One channel, by its name such as T1R2 or by its number from 1 [default: the reference channel of a CPHD; all channels of a
    /// description, in order of time]
    #[arg(long, value_name = "NAME")]
    pub(crate) channel: Option<String>,

    /// Coherent sum of channels that share their pulses (MIMO): all, or a list such as T1R1,T1R2. A module does not sum them: with
    /// --send detections it detects targets in the first and sends their power and phase in each
    #[arg(long, value_name = "all|A,B", value_parser = several_channels, conflicts_with = "channel")]
    #[serde(deserialize_with = "channels_of_job")]
    pub(crate) channels: Option<SeveralChannels>,

    /// Override a key of a description, such as radar.first_pulse=9.2s. May be repeated
    #[arg(long, value_name = "KEY=VALUE", value_parser = setting)]
    #[serde(skip)]
    pub(crate) set: Vec<(String, String)>,
}

impl Input {
    /// One recording with default settings.
    pub(crate) fn alone(path: &Path) -> Self {
        Self {
            files: vec![path.to_owned()],
            ..Self::default()
        }
    }

    /// Refuse `--channels` for the command `whom`, which processes one channel.
    pub(crate) fn refuse_several(&self, whom: &str) -> Result<(), Usage> {
        match self.channels {
            Some(_) => Err(Usage(format!(
                "{whom} takes the pulses of one channel: give --channel instead of --channels"
            ))),
            None => Ok(()),
        }
    }
}

fn channels_of_job<'de, D: Deserializer<'de>>(
    from: D,
) -> Result<Option<SeveralChannels>, D::Error> {
    settings::parsed_by(from, several_channels).map(Some)
}

/// Least severe level of the module's events to print.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum EventLevel {
    /// Starts and ends of runs
    Info,
    /// Lost or refused input
    Warning,
    /// Resets after faults
    Error,
}

impl From<EventLevel> for Level {
    fn from(level: EventLevel) -> Self {
        match level {
            EventLevel::Info => Self::Info,
            EventLevel::Warning => Self::Warn,
            EventLevel::Error => Self::Error,
        }
    }
}

/// Product that a module sends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Sent {
    /// Range-Doppler maps of every patch and sub-CPI
    Maps,
    /// One image, accumulated on board over all sub-CPIs
    Image,
    /// Targets detected on the maps by CFAR, with their positions
    Detections,
    /// Motion of the module from pulse to pulse, estimated from the echoes of several receivers
    Increments,
    /// Range profiles of a capture of a stepped-frequency radar
    Profiles,
}

impl Sent {
    /// Product for which maps are planned.
    pub(crate) fn planned(self) -> Option<ModuleProduct> {
        match self {
            Self::Maps => Some(ModuleProduct::Maps),
            Self::Detections => Some(ModuleProduct::Detections),
            Self::Image => Some(ModuleProduct::Image),
            Self::Increments | Self::Profiles => None,
        }
    }

    /// Name of the product.
    pub(crate) fn name(self) -> String {
        let value = self.to_possible_value();
        value.map_or_else(String::new, |value| value.get_name().to_owned())
    }
}

/// `subap link`.
#[derive(Debug, Group)]
pub(crate) struct Link {
    /// Address of the module: tcp://HOST:PORT, serial:/dev/ttyX@BAUD, emulate:float or emulate:fixed
    #[arg(value_name = "WHERE")]
    pub(crate) place: ModuleAddress,

    #[command(flatten)]
    pub(crate) input: Input,

    /// File for the maps; subap focus --from-maps forms the image. With --send image or profiles, folder;
    /// with --send detections, CSV file; with --send increments, CSV file of the track, for subap focus --track
    #[arg(long, short, value_name = "PATH", value_hint = ValueHint::AnyPath, value_parser = output())]
    pub(crate) out: PathBuf,

    /// Product that the module sends
    #[arg(long, value_enum, value_name = "PRODUCT", default_value_t = Sent::Maps)]
    pub(crate) send: Sent,

    /// Mean power of the images of all sub-CPIs (noncoherent multilook) in place of the coherent image, only with --send
    /// image: pixels are the root of the mean power, with the resolution of a sub-CPI
    #[arg(long)]
    pub(crate) power: bool,

    /// Probability of a false alarm per map cell, only with --send detections [default: 1e-6]
    #[arg(long, value_name = "P", value_parser = probability)]
    pub(crate) false_alarms: Option<f64>,

    /// Cancel the clutter between two channels along the track before the detection (DPCA), only with --send detections
    #[arg(long)]
    pub(crate) dpca: bool,

    /// Pixels covered by the maps, as for focus [default: the scene's extent at half the resolution]
    #[arg(long, value_name = "GRID", allow_hyphen_values = true)]
    pub(crate) grid: Option<ImageGrid>,

    /// Bound on the relative RMS error of the image against the exact sum, in dB, -20 to -120
    /// [default: -66, for detections -40]
    #[arg(long, value_name = "DB", allow_hyphen_values = true, value_parser = error_bound)]
    pub(crate) error_db: Option<f64>,

    #[command(flatten)]
    pub(crate) windows: Windows,

    /// Nearest and farthest range searched for targets, as 2m:30m, only with --send increments [default: the whole
    /// unambiguous interval]
    #[arg(long, value_name = "NEAR:FAR", value_parser = ranges)]
    pub(crate) range: Option<(f64, f64)>,

    /// Firmware to emulate [default: target/module/float or fixed, here or above]
    #[arg(long, value_name = "ELF", value_hint = ValueHint::FilePath)]
    pub(crate) firmware: Option<PathBuf>,

    /// Send pulses at this rate, hertz, as a radar does, without repeating lost ones [default: as fast as the module
    /// accepts them]
    #[arg(long, value_name = "HERTZ", allow_hyphen_values = true, value_parser = above_zero(Dimension::Frequency))]
    pub(crate) rate: Option<f64>,

    /// Largest number of repetitions of sub-CPIs with missing maps
    #[arg(long, value_name = "N", default_value_t = 3, conflicts_with_all = ["rate", "front_end"])]
    pub(crate) retries: u32,

    /// Let the module read the samples from its own front end; the recording provides the geometry and the frequencies. With
    /// --send increments, the antennas and the number of pulses
    #[arg(long, conflicts_with_all = ["rate", "verify", "dry_run"])]
    pub(crate) front_end: bool,

    /// Compare every map or the image bit by bit with that of the same core on this machine, and fail if it differs;
    /// not with --send detections
    #[arg(long)]
    pub(crate) verify: bool,

    /// Print the module's events from this level on
    #[arg(long, value_name = "LEVEL")]
    pub(crate) events: Option<EventLevel>,

    /// PNG file of the image so far: with --send maps updated about once a second, with --send image eight times, each for the bytes
    /// of an image
    #[arg(long, value_name = "PNG", value_hint = ValueHint::FilePath, value_parser = output())]
    pub(crate) picture: Option<PathBuf>,

    #[command(flatten)]
    pub(crate) rehearsal: Rehearsal,

    #[command(flatten)]
    pub(crate) writing: Writing,
}

/// Arguments of `subap module`.
#[derive(Debug, Group)]
pub(crate) struct Module {
    #[command(subcommand)]
    pub(crate) task: ModuleTask,
}

/// Task for an embedded module.
#[derive(Debug, Subcommand)]
pub(crate) enum ModuleTask {
    /// Send built-in recordings to a module, and compare its products bit by bit with those of this computer
    Selftest(ModuleSelftest),
}

/// Arguments of `subap module selftest`.
#[derive(Debug, Group)]
#[command(
    after_help = "The exit status is 1 if a check failed. The report (--out) is one JSON file to send to the developers."
)]
pub(crate) struct ModuleSelftest {
    /// Address of the module: tcp://HOST:PORT, serial:/dev/ttyX@BAUD, emulate:float or emulate:fixed
    #[arg(value_name = "WHERE")]
    pub(crate) place: ModuleAddress,

    /// Firmware to emulate [default: target/module/float or fixed, here or above]
    #[arg(long, value_name = "ELF", value_hint = ValueHint::FilePath)]
    pub(crate) firmware: Option<PathBuf>,

    /// File for the report, JSON
    #[arg(long, short, value_name = "FILE", value_hint = ValueHint::FilePath, value_parser = output())]
    pub(crate) out: Option<PathBuf>,

    #[command(flatten)]
    pub(crate) writing: Writing,
}

/// `subap simulate`.
#[derive(Debug, Group)]
#[command(after_help = "First steps:\n  \
    subap simulate --example spotlight > scene.toml\n  \
    subap simulate scene.toml --set radar.pulses=256 -o scene.cphd")]
pub(crate) struct Simulate {
    /// Scenario in TOML; see --keys and --example
    #[arg(value_name = "SCENARIO", value_hint = ValueHint::FilePath,
        required_unless_present_any = ["preset", "keys", "example"])]
    pub(crate) scenario: Option<PathBuf>,

    /// Scenario of Schone 2020: table-4-1 (imaging) or table-2-1 (range migration)
    #[arg(long, value_name = "NAME", conflicts_with = "scenario")]
    pub(crate) preset: Option<Preset>,

    // Not a doc comment, in which brackets are a link.
    #[arg(
        long,
        value_name = "KEY=VALUE",
        conflicts_with = "preset",
        value_parser = setting,
        help = "Override a key of the scenario, such as radar.pri=\"0.5 ms\" or \
                scene.point[0].position=\"0, 1, 0 m\". May be repeated"
    )]
    pub(crate) set: Vec<(String, String)>,

    /// Print every key of a scenario with its unit, default and meaning
    #[arg(long, conflicts_with_all = ["scenario", "preset", "example", "out"])]
    pub(crate) keys: bool,

    /// Print an example scenario
    #[arg(long, value_name = "NAME", conflicts_with_all = ["scenario", "preset", "out"],
        value_parser = clap::builder::PossibleValuesParser::new(scenario::examples::names()))]
    pub(crate) example: Option<String>,

    /// CPHD file to write. Each pair of antennas of the scenario is a channel
    #[arg(long, short, value_name = "FILE", value_hint = ValueHint::FilePath, value_parser = output(),
        required_unless_present_any = ["keys", "example", "echoes"])]
    pub(crate) out: Option<PathBuf>,

    /// Folder for raw echoes as received: echoes.npy and recording.toml, which subap focus reads; with several pairs of
    /// antennas one description each, such as recording-T1R2.toml
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath, value_parser = output(),
        conflicts_with_all = ["preset", "keys", "example"])]
    pub(crate) echoes: Option<PathBuf>,

    /// Domain of the signal array
    #[arg(long, value_enum, default_value_t)]
    pub(crate) domain: SignalDomain,

    /// Reference surface that the file declares for its scene coordinates
    #[arg(long, value_enum, default_value_t)]
    pub(crate) reference_surface: DeclaredSurface,

    /// Sign of the phase, SGN: -1 or +1
    #[arg(long, value_name = "SIGN", default_value = "-1", allow_hyphen_values = true, value_parser = sign)]
    pub(crate) sgn: i8,

    /// Power of noise added to a preset, dB relative to a sample of a unit scatterer [default: no noise]
    #[arg(long, value_name = "DB", allow_hyphen_values = true, value_parser = any(Dimension::Level),
        conflicts_with = "scenario")]
    pub(crate) noise_db: Option<f64>,

    /// Smooth perturbation of the track of a preset, metres RMS in each axis; recorded in the file
    #[arg(long, value_name = "METRES", default_value_t = 0.0, allow_hyphen_values = true,
        value_parser = from_zero(Dimension::Length), conflicts_with = "scenario")]
    pub(crate) perturb: f64,

    /// Seed of all random numbers [default: that of the scenario, or 0]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(..=i64::MAX as u64))]
    pub(crate) seed: Option<u64>,

    #[command(flatten)]
    pub(crate) writing: Writing,

    #[command(flatten)]
    pub(crate) rehearsal: Rehearsal,
}

/// Domains of a CPHD's signal arrays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum SignalDomain {
    /// Frequency
    #[default]
    Fx,
    /// Time of arrival
    Toa,
}

/// Reference surfaces of a CPHD.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum DeclaredSurface {
    /// The plane z = 0 of the scene
    #[default]
    Planar,
    /// The surface of constant height above the ellipsoid through the scene's origin, where z is the vertical
    Hae,
}

/// `subap crosscheck`.
#[derive(Debug, Group)]
pub(crate) struct Crosscheck {
    #[command(flatten)]
    pub(crate) input: Input,

    /// Number of pulses per sub-CPI [default: 40]
    #[arg(long, value_name = "N", value_parser = positive)]
    pub(crate) sub_cpi: Option<usize>,
}

/// `subap info`.
#[derive(Debug, Group)]
pub(crate) struct Info {
    #[command(flatten)]
    pub(crate) input: Input,

    /// Position for which geometry and resolution are given, metres in the scene frame [default: the scene centre]
    #[arg(long, value_name = "X,Y[,Z]", allow_hyphen_values = true, value_parser = vector(Dimension::Length))]
    pub(crate) at: Option<DVec3>,
}

/// `subap compare`.
#[derive(Debug, Group)]
pub(crate) struct Compare {
    /// Image: folder of a product, its image.json, complex64 .npy, SICD, SIDD, GeoTIFF, or Zarr
    #[arg(value_name = "A", value_hint = ValueHint::AnyPath)]
    pub(crate) image: PathBuf,

    /// Reference image, of the same formats
    #[arg(value_name = "B", value_hint = ValueHint::AnyPath)]
    pub(crate) reference: PathBuf,

    /// Position on the Earth of the scene's origin, x to the east, for an image that does not state it: degrees north and east,
    /// metres above the ellipsoid
    #[arg(long, value_name = "LAT,LON[,HEIGHT]", allow_hyphen_values = true, value_parser = geodetic)]
    pub(crate) place: Option<Geodetic>,

    /// Bound on the relative RMS error, dB; exit status 3 if it is exceeded
    #[arg(long, value_name = "DB", allow_hyphen_values = true, value_parser = any(Dimension::Level))]
    pub(crate) error_db: Option<f64>,
}

/// `subap demo`.
#[derive(Debug, Group)]
pub(crate) struct Demo {
    /// Folder to write
    #[arg(long, short, value_name = "DIR", default_value = "subap-demo", value_hint = ValueHint::DirPath, value_parser = output())]
    pub(crate) out: PathBuf,

    /// Pixels, as for focus. Errors are compared with their bounds on the default grid only, which covers all scatterers
    /// [default: the 80 x 80 m scene with a margin]
    #[arg(long, value_name = "GRID", allow_hyphen_values = true)]
    pub(crate) grid: Option<ImageGrid>,

    #[command(flatten)]
    pub(crate) rehearsal: Rehearsal,

    #[command(flatten)]
    pub(crate) writing: Writing,
}

/// `subap reproduce`.
#[derive(Debug, Group)]
pub(crate) struct Reproduce {
    /// Folder to write; items already in it are kept
    #[arg(long, short, value_name = "DIR", default_value = "subap-gallery", value_hint = ValueHint::DirPath, value_parser = output())]
    pub(crate) out: PathBuf,

    /// Items to make, by name (see --list), separated by commas. May be repeated [default: all]
    #[arg(long, value_name = "ID", value_delimiter = ',')]
    pub(crate) only: Vec<String>,

    /// GOTCHA recordings, or folders of them, for the items that use them
    #[arg(long, value_name = "MAT", num_args = 1.., value_hint = ValueHint::FilePath)]
    pub(crate) gotcha: Vec<PathBuf>,

    /// Make the items on the large scene (s-4-10, s-4-11) at the thesis's own scale: 30,000 pulses and 1 km x 1 km, with at least 9 GiB
    /// of memory. An interrupted run resumes after the last finished image
    #[arg(long)]
    pub(crate) full: bool,

    /// List the items
    #[arg(long)]
    pub(crate) list: bool,

    #[command(flatten)]
    pub(crate) rehearsal: Rehearsal,

    #[command(flatten)]
    pub(crate) writing: Writing,
}

/// The help that `subap` alone prints.
pub(crate) fn help() -> String {
    command().render_help().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn definitions_are_sound() {
        command().debug_assert();
    }

    #[test]
    fn negative_values_need_no_equals_sign() {
        let words = "subap focus a.mat --out d --error-db -55.5 --grid x=-5:5:1,y=-5:5:1,z=-2";
        let args = Args::try_parse_from(words.split(' ')).unwrap();
        let Some(Command::Focus(focus)) = args.command else {
            panic!("not focus");
        };
        assert_eq!(focus.image.forming.former.error_db(), Some(-55.5));
        assert_eq!(focus.image.grid.pixels.unwrap().origin_m.z, -2.0);
        let words = "subap simulate --preset table-4-1 -o f --sgn -1 --noise-db -20";
        assert!(Args::try_parse_from(words.split(' ')).is_ok());
    }

    #[test]
    fn bad_values_name_their_option() {
        for (words, option) in [
            ("focus a --out d --error-db 60", "--error-db"),
            ("focus a --out d --grid x=1", "--grid"),
            ("focus a --out d --window blackman", "--window"),
            ("focus a --out d --patch -3", "--patch"),
            ("focus a --out d --patch 3Hz", "--patch"),
            ("focus a --out d --velocity 3", "--velocity"),
            ("velocity a --out d --at 1 --vx -1:1:1 --vy -1:1:1", "--at"),
            (
                "velocity a --out d --at 1,2 --vx 1:-1:1 --vy -1:1:1",
                "--vx",
            ),
            ("focus a --out d --threads 0", "--threads"),
            ("focus a --out d --threads 1025", "--threads"),
            ("focus a --out d --memory 3Q", "--memory"),
            ("link nowhere a -o m", "WHERE"),
            ("link tcp://h:1 a -o m --rate 0", "--rate"),
            ("link tcp://h:1 a -o m --error-db 3", "--error-db"),
            ("simulate --preset table-9 -o f", "--preset"),
            ("simulate --preset table-4-1 -o f --sgn 2", "--sgn"),
            ("simulate -o f", "SCENARIO"),
            ("simulate a.toml", "--out"),
            ("simulate a.toml -o f --preset table-4-1", "--preset"),
            ("simulate a.toml -o f --noise-db 3", "--noise-db"),
            ("simulate a.toml -o f --set radar.pri", "--set"),
            ("simulate --example nothing", "--example"),
        ] {
            let words = std::iter::once("subap").chain(words.split(' '));
            let error = Args::try_parse_from(words).unwrap_err();
            assert!(error.to_string().contains(option), "{error}");
            assert_eq!(error.exit_code(), 2);
        }
    }
}
