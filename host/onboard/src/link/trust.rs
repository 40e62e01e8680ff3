//! Whether a file is one that only its user can have written.

use std::fs::Metadata;
use std::io::{self, ErrorKind};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use super::UnnamedFirmware;

/// Bits of a mode: others may write, the group may write, and of a folder: entries are their owners' alone.
const OTHERS_WRITE: u32 = 0o002;
const GROUP_WRITES: u32 = 0o020;
const STICKY: u32 = 0o1000;

/// The administrator, who can do anything.
const ROOT: u32 = 0;

/// The whole path of the file at `path`, if nobody but this user and the administrator can have put it there or
/// changed it: file and folders belong to either, and are not open to others. A group may write where it is
/// that which the user's own files get. A folder in which everybody may write but each only change what is
/// theirs (`/tmp`) is no harm.
///
/// # Errors
/// [`ErrorKind::PermissionDenied`], with what is open to whom; those of the system.
pub(super) fn trusted(path: &Path) -> io::Result<PathBuf> {
    let whole = path.canonicalize()?;
    // There is no asking who one is without `unsafe`; a file that one makes tells.
    let mine = tempfile::tempfile()?.metadata()?;
    for part in whole.ancestors() {
        let about = part.metadata()?;
        if let Some(what) = fault(&about, &mine) {
            let error = UnnamedFirmware::Untrusted {
                firmware: whole.clone(),
                what: format!("{} {what}", part.display()),
            };
            return Err(io::Error::new(ErrorKind::PermissionDenied, error));
        }
    }
    Ok(whole)
}

/// Who else could have changed what is there.
fn fault(about: &Metadata, mine: &Metadata) -> Option<&'static str> {
    let mode = about.mode();
    let sticky = about.is_dir() && mode & STICKY != 0;
    if ![mine.uid(), ROOT].contains(&about.uid()) {
        Some("belongs to another user")
    } else if mode & OTHERS_WRITE != 0 && !sticky {
        Some("can be written by every user (chmod o-w)")
    } else if mode & GROUP_WRITES != 0 && !sticky && ![mine.gid(), ROOT].contains(&about.gid()) {
        Some("can be written by a group (chmod g-w)")
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use std::fs::{self, Permissions};
    use std::os::unix::fs::{PermissionsExt, chown};

    use super::*;

    fn set(path: &Path, mode: u32) {
        fs::set_permissions(path, Permissions::from_mode(mode)).unwrap();
    }

    #[test]
    fn what_others_can_write_is_not_trusted() {
        let outside = tempfile::tempdir().unwrap();
        let folder = outside.path().join("target");
        fs::create_dir(&folder).unwrap();
        let file = folder.join("float");
        fs::write(&file, "firmware").unwrap();
        set(&folder, 0o755);
        set(&file, 0o644);
        let whole = trusted(&file).unwrap();
        assert_eq!(whole, file.canonicalize().unwrap());
        let refused = |part: &str| {
            let error = trusted(&file).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::PermissionDenied);
            let text = error.to_string();
            assert!(text.contains(part) && text.contains("name it"), "{text}");
        };
        set(&file, 0o666);
        refused("float can be written by every user");
        set(&file, 0o644);
        // Whoever can write in a folder can put another file there, and any folder above counts.
        set(&folder, 0o777);
        refused("target can be written by every user");
        set(&folder, 0o755);
        set(outside.path(), 0o777);
        refused("can be written by every user");
        // But not where each can only change what is theirs.
        set(outside.path(), 0o1777);
        trusted(&file).unwrap();
        // A group that is one's own is oneself.
        set(&folder, 0o775);
        trusted(&file).unwrap();
        // Only the administrator can give a file away.
        if chown(&file, Some(12_345), None).is_ok() {
            refused("float belongs to another user");
            chown(&file, Some(0), None).unwrap();
            chown(&folder, None, Some(12_345)).unwrap();
            refused("target can be written by a group");
        }
    }

    #[test]
    fn a_link_is_where_it_leads() {
        let open = tempfile::tempdir().unwrap();
        let file = open.path().join("float");
        fs::write(&file, "firmware").unwrap();
        set(&file, 0o666);
        let own = tempfile::tempdir().unwrap();
        let link = own.path().join("float");
        std::os::unix::fs::symlink(&file, &link).unwrap();
        assert!(trusted(&link).is_err());
    }
}
