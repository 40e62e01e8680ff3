//! What can be typed. Each option sits beside its help; what it resolves to is in [`crate::config`].

mod autofocus;
mod export;
mod focus;
mod formers;
mod front;
mod global;
mod logs;
mod look;
mod maps;
mod navigation;
mod plan;
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
use subaperture::geometry::{Extent, Geodetic, ImageGrid};
use subaperture::module::link::ModuleAddress;
use subaperture::signal::window::Window;
use subaperture::simulate::{Preset, scenario};

use crate::failure::Usage;
pub(crate) use autofocus::{Autofocus, AutofocusSettings, Method};
pub(crate) use export::{Export, ImageFormat, Producing};
pub(crate) use focus::{BeamWidth, Focus, Forming, Imaging, TargetMotion, Velocity, Windows};
pub(crate) use formers::{FormerOptions, key as former_key, options as former_options};
pub(crate) use front::{command, parse};
pub(crate) use global::Global;
pub(crate) use logs::Logs;
pub(crate) use look::{ColourMap, Look, Picture};
pub(crate) use maps::{MapLayout, MapProjection, Mapping, RemapName};
pub(crate) use navigation::Navigation;
pub(crate) use plan::{Plan, PlanCalibrate, PlanFocus, PlanModule, PlanRadar, PlanTarget};
pub(crate) use radio::{Calibrate, Capture, Convert, Probe, Profile, Radio, RadioTask};
pub(crate) use run::Run;
pub(crate) use settings::defaults;
pub(crate) use shell::{Completions, Man};
use subaperture::units::Dimension;
pub(crate) use surface::{GeoidSource, GridSettings, SurfaceKind};
pub(crate) use tiled::{Part, Tiled};
pub(crate) use track::{Track, TrackSource};
pub(crate) use tune::{Recording, Tune, Vary};
pub(crate) use values::{At, SeveralChannels, several_channels};
use values::{
    above_zero, any, error_bound, finite, from_zero, geodetic, odd, output, place, positive,
    rectangle, setting, sign, vector,
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
        subap info FILE                  what a recording holds\n  \
        subap focus FILE... --out DIR    an image of it\n\n\
        Exit status:\n  \
        0    done\n  \
        1    failed; nothing is left in part\n  \
        2    wrong usage\n  \
        3    done, but a bound is missed: the prediction where that was allowed, focus --check, compare\n       \
        --error-db, crosscheck, demo; or a track found of echoes is in doubt\n  \
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
    /// Form an image of one or more recordings
    Focus(Box<Focus>),
    /// Show one place of recordings at many velocities
    Velocity(Velocity),
    /// Have a module compute the maps of recordings, and keep them in a file
    Link(Link),
    /// Write the phase history of a simulated scene as CPHD 1.1, or its raw echoes
    Simulate(Simulate),
    /// Compare the embedded core, in float32 and fixed point, and rdbp's maps with the float64 sum
    Crosscheck(Crosscheck),
    /// Say what recordings hold
    Info(Info),
    /// How a raw recording of your own is described: keys and examples
    Recording(Recording),
    /// Find what nobody measured of a raw recording's geometry by the sharpness of its image
    Tune(Tune),
    /// Find the track of a radar with several receivers from its echoes alone
    Track(Track),
    /// Estimate phase errors or the track by autofocus, judged on held-out data
    Autofocus(Autofocus),
    /// Say what a navigation log holds and what of it is lost, and write its track
    Navigation(Navigation),
    /// Say how far apart two complex images are
    Compare(Compare),
    /// Measure an image: responses of points, level, contrast, differences from another
    Quality(Quality),
    /// Draw an image's picture again, with other levels or colours
    Picture(Picture),
    /// Look at images of any size in a browser of this machine
    #[cfg(feature = "page")]
    View(View),
    /// Capture a stepped-carrier radar's echoes by a radio, into a recording (SigMF)
    Capture(Capture),
    /// Capture, and form the image meanwhile, sweep by sweep
    Live(Live),
    /// Radios: which there are, what they can do, and what cables and channels do
    Radio(Radio),
    /// Range profiles of a capture
    Profile(Profile),
    /// Write an image in a format that other programs read
    Export(Export),
    /// Do a whole job of one text: focus, check, measure, export, report; and again what has changed since
    Run(Run),
    /// Plan a pass of a radar, or a module that makes its maps
    Plan(Plan),
    /// Simulate the thesis's Table 4.1, focus it in every way, and show errors and pictures
    Demo(Demo),
    /// Make the figures of both theses again, beside the theses' own numbers; writes a page
    Reproduce(Reproduce),
    /// Print completions for a shell
    Completions(Completions),
    /// Print the man page of subap or of one of its commands
    Man(Man),
}

/// How files are written.
#[derive(Clone, Copy, Debug, Group)]
pub(crate) struct Writing {
    /// Replace files that subap did not write; never an input of the same run [default: only its own]
    #[arg(long)]
    pub(crate) force: bool,
}

/// Whether to do it, or to say what it would take.
#[derive(Clone, Copy, Debug, Default, Group)]
pub(crate) struct Rehearsal {
    /// Say what it will take (time, memory, disk), from a short measured part of the work, and do nothing
    #[arg(long)]
    pub(crate) dry_run: bool,
}

/// Recordings.
#[derive(Clone, Debug, Default, Group, Deserialize)]
#[serde(default)]
pub(crate) struct Input {
    /// Recordings: CPHD, CRSD, GOTCHA .mat, arrays, or descriptions of raw samples (.toml, see subap recording). Several make one aperture,
    /// in the order given
    #[arg(required = true, value_name = "INPUT", value_hint = ValueHint::FilePath)]
    pub(crate) files: Vec<PathBuf>,

    /// One channel, by its name such as T1R2 or by its number from 1 [default: the reference channel of a CPHD; all channels of a
    /// description, in order of time]
    #[arg(long, value_name = "NAME")]
    pub(crate) channel: Option<String>,

    /// Coherent sum of channels that share their pulses (MIMO): all, or a list such as T1R1,T1R2
    #[arg(long, value_name = "all|A,B", value_parser = several_channels, conflicts_with = "channel")]
    #[serde(deserialize_with = "channels_of_job")]
    pub(crate) channels: Option<SeveralChannels>,

    /// Override a key of a description, such as radar.first_pulse=9.2s. May be repeated
    #[arg(long, value_name = "KEY=VALUE", value_parser = setting)]
    #[serde(skip)]
    pub(crate) set: Vec<(String, String)>,
}

impl Input {
    /// A recording and nothing else.
    pub(crate) fn alone(path: &Path) -> Self {
        Self {
            files: vec![path.to_owned()],
            ..Self::default()
        }
    }

    /// Refuses the sum of several channels for `whom`, which takes one.
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

/// `subap link`.
#[derive(Debug, Group)]
pub(crate) struct Link {
    /// Where the module is: tcp://HOST:PORT, serial:/dev/ttyX@BAUD, emulate:float or emulate:fixed
    #[arg(value_name = "WHERE")]
    pub(crate) place: ModuleAddress,

    #[command(flatten)]
    pub(crate) input: Input,

    /// File for the maps; subap focus --from-maps forms the image
    #[arg(long, short, value_name = "MAPS", value_hint = ValueHint::FilePath, value_parser = output())]
    pub(crate) out: PathBuf,

    /// Pixels that the maps are for, as for focus [default: the scene's extent at half the resolution]
    #[arg(long, value_name = "GRID", allow_hyphen_values = true)]
    pub(crate) grid: Option<ImageGrid>,

    /// Bound on the relative RMS error of the image against the exact sum, in dB, -20 to -120
    /// [default: -66]
    #[arg(long, value_name = "DB", allow_hyphen_values = true, value_parser = error_bound)]
    pub(crate) error_db: Option<f64>,

    #[command(flatten)]
    pub(crate) windows: Windows,

    /// Firmware to emulate [default: target/module/float or fixed, here or above]
    #[arg(long, value_name = "ELF", value_hint = ValueHint::FilePath)]
    pub(crate) firmware: Option<PathBuf>,

    /// Send so many pulses a second, as a radar does that waits for nobody; what is lost is not sent
    /// again [default: as fast as the module has room]
    #[arg(long, value_name = "HERTZ", allow_hyphen_values = true, value_parser = above_zero(Dimension::Frequency))]
    pub(crate) rate: Option<f64>,

    /// Further runs, at most, over what was lost
    #[arg(long, value_name = "N", default_value_t = 3, conflicts_with = "rate")]
    pub(crate) retries: u32,

    /// Compare every map with the same core run here, bit by bit, and fail if one differs
    #[arg(long)]
    pub(crate) verify: bool,

    /// Show the image so far in this file, about once a second
    #[arg(long, value_name = "PNG", value_hint = ValueHint::FilePath, value_parser = output())]
    pub(crate) picture: Option<PathBuf>,

    #[command(flatten)]
    pub(crate) rehearsal: Rehearsal,

    #[command(flatten)]
    pub(crate) writing: Writing,
}

/// `subap simulate`.
#[derive(Debug, Group)]
#[command(after_help = "First steps:\n  \
    subap simulate --example spotlight > scene.toml\n  \
    subap simulate scene.toml --set radar.pulses=256 -o scene.cphd")]
pub(crate) struct Simulate {
    /// What to simulate, in TOML: see --keys and --example
    #[arg(value_name = "SCENARIO", value_hint = ValueHint::FilePath,
        required_unless_present_any = ["preset", "keys", "example"])]
    pub(crate) scenario: Option<PathBuf>,

    /// In place of a scenario: table-4-1 (imaging) or table-2-1 (range migration) of Schone 2020
    #[arg(long, value_name = "NAME", conflicts_with = "scenario")]
    pub(crate) preset: Option<Preset>,

    // Not a doc comment, in which brackets are a link.
    #[arg(
        long,
        value_name = "KEY=VALUE",
        conflicts_with = "preset",
        value_parser = setting,
        help = "Override a key of the scenario, as radar.pri=\"0.5 ms\" or \
                scene.point[0].position=\"0, 1, 0 m\"; any number of times"
    )]
    pub(crate) set: Vec<(String, String)>,

    /// Print every key of a scenario with its unit, default and meaning
    #[arg(long, conflicts_with_all = ["scenario", "preset", "example", "out"])]
    pub(crate) keys: bool,

    /// Print a scenario to start from
    #[arg(long, value_name = "NAME", conflicts_with_all = ["scenario", "preset", "out"],
        value_parser = clap::builder::PossibleValuesParser::new(scenario::examples::names()))]
    pub(crate) example: Option<String>,

    /// CPHD file to write; a scenario's pairs of antennas are its channels
    #[arg(long, short, value_name = "FILE", value_hint = ValueHint::FilePath, value_parser = output(),
        required_unless_present_any = ["keys", "example", "echoes"])]
    pub(crate) out: Option<PathBuf>,

    /// Folder for a scenario's raw echoes, as received: echoes.npy and the like, and recording.toml, which
    /// subap focus reads (of several pairs of antennas recording-T1R2.toml and so on)
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath, value_parser = output(),
        conflicts_with_all = ["preset", "keys", "example"])]
    pub(crate) echoes: Option<PathBuf>,

    /// Domain of the signal array
    #[arg(long, value_enum, default_value_t)]
    pub(crate) domain: SignalDomain,

    /// What the file declares as the surface of its scene coordinates
    #[arg(long, value_enum, default_value_t)]
    pub(crate) reference_surface: DeclaredSurface,

    /// Sign of the phase, SGN: -1 or +1
    #[arg(long, value_name = "SIGN", default_value = "-1", allow_hyphen_values = true, value_parser = sign)]
    pub(crate) sgn: i8,

    /// Of a preset: add noise of this power, dB relative to a unit scatterer's sample
    #[arg(long, value_name = "DB", allow_hyphen_values = true, value_parser = any(Dimension::Level),
        conflicts_with = "scenario")]
    pub(crate) noise_db: Option<f64>,

    /// Of a preset: shake the track by this much (RMS in each axis, smooth, known to the record)
    #[arg(long, value_name = "METRES", default_value_t = 0.0, allow_hyphen_values = true,
        value_parser = from_zero(Dimension::Length), conflicts_with = "scenario")]
    pub(crate) perturb: f64,

    /// Seed of everything random [default: the scenario's, or 0]
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

    /// Pulses a sub-CPI [default: 40]
    #[arg(long, value_name = "N", value_parser = positive)]
    pub(crate) sub_cpi: Option<usize>,
}

/// `subap info`.
#[derive(Debug, Group)]
pub(crate) struct Info {
    #[command(flatten)]
    pub(crate) input: Input,

    /// Place that geometry and resolution are given for, metres in the scene frame [default: the scene's
    /// centre]
    #[arg(long, value_name = "X,Y[,Z]", allow_hyphen_values = true, value_parser = vector(Dimension::Length))]
    pub(crate) at: Option<DVec3>,
}

/// `subap compare`.
#[derive(Debug, Group)]
pub(crate) struct Compare {
    /// Image to judge: folder of a product, its image.json, complex64 .npy, SICD, SIDD, GeoTIFF, or Zarr
    #[arg(value_name = "A", value_hint = ValueHint::AnyPath)]
    pub(crate) image: PathBuf,

    /// Image to judge it by
    #[arg(value_name = "B", value_hint = ValueHint::AnyPath)]
    pub(crate) reference: PathBuf,

    /// Where on the Earth the scene's origin is, x to the east, of an image that does not say: to compare it with one that does
    #[arg(long, value_name = "LAT,LON[,HEIGHT]", allow_hyphen_values = true, value_parser = geodetic)]
    pub(crate) place: Option<Geodetic>,

    /// Bound on the relative RMS error, dB: exit status 3 if it is missed
    #[arg(long, value_name = "DB", allow_hyphen_values = true, value_parser = any(Dimension::Level))]
    pub(crate) error_db: Option<f64>,
}

/// `subap quality`.
#[derive(Debug, Group)]
#[command(mut_arg("dry_run", |dry_run| dry_run.requires("from")))]
pub(crate) struct Quality {
    /// Image: folder of a product (image.json and image.npy), its image.json, SICD, SIDD, GeoTIFF, Zarr, or complex64 .npy. An image without
    /// a grid is measured in pixels
    #[arg(value_name = "IMAGE", value_hint = ValueHint::AnyPath)]
    pub(crate) image: PathBuf,

    #[command(flatten)]
    pub(crate) points: Points,

    /// Recording from which the image was formed. Point responses are measured on finer chips formed from it, and theory uses the beam
    /// measured from the echoes. Repeat it for an image of several recordings, in the same order
    #[arg(long, value_name = "RECORDING", value_hint = ValueHint::FilePath)]
    pub(crate) from: Vec<PathBuf>,

    /// Image to compare with, of any format; it is related by its metadata
    #[arg(long, value_name = "OTHER", value_hint = ValueHint::AnyPath)]
    pub(crate) against: Option<PathBuf>,

    #[command(flatten)]
    pub(crate) measuring: Measuring,

    /// Folder for pictures: cuts, chips, percent difference, coherence
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath, value_parser = output())]
    pub(crate) plots: Option<PathBuf>,

    #[command(flatten)]
    pub(crate) rehearsal: Rehearsal,

    #[command(flatten)]
    pub(crate) writing: Writing,
}

/// Points whose responses are measured.
#[derive(Clone, Debug, Default, Group, Deserialize)]
#[serde(default)]
pub(crate) struct Points {
    /// Point to measure, as its position in the scene frame, metres (degrees and range on a polar grid; column and row of a .npy). The
    /// brightest pixel within 4 pixels is taken. May be repeated [default: the brightest]
    #[arg(long, value_name = "X,Y[,Z]", allow_hyphen_values = true, value_parser = place)]
    pub(crate) at: Vec<At>,
}

/// What is measured of an image, and how.
#[derive(Debug, Group)]
pub(crate) struct Measuring {
    /// Rectangle for the statistics, in x and y of the grid (as --at on polar grids and arrays). Over a dark rectangle the mean level is
    /// that of the noise [default: the whole image]
    #[arg(long, value_name = "X0:X1,Y0:Y1", allow_hyphen_values = true, value_parser = rectangle)]
    pub(crate) extent: Option<Extent>,

    /// Window over fast and slow time for which theory is computed [default: that of the product]
    #[arg(long, value_name = "W")]
    pub(crate) window: Option<Window>,

    /// Measure along and across this line of sight too: its angle from x towards y, degrees
    #[arg(long, value_name = "DEG", allow_hyphen_values = true, value_parser = any(Dimension::Angle))]
    pub(crate) line_of_sight: Option<f64>,

    /// Level below the peak of --against, dB, under which pixels have no percent difference
    #[arg(long, value_name = "DB", default_value_t = 60.0, value_parser = above_zero(Dimension::Level))]
    pub(crate) floor: f64,

    /// Side of the coherence window, pixels, odd
    #[arg(long, value_name = "N", default_value_t = 7, value_parser = odd)]
    pub(crate) coherence: usize,
}

/// `subap demo`.
#[derive(Debug, Group)]
pub(crate) struct Demo {
    /// Folder to write
    #[arg(long, short, value_name = "DIR", default_value = "subap-demo", value_hint = ValueHint::DirPath, value_parser = output())]
    pub(crate) out: PathBuf,

    /// Pixels; errors are held to their bounds on the default only, which covers all scatterers
    /// [default: the scene's 80 x 80 m and some margin]
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
    /// Folder to write; items that are there already are not made again
    #[arg(long, short, value_name = "DIR", default_value = "subap-gallery", value_hint = ValueHint::DirPath, value_parser = output())]
    pub(crate) out: PathBuf,

    /// Only these items, by their names (see --list): parted by commas, or one an --only
    #[arg(long, value_name = "ID", value_delimiter = ',')]
    pub(crate) only: Vec<String>,

    /// GOTCHA recordings, or folders that hold them, for the items that can be shown on them
    #[arg(long, value_name = "MAT", num_args = 1.., value_hint = ValueHint::FilePath)]
    pub(crate) gotcha: Vec<PathBuf>,

    /// List the items and do nothing else
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
