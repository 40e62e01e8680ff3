//! Example `truck` from the simulated recording and navigation log to a ground overlay, whose pixels lie at the true places of the reflectors.

use std::fs;
use std::io::Read;
use std::path::Path;

use subaperture_tests::subap::run;

/// Corner reflectors of the example, metres east and north of its origin, at its height.
const CORNERS_M: [[f64; 2]; 4] = [[-8.0, 20.0], [0.0, 30.0], [7.0, 26.0], [3.0, 41.0]];

/// Latitude and longitude of the origin, radians, and its height, metres.
const ORIGIN: [f64; 3] = [
    40.4237 * std::f64::consts::PI / 180.0,
    -86.9212 * std::f64::consts::PI / 180.0,
    150.0,
];

/// Axes of WGS 84, metres, and square of the eccentricity.
const SEMI_MAJOR_M: f64 = 6_378_137.0;
const ECCENTRICITY2: f64 = 6.694_379_990_141_3e-3;

/// Metres of ground for a radian of latitude and of longitude at the origin, by the radii of curvature.
fn metres_per_radian() -> [f64; 2] {
    let [latitude, _, height_m] = ORIGIN;
    let w2 = 1.0 - ECCENTRICITY2 * latitude.sin().powi(2);
    let vertical_m = SEMI_MAJOR_M / w2.sqrt();
    let meridian_m = vertical_m * (1.0 - ECCENTRICITY2) / w2;
    [
        meridian_m + height_m,
        (vertical_m + height_m) * latitude.cos(),
    ]
}

/// File of a ZIP archive, stored or deflated, by its local header.
fn unzipped(archive: &[u8], name: &str) -> Vec<u8> {
    let number = |at: usize, bytes: usize| {
        let digits = archive[at..at + bytes].iter().rev();
        digits.fold(0usize, |sum, &byte| sum * 256 + usize::from(byte))
    };
    // The central directory has the sizes.
    let entries = (0..archive.len() - 46).filter(|&at| archive[at..].starts_with(b"PK\x01\x02"));
    let entry = entries
        .into_iter()
        .find(|&at| archive[at + 46..].starts_with(name.as_bytes()))
        .unwrap_or_else(|| panic!("no {name}"));
    let (method, size, local) = (
        number(entry + 10, 2),
        number(entry + 20, 4),
        number(entry + 42, 4),
    );
    let from = local + 30 + number(local + 26, 2) + number(local + 28, 2);
    let stored = &archive[from..from + size];
    if method == 0 {
        return stored.to_vec();
    }
    let mut content = Vec::new();
    flate2::read::DeflateDecoder::new(stored)
        .read_to_end(&mut content)
        .unwrap();
    content
}

/// Overlay: edges north, south, east and west, degrees, and brightness from 0 to 255 with its size.
struct Overlay {
    edges_deg: [f64; 4],
    brightness: Vec<f64>,
    size: [usize; 2],
}

fn overlay(path: &Path) -> Overlay {
    let archive = fs::read(path).unwrap();
    let document = String::from_utf8(unzipped(&archive, "doc.kml")).unwrap();
    let edges_deg = ["north", "south", "east", "west"].map(|edge| {
        let (_, rest) = document.split_once(&format!("<{edge}>")).unwrap();
        rest.split_once('<').unwrap().0.parse().unwrap()
    });
    let picture = unzipped(&archive, "map.png");
    let mut decoder = png::Decoder::new(std::io::Cursor::new(picture));
    decoder.set_transformations(png::Transformations::EXPAND | png::Transformations::ALPHA);
    let mut reader = decoder.read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let about = reader.next_frame(&mut bytes).unwrap();
    let channels = about.color_type.samples();
    let opaque = |pixel: &[u8]| match pixel[channels - 1] {
        0 => 0.0,
        _ => f64::from(pixel[0]),
    };
    Overlay {
        edges_deg,
        brightness: bytes.chunks_exact(channels).map(opaque).collect(),
        size: [about.width as usize, about.height as usize],
    }
}

impl Overlay {
    /// Metres east and north of the origin of the brightest pixels (their centroid) within `reach_m` of a place.
    fn brightest_m(&self, [east_m, north_m]: [f64; 2], reach_m: f64) -> [f64; 2] {
        let [north, south, east, west] = self.edges_deg.map(f64::to_radians);
        let [width, height] = self.size;
        let [per_latitude, per_longitude] = metres_per_radian();
        let place = |n: usize| {
            let right = ((n % width) as f64 + 0.5) / width as f64;
            let down = ((n / width) as f64 + 0.5) / height as f64;
            [
                (west + (east - west) * right - ORIGIN[1]) * per_longitude,
                (north + (south - north) * down - ORIGIN[0]) * per_latitude,
            ]
        };
        let near = |n: &usize| {
            let [x, y] = place(*n);
            (x - east_m).hypot(y - north_m) < reach_m
        };
        let pixels: Vec<usize> = (0..self.brightness.len()).filter(near).collect();
        let most = pixels.iter().map(|&n| self.brightness[n]);
        let most = most.fold(0.0, f64::max);
        let brightest: Vec<[f64; 2]> = pixels
            .into_iter()
            .filter(|&n| self.brightness[n] == most)
            .map(place)
            .collect();
        assert!(most > 0.0, "no echo at {east_m}, {north_m}");
        let mean = |axis: usize| {
            brightest.iter().map(|place| place[axis]).sum::<f64>() / brightest.len() as f64
        };
        [mean(0), mean(1)]
    }
}

#[test]
fn reflectors_of_truck_lie_at_true_places_of_ground_overlay() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let example = run(at, "simulate --example truck");
    fs::write(at.join("truck.toml"), example.succeeded()).unwrap();
    run(at, "simulate truck.toml -o truck.cphd").succeeded();
    let on_log = "--track fused --navigation truck.log --lever-arm=-0.8,-0.3,0.5";
    let bp = run(at, &format!("focus truck.cphd {on_log} -a bp --out bp"));
    bp.succeeded();
    bp.reports("the image is formed on the navigation track alone");
    let strip = format!("focus truck.cphd {on_log} -a rda --error-db -30 --out rda");
    run(at, &strip).succeeded();
    run(at, "focus truck.cphd -a bp --out recorded").succeeded();
    let image = |name: &str, corner_m: [f64; 2]| {
        run(
            at,
            &format!("export {name} -o {name}.kmz --remap db --pixel 6cm --force"),
        )
        .succeeded();
        let found_m = overlay(&at.join(format!("{name}.kmz"))).brightest_m(corner_m, 2.0);
        (found_m[0] - corner_m[0]).hypot(found_m[1] - corner_m[1])
    };
    for corner_m in CORNERS_M {
        // Resolution is 0.5 m. The centroid of the brightest pixels of 6 cm is within a pixel of the peak. The positions of the log deviate by 4 mm, over some
        // 60 fixes of a beam; the mean of their errors moves the peak by less than 1 cm.
        for name in ["bp", "rda"] {
            let away_m = image(name, corner_m);
            assert!(away_m < 0.1, "{name} {corner_m:?}: {away_m}");
        }
        // The recorded track is off by decimetres.
        let away_m = image("recorded", corner_m);
        println!("recorded {corner_m:?}: {away_m}");
    }
    let worst_m = CORNERS_M.map(|corner_m| image("recorded", corner_m));
    assert!(worst_m.into_iter().fold(0.0, f64::max) > 0.3, "{worst_m:?}");
    // The range-Doppler image on the uneven track is that of backprojection within its bound.
    let compared = run(at, "compare bp rda --json");
    let compared: serde_json::Value = serde_json::from_str(compared.succeeded()).unwrap();
    let rms_db = compared["error_db"].as_f64();
    let rms_db = rms_db.unwrap_or_else(|| panic!("{compared}"));
    assert!(rms_db < -30.0, "{rms_db}");
}
