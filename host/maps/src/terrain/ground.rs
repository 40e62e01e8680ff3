//! Ground heights over a region, from one or more elevation model files.

use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

use subaperture_model::units::Dimension;

use crate::terrain::raster::{Model, Raster};
use crate::terrain::{Region, TerrainError, geotiff, hgt};

/// Geoid undulation added to the heights of an elevation model.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Geoid {
    /// None: heights are used as ellipsoidal. Default.
    #[default]
    None,
    /// Constant undulation, metres.
    Undulation(f64),
    /// Raster of undulations, metres, in a format of elevation models.
    File(PathBuf),
}

impl Geoid {
    /// Undulation in metres, or file: a text that begins as a number is one, unless there is a file of this name.
    ///
    /// # Errors
    /// The expected form, for a number that is not a possible height.
    pub fn parse(path: PathBuf) -> Result<Self, String> {
        match path.to_str() {
            Some(text)
                if text.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c))
                    && !path.exists() =>
            {
                height_m(text).map(Self::Undulation)
            }
            _ => Ok(Self::File(path)),
        }
    }

    /// The file, if undulations are read from one.
    pub fn file(&self) -> Option<&Path> {
        match self {
            Self::File(path) => Some(path),
            Self::None | Self::Undulation(_) => None,
        }
    }
}

impl fmt::Display for Geoid {
    /// Text that [`Geoid::parse`] reads.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::None => f.write_str("0"),
            Self::Undulation(metres) => write!(f, "{metres}"),
            Self::File(path) => path.display().fmt(f),
        }
    }
}

/// Parse a height or undulation, metres, that the Earth may have.
pub(super) fn height_m(text: &str) -> Result<f64, String> {
    let plain: Option<f64> = text.trim().parse().ok();
    let height_m = match plain.filter(|height_m| height_m.is_finite()) {
        Some(height_m) => height_m,
        None => Dimension::Length.parse(text)?,
    };
    match height_m.abs() <= 1e5 {
        true => Ok(height_m),
        false => Err(format!(
            "{height_m} m is beyond the Earth's surface: heights of at most 100 km are possible"
        )),
    }
}

/// Ground heights above the WGS 84 ellipsoid over a region.
#[derive(Debug)]
pub struct Ground {
    name: String,
    rasters: Vec<Raster>,
    undulation: Undulation,
    files: Vec<PathBuf>,
    warnings: Vec<String>,
}

#[derive(Debug)]
enum Undulation {
    Constant(f64),
    Rasters(Vec<Raster>),
}

impl Ground {
    /// Read a file, or all files of a folder: HGT and GeoTIFF, by file name extension. Only the part that `region` needs is held, within
    /// `memory_bytes`. Where files overlap, the first by name is used.
    ///
    /// # Errors
    /// [`TerrainError`] if a file cannot be read, is not supported, exceeds the memory or does not overlap the region.
    pub fn open(
        path: &Path,
        geoid: &Geoid,
        region: &Region,
        memory_bytes: u64,
    ) -> Result<Self, TerrainError> {
        let mut left = memory_bytes;
        let Read {
            rasters,
            mut files,
            mut warnings,
            above_sea,
        } = rasters(path, region, &mut left)?;
        let models = listed(&files);
        let undulation = match geoid {
            Geoid::None => Undulation::Constant(0.0),
            Geoid::Undulation(metres) => Undulation::Constant(*metres),
            Geoid::File(path) => {
                let own = self::rasters(path, region, &mut left)?;
                files.extend(own.files);
                warnings.extend(own.warnings);
                Undulation::Rasters(own.rasters)
            }
        };
        let above = match geoid {
            Geoid::None => ", heights used as ellipsoidal".to_owned(),
            Geoid::Undulation(metres) => format!(" above a geoid {metres} m above the ellipsoid"),
            Geoid::File(path) => format!(" above the geoid of {}", short(path)),
        };
        if let (Some(datum), Geoid::None) = (above_sea, geoid) {
            warnings.push(format!(
                "{}: heights refer to {datum} and are used as ellipsoidal; errors of up to 107 m are possible; give the geoid",
                path.display()
            ));
        }
        Ok(Self {
            name: format!("the ground of {models}{above}"),
            rasters,
            undulation,
            files,
            warnings,
        })
    }

    /// Description: files and vertical reference.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Warnings, one sentence each.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Files that contributed heights or undulations.
    pub fn files(&self) -> &[PathBuf] {
        &self.files
    }

    /// Height above the ellipsoid, metres.
    ///
    /// # Errors
    /// [`TerrainError::Void`] outside the model or in a void; [`TerrainError::NoUndulation`] outside the geoid raster.
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

    /// Approximate post spacing, metres: the finest of all files.
    pub fn step_m(&self, latitude_deg: f64) -> f64 {
        let steps = self
            .rasters
            .iter()
            .map(|raster| raster.step_m(latitude_deg));
        steps.fold(f64::INFINITY, f64::min)
    }
}

/// Height from the first raster that covers a position. Between the outermost posts of two adjacent rasters that share no posts, it is interpolated across the gap.
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

/// File name of a path.
fn short(path: &Path) -> String {
    let name = path.file_name().unwrap_or(path.as_os_str());
    name.to_string_lossy().into_owned()
}

/// Comma-separated file names, at most three.
fn listed(files: &[PathBuf]) -> String {
    const MOST: usize = 3;
    let named: Vec<String> = files.iter().take(MOST).map(|path| short(path)).collect();
    match files.len() {
        0..=MOST => named.join(", "),
        count => format!("{} and {} more", named.join(", "), count - MOST),
    }
}

/// Rasters read from a file or folder.
#[derive(Default)]
struct Read {
    rasters: Vec<Raster>,
    files: Vec<PathBuf>,
    warnings: Vec<String>,
    /// Geoid to which heights refer, if a file names one.
    above_sea: Option<&'static str>,
}

/// Read the parts that a region needs; subtract their memory from `left`.
fn rasters(path: &Path, region: &Region, left: &mut u64) -> Result<Read, TerrainError> {
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
    let mut all = Read::default();
    for own in paths {
        let read = match Format::of(&own) {
            Some(Format::Hgt) => hgt::read(&own, region, *left)?.map(Model::plain),
            Some(Format::GeoTiff) => geotiff::read(&own, region, *left)?,
            None => {
                return Err(TerrainError::Format {
                    path: own,
                    what: "expected an elevation model in .hgt (SRTM, uncompressed), .tif or .tiff (GeoTIFF); convert the file, for example with gdal_translate"
                        .to_owned(),
                });
            }
        };
        if let Some(model) = read {
            *left = left.saturating_sub(model.raster.bytes());
            all.rasters.push(model.raster);
            all.files.push(own);
            all.warnings.extend(model.warnings);
            all.above_sea = all.above_sea.or(model.above_sea);
        }
    }
    match all.rasters.is_empty() {
        false => Ok(all),
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
