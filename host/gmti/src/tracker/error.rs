//! Errors of the tracker.

/// Reason why settings or a scan are refused. A refused scan leaves the tracks unchanged.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TrackerError {
    /// A setting is out of its range.
    #[error("tracker settings: {name}: expected {expected}, found {found:e}")]
    Setting {
        /// Name of the setting.
        name: &'static str,
        /// Accepted range, with its unit.
        expected: &'static str,
        /// Value that was refused.
        found: f64,
    },
    /// The axes of the plane are not orthonormal.
    #[error(
        "tracker settings: plane: expected a finite origin and two perpendicular unit vectors, found lengths {x_length} and {y_length} and scalar product {product:e}"
    )]
    Plane {
        /// Length of the x axis.
        x_length: f64,
        /// Length of the y axis.
        y_length: f64,
        /// Scalar product of both axes.
        product: f64,
    },
    /// A scan is not later than the scan before.
    #[error(
        "scan: expected a finite time after {last_s} s, found {time_s} s: sort scans by time and merge scans of the same time"
    )]
    Time {
        /// Time of the scan before, seconds; negative infinity for the first scan.
        last_s: f64,
        /// Time of the refused scan, seconds.
        time_s: f64,
    },
    /// The radar position is not finite.
    #[error("scan: expected a finite radar position, found {0:?} m")]
    Sensor([f64; 3]),
    /// The radar velocity is not finite.
    #[error("scan: expected a finite radar velocity, found {0:?} m/s")]
    SensorVelocity([f64; 3]),
    /// A scan has too many detections.
    #[error(
        "scan: expected at most {allowed} detections, found {found}: raise the detection threshold or the setting max_detections"
    )]
    Detections {
        /// Largest accepted number of detections.
        allowed: usize,
        /// Number of detections of the scan.
        found: usize,
    },
    /// A detection has a value that is not finite.
    #[error("scan: detection {index}: expected finite values, found {found} as {name}")]
    NotFinite {
        /// Index of the detection in the scan, from 0.
        index: usize,
        /// Name of the value.
        name: &'static str,
        /// Value that was refused.
        found: f64,
    },
    /// The covariance of a detection is not positive definite.
    #[error(
        "scan: detection {index}: expected a symmetric positive definite covariance of x, y and radial velocity, found {covariance:?}: give all three positive variances and correlations below 1"
    )]
    Covariance {
        /// Index of the detection in the scan, from 0.
        index: usize,
        /// Refused covariance, m^2, m * m/s and (m/s)^2.
        covariance: [[f64; 3]; 3],
    },
    /// The velocity ambiguity of a detection is not positive.
    #[error(
        "scan: detection {index}: expected a velocity ambiguity above 0, found {found} m/s: use None for unambiguous velocities"
    )]
    Ambiguity {
        /// Index of the detection in the scan, from 0.
        index: usize,
        /// Refused interval, metres per second.
        found: f64,
    },
}
