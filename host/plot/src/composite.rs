//! Colour composites from several images of one grid, and masks over one.

use super::Source;
use super::layout::Drawn;
use super::scale::Scale;
use subaperture_model::image::ImageSourceError;

/// Source of a picture's colours.
#[derive(Clone, Debug, Default)]
pub enum ColourSource<'a> {
    /// Levels through the colour map. Default.
    #[default]
    Levels,
    /// One hue for each of 2 to [`MAX_HUES`] images, such as sub-apertures, evenly around the colour circle from red. A place with power in one image only has its hue; a place with equal
    /// power in all is white. Brightness is the level of the panel's own image.
    Hues(Vec<Source<'a>>),
    /// Two or three images as colour channels, each with its own scale: red, green and blue. The first of two is red and blue (magenta), so that equal
    /// images give white or grey.
    Channels(Vec<Channel<'a>>),
    /// The panel's own image in grey, with the pixels of a mask in one colour.
    Mask(Mask<'a>),
}

/// Mask over an image, such as detected changes. A cell of the picture with any masked pixel has the colour of the mask.
#[derive(Clone, Debug)]
pub struct Mask<'a> {
    /// Mask on the panel's grid: 0 for pixels that are not masked, NaN for unknown ones.
    pub mask: Source<'a>,
    /// Names in the key of masked pixels (orange), of others (grey) and of unknown ones (blue).
    pub names: [String; 3],
}

/// Image of a colour channel.
#[derive(Clone, Debug)]
pub struct Channel<'a> {
    /// Name in the key.
    pub name: String,
    /// Image, on the panel's grid.
    pub image: Source<'a>,
}

/// Largest number of hues; more cannot be distinguished.
pub const MAX_HUES: usize = 12;

const RED: [f64; 3] = [1.0, 0.0, 0.0];
const GREEN: [f64; 3] = [0.0, 1.0, 0.0];
const BLUE: [f64; 3] = [0.0, 0.0, 1.0];
const MAGENTA: [f64; 3] = [1.0, 0.0, 1.0];

/// Colours of masked, other and unknown pixels at full brightness. Orange differs from grey, and from the red of absent values.
const MASKED: [f64; 3] = [1.0, 0.55, 0.0];
const OTHER: [f64; 3] = [1.0, 1.0, 1.0];
const UNKNOWN: [f64; 3] = [0.35, 0.5, 1.0];

/// Brightness of unknown pixels of no power, so that their colour shows.
const DIMMEST: f64 = 0.4;

impl<'a> ColourSource<'a> {
    /// Images of the composite.
    pub(super) fn images(&self) -> Box<dyn Iterator<Item = &Source<'a>> + '_> {
        match self {
            Self::Levels => Box::new(std::iter::empty()),
            Self::Hues(parts) => Box::new(parts.iter()),
            Self::Channels(channels) => Box::new(channels.iter().map(|channel| &channel.image)),
            Self::Mask(mask) => Box::new(std::iter::once(&mask.mask)),
        }
    }

    /// Error text if the number of images is invalid.
    pub(super) fn fault(&self) -> Option<String> {
        match self {
            Self::Hues(parts) if !(2..=MAX_HUES).contains(&parts.len()) => Some(format!(
                "expected 2 to {MAX_HUES} images for hues, found {}",
                parts.len()
            )),
            Self::Channels(channels) if !(2..=3).contains(&channels.len()) => Some(format!(
                "expected 2 or 3 images for colour channels, found {}",
                channels.len()
            )),
            _ => None,
        }
    }

    /// Additional memory per cell, bytes: an unrounded colour and its presence.
    pub(super) fn bytes_a_cell(&self) -> u64 {
        match self {
            Self::Levels => 0,
            _ => 28,
        }
    }

    /// Key: names and colours.
    pub(super) fn key(&self) -> Vec<(String, [u8; 3])> {
        let bright = |colour: [f64; 3]| colour.map(byte);
        match self {
            Self::Levels => Vec::new(),
            Self::Hues(parts) => {
                let count = parts.len();
                let hues =
                    (0..count).map(|k| (format!("{} of {count}", k + 1), bright(hue(k, count))));
                hues.collect()
            }
            Self::Channels(channels) => {
                let colours = colours_of(channels.len());
                let names = channels.iter().map(|channel| channel.name.clone());
                names.zip(colours.iter().map(|&c| bright(c))).collect()
            }
            Self::Mask(mask) => {
                let grey = OTHER.map(|part| 0.6 * part);
                let colours = [MASKED, grey, UNKNOWN].map(bright);
                mask.names.iter().cloned().zip(colours).collect()
            }
        }
    }
}

/// Colours of two or three channels.
fn colours_of(channels: usize) -> &'static [[f64; 3]] {
    match channels {
        2 => &[MAGENTA, GREEN],
        _ => &[RED, GREEN, BLUE],
    }
}

/// Round a fraction to a byte; a cast would truncate.
fn byte(part: f64) -> u8 {
    (255.0 * part.clamp(0.0, 1.0) + 0.5) as u8
}

/// Saturated hue `k` of `count`: red, yellow, green, cyan, blue, magenta at every sixth of the circle.
fn hue(k: usize, count: usize) -> [f64; 3] {
    let sixths = 6.0 * k as f64 / count as f64;
    // A channel is 1 within a sixth of the circle about its hue and 0 beyond two sixths.
    [0.0, 2.0, 4.0].map(|own| {
        let off = (sixths - own).abs();
        (2.0 - off.min(6.0 - off)).clamp(0.0, 1.0)
    })
}

/// Function that resamples the power of an image to the cells.
type Powers<'f> = &'f dyn Fn(&Source) -> Result<Vec<f64>, ImageSourceError>;

/// Colour composite: brightness from `image`, hue from each sub-aperture's share of power. The hues are summed, each channel is normalised by its value for equal shares, and the largest
/// channel is scaled to 1.
pub(super) fn hues(
    image: &Source,
    parts: &[Source],
    scale: Scale,
    powers: impl Fn(&Source) -> Result<Vec<f64>, ImageSourceError>,
) -> Result<Drawn, ImageSourceError> {
    let powers: Powers = &powers;
    let shown = powers(image)?;
    let levels = scale.levels(&shown);
    let mut sums = vec![[0.0; 3]; shown.len()];
    let mut alike = [0.0; 3];
    for (k, part) in parts.iter().enumerate() {
        let colour = hue(k, parts.len());
        (0..3).for_each(|i| alike[i] += colour[i]);
        for (sum, power) in sums.iter_mut().zip(powers(part)?) {
            if power.is_finite() {
                (0..3).for_each(|i| sum[i] += power * colour[i]);
            }
        }
    }
    let cells = shown.iter().zip(sums).map(|(power, sum)| {
        let brightness = levels.part_of(*power)?;
        let balanced: [f64; 3] = std::array::from_fn(|i| sum[i] / alike[i]);
        let most = balanced.iter().copied().fold(0.0, f64::max);
        // Without power the colour is grey.
        Some(balanced.map(|c| byte(brightness * if most > 0.0 { c / most } else { 1.0 })))
    });
    Ok(Drawn::Painted(cells.collect(), Some(levels)))
}

/// Channel composite: each channel with its own colour and levels.
pub(super) fn channels(
    channels: &[Channel],
    scale: Scale,
    powers: impl Fn(&Source) -> Result<Vec<f64>, ImageSourceError>,
) -> Result<Drawn, ImageSourceError> {
    let powers: Powers = &powers;
    let mut cells: Vec<Option<[f64; 3]>> = Vec::new();
    for (channel, colour) in channels.iter().zip(colours_of(channels.len())) {
        let shown = powers(&channel.image)?;
        let levels = scale.levels(&shown);
        cells.resize(shown.len(), Some([0.0; 3]));
        for (cell, power) in cells.iter_mut().zip(shown) {
            *cell = cell
                .zip(levels.part_of(power))
                .map(|(sum, part)| std::array::from_fn(|i| sum[i] + part * colour[i]));
        }
    }
    let cells = cells.into_iter().map(|cell| cell.map(|sum| sum.map(byte)));
    Ok(Drawn::Painted(cells.collect(), None))
}

/// Image in grey with the cells of a mask in one colour of full brightness, and unknown cells tinted.
pub(super) fn masked(
    image: &Source,
    mask: &Mask,
    scale: Scale,
    powers: impl Fn(&Source) -> Result<Vec<f64>, ImageSourceError>,
) -> Result<Drawn, ImageSourceError> {
    let shown = powers(image)?;
    let levels = scale.levels(&shown);
    let paint = |(power, mask): (&f64, f64)| {
        let brightness = levels.part_of(*power)?;
        let colour = match mask {
            mask if mask.is_nan() => {
                let visible = DIMMEST + (1.0 - DIMMEST) * brightness;
                UNKNOWN.map(|part| visible * part)
            }
            0.0 => OTHER.map(|part| brightness * part),
            _ => MASKED,
        };
        Some(colour.map(byte))
    };
    let cells = shown.iter().zip(powers(&mask.mask)?).map(paint);
    Ok(Drawn::Painted(cells.collect(), Some(levels)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_complex::Complex32;
    use subaperture_model::image::{Image, power};

    fn image(magnitudes: &[f32]) -> Image {
        Image {
            rows: 1,
            columns: magnitudes.len(),
            pixels: magnitudes.iter().map(|&m| Complex32::new(0.0, m)).collect(),
        }
    }

    fn powers(source: &Source) -> Result<Vec<f64>, ImageSourceError> {
        let Source::Whole(image) = source else {
            unreachable!()
        };
        Ok(image.pixels.iter().map(|&z| power(z)).collect())
    }

    const SCALE: Scale = Scale::Fixed {
        top_db: 0.0,
        span_db: 40.0,
    };

    fn painted(drawn: Drawn) -> Vec<Option<[u8; 3]>> {
        match drawn {
            Drawn::Painted(cells, _) => cells,
            Drawn::Levels(..) | Drawn::Powers(..) => panic!("levels"),
        }
    }

    /// For any number of images: power in one only gives its hue, equal power gives white, no power keeps the brightness.
    #[test]
    fn equal_sub_apertures_are_white_and_single_ones_have_their_hue() {
        for count in 2..=MAX_HUES {
            let total = image(&[1.0, 1.0, 0.1, 0.0, 1.0, f32::NAN]);
            let looks: Vec<Image> = (0..count)
                .map(|k| {
                    let only = if k == 1 { 2.0 } else { 0.0 };
                    image(&[only, 3.0, 0.2, 0.0, 0.0, 1.0])
                })
                .collect();
            let parts: Vec<Source> = looks.iter().map(Source::from).collect();
            let cells = painted(hues(&Source::from(&total), &parts, SCALE, powers).unwrap());
            let own = hue(1, count).map(byte);
            // Channels of a single hue after balancing all hues: for 5 hues they differ by at most 2.6 / 2.4.
            let first = cells[0].unwrap();
            for i in 0..3 {
                assert!(
                    first[i].abs_diff(own[i]) <= 22,
                    "{count}: {first:?} {own:?}"
                );
            }
            if matches!(count, 2 | 3 | 4 | 6 | 12) {
                assert_eq!(first, own, "{count}");
            }
            assert_eq!(cells[1], Some([255; 3]), "{count}");
            // 20 dB below white on a scale of 40 dB: half brightness.
            assert_eq!(cells[2], Some([128; 3]));
            assert_eq!(cells[3], Some([0; 3]));
            assert_eq!(cells[4], Some([255; 3]));
            assert_eq!(cells[5], None);
        }
        assert_eq!([0, 1, 2].map(|k| hue(k, 3)), [RED, GREEN, BLUE]);
        assert_eq!(hue(1, 6), [1.0, 1.0, 0.0]);
        assert_eq!(hue(3, 4), [0.5, 0.0, 1.0]);
    }

    /// Masked pixels are orange whatever their level, others grey, unknown ones blue; absent pixels stay absent.
    #[test]
    fn mask_colours_masked_pixels_over_grey() {
        let shown = image(&[1.0, 0.1, 0.0, 0.1, 1.0, 0.0, f32::NAN]);
        let over = image(&[1.0, 0.0, 1.0, 1.0, f32::NAN, f32::NAN, 1.0]);
        let mask = Mask {
            mask: Source::from(&over),
            names: ["changed", "unchanged", "not tested"].map(str::to_owned),
        };
        let cells = painted(masked(&Source::from(&shown), &mask, SCALE, powers).unwrap());
        let orange = Some([255, 140, 0]);
        let blue = [[89, 128, 255], [36, 51, 102]].map(Some);
        assert_eq!(
            cells,
            [
                orange,
                Some([128; 3]),
                orange,
                orange,
                blue[0],
                blue[1],
                None
            ]
        );
        let key = ColourSource::Mask(mask).key();
        let names = key.iter().map(|(name, _)| name.as_str());
        assert_eq!(
            names.collect::<Vec<_>>(),
            ["changed", "unchanged", "not tested"]
        );
    }

    /// Three images are red, green and blue, two are magenta and green, each with its own levels.
    #[test]
    fn channel_composite_maps_images_to_colours() {
        let all = [[1.0, 0.1, 0.0], [0.01, 0.1, 0.0], [0.1, 0.1, 1.0]].map(|m| image(&m));
        let named = |count: usize| -> Vec<Channel> {
            let each = all.iter().take(count).enumerate();
            each.map(|(i, image)| Channel {
                name: i.to_string(),
                image: image.into(),
            })
            .collect()
        };
        let three = painted(channels(&named(3), SCALE, powers).unwrap());
        let expected = [[255, 0, 128], [128, 128, 128], [0, 0, 255]];
        assert_eq!(three, expected.map(Some));
        let two = painted(channels(&named(2), SCALE, powers).unwrap());
        let expected = [[255, 0, 255], [128, 128, 128], [0, 0, 0]];
        assert_eq!(two, expected.map(Some));
        assert!(ColourSource::Channels(named(1)).fault().is_some());
        assert!(
            ColourSource::Hues(Vec::new()).fault().is_some()
                && ColourSource::Levels.fault().is_none()
        );
    }
}
