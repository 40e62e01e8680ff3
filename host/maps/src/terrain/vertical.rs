//! Unit and vertical datum of GeoTIFF heights: vertical CRS (key 4096), vertical units (key 4099), and GDAL's band unit.
//!
//! Where several are present, they must agree. Without any, heights are metres (GeoTIFF leaves the unit to the reader).

/// International foot, metres.
const FOOT_M: f64 = 0.3048;
/// US survey foot, metres.
const SURVEY_FOOT_M: f64 = 1200.0 / 3937.0;

/// `VerticalGeoKey` (vertical CRS).
pub(crate) const VERTICAL_TYPE: u16 = 4096;
/// `VerticalUnitsGeoKey`.
pub(crate) const VERTICAL_UNITS: u16 = 4099;

/// Key value `user-defined`.
const USER_DEFINED: u16 = 32767;

/// Relative difference below which units are equal. The two feet, often confused, differ by 2e-6 (4 mm in 2 km).
const ALIKE: f64 = 1e-5;

/// Vertical datum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Datum {
    Ellipsoid,
    /// Named geoid or mean sea level.
    Sea(&'static str),
    /// Not stated.
    Unknown,
}

/// Unit and datum of heights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Vertical {
    /// Unit, metres.
    pub(crate) unit_m: f64,
    pub(crate) datum: Datum,
}

/// Vertical CRS of elevation models: EPSG code, datum, unit in metres. 5030 and 4979 are written by older software for ellipsoidal heights.
const SYSTEMS: [(u16, Datum, f64); 25] = [
    (5030, Datum::Ellipsoid, 1.0),
    (4979, Datum::Ellipsoid, 1.0),
    (5773, Datum::Sea("EGM96"), 1.0),
    (3855, Datum::Sea("EGM2008"), 1.0),
    (5798, Datum::Sea("EGM84"), 1.0),
    (5714, Datum::Sea("mean sea level"), 1.0),
    (5703, Datum::Sea("NAVD88"), 1.0),
    (6360, Datum::Sea("NAVD88"), SURVEY_FOOT_M),
    (8228, Datum::Sea("NAVD88"), FOOT_M),
    (7968, Datum::Sea("NGVD29"), 1.0),
    (5702, Datum::Sea("NGVD29"), SURVEY_FOOT_M),
    (5713, Datum::Sea("CGVD28"), 1.0),
    (6647, Datum::Sea("CGVD2013"), 1.0),
    (5701, Datum::Sea("ODN"), 1.0),
    (5709, Datum::Sea("NAP"), 1.0),
    (5711, Datum::Sea("AHD"), 1.0),
    (5720, Datum::Sea("NGF-IGN69"), 1.0),
    (5728, Datum::Sea("LN02"), 1.0),
    (5729, Datum::Sea("LHN95"), 1.0),
    (5730, Datum::Sea("EVRF2000"), 1.0),
    (5621, Datum::Sea("EVRF2007"), 1.0),
    (9389, Datum::Sea("EVRF2019"), 1.0),
    (5783, Datum::Sea("DHHN92"), 1.0),
    (7837, Datum::Sea("DHHN2016"), 1.0),
    (5705, Datum::Sea("Baltic 1977"), 1.0),
];

/// Unit and datum from the keys and GDAL's band unit (empty if absent).
///
/// # Errors
/// A unit or system that is not supported, or statements that disagree.
pub(crate) fn of(system: Option<u16>, units: Option<u16>, band: &str) -> Result<Vertical, String> {
    let convert = "convert heights to metres, for example with gdal_calc.py, or gdalwarp -t_srs and a vertical system in metres";
    let known = system.and_then(|code| SYSTEMS.iter().find(|(own, ..)| *own == code));
    let by_units = match units {
        None | Some(0) => None,
        Some(9001) => Some(1.0),
        Some(9002) => Some(FOOT_M),
        Some(9003) => Some(SURVEY_FOOT_M),
        Some(other) => {
            return Err(format!(
                "expected heights in metres (EPSG 9001), feet (9002) or US survey feet (9003), found units of EPSG {other} (key {VERTICAL_UNITS}); {convert}"
            ));
        }
    };
    let by_band = match band.trim().to_ascii_lowercase().as_str() {
        "" => None,
        "m" | "metre" | "meter" | "metres" | "meters" => Some(1.0),
        "ft" | "foot" | "feet" | "international foot" => Some(FOOT_M),
        "us-ft" | "ftus" | "us survey foot" | "us survey feet" | "foot_us" | "us_survey_foot" => {
            Some(SURVEY_FOOT_M)
        }
        other => {
            return Err(format!(
                "expected heights in m, ft or US survey foot, found '{other}' (GDAL band unit); {convert}"
            ));
        }
    };
    let datum = known.map_or(Datum::Unknown, |(_, datum, _)| *datum);
    let mut stated = [
        (by_units, "vertical units (key 4099)"),
        (known.map(|(.., unit)| *unit), "vertical system (key 4096)"),
        (by_band, "the GDAL band unit"),
    ]
    .into_iter()
    .filter_map(|(unit, what)| Some((unit?, what)));
    let Some((unit_m, what)) = stated.next() else {
        return match system {
            None | Some(0 | USER_DEFINED) => Ok(Vertical { unit_m: 1.0, datum }),
            Some(code) => Err(format!(
                "unknown unit of vertical system EPSG {code} (key {VERTICAL_TYPE}), and no vertical units (key {VERTICAL_UNITS}); state them, \
                 for example with gdal_edit.py -units m, or {convert}"
            )),
        };
    };
    match stated.find(|(other, _)| (other / unit_m - 1.0).abs() > ALIKE) {
        None => Ok(Vertical { unit_m, datum }),
        Some((other, by)) => Err(format!(
            "conflicting height units: {unit_m} m by {what}, {other} m by {by}; correct one of them, for example with gdal_edit.py"
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn height_units_are_converted_or_rejected() {
        let unit = |system, units, band| of(system, units, band).map(|vertical| vertical.unit_m);
        for (system, units, band, expected) in [
            (None, None, "", 1.0),
            (None, Some(9001), "metre", 1.0),
            (None, Some(9002), "", 0.3048),
            (None, Some(9003), "", 0.304_800_609_601_219_2),
            (Some(6360), None, "", 0.304_800_609_601_219_2),
            (Some(8228), None, "ft", 0.3048),
            (Some(5703), None, "", 1.0),
            // Unknown system with a stated unit.
            (Some(9999), Some(9002), "", 0.3048),
            (None, None, "US survey foot", 0.304_800_609_601_219_2),
            (None, None, "ft", 0.3048),
            // GDAL writes 'ft' for survey feet: the key takes precedence.
            (None, Some(9003), "ft", 0.304_800_609_601_219_2),
            (Some(32767), Some(9001), "", 1.0),
        ] {
            let found = unit(system, units, band).unwrap();
            assert!(
                (found - expected).abs() < 1e-15,
                "{system:?} {units:?} {band}: {found}"
            );
        }
        for (system, units, band, part) in [
            (
                Some(6360),
                Some(9001),
                "",
                "by vertical units (key 4099), 0.3048",
            ),
            (Some(5703), None, "ft", "correct one"),
            (None, Some(9036), "", "EPSG 9036"),
            (None, None, "fathom", "'fathom'"),
            (Some(5336), None, "", "unknown unit of vertical system"),
        ] {
            let error = unit(system, units, band).unwrap_err();
            assert!(error.contains(part), "{error}");
        }
        assert_eq!(of(Some(5773), None, "").unwrap().datum, Datum::Sea("EGM96"));
    }
}
