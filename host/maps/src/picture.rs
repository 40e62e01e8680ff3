//! Writer of PNG maps with world file and projection file.
//!
//! The world file (`.pgw`) contains the pixel spacing and the centre of the north-western pixel; `.prj` contains the coordinate system as WKT. Rows are
//! computed and written in bands.

use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use png::{BitDepth, ColorType};

use subaperture_io::atomic::AtomicFile;
use subaperture_io::together::FileSet;
use subaperture_io::written::{FileKind, WrittenFile};
use subaperture_model::PROGRAM;
use subaperture_model::monitor::Monitor;

use crate::first_error::FirstError;
use crate::levels::Levels;
use crate::{MapError, Ortho, Projection};

/// Rows per band.
const BAND: usize = 256;

/// Paths of a picture's world file (`.pgw`) and projection file (`.prj`).
pub fn sidecars(path: &Path) -> [PathBuf; 2] {
    ["pgw", "prj"].map(|ending| path.with_extension(ending))
}

/// Write picture, world file and projection file, all or none.
///
/// # Errors
/// [`MapError`] if the image cannot be read or resampled, a file cannot be written, or the monitor cancels.
pub fn write(
    path: &Path,
    ortho: &Ortho,
    levels: Levels,
    monitor: &dyn Monitor,
) -> Result<Vec<WrittenFile>, MapError> {
    let raster = ortho.raster();
    let mut files = FileSet::new();
    let mut file = AtomicFile::create(path, 0, ".part")?;
    let mut failed = None;
    let written = (|| -> std::io::Result<()> {
        let mut out = FirstError::new(BufWriter::new(file.file()));
        let error = out.error();
        let mut encoder = png::Encoder::new(&mut out, raster.columns as u32, raster.rows as u32);
        encoder.set_color(ColorType::GrayscaleAlpha);
        encoder.set_depth(BitDepth::Eight);
        encoder.add_text_chunk("Software".to_owned(), PROGRAM.to_owned())?;
        let mut writer = encoder.write_header()?;
        let mut rows = writer.stream_writer()?;
        for first in (0..raster.rows).step_by(BAND) {
            let band = first..(first + BAND).min(raster.rows);
            let powers = match monitor.cancelled() {
                true => Err(MapError::Cancelled),
                false => ortho.powers(&[band.clone(), 0..raster.columns]),
            };
            let powers = match powers {
                Ok(powers) => powers,
                Err(error) => {
                    failed = Some(error);
                    return Err(std::io::Error::other("no pixels"));
                }
            };
            let greys: Vec<u8> = powers
                .into_iter()
                .flat_map(|power| levels.grey_alpha(power))
                .collect();
            rows.write_all(&greys)?;
            error.check()?;
            monitor.progress(band.end as f64 / raster.rows as f64);
        }
        rows.finish()?;
        writer.finish()?;
        out.flush()?;
        error.check()
    })();
    if let Some(error) = failed {
        return Err(error);
    }
    written.map_err(|e| file.failed(e))?;
    files.add(file, WrittenFile::new(path, FileKind::Png))?;
    let [world, system] = sidecars(path);
    let [east, south] = raster.step;
    let [x, y] = raster.coordinates([0.5, 0.5]);
    let text = format!("{east}\n0\n0\n{}\n{x}\n{y}\n", -south);
    let system_text = well_known_text(&raster.projection);
    for (path, text) in [(&world, text), (&system, system_text)] {
        files.write_bytes(path, FileKind::Sidecar, text.as_bytes())?;
    }
    Ok(files.commit()?)
}

/// Coordinate system in ESRI WKT, which most programs read.
fn well_known_text(projection: &Projection) -> String {
    let earth = "GEOGCS[\"GCS_WGS_1984\",DATUM[\"D_WGS_1984\",SPHEROID[\"WGS_1984\",6378137.0,298.257223563]],\
                 PRIMEM[\"Greenwich\",0.0],UNIT[\"Degree\",0.0174532925199433]]";
    match projection {
        Projection::Geographic { .. } => format!("{earth}\n"),
        Projection::Utm(zone) => format!(
            "PROJCS[\"WGS_1984_UTM_Zone_{zone}\",{earth},PROJECTION[\"Transverse_Mercator\"],PARAMETER[\"False_Easting\",500000.0],\
             PARAMETER[\"False_Northing\",{:.1}],PARAMETER[\"Central_Meridian\",{:.1}],PARAMETER[\"Scale_Factor\",0.9996],\
             PARAMETER[\"Latitude_Of_Origin\",0.0],UNIT[\"Meter\",1.0]]\n",
            if zone.is_north() { 0.0 } else { 1e7 },
            zone.meridian_deg(),
        ),
    }
}
