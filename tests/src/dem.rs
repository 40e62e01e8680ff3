//! Elevation models as files, and the Earth's shape, by the tests' own formulas.

use glam::DVec3;

/// Semi-major axis, metres, and first eccentricity squared, of WGS 84.
const A_M: f64 = 6_378_137.0;
const E2: f64 = 6.694_379_990_141_316e-3;

/// Earth-centred Earth-fixed coordinates, metres, by definition; latitude and longitude in degrees.
pub fn ecf_m([latitude_deg, longitude_deg, height_m]: [f64; 3]) -> DVec3 {
    let (sin, cos) = latitude_deg.to_radians().sin_cos();
    let (sin_lon, cos_lon) = longitude_deg.to_radians().sin_cos();
    let n = A_M / (1.0 - E2 * sin * sin).sqrt();
    DVec3::new(
        (n + height_m) * cos * cos_lon,
        (n + height_m) * cos * sin_lon,
        (n * (1.0 - E2) + height_m) * sin,
    )
}

/// East, north and up of `place` from `origin`, metres along the axes at `origin`.
pub fn east_north_up_m(origin: [f64; 3], place: [f64; 3]) -> DVec3 {
    let (sin, cos) = origin[0].to_radians().sin_cos();
    let (sin_lon, cos_lon) = origin[1].to_radians().sin_cos();
    let from = ecf_m(place) - ecf_m(origin);
    DVec3::new(
        from.dot(DVec3::new(-sin_lon, cos_lon, 0.0)),
        from.dot(DVec3::new(-sin * cos_lon, -sin * sin_lon, cos)),
        from.dot(DVec3::new(cos * cos_lon, cos * sin_lon, sin)),
    )
}

/// Metres per degree of latitude and of longitude on the ellipsoid, from the radii of curvature.
pub fn degree_m(latitude_deg: f64) -> [f64; 2] {
    let (sin, cos) = latitude_deg.to_radians().sin_cos();
    let w2 = 1.0 - E2 * sin * sin;
    let n = A_M / w2.sqrt();
    [n * (1.0 - E2) / w2, n * cos].map(|radius| radius * std::f64::consts::PI / 180.0)
}

/// An HGT file with its south-western corner at whole degrees; heights as a function of latitude and longitude are rounded to metres.
pub fn hgt(corner: [f64; 2], side: usize, height_m: impl Fn(f64, f64) -> f64) -> Vec<u8> {
    let step = 1.0 / (side - 1) as f64;
    let mut bytes = Vec::with_capacity(2 * side * side);
    for row in 0..side {
        let latitude = corner[0] + 1.0 - row as f64 * step;
        for column in 0..side {
            let height = height_m(latitude, corner[1] + column as f64 * step);
            bytes.extend((height.round() as i16).to_be_bytes());
        }
    }
    bytes
}

/// Height of an HGT file at a position: bilinear between whole metres.
pub fn hgt_height_m(
    corner: [f64; 2],
    side: usize,
    [latitude, longitude]: [f64; 2],
    height_m: impl Fn(f64, f64) -> f64,
) -> f64 {
    let step = 1.0 / (side - 1) as f64;
    let (north, east) = (
        (latitude - corner[0]) / step,
        (longitude - corner[1]) / step,
    );
    let (i, j) = (north.floor(), east.floor());
    let post = |di: f64, dj: f64| {
        height_m(corner[0] + (i + di) * step, corner[1] + (j + dj) * step).round()
    };
    let (v, u) = (north - i, east - j);
    (1.0 - v) * ((1.0 - u) * post(0.0, 0.0) + u * post(0.0, 1.0))
        + v * ((1.0 - u) * post(1.0, 0.0) + u * post(1.0, 1.0))
}

/// A GeoTIFF of float32 heights, little-endian, in strips or in square tiles.
#[derive(Clone, Debug)]
pub struct GeoTiff {
    /// Columns, rows.
    pub size: [usize; 2],
    /// Eastern and northern coordinate of the tie point: the outer corner of the first pixel, or its centre if pixels are points.
    pub origin: [f64; 2],
    /// Steps eastwards and southwards, positive.
    pub steps: [f64; 2],
    /// Whether pixels are points.
    pub points: bool,
    /// EPSG code: 4326, or of a UTM zone.
    pub epsg: u16,
    /// Side of a tile, a multiple of 16; `None` for strips.
    pub tile: Option<usize>,
    /// Rows of a strip.
    pub strip_rows: usize,
    /// Value that marks a void.
    pub void: Option<f32>,
    /// Whether strips or tiles are compressed by Deflate.
    pub deflate: bool,
}

impl GeoTiff {
    /// Bytes of the file with heights by column and row.
    ///
    /// # Panics
    /// If compression fails.
    pub fn bytes(&self, height_m: impl Fn(usize, usize) -> f32) -> Vec<u8> {
        let [columns, rows] = self.size;
        let (wide, high) = match self.tile {
            Some(side) => (side, side),
            None => (columns, self.strip_rows),
        };
        let mut out = b"II\x2a\0\0\0\0\0".to_vec();
        let (mut places, mut lengths) = (Vec::new(), Vec::new());
        for top in (0..rows).step_by(high) {
            for left in (0..columns).step_by(wide) {
                let mut chunk = Vec::new();
                for row in top..top + high {
                    for column in left..left + wide {
                        // A strip ends with the image; a tile is padded.
                        if self.tile.is_none() && row >= rows {
                            continue;
                        }
                        let there = row < rows && column < columns;
                        let height = if there { height_m(column, row) } else { -1e9 };
                        chunk.extend(height.to_le_bytes());
                    }
                }
                if self.deflate {
                    use std::io::Write;
                    let mut packed =
                        flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
                    packed.write_all(&chunk).unwrap();
                    chunk = packed.finish().unwrap();
                }
                places.push(out.len() as u32);
                lengths.push(chunk.len() as u32);
                out.extend(chunk);
            }
        }
        let (model, code) = match self.epsg {
            4326 => (2, 2048),
            _ => (1, 3072),
        };
        let raster = if self.points { 2 } else { 1 };
        let keys = [
            [1, 1, 0, 3],
            [1024, 0, 1, model],
            [1025, 0, 1, raster],
            [code, 0, 1, self.epsg],
        ];
        let shorts = |values: &[u16]| {
            values
                .iter()
                .flat_map(|v| v.to_le_bytes())
                .collect::<Vec<u8>>()
        };
        let longs = |values: &[u32]| {
            values
                .iter()
                .flat_map(|v| v.to_le_bytes())
                .collect::<Vec<u8>>()
        };
        let doubles = |values: &[f64]| {
            values
                .iter()
                .flat_map(|v| v.to_le_bytes())
                .collect::<Vec<u8>>()
        };
        // Tag, type, count, bytes.
        let mut tags: Vec<(u16, u16, usize, Vec<u8>)> = vec![
            (256, 4, 1, longs(&[columns as u32])),
            (257, 4, 1, longs(&[rows as u32])),
            (258, 3, 1, shorts(&[32])),
            (259, 3, 1, shorts(&[if self.deflate { 8 } else { 1 }])),
            (262, 3, 1, shorts(&[1])),
            (277, 3, 1, shorts(&[1])),
            (339, 3, 1, shorts(&[3])),
            (33550, 12, 3, doubles(&[self.steps[0], self.steps[1], 0.0])),
            (
                33922,
                12,
                6,
                doubles(&[0.0, 0.0, 0.0, self.origin[0], self.origin[1], 0.0]),
            ),
            (34735, 3, 16, shorts(&keys.concat())),
        ];
        match self.tile {
            Some(side) => tags.extend([
                (322, 4, 1, longs(&[side as u32])),
                (323, 4, 1, longs(&[side as u32])),
                (324, 4, places.len(), longs(&places)),
                (325, 4, lengths.len(), longs(&lengths)),
            ]),
            None => tags.extend([
                (273, 4, places.len(), longs(&places)),
                (278, 4, 1, longs(&[self.strip_rows as u32])),
                (279, 4, lengths.len(), longs(&lengths)),
            ]),
        }
        if let Some(void) = self.void {
            let text = format!("{void}\0").into_bytes();
            tags.push((42113, 2, text.len(), text));
        }
        tags.sort_by_key(|tag| tag.0);
        // Values too long for an entry are before the directory.
        let mut entries = Vec::new();
        for (tag, kind, count, mut bytes) in tags {
            if bytes.len() > 4 {
                let at = out.len() as u32;
                out.extend(&bytes);
                bytes = at.to_le_bytes().to_vec();
            }
            bytes.resize(4, 0);
            entries.extend(tag.to_le_bytes());
            entries.extend(kind.to_le_bytes());
            entries.extend((count as u32).to_le_bytes());
            entries.extend(bytes);
        }
        let at = (out.len() as u32).to_le_bytes();
        out[4..8].copy_from_slice(&at);
        out.extend(((entries.len() / 12) as u16).to_le_bytes());
        out.extend(entries);
        out.extend([0; 4]);
        out
    }
}
