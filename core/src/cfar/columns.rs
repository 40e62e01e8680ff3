//! Sliding sums over the columns of a map.

/// Sliding sums over one column of the ring. The caller lends one per range bin.
#[derive(Clone, Copy, Debug, Default)]
pub struct Column {
    /// Sum over all rows of the ring.
    pub(super) all: Sum,
    /// Sum over the training rows only, above and below the guard rows.
    pub(super) beyond_guard: Sum,
}

impl Column {
    /// Zero sums; initial value of a static buffer.
    pub const EMPTY: Self = Self {
        all: Sum::EMPTY,
        beyond_guard: Sum::EMPTY,
    };
}

/// Sum and number of the valid cells.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sum {
    pub(super) power: f64,
    pub(super) cells: u32,
}

impl Sum {
    const EMPTY: Self = Self {
        power: 0.0,
        cells: 0,
    };

    pub(super) fn add_cell(&mut self, power: Option<f32>) {
        if let Some(power) = power {
            self.power += f64::from(power);
            self.cells = self.cells.wrapping_add(1);
        }
    }

    pub(super) fn subtract_cell(&mut self, power: Option<f32>) {
        if let Some(power) = power {
            self.power -= f64::from(power);
            self.cells = self.cells.wrapping_sub(1);
        }
    }

    pub(super) fn add(&mut self, other: Option<Self>) {
        if let Some(other) = other {
            self.power += other.power;
            self.cells = self.cells.wrapping_add(other.cells);
        }
    }

    pub(super) fn subtract(&mut self, other: Option<Self>) {
        if let Some(other) = other {
            self.power -= other.power;
            self.cells = self.cells.wrapping_sub(other.cells);
        }
    }
}
