//! Sweeps of a vector network analyser in Touchstone files, and a recording of two of them.

use subaperture::io::recording::RecordingFile;
use subaperture::io::touchstone;
use subaperture::phase_history::PhaseHistory;

use super::scratch::with_files;
use super::{MEMORY_BYTES, choice};

pub(super) const WORDS: &[&str] = &[
    "# GHz S RI R 50",
    "# MHz S DB R 50",
    "# Hz S MA",
    "!",
    "\n",
    "[Version] 2.0",
    "[Number of Ports] 2",
    "[Two-Port Data Order] 12_21",
    "[Number of Frequencies] 3",
    "[Matrix Format] Lower",
    "[Network Data]",
    "[Noise Data]",
    "[Begin Information]",
    "[End Information]",
    "[End]",
    "1e308",
    "-0",
    "inf",
];

const DESCRIPTION: &str = r#"[recording]
format = "touchstone"
file = ["a.s2p", "b.s2p"]
[radar]
kind = "stepped"
[platform]
kind = "linear"
position = "0, -10, 0 m"
velocity = "0.1, 0, 0 m/s"
"#;

pub(super) fn seeds() -> Vec<Vec<u8>> {
    let two = "! scan\n# GHz S RI R 50\n1.0 0.1 0 0.2 0.1 0.2 0.1 0 0\n1.1 0.1 0 0.1 0.2 0.1 0.2 0 0\n1.2 0 0 0.2 0 0.2 0 0 0\n";
    let noise = format!("{two}0.5 2 0.4 -30 0.3\n");
    let second = "[Version] 2.0\n# MHz S DB R 50\n[Number of Ports] 2\n[Two-Port Data Order] 12_21\n[Number of Frequencies] 2\n[Matrix Format] Lower\n\
                  [Network Data]\n1000 -10 0 -20 45 -30 90\n1100 -10 0 -20 60 -30 90\n[End]\n";
    [two, &noise, second]
        .map(|text| text.as_bytes().to_vec())
        .to_vec()
}

pub(super) fn read(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes);
    let ports = [None, Some(1), Some(2), Some(3)][choice(bytes, 4) as usize];
    let direct = match touchstone::read(&text, ports, None) {
        Ok(parameter) => {
            let hz = &parameter.frequencies_hz;
            assert_eq!(hz.len(), parameter.values.len());
            assert!(hz.windows(2).all(|pair| pair[0] < pair[1]));
            assert!(
                parameter
                    .values
                    .iter()
                    .all(|z| z.re.is_finite() && z.im.is_finite())
            );
            format!("{} frequencies", hz.len())
        }
        Err(error) => {
            assert!(error.line > 0 && !error.message.is_empty());
            error.to_string()
        }
    };
    with_files(&[("a.s2p", bytes), ("b.s2p", bytes)], |folder| {
        let file = RecordingFile::new("scan.toml", DESCRIPTION, folder);
        let recording = match file.history(MEMORY_BYTES) {
            Ok(history) => format!("{} samples", history.collection().num_samples),
            Err(error) => error.to_string(),
        };
        format!("{direct}; {recording}")
    })
}
