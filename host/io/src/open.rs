//! Recordings opened by what they hold, not by how they are called; only a description of a raw recording, which is
//! text, is known by its `.toml`.

use std::io::Read;
use std::path::Path;

#[cfg(feature = "npz")]
use super::arrays;
#[cfg(feature = "cphd")]
use super::cphd;
#[cfg(feature = "cphd")]
use super::crsd;
#[cfg(feature = "gotcha")]
use super::gotcha;
use super::input::open_file;
#[cfg(feature = "recording")]
use super::recording;
use subaperture_model::phase_history::{
    Channel, Channels, CoherentSum, Excluding, Inference, Joined, PhaseHistory, ReadError,
};

const CPHD_MAGIC: &[u8] = b"CPHD/1.";
const CRSD_MAGIC: &[u8] = b"CRSD";
const SUPPORTED: &str = "CPHD 1.x, CRSD 1.0 and GOTCHA (MATLAB 5) files are read, arrays of phase history (.npz, HDF5), and descriptions of raw recordings (.toml)";
const ARCHIVE_MAGIC: &[u8] = b"PK\x03\x04";
const HDF5_MAGIC: &[u8] = b"\x89HDF\r\n\x1a\n";

/// How recordings are opened.
#[derive(Clone, Copy, Debug)]
pub struct Options<'a> {
    /// One channel of a recording that has several, by its name or its number from 1. If `None`, the reference channel of
    /// a CPHD or CRSD, the first of arrays, and of a described recording the pulses of all, in the order of time.
    pub channel: Option<&'a str>,
    /// Bytes that all recordings opened together may hold in memory.
    pub memory_bytes: u64,
    /// Keys of descriptions of raw recordings and the values that override them, such as `radar.pri`; laid over
    /// every description opened.
    pub settings: &'a [(String, String)],
    /// What decides sign and reference of the phase where a file does not state them, and checks them where it does:
    /// the crate `subaperture` has one, `convention::INFERENCE`. If `None`, arrays and descriptions have to state them.
    pub inference: Option<Inference>,
}

impl Default for Options<'_> {
    /// No channel asked for, any amount of memory, no settings, no inference.
    fn default() -> Self {
        Self {
            channel: None,
            memory_bytes: u64::MAX,
            settings: &[],
            inference: None,
        }
    }
}

/// Opens a recording, without pulses whose positions no vehicle can have had ([`Excluding::misplaced`]).
///
/// # Errors
/// [`ReadError::Malformed`] for a file of no known format, saying what it looks like, for one whose format is a feature
/// that is off, and for a broken one; [`ReadError::Mismatch`] for a channel or settings of a format that has none;
/// [`ReadError::Io`].
pub fn open(path: &Path, options: &Options) -> Result<Box<dyn PhaseHistory>, ReadError> {
    Excluding::misplaced(opened(path, options)?)
}

fn opened(path: &Path, options: &Options) -> Opened {
    match format(path, options)? {
        Format::Gotcha => match options.channel {
            Some(channel) => Err(ReadError::Mismatch(format!(
                "{}: a GOTCHA file has no channels; leave out channel '{channel}'",
                path.display()
            ))),
            None => open_gotcha(path, options),
        },
        Format::Cphd => open_cphd(path, options),
        Format::Crsd => open_crsd(path, options),
        Format::Arrays => {
            let channels = array_channels(path, options)?;
            one(channels, options.channel.unwrap_or("1"))
        }
        Format::Described => match options.channel {
            Some(channel) => one(described_channels(path, options)?, channel),
            None => open_described(path, options),
        },
    }
}

/// One of some channels.
fn one(channels: Channels<'static>, name: &str) -> Result<Box<dyn PhaseHistory>, ReadError> {
    let mut chosen = channels.select(&[name])?.into_inner();
    Ok(chosen.swap_remove(0).1)
}

/// Opens channels of a recording side by side, each as for [`Options::channel`], which itself says nothing here; all if
/// `None`. A GOTCHA file is one channel, `1`.
///
/// # Errors
/// As [`open`]; [`ReadError::Channels`] if there is no such channel, or they do not share their pulses.
pub fn open_channels<S: AsRef<str>>(
    path: &Path,
    channels: Option<&[S]>,
    options: &Options,
) -> Result<Channels<'static>, ReadError> {
    let all = match format(path, options)? {
        Format::Gotcha => Channels::new(vec![(Channel::new("1"), open_gotcha(path, options)?)])?,
        Format::Cphd => return cphd_channels(path, channels, options),
        Format::Crsd => return crsd_channels(path, channels, options),
        Format::Arrays => array_channels(path, options)?,
        Format::Described => described_channels(path, options)?,
    };
    match channels {
        Some(wanted) => all.select(wanted)?.without_misplaced(),
        None => all.without_misplaced(),
    }
}

/// What a file is.
enum Format {
    Gotcha,
    Cphd,
    Crsd,
    Arrays,
    Described,
}

fn format(path: &Path, options: &Options) -> Result<Format, ReadError> {
    if path.is_dir() {
        return Err(ReadError::Malformed {
            path: path.to_owned(),
            what: "a directory, and not a recording: name the files in it".to_owned(),
        });
    }
    let start = read_start(path).map_err(|source| ReadError::Io {
        path: path.to_owned(),
        source,
    })?;
    let described = path
        .extension()
        .is_some_and(|extension| extension == "toml");
    if let ([(key, value), ..], false) = (options.settings, described) {
        return Err(ReadError::Mismatch(format!(
            "{}: {key} = {value} is laid over descriptions of raw recordings (.toml) only: leave out the setting",
            path.display()
        )));
    }
    if start.starts_with(super::input::MATLAB_MAGIC) {
        return Ok(Format::Gotcha);
    }
    if start.starts_with(CPHD_MAGIC) {
        return Ok(Format::Cphd);
    }
    if start.starts_with(CRSD_MAGIC) {
        return Ok(Format::Crsd);
    }
    if start.starts_with(ARCHIVE_MAGIC) || start.starts_with(HDF5_MAGIC) {
        return Ok(Format::Arrays);
    }
    if described {
        return Ok(Format::Described);
    }
    Err(ReadError::Malformed {
        path: path.to_owned(),
        what: format!("{}; {SUPPORTED}", describe(&start)),
    })
}

type Opened = Result<Box<dyn PhaseHistory>, ReadError>;
type OpenedChannels = Result<Channels<'static>, ReadError>;

#[cfg(feature = "gotcha")]
fn open_gotcha(path: &Path, options: &Options) -> Opened {
    Ok(Box::new(gotcha::read(path, options.memory_bytes)?))
}

#[cfg(not(feature = "gotcha"))]
fn open_gotcha(path: &Path, _: &Options) -> Opened {
    Err(is_off(path, "a MATLAB 5 file", "gotcha"))
}

#[cfg(feature = "cphd")]
fn open_cphd(path: &Path, options: &Options) -> Opened {
    let opened = cphd::Cphd::open(path, options.channel, options.memory_bytes)?;
    Ok(Box::new(opened))
}

#[cfg(feature = "cphd")]
fn cphd_channels<S: AsRef<str>>(
    path: &Path,
    channels: Option<&[S]>,
    options: &Options,
) -> OpenedChannels {
    side_by_side(cphd::Cphd::open_channels(
        path,
        channels,
        options.memory_bytes,
    )?)
}

/// Histories of one channel each, side by side.
#[cfg(feature = "cphd")]
fn side_by_side<T: PhaseHistory + 'static>(opened: Vec<T>) -> OpenedChannels {
    let described = opened.into_iter().flat_map(|history| {
        let about = history.channels().pop();
        about.map(|about| (about, Box::new(history) as Box<dyn PhaseHistory>))
    });
    Channels::new(described.collect())?.without_misplaced()
}

#[cfg(feature = "cphd")]
fn open_crsd(path: &Path, options: &Options) -> Opened {
    let opened = crsd::Crsd::open(path, options.channel, options.memory_bytes)?;
    Ok(Box::new(opened))
}

#[cfg(feature = "cphd")]
fn crsd_channels<S: AsRef<str>>(
    path: &Path,
    channels: Option<&[S]>,
    options: &Options,
) -> OpenedChannels {
    side_by_side(crsd::Crsd::open_channels(
        path,
        channels,
        options.memory_bytes,
    )?)
}

#[cfg(not(feature = "cphd"))]
fn open_crsd(path: &Path, _: &Options) -> Opened {
    Err(is_off(path, "a CRSD file", "cphd"))
}

#[cfg(not(feature = "cphd"))]
fn crsd_channels<S: AsRef<str>>(path: &Path, _: Option<&[S]>, _: &Options) -> OpenedChannels {
    Err(is_off(path, "a CRSD file", "cphd"))
}

#[cfg(not(feature = "cphd"))]
fn open_cphd(path: &Path, _: &Options) -> Opened {
    Err(is_off(path, "a CPHD file", "cphd"))
}

#[cfg(not(feature = "cphd"))]
fn cphd_channels<S: AsRef<str>>(path: &Path, _: Option<&[S]>, _: &Options) -> OpenedChannels {
    Err(is_off(path, "a CPHD file", "cphd"))
}

#[cfg(feature = "npz")]
fn array_channels(path: &Path, options: &Options) -> OpenedChannels {
    #[cfg(not(feature = "hdf5"))]
    if read_start(path).is_ok_and(|start| start.starts_with(HDF5_MAGIC)) {
        return Err(is_off(path, "an HDF5 file", "hdf5"));
    }
    arrays::open_channels(path, options.memory_bytes, options.inference.as_ref())
}

#[cfg(not(feature = "npz"))]
fn array_channels(path: &Path, _: &Options) -> OpenedChannels {
    Err(is_off(path, "a file of arrays (.npz, HDF5)", "npz"))
}

#[cfg(feature = "recording")]
fn open_described(path: &Path, options: &Options) -> Opened {
    let opened = recording::open(
        path,
        options.settings,
        options.memory_bytes,
        options.inference.as_ref(),
    )?;
    Ok(Box::new(opened))
}

#[cfg(feature = "recording")]
fn described_channels(path: &Path, options: &Options) -> OpenedChannels {
    recording::open_channels(
        path,
        options.settings,
        options.memory_bytes,
        options.inference.as_ref(),
    )
}

#[cfg(not(feature = "recording"))]
fn open_described(path: &Path, _: &Options) -> Opened {
    Err(is_off(path, "a described recording", "recording"))
}

#[cfg(not(feature = "recording"))]
fn described_channels(path: &Path, _: &Options) -> OpenedChannels {
    Err(is_off(path, "a described recording", "recording"))
}

/// Of a format that this program was built without.
#[cfg(not(all(
    feature = "cphd",
    feature = "gotcha",
    feature = "hdf5",
    feature = "recording"
)))]
fn is_off(path: &Path, what: &str, feature: &str) -> ReadError {
    ReadError::Malformed {
        path: path.to_owned(),
        what: format!(
            "{what}, and this program was built without the feature '{feature}' of subaperture"
        ),
    }
}

/// Metadata of a CPHD file's header and XML, which takes at most `memory_bytes` once parsed; `None` for other files.
///
/// # Errors
/// As [`cphd::CphdInfo::read_within`].
#[cfg(feature = "cphd")]
pub fn cphd_info(path: &Path, memory_bytes: u64) -> Result<Option<cphd::CphdInfo>, ReadError> {
    let start = read_start(path).map_err(|source| ReadError::Io {
        path: path.to_owned(),
        source,
    })?;
    if !start.starts_with(CPHD_MAGIC) {
        return Ok(None);
    }
    cphd::CphdInfo::read_within(path, memory_bytes).map(Some)
}

/// Description of a CRSD file in its header and XML; `None` for other files.
///
/// # Errors
/// As [`crsd::CrsdInfo::read`].
#[cfg(feature = "cphd")]
pub fn crsd_info(path: &Path) -> Result<Option<crsd::CrsdInfo>, ReadError> {
    let start = read_start(path).map_err(|source| ReadError::Io {
        path: path.to_owned(),
        source,
    })?;
    if !start.starts_with(CRSD_MAGIC) {
        return Ok(None);
    }
    crsd::CrsdInfo::read(path).map(Some)
}

/// Opens recordings and joins them into one aperture, its pulses in the order of [`Joined`] whatever that of
/// `paths`.
///
/// # Errors
/// As [`open`], and [`ReadError::Mismatch`] if there are none or they do not fit together.
pub fn open_all<P: AsRef<Path>>(paths: &[P], options: &Options) -> Result<Joined, ReadError> {
    let mut left = *options;
    let mut parts = Vec::with_capacity(paths.len());
    for path in paths {
        let part = open(path.as_ref(), &left)?;
        left.memory_bytes = left.memory_bytes.saturating_sub(part.held_bytes());
        parts.push(part);
    }
    let joining = Joined::joining_bytes(&parts);
    if let [.., last] = paths
        && joining > left.memory_bytes
    {
        return Err(ReadError::Memory {
            path: last.as_ref().to_owned(),
            needed_bytes: joining,
            allowed_bytes: left.memory_bytes,
        });
    }
    Joined::join(parts)
}

/// Opens the coherent sum of channels, as for [`open_channels`], of recordings that are joined channel by channel
/// ([`Channels::join`]); of a single channel that channel.
///
/// # Errors
/// As [`open_channels`], [`Channels::join`] and [`CoherentSum::new`]; [`ReadError::Mismatch`] if there are no recordings.
pub fn open_sum<P: AsRef<Path>, S: AsRef<str>>(
    paths: &[P],
    channels: Option<&[S]>,
    options: &Options,
) -> Result<Joined, ReadError> {
    let Some(last) = paths.last() else {
        return Err(ReadError::Mismatch("no input given".to_owned()));
    };
    let mut left = *options;
    let mut recordings: Vec<Channels> = Vec::with_capacity(paths.len());
    for path in paths {
        let opened = open_channels(path.as_ref(), channels, &left)?;
        left.memory_bytes = left.memory_bytes.saturating_sub(opened.held_bytes());
        recordings.push(opened);
    }
    let check = |needed_bytes: u64, allowed_bytes: u64| match needed_bytes > allowed_bytes {
        true => Err(ReadError::Memory {
            path: last.as_ref().to_owned(),
            needed_bytes,
            allowed_bytes,
        }),
        false => Ok(()),
    };
    check(Channels::joining_bytes(&recordings), left.memory_bytes)?;
    let all = Channels::join(recordings)?;
    let left_bytes = options.memory_bytes.saturating_sub(all.held_bytes());
    check(CoherentSum::summing_bytes(&all), left_bytes)?;
    Ok(Joined::alone(Box::new(all.coherent_sum()?)))
}

/// The first bytes: enough to know every format by.
fn read_start(path: &Path) -> std::io::Result<Vec<u8>> {
    let mut start = Vec::new();
    open_file(path)?.take(64).read_to_end(&mut start)?;
    Ok(start)
}

/// What a file of no supported format looks like, and what to do with it.
fn describe(start: &[u8]) -> &'static str {
    let known: [(&[u8], &str); 6] = [
        (
            b"MATLAB 7.3 MAT-file",
            "a MATLAB 7.3 (HDF5) file: load it in MATLAB and save it again with -v7",
        ),
        (
            b"CPHD/0.",
            "CPHD of a version before 1: convert it to CPHD 1.1",
        ),
        (b"CPHD", "CPHD of an unknown version"),
        (
            b"NITF",
            "a NITF file (SICD or SIDD): an image already, not phase history",
        ),
        (
            b"\x93NUMPY",
            "a NumPy array, without the pulses' geometry: put both into an archive, or describe it in TOML (subap recording says how)",
        ),
        (b"\x1f\x8b", "a gzip file: unpack it"),
    ];
    if start.is_empty() {
        return "the file is empty";
    }
    known
        .iter()
        .find(|(magic, _)| start.starts_with(magic))
        .map_or("neither CPHD nor MATLAB 5 by its first bytes", |k| k.1)
}
