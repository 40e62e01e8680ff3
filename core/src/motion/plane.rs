//! Plane vectors in metres.

pub(super) type Vector = [f64; 2];

pub(super) fn plus(a: Vector, b: Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1]]
}

pub(super) fn minus(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1]]
}

pub(super) fn times(a: Vector, by: f64) -> Vector {
    [a[0] * by, a[1] * by]
}

pub(super) fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

pub(super) fn cross(a: Vector, b: Vector) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

pub(super) fn length(a: Vector) -> f64 {
    libm::sqrt(dot(a, a))
}

pub(super) fn rotated(a: Vector, angle_rad: f64) -> Vector {
    let (sin, cos) = libm::sincos(angle_rad);
    [cos * a[0] - sin * a[1], sin * a[0] + cos * a[1]]
}

pub(super) fn direction(from: Vector, to: Vector) -> Vector {
    let apart = minus(to, from);
    times(apart, 1.0 / length(apart))
}
