//! Two images on the pixels of the reference, registered.

use anyhow::bail;
use subaperture::geometry::{ImageGrid, SceneFrame};
use subaperture::image::{Image, ImageSource as _};
use subaperture::images::{OpenImage, Pair as ImagePair};
use subaperture::interferometry::InterferometryError;
use subaperture::interferometry::registration::{Registered, register_by, shifted};
use subaperture::quality::registration::Offset;

use crate::args::Pair;
use crate::commands::stored;
use crate::config::Session;
use crate::text;

/// Memory for registration and statistics, bytes per pixel.
const PIXEL_BYTES: u64 = 200;

/// Registered pair of images, in memory.
pub(super) struct Read {
    /// Image on the pixels of the reference.
    pub(super) image: Image,
    /// Pixels of the reference.
    pub(super) pixels: Image,
    /// Image as opened, before registration.
    pub(super) later: OpenImage,
    /// Reference as opened, with its metadata.
    pub(super) reference: OpenImage,
    /// Offset before registration; `None` if not estimated.
    pub(super) offset: Option<Offset>,
    /// Whether the offset was removed.
    pub(super) corrected: bool,
    pub(super) notes: Vec<String>,
}

impl Read {
    /// Read both images, relate them by metadata, and register them.
    pub(super) fn new(session: &Session, typed: &Pair) -> anyhow::Result<Self> {
        let place = |image: OpenImage| match &typed.place {
            Some(place) if image.is_unplaced() => image.placed(place),
            _ => image,
        };
        let later = place(stored::open(session, &typed.image)?);
        let reference = place(stored::open(session, &typed.reference)?);
        stored::check_complex(&later)?;
        stored::check_complex(&reference)?;
        let size = reference.pixels.size();
        let bytes = u128::from(PIXEL_BYTES) * size.0 as u128 * size.1 as u128;
        if bytes > u128::from(session.memory_bytes) {
            bail!(
                "{} x {} pixels need {}; --memory allows {}: raise --memory or form smaller images",
                size.0,
                size.1,
                text::bytes(bytes),
                text::bytes(session.memory_bytes.into())
            );
        }
        let looks = [later.looks(), reference.looks()];
        let looks = [looks[0].as_ref(), looks[1].as_ref()];
        let pair = ImagePair::new(&later, &reference, looks).map_err(|error| {
            match error.unplaced && typed.place.is_none() {
                true => anyhow::anyhow!("{error}: give --place LAT,LON[,HEIGHT]"),
                false => error.into(),
            }
        })?;
        let mut notes = pair.notes.clone();
        if !pair.complex {
            bail!(
                "{} and {}: expected images whose phases refer to the same pixels, found: {}: form both on one grid",
                typed.image.display(),
                typed.reference.display(),
                notes.join("; ")
            );
        }
        let pixels = stored::whole(&*pair.reference)?;
        let original = stored::whole(&*pair.image)?;
        drop(pair);
        let mut both = original.pixels.iter().zip(&pixels.pixels);
        if !both.any(|(a, b)| a.is_finite() && b.is_finite()) {
            bail!(
                "{} and {} show different places: they have no pixel in common",
                typed.image.display(),
                typed.reference.display()
            );
        }
        if typed.registered {
            return Ok(Self {
                image: original,
                pixels,
                later,
                reference,
                offset: None,
                corrected: false,
                notes,
            });
        }
        let mut by_spectrum = false;
        let registered = register_by(&pixels, |offset| -> anyhow::Result<Image> {
            if offset == [0.0; 2] {
                return Ok(original.clone());
            }
            let moved = place(stored::open_unread(session, &typed.reference)?);
            let resampled = resampled(&later, moved, offset, looks[0].is_some());
            by_spectrum = resampled.is_none();
            Ok(resampled.unwrap_or_else(|| shifted(&original, offset)))
        });
        let Registered {
            image,
            offset,
            corrected,
        } = registered.map_err(with_advice)?;
        if corrected && by_spectrum {
            notes.push(
                "the offset was removed by a phase ramp over the whole image, which needs a spectrum within one cycle per pixel"
                    .to_owned(),
            );
        }
        Ok(Self {
            image,
            pixels,
            later,
            reference,
            offset: Some(offset),
            corrected,
            notes,
        })
    }

    /// Grid and scene frame of the reference, or its rows and columns.
    pub(super) fn grid(&self) -> (ImageGrid, SceneFrame) {
        stored::grid(&self.reference)
    }
}

/// Image at the pixels of the reference moved by an offset, following the image's carrier; `None` if its geometry is not recorded.
fn resampled(
    later: &OpenImage,
    mut moved: OpenImage,
    offset: [f64; 2],
    is_seen: bool,
) -> Option<Image> {
    if !is_seen || !moved.move_grid(offset) {
        return None;
    }
    let looks = [later.looks(), moved.looks()];
    let pair = ImagePair::new(later, &moved, [looks[0].as_ref(), looks[1].as_ref()]).ok()?;
    match pair.complex {
        true => stored::whole(&*pair.image).ok(),
        false => None,
    }
}

fn with_advice(error: anyhow::Error) -> anyhow::Error {
    match error.downcast_ref() {
        Some(InterferometryError::Uncorrelated { .. }) => {
            anyhow::anyhow!("{error}; --registered takes them as registered")
        }
        _ => error,
    }
}
