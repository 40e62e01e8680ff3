//! Arrays in an archive (`.npz`), a zip file of `.npy` files.

use std::io::{Read, Seek};

use super::Array;

/// Read the array `name`, with or without its suffix `.npy`, by `take`.
#[cfg(feature = "npz")]
pub(super) fn read<E>(
    file: impl Read + Seek,
    name: &str,
    take: impl FnOnce(&mut dyn Read) -> Result<Array, E>,
) -> Result<Result<Array, E>, String> {
    let mut archive = zip::ZipArchive::new(std::io::BufReader::new(file))
        .map_err(|error| format!("not an archive of arrays (.npz): {error}"))?;
    let member = format!("{}.npy", name.strip_suffix(".npy").unwrap_or(name));
    let Some(index) = archive.index_for_name(&member) else {
        let known: Vec<_> = archive.file_names().flatten().collect();
        return Err(format!(
            "expected an array {name}, found {}",
            known.join(", ").replace(".npy", "")
        ));
    };
    let mut member = archive
        .by_index(index)
        .map_err(|error| format!("array {name}: {error}"))?;
    Ok(take(&mut member))
}

/// Refuse: archives need a feature that is off.
#[cfg(not(feature = "npz"))]
pub(super) fn read<E>(
    _: impl Read + Seek,
    name: &str,
    _: impl FnOnce(&mut dyn Read) -> Result<Array, E>,
) -> Result<Result<Array, E>, String> {
    Err(format!(
        "array {name} is in an archive (.npz), and this program was built without the feature 'npz' of subaperture"
    ))
}

/// Names of the arrays in an archive.
#[cfg(feature = "npz")]
pub(super) fn names(file: impl Read + Seek) -> Result<Vec<String>, String> {
    let archive = zip::ZipArchive::new(std::io::BufReader::new(file))
        .map_err(|error| format!("not an archive of arrays (.npz): {error}"))?;
    let names = archive.file_names().flatten();
    Ok(names
        .map(|name| name.strip_suffix(".npy").unwrap_or(&name).to_owned())
        .collect())
}
