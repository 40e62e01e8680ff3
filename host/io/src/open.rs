//! Opening of recordings, recognised by content, in files or at URLs ([`super::remote`]). CPHD, CRSD and HDF5 are read by ranges of bytes;
//! GOTCHA and archives of arrays at URLs are read whole into memory. Only descriptions of raw recordings, which are text, are recognised
//! by their suffix `.toml`, and samples of the Gotcha GMTI challenge, which have no header, by their name.

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
use super::gotcha_gmti;
use super::input::open_file;
#[cfg(all(feature = "cphd", feature = "hdf5"))]
use super::l0b;
#[cfg(feature = "recording")]
use super::recording;
use super::remote;
use subaperture_model::phase_history::{
    Channel, Channels, CoherentSum, Excluding, Inference, Joined, PhaseHistory, ReadError,
};

const CPHD_MAGIC: &[u8] = b"CPHD/1.";
const CRSD_MAGIC: &[u8] = b"CRSD";
const SUPPORTED: &str = "CPHD 1.x, CRSD 1.0, GOTCHA (MATLAB 5), Gotcha GMTI challenge (by name: PREFIX_chanN_SET_PH) and NISAR L0B files are read, arrays of phase history (.npz, HDF5), and descriptions of raw recordings (.toml)";
const ARCHIVE_MAGIC: &[u8] = b"PK\x03\x04";
const HDF5_MAGIC: &[u8] = b"\x89HDF\r\n\x1a\n";

/// Bytes that suffice to recognise every format.
const START_BYTES: usize = 64;

/// Options for opening recordings.
#[derive(Clone, Copy, Debug)]
pub struct Options<'a> {
    /// Channel of a multichannel recording, by its name or its number from 1. `None`: the reference channel of CPHD
    /// or CRSD, the first channel of L0B and of arrays, the channel of the named file of the Gotcha GMTI challenge, and all pulses of a described
    /// recording in order of time.
    pub channel: Option<&'a str>,
    /// Maximum memory of all recordings opened together, bytes.
    pub memory_bytes: u64,
    /// Keys of raw recording descriptions with values that override them, such as `radar.pri`. They apply to every
    /// description opened. For the Gotcha GMTI challenge, values that its files do not state ([`gotcha_gmti`]).
    pub settings: &'a [(String, String)],
    /// Inference of the phase convention where a file does not state it, and its verification where it does; the
    /// crate `subaperture` provides `convention::INFERENCE`. If `None`, arrays and descriptions must state the
    /// convention.
    pub inference: Option<Inference>,
}

impl Default for Options<'_> {
    /// No channel, unlimited memory, no settings, no inference.
    fn default() -> Self {
        Self {
            channel: None,
            memory_bytes: u64::MAX,
            settings: &[],
            inference: None,
        }
    }
}

/// Open a recording, without pulses at positions that no vehicle can have ([`Excluding::misplaced`]).
///
/// # Errors
/// [`ReadError::Malformed`] for a damaged file, an unknown format (with the format it resembles), or a format whose
/// feature is off; [`ReadError::Mismatch`] for a channel or settings that the format does not support;
/// [`ReadError::Io`].
pub fn open(path: &Path, options: &Options) -> Result<Box<dyn PhaseHistory>, ReadError> {
    Excluding::misplaced(opened(path, options)?)
}

/// As [`open`], from the bytes of a file in memory; `name` stands for its path. CPHD, GOTCHA and archives of arrays (`.npz`) are read. The
/// bytes count as memory.
///
/// # Errors
/// As [`open`], and [`ReadError::Malformed`] for CRSD, HDF5 and descriptions, which are read from files only.
pub fn open_bytes(
    name: &Path,
    bytes: Vec<u8>,
    options: &Options,
) -> Result<Box<dyn PhaseHistory>, ReadError> {
    let start = &bytes[..bytes.len().min(START_BYTES)];
    let opened = match recognised(name, start, options)? {
        Format::Gotcha => gotcha_of(name, bytes, options),
        Format::Cphd => cphd_of(name, bytes, options),
        Format::Arrays if start.starts_with(ARCHIVE_MAGIC) => arrays_of(name, bytes, options),
        _ => Err(ReadError::Malformed {
            path: name.to_owned(),
            what: "expected CPHD, GOTCHA or an archive of arrays (.npz), found a format that is read from files only"
                .to_owned(),
        }),
    };
    Excluding::misplaced(opened?)
}

fn opened(path: &Path, options: &Options) -> Opened {
    match format(path, options)? {
        Format::Gotcha => {
            no_channel(path, options)?;
            open_gotcha(path, options)
        }
        Format::GotchaGmti => open_gotcha_gmti(path, options),
        Format::Cphd => open_cphd(path, options),
        Format::Crsd => open_crsd(path, options),
        #[cfg(all(feature = "cphd", feature = "hdf5"))]
        Format::L0b => open_l0b(path, options),
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

/// Refuse a channel of a GOTCHA file.
fn no_channel(path: &Path, options: &Options) -> Result<(), ReadError> {
    match options.channel {
        Some(channel) => Err(ReadError::Mismatch(format!(
            "{}: a GOTCHA file has no channels; remove channel '{channel}'",
            path.display()
        ))),
        None => Ok(()),
    }
}

/// Single channel by its name.
fn one(channels: Channels<'static>, name: &str) -> Result<Box<dyn PhaseHistory>, ReadError> {
    let mut chosen = channels.select(&[name])?.into_inner();
    Ok(chosen.swap_remove(0).1)
}

/// Open channels of a recording, selected as by [`Options::channel`], which is ignored here; all if `None`. A GOTCHA
/// file has one channel, `1`.
///
/// # Errors
/// As [`open`]; [`ReadError::Channels`] if a channel is missing, or if the channels do not share their pulses.
pub fn open_channels<S: AsRef<str>>(
    path: &Path,
    channels: Option<&[S]>,
    options: &Options,
) -> Result<Channels<'static>, ReadError> {
    let all = match format(path, options)? {
        Format::Gotcha => Channels::new(vec![(Channel::new("1"), open_gotcha(path, options)?)])?,
        Format::GotchaGmti => return gotcha_gmti_channels(path, channels, options),
        Format::Cphd => return cphd_channels(path, channels, options),
        Format::Crsd => return crsd_channels(path, channels, options),
        #[cfg(all(feature = "cphd", feature = "hdf5"))]
        Format::L0b => return l0b_channels(path, channels, options),
        Format::Arrays => array_channels(path, options)?,
        Format::Described => described_channels(path, options)?,
    };
    match channels {
        Some(wanted) => all.select(wanted)?.without_misplaced(),
        None => all.without_misplaced(),
    }
}

/// Format of a file.
enum Format {
    Gotcha,
    GotchaGmti,
    Cphd,
    Crsd,
    #[cfg(all(feature = "cphd", feature = "hdf5"))]
    L0b,
    Arrays,
    Described,
}

fn format(path: &Path, options: &Options) -> Result<Format, ReadError> {
    if path.is_dir() {
        return Err(ReadError::Malformed {
            path: path.to_owned(),
            what: "expected a recording, found a directory: name the files in it".to_owned(),
        });
    }
    let start = read_start(path).map_err(|source| ReadError::Io {
        path: path.to_owned(),
        source,
    })?;
    let format = recognised(path, &start, options)?;
    #[cfg(all(feature = "cphd", feature = "hdf5"))]
    if start.starts_with(HDF5_MAGIC) && l0b::is_nisar(path) {
        return Ok(Format::L0b);
    }
    Ok(format)
}

/// Format of a file that begins with `start`.
fn recognised(path: &Path, start: &[u8], options: &Options) -> Result<Format, ReadError> {
    let described = path
        .extension()
        .is_some_and(|extension| extension == "toml");
    let challenge = gotcha_gmti::Files::of(path).is_some();
    if let ([(key, value), ..], false) = (options.settings, described || challenge) {
        return Err(ReadError::Mismatch(format!(
            "{}: setting {key} = {value} applies only to descriptions of raw recordings (.toml) and to the Gotcha GMTI challenge: remove it",
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
    if challenge {
        return Ok(Format::GotchaGmti);
    }
    if described {
        return match remote::url(path) {
            None => Ok(Format::Described),
            Some(_) => Err(ReadError::Malformed {
                path: path.to_owned(),
                what: "expected a description in a local file, found a URL: copy it with the files that it names".to_owned(),
            }),
        };
    }
    Err(ReadError::Malformed {
        path: path.to_owned(),
        what: format!("{}; {SUPPORTED}", describe(start)),
    })
}

type Opened = Result<Box<dyn PhaseHistory>, ReadError>;
type OpenedChannels = Result<Channels<'static>, ReadError>;

#[cfg(feature = "gotcha")]
fn open_gotcha(path: &Path, options: &Options) -> Opened {
    if let Some(bytes) = remote::content(path, options.memory_bytes)? {
        return gotcha_of(path, bytes, options);
    }
    Ok(Box::new(gotcha::read(path, options.memory_bytes)?))
}

#[cfg(feature = "gotcha")]
fn gotcha_of(name: &Path, bytes: Vec<u8>, options: &Options) -> Opened {
    no_channel(name, options)?;
    let opened = gotcha::from_bytes(name, bytes, options.memory_bytes)?;
    Ok(Box::new(opened))
}

#[cfg(not(feature = "gotcha"))]
fn gotcha_of(name: &Path, _: Vec<u8>, options: &Options) -> Opened {
    open_gotcha(name, options)
}

#[cfg(not(feature = "gotcha"))]
fn open_gotcha(path: &Path, _: &Options) -> Opened {
    Err(is_off(path, "a MATLAB 5 file", "gotcha"))
}

/// Values that the files of the Gotcha GMTI challenge do not state.
#[cfg(all(feature = "cphd", feature = "gotcha"))]
fn challenge_settings(path: &Path, options: &Options) -> Result<gotcha_gmti::Settings, ReadError> {
    gotcha_gmti::Settings::of(options.settings)
        .map_err(|fault| ReadError::Mismatch(format!("{}: {fault}", path.display())))
}

#[cfg(all(feature = "cphd", feature = "gotcha"))]
fn open_gotcha_gmti(path: &Path, options: &Options) -> Opened {
    let settings = challenge_settings(path, options)?;
    let (channel, memory_bytes) = (options.channel, options.memory_bytes);
    let opened = gotcha_gmti::GotchaGmti::open(path, channel, &settings, memory_bytes)?;
    Ok(Box::new(opened))
}

#[cfg(all(feature = "cphd", feature = "gotcha"))]
fn gotcha_gmti_channels<S: AsRef<str>>(
    path: &Path,
    channels: Option<&[S]>,
    options: &Options,
) -> OpenedChannels {
    let settings = challenge_settings(path, options)?;
    side_by_side(gotcha_gmti::GotchaGmti::open_channels(
        path,
        channels,
        &settings,
        options.memory_bytes,
    )?)
}

#[cfg(not(all(feature = "cphd", feature = "gotcha")))]
fn challenge_is_off(path: &Path) -> ReadError {
    let missing = match cfg!(feature = "cphd") {
        true => "gotcha",
        false => "cphd",
    };
    is_off(path, "samples of the Gotcha GMTI challenge", missing)
}

#[cfg(not(all(feature = "cphd", feature = "gotcha")))]
fn open_gotcha_gmti(path: &Path, _: &Options) -> Opened {
    Err(challenge_is_off(path))
}

#[cfg(not(all(feature = "cphd", feature = "gotcha")))]
fn gotcha_gmti_channels<S: AsRef<str>>(
    path: &Path,
    _: Option<&[S]>,
    _: &Options,
) -> OpenedChannels {
    Err(challenge_is_off(path))
}

#[cfg(feature = "cphd")]
fn open_cphd(path: &Path, options: &Options) -> Opened {
    let opened = cphd::Cphd::open(path, options.channel, options.memory_bytes)?;
    Ok(Box::new(opened))
}

#[cfg(feature = "cphd")]
fn cphd_of(name: &Path, bytes: Vec<u8>, options: &Options) -> Opened {
    let opened = cphd::Cphd::from_bytes(name, bytes, options.channel, options.memory_bytes)?;
    Ok(Box::new(opened))
}

#[cfg(not(feature = "cphd"))]
fn cphd_of(name: &Path, _: Vec<u8>, options: &Options) -> Opened {
    open_cphd(name, options)
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

/// Combine histories of one channel each.
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

#[cfg(all(feature = "cphd", feature = "hdf5"))]
fn open_l0b(path: &Path, options: &Options) -> Opened {
    let opened = l0b::L0b::open(path, options.channel, options.memory_bytes)?;
    Ok(Box::new(opened))
}

#[cfg(all(feature = "cphd", feature = "hdf5"))]
fn l0b_channels<S: AsRef<str>>(
    path: &Path,
    channels: Option<&[S]>,
    options: &Options,
) -> OpenedChannels {
    side_by_side(l0b::L0b::open_channels(
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
    let inference = options.inference.as_ref();
    arrays::open_channels(path, options.memory_bytes, inference)
}

#[cfg(feature = "npz")]
fn arrays_of(name: &Path, bytes: Vec<u8>, options: &Options) -> Opened {
    let inference = options.inference.as_ref();
    let channels = arrays::from_bytes(name, bytes, options.memory_bytes, inference)?;
    one(channels, options.channel.unwrap_or("1"))
}

#[cfg(not(feature = "npz"))]
fn arrays_of(name: &Path, _: Vec<u8>, _: &Options) -> Opened {
    Err(is_off(name, "a file of arrays (.npz, HDF5)", "npz"))
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

/// Error for a format whose feature is off.
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

/// Metadata from header and XML of a CPHD file, with XML of at most `memory_bytes` once parsed. `None` for other
/// files.
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

/// Metadata from header and XML of a CRSD file. `None` for other files.
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

/// Metadata of a NISAR L0B file, read with at most `memory_bytes` of memory. `None` for other files.
///
/// # Errors
/// As [`l0b::L0bInfo::read`].
#[cfg(all(feature = "cphd", feature = "hdf5"))]
pub fn l0b_info(path: &Path, memory_bytes: u64) -> Result<Option<l0b::L0bInfo>, ReadError> {
    let start = read_start(path).map_err(|source| ReadError::Io {
        path: path.to_owned(),
        source,
    })?;
    if !start.starts_with(HDF5_MAGIC) || !l0b::is_nisar(path) {
        return Ok(None);
    }
    l0b::L0bInfo::read(path, memory_bytes).map(Some)
}

/// Open recordings and join them into one aperture, with pulses in the order of [`Joined`] for any order of `paths`.
///
/// # Errors
/// As [`open`]; [`ReadError::Mismatch`] if there are no recordings, or if they cannot be joined.
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

/// Open channels (selected as by [`open_channels`]) of recordings that are joined channel by channel ([`Channels::join`]).
///
/// # Errors
/// As [`open_channels`] and [`Channels::join`]; [`ReadError::Mismatch`] if there are no recordings.
pub fn open_joined_channels<P: AsRef<Path>, S: AsRef<str>>(
    paths: &[P],
    channels: Option<&[S]>,
    options: &Options,
) -> Result<Channels<'static>, ReadError> {
    if paths.is_empty() {
        return Err(ReadError::Mismatch("no input given".to_owned()));
    }
    let mut left = *options;
    let mut recordings: Vec<Channels> = Vec::with_capacity(paths.len());
    for path in paths {
        let opened = open_channels(path.as_ref(), channels, &left)?;
        left.memory_bytes = left.memory_bytes.saturating_sub(opened.held_bytes());
        recordings.push(opened);
    }
    check_memory(
        paths,
        Channels::joining_bytes(&recordings),
        left.memory_bytes,
    )?;
    Channels::join(recordings)
}

/// Open the coherent sum of channels, opened as by [`open_joined_channels`]. A single channel is returned unchanged.
///
/// # Errors
/// As [`open_joined_channels`] and [`CoherentSum::new`].
pub fn open_sum<P: AsRef<Path>, S: AsRef<str>>(
    paths: &[P],
    channels: Option<&[S]>,
    options: &Options,
) -> Result<Joined, ReadError> {
    let all = open_joined_channels(paths, channels, options)?;
    let left_bytes = options.memory_bytes.saturating_sub(all.held_bytes());
    check_memory(paths, CoherentSum::summing_bytes(&all), left_bytes)?;
    Ok(Joined::alone(Box::new(all.coherent_sum()?)))
}

/// Check that recordings need no more than the allowed memory.
fn check_memory<P: AsRef<Path>>(
    paths: &[P],
    needed_bytes: u64,
    allowed_bytes: u64,
) -> Result<(), ReadError> {
    match paths.last() {
        Some(last) if needed_bytes > allowed_bytes => Err(ReadError::Memory {
            path: last.as_ref().to_owned(),
            needed_bytes,
            allowed_bytes,
        }),
        _ => Ok(()),
    }
}

/// First bytes of a file, enough to recognise every format.
fn read_start(path: &Path) -> std::io::Result<Vec<u8>> {
    if let Some(url) = remote::url(path) {
        return remote::start(url, START_BYTES);
    }
    let mut start = Vec::new();
    open_file(path)?
        .take(START_BYTES as u64)
        .read_to_end(&mut start)?;
    Ok(start)
}

/// Format that an unsupported file resembles, and what to do with it.
fn describe(start: &[u8]) -> &'static str {
    let known: [(&[u8], &str); 6] = [
        (
            b"MATLAB 7.3 MAT-file",
            "a MATLAB 7.3 (HDF5) file: load it in MATLAB and save it again with -v7",
        ),
        (b"CPHD/0.", "CPHD before version 1: convert it to CPHD 1.1"),
        (b"CPHD", "CPHD of an unknown version"),
        (
            b"NITF",
            "a NITF file (SICD or SIDD): an image already, not phase history",
        ),
        (
            b"\x93NUMPY",
            "a NumPy array, without the pulses' geometry: put both into an archive, or describe it in TOML (see subap recording)",
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
