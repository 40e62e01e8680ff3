//! Files of maps, and images from them.

use num_complex::Complex32;
use serde_json::json;
use subaperture::focus::BoundPolicy;
use subaperture::geometry::SceneFrame;
use subaperture::module::image::{MapsTask, default_grid, form};
use subaperture::module::maps::{Arithmetic, Maps, OwnedMap, Run, RunTotals};
use subaperture::module::maps_file::{MapFile, MapWriter};
use subaperture::monitor::Silent;
use subaperture_core::stream::{Patch, Setup};

use super::MEMORY_BYTES;
use super::scratch::with_files;
use crate::{link_scene, maps};

/// Maximum of maps read from a file; it may contain many without being large.
const MAX_READ: usize = 64;

/// Setup and maps of two patches, three sub-CPIs, seen from 850 m.
fn run_and_maps(arithmetic: Arithmetic) -> (Run, Vec<OwnedMap>) {
    let setup = Setup {
        num_pulses: 4,
        num_channels: 1,
        num_frequencies: 16,
        range_length: 32,
        doppler_length: 8,
        start_hz: 9.4e9,
        step_hz: 3e6,
    };
    let scene = link_scene::scene();
    let history = link_scene::recorded(&scene);
    let fast = maps::fast_weights(&[1.0; 16]);
    let patch = |x, range_reach, doppler_reach| Patch {
        centre_m: [x, -2.0, 0.5],
        range_reach,
        doppler_reach,
    };
    let patches = [patch(3.0, 5, 2), patch(-4.0, 4, 1)];
    let all = maps::maps(
        &history,
        &setup,
        &patches,
        &fast,
        &[1.0; link_scene::PULSES],
    );
    let mut few: Vec<OwnedMap> = all.into_iter().take(6).collect();
    if arithmetic == Arithmetic::Fixed {
        few = few.iter().map(maps::in_blocks).collect();
    }
    let provenance = json!({ "slow_window": "none", "amplitude_scale": 1.0 });
    let run = Run {
        name: "seed".to_owned(),
        setup,
        arithmetic,
        fast_window: "none".to_owned(),
        fast_weights: fast,
        frame: SceneFrame::Local,
        provenance: provenance.as_object().cloned().unwrap_or_default(),
    };
    (run, few)
}

pub(super) fn seeds() -> Vec<Vec<u8>> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("seed.maps");
    let mut seeds = Vec::new();
    // The last seed's patches are so far apart that their mean position is outside all of them.
    for (arithmetic, apart_m) in [
        (Arithmetic::Float, [0.0, 0.0]),
        (Arithmetic::Fixed, [0.0, 0.0]),
        (Arithmetic::Float, [30.0, 4e9]),
    ] {
        let (run, mut maps) = run_and_maps(arithmetic);
        for header in maps.iter_mut().map(|map| &mut map.header) {
            match header.patch_index {
                0 => header.patch.centre_m[1] += apart_m[0],
                _ => header.patch.centre_m[2] += apart_m[1],
            }
        }
        write(
            &path,
            &run,
            &maps,
            &RunTotals {
                num_pulses: 12,
                weight_sum: 12.0,
                counters: serde_json::Map::new(),
            },
        );
        let whole = std::fs::read(&path).expect("a file is read");
        // A truncated file is read map by map.
        seeds.push(whole[..whole.len() - 16].to_vec());
        seeds.push(whole);
    }
    seeds
}

fn write(path: &std::path::Path, run: &Run, maps: &[OwnedMap], closing: &RunTotals) {
    let mut writer = MapWriter::create(path, run).expect("a file of maps is begun");
    for map in maps {
        writer.append(&map.view()).expect("a map is written");
    }
    writer.finish(closing).expect("a file of maps is ended");
}

pub(super) fn read(bytes: &[u8]) -> String {
    with_files(&[("input.maps", bytes)], |folder| {
        let file = match MapFile::open(&folder.join("input.maps")) {
            Ok(file) => file,
            Err(error) => return error.to_string(),
        };
        assert!(
            file.held_bytes() <= 16 * bytes.len() as u64,
            "more maps than the file has room for"
        );
        let count = file.headers().len();
        let read: Result<Vec<OwnedMap>, _> =
            (0..count.min(MAX_READ)).map(|n| file.read(n)).collect();
        let maps = match read {
            Ok(maps) => maps,
            Err(error) => return error.to_string(),
        };
        if let Some(closing) = file.closing()
            && count <= MAX_READ
        {
            let path = folder.join("again.maps");
            write(&path, file.run(), &maps, closing);
            let again = MapFile::open(&path).expect("written maps are read");
            assert_eq!((again.run(), again.closing()), (file.run(), Some(closing)));
            for (n, map) in maps.iter().enumerate() {
                assert_eq!(
                    bits(&again.read(n).expect("a map is read again")),
                    bits(map)
                );
            }
        }
        image(&file)
    })
}

/// Headers and bits of samples, so that NaN equals itself.
fn bits(map: &OwnedMap) -> String {
    let samples: Vec<[u32; 2]> = map
        .clone()
        .into_values()
        .iter()
        .map(|z: &Complex32| [z.re.to_bits(), z.im.to_bits()])
        .collect();
    format!("{:?} {samples:?}", map.header)
}

/// An image of a few pixels: finite, or an error.
fn image(file: &MapFile) -> String {
    // Few pulses of small patches have no default grid; then one around the seeds' first patch is used.
    let (wide, found) = match default_grid(file, -50.0) {
        Ok(grid) => (grid, "a grid".to_owned()),
        Err(error) => (
            "x=2:4:0.5,y=-3:-1:0.5,z=0.5".parse().expect("a grid"),
            error.to_string(),
        ),
    };
    assert!(wide.fault().is_none(), "{:?} of {wide:?}", wide.fault());
    let mut grid = wide.clone();
    (grid.rows.count, grid.columns.count) = (wide.rows.count.min(5), wide.columns.count.min(4));
    let task = MapsTask {
        maps: file,
        grid: &grid,
        error_db: -50.0,
        bound_policy: BoundPolicy::Allowed,
        memory_bytes: MEMORY_BYTES,
        monitor: &Silent,
    };
    match form(&task) {
        Ok((formed, _)) => {
            let finite = formed.image.pixels.iter().all(|z| z.is_finite());
            assert!(finite, "an image that is not finite");
            format!("{found}; an image")
        }
        Err(error) => format!("{found}; {error}"),
    }
}
