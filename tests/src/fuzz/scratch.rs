//! Files for readers that need a path: in memory where the system supports it, one folder per thread.

use std::path::Path;

use tempfile::TempDir;

thread_local! {
    static FOLDER: TempDir = folder().expect("a temporary folder");
}

fn folder() -> std::io::Result<TempDir> {
    let in_memory = Path::new("/dev/shm");
    let mut builder = tempfile::Builder::new();
    builder.prefix("subap-fuzz-");
    match builder.tempdir_in(in_memory) {
        Ok(folder) => Ok(folder),
        Err(_) => builder.tempdir(),
    }
}

/// Call `read` with a folder that contains files of these names and bytes.
pub(super) fn with_files<T>(files: &[(&str, &[u8])], read: impl FnOnce(&Path) -> T) -> T {
    FOLDER.with(|folder| {
        for (name, bytes) in files {
            std::fs::write(folder.path().join(name), bytes).expect("a file in a temporary folder");
        }
        read(folder.path())
    })
}
