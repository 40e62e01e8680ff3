//! Files that claim more than they contain: each command names the fault, within its memory.

use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::Path;

use serde_json::{Value, json};
use subaperture_tests::subap::run;

use crate::memory::measured;

const MIB: u32 = 64;

/// Commands that read an image's folder `it`.
const READERS: [&str; 8] = [
    "info it",
    "compare it it",
    "picture it -o it.png",
    "quality it",
    "export it -o it.tif",
    "export it -o it.kmz",
    "export it -o it.nitf",
    "export it it -o it.zarr",
];

/// Run `line`; it must be refused with a word of `parts`, or succeed, within its memory.
#[track_caller]
fn bounded(at: &Path, line: &str, parts: &[&str]) {
    let ran = measured(at, line, MIB);
    match ran.code {
        Some(0) => {}
        Some(1) => assert!(
            parts.iter().any(|part| ran.stderr.contains(part)),
            "{line}: {ran:?}"
        ),
        _ => panic!("{line}: {ran:?}"),
    }
    assert!(!ran.stderr.contains("panicked"), "{line}: {ran:?}");
    assert!(ran.peak_mib <= f64::from(MIB), "{line}: {ran:?}");
}

/// An image in tiles whose description and record state `side` x `side` pixels in tiles of `tile` x `tile`; one tile has a file.
fn claimed(at: &Path, side: u64, tile: u64) {
    let folder = at.join("it");
    let _ = fs::remove_dir_all(&folder);
    run(
        at,
        "focus table.cphd -a bp --grid x=-6:6:0.1,y=-5:5:0.1 --tiled -o it",
    )
    .succeeded();
    let edit = |name: &str, edit: &dyn Fn(&mut Value)| {
        let path = folder.join(name);
        let mut value: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
        edit(&mut value);
        fs::write(&path, value.to_string()).unwrap();
    };
    edit("image.zarr/zarr.json", &|array| {
        array["shape"] = json!([side, side]);
        array["chunk_grid"]["configuration"]["chunk_shape"] = json!([tile, tile]);
    });
    edit("image.json", &|record| {
        record["grid"]["rows"]["count"] = side.into();
        record["grid"]["columns"]["count"] = side.into();
    });
    let bytes = 8 * tile * tile;
    File::create(folder.join("image.zarr/c/0/0"))
        .unwrap()
        .set_len(bytes)
        .unwrap();
    // The mark has the CRC-32 of these zeros, so that the tile is valid.
    if bytes < 1 << 30 {
        let crc32 = crc32fast::hash(&vec![0; bytes as usize]);
        edit("image.zarr/done/0.0.json", &|mark| {
            mark["crc32"] = format!("{crc32:08x}").into();
        });
    }
}

#[test]
fn claimed_sizes_of_image_folder_take_no_memory() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    run(at, "simulate --preset table-4-1 -o table.cphd").succeeded();
    for (side, tile) in [
        (30_000, 1),
        (1_000_000_000, 1),
        (1_000_000_000, 2000),
        (1_000_000_000, 40_000),
        (1_000_000_000_000, 1),
    ] {
        claimed(at, side, tile);
        for line in READERS {
            bounded(
                at,
                line,
                &["zarr", "image.json", "grid", "degrees", "NITF", "bytes"],
            );
        }
    }
}

/// An array of one row with as many samples as the sparse file has room for.
#[test]
fn row_longer_than_memory_is_read_in_parts() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let header = "{'descr': '<c8', 'fortran_order': False, 'shape': (1, 33554432), }";
    let mut file = File::create(at.join("row.npy")).unwrap();
    file.write_all(b"\x93NUMPY\x01\x00\x76\x00").unwrap();
    writeln!(file, "{header:<117}").unwrap();
    file.set_len(128 + 8 * 33_554_432).unwrap();
    drop(file);
    for line in [
        "info row.npy",
        "compare row.npy row.npy",
        "picture row.npy -o row.png",
        "quality row.npy",
    ] {
        bounded(at, line, &["zero", "no pixel", "nothing"]);
    }
}

/// JSON of `count` small values, some hundred megabytes, which would take gigabytes as a tree.
fn much_json(path: &Path, begin: &str, element: &str, count: usize) {
    let mut file = BufWriter::new(File::create(path).unwrap());
    write!(file, "{begin}[").unwrap();
    for _ in 0..count {
        file.write_all(element.as_bytes()).unwrap();
    }
    write!(file, "0]}}").unwrap();
    file.flush().unwrap();
}

#[test]
fn json_beyond_memory_is_refused_within_budget() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    run(at, "simulate --preset table-4-1 -o table.cphd").succeeded();
    let too_much = ["expected JSON", "expected at most", "more than"];
    fs::create_dir(at.join("it")).unwrap();
    much_json(&at.join("it/image.json"), "{\"grid\":", "{},", 30_000_000);
    for line in READERS.into_iter().chain(["view it"]) {
        bounded(at, line, &too_much);
    }
    // The same file in place of every other JSON input.
    fs::rename(at.join("it/image.json"), at.join("much.json")).unwrap();
    let image = "--grid x=-2:2:0.5,y=-2:2:0.5 -o out --force";
    run(at, &format!("focus table.cphd {image}")).succeeded();
    for line in [
        "focus table.cphd --plan much.json -o planned",
        &format!("focus table.cphd --model much.json {image}"),
        "plan focus table.cphd --model much.json -o plan.json",
        "view out --layer much.json",
        "profile much.sigmf-meta",
        "radio calibrate --sky much --reflector much --range 3 -o c.json",
        "radio convert much --track much.json --reference 0,4 -o c.cphd",
        "info much.sigmf-meta",
    ] {
        if line.contains("much ") || line.contains("sigmf") {
            let _ = fs::hard_link(at.join("much.json"), at.join("much.sigmf-meta"));
            fs::write(at.join("much.sigmf-data"), [0; 64]).unwrap();
        }
        let ran = measured(at, line, MIB);
        assert!(ran.code == Some(1), "{line}: {ran:?}");
        assert!(ran.peak_mib <= f64::from(MIB), "{line}: {ran:?}");
    }
    // An unterminated string, and nested lists.
    for text in [
        format!("{{\"schema\":\"{}\"}}", "x".repeat(80 << 20)),
        "[".repeat(10 << 20),
    ] {
        fs::write(at.join("plan.json"), text).unwrap();
        let ran = measured(at, "focus table.cphd --plan plan.json -o planned", MIB);
        assert_eq!(ran.code, Some(1), "{ran:?}");
        assert!(ran.peak_mib <= f64::from(MIB), "{ran:?}");
    }
}
