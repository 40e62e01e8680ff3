//! Colour maps.

/// Colour map from the lowest level to the highest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Colours {
    /// Black to white, as usual for radar images. Default.
    #[default]
    Grey,
    /// Perceptually uniform, dark blue over green to yellow (matplotlib's viridis, CC0). For differences,
    /// to distinguish them from images.
    Viridis,
    /// Hue circle: red, yellow, green, cyan, blue, magenta, red. For phases, whose lowest and highest level are the same.
    Hue,
}

/// Invalid pixels in grey images.
pub(super) const RED: [u8; 3] = [214, 40, 40];
/// Missing values; not a colour of viridis.
pub(super) const PALE: [u8; 3] = [222, 222, 222];

/// Levels above the scale; not a colour of any map.
const AMBER: [u8; 3] = [255, 150, 30];
const CORAL: [u8; 3] = [255, 110, 90];

/// Viridis in steps of an eighth.
const VIRIDIS: [[u8; 3]; 9] = [
    [68, 1, 84],
    [71, 44, 122],
    [59, 81, 139],
    [44, 113, 142],
    [33, 144, 141],
    [39, 173, 129],
    [92, 200, 99],
    [170, 220, 50],
    [253, 231, 37],
];

/// Hue circle in steps of a sixth.
const HUE: [[u8; 3]; 7] = [
    [255, 0, 0],
    [255, 255, 0],
    [0, 255, 0],
    [0, 255, 255],
    [0, 0, 255],
    [255, 0, 255],
    [255, 0, 0],
];

impl Colours {
    /// Colour of levels above the scale.
    pub(super) fn above(self) -> [u8; 3] {
        match self {
            Self::Grey => AMBER,
            Self::Viridis => CORAL,
            // Phases are never above the scale.
            Self::Hue => HUE[6],
        }
    }

    /// Table of 256 colours from the lowest level to the highest.
    pub fn table(self) -> Vec<[u8; 3]> {
        (0..=u8::MAX)
            .map(|i| self.at(f64::from(i) / 255.0))
            .collect()
    }

    fn stops(self) -> &'static [[u8; 3]] {
        match self {
            Self::Grey => &[[0; 3], [255; 3]],
            Self::Viridis => &VIRIDIS,
            Self::Hue => &HUE,
        }
    }

    /// Index of the colour stop below `level` (clamped to 0 to 1), and the fraction to the next.
    fn between(self, level: f64) -> (usize, f64) {
        let last = self.stops().len() - 1;
        let position = level.clamp(0.0, 1.0) * last as f64;
        let below = (position as usize).min(last - 1);
        (below, position - below as f64)
    }

    /// Colour at `level`, clamped to 0 to 1.
    pub(super) fn at(self, level: f64) -> [u8; 3] {
        let (below, part) = self.between(level);
        let [from, to] = [0, 1].map(|i| self.stops()[below + i]);
        std::array::from_fn(|i| {
            let (a, b) = (f64::from(from[i]), f64::from(to[i]));
            // Rounds to nearest; the cast truncates.
            (a + (b - a) * part + 0.5) as u8
        })
    }

    /// Colour of all levels from `low` to `high`, if it is one: channels are monotonic between two stops.
    pub(super) fn of_all(self, low: f64, high: f64) -> Option<[u8; 3]> {
        let colour = self.at(low);
        let alike = self.between(low).0 == self.between(high).0 && self.at(high) == colour;
        alike.then_some(colour)
    }
}
