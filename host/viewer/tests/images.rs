//! HTTP tests of the image viewer. Each response is checked against values computed here.

use std::f64::consts::TAU;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::Arc;
use std::time::{Duration, Instant};

use num_complex::Complex32;
use serde_json::{Value, json};
use subaperture_io::geojson;
use subaperture_io::tiles::TileStore;
use subaperture_model::geometry::{Geodetic, ImageGrid, SceneFrame};
use subaperture_model::image::{Image, ImageSource, Tiling};
use subaperture_viewer::Server;
use subaperture_viewer::product::{Bounds, Gallery, Layer, Pixels, Product, TILE};
use tempfile::TempDir;

use crate::http::secret;

const NONE: i16 = i16::MIN;
const BOUNDS: Bounds = Bounds {
    overview_bytes: 64 << 20,
    computing: 2,
    request_bytes: 256 << 20,
    picture_bytes: Some(64 << 20),
    answer_bytes: 16 << 20,
};

/// A ramp of 40 dB across the columns, with a phase that rotates along the rows, and one bright pixel.
pub(crate) const ROWS: usize = 2100;
pub(crate) const COLUMNS: usize = 2600;
pub(crate) const BRIGHT: [usize; 2] = [1500, 700];

pub(crate) fn value(row: usize, column: usize) -> Complex32 {
    if [row, column] == BRIGHT {
        return Complex32::new(100.0, 0.0);
    }
    let level_db = -40.0 * column as f64 / COLUMNS as f64;
    let amplitude = 10f64.powf(level_db / 20.0);
    let (sin, cos) = (TAU * row as f64 / 8.0).sin_cos();
    Complex32::new((amplitude * cos) as f32, (amplitude * sin) as f32)
}

pub(crate) fn image(rows: usize, columns: usize) -> Image {
    Image {
        rows,
        columns,
        pixels: (0..rows * columns)
            .map(|i| value(i / columns, i % columns))
            .collect(),
    }
}

/// Image at 45 N, 10 E, x east and y north, 0.5 m per pixel.
pub(crate) fn on_earth() -> Product {
    let origin = Geodetic {
        latitude_deg: 45.0,
        longitude_deg: 10.0,
        height_m: 0.0,
    };
    let grid: ImageGrid = "x=-650:650:0.5,y=-525:525:0.5,z=0".parse().unwrap();
    let mut product = Product::new(
        "earth <b>".to_owned(),
        Pixels::whole(Box::new(image(ROWS, COLUMNS))),
    );
    product.grid = Some(grid);
    product.frame = SceneFrame::east_north_up(&origin);
    product
}

pub(crate) fn serve(products: Vec<Product>, layers: Vec<Layer>) -> Server {
    let gallery = Arc::new(Gallery::new(products, layers, BOUNDS));
    Server::show(([127, 0, 0, 1], 0).into(), gallery).unwrap()
}

/// Status and body.
fn answer(server: &Server, path: &str, host: &str) -> (String, Vec<u8>) {
    let mut stream = TcpStream::connect(server.address()).unwrap();
    stream
        .set_read_timeout(Some(Duration::from_secs(20)))
        .unwrap();
    let path = secret(server, path);
    let request = format!("GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n");
    stream.write_all(request.as_bytes()).unwrap();
    let mut all = Vec::new();
    stream.read_to_end(&mut all).unwrap();
    let end = all.windows(4).position(|four| four == b"\r\n\r\n").unwrap();
    let head = String::from_utf8(all[..end].to_vec()).unwrap();
    (head.to_lowercase(), all.split_off(end + 4))
}

fn json_at(server: &Server, path: &str) -> Value {
    let (head, body) = answer(server, path, "localhost");
    assert!(head.starts_with("http/1.1 200"), "{path}: {head}");
    serde_json::from_slice(&body).unwrap()
}

fn tile(server: &Server, path: &str) -> Vec<i16> {
    let (head, body) = answer(server, path, "localhost");
    assert!(head.starts_with("http/1.1 200"), "{path}: {head}");
    assert_eq!(body.len(), 2 * TILE * TILE);
    let pairs = body.chunks_exact(2);
    pairs.map(|b| i16::from_le_bytes([b[0], b[1]])).collect()
}

fn settled(server: &Server) -> Value {
    let begun = Instant::now();
    loop {
        let state = json_at(server, "/state");
        let images = state["images"].as_array().unwrap();
        if images.iter().all(|image| image["settled"] == true) {
            return state;
        }
        assert!(begun.elapsed() < Duration::from_secs(30), "{state}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Expected level of a cell, from the formula of its pixels.
fn expected(level: u32, row: usize, column: usize) -> f64 {
    let side = 1 << level;
    let (mut sum, mut count) = (0.0, 0.0);
    for r in (row * side..(row + 1) * side).filter(|&r| r < ROWS) {
        for c in (column * side..(column + 1) * side).filter(|&c| c < COLUMNS) {
            sum += f64::from(value(r, c).norm_sqr());
            count += 1.0;
        }
    }
    100.0 * (sum / count).log10()
}

/// Every level has the mean powers of its cells, whether kept or computed. Levels are sent in tenths of dB, so rounding
/// is half a tenth; float32 sums of the overview err by less than a hundredth of that.
#[test]
fn tiles_of_every_level_are_mean_powers() {
    let server = serve(vec![on_earth()], Vec::new());
    let state = settled(&server);
    let about = &state["images"][0];
    assert_eq!(
        (about["levels"].as_u64(), about["finest_kept"].as_u64()),
        (Some(4), Some(3))
    );
    assert_eq!(about["peak_db"].as_f64(), Some(40.0));
    for level in 0..=4u32 {
        let size = [ROWS, COLUMNS].map(|n| n.div_ceil(1 << level));
        let last = size.map(|n| (n - 1) / TILE);
        for at in [[0, 0], last, [last[0], 0]] {
            let cells = tile(&server, &format!("/tile/0/{level}/{}/{}", at[0], at[1]));
            for (i, sent) in cells.iter().enumerate().step_by(97) {
                let [row, column] = [at[0] * TILE + i / TILE, at[1] * TILE + i % TILE];
                if row >= size[0] || column >= size[1] {
                    assert_eq!(*sent, NONE);
                    continue;
                }
                let off = f64::from(*sent) - expected(level, row, column);
                assert!(
                    off.abs() < 0.51,
                    "level {level}, cell {row} {column}: {off}"
                );
            }
        }
        let beyond = format!("/tile/0/{level}/{}/0", last[0] + 1);
        assert!(
            answer(&server, &beyond, "localhost")
                .0
                .starts_with("http/1.1 404")
        );
    }
    // Value, position and phase of a pixel. The phase is 1/8 turn per row.
    let pixel = json_at(&server, "/value/0/1051/1302");
    assert_eq!(pixel["position_m"], json!([1.0, 0.5, 0.0]));
    let number = |key: &str| pixel[key].as_f64().unwrap();
    assert!((number("level_db") + 40.0 * 1302.0 / 2600.0).abs() < 1e-4);
    assert!((number("phase_deg") - 135.0).abs() < 1e-3, "{pixel}");
    // Half a metre north and one metre east of 45 N, 10 E: arcs of 111.13 km and 78.85 km per degree.
    assert!((number("latitude_deg") - 45.0 - 0.5 / 111_132.0).abs() < 1e-8);
    assert!((number("longitude_deg") - 10.0 - 1.0 / 78_847.0).abs() < 1e-8);
    let (_, phases) = answer(&server, "/phase/0/4/5", "localhost");
    assert_eq!(phases.len(), TILE * TILE);
    for (i, phase) in phases.iter().enumerate().step_by(31) {
        assert_eq!(usize::from(*phase), (4 * TILE + i / TILE) % 8 * 32);
    }
    // Along a row of the ramp: a straight line.
    let cut = json_at(&server, "/cut/0/10/0/10/2599");
    let levels = cut["levels_db"].as_array().unwrap();
    for (i, level) in levels.iter().enumerate() {
        let column = (2599.0 * i as f64 / (levels.len() - 1) as f64).round();
        assert!((level.as_f64().unwrap() + 40.0 * column / 2600.0).abs() < 1e-4);
    }
}

/// The levels at the start are those of the picture that `quicklook` draws: here of cells of 2 x 2 pixels, sorted by hand. Points one
/// pixel wide would be 12 dB lower in an overview of 400 cells a side.
#[test]
fn levels_at_the_start_are_those_of_the_picture() {
    let side = 3200;
    let value = |i: usize| {
        let (row, column) = (i / side, i % side);
        let bright = row.is_multiple_of(40) && column.is_multiple_of(20);
        let db = if bright {
            30.0
        } else {
            (row * 7 + column * 3) as f64 % 8.0
        };
        Complex32::new(10f64.powf(db / 20.0) as f32, 0.0)
    };
    let image = Image {
        rows: side,
        columns: side,
        pixels: (0..side * side).map(value).collect(),
    };
    let power = |row: usize, column: usize| f64::from(image.pixels[row * side + column].norm_sqr());
    let mut cells: Vec<f64> = (0..1600 * 1600)
        .map(|i| {
            let (row, column) = (2 * (i / 1600), 2 * (i % 1600));
            let all = [[0, 0], [0, 1], [1, 0], [1, 1]];
            all.map(|[r, c]| power(row + r, column + c))
                .iter()
                .sum::<f64>()
                / 4.0
        })
        .collect();
    cells.sort_by(f64::total_cmp);
    let db = |i: usize| 10.0 * cells[i].log10();
    let last = cells.len() - 1;
    let top = db(last - cells.len() / 1000).max(db(last) - 12.0).ceil();
    let span = (top - (db(last / 2) - 6.0).floor()).clamp(40.0, 60.0);
    let server = serve(
        vec![Product::new("a".to_owned(), Pixels::whole(Box::new(image)))],
        Vec::new(),
    );
    let about = &settled(&server)["images"][0];
    assert_eq!(about["scale"], json!([top, span]));
    // Each cell is counted once, in bins of 1 dB up to the highest.
    let counts = about["histogram"]["counts"].as_array().unwrap();
    let total: u64 = counts.iter().map(|n| n.as_u64().unwrap()).sum();
    assert_eq!(total, 1600 * 1600);
    let first = about["histogram"]["first_db"].as_f64().unwrap();
    assert_eq!(first + counts.len() as f64 - 1.0, db(last).floor());
}

/// Statistics over all pixels of a region, against plain sums of the formula of its pixels; a region beyond the image is clipped.
#[test]
fn statistics_of_a_region_are_those_of_all_its_pixels() {
    let server = serve(vec![on_earth()], Vec::new());
    let found = json_at(&server, "/statistics/0/1400/300/9999/1201");
    let (mut powers, mut levels) = (Vec::new(), 0.0);
    for row in 1400..ROWS {
        for column in 300..1201 {
            let power = f64::from(value(row, column).norm_sqr());
            levels += 10.0 * power.log10();
            powers.push(power);
        }
    }
    powers.sort_by(f64::total_cmp);
    let count = powers.len();
    let mean = powers.iter().sum::<f64>() / count as f64;
    let variance = powers.iter().map(|p| (p - mean).powi(2)).sum::<f64>() / count as f64;
    let db = |p: f64| 10.0 * p.log10();
    assert_eq!(found["num_pixels"], count);
    for (key, expected) in [
        ("mean_db", db(mean)),
        ("standard_deviation_db", db(variance.sqrt())),
        ("looks", mean * mean / variance),
        ("minimum_db", db(powers[0])),
        (
            "median_db",
            db((powers[(count - 1) / 2] + powers[count / 2]) / 2.0),
        ),
        ("maximum_db", 40.0),
        ("mean_level_db", levels / count as f64),
    ] {
        let value = found[key].as_f64().unwrap();
        // The median is exact to 8e-6 dB.
        assert!((value - expected).abs() < 2e-5, "{key}: {value} {expected}");
    }
}

/// The state is answered while a client that does not read holds all memory of responses.
#[test]
fn state_does_not_wait_for_other_responses() {
    // A layer of 200 000 positions of 17 digits, 7 MB of JSON: more than the buffers of a connection hold.
    let points: Vec<String> = (1..=200_000)
        .map(|i| format!("[{0},{0}]", f64::from(i).sqrt()))
        .collect();
    let text = format!(
        r#"{{"type":"MultiPoint","coordinates":[{}]}}"#,
        points.join(",")
    );
    let features = geojson::parse(text.as_bytes()).unwrap();
    let layer = Layer::of_features("l".to_owned(), features).unwrap();
    let bounds = Bounds {
        answer_bytes: 1 << 20,
        ..BOUNDS
    };
    let mut plain = on_earth();
    plain.frame = SceneFrame::Local;
    let gallery = Arc::new(Gallery::new(vec![plain], vec![layer], bounds));
    let server = Server::show(([127, 0, 0, 1], 0).into(), gallery).unwrap();
    settled(&server);
    let mut slow = TcpStream::connect(server.address()).unwrap();
    let path = secret(&server, "/layer/0/0");
    write!(slow, "GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n").unwrap();
    // Its response has begun: it holds the memory of all.
    slow.read_exact(&mut [0; 12]).unwrap();
    assert_eq!(json_at(&server, "/state")["images"][0]["name"], "earth <b>");
    // A tile waits until the client has read its response.
    let mut waiting = TcpStream::connect(server.address()).unwrap();
    waiting
        .set_read_timeout(Some(Duration::from_millis(300)))
        .unwrap();
    let path = secret(&server, "/tile/0/0/0/0");
    write!(
        waiting,
        "GET {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n"
    )
    .unwrap();
    assert!(waiting.read(&mut [0; 12]).is_err());
    assert_eq!(json_at(&server, "/state")["images"][0]["settled"], true);
    drop(slow);
    waiting
        .set_read_timeout(Some(Duration::from_secs(20)))
        .unwrap();
    waiting.read_exact(&mut [0; 12]).unwrap();
}

/// Unknown paths, foreign host names and file paths are refused.
#[test]
fn unknown_paths_and_hosts_are_refused() {
    let server = serve(vec![on_earth()], Vec::new());
    let address = server.address();
    assert!(address.ip().is_loopback());
    for path in [
        "/",
        "/view.css",
        "/view.js",
        "/histogram.js",
        "/measure.js",
        "/axes.js",
        "/region.js",
        "/leaflet.js",
        "/leaflet.css",
        "/licences",
    ] {
        let (head, body) = answer(&server, path, "localhost");
        assert!(
            head.starts_with("http/1.1 200") && body.len() > 500,
            "{path}: {head}"
        );
        for header in [
            "content-security-policy: default-src 'none'",
            "nosniff",
            "cache-control: no-store",
        ] {
            assert!(head.contains(header), "{path}: {head}");
        }
        assert!(!head.contains("access-control"), "{path}");
    }
    for path in [
        "/tile/1/0/0/0",
        "/tile/0/9/0/0",
        "/tile/0/0/18446744073709551615/0",
        "/tile/../../Cargo.toml",
        "/%2e%2e/Cargo.toml",
        "/layer/0/0",
        "/value/0/2100/0",
        "/look/0/0/500/0/0/0",
        "/look/0/500/500/0/0/0",
        "/cut/0/0/0/nan/0",
        "/statistics/0/10/10/10/20",
        "/statistics/0/2100/0/2200/20",
        "/statistics/1/0/0/10/10",
        "/Cargo.toml",
    ] {
        let (head, _) = answer(&server, path, "localhost");
        assert!(head.starts_with("http/1.1 404"), "{path}: {head}");
    }
    for path in ["/tile/0/0/-1/0", "/tile/0/x/0/0", "/value/0/1"] {
        let (head, _) = answer(&server, path, "localhost");
        assert!(head.starts_with("http/1.1 4"), "{path}: {head}");
    }
    for host in ["evil.example", "127.0.0.1.evil.example", ""] {
        for path in ["/", "/state", "/tile/0/0/0/0", "/value/0/0/0"] {
            let (head, _) = answer(&server, path, host);
            assert!(head.starts_with("http/1.1 421"), "{host} {path}: {head}");
        }
    }
}

/// An incomplete image is shown as far as it exists, and the remaining tiles when they arrive.
#[test]
fn growing_image_is_shown_as_tiles_arrive() {
    let folder = TempDir::new().unwrap();
    let tiling = Tiling {
        image: [1000, 1500],
        tile: [256, 256],
    };
    let store = TileStore::create(folder.path(), tiling, "plan").unwrap();
    let whole = image(1000, 1500);
    let put = |index: usize| {
        let part = whole.window(&tiling.place(index)).unwrap();
        store.put(index, &part.pixels, &Value::Null).unwrap();
    };
    (0..8).for_each(put);
    let again = TileStore::open(folder.path()).unwrap().unwrap();
    let server = serve(
        vec![Product::new("growing".to_owned(), Pixels::tiles(again))],
        Vec::new(),
    );
    let begun = Instant::now();
    while json_at(&server, "/state")["images"][0]["ready"] != true {
        assert!(begun.elapsed() < Duration::from_secs(20));
        std::thread::sleep(Duration::from_millis(20));
    }
    let state = json_at(&server, "/state");
    // 6 tiles of 256 rows, and 2 more of 256 x 256.
    let fraction = (256.0 * 1500.0 + 2.0 * 256.0 * 256.0) / 1.5e6;
    assert_eq!(state["images"][0]["settled"], false);
    assert!((state["images"][0]["fraction"].as_f64().unwrap() - fraction).abs() < 1e-9);
    // At level 3, tiles are 32 cells wide. The ninth tile is missing.
    let cells = tile(&server, "/tile/0/3/0/0");
    assert!(cells[33 * TILE + 63] != NONE && cells[33 * TILE + 64] == NONE);
    assert!(
        tile(&server, "/tile/0/0/1/2")
            .iter()
            .all(|&level| level == NONE)
    );
    (8..tiling.count()).for_each(put);
    let state = settled(&server);
    assert_eq!(state["images"][0]["fault"], Value::Null);
    assert!(
        tile(&server, "/tile/0/0/1/2")
            .iter()
            .all(|&level| level != NONE)
    );
    assert!(tile(&server, "/tile/0/3/0/0")[33 * TILE + 64] != NONE);
}

/// Unreadable data are reported, and the page remains usable.
#[test]
fn damaged_files_are_reported() {
    let folder = TempDir::new().unwrap();
    let tiling = Tiling {
        image: [300, 300],
        tile: [150, 150],
    };
    let store = TileStore::create(folder.path(), tiling, "plan").unwrap();
    let whole = image(300, 300);
    for index in 0..4 {
        let part = whole.window(&tiling.place(index)).unwrap();
        store.put(index, &part.pixels, &Value::Null).unwrap();
    }
    let chunk = folder.path().join("image.zarr/c/1/0");
    let mut bytes = std::fs::read(&chunk).unwrap();
    bytes[1000] ^= 1;
    std::fs::write(&chunk, bytes).unwrap();
    let mut checked = on_earth();
    checked.check = Some(Box::new(|| Err("CRC-32 mismatch".to_owned())));
    let server = serve(
        vec![Product::new("a".to_owned(), Pixels::tiles(store)), checked],
        Vec::new(),
    );
    let state = settled(&server);
    let fault = |i: usize| state["images"][i]["fault"].as_str().unwrap().to_owned();
    assert!(fault(0).contains("CRC-32") && fault(1).contains("mismatch"));
    let (head, body) = answer(&server, "/tile/0/0/0/0", "localhost");
    assert!(head.starts_with("http/1.1 500"), "{head}");
    assert!(String::from_utf8(body).unwrap().contains("CRC-32"));
    assert!(
        answer(&server, "/tile/1/0/0/0", "localhost")
            .0
            .starts_with("http/1.1 200")
    );
}
