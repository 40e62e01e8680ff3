//! Dependencies of a stage, and their fingerprint.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use super::stamp::FileStamp;

/// Dependencies of the outputs of a stage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Basis {
    /// Version of the program.
    pub version: String,
    /// Name of the stage.
    pub stage: String,
    /// Settings of the stage by key, as `former.error`.
    pub settings: Map<String, Value>,
    /// Input files, except outputs of preceding stages.
    pub files: Vec<FileStamp>,
    /// Preceding stages and their fingerprints.
    pub after: BTreeMap<String, String>,
}

impl Basis {
    /// Digest of all fields except the paths of files, which may move.
    pub fn fingerprint(&self) -> String {
        let files: Vec<Value> = self
            .files
            .iter()
            .map(|file| json!([file.bytes, file.crc32]))
            .collect();
        // Maps of JSON are in the order of their keys.
        let all = json!([self.version, self.stage, self.settings, files, self.after]);
        fingerprint(all.to_string().as_bytes())
    }
}

/// FNV-1a of 128 bits (RFC 9923), in hexadecimal.
pub fn fingerprint(bytes: &[u8]) -> String {
    const START: u128 = 0x6c62_272e_07bb_0142_62b8_2175_6295_c58d;
    const PRIME: u128 = (1 << 88) + 0x13b;
    let hash = bytes.iter().fold(START, |hash, &byte| {
        (hash ^ u128::from(byte)).wrapping_mul(PRIME)
    });
    format!("{hash:032x}")
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(crate) fn basis(setting: i64) -> Basis {
        Basis {
            version: "1".to_owned(),
            stage: "focus".to_owned(),
            settings: Map::from_iter([("former.error".to_owned(), json!(setting))]),
            files: vec![FileStamp {
                path: "a.cphd".to_owned(),
                bytes: 9,
                crc32: "cbf43926".to_owned(),
            }],
            after: BTreeMap::from([("autofocus".to_owned(), "ff".to_owned())]),
        }
    }

    #[test]
    fn digests_agree_with_the_definition_of_fnv_1a() {
        // The digest of no bytes is the offset; that of "a" was computed with Python's integers.
        assert_eq!(fingerprint(b""), "6c62272e07bb014262b821756295c58d");
        assert_eq!(fingerprint(b"a"), "d228cb696f1a8caf78912b704e4a8964");
    }

    #[test]
    fn fingerprint_covers_all_fields_except_paths() {
        let first = basis(-60);
        let other = |change: &dyn Fn(&mut Basis)| {
            let mut changed = first.clone();
            change(&mut changed);
            changed.fingerprint() != first.fingerprint()
        };
        assert!(!other(&|_| {}));
        assert!(!other(&|b| b.files[0].path = "moved/a.cphd".to_owned()));
        assert!(other(&|b| b.version = "2".to_owned()));
        assert!(other(&|b| b.stage = "check".to_owned()));
        assert!(other(&|b| b.settings = basis(-61).settings));
        assert!(other(&|b| b.files[0].crc32 = "cbf43927".to_owned()));
        assert!(other(&|b| b.files.clear()));
        assert!(other(&|b| {
            b.after.insert("autofocus".to_owned(), "fe".to_owned());
        }));
    }
}
