//! Unit of velocity that suits the span of the passes.

/// Millimetres per unit of time.
pub(super) struct Rate {
    /// Suffix of names: `mm_per_day`.
    pub(super) suffix: &'static str,
    /// Text with a solidus: `mm/day`.
    pub(super) text: &'static str,
    /// Seconds of the unit.
    seconds: f64,
}

impl Rate {
    /// Millimetres per hour up to 6 hours, per day up to 60 days, else per year of 365.25 days.
    pub(super) fn of_span(span_s: f64) -> Self {
        let (suffix, text, seconds) = match span_s / 3600.0 {
            hours if hours <= 6.0 => ("mm_per_hour", "mm/hour", 3600.0),
            hours if hours <= 1440.0 => ("mm_per_day", "mm/day", 86_400.0),
            _ => ("mm_per_year", "mm/year", 365.25 * 86_400.0),
        };
        Self {
            suffix,
            text,
            seconds,
        }
    }

    /// Velocity in metres a second in this unit.
    pub(super) fn of(&self, velocity_m_s: f64) -> f64 {
        1e3 * velocity_m_s * self.seconds
    }

    /// Time in seconds in the unit of the rate, and its name.
    pub(super) fn time(&self, time_s: f64) -> f64 {
        time_s / self.seconds
    }

    /// Name of the unit of time.
    pub(super) fn unit(&self) -> &'static str {
        self.text.trim_start_matches("mm/")
    }
}
