//! Terrain of a scene from `[scene.terrain]`.

use std::path::Path;

use glam::DVec2;
use subaperture_describe::declare::Located;
use subaperture_describe::error::Fault;
use subaperture_io::npy;
use subaperture_model::geometry::{Axis, Extent, Relief};

use super::around::Around;
use super::scene_keys::{HillKeys, RidgeKeys, SceneKeys, TerrainKeys, TerrainSource};
use crate::scene::{HeightFunction, Hill, Ridges, Terrain};

/// Bytes of an array of heights at most.
const MAX_BYTES: u64 = 8 * Relief::MAX_NODES as u64;

/// Build the terrain; `None` for flat ground. An elevation model takes at most a quarter of `memory_bytes`.
pub(super) fn build(
    scene: &SceneKeys,
    around: &Around,
    memory_bytes: u64,
) -> Result<Option<Terrain>, Fault> {
    let keys = &scene.terrain;
    let mut function = HeightFunction {
        hills: keys.hill.iter().map(HillKeys::build).collect(),
        ridges: keys.ridge.iter().map(RidgeKeys::build).collect(),
        ..HeightFunction::default()
    };
    let base = match &keys.kind {
        TerrainSource::Function(own) => {
            function.slope = DVec2::new(own.slope_x, own.slope_y);
            (function.rms_m, function.correlation_m) = (own.rms_m, own.correlation_m);
            if function.is_flat() {
                return Ok(None);
            }
            None
        }
        TerrainSource::File(own) => {
            let extent = extent(scene, keys)?;
            let path = around.folder.join(&*own.file);
            let is_array = path.extension().is_some_and(|end| end == "npy");
            let read = match is_array {
                true => array(&path, &extent),
                false if !scene.origin.is_given() => Err(
                    "an elevation model has geographic positions: give latitude and longitude of [scene.origin]"
                        .to_owned(),
                ),
                false => model(&path, &extent, keys, around, memory_bytes / 4),
            };
            Some(read.map_err(|error| own.file.fault(error))?)
        }
    };
    let extent = extent(scene, keys)?;
    let own = function.prepare(around.seed);
    let name = base.as_ref().map_or("a sum of functions", Relief::surface);
    let height_m = |at: DVec2| {
        let base_m = base.as_ref().map_or(0.0, |base| base.height_m(at.x, at.y));
        base_m + own(at)
    };
    let terrain = Terrain::sample(name, &extent, *keys.spacing_m, height_m);
    let terrain = terrain.map_err(|error| keys.spacing_m.fault(error.to_string()))?;
    Ok(Some(terrain))
}

/// Extent of the terrain: its own, or that of the scene.
fn extent(scene: &SceneKeys, keys: &TerrainKeys) -> Result<Extent, Fault> {
    type Side = Option<Located<(f64, f64)>>;
    let side = |own: &Side, scene: &Side, name: &str| match (own, scene) {
        (Some(side), _) | (None, Some(side)) => Ok(**side),
        (None, None) => Err(Fault::new(
            &keys.header,
            format!("the terrain has no extent: give {name} of [scene] or of [scene.terrain]"),
        )),
    };
    Ok(Extent {
        x_m: side(&keys.x_m, &scene.x_m, "x")?,
        y_m: side(&keys.y_m, &scene.y_m, "y")?,
    })
}

/// Heights of an array whose outer elements lie on the borders of the extent.
fn array(path: &Path, extent: &Extent) -> Result<Relief, String> {
    let array = npy::Array::read(path, None, MAX_BYTES).map_err(|e| e.to_string())?;
    let (Some(heights_m), &[rows, columns]) = (array.real(), array.shape.as_slice()) else {
        return Err(format!(
            "{}: expected a two-dimensional array of heights in metres",
            path.display()
        ));
    };
    let axis = |(start, end): (f64, f64), count: usize| Axis {
        start,
        step: (end - start) / (count.max(2) - 1) as f64,
        count,
    };
    let axes = [axis(extent.y_m, rows), axis(extent.x_m, columns)];
    let name = format!("the heights of {}", path.display());
    Relief::new(name, axes, heights_m.to_vec(), 0.0).map_err(|e| format!("{}: {e}", path.display()))
}

/// Heights of an elevation model over the plane `z = 0`.
#[cfg(feature = "elevation-models")]
fn model(
    path: &Path,
    extent: &Extent,
    keys: &TerrainKeys,
    around: &Around,
    memory_bytes: u64,
) -> Result<Relief, String> {
    use subaperture_maps::terrain::{Geoid, Ground, Region, Surface, relief};
    use subaperture_model::geometry::ImageGrid;
    use subaperture_model::monitor::Silent;

    let axis = |(start, end): (f64, f64)| {
        let count = ((end - start) / *keys.spacing_m).ceil().clamp(1.0, 1e6) + 1.0;
        Axis {
            start,
            step: (end - start) / (count - 1.0),
            count: count as usize,
        }
    };
    let plane = ImageGrid::horizontal(axis(extent.x_m), axis(extent.y_m), 0.0);
    let geoid = match &keys.geoid {
        None => Geoid::None,
        Some(text) => match Geoid::parse(text.to_path_buf())? {
            Geoid::File(file) => Geoid::File(around.folder.join(file)),
            undulation => undulation,
        },
    };
    let region = Region::of(&plane, around.frame).map_err(|e| e.to_string())?;
    let ground = Ground::open(path, &geoid, &region, memory_bytes).map_err(|e| e.to_string())?;
    relief(&plane, around.frame, Surface::Ground(&ground), &Silent).map_err(|e| e.to_string())
}

/// Refuse an elevation model: the readers are not in this build.
#[cfg(not(feature = "elevation-models"))]
fn model(
    path: &Path,
    _extent: &Extent,
    keys: &TerrainKeys,
    around: &Around,
    _memory_bytes: u64,
) -> Result<Relief, String> {
    // Keys of elevation models only.
    let _ = (&keys.geoid, around.frame);
    Err(format!(
        "{}: this program is built without readers of elevation models: expected a NumPy array of heights (.npy)",
        path.display()
    ))
}

impl HillKeys {
    fn build(&self) -> Hill {
        Hill {
            centre_m: self.summit_m.truncate(),
            height_m: self.summit_m.z,
            radius_m: self.radius_m,
        }
    }
}

impl RidgeKeys {
    fn build(&self) -> Ridges {
        Ridges {
            direction_rad: self.direction_rad,
            crest_m: self.crest_m,
            wavelength_m: self.wavelength_m,
            height_m: self.height_m,
        }
    }
}
