//! Recognition of files and folders by content.
//!
//! File names decide only where content cannot: `.toml` for a description without a known table, `.sigmf-data` and samples of the Gotcha GMTI
//! challenge (without a header), `.hgt` and `.sbet`. Recognition reads the first bytes only; the format's reader detects damage.

use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde::de::IgnoredAny;
use subaperture_io::gotcha_gmti;
use subaperture_io::input::open_file;
use subaperture_io::json::{self, Limits};

/// Leading bytes of a file examined for its format.
const HEAD_BYTES: u64 = 64 << 10;
/// Bounds on JSON text whose first keys are examined. Plans and captures may be long.
const JSON_LIMITS: Limits = Limits {
    bytes: 256 << 20,
    string_bytes: 4 << 20,
    value_bytes: 0,
};
/// Maximum length of TOML text whose tables are examined, bytes.
const MAX_TOML_BYTES: u64 = 8 << 20;
/// Posts along a side of HGT tiles; a post has two bytes.
const HGT_SIDES: [u64; 2] = [1201, 3601];
/// Length of an SBET record, bytes.
const SBET_BYTES: u64 = 136;

/// Kind of a file or folder.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum FileKind {
    /// Phase history or raw echoes readable by [`crate::open()`]: CPHD, CRSD, NISAR L0B, GOTCHA, Gotcha GMTI challenge, arrays, or a TOML description.
    Recording,
    /// Image of any format supported by the module `images`.
    Image,
    /// Range-Doppler maps of the embedded module.
    Maps,
    /// Radio capture (SigMF).
    Capture,
    /// Image plan.
    Plan,
    /// JSON written by Subaperture, with its schema.
    Record(String),
    /// GeoJSON, including STAC items.
    GeoJson,
    /// Simulator scenario (TOML).
    Scenario,
    /// Radio experiment (TOML).
    Experiment,
    /// Processing pipeline as TOML.
    Job,
    /// Folder of a pipeline that has run.
    JobFolder,
    /// Track as comma-separated values.
    Track,
    /// Phases of pulses, comma-separated.
    Phases,
    /// Motion capture, comma-separated (OptiTrack Motive).
    MotionCapture,
    /// Log of a navigation receiver.
    Navigation,
    /// Elevation model (HGT).
    Elevation,
    /// Picture in PNG format.
    Picture,
    /// Google Earth archive (KMZ).
    Kmz,
    /// HTML or Markdown written by Subaperture.
    Report,
    /// Folder without any recognised content.
    Folder,
    /// Unknown format, missing file or unreadable file.
    Unknown,
}

/// Recognise the file or folder at a path.
pub fn recognise(path: &Path) -> FileKind {
    if path.is_dir() {
        let holds = |name: &str| path.join(name).exists();
        return match () {
            () if ["image.json", "image.zarr", "zarr.json"]
                .iter()
                .any(|n| holds(n)) =>
            {
                FileKind::Image
            }
            () if holds("job.json") => FileKind::JobFolder,
            () => FileKind::Folder,
        };
    }
    if capture_of(path).is_some() {
        return FileKind::Capture;
    }
    if !path.is_file() {
        // `FOLDER:N` names one image of a stack. A pipe can be read only once, so it is left to the reader of recordings.
        let stack = path.to_str().and_then(|text| text.rsplit_once(':'));
        return match stack {
            Some((folder, number))
                if number.parse::<usize>().is_ok()
                    && Path::new(folder).join("zarr.json").is_file() =>
            {
                FileKind::Image
            }
            _ => FileKind::Unknown,
        };
    }
    let mut head = Vec::new();
    let read = open_file(path).and_then(|file| file.take(HEAD_BYTES).read_to_end(&mut head));
    match read {
        Ok(_) => of_bytes(path, &head),
        Err(_) => FileKind::Unknown,
    }
}

/// Metadata file of the capture to which a path belongs. The path is one of the capture's files or its name without extension.
pub fn capture_of(path: &Path) -> Option<PathBuf> {
    let ending = path.extension().and_then(|ending| ending.to_str());
    let meta = match ending {
        Some("sigmf-meta" | "sigmf-data" | "sigmf-journal") => path.with_extension("sigmf-meta"),
        _ => {
            let mut name = path.file_name()?.to_owned();
            name.push(".sigmf-meta");
            path.with_file_name(name)
        }
    };
    meta.is_file().then_some(meta)
}

fn of_bytes(path: &Path, head: &[u8]) -> FileKind {
    let begins = |magic: &[u8]| head.starts_with(magic);
    let ending = path.extension().and_then(|ending| ending.to_str());
    let is = |wanted: &str| ending.is_some_and(|ending| ending.eq_ignore_ascii_case(wanted));
    let images: [&[u8]; 7] = [
        b"\x93NUMPY",
        b"NITF",
        b"NSIF",
        b"II*\0",
        b"MM\0*",
        b"II+\0",
        b"MM\0+",
    ];
    match () {
        () if images.iter().any(|magic| begins(magic)) => FileKind::Image,
        () if path.file_name().is_some_and(|name| name == "image.json") => FileKind::Image,
        () if begins(b"SUBAPMAP") => FileKind::Maps,
        () if begins(b"\x89PNG") => FileKind::Picture,
        // The name of an archive's first entry is at byte 30.
        () if begins(b"PK\x03\x04") && head[30.min(head.len())..].starts_with(b"doc.kml") => {
            FileKind::Kmz
        }
        () if begins(b"CPHD/") || begins(b"CRSD") || begins(b"MATLAB 5") => FileKind::Recording,
        () if begins(b"PK\x03\x04") || begins(b"\x89HDF\r\n\x1a\n") => FileKind::Recording,
        () if gotcha_gmti::Files::of(path).is_some() => FileKind::Recording,
        () if begins(&[0xaa, 0x44, 0x12]) || begins(&[0xaa, 0x44, 0x13]) => FileKind::Navigation,
        () if is("hgt") && is_hgt(path) => FileKind::Elevation,
        () if is_binary(head) => match bytes_of(path) {
            Some(bytes) if is("sbet") || (is("out") && bytes % SBET_BYTES == 0) => {
                FileKind::Navigation
            }
            _ => FileKind::Unknown,
        },
        () => of_text(path, head, is("toml")),
    }
}

fn bytes_of(path: &Path) -> Option<u64> {
    Some(std::fs::metadata(path).ok()?.len())
}

fn is_hgt(path: &Path) -> bool {
    let bytes = bytes_of(path);
    let squares = HGT_SIDES.map(|side| Some(2 * side * side));
    squares.contains(&bytes)
}

/// Whether the bytes include any that do not occur in text.
fn is_binary(head: &[u8]) -> bool {
    head.contains(&0) || std::str::from_utf8(head).is_err_and(|error| error.error_len().is_some())
}

fn of_text(path: &Path, head: &[u8], toml: bool) -> FileKind {
    let text = String::from_utf8_lossy(head);
    let text = text.trim_start_matches('\u{feff}');
    let start = text.trim_start();
    if start.starts_with(['{', '[']) && !toml && !start.starts_with("[[") {
        return of_json(path);
    }
    let first = text.lines().next().unwrap_or_default();
    if first.contains("written by subap") && (first.starts_with("<!") || first.starts_with("<!--"))
    {
        return FileKind::Report;
    }
    if toml {
        return of_toml(path);
    }
    // The first line that is not a comment names the columns.
    let lines = || text.lines().map(str::trim);
    let columns = lines().find(|line| !line.is_empty() && !line.starts_with('#'));
    let columns: Vec<&str> = columns
        .unwrap_or_default()
        .split(',')
        .map(str::trim)
        .collect();
    if columns == ["pulse", "phase_rad"] {
        return FileKind::Phases;
    }
    if columns[0] == "Format Version" {
        return FileKind::MotionCapture;
    }
    let track = ["time_s", "x_m", "y_m", "z_m"];
    if track.iter().all(|name| columns.contains(name)) {
        return FileKind::Track;
    }
    // NMEA sentences, NovAtel records, or a header with units.
    let sentence = |line: &str| {
        let mark = line.starts_with(['$', '!', '#', '%', '<', '[']);
        let name: String = line
            .chars()
            .skip(1)
            .take_while(char::is_ascii_alphanumeric)
            .collect();
        mark && name.len() >= 5
            && name
                .chars()
                .all(|c| c.is_ascii_uppercase() || c.is_ascii_digit())
    };
    if lines().take(20).any(sentence) || is_log_header(&columns) {
        return FileKind::Navigation;
    }
    FileKind::Unknown
}

/// Whether the columns include a time and a position with units, as in comma-separated navigation logs.
fn is_log_header(columns: &[&str]) -> bool {
    let has = |words: &[&str]| {
        columns.iter().any(|column| {
            let column = column.to_ascii_lowercase();
            words.iter().any(|word| column.contains(word))
        })
    };
    columns.len() >= 3
        && has(&["time", "week", "utc", "gps", "seconds"])
        && has(&["lat", "east", "x_m", "x (m)", "x[m]"])
}

/// Keys of a JSON text that decide its kind. All other keys are skipped without being stored.
#[derive(Deserialize)]
struct Keys {
    schema: Option<String>,
    #[serde(rename = "type")]
    kind: Option<String>,
    global: Option<IgnoredAny>,
}

fn of_json(path: &Path) -> FileKind {
    let Ok(file) = open_file(path) else {
        return FileKind::Unknown;
    };
    let keys: Result<Keys, _> = json::typed(file, JSON_LIMITS);
    let Ok(keys) = keys else {
        return FileKind::Unknown;
    };
    let schema = keys.schema.unwrap_or_default();
    let kind = keys.kind.unwrap_or_default();
    match () {
        () if keys.global.is_some() => FileKind::Capture,
        () if schema.starts_with("subaperture-plan") => FileKind::Plan,
        () if kind == "FeatureCollection" || kind == "Feature" => FileKind::GeoJson,
        () if schema.starts_with("subaperture-") => FileKind::Record(schema),
        () => FileKind::Unknown,
    }
}

/// Recognise TOML by its tables. Text without a deciding table is left to the reader of recordings, whose error states the expected tables.
fn of_toml(path: &Path) -> FileKind {
    let Ok(file) = open_file(path) else {
        return FileKind::Unknown;
    };
    // Tables that decide, in this order.
    const DECIDING: [&str; 7] = [
        "recording",
        "plan",
        "device",
        "input",
        "radar",
        "platform",
        "scene",
    ];
    let mut found = [false; DECIDING.len()];
    let lines = BufReader::new(file.take(MAX_TOML_BYTES)).lines();
    for line in lines.map_while(Result::ok) {
        let line = line.trim();
        if let Some(name) = line.strip_prefix('[') {
            let name = name.trim_start_matches('[').trim_start();
            let end = name.find([']', '.', ' ']).unwrap_or(name.len());
            if let Some(place) = DECIDING.iter().position(|table| *table == &name[..end]) {
                found[place] = true;
            }
        }
    }
    let has = |name: &str| {
        DECIDING
            .iter()
            .zip(found)
            .any(|(table, found)| found && *table == name)
    };
    match () {
        () if has("recording") => FileKind::Recording,
        () if has("plan") || has("device") => FileKind::Experiment,
        () if has("input") => FileKind::Job,
        () if has("radar") || has("platform") || has("scene") => FileKind::Scenario,
        () => FileKind::Recording,
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn content_and_not_the_name_decides_the_kind() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        for (name, content, expected) in [
            ("a.bin", &b"CPHD/1.1.0\n"[..], FileKind::Recording),
            ("a.txt", b"CRSD/1.0.0\n", FileKind::Recording),
            ("b.dat", b"\x93NUMPY\x01\x00", FileKind::Image),
            ("c.cphd", b"NITF02.10", FileKind::Image),
            ("d.npy", b"SUBAPMAP....", FileKind::Maps),
            ("e.json", b"\x89PNG\r\n", FileKind::Picture),
            (
                "f.txt",
                b"{\"schema\":\"subaperture-plan\"}",
                FileKind::Plan,
            ),
            (
                "g.txt",
                b" {\"schema\":\"subaperture-tune\"}",
                FileKind::Record("subaperture-tune".to_owned()),
            ),
            ("h.txt", b"{\"type\":\"Feature\"}", FileKind::GeoJson),
            (
                "i.txt",
                b"{\"global\":{\"core:datatype\":\"ci16_le\"}}",
                FileKind::Capture,
            ),
            ("j.toml", b"[recording]\n", FileKind::Recording),
            ("k.toml", b"name=\"x\"\n[plan]\n", FileKind::Experiment),
            ("l.toml", b"[input]\n", FileKind::Job),
            ("m.toml", b"[[scene.point]]\n[radar]\n", FileKind::Scenario),
            (
                "n.txt",
                b"# written by subap\ntime_s,x_m,y_m,z_m\n0,0,0,0\n",
                FileKind::Track,
            ),
            ("o.txt", b"pulse,phase_rad\n0,0\n", FileKind::Phases),
            (
                "p.txt",
                b"Format Version,1.23,Take Name,walk\n",
                FileKind::MotionCapture,
            ),
            ("q.txt", b"$GPGGA,120000,4807.038,N\n", FileKind::Navigation),
            ("r.txt", b"#INSPVAXA,COM1,0,0\n", FileKind::Navigation),
            ("s.txt", b"a,b,c\n1,2,3\n", FileKind::Unknown),
            ("t.txt", b"", FileKind::Unknown),
            ("a_chan1_b_PH", b"\x00\x01", FileKind::Recording),
            ("a_chan1_b_PHX", b"\x00\x01", FileKind::Unknown),
        ] {
            fs::write(at.join(name), content).unwrap();
            assert_eq!(recognise(&at.join(name)), expected, "{name}");
        }
        assert_eq!(recognise(&at.join("missing")), FileKind::Unknown);
        assert_eq!(recognise(at), FileKind::Folder);
    }
}
