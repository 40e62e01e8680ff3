//! Where results go: seen to be writable before long work starts.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};

/// Fails if nothing could be written at `out` (a file or folder to make): the work behind it may
/// take hours. Leaves no trace.
pub(crate) fn check_writable(out: &Path) -> anyhow::Result<()> {
    let parent = nearest_folder(out);
    if !parent.is_dir() {
        bail!("cannot write {}: {} is not a folder", out.display(), parent.display());
    }
    // Permissions, read-only mounts and quotas all show by trying and by nothing else.
    let probe = parent.join(format!(".subap-{}-probe", std::process::id()));
    fs::create_dir(&probe).and_then(|()| fs::remove_dir(&probe)).with_context(|| {
        format!("cannot write {}: nothing can be made in {}", out.display(), parent.display())
    })
}

/// The closest ancestor of `path` that exists.
fn nearest_folder(path: &Path) -> PathBuf {
    let mut parent = path.parent().unwrap_or(Path::new("."));
    loop {
        if parent.as_os_str().is_empty() {
            return PathBuf::from(".");
        }
        if parent.symlink_metadata().is_ok() {
            return parent.to_owned();
        }
        parent = parent.parent().unwrap_or(Path::new("."));
    }
}
