//! Levels along a line, from the pixel nearest to each point. Points are one pixel apart, or farther on lines longer
//! than the maximum number of points.

use serde_json::{Value, json};
use subaperture_model::image::{ImageSource, ImageSourceError, power};

use super::pixels::Pixels;

/// Maximum number of points of a line.
const MAX_POINTS: usize = 2048;

/// Levels in dB from one row and column to another, evenly spaced, as JSON. `null` outside the image and for zero
/// pixels.
pub(super) fn along(pixels: &Pixels, [from, to]: [[f64; 2]; 2]) -> Result<Value, ImageSourceError> {
    let (rows, columns) = pixels.size();
    let reach = (to[0] - from[0]).abs().max((to[1] - from[1]).abs());
    let count = (reach.ceil() as usize + 1).clamp(2, MAX_POINTS);
    let mut levels = Vec::with_capacity(count);
    for i in 0..count {
        let part = i as f64 / (count - 1) as f64;
        let at = [0, 1].map(|k| (from[k] + (to[k] - from[k]) * part).round());
        let within = at[0] >= 0.0 && at[1] >= 0.0 && at[0] < rows as f64 && at[1] < columns as f64;
        if !within {
            levels.push(None);
            continue;
        }
        let [row, column] = at.map(|x| x as usize);
        let pixel = pixels.window(&[row..row + 1, column..column + 1])?.pixels[0];
        let power = power(pixel);
        levels.push((power > 0.0).then(|| 10.0 * power.log10()));
    }
    Ok(json!({ "levels_db": levels }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_complex::Complex32;
    use subaperture_model::image::Image;

    /// Amplitude is 10^(row/20) in column 3 and zero elsewhere, so the line along row 2 meets one pixel.
    #[test]
    fn line_samples_nearest_pixels() {
        let value = |i: usize| match i % 9 {
            3 => Complex32::new(10f32.powf((i / 9) as f32 / 20.0), 0.0),
            _ => Complex32::ZERO,
        };
        let image = Image {
            rows: 7,
            columns: 9,
            pixels: (0..63).map(value).collect(),
        };
        let pixels = Pixels::whole(Box::new(image));
        let down = along(&pixels, [[0.0, 3.2], [6.0, 2.8]]).unwrap();
        let levels = down["levels_db"].as_array().unwrap();
        assert_eq!(levels.len(), 7);
        for (row, level) in levels.iter().enumerate() {
            // Float32 amplitudes: 1e-7 of 1 is 1e-6 dB.
            assert!((level.as_f64().unwrap() - row as f64).abs() < 1e-5);
        }
        let across = along(&pixels, [[2.0, -2.0], [2.0, 8.0]]).unwrap();
        let levels = across["levels_db"].as_array().unwrap();
        let seen: Vec<usize> = (0..levels.len())
            .filter(|&i| !levels[i].is_null())
            .collect();
        assert_eq!((levels.len(), seen), (11, vec![5]));
    }
}
