//! UTM compared with PROJ, and with the defining properties of the projection.

use super::*;

fn place(latitude_deg: f64, longitude_deg: f64) -> Geodetic {
    Geodetic {
        latitude_deg,
        longitude_deg,
        height_m: 0.0,
    }
}

/// Reference: PROJ 9 (`+proj=utm`), with a different algorithm (Poder and Engsager's). Northings of 10^7 m have
/// roundings of 2e-9 m; ten of these are allowed.
#[test]
fn coordinates_match_proj() {
    for (latitude, longitude, zone, east, north) in [
        (0.0, 3.5, "31N", 555_638.192_444_180_6, 0.0),
        (
            52.1,
            4.3,
            "31N",
            589_044.843_911_894_5,
            5_772_957.770_711_297,
        ),
        (
            -33.9,
            151.2,
            "56S",
            333_568.941_011_552_1,
            6_247_473.336_844_02,
        ),
        (
            39.78,
            -84.1,
            "16N",
            748_355.143_069_312_7,
            4_407_363.249_375_127,
        ),
        (
            70.5,
            29.9,
            "35N",
            608_004.567_089_061_3,
            7_824_210.600_600_391,
        ),
        (
            83.9,
            -179.5,
            "1N",
            470_349.553_142_875_1,
            9_317_573.468_214_937,
        ),
        (
            -79.9,
            0.1,
            "31S",
            443_247.871_807_480_6,
            1_128_161.372_864_775_4,
        ),
        (1e-9, -177.0, "1N", 500_000.0, 0.000_110_530),
    ] {
        let found = Utm::of(&place(latitude, longitude)).unwrap();
        assert_eq!(found.zone.to_string(), zone);
        let off_m = f64::hypot(found.easting_m - east, found.northing_m - north);
        assert!(
            off_m < 2e-8,
            "{latitude} {longitude}: {found:?}, {off_m:e} m off"
        );
    }
}

/// A conformal map is defined by its values along one line: along the meridian northings are 0.9996 times its length
/// (by Simpson's rule here). Elsewhere the map rotates and scales equally in all directions.
#[test]
fn projection_is_conformal_and_true_to_scale_along_meridian() {
    let radius_m = |latitude: f64| {
        let w2 = 1.0 - ECCENTRICITY2 * latitude.sin().powi(2);
        SEMI_MAJOR_M * (1.0 - ECCENTRICITY2) / (w2 * w2.sqrt())
    };
    let zone = Zone::new(31, true).unwrap();
    for latitude_deg in [-75.0, -20.0, 1.0, 45.0, 84.0f64] {
        let latitude = latitude_deg.to_radians();
        let steps = 2000;
        let step = latitude / f64::from(steps);
        let weight = |k: i32| match k {
            0 => 1.0,
            k if k == steps => 1.0,
            k => f64::from(2 + 2 * (k % 2)),
        };
        let length_m: f64 = (0..=steps)
            .map(|k| weight(k) * radius_m(f64::from(k) * step))
            .sum::<f64>()
            * step
            / 3.0;
        let found = Utm::in_zone(&place(latitude_deg, 3.0), zone).unwrap();
        // 2000 roundings of 1e-9 m.
        assert!(
            (found.northing_m - 0.9996 * length_m).abs() < 1e-7,
            "{found:?}, {length_m}"
        );
        assert_eq!(found.easting_m, 500_000.0);
    }
    // Central differences over 1e-5 rad, 64 m: the truncation error is 1e-10 of them, and roundings are 2e-9 / 64.
    let step = 1e-5f64;
    for (latitude_deg, longitude_deg) in [(52.0, 5.9), (-75.0, 7.0), (10.0, -20.0), (80.0, 30.0)] {
        let at = |north: f64, east: f64| {
            let moved = place(
                latitude_deg + (north * step).to_degrees(),
                longitude_deg + (east * step).to_degrees(),
            );
            let utm = Utm::in_zone(&moved, zone).unwrap();
            [utm.easting_m, utm.northing_m]
        };
        let slope = |a: [f64; 2], b: [f64; 2], ground_m: f64| {
            [0, 1].map(|k| (a[k] - b[k]) / (2.0 * step * ground_m))
        };
        let latitude = f64::to_radians(latitude_deg);
        let across_m =
            SEMI_MAJOR_M * latitude.cos() / (1.0 - ECCENTRICITY2 * latitude.sin().powi(2)).sqrt();
        let north = slope(at(1.0, 0.0), at(-1.0, 0.0), radius_m(latitude));
        let east = slope(at(0.0, 1.0), at(0.0, -1.0), across_m);
        assert!(
            (north[0] + east[1]).abs() < 1e-8 || (north[0] - -east[1]).abs() < 1e-8,
            "{north:?} {east:?}"
        );
        assert!((north[1] - east[0]).abs() < 1e-8, "{north:?} {east:?}");
    }
}

#[test]
fn inverse_projection_restores_position() {
    for zone in [Zone::new(1, true).unwrap(), Zone::new(33, false).unwrap()] {
        for latitude in [-80.0, -33.3, 0.0, 1e-6, 51.0, 84.0, 89.9] {
            for away in [-29.9, -3.0, 0.0, 2.5, 20.0] {
                let there = place(latitude, wrapped(zone.meridian_deg() + away));
                let utm = Utm::in_zone(&there, zone).unwrap();
                let back = utm.to_geodetic(7.0);
                // 5 nm are 4.5e-14 degrees; sums of degrees are rounded to 3e-14, and longitudes near the poles to
                // more.
                let cos = there.latitude_deg.to_radians().cos();
                assert!((back.latitude_deg - latitude).abs() < 3e-13, "{back:?}");
                assert!(
                    cos * (back.longitude_deg - there.longitude_deg).abs() < 3e-13,
                    "{back:?}"
                );
                assert_eq!(back.height_m, 7.0);
            }
        }
    }
}

#[test]
fn zone_exceptions_of_norway_and_svalbard_apply() {
    for (latitude, longitude, expected) in [
        (0.0, -180.0, 1),
        (0.0, 180.0, 1),
        (-1.0, 179.999, 60),
        (60.0, 3.0, 32),
        (55.9, 3.0, 31),
        (78.0, 8.9, 31),
        (78.0, 9.0, 33),
        (78.0, 33.0, 37),
        (45.0, 725.0, 31),
    ] {
        let zone = Zone::of(&place(latitude, longitude)).unwrap();
        assert_eq!(zone.number(), expected, "{latitude} {longitude}");
        let first = if latitude < 0.0 { 32_700 } else { 32_600 };
        assert_eq!(zone.epsg(), first + u16::from(expected));
    }
    assert_eq!(Zone::of(&place(84.1, 0.0)), Err(UtmError::Latitude(84.1)));
    assert!(Zone::of(&place(0.0, f64::NAN)).is_err());
    assert_eq!(Zone::new(61, true), Err(UtmError::Zone(61)));
    let far = Utm::in_zone(&place(0.0, 50.0), Zone::new(31, true).unwrap());
    assert!(far.unwrap_err().to_string().contains("zone 31N"));
}
