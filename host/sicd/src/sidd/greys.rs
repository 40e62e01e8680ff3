//! Remap from power to grey.

/// Remap from power to grey.
#[derive(Clone, Copy)]
pub struct Greys<'a> {
    /// Name of the remap, such as `Density`.
    pub name: &'a str,
    /// Levels of black and white, dB of magnitude.
    pub levels_db: [f64; 2],
    /// Grey of a power; 0 for NaN.
    pub of: &'a dyn Fn(f32) -> u8,
}
