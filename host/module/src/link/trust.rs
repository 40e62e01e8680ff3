//! Check whether a file can only have been written by its user.

use std::fs::Metadata;
use std::io::{self, ErrorKind};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use super::UnnamedFirmware;

/// Mode bits: writable by others; writable by the group; sticky folder, whose entries only their owners can change.
const OTHERS_WRITE: u32 = 0o002;
const GROUP_WRITES: u32 = 0o020;
const STICKY: u32 = 0o1000;

/// User ID of the administrator.
const ROOT: u32 = 0;

/// Canonical path of the file at `path`, if only this user and the administrator can have created or changed it: they own the
/// file and its folders, and others cannot write to them. A group may have write permission if it is the group of the user's
/// own files. A sticky folder such as `/tmp` is allowed.
///
/// # Errors
/// [`ErrorKind::PermissionDenied`], stating which path is writable by whom; errors of the system.
pub(super) fn trusted(path: &Path) -> io::Result<PathBuf> {
    let whole = path.canonicalize()?;
    // The user ID cannot be queried without `unsafe`; the owner of a new file reveals it.
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

/// Who else could have changed the file or folder.
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
    fn firmware_writable_by_others_is_not_trusted() {
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
        // Write permission in a folder allows replacing its files; every folder of the path counts.
        set(&folder, 0o777);
        refused("target can be written by every user");
        set(&folder, 0o755);
        set(outside.path(), 0o777);
        refused("can be written by every user");
        // But not in a sticky folder.
        set(outside.path(), 0o1777);
        trusted(&file).unwrap();
        // The user's own group is acceptable.
        set(&folder, 0o775);
        trusted(&file).unwrap();
        // Only the administrator can change the owner of a file.
        if chown(&file, Some(12_345), None).is_ok() {
            refused("float belongs to another user");
            chown(&file, Some(0), None).unwrap();
            chown(&folder, None, Some(12_345)).unwrap();
            refused("target can be written by a group");
        }
    }

    #[test]
    fn symbolic_link_is_judged_by_its_target() {
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
