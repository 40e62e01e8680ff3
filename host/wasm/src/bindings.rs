//! The interface of the page: classes and functions for JavaScript. Requests and facts are JSON.

use serde::Serialize;
use subaperture::monitor::Monitor;
use wasm_bindgen::prelude::wasm_bindgen;

use crate::{focused, recording};

#[wasm_bindgen]
extern "C" {
    /// Function of the worker that receives the finished fraction of the work.
    #[wasm_bindgen(js_name = reportProgress)]
    fn report_progress(fraction: f64);

    #[wasm_bindgen(js_namespace = console, js_name = error)]
    fn log_error(text: &str);
}

/// Passes progress to the worker.
struct Reported;

impl Monitor for Reported {
    fn progress(&self, fraction: f64) {
        report_progress(fraction);
    }
}

/// Write the place of a panic to the console.
#[wasm_bindgen(start)]
fn start() {
    std::panic::set_hook(Box::new(|info| log_error(&info.to_string())));
}

fn text(facts: &impl Serialize) -> Result<String, String> {
    serde_json::to_string(facts).map_err(|error| error.to_string())
}

/// Files of one aperture.
#[wasm_bindgen]
#[derive(Default)]
pub struct Files(recording::Files);

#[wasm_bindgen]
impl Files {
    /// Empty list of files.
    #[wasm_bindgen(constructor)]
    pub fn new() -> Self {
        Self::default()
    }

    /// Instruction set of the kernels: `simd128` or `simd128-fused`.
    pub fn instructions() -> String {
        subaperture::focus::instructions().to_owned()
    }

    /// Memory left for a further file, bytes.
    #[wasm_bindgen(js_name = leftBytes)]
    pub fn left_bytes(&self) -> f64 {
        self.0.left_bytes() as f64
    }

    /// Open a file by its content.
    ///
    /// # Errors
    /// Text for the user.
    pub fn add(&mut self, name: &str, bytes: Vec<u8>) -> Result<(), String> {
        self.0.add(name, bytes)
    }

    /// Join the files into one aperture.
    ///
    /// # Errors
    /// Text for the user.
    pub fn open(self) -> Result<Recording, String> {
        self.0.open().map(Recording)
    }
}

/// Recording opened from its files.
#[wasm_bindgen]
pub struct Recording(recording::Recording);

#[wasm_bindgen]
impl Recording {
    /// Facts of the recording, JSON of `Summary`.
    ///
    /// # Errors
    /// Text for the user.
    pub fn summary(&self) -> Result<String, String> {
        text(&self.0.summary()?)
    }

    /// Form the image of a request, JSON of `Request`.
    ///
    /// # Errors
    /// Text for the user.
    pub fn focus(&self, request: &str) -> Result<Focused, String> {
        let request = serde_json::from_str(request).map_err(|error| error.to_string())?;
        self.0.focus(&request, &Reported).map(Focused)
    }
}

/// Formed image with its record.
#[wasm_bindgen]
pub struct Focused(focused::Focused);

#[wasm_bindgen]
impl Focused {
    /// Facts of the image, JSON of `Facts`.
    ///
    /// # Errors
    /// Text for the user.
    pub fn facts(&self) -> Result<String, String> {
        text(&self.0.facts())
    }

    /// Complex pixels as a NumPy file.
    ///
    /// # Errors
    /// Text for the user.
    pub fn npy(&self) -> Result<Vec<u8>, String> {
        self.0.npy()
    }

    /// Levels of a picture, 0 to 255, from the largest y down.
    pub fn levels(&self, range_db: f64) -> Vec<u8> {
        self.0.levels(range_db)
    }
}
