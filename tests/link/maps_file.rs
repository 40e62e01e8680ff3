//! Maps files: values are stored bit by bit, and damage never goes unnoticed.

use std::path::Path;

use glam::DVec3;
use num_complex::Complex32;
use serde_json::{Map, json};
use subaperture::geometry::SceneFrame;
use subaperture::module::maps::{Arithmetic, Maps, OwnedMap, OwnedSamples, Run, RunTotals};
use subaperture::module::maps_file::{MapFile, MapWriter};
use subaperture_core::Sc16;
use subaperture_core::stream::{BlockFloat, MapHeader, Node, Patch, Setup};
use subaperture_tests::tiny_disk::TinyDisk;

fn object(value: serde_json::Value) -> Map<String, serde_json::Value> {
    value.as_object().unwrap().clone()
}

fn run(arithmetic: Arithmetic) -> Run {
    Run {
        name: "a run \u{2713}".to_owned(),
        setup: Setup {
            num_pulses: 5,
            num_channels: 1,
            num_frequencies: 3,
            range_length: 128,
            doppler_length: 11,
            start_hz: 9.288_080_384e9,
            step_hz: 1.471_301e6,
        },
        arithmetic,
        fast_window: "taylor:35".to_owned(),
        fast_weights: vec![0.3, 0.4, 0.3],
        frame: SceneFrame::Earth {
            origin_ecf_m: DVec3::new(1.0, 6.378e6, 0.1),
            x_axis_ecf: DVec3::NEG_X,
            y_axis_ecf: DVec3::Z,
        },
        provenance: object(json!({ "module": "bench", "firmware": [1, 2, 3] })),
    }
}

fn closing() -> RunTotals {
    RunTotals {
        num_pulses: 15,
        weight_sum: 14.25,
        counters: object(json!({ "saturated": 2 })),
    }
}

/// Two patches of different sizes, three sub-CPIs, arbitrary bit patterns.
fn maps(arithmetic: Arithmetic) -> Vec<OwnedMap> {
    let patches = [(1, 1), (33, 0)].map(|(range_reach, doppler_reach)| Patch {
        centre_m: [0.1 * f64::from(range_reach), -7.3, 1e-300],
        range_reach,
        doppler_reach,
    });
    let mut maps = Vec::new();
    for sub_cpi in [0, 1, 70_000] {
        for (patch_index, patch) in (0..).zip(patches) {
            let place = f64::from(sub_cpi) + 0.123_456_789;
            let node = Node {
                transmitter_m: [place, 2.0 / 3.0, -1.0],
                receiver_m: [place, 1.0 / 3.0, 1.0],
            };
            let count = patch.map_len() as u32;
            let samples = match arithmetic {
                Arithmetic::Float => OwnedSamples::Float(
                    (0..count)
                        .map(|i| Complex32::new(f32::from_bits(i * 7919), -(i as f32)))
                        .collect(),
                ),
                Arithmetic::Fixed => OwnedSamples::Fixed {
                    mantissas: (0..count as i16)
                        .map(|i| Sc16::from_bits(i.wrapping_mul(3001), i16::MIN + i))
                        .collect(),
                    exponents: (0..patch.num_doppler_bins()
                        * BlockFloat::blocks(patch.num_range_bins()))
                        .map(|i| i8::MIN + i as i8 * 50)
                        .collect(),
                },
            };
            maps.push(OwnedMap {
                header: MapHeader {
                    sub_cpi,
                    patch_index,
                    channel: 0,
                    num_pulses: 4 + patch_index,
                    patch,
                    time_s: [place, place + 0.1],
                    weight_sum: 4.75,
                    nodes: [
                        node,
                        Node {
                            receiver_m: [0.0; 3],
                            ..node
                        },
                    ],
                },
                samples,
            });
        }
    }
    maps
}

fn write(path: &Path, arithmetic: Arithmetic, maps: &[OwnedMap]) {
    let mut writer = MapWriter::create(path, &run(arithmetic)).unwrap();
    maps.iter()
        .for_each(|map| writer.append(&map.view()).unwrap());
    assert_eq!(writer.num_maps(), maps.len());
    writer.finish(&closing()).unwrap();
}

#[test]
fn maps_round_trip_through_file() {
    let folder = tempfile::tempdir().unwrap();
    for arithmetic in [Arithmetic::Float, Arithmetic::Fixed] {
        let path = folder.path().join("a.maps");
        let maps = maps(arithmetic);
        write(&path, arithmetic, &maps);
        let file = MapFile::open(&path).unwrap();
        assert!(file.is_complete());
        assert_eq!(file.run(), &run(arithmetic));
        assert_eq!(file.closing(), Some(&closing()));
        assert_eq!(file.headers().len(), maps.len());
        // Any map can be read without the others.
        for index in [4, 0, 5, 1, 3, 2] {
            assert_eq!(file.read(index).unwrap(), maps[index]);
        }
        let input = file.input().unwrap();
        let bytes = std::fs::read(&path).unwrap();
        assert_eq!(input.bytes, bytes.len() as u64);
        assert_eq!(
            input.identity.text(),
            format!("{:08x}", crc32fast::hash(&bytes))
        );
    }
    // A file without maps is valid.
    let path = folder.path().join("none.maps");
    write(&path, Arithmetic::Float, &[]);
    assert!(MapFile::open(&path).unwrap().headers().is_empty());
}

/// Open a file and read everything. Panics if a value differs from the written one. Returns the number of maps and whether
/// the file is complete, or the error.
fn examine(path: &Path, maps: &[OwnedMap]) -> Result<(usize, bool), String> {
    let file = MapFile::open(path).map_err(|error| error.to_string())?;
    assert_eq!(file.run(), &run(Arithmetic::Fixed));
    if let Some(found) = file.closing() {
        assert_eq!(found, &closing());
        assert_eq!(file.headers().len(), maps.len());
    }
    for (index, header) in file.headers().iter().enumerate() {
        assert_eq!(*header, maps[index].header);
        let map = file.read(index).map_err(|error| error.to_string())?;
        assert_eq!(map, maps[index]);
    }
    Ok((file.headers().len(), file.is_complete()))
}

#[test]
fn every_damaged_byte_is_detected_or_harmless() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.maps");
    let maps = maps(Arithmetic::Fixed);
    write(&path, Arithmetic::Fixed, &maps);
    let whole = std::fs::read(&path).unwrap();
    let mut harmless = 0;
    for place in 0..whole.len() {
        for flip in [0x01, 0x80] {
            let mut bytes = whole.clone();
            bytes[place] ^= flip;
            std::fs::write(&path, &bytes).unwrap();
            match examine(&path, &maps) {
                Ok((count, true)) => {
                    assert_eq!(count, maps.len());
                    harmless += 1;
                }
                Ok((_, false)) => {}
                Err(message) => assert!(message.contains("a.maps"), "{message}"),
            }
        }
    }
    // The 16 bytes of the trailer only point to data that a scan finds as well.
    assert_eq!(harmless, 32);
}

#[test]
fn truncated_file_is_read_up_to_last_complete_map() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.maps");
    let maps = maps(Arithmetic::Fixed);
    write(&path, Arithmetic::Fixed, &maps);
    let whole = std::fs::read(&path).unwrap();
    let mut counts = Vec::new();
    for length in 0..whole.len() {
        std::fs::write(&path, &whole[..length]).unwrap();
        match examine(&path, &maps) {
            Ok((count, complete)) => {
                // Only the pointer to the tail may be missing from a complete file.
                assert!(!complete || length >= whole.len() - 16);
                counts.push(count);
            }
            Err(message) => {
                assert!(counts.is_empty(), "{length}: {message}");
                let known = ["not a maps file", "damaged", "not a complete HEAD"];
                assert!(known.iter().any(|part| message.contains(part)), "{message}");
            }
        }
    }
    assert!(counts.is_sorted());
    for count in 0..=maps.len() {
        assert!(counts.contains(&count), "{count}");
    }
}

#[test]
fn unfinished_file_is_hidden_and_readable() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.maps");
    let maps = maps(Arithmetic::Fixed);
    let mut writer = MapWriter::create(&path, &run(Arithmetic::Fixed)).unwrap();
    maps[..3]
        .iter()
        .for_each(|map| writer.append(&map.view()).unwrap());
    let entries: Vec<_> = std::fs::read_dir(folder.path())
        .unwrap()
        .map(|e| e.unwrap().path())
        .filter(|path| path.extension().is_none_or(|end| end != "lock"))
        .collect();
    assert_eq!(entries.len(), 1);
    let hidden = entries[0].file_name().unwrap().to_str().unwrap();
    assert!(
        hidden.starts_with(".subap-") && hidden.ends_with(".part"),
        "{hidden}"
    );
    assert_eq!(examine(&entries[0], &maps), Ok((3, false)));
    drop(writer);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn full_disk_keeps_maps_that_fit() {
    let Some(disk) = TinyDisk::mount() else {
        return;
    };
    let path = disk.path().join("a.maps");
    let mut writer = MapWriter::create(&path, &run(Arithmetic::Float)).unwrap();
    let one = &maps(Arithmetic::Float)[0];
    let mut fitted = 0;
    let error = loop {
        let mut map = one.clone();
        map.header.sub_cpi = fitted;
        match writer.append(&map.view()) {
            Ok(()) => fitted += 1,
            Err(error) => break error.to_string(),
        }
    };
    println!("{error}");
    assert!(error.contains("a.maps") && error.contains("free some space"));
    // The index of so many maps does not fit either.
    let error = writer.finish(&closing()).unwrap_err().to_string();
    println!("{error}");
    assert!(error.contains("every map in it can be read"), "{error}");
    let names = std::fs::read_dir(disk.path()).unwrap();
    assert_eq!(names.count(), 1, "only the file remains");
    let file = MapFile::open(&path).unwrap();
    assert!(!file.is_complete());
    assert_eq!(file.headers().len(), fitted as usize);
    for index in 0..fitted as usize {
        assert_eq!(file.read(index).unwrap().samples, one.samples);
    }
}

#[test]
fn maps_of_another_run_are_rejected() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.maps");
    let maps = maps(Arithmetic::Fixed);
    let mut writer = MapWriter::create(&path, &run(Arithmetic::Fixed)).unwrap();
    writer.append(&maps[0].view()).unwrap();
    let mut refused = |map: &OwnedMap, part: &str| {
        let error = writer.append(&map.view()).unwrap_err().to_string();
        assert!(error.contains("a.maps") && error.contains(part), "{error}");
    };
    refused(&maps[0], "duplicate");
    refused(&self::maps(Arithmetic::Float)[1], "the run's arithmetic");
    let mut other = maps[1].clone();
    other.header.num_pulses = 6;
    refused(&other, "expected 1 to 5");
    let mut other = maps[1].clone();
    other.header.patch.range_reach = 64;
    refused(&other, "found 129");
    let mut other = maps[1].clone();
    other.header.nodes[1].receiver_m[2] = f64::INFINITY;
    refused(&other, "its receiver at (");
    let mut other = maps[1].clone();
    other.header.patch.centre_m[0] = 1e300;
    refused(&other, "its patch at (1e300");
    // Rejected maps leave no trace.
    writer.append(&maps[1].view()).unwrap();
    writer.finish(&closing()).unwrap();
    assert_eq!(MapFile::open(&path).unwrap().headers().len(), 2);

    let mut impossible = run(Arithmetic::Float);
    impossible.setup.range_length = 100;
    let error = MapWriter::create(&path, &impossible)
        .err()
        .unwrap()
        .to_string();
    assert!(error.contains("power of two"), "{error}");
    // Every byte has a correct checksum, but the numbers are finite and impossible for a radar.
    let mut impossible = run(Arithmetic::Float);
    impossible.setup.start_hz = 5e245;
    let path = folder.path().join("b.maps");
    let writer = MapWriter::create(&path, &impossible).unwrap();
    writer.finish(&closing()).unwrap();
    let error = MapFile::open(&path).err().unwrap().to_string();
    assert!(
        error.contains("expected a frequency from") && error.contains("found 5e245 Hz"),
        "{error}"
    );
    let mut impossible = run(Arithmetic::Float);
    impossible.fast_weights.pop();
    let error = MapWriter::create(&path, &impossible)
        .err()
        .unwrap()
        .to_string();
    assert!(
        error.contains("expected 3, one per frequency, found 2"),
        "{error}"
    );
}

/// Section with a correct checksum.
fn section(tag: &[u8; 4], payload: &[u8]) -> Vec<u8> {
    let length = (payload.len() as u64).to_le_bytes();
    let crc = crc32fast::hash(&[&tag[..], &length, payload].concat());
    [&tag[..], &crc.to_le_bytes(), &length, payload].concat()
}

#[test]
fn forged_files_are_rejected_with_reason() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.maps");
    let refused = |bytes: &[u8], part: &str| {
        std::fs::write(&path, bytes).unwrap();
        let error = MapFile::open(&path).unwrap_err().to_string();
        assert!(error.contains("a.maps") && error.contains(part), "{error}");
    };
    write(&path, Arithmetic::Fixed, &maps(Arithmetic::Fixed)[..1]);
    let whole = std::fs::read(&path).unwrap();
    let head_end = 32 + u64::from_le_bytes(whole[24..32].try_into().unwrap()) as usize;
    let head = &whole[..head_end];

    refused(b"", "not a maps file");
    refused(
        b"CPHD/1.1.0\nand more than sixteen bytes",
        "not a maps file",
    );
    let mut newer = whole.clone();
    newer[8] = 2;
    let crc = crc32fast::hash(&newer[..12]);
    newer[12..16].copy_from_slice(&crc.to_le_bytes());
    refused(&newer, "version 2");
    refused(
        &[&head[..16], &section(b"HEAD", b"")].concat(),
        "unexpected end",
    );
    refused(&[&head[..16], &section(b"MAP ", b"")].concat(), "HEAD");
    refused(
        &[head, &section(b"WHAT", b"")].concat(),
        "unknown section 'WHAT'",
    );
    // A duplicate map, and one with more pulses than a sub-CPI has.
    let map_end = head_end
        + 16
        + u64::from_le_bytes(whole[head_end + 8..head_end + 16].try_into().unwrap()) as usize;
    let map = &whole[head_end..map_end];
    refused(&[head, map, map].concat(), "duplicate");
    let mut payload = map[16..].to_vec();
    payload[6] = 200;
    refused(&[head, &section(b"MAP ", &payload)].concat(), "found 200");
    // A tail that claims 2^50 maps, and one that claims too many for its length.
    let end = (head_end as u64).to_le_bytes();
    for count in [1u64 << 50, 1000] {
        let mut tail = vec![0; 16];
        tail.extend_from_slice(&2u32.to_le_bytes());
        tail.extend_from_slice(b"{}");
        tail.extend_from_slice(&count.to_le_bytes());
        let bytes = [head, &section(b"TAIL", &tail), &end, b"SUBAPEND"].concat();
        refused(&bytes, "TAIL");
    }
    // An index with a wrong offset: the file opens, but the map cannot be read.
    let mut tail = vec![0; 16];
    tail.extend_from_slice(&2u32.to_le_bytes());
    tail.extend_from_slice(b"{}");
    tail.extend_from_slice(&1u64.to_le_bytes());
    tail.extend_from_slice(&u64::MAX.to_le_bytes());
    tail.extend_from_slice(&map[16..16 + 152]);
    std::fs::write(
        &path,
        [head, &section(b"TAIL", &tail), &end, b"SUBAPEND"].concat(),
    )
    .unwrap();
    let file = MapFile::open(&path).unwrap();
    let error = file.read(0).unwrap_err().to_string();
    assert!(
        error.contains("sub-CPI 0, patch 0 is not at the offset"),
        "{error}"
    );
    // Optional sections are skipped.
    std::fs::write(&path, [head, &section(b"note", b"later"), map].concat()).unwrap();
    let file = MapFile::open(&path).unwrap();
    assert_eq!(file.read(0).unwrap(), maps(Arithmetic::Fixed)[0]);

    let error = MapFile::open(folder.path()).unwrap_err().to_string();
    assert!(error.contains("folder"), "{error}");
    let error = MapFile::open(&folder.path().join("none"))
        .unwrap_err()
        .to_string();
    assert!(error.contains("none"), "{error}");
}
