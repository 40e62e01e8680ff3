//! A small disk that is soon full.

use std::path::Path;
use std::process::Command;

/// A file system of 256 KiB, unmounted when dropped.
pub struct TinyDisk(tempfile::TempDir);

impl TinyDisk {
    /// `None`, with a message, where this machine does not allow it.
    pub fn mount() -> Option<Self> {
        let place = tempfile::tempdir().ok()?;
        let mounted = Command::new("mount")
            .args(["-t", "tmpfs", "-o", "size=256k", "tmpfs"])
            .arg(place.path())
            .output()
            .is_ok_and(|output| output.status.success());
        if !mounted {
            println!("skipped: no right to mount a tmpfs");
        }
        mounted.then_some(Self(place))
    }

    /// Mount point of the file system.
    pub fn path(&self) -> &Path {
        self.0.path()
    }
}

impl Drop for TinyDisk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg(self.0.path()).status();
    }
}
