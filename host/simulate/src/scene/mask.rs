//! Map of classes: the part of an area that a patch of clutter covers.
//!
//! A greyscale PNG file or a NumPy array over the area, one class per value: a point belongs to the patch if the pixel at its place has the
//! patch's value. The top row of a PNG file has the largest y, row 0 of an array the smallest. Borders between classes are sharp.

use glam::DVec2;
use subaperture_model::geometry::Extent;

use super::Picture;

/// Pixels of one value in a map over an extent.
#[derive(Clone, Debug)]
pub struct Mask {
    /// Map of classes by their values.
    pub map: Picture,
    /// Rectangle covered by the map.
    pub extent: Extent,
    /// Value of the class: a grey level, 0 to 255 or 65535, or a number of the array.
    pub value: f32,
}

impl Mask {
    /// Whether a position belongs to the class; positions outside of the map do not.
    pub fn contains(&self, at: DVec2) -> bool {
        let part = |x: f64, (from, to): (f64, f64)| (x - from) / (to - from);
        let (x, y) = (part(at.x, self.extent.x_m), part(at.y, self.extent.y_m));
        let inside = (0.0..=1.0).contains(&x) && (0.0..=1.0).contains(&y);
        inside && self.map.value_at(x, y) == self.value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_meet_at_borders_of_pixels() {
        let map = Picture::new(2, 3, vec![1.0, 2.0, 3.0, 4.0, 5.0, 2.0]).unwrap();
        let mask = Mask {
            map,
            extent: Extent {
                x_m: (-3.0, 6.0),
                y_m: (10.0, 14.0),
            },
            value: 2.0,
        };
        let has = |x: f64, y: f64| mask.contains(DVec2::new(x, y));
        assert!(has(0.01, 10.0) && has(2.99, 11.99) && !has(-0.01, 11.0) && !has(3.01, 11.0));
        assert!(has(3.01, 12.01) && has(6.0, 14.0) && !has(2.99, 12.01) && !has(6.01, 13.0));
    }
}
