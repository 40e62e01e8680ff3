//! Projection of a complex image onto the raster of a map.

use subaperture_maps::{MapError, Ortho, Raster, Source};
use subaperture_model::resolution::support::Looks;

use super::views::OnRaster;
use super::{OpenImage, PixelGeometry, Pixels, Values};

/// Project a complex image onto a map's raster, with notes. Values are complex if the map's are and the image is a product; else amplitudes.
pub(super) fn project<'a>(
    image: &'a OpenImage,
    looks: Option<&'a Looks>,
    raster: &Raster,
    values: Values,
) -> Result<(OnRaster<'a>, Vec<String>), String> {
    refuse_partial(image)?;
    if is_detected(image) {
        return Err("are detected images on different pixels: compare the complex images from which they were made".to_owned());
    }
    let mut notes = Vec::new();
    let mut raster = *raster;
    if values == Values::Complex {
        // Complex map values are samples at the pixel centres, not means.
        raster.pixel_m = 0.0;
    }
    let (ortho, complex) = match &image.lies {
        PixelGeometry::Sicd { on_map, .. } => match &**on_map {
            Ok(on_map) => {
                if values == Values::Complex {
                    notes.push(format!(
                        "amplitudes are compared: phases of {} refer to its own pixels",
                        image.path.display()
                    ));
                }
                (Ortho::with_projection(&image.pixels, on_map, raster), false)
            }
            Err(what) => return Err(format!("cannot be related: {what}")),
        },
        PixelGeometry::Grid {
            grid,
            frame: Some(frame),
        } => {
            let looks = looks.ok_or_else(|| cannot_resample(image, &MapError::Unseen))?;
            let source = Source {
                pixels: &image.pixels,
                grid,
                frame,
                looks,
            };
            let ortho = Ortho::new(source, raster).map_err(|error| match error {
                MapError::Local => unplaced(image),
                error => cannot_resample(image, &error),
            })?;
            (ortho, values == Values::Complex)
        }
        _ => return Err(unplaced(image)),
    };
    notes.insert(
        0,
        format!(
            "{} is projected onto the map's pixels, with a relative error below {:.0} dB",
            image.path.display(),
            ortho.error_db().ceil()
        ),
    );
    if ortho.averaged() > 1 {
        notes.push(format!(
            "a map pixel is the root mean square of {} values of {}",
            ortho.averaged(),
            image.path.display()
        ));
    }
    Ok((OnRaster { ortho, complex }, notes))
}

/// Reason why an image without georeference cannot be related.
pub(super) fn unplaced(image: &OpenImage) -> String {
    format!(
        "cannot be related: {} has no position on the Earth; give the position of its scene's origin",
        image.path.display()
    )
}

pub(super) fn is_detected(image: &OpenImage) -> bool {
    image.values != Values::Complex
}

pub(super) fn refuse_partial(image: &OpenImage) -> Result<(), String> {
    match &image.pixels {
        Pixels::Unfinished(_) => Err(format!(
            "are on different grids, and {} is incomplete: finish it first",
            image.path.display()
        )),
        _ => Ok(()),
    }
}

pub(super) fn cannot_resample(image: &OpenImage, error: &MapError) -> String {
    format!(
        "are on different grids, and {} cannot be resampled: {error}",
        image.path.display()
    )
}
