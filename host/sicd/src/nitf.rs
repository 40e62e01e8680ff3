//! Writer of NITF 2.1 headers (MIL-STD-2500C) for image segments and one XML segment, as in SICD volume 2.

use subaperture_io::ours::NITF_MARK;
use subaperture_model::geometry::Geodetic;

use crate::dates::digits;
use crate::version::SicdVersion;

/// Largest data length of an image segment, bytes.
pub(crate) const MAX_BYTES: u64 = 9_999_999_998;
/// Largest row offset of a segment to the one before.
const MAX_ROWS: u64 = 99_999;
/// Largest number of image segments.
const MAX_SEGMENTS: u64 = 999;
/// Length of an image segment header with one band, bytes.
const IMAGE_HEADER: u64 = 499;
/// Length added by each further band, bytes.
const BAND_HEADER: u64 = 13;
/// Length of the XML segment header, bytes.
const XML_HEADER: u64 = 973;

/// XML namespace of SIDD 3.0.
pub(crate) const SIDD_NAMESPACE: &str = "urn:SIDD:3.0.0";

/// Kind of file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Product {
    /// Complex pixels, pairs of float32.
    Sicd(SicdVersion),
    /// Grey pixels, bytes.
    Sidd,
}

impl Product {
    /// Size of a pixel, bytes.
    pub(crate) fn sample_bytes(self) -> u64 {
        match self {
            Self::Sicd(_) => 8,
            Self::Sidd => 1,
        }
    }

    /// Name of the standard.
    fn title(self) -> &'static str {
        match self {
            Self::Sicd(_) => "SICD",
            Self::Sidd => "SIDD",
        }
    }

    /// Version, date and XML namespace of the standard.
    fn schema(self) -> [&'static str; 3] {
        match self {
            Self::Sicd(version) => [version.number(), version.date(), version.namespace()],
            Self::Sidd => ["3.0", "2021-11-30T00:00:00Z", SIDD_NAMESPACE],
        }
    }

    /// `IID1` of segment `n`, counted from 0.
    fn segment_name(self, n: usize, of: usize) -> String {
        match (self, of) {
            (Self::Sidd, _) => format!("SIDD001{:03}", n + 1),
            (Self::Sicd(_), 1) => "SICD000".to_owned(),
            (Self::Sicd(_), _) => format!("SICD{:03}", n + 1),
        }
    }

    fn bands(self) -> &'static [&'static str] {
        match self {
            Self::Sicd(_) => &["I", "Q"],
            Self::Sidd => &["M"],
        }
    }

    /// Length of an image segment header, bytes.
    fn header_bytes(self) -> u64 {
        IMAGE_HEADER + BAND_HEADER * (self.bands().len() as u64 - 1)
    }
}

/// Row range of a segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Segment {
    pub(crate) first: u64,
    pub(crate) rows: u64,
}

/// Divide an image's rows into segments (SICD volume 2, 3.2.1) of at most `most_bytes` and [`MAX_BYTES`]. `None` if the image exceeds the capacity
/// of a file.
pub(crate) fn segments(
    rows: u64,
    columns: u64,
    sample_bytes: u64,
    most_bytes: u64,
) -> Option<Vec<Segment>> {
    let most_bytes = most_bytes.min(MAX_BYTES);
    let row_bytes = columns.checked_mul(sample_bytes)?;
    if rows.checked_mul(row_bytes)? <= most_bytes {
        return Some(vec![Segment { first: 0, rows }]);
    }
    let each = (most_bytes / row_bytes).min(MAX_ROWS);
    if each == 0 || rows.div_ceil(each) > MAX_SEGMENTS {
        return None;
    }
    let firsts = (0..rows).step_by(each as usize);
    Some(
        firsts
            .map(|first| Segment {
                first,
                rows: each.min(rows - first),
            })
            .collect(),
    )
}

/// Writer of fixed-width fields.
struct Fields(String);

impl Fields {
    /// Append left-aligned text, truncated to the width; characters that are not ASCII become question marks.
    fn text(&mut self, width: usize, text: &str) -> &mut Self {
        let plain = |c: char| if (' '..='~').contains(&c) { c } else { '?' };
        let cut: String = text.chars().map(plain).take(width).collect();
        self.0 += &format!("{cut:width$}");
        self
    }

    /// Append a number with leading zeros.
    fn number(&mut self, width: usize, value: u64) -> &mut Self {
        self.0 += &format!("{value:0width$}");
        self
    }

    /// Append the security fields of an unclassified file: one letter and 166 spaces.
    fn unclassified(&mut self) -> &mut Self {
        self.text(1, "U").text(166, "")
    }
}

/// Encoded headers, in file order: the file header, one header before each segment's samples, one before the XML.
#[derive(Clone, Debug)]
pub(crate) struct Headers {
    pub(crate) file: Vec<u8>,
    pub(crate) images: Vec<Vec<u8>>,
    pub(crate) xml: Vec<u8>,
    /// Size of the file, bytes.
    pub(crate) bytes: u64,
}

/// Content of the headers.
pub(crate) struct About<'a> {
    pub(crate) product: Product,
    pub(crate) name: &'a str,
    pub(crate) start_ns: i64,
    pub(crate) created_ns: i64,
    pub(crate) columns: u64,
    pub(crate) segments: &'a [Segment],
    /// Corners of each segment, clockwise from first row and column.
    pub(crate) corners: &'a [[Geodetic; 4]],
    /// Corners of the image.
    pub(crate) outline: &'a [Geodetic; 4],
    pub(crate) xml_bytes: u64,
}

impl About<'_> {
    /// Encode the headers; `None` if the file is too long for the length fields.
    pub(crate) fn headers(&self) -> Option<Headers> {
        let data = |segment: &Segment| segment.rows * self.columns * self.product.sample_bytes();
        // 388 bytes up to NUMXS without the list of image segments, 13 for the XML's entry, and the two lengths of extension headers.
        let header_bytes = 404 - 16 + 16 * self.segments.len() as u64 + 13;
        let samples: u64 = self.segments.iter().map(data).sum();
        let bytes = header_bytes
            + self.product.header_bytes() * self.segments.len() as u64
            + samples
            + XML_HEADER
            + self.xml_bytes;
        if bytes > 999_999_999_998 || self.xml_bytes > 999_999_998 {
            return None;
        }
        let mut file = Fields(String::new());
        file.text(9, "NITF02.10").number(2, self.complexity(bytes));
        file.text(4, "BF01").text(10, NITF_MARK);
        file.text(14, &digits(self.created_ns));
        file.text(80, &format!("{}: {}", self.product.title(), self.name));
        file.unclassified().number(5, 0).number(5, 0).number(1, 0);
        // Background colour: black.
        file.0 += "\0\0\0";
        file.text(24, NITF_MARK).text(18, "");
        file.number(12, bytes).number(6, header_bytes);
        file.number(3, self.segments.len() as u64);
        for segment in self.segments {
            file.number(6, self.product.header_bytes())
                .number(10, data(segment));
        }
        // No graphics, reserved segments or texts; one data extension; no reserved extensions or user headers.
        file.number(3, 0).number(3, 0).number(3, 0).number(3, 1);
        file.number(4, XML_HEADER).number(9, self.xml_bytes);
        file.number(3, 0).number(5, 0).number(5, 0);
        assert_eq!(file.0.len() as u64, header_bytes, "the file's header");
        let images = (0..self.segments.len()).map(|n| self.image(n)).collect();
        Some(Headers {
            file: file.0.into_bytes(),
            images,
            xml: self.xml(),
            bytes,
        })
    }

    /// Complexity level (CLEVEL) from file and image size.
    fn complexity(&self, bytes: u64) -> u64 {
        let rows: u64 = self.segments.iter().map(|segment| segment.rows).sum();
        let side = rows.max(self.columns);
        match () {
            () if bytes < 50 << 20 && side <= 2048 => 3,
            () if bytes < 1 << 30 && side <= 8192 => 5,
            () if bytes < 2 << 30 && side <= 65_536 => 6,
            () if bytes < 10 << 30 => 7,
            () => 9,
        }
    }

    fn image(&self, n: usize) -> Vec<u8> {
        let segment = self.segments[n];
        let mut h = Fields(String::new());
        let name = self.product.segment_name(n, self.segments.len());
        h.text(2, "IM")
            .text(10, &name)
            .text(14, &digits(self.start_ns));
        h.text(17, "").text(80, self.name);
        h.unclassified().number(1, 0).text(42, NITF_MARK);
        h.number(8, segment.rows).number(8, self.columns);
        let grey = self.product == Product::Sidd;
        let [kind, shown] = if grey {
            ["INT", "MONO"]
        } else {
            ["R", "NODISPLY"]
        };
        let bits = if grey { 8 } else { 32 };
        h.text(3, kind).text(8, shown).text(8, "SAR");
        h.number(2, bits).text(1, "R");
        h.text(1, "G")
            .text(60, &self.corners[n].map(|c| arc_seconds(&c)).concat());
        // No comments; no compression.
        let bands = self.product.bands();
        h.number(1, 0).text(2, "NC").number(1, bands.len() as u64);
        for band in bands {
            // IREPBAND of a grey band, ISUBCAT of a complex part.
            let [represents, part] = if grey { [*band, ""] } else { ["", band] };
            h.text(2, represents)
                .text(6, part)
                .text(1, "N")
                .text(3, "")
                .number(1, 0);
        }
        // One block; sides above 8192 are written as 0. IMODE P for complex pixels, B for one band.
        let side = |count: u64| if count > 8192 { 0 } else { count };
        let mode = if grey { "B" } else { "P" };
        h.number(1, 0).text(1, mode).number(4, 1).number(4, 1);
        h.number(4, side(self.columns))
            .number(4, side(segment.rows))
            .number(2, bits);
        h.number(3, n as u64 + 1).number(3, n as u64);
        let below = n
            .checked_sub(1)
            .map_or(0, |before| self.segments[before].rows);
        h.number(5, below)
            .number(5, 0)
            .text(4, "1.0")
            .number(5, 0)
            .number(5, 0);
        assert_eq!(
            h.0.len() as u64,
            self.product.header_bytes(),
            "an image's header"
        );
        h.0.into_bytes()
    }

    fn xml(&self) -> Vec<u8> {
        let mut h = Fields(String::new());
        h.text(2, "DE")
            .text(25, "XML_DATA_CONTENT")
            .number(2, 1)
            .unclassified();
        h.number(4, 773).number(5, 99_999).text(8, "XML");
        let created = crate::dates::iso(self.created_ns);
        h.text(20, &format!("{}Z", &created[..19])).text(40, "");
        let [version, date, namespace] = self.product.schema();
        let standard = format!(
            "{} Volume 1 Design & Implementation Description Document",
            self.product.title()
        );
        h.text(60, &standard);
        h.text(10, version).text(20, date).text(120, namespace);
        let outline = [0, 1, 2, 3, 0].map(|k| {
            let at = &self.outline[k];
            format!("{:+012.8}{:+013.8}", at.latitude_deg, at.longitude_deg)
        });
        h.text(125, &outline.concat());
        h.text(25, "").text(20, "").text(120, "").text(200, "");
        assert_eq!(h.0.len() as u64, XML_HEADER, "the header of the XML");
        h.0.into_bytes()
    }
}

/// `ddmmssXdddmmssY`.
fn arc_seconds(place: &Geodetic) -> String {
    let part = |degrees: f64, width: usize, signs: [char; 2]| {
        let seconds = (degrees.abs() * 3600.0).round() as u64;
        let sign = signs[usize::from(degrees < 0.0)];
        let (degrees, minutes) = (seconds / 3600, seconds / 60 % 60);
        format!("{degrees:0width$}{minutes:02}{:02}{sign}", seconds % 60)
    };
    part(place.latitude_deg, 2, ['N', 'S']) + &part(place.longitude_deg, 3, ['E', 'W'])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Example of volume 2, 3.2.1, and its limits: 10 000 columns of 8 bytes give 124 999 rows in 9 999 999 998 bytes; the row offset of five digits limits them to 99 999.
    #[test]
    fn large_image_is_divided_into_segments() {
        assert_eq!(
            segments(3, 5, 8, MAX_BYTES),
            Some(vec![Segment { first: 0, rows: 3 }])
        );
        let all = segments(250_000, 10_000, 8, MAX_BYTES).unwrap();
        let rows: Vec<[u64; 2]> = all.iter().map(|s| [s.first, s.rows]).collect();
        assert_eq!(rows, [[0, 99_999], [99_999, 99_999], [199_998, 50_002]]);
        let wide = segments(20_000, 100_000, 8, MAX_BYTES).unwrap();
        assert_eq!(wide[0].rows, 12_499);
        assert_eq!(wide.iter().map(|s| s.rows).sum::<u64>(), 20_000);
        assert_eq!(segments(10, 2_000_000_000, 8, MAX_BYTES), None);
        assert_eq!(segments(u64::MAX, 2, 8, MAX_BYTES), None);
    }

    #[test]
    fn corner_is_formatted_in_degrees_minutes_and_seconds() {
        let place = Geodetic {
            latitude_deg: -5.0 - 59.0 / 60.0 - 59.6 / 3600.0,
            longitude_deg: 7.5,
            height_m: 0.0,
        };
        assert_eq!(arc_seconds(&place), "060000S0073000E");
    }
}
