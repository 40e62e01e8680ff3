//! Browser tests of the capture page: display, counts, and access.
//!
//! `SUBAPERTURE_SCREENSHOTS=FOLDER` stores screenshots, as PNG in base64.

use std::time::Duration;

use serde_json::{Value, json};
use subaperture_radio::live::Picture;

use crate::driver::Browser;
use crate::http::serve;
use crate::running::{Running, SPEED_M_S, STEPS, captured};

/// First number in a text.
fn number(text: &str) -> f64 {
    let digits = text.trim_start_matches(|c: char| !c.is_ascii_digit() && c != '-');
    let end = digits
        .find(|c: char| !matches!(c, '0'..='9' | '.' | '-' | ','))
        .unwrap_or(digits.len());
    digits[..end]
        .trim_end_matches(',')
        .replace(',', "")
        .parse()
        .unwrap()
}

fn keep(browser: &Browser, name: &str) {
    if let Ok(folder) = std::env::var("SUBAPERTURE_SCREENSHOTS") {
        std::fs::write(format!("{folder}/{name}.base64"), browser.screenshot()).unwrap();
    }
}

/// Hash of the pixels of a canvas.
fn pixels(browser: &Browser, id: &str) -> Value {
    browser.run(&format!(
        "const c = document.getElementById('{id}'), d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data; \
         let h = 7; for (let i = 0; i < d.length; i++) h = (h * 31 + d[i]) % 2147483647; return h"
    ))
}

/// Wait until a condition holds and the page has drawn everything it was asked to draw.
fn wait_drawn(browser: &Browser, condition: &str) {
    browser.wait(&format!("{condition} && !drawPending"));
}

fn shown(browser: &Browser, sweep: u64) {
    wait_drawn(
        browser,
        &format!("document.body.dataset.drawn === '{sweep}'"),
    );
}

/// Hexadecimal addresses that this machine listens on at a port, as reported by the kernel.
#[cfg(target_os = "linux")]
fn listening(port: u16) -> Vec<String> {
    let mut all = Vec::new();
    for table in ["/proc/net/tcp", "/proc/net/tcp6"] {
        for line in std::fs::read_to_string(table)
            .unwrap_or_default()
            .lines()
            .skip(1)
        {
            let words: Vec<&str> = line.split_whitespace().collect();
            let (address, at) = words[1].rsplit_once(':').unwrap();
            if words[3] == "0A" && u16::from_str_radix(at, 16) == Ok(port) {
                all.push(address.to_owned());
            }
        }
    }
    all
}

/// Check that the strongest echo appears at the reflector's range at mid-sweep. For a radar moving at `v`, the profile
/// shows the reflector farther by `f v T / B`, with `T` the duration of a sweep computed from its steps. Half a display
/// point (12 m / 255) and noise of -20 dB move it by less than the tolerance.
fn assert_profile(browser: &Browser, running: &Running, sweep: u64) {
    let text = browser.text("cursor");
    assert!(text.starts_with("strongest: "), "{text}");
    let times: Vec<f64> = running
        .steps
        .iter()
        .filter(|step| step.sweep == sweep)
        .map(|step| step.time_s)
        .collect();
    let lasts_s = times[STEPS - 1] - times[0];
    let true_m = 6.0 + SPEED_M_S * running.middle_s(sweep);
    let shift_m = 1.2e9 * SPEED_M_S * lasts_s / 200e6;
    let off_m = number(&text) - (true_m + shift_m) % (STEPS as f64 * 299_792_458.0 / 400e6);
    assert!(off_m.abs() < 0.1, "sweep {sweep}: {text}, off by {off_m} m");
}

#[test]
fn page_follows_capture_and_shows_levels_and_losses() {
    let Some(browser) = Browser::start(1280, 1000) else {
        println!("skipped: chromium or chromedriver not found");
        return;
    };
    let mut running = captured("A page's <b>name</b>", 9);
    let server = serve(&running);
    #[cfg(target_os = "linux")]
    assert_eq!(listening(server.address().port()), ["0100007F"]);
    browser.open(&server.url());
    wait_drawn(&browser, "document.body.dataset.state === 'running'");
    // Names are text, never markup.
    assert_eq!(browser.text("name"), "A page's <b>name</b>");

    running.show(0..1);
    shown(&browser, 0);
    assert_profile(&browser, &running, 0);
    let first = ["profile", "waterfall"].map(|id| pixels(&browser, id));
    running.show(1..5);
    shown(&browser, 4);
    assert_profile(&browser, &running, 4);
    let moved = ["profile", "waterfall"].map(|id| pixels(&browser, id));
    assert!(first[0] != moved[0] && first[1] != moved[1]);

    // While paused, the page does not change. On resume it shows all rows that arrived in between.
    browser.press(" ");
    browser.wait("document.getElementById('pause').getAttribute('aria-pressed') === 'true'");
    running.show(5..9);
    std::thread::sleep(Duration::from_millis(400));
    assert_eq!(browser.text("sweep"), "5 of 9");
    browser.press(" ");
    shown(&browser, 8);
    assert_profile(&browser, &running, 8);
    assert_eq!(
        browser.run("return view.rows.map((row) => row.sweep)"),
        json!([3, 4, 5, 6, 7, 8])
    );

    // The page shows the totals of the capture, and the flags of the last sweep.
    let (status, _) = running.board.status();
    let summary = &running.summary;
    for (i, name) in ["late", "lost", "unsteady", "clipped", "unlocked"]
        .into_iter()
        .enumerate()
    {
        assert_eq!(
            number(&browser.text(&format!("flags-{name}"))),
            summary.flagged[i] as f64
        );
        assert_eq!(
            number(&browser.text(&format!("flags-{name}-now"))),
            status.flagged[i] as f64
        );
    }
    for (name, count) in [
        ("overruns", summary.events[0]),
        ("late-commands", summary.events[2]),
        ("lost-packets", summary.events[3]),
        ("samples-lost", summary.lost_samples),
        ("waits-for-the-disk", summary.waits),
        ("steps-not-shown", 0),
    ] {
        assert_eq!(
            number(&browser.text(&format!("events-{name}"))),
            count as f64,
            "{name}"
        );
    }
    assert!(summary.events[0] > 0 && summary.events[2] > 0 && summary.events[3] > 0);
    for (id, level) in ["reference", "echo"].into_iter().zip(status.levels) {
        let text = browser.text(id);
        // Rounded to a tenth.
        assert!(
            (number(&text) - 20.0 * level.rms.log10()).abs() < 0.051,
            "{text}"
        );
        let peak = text.split_once("RMS, ").unwrap().1;
        assert!(
            (number(peak) - 20.0 * level.peak.log10()).abs() < 0.051,
            "{text}"
        );
    }
    let usable = format!("{} of {STEPS}", status.usable);
    assert_eq!(
        (browser.text("usable"), browser.text("sweep")),
        (usable, "9 of 9".to_owned())
    );
    assert!(
        number(&browser.text("disk")) > 0.0 && browser.text("rate").parse::<f64>().unwrap() > 1.0
    );

    // The image, and the second colour map.
    let level = |i: usize| -2.0 * ((i % 64) as f32 - 20.0).hypot((i / 64) as f32 - 40.0);
    running.board.show_picture(Picture {
        columns: 64,
        x_m: [-3.0, 3.0],
        y_m: [2.0, 8.0],
        levels_db: (0..64 * 64).map(level).collect(),
        pulses: 9,
    });
    wait_drawn(
        &browser,
        "!document.getElementById('image-figure').hidden && view.image",
    );
    assert!(
        browser.text("pulses").starts_with("9 pulses, 0.0 dB"),
        "{}",
        browser.text("pulses")
    );
    // The brightest pixel of the image, at x -1.1 m and y 5.8 m of 6 m each way, is drawn in yellow at the right place:
    // columns to the right, rows upwards.
    let yellow = "const c = document.getElementById('image'), w = c.width, d = c.getContext('2d').getImageData(0, 0, w, c.height).data; \
         let best = [0, 0, -1]; for (let i = 0; i < d.length; i += 4) { const y = d[i] + d[i + 1] - 2 * d[i + 2]; if (y > best[2]) best = [i / 4 % w, Math.floor(i / 4 / w), y]; } \
         const r = devicePixelRatio, x = w / r - EDGE.left - EDGE.right, t = Math.min(x, c.height / r - EDGE.top - EDGE.bottom), l = EDGE.left + (x - t) / 2; \
         return [(best[0] / r - l) / t, (best[1] / r - EDGE.top) / t]";
    shown(&browser, 8);
    let place = browser.run(yellow);
    let [across, down] = [0, 1].map(|i| place[i].as_f64().unwrap());
    assert!(
        (across - 20.5 / 64.0).abs() < 0.02 && (down - (1.0 - 40.5 / 64.0)).abs() < 0.02,
        "{place}"
    );
    keep(&browser, "light");
    let before = pixels(&browser, "waterfall");
    browser.press("c");
    wait_drawn(&browser, "view.map === 'grey'");
    assert_ne!(pixels(&browser, "waterfall"), before);
    browser.press("c");

    // On a small dark screen, nothing is wider than the screen.
    let dark = json!({ "features": [{ "name": "prefers-color-scheme", "value": "dark" }] });
    browser.command("Emulation.setEmulatedMedia", &dark);
    let small = json!({ "width": 390, "height": 844, "deviceScaleFactor": 2, "mobile": true });
    browser.command("Emulation.setDeviceMetricsOverride", &small);
    browser.press("?");
    browser.wait("!document.getElementById('help').hidden");
    std::thread::sleep(Duration::from_millis(200));
    let wide = browser
        .run("return document.documentElement.scrollWidth")
        .as_f64()
        .unwrap();
    let paper = browser.run("return getComputedStyle(document.body).backgroundColor");
    assert!(
        wide <= 390.0 && paper == "rgb(16, 20, 24)",
        "{wide} {paper}"
    );
    keep(&browser, "dark");
    browser.press("\u{e00c}");
    browser.wait("document.getElementById('help').hidden");

    running.board.end("all sweeps are taken");
    browser.wait("document.body.dataset.state === 'ended'");
    assert!(browser.text("state").contains("all sweeps are taken"));
    // The page has no failed, missing or foreign resources.
    assert_eq!(browser.run("return performance.getEntriesByType('resource').every((e) => e.name.startsWith(location.origin))"), true);
}
