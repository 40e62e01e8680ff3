//! Tests of maps against the defining sum at the map's pixels, phase included.

use std::f64::consts::TAU;

use glam::DVec3;
use num_complex::Complex64;

use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::{Geodetic, Relief};
use subaperture_model::image::Image;
use subaperture_model::resolution::support::RecordedLooks;
use subaperture_signal::window::Window;

use super::*;
use crate::Projection;

const BAND_HZ: [f64; 2] = [9.5e9, 9.8e9];
const FREQUENCIES: usize = 16;
const PULSES: usize = 15;

/// Three scatterers, on and off the focusing plane: position in the scene frame (metres) and amplitude.
const POINTS: [([f64; 3], f64); 3] = [
    ([1.3, 0.4, 0.0], 1.0),
    ([-1.1, -2.0, 0.3], 0.6),
    ([0.2, 2.1, -0.2], 0.4),
];

/// A radar 5 km to the south-west, at 30 degrees of elevation, over 0.06 rad.
fn antenna(pulse: usize) -> DVec3 {
    let angle = 4.0 + 0.06 * (pulse as f64 / (PULSES - 1) as f64 - 0.5);
    let (sin, cos) = angle.sin_cos();
    DVec3::new(4330.0 * cos, 4330.0 * sin, 2500.0)
}

fn frequency(k: usize) -> f64 {
    BAND_HZ[0] + (k as f64 + 0.5) * (BAND_HZ[1] - BAND_HZ[0]) / FREQUENCIES as f64
}

/// Defining sum at a point of the scene.
fn exact(at: DVec3) -> Complex64 {
    let mut sum = Complex64::ZERO;
    for pulse in 0..PULSES {
        let radar = antenna(pulse);
        for (point, amplitude) in POINTS {
            let path_m = 2.0 * (at.distance(radar) - DVec3::from(point).distance(radar));
            for k in 0..FREQUENCIES {
                let turns = frequency(k) * path_m / SPEED_OF_LIGHT_M_S;
                sum += amplitude * Complex64::cis(TAU * turns);
            }
        }
    }
    sum / (PULSES * FREQUENCIES) as f64
}

fn looks() -> Looks {
    RecordedLooks {
        band_cells: FREQUENCIES,
        bands_hz: vec![BAND_HZ],
        transmitters_m: (0..PULSES).map(|n| antenna(n).to_array()).collect(),
        receivers_m: Vec::new(),
    }
    .looks(Window::None, Window::None)
    .unwrap()
}

/// Scene frame whose x axis is rotated by 0.4 rad from east.
fn frame() -> SceneFrame {
    let place = Geodetic {
        latitude_deg: 52.1,
        longitude_deg: 4.3,
        height_m: 43.0,
    };
    let [east, north, _] = place.east_north_up();
    let (sin, cos) = 0.4f64.sin_cos();
    SceneFrame::Earth {
        origin_ecf_m: place.to_ecf_m(),
        x_axis_ecf: east * cos + north * sin,
        y_axis_ecf: north * cos - east * sin,
    }
}

fn image(grid: &ImageGrid) -> Image {
    let (rows, columns) = (grid.rows.count, grid.columns.count);
    let pixel = |i: usize| {
        let z = exact(grid.position_m(i / columns, i % columns));
        Complex32::new(z.re as f32, z.im as f32)
    };
    Image {
        rows,
        columns,
        pixels: (0..rows * columns).into_par_iter().map(pixel).collect(),
    }
}

/// Grid on a relief of half a metre, period 8 m, with nodes fine enough that their interpolation is negligible.
fn on_hills(text: &str) -> ImageGrid {
    let axis = subaperture_model::geometry::Axis {
        start: -6.0,
        step: 0.05,
        count: 241,
    };
    let heights_m = (0..axis.count * axis.count).map(|i| {
        let (x, y) = (axis.at(i % axis.count), axis.at(i / axis.count));
        0.5 * (0.8 * x).sin() * (0.8 * y).cos()
    });
    let relief = Relief::new("hills", [axis, axis], heights_m.collect(), 0.0).unwrap();
    text.parse::<ImageGrid>().unwrap().on(relief)
}

/// Surface point on the vertical of a map position, by bisection of the height.
fn above(grid: &ImageGrid, frame: &SceneFrame, place: Geodetic) -> DVec3 {
    let normal = grid.x_axis.cross(grid.y_axis);
    let point = |height_m| frame.from_ecf_m(Geodetic { height_m, ..place }.to_ecf_m());
    let side = |height_m| {
        let from = point(height_m) - grid.origin_m;
        let (x, y) = (from.dot(grid.x_axis), from.dot(grid.y_axis));
        let relief_m = grid.relief.as_ref().map_or(0.0, |r| r.height_m(x, y));
        from.dot(normal) > relief_m
    };
    let (mut low, mut high) = (-1000.0, 1000.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        match side(middle) == side(low) {
            true => low = middle,
            false => high = middle,
        }
    }
    point(0.5 * (low + high))
}

/// Relative RMS error against the sum at map pixels well inside the image, and the planned error; dB.
fn error_db(
    grid: &ImageGrid,
    projection: fn(&Geodetic) -> Result<Projection, MapError>,
) -> [f64; 2] {
    let (frame, looks) = (frame(), looks());
    let image = image(grid);
    let source = Source {
        pixels: &image,
        grid,
        frame: &frame,
        looks: &looks,
    };
    let raster = Raster::covering(grid, &frame, projection, None).unwrap();
    let ortho = Ortho::new(source, raster).unwrap();
    let place = [0..raster.rows, 0..raster.columns];
    let got = ortho.complex(&place).unwrap();
    let (mut error, mut norm, mut compared) = (0.0, 0.0, 0);
    for (i, z) in got.into_iter().enumerate().step_by(7) {
        let (row, column) = (i / raster.columns, i % raster.columns);
        let at = raster.coordinates([row as f64 + 0.5, column as f64 + 0.5]);
        let point = above(grid, &frame, raster.projection.place(at));
        let [row_value, mut column_value] = grid.coordinates(point);
        if grid.polar && column_value < 0.0 {
            column_value += TAU;
        }
        let margin = |axis: &subaperture_model::geometry::Axis, value: f64| {
            let at = (value - axis.start) / axis.step;
            at.min((axis.count - 1) as f64 - at)
        };
        let margin = margin(&grid.rows, row_value).min(margin(&grid.columns, column_value));
        if margin < -0.51 {
            assert!(z.is_nan(), "a value beyond the image, by {margin}");
        } else if margin > 8.0 {
            let expected = exact(point);
            error += (Complex64::new(z.re.into(), z.im.into()) - expected).norm_sqr();
            norm += expected.norm_sqr();
            compared += 1;
        }
    }
    assert!(compared > 200, "{compared}");
    [10.0 * (error / norm).log10(), ortho.error_db()]
}

#[test]
fn map_values_agree_with_defining_sum() {
    let utm: fn(&Geodetic) -> Result<Projection, MapError> = Projection::utm;
    let geographic: fn(&Geodetic) -> Result<Projection, MapError> =
        |place| Ok(Projection::geographic(place));
    let plane = |text: &str| text.parse::<ImageGrid>().unwrap();
    for (grid, projection) in [
        (plane("x=-5:5:0.14,y=-5:5:0.13,z=0"), utm),
        (plane("x=-5:5:0.14,y=-5:5:0.13,z=0"), geographic),
        (plane("x=-5:5:0.12,y=-5:5:0.12,z=1,pitch=8,roll=-5"), utm),
        // Polar grid about a pole 20 m away, angles across +-180 degrees.
        (plane("r=15:25:0.14,theta=165:195:0.35,cx=20"), utm),
        (on_hills("x=-5:5:0.12,y=-5:5:0.12,z=0"), utm),
        (
            on_hills("x=-5:5:0.11,y=-5:5:0.11,z=1,pitch=8,roll=-5"),
            geographic,
        ),
    ] {
        let [error_db, planned_db] = error_db(&grid, projection);
        println!("{error_db:.1} dB, planned {planned_db:.1} dB");
        // The planned error is for a spectrum that fills its rectangle; this one fills a part of it, whose edges weigh more: 3 dB. Pixels and
        // carrier phasors are float32, some 1e-7 each: -120 dB.
        assert!(planned_db < -60.0, "{planned_db}");
        assert!(
            error_db < planned_db + 3.0,
            "{error_db} dB, planned {planned_db} dB"
        );
    }
}

#[test]
fn coarse_map_pixels_average_power() {
    let grid: ImageGrid = "x=-5:5:0.14,y=-5:5:0.14,z=0".parse().unwrap();
    let (frame, looks) = (frame(), looks());
    let image = image(&grid);
    let source = Source {
        pixels: &image,
        grid: &grid,
        frame: &frame,
        looks: &looks,
    };
    let raster = Raster::covering(&grid, &frame, Projection::utm, Some(0.3)).unwrap();
    let ortho = Ortho::new(source, raster).unwrap();
    // 0.3 m in samples of at most 0.14 m: three per side.
    assert_eq!(ortho.averaged(), 9);
    assert!(matches!(
        ortho.complex(&[0..1, 0..1]),
        Err(MapError::Coarse { .. })
    ));
    let (row, column) = (raster.rows / 2, raster.columns / 2 + 2);
    let got = ortho.powers(&[row..row + 1, column..column + 1]).unwrap()[0];
    let parts = [1.0, 3.0, 5.0].map(|part| part / 6.0);
    let (grid, frame) = (&grid, &frame);
    let powers = parts.iter().flat_map(|down| {
        parts.iter().map(move |along| {
            let at = raster.coordinates([row as f64 + down, column as f64 + along]);
            exact(above(grid, frame, raster.projection.place(at))).norm_sqr()
        })
    });
    let expected = powers.sum::<f64>() / 9.0;
    // Interpolation error: at most 1e-3 of the image's RMS, which is less than the mean here.
    assert!(
        (f64::from(got) / expected - 1.0).abs() < 4e-3,
        "{got} {expected}"
    );
}

#[test]
fn raster_refuses_local_vertical_and_oversized_maps() {
    let looks = looks();
    let covering = |text: &str, frame: &SceneFrame, pixel_m| {
        let grid: ImageGrid = text.parse().unwrap();
        Raster::covering(&grid, frame, Projection::utm, pixel_m)
    };
    let grid = "x=-5:5:0.14,y=-5:5:0.14,z=0";
    assert!(matches!(
        covering(grid, &SceneFrame::Local, None),
        Err(MapError::Local)
    ));
    let wall = "x=-5:5:0.14,y=-5:5:0.14,roll=90";
    assert!(matches!(
        covering(wall, &frame(), None),
        Err(MapError::Upright)
    ));
    for pixel_m in [1e-12, 1000.0] {
        let refused = covering(grid, &frame(), Some(pixel_m));
        assert!(matches!(refused, Err(MapError::Size { .. })), "{pixel_m}");
    }
    // 4 cycles per metre are undersampled by pixels of 0.3 m.
    let coarse: ImageGrid = "x=-5:5:0.3,y=-5:5:0.3".parse().unwrap();
    let folded = Carrier::of(&coarse, &looks);
    assert!(matches!(folded, Err(MapError::Folded { .. })), "{folded:?}");
}

/// Values of a map by the nearest pixel, against the pixel whose centre is nearest to the map pixel's position. NaN do not spread.
#[test]
fn nearest_pixels_are_mapped_without_interpolation() {
    let grid: ImageGrid = "x=-6:6:0.5,y=-5:5:0.4".parse().unwrap();
    let frame = frame();
    let (rows, columns) = (grid.rows.count, grid.columns.count);
    let value = |i: usize| match i % 7 {
        0 => NO_VALUE,
        _ => Complex32::new(i as f32, 1.0),
    };
    let image = Image {
        rows,
        columns,
        pixels: (0..rows * columns).map(value).collect(),
    };
    let raster = Raster::covering(&grid, &frame, Projection::utm, None).unwrap();
    let ortho = Ortho::nearest(&image, &grid, &frame, raster).unwrap();
    let got = ortho.complex(&[0..raster.rows, 0..raster.columns]).unwrap();
    let mut compared = 0;
    for (i, z) in got.into_iter().enumerate() {
        let at = [i / raster.columns, i % raster.columns].map(|n| n as f64 + 0.5);
        let place = raster.projection.place(raster.coordinates(at));
        let [y, x] = grid.coordinates(above(&grid, &frame, place));
        let at = [
            (y - grid.rows.start) / grid.rows.step,
            (x - grid.columns.start) / grid.columns.step,
        ];
        // Positions between two pixels may be rounded to either.
        if at.iter().any(|x| (x - x.floor() - 0.5).abs() < 1e-3) {
            continue;
        }
        let [row, column] = at.map(f64::round);
        let inside = row >= 0.0 && column >= 0.0 && row < rows as f64 && column < columns as f64;
        let wanted = match inside {
            true => value(row as usize * columns + column as usize),
            false => NO_VALUE,
        };
        assert!(
            z == wanted || z.is_nan() && wanted.is_nan(),
            "{at:?}: {z} {wanted}"
        );
        compared += usize::from(inside);
    }
    assert!(compared > 400, "{compared}");
}
