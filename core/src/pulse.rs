//! Pulse metadata: number, time and geometry.

/// Number, time, antenna positions, phase reference and slow-time weight of a pulse.
///
/// Positions are in metres in any Cartesian frame. Samples have the phase
/// `-2 pi f (path - reference_path_m) / c`, where `path` leads from transmitter to scatterer to receiver.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Pulse {
    /// Consecutive pulse number. Sub-CPI `n` of `M` pulses holds the numbers `n M .. (n + 1) M`.
    pub number: u32,
    /// Time of the pulse in seconds.
    pub time_s: f64,
    /// Transmitter position (x, y, z) in metres.
    pub transmitter_m: [f64; 3],
    /// Receiver position (x, y, z) in metres.
    pub receiver_m: [f64; 3],
    /// Two-way path in metres that the sample phases are referenced to; 0 for raw phases.
    pub reference_path_m: f64,
    /// Slow-time window weight; 1 without a window.
    pub weight: f32,
}

impl Pulse {
    /// Pulse number 0 at the origin with weight 0; initial value of a buffer.
    pub const EMPTY: Self = Self {
        number: 0,
        time_s: 0.0,
        transmitter_m: [0.0; 3],
        receiver_m: [0.0; 3],
        reference_path_m: 0.0,
        weight: 0.0,
    };

    /// Two-way path through `point_m` minus the reference path, in metres.
    pub fn relative_path_m(&self, point_m: [f64; 3]) -> f64 {
        distance_m(self.transmitter_m, point_m) + distance_m(point_m, self.receiver_m)
            - self.reference_path_m
    }
}

/// Euclidean distance in metres.
pub(crate) fn distance_m(a: [f64; 3], b: [f64; 3]) -> f64 {
    let [x, y, z] = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    libm::sqrt(x * x + y * y + z * z)
}
