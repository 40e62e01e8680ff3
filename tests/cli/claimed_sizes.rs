//! Small files that claim huge sizes: every command that opens one ends with an error, within its memory and a limit on the address space.

use std::fs::{self, File};
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use serde_json::json;
use subaperture_tests::subap::{command, write_recording};

use crate::memory::{self, peak_of};

/// `--memory` and the limit on the address space, MiB. Only the latter counts memory that is reserved but never touched.
const MIB: u32 = 64;
const SPACE_MIB: u32 = 1024;

/// Commands that open a recording, an image, and a surface.
const RECORDING: [&str; 7] = [
    "info X",
    "focus X -o o",
    "crosscheck X",
    "track X -o o.csv",
    "gmti X -o o.geojson",
    "velocity X --at 1,2 --vx=-1:1:1 --vy=-1:1:1 --out o",
    "plan focus X -o o.json",
];
const IMAGE: [&str; 7] = [
    "info X",
    "compare X X",
    "pair X X -o o",
    "picture X -o o.png",
    "quality X",
    "export X -o o.tif",
    "export X X -o o.zarr",
];
const SURFACE: [&str; 1] = ["focus few.cphd --surface dem:X -o o"];

/// Header of a NumPy file with this shape, and few bytes after it.
fn npy(dtype: &str, shape: &str) -> Vec<u8> {
    let header = format!("{{'descr': '{dtype}', 'fortran_order': False, 'shape': {shape}, }}");
    let mut bytes = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    writeln!(bytes, "{header:<117}").unwrap();
    bytes.extend([0; 64]);
    bytes
}

fn npz(arrays: &[(&str, Vec<u8>)]) -> Vec<u8> {
    // Stored, with a local and a central header for each; lengths are correct, shapes are not.
    let (mut file, mut directory) = (Vec::new(), Vec::new());
    for (name, bytes) in arrays {
        let (at, name) = (file.len() as u32, format!("{name}.npy"));
        let mut entry = vec![20, 0, 0, 0, 0, 0, 0, 0, 0, 0];
        entry.extend(crc32fast::hash(bytes).to_le_bytes());
        entry.extend((bytes.len() as u32).to_le_bytes());
        entry.extend((bytes.len() as u32).to_le_bytes());
        entry.extend((name.len() as u16).to_le_bytes());
        entry.extend([0, 0]);
        file.extend(b"PK\x03\x04");
        file.extend(&entry);
        file.extend(name.as_bytes());
        file.extend(bytes);
        directory.extend(b"PK\x01\x02\x14\x00");
        directory.extend(&entry);
        directory.extend([0; 10]);
        directory.extend(at.to_le_bytes());
        directory.extend(name.as_bytes());
    }
    let (at, count) = (file.len() as u32, arrays.len() as u16);
    file.extend(&directory);
    file.extend(b"PK\x05\x06\0\0\0\0");
    file.extend(count.to_le_bytes());
    file.extend(count.to_le_bytes());
    file.extend((directory.len() as u32).to_le_bytes());
    file.extend(at.to_le_bytes());
    file.extend([0, 0]);
    file
}

fn png() -> Vec<u8> {
    let chunk = |kind: &[u8; 4], data: &[u8]| {
        let all = [&kind[..], data].concat();
        let length = (data.len() as u32).to_be_bytes();
        [&length[..], &all, &crc32fast::hash(&all).to_be_bytes()].concat()
    };
    let side = i32::MAX.to_be_bytes();
    let header = [&side[..], &side, &[8, 6, 0, 0, 0]].concat();
    let mut packed = ZlibEncoder::new(Vec::new(), Compression::fast());
    packed.write_all(&[0; 100]).unwrap();
    let data = packed.finish().unwrap();
    let chunks = [
        chunk(b"IHDR", &header),
        chunk(b"IDAT", &data),
        chunk(b"IEND", &[]),
    ];
    [b"\x89PNG\r\n\x1a\n", &chunks.concat()[..]].concat()
}

/// A TIFF with 32-bit floats and these further tags.
fn tiff(side: u32, tags: &[(u16, u32, u32)]) -> Vec<u8> {
    let mut all = vec![
        (256, 1, side),
        (257, 1, side),
        (258, 1, 32),
        (259, 1, 1),
        (262, 1, 1),
    ];
    all.extend([(277, 1, 1), (339, 1, 3)]);
    all.extend(tags);
    all.sort_unstable();
    let mut file = b"II*\0\x08\0\0\0".to_vec();
    file.extend((all.len() as u16).to_le_bytes());
    for (tag, count, value) in all {
        // Type 4: 32 bits.
        file.extend(tag.to_le_bytes());
        file.extend(4u16.to_le_bytes());
        file.extend(count.to_le_bytes());
        file.extend(value.to_le_bytes());
    }
    file.extend([0; 68]);
    file
}

/// A MATLAB 5 file with these bytes after its header.
fn matlab(rest: &[u8]) -> Vec<u8> {
    let mut file = format!("{:<124}", "MATLAB 5.0 MAT-file").into_bytes();
    file.extend([0, 1, b'I', b'M']);
    file.extend(rest);
    file.extend([0; 64]);
    file
}

fn words(words: &[u32]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

/// An array of `data` with a side of 2^31 - 1, in an element that ends at the end of the file.
fn matlab_array() -> Vec<u8> {
    let side = i32::MAX as u32;
    let array = [
        words(&[6, 8, 2, 0, 5, 16, side, side, side, side, 1, 4]),
        b"data\0\0\0\0".to_vec(),
        words(&[9, 8, 0, 0]),
    ]
    .concat();
    matlab(&[words(&[14, array.len() as u32]), array].concat())
}

fn matlab_packed() -> Vec<u8> {
    let mut packed = ZlibEncoder::new(Vec::new(), Compression::best());
    packed
        .write_all(&words(&[14, 0xffff_fff0, 6, 8, 2, 0]))
        .unwrap();
    packed.write_all(&[0; 1 << 20]).unwrap();
    let packed = packed.finish().unwrap();
    matlab(&[words(&[15, packed.len() as u32]), packed].concat())
}

/// Files by name, and the commands that open them.
fn files() -> Vec<(&'static str, Vec<u8>, Vec<&'static str>)> {
    let (recording, image, surface) = (RECORDING.to_vec(), IMAGE.to_vec(), SURFACE.to_vec());
    let long = "(1099511627776,)";
    let vectors = || npy("<f8", "(1099511627776, 3)");
    let history = npz(&[
        ("samples", npy("<c8", "(1099511627776, 1048576)")),
        ("frequencies_hz", npy("<f8", long)),
        ("transmitter_m", vectors()),
        ("receiver_m", vectors()),
    ]);
    let most = i32::MAX as u32;
    let strips = [(273, most / 2, 8), (278, 1, 1), (279, most / 2, 8)];
    let tiles = [
        (322, 1, 1 << 30),
        (323, 1, 1 << 30),
        (324, 1, 8),
        (325, 1, u32::MAX),
    ];
    let strip = [(273, 1, 8), (278, 1, most), (279, 1, u32::MAX)];
    let text = [
        (273, 1, 8),
        (278, 1, 1000),
        (279, 1, 4_000_000),
        (42112, 0x0fff_ffff, 100),
    ];
    let hdf5 = [
        b"\x89HDF\r\n\x1a\n\0\0\0\0\0\x08\x08\0\x04\0\x10\0\0\0\0\0".to_vec(),
        words(&[0, 0, u32::MAX, u32::MAX, 0, 1 << 28, u32::MAX, u32::MAX]),
        vec![0xff; 200],
    ]
    .concat();
    let cphd = "CPHD/1.1.0\nXML_BLOCK_SIZE := 9000000000000000000\nXML_BLOCK_BYTE_OFFSET := 400\n\
                PVP_BLOCK_SIZE := 9000000000000000000\nPVP_BLOCK_BYTE_OFFSET := 9000000000000000000\n\
                SIGNAL_BLOCK_SIZE := 9000000000000000000\nSIGNAL_BLOCK_BYTE_OFFSET := 9000000000000000000\n\x0c\n";
    let crsd = cphd
        .replace("CPHD/1.1.0", "CRSDsar/1.0.0")
        .replace("PVP_BLOCK", "PPP_BLOCK");
    let nines = |count| [b"NITF02.10".to_vec(), vec![b'9'; count]].concat();
    let capture = json!({
        "global": { "core:datatype": "cf32_le", "core:sample_rate": 1e6, "core:version": "1.0.0", "core:num_channels": 1_000_000_000_u64 },
        "captures": [{ "core:sample_start": 0, "core:frequency": 1e9 }],
        "annotations": [{ "core:sample_start": 0, "core:sample_count": 1_000_000_000_000_000_000_u64 }]
    });
    let mut job =
        "[input]\nfiles = \"few.cphd\"\n[grid]\npixels = \"x=0:1e9:1,y=0:1e9:1\"\n".to_owned();
    job += "[former]\nalgorithm = \"bp\"\nerror = \"-50 dB\"\n[products]\nformats = [\"png\"]\n";
    let raw = "[recording]\nformat = \"int16\"\nfile = \"zeros\"\n[radar]\nkind = \"stepped\"\nstart = \"9 GHz\"\nstep = \"1 kHz\"\n\
               samples = 1000000000000\npulses = 1000000000000\n[platform]\nkind = \"linear\"\nposition = \"0, -900, 400 m\"\n\
               velocity = \"20, 0, 0 m/s\"\n";
    vec![
        (
            "a.npy",
            npy("<c8", "(1073741824, 1073741824)"),
            image.clone(),
        ),
        (
            "b.npy",
            npy("<c8", "(4611686018427387904, 8)"),
            image.clone(),
        ),
        (
            "c.npy",
            b"\x93NUMPY\x02\x00\xf0\xff\xff\xff{".to_vec(),
            image.clone(),
        ),
        ("a.npz", history, recording.clone()),
        ("a.h5", hdf5, recording.clone()),
        (
            "a.mat",
            matlab(&words(&[14, 0xffff_fff0])),
            recording.clone(),
        ),
        ("b.mat", matlab_array(), recording.clone()),
        ("c.mat", matlab_packed(), recording.clone()),
        ("a.cphd", cphd.into(), recording.clone()),
        ("a.crsd", crsd.into(), recording.clone()),
        ("raw.toml", raw.into(), recording.clone()),
        ("a.nitf", nines(400), image.clone()),
        ("b.nitf", nines(4000), image.clone()),
        ("a.tif", tiff(most, &strip), [&image[..], &surface].concat()),
        (
            "b.tif",
            tiff(most, &strips),
            [&image[..], &surface].concat(),
        ),
        (
            "c.tif",
            tiff(100_000, &tiles),
            [&image[..], &surface].concat(),
        ),
        ("d.tif", tiff(1000, &text), [&image[..], &surface].concat()),
        ("N52E004.hgt", vec![0; 64], surface),
        ("scene.png", png(), vec!["simulate picture.toml -o o.cphd"]),
        (
            "a.sigmf-meta",
            capture.to_string().into(),
            vec!["info X", "profile X"],
        ),
        ("job.toml", job.into(), vec!["run X"]),
        (
            "a.maps",
            [b"SUBAPMAP".to_vec(), vec![0xff; 200]].concat(),
            vec!["info X", "focus --from-maps X -o o"],
        ),
        ("a.sbet", vec![0xff; 4 * 136 + 1], vec!["navigation X"]),
        (
            "a.csv",
            b"time_s,x_m,y_m,z_m\n1e308,1e308,1e308,1e308\n".to_vec(),
            vec!["focus few.cphd --track X -o o"],
        ),
    ]
}

/// Runs `line` under both limits: status, standard error and peak, MiB.
fn limited(at: &Path, line: &str) -> (Option<i32>, String, f64) {
    let program = command(at, [""; 0]).get_program().to_owned();
    let script = format!(
        "ulimit -v {}; exec \"$0\" {line} --threads 2 --memory {MIB}M -q",
        u64::from(SPACE_MIB) * 1024
    );
    let mut child = Command::new("sh")
        .args(["-c", &script])
        .arg(program)
        .current_dir(at)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut peak_mib = 0.0f64;
    while child.try_wait().unwrap().is_none() {
        peak_mib = peak_mib.max(peak_of(child.id()).unwrap_or(0.0));
        sleep(Duration::from_millis(2));
    }
    let output = child.wait_with_output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    (output.status.code(), stderr, peak_mib)
}

#[test]
fn claimed_sizes_are_refused_within_memory_and_address_space() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    write_recording(at, "few", memory::SCENARIO);
    let picture = "\n[[scene.clutter]]\nkind = \"picture\"\nfile = \"scene.png\"\nx = \"-30, 30 m\"\ny = \"-30, 30 m\"\nsigma0 = \"-20 dB\"\ncount = 100\n";
    fs::write(
        at.join("picture.toml"),
        format!("{}{picture}", memory::SCENARIO),
    )
    .unwrap();
    fs::write(at.join("a.sigmf-data"), [0; 64]).unwrap();
    File::create(at.join("zeros")).unwrap().set_len(64).unwrap();
    let mut wrong = Vec::new();
    for (name, bytes, lines) in files() {
        assert!(bytes.len() < 64 << 10, "{name}");
        fs::write(at.join(name), bytes).unwrap();
        for line in lines {
            let line = line.replace('X', name);
            let (code, stderr, peak_mib) = limited(at, &line);
            println!("{code:?} {peak_mib:.1} MiB: {line}: {stderr}");
            let sound = code == Some(1) && !stderr.contains("panicked");
            if !sound || peak_mib > f64::from(MIB) {
                wrong.push(format!("{line}: {code:?}, {peak_mib} MiB: {stderr}"));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert!(!at.join("o").exists() && !at.join("o.cphd").exists());
}
