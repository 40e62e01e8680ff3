//! Records of an SBET, with the wander frame along north and east.

use std::f64::consts::PI;
use std::io::{self, Write};

use super::state::VehicleState;

/// Write a record; acceleration and rates of the body are 0.
pub(super) fn record(out: &mut dyn Write, state: &VehicleState) -> io::Result<()> {
    let [east, north, up] = state.velocity_m_s.to_array();
    let [roll, pitch, azimuth] = state.attitude_deg.map(f64::to_radians);
    let mut numbers = [0.0; 17];
    numbers[..10].copy_from_slice(&[
        state.time.seconds,
        state.place.latitude_deg.to_radians(),
        state.place.longitude_deg.to_radians(),
        state.place.height_m,
        north,
        east,
        up,
        roll,
        pitch,
        // From -pi to pi, as Applanix writes it.
        (azimuth + PI).rem_euclid(2.0 * PI) - PI,
    ]);
    for number in numbers {
        out.write_all(&number.to_le_bytes())?;
    }
    Ok(())
}
