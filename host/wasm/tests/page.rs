//! The page in headless Chromium: images have the bits of the native library, and no byte leaves the machine.
//!
//! Screenshots are written to `target/wasm-pictures`.

use std::fs;
use std::net::TcpListener;
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use subaperture::phase_history::PhaseHistory;
use subaperture_wasm::request::Request;
use subaperture_xtask::target_folder;

use crate::driver::Browser;
use crate::input::{by_library, difference_db, gotcha, request, write_cphd, write_npz};
use crate::server::Server;

/// The page in a browser; `None` with a message if the page is not built or there is no browser.
fn page(fragment: &str) -> Option<(Server, Browser)> {
    let folder = target_folder().join("wasm");
    if !folder.join("index.html").exists() {
        println!(
            "skipped: {} not found: run cargo xtask wasm",
            folder.display()
        );
        return None;
    }
    let Some(browser) = Browser::start(1280, 1000) else {
        println!("skipped: chromium or chromedriver not found");
        return None;
    };
    let server = Server::start(&folder);
    browser.open(&format!("http://127.0.0.1:{}/{fragment}", server.port));
    wait(&browser, "empty");
    Some((server, browser))
}

/// Wait for a state of the page, and fail with its text if it is the state of an error.
fn wait(browser: &Browser, state: &str) {
    let reached = |state: &str| format!("document.body.dataset.state === {state:?}");
    browser.wait(&format!("{} || {}", reached(state), reached("wrong")));
    let found = browser.run("return document.body.dataset.state");
    if found != state {
        let text = browser.text("state");
        panic!(
            "expected {state}, found {found}: {text}; {:#?}",
            browser.console()
        );
    }
}

fn open(browser: &Browser, paths: &[PathBuf]) {
    // The state of an earlier choice must not be taken for that of this one.
    browser.run("document.body.dataset.state = 'asked'");
    browser.choose("files", paths);
    wait(browser, "open");
}

/// Form an image as a user does, and return its pixels as a NumPy file with the milliseconds of the page.
fn form(browser: &Browser, request: &Request) -> (Vec<u8>, f64) {
    let asked = serde_json::to_string(request).unwrap();
    browser.run(&format!(
        "const asked = {asked}; setGrid(asked.grid); document.getElementById('former').value = asked.former;
         document.getElementById('error').value = asked.error_db; document.getElementById('portable').checked = asked.portable;
         document.getElementById('focus').click()"
    ));
    wait(browser, "image");
    let milliseconds = browser.text("time");
    let milliseconds = milliseconds.strip_suffix(" ms").unwrap().parse().unwrap();
    let pixels = browser.run(
        "return (async () => { let text = ''; for (const byte of await npy()) text += String.fromCharCode(byte); return btoa(text); })()",
    );
    let pixels = BASE64_STANDARD.decode(pixels.as_str().unwrap()).unwrap();
    (pixels, milliseconds)
}

fn keep_screenshot(browser: &Browser, name: &str) {
    let folder = target_folder().join("wasm-pictures");
    fs::create_dir_all(&folder).unwrap();
    let picture = BASE64_STANDARD.decode(browser.screenshot()).unwrap();
    fs::write(folder.join(name), picture).unwrap();
}

/// Drop a file on the page.
fn drop_file(browser: &Browser, path: &Path) {
    let content = BASE64_STANDARD.encode(fs::read(path).unwrap());
    let name = path.file_name().unwrap().to_str().unwrap();
    browser.run(&format!(
        "const bytes = Uint8Array.from(atob({content:?}), (letter) => letter.charCodeAt(0));
         const dataTransfer = new DataTransfer(); dataTransfer.items.add(new File([bytes], {name:?}));
         document.body.dispatchEvent(new DragEvent('drop', {{ dataTransfer, bubbles: true, cancelable: true }}))"
    ));
    wait(browser, "open");
}

#[test]
fn images_have_the_bits_of_the_native_library() {
    let Some((server, browser)) = page("") else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let [cphd, npz] = ["points.cphd", "points.npz"].map(|name| folder.path().join(name));
    write_cphd(&cphd);
    write_npz(&npz);
    open(&browser, std::slice::from_ref(&cphd));
    assert_eq!(browser.text("size"), "1040 × 256");
    let history = subaperture::open(&cphd).unwrap();
    let exact = by_library(&history, &request("exact", true));
    for former in ["auto", "bp", "ffbp", "rdbp"] {
        let portable = request(former, true);
        let (pixels, _) = form(&browser, &portable);
        assert!(
            pixels == by_library(&history, &portable),
            "{former}: bits differ"
        );
        let (pixels, _) = form(&browser, &request(former, false));
        let error_db = difference_db(&pixels, &exact);
        println!("{former}: {error_db:.1} dB");
        assert!(error_db <= -50.0, "{former}: {error_db}");
    }
    assert!(browser.text("instructions").starts_with("simd128"));
    keep_screenshot(&browser, "points.png");

    // A dropped archive of the same samples.
    drop_file(&browser, &npz);
    let portable = request("rdbp", true);
    let (pixels, _) = form(&browser, &portable);
    assert!(pixels == by_library(&subaperture::open(&npz).unwrap(), &portable));
    let errors = browser.console();
    assert!(errors.is_empty(), "{errors:?}");
    assert_only_page_is_requested(&server);
}

/// The browser has requested the files of the page, each without a body.
fn assert_only_page_is_requested(server: &Server) {
    let known = [
        "",
        "page.css",
        "page.js",
        "worker.js",
        "relaxed.js",
        "relaxed_bg.wasm",
    ];
    let requests = server.requests.lock().unwrap();
    assert!(requests.len() >= known.len(), "{requests:?}");
    for request in requests.iter() {
        let is_known = known
            .iter()
            .any(|name| *request == format!("GET /{name} HTTP/1.1"));
        assert!(is_known, "{request}");
    }
}

/// Fused multiply-adds are made of others in the module for browsers without them.
#[test]
fn module_without_relaxed_instructions_has_the_same_bits() {
    let Some((_server, browser)) = page("#simd128") else {
        return;
    };
    assert_eq!(browser.text("instructions"), "simd128");
    let folder = tempfile::tempdir().unwrap();
    let cphd = folder.path().join("points.cphd");
    write_cphd(&cphd);
    open(&browser, std::slice::from_ref(&cphd));
    let history = subaperture::open(&cphd).unwrap();
    for former in ["bp", "ffbp", "rdbp"] {
        let portable = request(former, true);
        let (pixels, _) = form(&browser, &portable);
        assert!(
            pixels == by_library(&history, &portable),
            "{former}: bits differ"
        );
    }
}

/// The tests of the kernels' lanes, of each operation against scalar arithmetic. A failed test ends the module by a trap.
#[test]
fn lanes_pass_their_tests() {
    let folder = target_folder().join("wasm-tests");
    if !folder.exists() {
        println!(
            "skipped: {} not found: run cargo xtask wasm",
            folder.display()
        );
        return;
    }
    let Some(browser) = Browser::start(800, 600) else {
        println!("skipped: chromium or chromedriver not found");
        return;
    };
    let server = Server::start(&folder);
    // A page that is not found has the origin too.
    browser.open(&format!("http://127.0.0.1:{}/", server.port));
    let status = browser.run(
        "return WebAssembly.instantiateStreaming(fetch('relaxed.wasm')).then(({ instance }) => instance.exports.main(0, 0)).catch(String)",
    );
    assert_eq!(status, 0);
}

#[test]
fn other_origins_cannot_be_reached() {
    let Some((_server, browser)) = page("") else {
        return;
    };
    let other = TcpListener::bind(("127.0.0.1", 0)).unwrap();
    other.set_nonblocking(true).unwrap();
    let url = format!("http://127.0.0.1:{}/", other.local_addr().unwrap().port());
    // By the page, and by a worker of the kind that has the recording.
    let by_page = format!("return fetch({url:?}).then(() => 'reached', () => 'refused')");
    assert_eq!(browser.run(&by_page), "refused");
    let script =
        format!("fetch({url:?}).then(() => postMessage('reached'), () => postMessage('refused'))");
    let by_worker = format!(
        "return new Promise((resolve) => {{
           const worker = new Worker(URL.createObjectURL(new Blob([{script:?}], {{ type: 'text/javascript' }})), {{ type: 'module' }});
           worker.onmessage = (event) => resolve(event.data); }})"
    );
    assert_eq!(browser.run(&by_worker), "refused");
    assert!(other.accept().is_err(), "a connection was made");
}

#[test]
fn faulty_files_are_refused_and_work_is_cancelled() {
    let Some((_server, browser)) = page("") else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let text = folder.path().join("notes.txt");
    fs::write(&text, "not a recording").unwrap();
    browser.choose("files", &[text]);
    browser.wait("document.body.dataset.state === 'wrong'");
    assert!(
        browser.text("state").contains("notes.txt"),
        "{}",
        browser.text("state")
    );

    let cphd = folder.path().join("points.cphd");
    write_cphd(&cphd);
    open(&browser, &[cphd]);
    // Some seconds of work, ended at once.
    browser.run(
        "setGrid({ centre_m: [0, 0], size_m: [90, 90], pixels: [3000, 3000] }); document.getElementById('former').value = 'bp';
         document.getElementById('focus').click(); document.getElementById('cancel').click()",
    );
    wait(&browser, "open");
    let (pixels, _) = form(&browser, &request("rdbp", false));
    assert!(pixels.len() > 120 * 96 * 8);
}

/// Times of the guide: two degrees of GOTCHA on 500 x 500 pixels.
#[test]
fn gotcha_has_the_bits_of_the_native_library() {
    let Some(paths) = gotcha() else { return };
    let history = subaperture::open_all(&paths).unwrap();
    for module in ["", "#simd128"] {
        form_gotcha(module, &paths, &history);
    }
}

fn form_gotcha(module: &str, paths: &[PathBuf], history: &dyn PhaseHistory) {
    let Some((_server, browser)) = page(module) else {
        return;
    };
    open(&browser, paths);
    for former in ["auto", "bp", "ffbp", "rdbp"] {
        for portable in [true, false] {
            let mut asked = request(former, portable);
            asked.grid.centre_m = [0.0; 2];
            asked.grid.size_m = [100.0; 2];
            asked.grid.pixels = [500; 2];
            let (pixels, first_ms) = form(&browser, &asked);
            let (again, second_ms) = form(&browser, &asked);
            assert!(pixels == again, "{former}: bits differ between runs");
            println!(
                "{former}, portable {portable}: {first_ms} ms, then {second_ms} ms, predicted {}, {}",
                browser.text("predicted"),
                browser.text("instructions")
            );
            if portable {
                assert!(
                    pixels == by_library(history, &asked),
                    "{former}: bits differ"
                );
            }
        }
    }
    keep_screenshot(&browser, "gotcha.png");
}
