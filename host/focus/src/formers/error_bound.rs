//! Setting `error_db` of formers that plan by an error bound.

/// Settings with an error bound.
pub(crate) trait ErrorBound: Copy {
    /// Bound on the relative RMS error of the image that plans keep, dB (negative).
    fn planned_bound_db(&self) -> f64;

    /// The same settings with another bound.
    #[must_use]
    fn with_planned_bound_db(self, error_db: f64) -> Self;
}

/// Implement [`ErrorBound`], the builder `error_db` and [`Default`] for settings with the field `error_db`, given the
/// defaults of all other fields.
macro_rules! error_bound {
    ($former:ident { $($setting:ident: $default:expr),* $(,)? }) => {
        impl Default for $former {
            fn default() -> Self {
                Self {
                    error_db: $crate::DEFAULT_ERROR_DB,
                    $($setting: $default,)*
                }
            }
        }

        impl $former {
            /// Make the former with a bound on the relative RMS error of the image, dB (negative).
            #[must_use]
            pub fn error_db(mut self, error_db: f64) -> Self {
                self.error_db = error_db;
                self
            }
        }

        impl $crate::formers::error_bound::ErrorBound for $former {
            fn planned_bound_db(&self) -> f64 {
                self.error_db
            }

            fn with_planned_bound_db(self, error_db: f64) -> Self {
                self.error_db(error_db)
            }
        }
    };
}

pub(super) use error_bound;
