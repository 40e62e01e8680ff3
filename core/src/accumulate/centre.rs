//! Geometry at the centre of a sub-CPI, and the pixel grid. Float64 throughout.

/// Antenna positions, velocities and phase reference at the centre of a sub-CPI, the mean pulse index `(M - 1) / 2`.
///
/// Positions are in metres in any Cartesian frame; rates are per pulse, not per second. Samples have the phase
/// `-2 pi f (path - reference path) / c`, where the path leads from transmitter to point to receiver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Centre {
    /// Transmitter position in metres.
    pub transmitter_m: [f64; 3],
    /// Transmitter velocity in metres per pulse.
    pub transmitter_m_per_pulse: [f64; 3],
    /// Receiver position in metres.
    pub receiver_m: [f64; 3],
    /// Receiver velocity in metres per pulse.
    pub receiver_m_per_pulse: [f64; 3],
    /// Two-way path in metres that sample phases are referenced to; 0 for raw phases.
    pub reference_path_m: f64,
    /// Rate of change of the reference path in metres per pulse.
    pub reference_path_m_per_pulse: f64,
}

impl Centre {
    /// Monostatic geometry with phases referenced to the fixed point `reference_m`.
    ///
    /// ```
    /// use subaperture_core::accumulate::Centre;
    /// let centre = Centre::monostatic([0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [30.0, 40.0, 0.0]);
    /// assert_eq!(centre.reference_path_m, 100.0);
    /// // Approaches the reference at 3 m per pulse times 30/50, on both legs of the path.
    /// assert!((centre.reference_path_m_per_pulse + 3.6).abs() < 1e-14);
    /// assert_eq!(centre.relative_path_m([30.0, 40.0, 0.0]), (0.0, 0.0));
    /// ```
    pub fn monostatic(
        position_m: [f64; 3],
        velocity_m_per_pulse: [f64; 3],
        reference_m: [f64; 3],
    ) -> Self {
        let mut centre = Self {
            transmitter_m: position_m,
            transmitter_m_per_pulse: velocity_m_per_pulse,
            receiver_m: position_m,
            receiver_m_per_pulse: velocity_m_per_pulse,
            reference_path_m: 0.0,
            reference_path_m_per_pulse: 0.0,
        };
        let (path, rate) = centre.relative_path_m(reference_m);
        centre.reference_path_m = path;
        centre.reference_path_m_per_pulse = rate;
        centre
    }

    /// Path to `point_m` minus the reference path in metres, and its rate in metres per pulse.
    ///
    /// The rate is NaN for a point at an antenna.
    pub fn relative_path_m(&self, point_m: [f64; 3]) -> (f64, f64) {
        let one_way = |antenna: [f64; 3], velocity: [f64; 3]| {
            let [x, y, z] = [0, 1, 2].map(|i| point_m[i] - antenna[i]);
            let length = libm::sqrt(x * x + y * y + z * z);
            let closing = x * velocity[0] + y * velocity[1] + z * velocity[2];
            (length, -closing / length)
        };
        let (out, out_rate) = one_way(self.transmitter_m, self.transmitter_m_per_pulse);
        let (back, back_rate) = one_way(self.receiver_m, self.receiver_m_per_pulse);
        (
            out + back - self.reference_path_m,
            out_rate + back_rate - self.reference_path_m_per_pulse,
        )
    }
}

/// Planar pixel grid in any orientation, row-major.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelGrid {
    /// Position of pixel (0, 0) in metres.
    pub origin_m: [f64; 3],
    /// Vector from one column to the next in metres.
    pub column_step_m: [f64; 3],
    /// Vector from one row to the next in metres.
    pub row_step_m: [f64; 3],
    /// Number of columns.
    pub num_columns: usize,
    /// Number of rows.
    pub num_rows: usize,
}

impl PixelGrid {
    /// Number of rows times columns. `None` on overflow.
    pub fn num_pixels(&self) -> Option<usize> {
        self.num_rows.checked_mul(self.num_columns)
    }

    /// Position of a pixel in metres.
    pub fn position_m(&self, row: usize, column: usize) -> [f64; 3] {
        let (row, column) = (row as f64, column as f64);
        [0, 1, 2]
            .map(|i| self.origin_m[i] + column * self.column_step_m[i] + row * self.row_step_m[i])
    }
}
