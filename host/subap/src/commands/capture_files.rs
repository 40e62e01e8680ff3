//! Files of a capture.

use std::path::{Path, PathBuf};

use subaperture::io::written::{FileKind, WrittenFile};

/// Both files of a SigMF recording.
pub(super) fn recording_files(out: &Path) -> [WrittenFile; 2] {
    let meta = meta(out);
    let data = meta.with_extension("sigmf-data");
    [
        WrittenFile::new(meta, FileKind::Recording),
        WrittenFile::new(data, FileKind::Samples),
    ]
}

/// Path of the SigMF metadata file of a recording.
pub(super) fn meta(out: &Path) -> PathBuf {
    let mut name = out.as_os_str().to_owned();
    name.push(".sigmf-meta");
    PathBuf::from(name)
}
