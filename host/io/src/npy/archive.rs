//! Arrays in an archive (`.npz`), which is a zip file of `.npy` files.

use std::fs::File;
use std::io::Read;

use super::Array;
use subaperture_model::phase_history::ReadError;

/// What `take` makes of the contents of the array `name`, with or without its `.npy`; or why there is no such array.
#[cfg(feature = "npz")]
pub(super) fn read(
    file: &File,
    name: &str,
    take: impl FnOnce(&mut dyn Read) -> Result<Array, ReadError>,
) -> Result<Result<Array, ReadError>, String> {
    let mut archive = zip::ZipArchive::new(std::io::BufReader::new(file))
        .map_err(|error| format!("not an archive of arrays (.npz): {error}"))?;
    let member = format!("{}.npy", name.strip_suffix(".npy").unwrap_or(name));
    let Some(index) = archive.index_for_name(&member) else {
        let known: Vec<_> = archive.file_names().flatten().collect();
        return Err(format!(
            "has no array {name}; it has {}",
            known.join(", ").replace(".npy", "")
        ));
    };
    let mut member = archive
        .by_index(index)
        .map_err(|error| format!("array {name}: {error}"))?;
    Ok(take(&mut member))
}

/// None is read: the archive's format is a feature that is off.
#[cfg(not(feature = "npz"))]
pub(super) fn read(
    _: &File,
    name: &str,
    _: impl FnOnce(&mut dyn Read) -> Result<Array, ReadError>,
) -> Result<Result<Array, ReadError>, String> {
    Err(format!(
        "array {name} is in an archive (.npz), and this program was built without the feature 'npz' of subaperture"
    ))
}

/// The arrays of an archive.
#[cfg(feature = "npz")]
pub(super) fn names(file: &File) -> Result<Vec<String>, String> {
    let archive = zip::ZipArchive::new(std::io::BufReader::new(file))
        .map_err(|error| format!("not an archive of arrays (.npz): {error}"))?;
    let names = archive.file_names().flatten();
    Ok(names
        .map(|name| name.strip_suffix(".npy").unwrap_or(&name).to_owned())
        .collect())
}
