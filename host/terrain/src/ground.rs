//! Heights of the ground over a region, of as many files as it takes.

use std::fs;
use std::path::{Path, PathBuf};

use crate::raster::Raster;
use crate::{Region, TerrainError, geotiff, hgt};

/// What lies between the ellipsoid and the surface above which a model states its heights.
#[derive(Clone, Debug, Default)]
pub enum Geoid {
    /// Nothing: heights are above the ellipsoid, or taken as if they were.
    #[default]
    None,
    /// So much everywhere, metres.
    Undulation(f64),
    /// A file of undulations, metres, read as models of the ground are.
    File(PathBuf),
}

/// Heights of the ground above the ellipsoid, over a region.
#[derive(Debug)]
pub struct Ground {
    name: String,
    rasters: Vec<Raster>,
    undulation: Undulation,
    files: Vec<PathBuf>,
}

#[derive(Debug)]
enum Undulation {
    Constant(f64),
    Rasters(Vec<Raster>),
}

impl Ground {
    /// What a file, or all files of a folder, tell of a region, within a bound of memory: HGT and GeoTIFF, by the ends of their names. Where files
    /// overlap the first by name counts.
    ///
    /// # Errors
    /// [`TerrainError`].
    pub fn open(
        path: &Path,
        geoid: &Geoid,
        region: &Region,
        memory_bytes: u64,
    ) -> Result<Self, TerrainError> {
        let mut left = memory_bytes;
        let (rasters, mut files) = rasters(path, region, &mut left)?;
        let models = listed(&files);
        let undulation = match geoid {
            Geoid::None => Undulation::Constant(0.0),
            Geoid::Undulation(metres) => Undulation::Constant(*metres),
            Geoid::File(path) => {
                let (rasters, own) = self::rasters(path, region, &mut left)?;
                files.extend(own);
                Undulation::Rasters(rasters)
            }
        };
        let above = match geoid {
            Geoid::None => ", its heights taken as above the ellipsoid".to_owned(),
            Geoid::Undulation(metres) => format!(" above a geoid {metres} m above the ellipsoid"),
            Geoid::File(path) => format!(" above the geoid of {}", short(path)),
        };
        Ok(Self {
            name: format!("the ground of {models}{above}"),
            rasters,
            undulation,
            files,
        })
    }

    /// What it is, in words.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The files that were read.
    pub fn files(&self) -> &[PathBuf] {
        &self.files
    }

    /// Height above the ellipsoid, metres, where it is known.
    ///
    /// # Errors
    /// [`TerrainError::Void`], [`TerrainError::NoUndulation`].
    pub fn height_m(&self, latitude_deg: f64, longitude_deg: f64) -> Result<f64, TerrainError> {
        let found = |rasters: &[Raster]| height_of(rasters, latitude_deg, longitude_deg);
        let height = found(&self.rasters).ok_or_else(|| TerrainError::Void {
            surface: self.name.clone(),
            latitude_deg,
            longitude_deg,
        })?;
        let undulation = match &self.undulation {
            Undulation::Constant(metres) => Some(*metres),
            Undulation::Rasters(rasters) => found(rasters),
        };
        let unknown = TerrainError::NoUndulation {
            latitude_deg,
            longitude_deg,
        };
        Ok(height + undulation.ok_or(unknown)?)
    }

    /// Metres between posts, about: the least of all files.
    pub fn step_m(&self, latitude_deg: f64) -> f64 {
        let steps = self
            .rasters
            .iter()
            .map(|raster| raster.step_m(latitude_deg));
        steps.fold(f64::INFINITY, f64::min)
    }
}

/// The height at a place in the first raster that has it; or between the last posts of one and the first of its neighbours, as models whose files share no posts have it.
fn height_of(rasters: &[Raster], latitude_deg: f64, longitude_deg: f64) -> Option<f64> {
    let within = |latitude, longitude| {
        let mut all = rasters.iter();
        all.find_map(|raster| raster.at(latitude, longitude))
    };
    within(latitude_deg, longitude_deg).or_else(|| {
        let mut all = rasters.iter();
        all.find_map(|raster| raster.at_edge(latitude_deg, longitude_deg, within))
    })
}

/// A path's last part.
fn short(path: &Path) -> String {
    let name = path.file_name().unwrap_or(path.as_os_str());
    name.to_string_lossy().into_owned()
}

/// Names of files, three at the most.
fn listed(files: &[PathBuf]) -> String {
    const MOST: usize = 3;
    let named: Vec<String> = files.iter().take(MOST).map(|path| short(path)).collect();
    match files.len() {
        0..=MOST => named.join(", "),
        count => format!("{} and {} more", named.join(", "), count - MOST),
    }
}

/// The parts that a region needs, and of which files, taking what they take from what is `left`.
fn rasters(
    path: &Path,
    region: &Region,
    left: &mut u64,
) -> Result<(Vec<Raster>, Vec<PathBuf>), TerrainError> {
    let failed = |source| TerrainError::Io {
        path: path.to_owned(),
        source,
    };
    let mut paths = Vec::new();
    match fs::metadata(path).map_err(failed)?.is_dir() {
        false => paths.push(path.to_owned()),
        true => {
            for entry in fs::read_dir(path).map_err(failed)? {
                let own = entry.map_err(failed)?.path();
                if Format::of(&own).is_some() {
                    paths.push(own);
                }
            }
            paths.sort();
        }
    }
    let (mut rasters, mut files) = (Vec::new(), Vec::new());
    for own in paths {
        let read = match Format::of(&own) {
            Some(Format::Hgt) => hgt::read(&own, region, *left)?,
            Some(Format::GeoTiff) => geotiff::read(&own, region, *left)?,
            None => {
                return Err(TerrainError::Format {
                    path: own,
                    what: "elevation models are read from .hgt (SRTM, unpacked) and .tif or .tiff (GeoTIFF): convert it, as gdal_translate does"
                        .to_owned(),
                });
            }
        };
        if let Some(raster) = read {
            *left = left.saturating_sub(raster.bytes());
            rasters.push(raster);
            files.push(own);
        }
    }
    match rasters.is_empty() {
        false => Ok((rasters, files)),
        true => Err(TerrainError::Nothing {
            path: path.to_owned(),
            region: region.to_string(),
        }),
    }
}

#[derive(Clone, Copy)]
enum Format {
    Hgt,
    GeoTiff,
}

impl Format {
    fn of(path: &Path) -> Option<Self> {
        let end = path.extension()?.to_str()?.to_ascii_lowercase();
        match end.as_str() {
            "hgt" => Some(Self::Hgt),
            "tif" | "tiff" => Some(Self::GeoTiff),
            _ => None,
        }
    }
}
