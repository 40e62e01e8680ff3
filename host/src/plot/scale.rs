//! Which levels are black and white.

/// The range of levels that a picture shows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Scale {
    /// From the image. The top is its peak, or 6 dB above the brightest thousandth of the pixels if the
    /// peak stands out further than that; the bottom lies 6 dB below the median, which shows clutter or
    /// noise as dark grey; the span is kept within 40 and 70 dB. Whole decibels.
    #[default]
    FromData,
    /// Given, so that pictures can be compared.
    Fixed {
        /// Level of the brightest colour, dB.
        top_db: f64,
        /// How far below it the darkest lies, dB; positive.
        span_db: f64,
    },
}

/// Bottom and top, in the unit shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Levels {
    pub(super) bottom: f64,
    pub(super) top: f64,
}

impl Scale {
    /// The levels for an image whose shown pixels have these powers.
    pub(super) fn levels(self, powers: &[f64]) -> Levels {
        let (top_db, span_db) = match self {
            Self::Fixed { top_db, span_db } if top_db.is_finite() && span_db > 0.0 => {
                (top_db, span_db.min(1e3))
            }
            _ => from_data(powers),
        };
        Levels {
            bottom: top_db - span_db,
            top: top_db,
        }
    }
}

fn from_data(powers: &[f64]) -> (f64, f64) {
    let mut seen: Vec<f64> = powers
        .iter()
        .copied()
        .filter(|p| p.is_finite() && *p > 0.0)
        .collect();
    if seen.is_empty() {
        return (0.0, 60.0);
    }
    seen.sort_unstable_by(f64::total_cmp);
    let last = seen.len() - 1;
    let db = |rank: usize| 10.0 * seen[rank].log10();
    let bright_db = db(last - seen.len() / 1000);
    let top_db = db(last).min(bright_db + 6.0).ceil();
    let bottom_db = (db(last / 2) - 6.0).floor();
    (top_db, (top_db - bottom_db).clamp(40.0, 70.0))
}
