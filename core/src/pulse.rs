//! What is known of a pulse beside its samples.

/// Number, time, antenna positions, phase reference and weight of a pulse.
///
/// Positions are metres in any Cartesian frame. Samples have the phase
/// `-2 pi f (path - reference_path_m) / c`, path from transmitter to scatterer to receiver.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Pulse {
    /// Running number; sub-CPI `n` of `M` pulses holds the numbers `n M .. (n + 1) M`.
    pub number: u32,
    /// Time of the pulse, seconds.
    pub time_s: f64,
    /// Transmitter position, metres.
    pub transmitter_m: [f64; 3],
    /// Receiver position, metres.
    pub receiver_m: [f64; 3],
    /// Two-way path to which the samples' phase is compensated, metres; 0 if to none.
    pub reference_path_m: f64,
    /// Weight in slow time; 1 for no window.
    pub weight: f32,
}

impl Pulse {
    /// A pulse of number 0 at the origin, of no weight: what fills empty storage.
    pub const EMPTY: Self = Self {
        number: 0,
        time_s: 0.0,
        transmitter_m: [0.0; 3],
        receiver_m: [0.0; 3],
        reference_path_m: 0.0,
        weight: 0.0,
    };

    /// Path by way of `point_m`, less the reference path, metres.
    pub fn relative_path_m(&self, point_m: [f64; 3]) -> f64 {
        distance_m(self.transmitter_m, point_m) + distance_m(point_m, self.receiver_m)
            - self.reference_path_m
    }
}

/// Distance between two points, metres.
pub(crate) fn distance_m(a: [f64; 3], b: [f64; 3]) -> f64 {
    let [x, y, z] = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    libm::sqrt(x * x + y * y + z * z)
}
