//! A map as a picture: PNG, grey with alpha, and beside it the world file and the system of coordinates by which others place it.
//!
//! The world file (`.pgw`) has the pixel's size and the middle of the north-western pixel; `.prj` the system of coordinates as WKT. Rows are made and
//! written band by band.

use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use png::{BitDepth, ColorType};

use subaperture_io::atomic::{Beside, write_atomically};
use subaperture_model::PROGRAM;
use subaperture_model::monitor::Monitor;

use crate::levels::Levels;
use crate::{MapError, Ortho, Projection};

/// Rows made at once.
const BAND: usize = 256;

/// The files beside a picture: its world file, and its coordinates' system.
pub fn beside(path: &Path) -> [PathBuf; 2] {
    ["pgw", "prj"].map(|ending| path.with_extension(ending))
}

/// Writes picture and world file, each complete or not at all.
///
/// # Errors
/// [`MapError`].
pub fn write(
    path: &Path,
    ortho: &Ortho,
    levels: Levels,
    monitor: &dyn Monitor,
) -> Result<(), MapError> {
    let raster = ortho.raster();
    let mut file = Beside::create(path, 0, ".part")?;
    let mut failed = None;
    let written = (|| -> std::io::Result<()> {
        let mut out = BufWriter::new(file.file());
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
            monitor.progress(band.end as f64 / raster.rows as f64);
        }
        rows.finish()?;
        writer.finish()?;
        out.flush()
    })();
    if let Some(error) = failed {
        return Err(error);
    }
    written.map_err(|e| file.failed(e))?;
    file.commit()?;
    let [world, system] = beside(path);
    let [east, south] = raster.step;
    let [x, y] = raster.coordinates([0.5, 0.5]);
    let text = format!("{east}\n0\n0\n{}\n{x}\n{y}\n", -south);
    write_atomically(&world, 0, |out| out.write_all(text.as_bytes()))?;
    let text = well_known_text(&raster.projection);
    write_atomically(&system, 0, |out| out.write_all(text.as_bytes()))?;
    Ok(())
}

/// The system of coordinates, as most programs read it (ESRI's WKT).
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
