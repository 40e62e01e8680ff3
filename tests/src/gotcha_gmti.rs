//! Small collections in the layout of AFRL's Gotcha GMTI challenge.

use std::path::{Path, PathBuf};

use crate::matlab::{self, Value};

/// Pulses of the collection.
pub const PULSES: usize = 3;

/// Samples of a pulse.
pub const SAMPLES: usize = 384;

/// Files of a collection: samples and auxiliary data of one channel, and positions.
#[derive(Clone, Debug)]
pub struct Content {
    /// Big-endian float32, real and imaginary parts in turn.
    pub samples: Vec<u8>,
    /// Fields of the structure `aux_SPIE`.
    pub auxiliary: Vec<(&'static str, Value)>,
    /// Fields of the structure `paux`.
    pub positions: Vec<(&'static str, Value)>,
}

fn row(values: impl IntoIterator<Item = f64>) -> Value {
    let values: Vec<f64> = values.into_iter().collect();
    Value::Double(1, values.len() as i32, values)
}

impl Default for Content {
    /// A collection of [`PULSES`] pulses.
    fn default() -> Self {
        Self::repeated(PULSES)
    }
}

impl Content {
    /// Collection of `count` pulses. Sample `k` of pulse `n` is `1 + k + 1000 n - j`. An aircraft 5 km away, a band of 640 MHz about 9.6 GHz.
    pub fn repeated(count: usize) -> Self {
        let pulses = || (0..count).map(|n| n as f64);
        let places = pulses().map(|n| [3.0 * n, -4000.0, 3000.0]);
        let numbers = pulses().flat_map(|n| {
            (0..SAMPLES).flat_map(move |k| [1.0 + k as f32 + 1000.0 * n as f32, -1.0])
        });
        let reading = vec![
            ("Fsamp", row([2.5e7])),
            ("deltaRbin", row(pulses().map(|n| 2.0 + n))),
        ];
        Self {
            samples: numbers.flat_map(f32::to_be_bytes).collect(),
            auxiliary: vec![
                ("readPrm", Value::Structure(1, 1, reading)),
                ("circshiftFloorPHradius", row(pulses().map(|n| 2702.0 + n))),
                ("PHradius_sampleError", row([-0.25])),
                ("PRF", row([2000.0])),
            ],
            positions: vec![
                (
                    "APCpos",
                    Value::Double(3, count as i32, places.clone().flatten().collect()),
                ),
                (
                    "APCMag",
                    row(places.map(|[x, y, z]| (x * x + y * y + z * z).sqrt() - 1.0)),
                ),
                ("Gamma", row(vec![2.96e12; count])),
                (
                    "PHradius",
                    row(pulses().map(|n| 9.6e9 + 118_400.0 * n + 1000.0)),
                ),
            ],
        }
    }

    /// Field of either structure.
    ///
    /// # Panics
    /// If there is no such field.
    pub fn field(&mut self, name: &str) -> &mut Value {
        let mut all = self.auxiliary.iter_mut().chain(&mut self.positions);
        let (_, value) = all
            .find(|(field, _)| *field == name)
            .expect("a field of the collection");
        value
    }

    /// MATLAB file of the auxiliary data.
    pub fn auxiliary_file(&self) -> Vec<u8> {
        let fields = Value::Structure(1, 1, self.auxiliary.clone());
        matlab::file(&[matlab::matrix("aux_SPIE", &fields)])
    }

    /// MATLAB file of the positions.
    pub fn positions_file(&self) -> Vec<u8> {
        let fields = Value::Structure(1, 1, self.positions.clone());
        matlab::file(&[matlab::matrix("paux", &fields)])
    }

    /// Write the collection `a`, `b` with the same samples in channels 1 and 2. Returns the path of channel 1.
    ///
    /// # Panics
    /// If a file cannot be written.
    pub fn write(&self, folder: &Path) -> PathBuf {
        let put = |name: String, bytes: &[u8]| {
            std::fs::write(folder.join(name), bytes).expect("a file is written");
        };
        for channel in 1..=2 {
            put(format!("a_chan{channel}_b_PH"), &self.samples);
            put(
                format!("a_chan{channel}_b_PH_auxSaveData.mat"),
                &self.auxiliary_file(),
            );
        }
        put("a_b_PAUX.mat".to_owned(), &self.positions_file());
        folder.join("a_chan1_b_PH")
    }
}
