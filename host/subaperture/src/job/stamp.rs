//! Identification of files and folders by size and CRC-32.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use subaperture_io::input::checksum;

/// Size and checksum of a file or a whole folder.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FileStamp {
    /// Path; for outputs relative to the job's folder.
    pub path: String,
    /// Size, bytes; for a folder the total of its files.
    pub bytes: u64,
    /// CRC-32 in hexadecimal; for a folder that of its files' names, sizes and CRC-32.
    pub crc32: String,
}

/// Stamp of the file or folder at `path`, with `name` as its path; `None` if `path` does not exist. Hidden files in a folder (locks, leftovers) are ignored.
///
/// # Errors
/// The error of the operating system.
pub fn stamp(path: &Path, name: &str) -> io::Result<Option<FileStamp>> {
    let about = match fs::metadata(path) {
        Ok(about) => about,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(error),
    };
    let (bytes, crc32) = if about.is_dir() {
        of_folder(path)?
    } else {
        checksum(&mut File::open(path)?)?
    };
    Ok(Some(FileStamp {
        path: name.to_owned(),
        bytes,
        crc32,
    }))
}

fn of_folder(root: &Path) -> io::Result<(u64, String)> {
    let mut files = Vec::new();
    let mut folders = vec![PathBuf::new()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(root.join(&folder))? {
            let entry = entry?;
            let name = entry.file_name();
            if name.as_encoded_bytes().starts_with(b".") {
                continue;
            }
            let within = folder.join(name);
            if fs::metadata(root.join(&within))?.is_dir() {
                folders.push(within);
            } else {
                files.push(within);
            }
        }
    }
    // The order of directory entries depends on the system.
    files.sort();
    let (mut bytes, mut all) = (0, String::new());
    for file in files {
        let (size, crc32) = checksum(&mut File::open(root.join(&file))?)?;
        bytes += size;
        all.push_str(&format!("{} {size} {crc32}\n", file.display()));
    }
    Ok((bytes, format!("{:08x}", crc32fast::hash(all.as_bytes()))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fingerprint_follows_content_of_files_and_names_in_folders() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        assert_eq!(stamp(&at.join("none"), "none").unwrap(), None);
        fs::write(at.join("a"), b"123456789").unwrap();
        let of_file = stamp(&at.join("a"), "a").unwrap().unwrap();
        // The check value of CRC-32.
        assert_eq!((of_file.bytes, of_file.crc32.as_str()), (9, "cbf43926"));

        fs::create_dir_all(at.join("f/g")).unwrap();
        fs::write(at.join("f/g/x"), b"1").unwrap();
        fs::write(at.join("f/y"), b"22").unwrap();
        let of = || stamp(&at.join("f"), "f").unwrap().unwrap();
        let first = of();
        assert_eq!(first.bytes, 3);
        fs::write(at.join("f/.lock"), b"hidden").unwrap();
        assert_eq!(of(), first);
        fs::rename(at.join("f/y"), at.join("f/z")).unwrap();
        let renamed = of();
        assert_eq!(renamed.bytes, 3);
        assert_ne!(renamed.crc32, first.crc32);
        fs::write(at.join("f/z"), b"23").unwrap();
        assert_ne!(of().crc32, renamed.crc32);
    }
}
