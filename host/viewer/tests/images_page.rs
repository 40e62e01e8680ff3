//! Browser tests of the image viewer: loading time, memory, display, comparison and measurements.
//!
//! `SUBAPERTURE_SCREENSHOTS=FOLDER` stores screenshots of the page, as PNG in base64.

use std::io::{Seek, SeekFrom, Write};
use std::time::Instant;

use glam::DVec3;
use serde_json::json;
use subaperture_io::geojson;
use subaperture_io::npy::ImageFile;
use subaperture_viewer::product::{Layer, Pixels, Product};
use tempfile::TempDir;

use crate::driver::Browser;
use crate::images::{BRIGHT, COLUMNS, ROWS, image, on_earth, serve, value};

/// Peak resident memory of this process, bytes.
#[cfg(target_os = "linux")]
fn peak_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status
        .lines()
        .find(|line| line.starts_with("VmHWM:"))
        .unwrap();
    let kib: u64 = line.split_whitespace().nth(1).unwrap().parse().unwrap();
    kib << 10
}

/// Rows and columns of the large image.
const SIDE: usize = 20_000;

/// Write an image of 20000 x 20000 pixels, 3.2 GB. Every hundredth row is written; the others are holes in the file,
/// which read as zeros.
fn large(path: &std::path::Path) {
    let header = format!("{{'descr': '<c8', 'fortran_order': False, 'shape': ({SIDE}, {SIDE}), }}");
    let padded = format!("{header:<117}\n");
    let mut file = std::fs::File::create(path).unwrap();
    file.write_all(b"\x93NUMPY\x01\x00\x76\x00").unwrap();
    file.write_all(padded.as_bytes()).unwrap();
    let line = (0..SIDE).flat_map(|column| [1.0, (column / 60) as f32]);
    let line: Vec<u8> = line.flat_map(f32::to_le_bytes).collect();
    for row in (0..SIDE).step_by(100) {
        let at = 128 + (row * line.len()) as u64;
        file.seek(SeekFrom::Start(at)).unwrap();
        file.write_all(&line).unwrap();
    }
    file.set_len(128 + (SIDE * line.len()) as u64).unwrap();
}

/// A large image appears within a second and can be panned and zoomed, in memory independent of its size.
#[test]
fn large_image_appears_at_once_in_little_memory() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("large.npy");
    large(&path);
    let Some(browser) = Browser::start(1280, 900) else {
        println!("skipped: chromium or chromedriver not found");
        return;
    };
    #[cfg(target_os = "linux")]
    let before = peak_bytes();
    let open = || {
        Product::new(
            "large".to_owned(),
            Pixels::whole(Box::new(ImageFile::open(&path).unwrap())),
        )
    };
    let begun = Instant::now();
    let server = serve(vec![open()], Vec::new());
    browser.open(&server.url());
    browser.wait("view.painted > 3");
    println!("first picture after {:?}", begun.elapsed());
    // A quarter of a second on two processors, more while other tests run: printed, not asserted.
    browser.wait("document.body.dataset.state === 'ready' && view.drawn === view.wanted");
    for zoom in [-4, -3, -2, -1, 0, 2] {
        browser.run(&format!(
            "map.setView([3000, 3000], {zoom}, {{ animate: false }}); return 1"
        ));
        for _ in 0..3 {
            browser.run("map.panBy([400, 250], { animate: false }); return 1");
            browser.wait("view.drawn === view.wanted");
        }
    }
    // The readout shows the pixel under the crosshair: row 3000, column 3000 at the centre of the map.
    browser.run("map.setView([3000.5, 3000.5], 0, { animate: false }); map.getContainer().focus(); readout(map.getCenter()); return 1");
    browser.wait("document.getElementById('level').textContent.includes('dB')");
    assert!(browser.text("where").contains("row 3000, column 3000"));
    let level = 10.0 * (1.0f64 + 50.0 * 50.0).log10();
    assert!(
        browser.text("level").starts_with(&format!("{level:.1} dB")),
        "{}",
        browser.text("level")
    );
    #[cfg(target_os = "linux")]
    {
        // The overview takes 400 M / 64 cells of 4 bytes plus one third, 33 MB; the preview of 500 x 500 pixels 2 MB;
        // two tiles at a time 2 MB each. The rest belongs to the server and the allocator. Other tests of this process
        // may run at the same time with images of 44 MB. The image itself has 3.2 GB.
        let more = peak_bytes().saturating_sub(before);
        println!("{} MiB more at the most", more >> 20);
        assert!(more < 200 << 20, "{more}");
    }
}

/// Row and column at the centre of the page's map.
fn centre(browser: &Browser) -> [f64; 2] {
    ["lat", "lng"].map(|key| {
        let number = browser.run(&format!("return map.getCenter().{key}"));
        number.as_f64().unwrap()
    })
}

/// Two images with a layer: blink, swipe, levels, phase, measurements, address, and small screens.
#[test]
fn page_displays_compares_and_measures_images() {
    let Some(browser) = Browser::start(1280, 900) else {
        println!("skipped: chromium or chromedriver not found");
        return;
    };
    let text = br#"{"type":"Feature","properties":{"name":"<i>mark</i>"},"geometry":{"type":"Point","coordinates":[10,45]}}"#;
    let layers = vec![
        Layer::of_features("marks".to_owned(), geojson::parse(text).unwrap()).unwrap(),
        Layer::of_track(
            "way".to_owned(),
            &[DVec3::ZERO, DVec3::new(100.0, 100.0, 50.0)],
        ),
    ];
    let mut other = on_earth();
    other.name = "other".to_owned();
    let mut turned = image(ROWS, COLUMNS);
    turned.pixels.reverse();
    other.pixels = Pixels::whole(Box::new(turned));
    let server = serve(vec![on_earth(), other], layers);
    browser.open(&server.url());
    browser.wait(
        "document.body.dataset.state === 'ready' && view.painted > 3 && view.drawn === view.wanted",
    );
    // Names are text, never markup.
    assert_eq!(browser.text("name"), "earth <b>");
    browser.wait("document.body.dataset.layers === '2'");
    // Painted colour at a row and column of an image.
    let colour = |plane: &str, row: usize, column: usize| {
        browser.run(&format!(
            "let found = null; planes.{plane}.each((c) => {{ const s = 2 ** c.level, n = 256, r = Math.floor({row} / s) - c.at[0] * n, k = Math.floor({column} / s) - c.at[1] * n; \
             if (r >= 0 && k >= 0 && r < n && k < n) found = Array.from(c.getContext('2d').getImageData(k, n - 1 - r, 1, 1).data); }}); return found"
        ))
    };
    // White is 0 dB and black is -40 dB. A quarter of the width is 10 dB below white: three quarters of 255.
    browser.run("choose(0, 40); return 1");
    let [first, quarter] =
        [20, COLUMNS / 4].map(|column| colour("shown", 300, column)[0].as_f64().unwrap());
    // Cells of level 2 span 0.06 dB; a tenth of a dB is half a grey level.
    assert!(
        (first - 253.0).abs() <= 2.0 && (quarter - 191.0).abs() <= 2.0,
        "{first} {quarter}"
    );
    // The line of the white level is dragged from 0 dB to -10 dB: the black level stays.
    browser.run(
        "const canvas = document.getElementById('histogram'), box = canvas.getBoundingClientRect(); canvas.setPointerCapture = () => {}; \
         const send = (kind, db) => canvas.dispatchEvent(new PointerEvent(kind, { pointerId: 1, clientX: box.left + atLevel(db, box.width), clientY: box.top + 9 })); \
         send('pointerdown', 0); send('pointermove', -10); send('pointerup', -10); return 1",
    );
    assert_eq!(
        browser.run("return [view.top, view.span, view.own]"),
        json!([-10, 30, true])
    );
    browser.run("choose(0, 40); return 1");
    browser.press("]");
    browser.wait("document.getElementById('top-text').textContent === '1 dB'");
    assert!(colour("shown", 300, COLUMNS / 4)[0].as_f64().unwrap() < quarter - 4.0);
    browser.press("c");
    browser.wait("view.map === 'viridis'");
    let purple = colour("shown", 300, COLUMNS - 30);
    assert!(purple[2].as_f64() > purple[1].as_f64(), "{purple}");
    browser.press("c");
    // The second image is the first rotated by half a turn: its bright side is on the right.
    browser.press("b");
    browser.wait("view.blinked && document.getElementById('name').textContent === 'other'");
    browser.wait("view.drawn === view.wanted");
    let right = colour("other", 300, COLUMNS - 30)[0].as_f64().unwrap();
    assert!(right > 240.0, "{right}");
    browser.press("b");
    browser.press("s");
    browser.wait("view.swiped && planes.other.getContainer().style.clip.startsWith('rect')");
    // Point response of the bright pixel, from a position a few pixels away.
    browser.run("mode('point'); return 1");
    browser.run(&format!(
        "pick(L.latLng({}.5, {}.5)); return 1",
        BRIGHT[0] + 2,
        BRIGHT[1] - 2
    ));
    browser.wait("!document.getElementById('numbers').hidden && document.body.dataset.chart");
    let measured = browser.text("message");
    assert!(
        measured.contains(&format!("row {}.00, column {}.00", BRIGHT[0], BRIGHT[1]))
            && measured.contains("40.00 dB"),
        "{measured}"
    );
    // Distance over 300 rows and 400 columns of 0.5 m: 250 m.
    browser
        .run("mode('cut'); pick(L.latLng(100.5, 100.5)); pick(L.latLng(400.5, 500.5)); return 1");
    browser.wait("document.getElementById('message').textContent.startsWith('250.00 m')");
    browser.wait("measured.curves.length === 1 && measured.curves[0].y.length === 401");
    keep(&browser, "images");
    // Phase at zoom 1:1: one turn per eight rows.
    browser.press("1");
    browser.press("p");
    browser.wait("view.phase && map.getZoom() === 0 && view.drawn === view.wanted");
    browser.wait("(() => { let all = true, any = false; planes.shown.each((c) => { if (c.level === 0) { any = true; all = all && !!c.phases; } }); return all && any; })()");
    let [row, column] = centre(&browser).map(|at| at as usize);
    assert_eq!(
        colour("shown", row, column),
        colour("shown", row + 8, column)
    );
    assert_ne!(
        colour("shown", row, column),
        colour("shown", row + 4, column)
    );
    // The address holds the view: another page opened with it shows the same.
    browser.wait("location.hash.includes('p=1') && location.hash.includes('t=1')");
    let shown = "return [view.top, view.span, view.phase, map.getZoom(), view.swiped]";
    let before = browser.run(shown);
    let [row, column] = centre(&browser);
    let hash = browser
        .run("return location.hash")
        .as_str()
        .unwrap()
        .to_owned();
    browser.open("about:blank");
    browser.open(&format!("{}{hash}", server.url()));
    browser.wait("view.painted > 3 && view.drawn === view.wanted");
    assert_eq!(browser.run(shown), before);
    // The address holds the centre in hundredths of a pixel.
    let [row_again, column_again] = centre(&browser);
    assert!(
        (row_again - row).abs() < 0.006 && (column_again - column).abs() < 0.006,
        "({row_again}, {column_again}) instead of ({row}, {column})"
    );
    // All controls have accessible names, and the page fits a small dark screen.
    let unnamed = "return [...document.querySelectorAll('button, select, input, canvas[role], #map')].filter((e) => !(e.textContent.trim() || e.getAttribute('aria-label') || e.labels?.length)).map((e) => e.id)";
    assert_eq!(browser.run(unnamed), json!([]));
    let dark = json!({ "features": [{ "name": "prefers-color-scheme", "value": "dark" }] });
    browser.command("Emulation.setEmulatedMedia", &dark);
    let small = json!({ "width": 390, "height": 844, "deviceScaleFactor": 2, "mobile": true });
    browser.command("Emulation.setDeviceMetricsOverride", &small);
    browser.press("?");
    browser.wait("!document.getElementById('help').hidden");
    let wide = browser.run("return document.documentElement.scrollWidth");
    assert!(wide.as_f64().unwrap() <= 390.0, "{wide}");
    keep(&browser, "images-small");
    assert_eq!(
        browser.run("return performance.getEntriesByType('resource').every((e) => e.name.startsWith(location.origin))"),
        true
    );
}

/// Drag with the left mouse button between two points of the window. `modifiers`: 8 is Shift.
fn drag(browser: &Browser, [from, to]: [[f64; 2]; 2], modifiers: u8) {
    let mouse = |kind: &str, [x, y]: [f64; 2], buttons: u8| {
        let button = if kind == "mouseMoved" && buttons == 0 {
            "none"
        } else {
            "left"
        };
        browser.command(
            "Input.dispatchMouseEvent",
            &json!({ "type": kind, "x": x, "y": y, "button": button, "buttons": buttons, "clickCount": 1, "modifiers": modifiers }),
        );
    };
    mouse("mouseMoved", from, 0);
    mouse("mousePressed", from, 1);
    for k in 1..=4 {
        let part = f64::from(k) / 4.0;
        mouse(
            "mouseMoved",
            [0, 1].map(|i| from[i] + part * (to[i] - from[i])),
            1,
        );
    }
    mouse("mouseReleased", to, 0);
}

/// Scale bar, axes and arrows, statistics of a dragged region, the picture of the view, and Escape.
#[test]
fn page_shows_axes_measures_regions_and_saves_pictures() {
    let Some(browser) = Browser::start(1280, 900) else {
        println!("skipped: chromium or chromedriver not found");
        return;
    };
    let mut shown = on_earth();
    shown.name = "runs/first/image.npy".to_owned();
    // From the west: the radar looks east, to the right.
    shown.antenna_m = Some(DVec3::new(-1e4, 0.0, 5e3));
    let server = serve(vec![shown], Vec::new());
    browser.open(&server.url());
    browser.wait(
        "document.body.dataset.state === 'ready' && view.painted > 3 && view.drawn === view.wanted",
    );
    keep(&browser, "axes");
    // At zoom 1:1 a pixel of 0.5 m is a pixel of the screen. Pixel (1050, 1300) is at the origin.
    let frame = |zoom: i32| {
        browser.run(&format!(
            "map.setView([1050.5, 1300.5], {zoom}, {{ animate: false }}); drawFrame(); return 1"
        ));
        let bar = browser.run("return JSON.parse(frame.dataset.bar)");
        let label = browser.run("return frame.getAttribute('aria-label')");
        (bar, label.as_str().unwrap().to_owned())
    };
    for (zoom, bar, text) in [
        (0, json!([50, 100]), "50 m"),
        (-2, json!([200, 100]), "200 m"),
        (3, json!([5, 80]), "5 m"),
        (6, json!([1, 128]), "1 m"),
    ] {
        let (found, label) = frame(zoom);
        assert_eq!(found, bar);
        assert!(label.contains(&format!("scale bar of {text};")), "{label}");
        assert!(
            label.contains("north 0°") && label.contains("look direction 90°"),
            "{label}"
        );
    }
    let (_, label) = frame(0);
    let size = browser.run("return [map.getSize().x, map.getSize().y]");
    let [wide, tall] = [0, 1].map(|i| size[i].as_f64().unwrap());
    // The axes begin 52 px from the left and 20 px from the bottom; labels have no decimals here.
    let across = [-(wide / 2.0 - 52.0) / 2.0, wide / 4.0].map(|x| format!("{x:.0}"));
    let down = [-(tall / 2.0 - 20.0) / 2.0, tall / 4.0].map(|y| format!("{y:.0}"));
    let expected = format!(
        "y (m) from {} to {}; x (m) from {} to {};",
        down[0], down[1], across[0], across[1]
    );
    assert!(label.starts_with(&expected), "{label}: {expected}");

    // Drag with Shift from 100 px left and 60 px above the centre to 50 px right and 40 px below.
    let corner = browser
        .run("const box = map.getContainer().getBoundingClientRect(); return [box.left, box.top]");
    let at = |x: f64, y: f64| {
        let corner = [0, 1].map(|i| corner[i].as_f64().unwrap());
        [
            (corner[0] + wide / 2.0 + x).floor(),
            (corner[1] + tall / 2.0 + y).floor(),
        ]
    };
    let measured = || {
        browser.wait("!document.getElementById('numbers').hidden");
        let text = browser.text("message");
        let numbers = text
            .split(|c: char| !c.is_ascii_digit())
            .filter(|word| !word.is_empty());
        let numbers: Vec<usize> = numbers.map(|word| word.parse().unwrap()).collect();
        <[usize; 4]>::try_from(numbers).unwrap()
    };
    drag(&browser, [at(-100.0, -60.0), at(50.0, 40.0)], 8);
    let [first, last, left, right] = measured();
    for (found, expected) in [(first, 1010), (last, 1110), (left, 1200), (right, 1350)] {
        assert!(found.abs_diff(expected) <= 1, "{}", browser.text("message"));
    }
    let cell = |row: usize| {
        browser.run(&format!(
            "return document.getElementById('numbers').tBodies[0].rows[{row}].cells[1].textContent"
        ))
    };
    let (mut sum, mut count) = (0.0, 0);
    for row in first..=last {
        for column in left..=right {
            sum += f64::from(value(row, column).norm_sqr());
            count += 1;
        }
    }
    assert_eq!(
        cell(0).as_str().unwrap().replace(' ', ""),
        count.to_string()
    );
    assert_eq!(
        cell(1),
        format!("{:.2} dB", 10.0 * (sum / f64::from(count)).log10())
    );
    assert_eq!(
        browser.run("return [map.getCenter().lat, map.getCenter().lng]"),
        json!([1050.5, 1300.5])
    );
    keep(&browser, "region");
    // Escape closes the results and the key help, also while a slider has the focus.
    browser.press("?");
    browser.run("document.getElementById('top').focus(); return 1");
    browser.press("\u{e00c}");
    let closed = "document.getElementById('numbers').hidden && document.getElementById('help').hidden && !document.getElementById('message').textContent && !measured.group.getLayers().length";
    assert_eq!(browser.run(&format!("return Boolean({closed})")), true);
    // By the button, without Shift: dragging draws, and does not pan until Escape.
    browser.run("document.getElementById('region').click(); return 1");
    drag(&browser, [at(10.0, 10.0), at(-30.0, -50.0)], 0);
    assert!(measured()[0].abs_diff(1040) <= 1);
    // Two clicks select corners.
    browser.run("pick(L.latLng(20.5, 30.5)); pick(L.latLng(10.5, 40.5)); return 1");
    browser.wait("document.getElementById('message').textContent.startsWith('rows 10 to 20, columns 30 to 40')");
    browser.press("\u{e00c}");
    assert_eq!(
        browser.run(&format!("return Boolean({closed}) && !measured.mode")),
        true
    );
    drag(&browser, [at(0.0, 0.0), at(-40.0, -30.0)], 0);
    browser.wait("map.getCenter().lng > 1320");

    // The picture has the colours of the screen: the only pixel above the upper level, and the ramp around it.
    let folder = TempDir::new().unwrap();
    let path = folder.path().to_str().unwrap();
    browser.command(
        "Browser.setDownloadBehavior",
        &json!({ "behavior": "allow", "downloadPath": path }),
    );
    let [row, column] = BRIGHT.map(|at| at as f64 + 0.5);
    browser.run(&format!(
        "choose(0, 40); map.setView([{row}, {column}], 0, {{ animate: false }}); return 1"
    ));
    browser.wait("view.drawn === view.wanted");
    browser.press("w");
    let begun = Instant::now();
    let file = folder.path().join("image.png");
    while !file.exists() {
        assert!(begun.elapsed().as_secs() < 20, "no picture");
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
    let decoder = png::Decoder::new(std::io::BufReader::new(std::fs::File::open(&file).unwrap()));
    let mut reader = decoder.read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    assert_eq!(
        (f64::from(info.width), f64::from(info.height)),
        (wide, tall)
    );
    let colour = |x: usize, y: usize| &pixels[4 * (y * info.width as usize + x)..][..3];
    let inner = |y: &usize| (90..tall as usize - 80).contains(y);
    let all = (0..tall as usize)
        .filter(inner)
        .flat_map(|y| (60..wide as usize).map(move |x| (x, y)));
    let bright: Vec<(usize, usize)> = all
        .filter(|&(x, y)| colour(x, y) == [255, 150, 30])
        .collect();
    let [(x, y)] = bright[..] else {
        panic!("{bright:?}");
    };
    let off = [x as f64 - wide / 2.0, y as f64 - tall / 2.0];
    // The centre of the map is a corner of a pixel of the screen, and tiles are placed at whole pixels.
    assert!(off.iter().all(|off| off.abs() <= 2.0), "{off:?}");
    for off in [-300i32, -40, 1, 250] {
        let column = (BRIGHT[1] as i32 + off) as usize;
        let level = (10.0 * (10.0 * f64::from(value(100, column).norm_sqr()).log10())).round();
        let grey = ((level + 400.0) * 255.0 / 400.0).round() as u8;
        for down in [-200i32, -1, 0, 150] {
            let found = colour((x as i32 + off) as usize, (y as i32 + down) as usize);
            assert_eq!(found, [grey; 3], "{off} {down}");
        }
    }
}

fn keep(browser: &Browser, name: &str) {
    if let Ok(folder) = std::env::var("SUBAPERTURE_SCREENSHOTS") {
        std::fs::write(format!("{folder}/{name}.base64"), browser.screenshot()).unwrap();
    }
}

/// Arrows on a polar grid: a displacement by 1 m to the north, or away from the antenna, leads from the centre of the view in their direction.
#[test]
fn arrows_of_polar_grid_point_along_displacements_on_the_ground() {
    let Some(browser) = Browser::start(1280, 900) else {
        println!("skipped: chromium or chromedriver not found");
        return;
    };
    // x is east and y north. Columns are 0.05 degrees apart, rows 0.25 m; the antenna is not at the pole.
    let (range_m, angle_deg) = (
        |row: f64| 200.0 + 0.25 * row,
        |column: f64| 20.0 + 0.05 * column,
    );
    let antenna_m = DVec3::new(-150.0, 60.0, 90.0);
    let mut shown = on_earth();
    shown.pixels = Pixels::whole(Box::new(image(1600, 2000)));
    shown.grid = Some("r=200:600:0.25,theta=20:120:0.05".parse().unwrap());
    shown.antenna_m = Some(antenna_m);
    let server = serve(vec![shown], Vec::new());
    browser.open(&server.url());
    browser.wait(
        "document.body.dataset.state === 'ready' && view.painted > 3 && view.drawn === view.wanted",
    );
    keep(&browser, "polar");
    for (row, column, zoom) in [
        (800.0, 1000.0, 0),
        (100.0, 150.0, 0),
        (1500.0, 1900.0, 2),
        (40.0, 1700.0, -1),
    ] {
        browser.run(&format!(
            "map.setView([{}, {}], {zoom}, {{ animate: false }}); drawFrame(); return 1",
            row + 0.5,
            column + 0.5
        ));
        let (range_m, angle_rad) = (range_m(row), angle_deg(column).to_radians());
        let [x_m, y_m] = [range_m * angle_rad.cos(), range_m * angle_rad.sin()];
        let (away, length_m) = (
            [x_m - antenna_m.x, y_m - antenna_m.y],
            (x_m - antenna_m.x).hypot(y_m - antenna_m.y),
        );
        for (key, east_m, north_m) in [
            ("north", 0.0, 1.0),
            ("look", away[0] / length_m, away[1] / length_m),
        ] {
            let [x_m, y_m] = [x_m + east_m, y_m + north_m];
            let row = (x_m.hypot(y_m) - 200.0) / 0.25;
            let column = (y_m.atan2(x_m).to_degrees() - 20.0) / 0.05;
            let expected = browser.run(&format!(
                "const from = map.project(map.getCenter()), to = map.project([{}, {}]); return (Math.atan2(to.x - from.x, from.y - to.y) * 180 / Math.PI + 360) % 360",
                row + 0.5,
                column + 0.5
            ));
            let (expected, found) = (
                expected.as_f64().unwrap(),
                browser.run(&format!("return Number(frame.dataset.{key})")),
            );
            let off = (found.as_f64().unwrap() - expected + 180.0).rem_euclid(360.0) - 180.0;
            assert!(
                off.abs() < 1.0,
                "{key} at {row}, {column}: {found}, {expected}"
            );
        }
    }
    keep(&browser, "polar-far");
}
