//! Which levels are black and white.

/// The range of levels that a picture shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scale {
    /// From the image, as far as it is not given. The top is its peak, so that nothing is above it; the
    /// bottom lies 6 dB below the median, which shows clutter or noise as dark grey; the span is kept
    /// within 40 and 60 dB. Whole decibels.
    FromData {
        /// Level of the brightest colour, dB.
        top_db: Option<f64>,
        /// How far below it the darkest lies, dB; positive.
        span_db: Option<f64>,
    },
    /// Given, so that pictures can be compared.
    Fixed {
        /// Level of the brightest colour, dB.
        top_db: f64,
        /// How far below it the darkest lies, dB; positive.
        span_db: f64,
    },
}

impl Default for Scale {
    fn default() -> Self {
        Self::FromData {
            top_db: None,
            span_db: None,
        }
    }
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
        let sound_top = |top_db: &f64| top_db.is_finite();
        let sound_span = |span_db: &f64| *span_db > 0.0;
        let (given_top, given_span) = match self {
            Self::FromData { top_db, span_db } => (top_db, span_db),
            Self::Fixed { top_db, span_db } => (Some(top_db), Some(span_db)),
        };
        let top_db = given_top.filter(sound_top);
        let span_db = given_span
            .filter(sound_span)
            .map(|span_db| span_db.min(1e3));
        let (top_db, span_db) = match (top_db, span_db) {
            (Some(top_db), Some(span_db)) => (top_db, span_db),
            _ => from_data(powers, top_db, span_db),
        };
        Levels {
            bottom: top_db - span_db,
            top: top_db,
        }
    }
}

/// Top and span, of which one may be given.
fn from_data(powers: &[f64], top_db: Option<f64>, span_db: Option<f64>) -> (f64, f64) {
    let mut seen: Vec<f64> = powers
        .iter()
        .copied()
        .filter(|p| p.is_finite() && *p > 0.0)
        .collect();
    if seen.is_empty() {
        return (top_db.unwrap_or(0.0), span_db.unwrap_or(60.0));
    }
    let peak = seen.iter().copied().fold(0.0, f64::max);
    let middle = (seen.len() - 1) / 2;
    let (_, median, _) = seen.select_nth_unstable_by(middle, f64::total_cmp);
    let top_db = top_db.unwrap_or_else(|| (10.0 * peak.log10()).ceil());
    let bottom_db = (10.0 * median.log10() - 6.0).floor();
    let span_db = span_db.unwrap_or_else(|| (top_db - bottom_db).clamp(40.0, 60.0));
    (top_db, span_db)
}
