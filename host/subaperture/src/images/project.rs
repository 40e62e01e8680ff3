//! A complex image on the raster of a map.

use subaperture_maps::{MapError, Ortho, Raster, Source};
use subaperture_model::resolution::support::Looks;

use super::views::OnRaster;
use super::{OpenImage, PixelGeometry, Pixels, Values};

/// A complex image on a map's raster, and notes of it. Values are complex where the map's are and the image is a product; else amplitudes.
pub(super) fn project<'a>(
    image: &'a OpenImage,
    looks: Option<&'a Looks>,
    raster: &Raster,
    values: Values,
) -> Result<(OnRaster<'a>, Vec<String>), String> {
    refuse_partial(image)?;
    if is_detected(image) {
        return Err("are detected images on different pixels: compare with the complex images that they are of".to_owned());
    }
    let mut notes = Vec::new();
    let mut raster = *raster;
    if values == Values::Complex {
        // Complex values of a map are those at the middles of its pixels, and not means.
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
            "a map's pixel is the root of the mean of {} powers of {}",
            ortho.averaged(),
            image.path.display()
        ));
    }
    Ok((OnRaster { ortho, complex }, notes))
}

/// That an image is tied to no place on the Earth.
pub(super) fn unplaced(image: &OpenImage) -> String {
    format!(
        "cannot be related: {} is tied to no place on the Earth; state where its scene's origin is",
        image.path.display()
    )
}

pub(super) fn is_detected(image: &OpenImage) -> bool {
    image.values != Values::Complex
}

pub(super) fn refuse_partial(image: &OpenImage) -> Result<(), String> {
    match &image.pixels {
        Pixels::Unfinished(_) => Err(format!(
            "are on different grids, and {} is not whole: form it to its end first",
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
