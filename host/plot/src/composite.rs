//! Colour by other images of the same grid.

use super::Source;
use super::layout::Drawn;
use super::scale::Scale;
use subaperture_model::image::PartsError;

/// What the colours of a picture are of.
#[derive(Clone, Debug, Default)]
pub enum Paint<'a> {
    /// Of levels.
    #[default]
    Levels,
    /// Hues around the circle, red first, one for each of 2 to [`MOST_HUES`] images, such as parts of the aperture: a place that one of them has alone is of its hue, one that all have
    /// alike is white. The brightness is the level of the panel's own image.
    Hues(Vec<Source<'a>>),
    /// Two or three images are the colours themselves, each between the levels of a scale of its own: red, green and blue; of two the first is red and blue, so that where both are
    /// alike it is white or grey.
    Channels(Vec<Channel<'a>>),
}

/// An image that is a colour.
#[derive(Clone, Debug)]
pub struct Channel<'a> {
    /// What it is called.
    pub name: String,
    /// The image.
    pub image: Source<'a>,
}

/// Most images of which each has a hue: more cannot be told apart.
pub const MOST_HUES: usize = 12;

const RED: [f64; 3] = [1.0, 0.0, 0.0];
const GREEN: [f64; 3] = [0.0, 1.0, 0.0];
const BLUE: [f64; 3] = [0.0, 0.0, 1.0];
const MAGENTA: [f64; 3] = [1.0, 0.0, 1.0];

impl<'a> Paint<'a> {
    /// The images that colours are of.
    pub(super) fn images(&self) -> Box<dyn Iterator<Item = &Source<'a>> + '_> {
        match self {
            Self::Levels => Box::new(std::iter::empty()),
            Self::Hues(parts) => Box::new(parts.iter()),
            Self::Channels(channels) => Box::new(channels.iter().map(|channel| &channel.image)),
        }
    }

    /// What is wrong with their number.
    pub(super) fn fault(&self) -> Option<String> {
        match self {
            Self::Hues(parts) if !(2..=MOST_HUES).contains(&parts.len()) => Some(format!(
                "hues are of 2 to {MOST_HUES} images, not of {}",
                parts.len()
            )),
            Self::Channels(channels) if !(2..=3).contains(&channels.len()) => Some(format!(
                "colours are of two or three images, not of {}",
                channels.len()
            )),
            _ => None,
        }
    }

    /// What a cell takes beside what levels take: a colour before it is rounded, and whether there is one.
    pub(super) fn bytes_a_cell(&self) -> u64 {
        match self {
            Self::Levels => 0,
            _ => 28,
        }
    }

    /// Colours and what they stand for.
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
        }
    }
}

/// The colours of two or three channels.
fn colours_of(channels: usize) -> &'static [[f64; 3]] {
    match channels {
        2 => &[MAGENTA, GREEN],
        _ => &[RED, GREEN, BLUE],
    }
}

/// To the nearest: a conversion cuts off.
fn byte(part: f64) -> u8 {
    (255.0 * part.clamp(0.0, 1.0) + 0.5) as u8
}

/// Full colours around the circle: red, yellow, green, cyan, blue, magenta at every sixth.
fn hue(k: usize, count: usize) -> [f64; 3] {
    let sixths = 6.0 * k as f64 / count as f64;
    // A channel is full within a sixth of its own hue and gone beyond two.
    [0.0, 2.0, 4.0].map(|own| {
        let off = (sixths - own).abs();
        (2.0 - off.min(6.0 - off)).clamp(0.0, 1.0)
    })
}

/// Powers of an image on the cells.
type Powers<'f> = &'f dyn Fn(&Source) -> Result<Vec<f64>, PartsError>;

/// Brightness by the level of `image`, colour by which of `parts` has how much of the power: the sum of their hues, each channel by what it would be if all had the same, and the largest
/// of them full.
pub(super) fn hues(
    image: &Source,
    parts: &[Source],
    scale: Scale,
    powers: impl Fn(&Source) -> Result<Vec<f64>, PartsError>,
) -> Result<Drawn, PartsError> {
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
        // Where none has anything it is grey.
        Some(balanced.map(|c| byte(brightness * if most > 0.0 { c / most } else { 1.0 })))
    });
    Ok(Drawn::Painted(cells.collect(), Some(levels)))
}

/// Each channel its own colour, by its own levels.
pub(super) fn channels(
    channels: &[Channel],
    scale: Scale,
    powers: impl Fn(&Source) -> Result<Vec<f64>, PartsError>,
) -> Result<Drawn, PartsError> {
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

    fn powers(source: &Source) -> Result<Vec<f64>, PartsError> {
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

    /// Of any number of parts: what one alone has is of its hue, what all have alike is white, and what none has keeps its brightness.
    #[test]
    fn what_all_parts_have_alike_is_white() {
        for count in 2..=MOST_HUES {
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
            // A part of the power of a hue's own channels, by the balance of all hues: of 5 at the most 2.6 / 2.4 apart.
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
            // 20 dB below white of 40: a half.
            assert_eq!(cells[2], Some([128; 3]));
            assert_eq!(cells[3], Some([0; 3]));
            assert_eq!(cells[4], Some([255; 3]));
            assert_eq!(cells[5], None);
        }
        assert_eq!([0, 1, 2].map(|k| hue(k, 3)), [RED, GREEN, BLUE]);
        assert_eq!(hue(1, 6), [1.0, 1.0, 0.0]);
        assert_eq!(hue(3, 4), [0.5, 0.0, 1.0]);
    }

    /// Three images are red, green and blue, two magenta and green; each by its own levels.
    #[test]
    fn images_are_colours() {
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
        assert!(Paint::Channels(named(1)).fault().is_some());
        assert!(Paint::Hues(Vec::new()).fault().is_some() && Paint::Levels.fault().is_none());
    }
}
