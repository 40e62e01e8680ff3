//! Colour maps.

/// Colours from the lowest level to the highest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Colours {
    /// Black to white: how radar images are shown.
    #[default]
    Grey,
    /// Dark blue over green to yellow, even to the eye (matplotlib's viridis, CC0): for differences,
    /// so that nobody takes them for an image.
    Viridis,
}

/// What should not be.
pub(super) const RED: [u8; 3] = [214, 40, 40];
/// Nothing to show; none of viridis's colours.
pub(super) const PALE: [u8; 3] = [222, 222, 222];

/// Brighter than the brightest shown: none of a map's own colours.
const AMBER: [u8; 3] = [255, 150, 30];
const CORAL: [u8; 3] = [255, 110, 90];

/// Viridis at every eighth.
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

impl Colours {
    /// The colour of levels above the scale.
    pub(super) fn above(self) -> [u8; 3] {
        match self {
            Self::Grey => AMBER,
            Self::Viridis => CORAL,
        }
    }

    /// 256 colours from the lowest level to the highest.
    pub fn table(self) -> Vec<[u8; 3]> {
        (0..=u8::MAX)
            .map(|i| self.at(f64::from(i) / 255.0))
            .collect()
    }

    /// The colour at `level`, 0 to 1; clamped outside.
    pub(super) fn at(self, level: f64) -> [u8; 3] {
        let stops: &[[u8; 3]] = match self {
            Self::Grey => &[[0; 3], [255; 3]],
            Self::Viridis => &VIRIDIS,
        };
        let position = level.clamp(0.0, 1.0) * (stops.len() - 1) as f64;
        let below = (position as usize).min(stops.len() - 2);
        let part = position - below as f64;
        std::array::from_fn(|i| {
            let (a, b) = (f64::from(stops[below][i]), f64::from(stops[below + 1][i]));
            // To the nearest: a conversion cuts off.
            (a + (b - a) * part + 0.5) as u8
        })
    }
}
