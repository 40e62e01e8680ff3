//! Claims on the outputs of a run, made before the work. A claim is refused for an input of the run, a file of another program or a file
//! that another run is writing.
//!
//! An output may replace a file written by this program ([`super::ours`]) or an empty file, and any other file if
//! `forced`. It never replaces an input of the same run; inputs are compared as files, not by path. Claims are locks:
//! other processes cannot claim the same output until the claims are dropped or the process ends.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::atomic::WriteError;
use super::input::same_path;
use super::ours::{Kind, objection};
use super::place::OutputPlace;
use super::stack::is_group;

/// Claimed outputs of one run.
#[derive(Debug)]
pub struct OutputClaims {
    inputs: Vec<PathBuf>,
    forced: bool,
    /// Place of each output, and for a folder the names of its files.
    held: Vec<(OutputPlace, Vec<String>)>,
}

impl OutputClaims {
    /// Create the claims of a run that reads `inputs` and the files named by descriptions among them. `forced`
    /// permits the outputs to replace any file except an input.
    pub fn new<P: AsRef<Path>>(inputs: &[P], forced: bool) -> Self {
        let mut all: Vec<PathBuf> = Vec::new();
        for path in inputs.iter().map(AsRef::as_ref) {
            all.push(path.to_owned());
            #[cfg(feature = "recording")]
            if path.extension().is_some_and(|end| end == "toml") {
                all.extend(subaperture_describe::named_files(path));
            }
            // The folder of an image product.
            if path.is_dir() {
                all.extend(["image.npy", "image.json"].map(|name| path.join(name)));
            }
        }
        Self {
            inputs: all,
            forced,
            held: Vec::new(),
        }
    }

    /// State that a description among the inputs names an output at this path: one of its mentions is no input.
    pub fn is_named_output(&mut self, path: &Path) {
        if let Some(at) = self.inputs.iter().position(|input| same_path(input, path)) {
            self.inputs.remove(at);
        }
    }

    /// Claim a file.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn file(&mut self, path: &Path, kind: Kind) -> Result<(), WriteError> {
        let place = OutputPlace::of_file(path)?;
        self.check(path, &place.path, kind)?;
        self.hold(path, place, Vec::new())
    }

    /// Claim a companion of one of our files whose format has no room for a mark. Any existing file except an input may be replaced.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn unmarked(&mut self, path: &Path) -> Result<(), WriteError> {
        let place = OutputPlace::of_file(path)?;
        self.check_input(path, &place.path)?;
        self.hold(path, place, Vec::new())
    }

    /// Claim a folder that is written as a whole. It may replace a [stack](super::stack) written by this program, and
    /// any Zarr group if forced. Any other folder, or a folder that contains an input, is refused.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn store(&mut self, path: &Path) -> Result<(), WriteError> {
        let place = OutputPlace::of_folder(path)?;
        let within = |input: &&PathBuf| {
            fs::canonicalize(input).is_ok_and(|input| input.starts_with(&place.path))
        };
        if let Some(input) = self.inputs.iter().find(within) {
            return Err(WriteError::IsInput {
                path: path.to_owned(),
                input: input.clone(),
            });
        }
        if place.path.exists() {
            let [is_zarr, is_ours] = is_group(&place.path);
            if !is_zarr {
                return Err(WriteError::Blocked {
                    path: path.to_owned(),
                    what: "a folder of that name exists",
                });
            }
            if !is_ours && !self.forced {
                return Err(WriteError::NotOurs {
                    path: path.to_owned(),
                    what: "it is not a stack written by subap",
                });
            }
        }
        self.hold(path, place, Vec::new())
    }

    /// Claim files of these names in a folder, which is created with the first of them. Other files in the folder are
    /// not affected.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn folder<S: AsRef<str>>(
        &mut self,
        folder: &Path,
        names: impl IntoIterator<Item = S>,
    ) -> Result<(), WriteError> {
        let place = OutputPlace::of_folder(folder)?;
        let mut held = Vec::new();
        for name in names {
            let name = name.as_ref();
            self.check(
                &folder.join(name),
                &place.path.join(name),
                Kind::of_name(name),
            )?;
            held.push(name.to_owned());
        }
        self.hold(folder, place, held)
    }

    /// Refuse a file that may not be replaced; `called` is the user's name for `path`.
    fn check(&self, called: &Path, path: &Path, kind: Kind) -> Result<(), WriteError> {
        self.check_input(called, path)?;
        match fs::metadata(path) {
            Ok(about) if about.is_dir() => {
                return Err(WriteError::Blocked {
                    path: called.to_owned(),
                    what: "a folder of that name exists",
                });
            }
            Ok(_) if self.forced => return Ok(()),
            Ok(_) => {}
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
            Err(source) => return Err(failed(called, source)),
        }
        match objection(path, kind) {
            Ok(None) => Ok(()),
            Ok(Some(what)) => Err(WriteError::NotOurs {
                path: called.to_owned(),
                what,
            }),
            Err(source) => Err(failed(called, source)),
        }
    }

    fn check_input(&self, called: &Path, path: &Path) -> Result<(), WriteError> {
        match self.inputs.iter().find(|input| same_path(input, path)) {
            Some(input) => Err(WriteError::IsInput {
                path: called.to_owned(),
                input: input.clone(),
            }),
            None => Ok(()),
        }
    }

    fn hold(
        &mut self,
        called: &Path,
        place: OutputPlace,
        names: Vec<String>,
    ) -> Result<(), WriteError> {
        let files = |place: &OutputPlace, names: &[String]| -> Vec<PathBuf> {
            match names {
                [] => vec![place.path.clone()],
                _ => names.iter().map(|name| place.path.join(name)).collect(),
            }
        };
        let own = files(&place, &names);
        for (other, names) in &self.held {
            if files(other, names).iter().any(|file| own.contains(file)) {
                return Err(WriteError::Twice {
                    path: called.to_owned(),
                });
            }
        }
        self.held.push((place, names));
        Ok(())
    }
}

impl Drop for OutputClaims {
    /// Drop in reverse order: a folder created for a later output may lie within one created for an earlier output.
    fn drop(&mut self) {
        while self.held.pop().is_some() {}
    }
}

fn failed(path: &Path, source: io::Error) -> WriteError {
    WriteError::Io {
        path: path.to_owned(),
        needed_bytes: 0,
        source,
    }
}
