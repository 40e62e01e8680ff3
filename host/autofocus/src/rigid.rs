//! Rigid-body motion of a track.

use glam::DVec3;

/// Remove from `displaced_m` the best-fitting rigid motion of the track `antennas_m` in the plane of `axes` (least squares; Kabsch in
/// two dimensions). A scene with the same rigid motion gives the same echoes, so that it is unobservable.
pub(crate) fn without_rigid_motion(
    axes: [DVec3; 2],
    antennas_m: &[DVec3],
    displaced_m: &[DVec3],
) -> Vec<DVec3> {
    let count = antennas_m.len().max(1) as f64;
    let flat = |v: DVec3| [v.dot(axes[0]), v.dot(axes[1])];
    let middle = antennas_m.iter().sum::<DVec3>() / count;
    let moved_middle = middle + displaced_m.iter().sum::<DVec3>() / count;
    let (mut dot, mut cross) = (0.0, 0.0);
    for (&antenna_m, &displaced_m) in antennas_m.iter().zip(displaced_m) {
        let [a, b] = flat(antenna_m - middle);
        let [c, d] = flat(antenna_m + displaced_m - moved_middle);
        dot += a * c + b * d;
        cross += a * d - b * c;
    }
    let length = libm::hypot(dot, cross);
    let (sin, cos) = match length > 0.0 {
        true => (cross / length, dot / length),
        false => (0.0, 1.0),
    };
    let each = antennas_m.iter().zip(displaced_m);
    each.map(|(&antenna_m, &displaced_m)| {
        let there_m = antenna_m + displaced_m - moved_middle;
        let [x, y] = flat(there_m);
        // Rotated back; the component out of the plane is kept.
        let back = axes[0] * (cos * x + sin * y) + axes[1] * (cos * y - sin * x);
        let out = there_m - axes[0] * x - axes[1] * y;
        middle + back + out - antenna_m
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rigid_motion_is_removed_and_curvature_kept() {
        let axes = [DVec3::X, DVec3::Y];
        let antennas: Vec<DVec3> = (0..101)
            .map(|n| DVec3::new(f64::from(n) / 100.0, -3.0, 1.0))
            .collect();
        let (sin, cos) = 0.03f64.sin_cos();
        let rigid = |p: DVec3| {
            DVec3::new(
                cos * p.x - sin * p.y + 0.2,
                sin * p.x + cos * p.y - 0.1,
                p.z,
            )
        };
        let moved: Vec<DVec3> = antennas.iter().map(|&p| rigid(p) - p).collect();
        for left in without_rigid_motion(axes, &antennas, &moved) {
            assert!(left.length() < 1e-14, "{left}");
        }
        // A parabola without mean and slope is unchanged: its cross product with the straight track is zero.
        let bend = |n: u32| DVec3::Y * 0.01 * ((f64::from(n) / 50.0 - 1.0).powi(2) - 0.34);
        let bent: Vec<DVec3> = (0..101).map(bend).collect();
        let left = without_rigid_motion(axes, &antennas, &bent);
        for (left, bent) in left.iter().zip(&bent) {
            assert!(left.distance(*bent) < 1e-5, "{left} {bent}");
        }
    }
}
