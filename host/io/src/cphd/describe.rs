//! The XML block of a file to be written, in the order of the schema.

use glam::DVec3;

use super::antenna_write;
use super::entry::Entry;
use super::image_area::ImageAreaCoordinates;
use super::pvp::{self, record_bytes};
use super::reference_geometry;
use super::write_options::{WriteError, WriteOptions};
use crate::xml::Writer;
use subaperture_model::geometry::{Extent, Geodetic, SceneFrame};
use subaperture_model::{PROGRAM, SPEED_OF_LIGHT_M_S};

const NAMESPACE: &str = "xmlns=\"http://api.nsgreg.nga.mil/schema/cphd/1.1.0\"";

/// The whole document. `entries` is not empty; the first is the reference channel.
///
/// # Errors
/// [`WriteError::Unsuited`] of a reference surface that the frame does not have.
pub(super) fn document(entries: &[Entry], options: &WriteOptions) -> Result<String, WriteError> {
    let reference = &entries[0];
    let frame = reference.channel.history.collection().frame;
    let coordinates = ImageAreaCoordinates::new(frame, options.surface)?;
    let mut w = Writer::new();
    w.element("CPHD", NAMESPACE, |w| {
        collection_id(w, entries, options);
        global(w, entries, options);
        scene_coordinates(
            w,
            &frame,
            &coordinates,
            union_of_extents(entries),
            grid_spacing_m(entries),
        );
        data(w, entries);
        channels(w, entries);
        pvp::describe(w, entries[0].prepared.with_truth());
        dwell(w, entries);
        let prepared = &reference.prepared;
        let vector = &prepared.records[prepared.reference];
        let srp_iac = coordinates.of(vector.srp_pos);
        reference_geometry::describe(w, vector, prepared.bistatic, srp_iac, prepared.dwell());
        antenna_write::describe(w, entries);
        // Marks the file as replaceable by later runs of this program.
        w.element("ProductInfo", "", |w| {
            w.text_with("Parameter", "name=\"Program\"", PROGRAM);
        });
    });
    Ok(w.finish())
}

fn collection_id(w: &mut Writer, entries: &[Entry], options: &WriteOptions) {
    let collection = entries[0].channel.history.collection();
    let spotlight = entries.iter().all(|e| e.prepared.spotlight);
    w.element("CollectionID", "", |w| {
        w.text("CollectorName", &options.collector_name);
        let core_name = options.core_name.as_ref().unwrap_or(&collection.name);
        w.text("CoreName", core_name);
        let bistatic = entries[0].prepared.bistatic;
        w.text(
            "CollectType",
            if bistatic { "BISTATIC" } else { "MONOSTATIC" },
        );
        w.element("RadarMode", "", |w| {
            w.text("ModeType", if spotlight { "SPOTLIGHT" } else { "STRIPMAP" });
            if let Some(mode_id) = &options.mode_id {
                w.text("ModeID", mode_id);
            }
        });
        w.text("Classification", &options.classification);
        w.text("ReleaseInfo", &options.release_info);
    });
}

/// Minimum and maximum of a parameter over all channels.
fn range(entries: &[Entry], parameter: fn(&pvp::Record) -> f64) -> (f64, f64) {
    let ranges = entries.iter().map(|e| e.prepared.range(parameter));
    ranges
        .reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
        .unwrap_or_default()
}

fn global(w: &mut Writer, entries: &[Entry], options: &WriteOptions) {
    let (tx_time1, tx_time2) = range(entries, |r| r.tx_time);
    w.element("Global", "", |w| {
        w.text("DomainType", options.domain);
        w.text("SGN", options.sgn);
        w.element("Timeline", "", |w| {
            w.text("CollectionStart", &options.collection_start);
            w.numbers(&[("TxTime1", tx_time1), ("TxTime2", tx_time2)]);
        });
        w.element("FxBand", "", |w| {
            let (low, high) = (range(entries, |r| r.fx1).0, range(entries, |r| r.fx2).1);
            w.numbers(&[("FxMin", low), ("FxMax", high)]);
        });
        w.element("TOASwath", "", |w| {
            let (low, high) = (range(entries, |r| r.toa1).0, range(entries, |r| r.toa2).1);
            w.numbers(&[("TOAMin", low), ("TOAMax", high)]);
        });
    });
}

fn union_of_extents(entries: &[Entry]) -> Extent {
    let join = |a: (f64, f64), b: (f64, f64)| (a.0.min(b.0), a.1.max(b.1));
    entries
        .iter()
        .map(|e| e.prepared.extent)
        .reduce(|a, b| Extent {
            x_m: join(a.x_m, b.x_m),
            y_m: join(a.y_m, b.y_m),
        })
        .expect("there is a channel")
}

fn image_area(w: &mut Writer, extent: &Extent) {
    let ((x1, x2), (y1, y2)) = (extent.x_m, extent.y_m);
    w.element("ImageArea", "", |w| {
        w.element("X1Y1", "", |w| w.numbers(&[("X", x1), ("Y", y1)]));
        w.element("X2Y2", "", |w| w.numbers(&[("X", x2), ("Y", y2)]));
    });
}

fn scene_coordinates(
    w: &mut Writer,
    frame: &SceneFrame,
    coordinates: &ImageAreaCoordinates,
    extent: Extent,
    spacing_m: f64,
) {
    w.element("SceneCoordinates", "", |w| {
        w.text("EarthModel", "WGS_84");
        coordinates.describe(w);
        image_area(w, &extent);
        w.element("ImageAreaCornerPoints", "", |w| {
            for (index, corner) in corner_points(frame, coordinates, &extent)
                .iter()
                .enumerate()
            {
                w.element("IACP", &format!("index=\"{}\"", index + 1), |w| {
                    w.numbers(&[("Lat", corner.latitude_deg), ("Lon", corner.longitude_deg)]);
                });
            }
        });
        image_grid(w, &extent, spacing_m);
    });
}

/// Range resolution of the widest channel.
fn grid_spacing_m(entries: &[Entry]) -> f64 {
    let widths = entries
        .iter()
        .map(|e| e.prepared.range(|r| r.fx2).1 - e.prepared.range(|r| r.fx1).0);
    SPEED_OF_LIGHT_M_S / (2.0 * widths.fold(0.0, f64::max))
}

/// A grid for the image area, lines along x: a proposal to processors, at most 1e6 lines and samples.
fn image_grid(w: &mut Writer, extent: &Extent, spacing_m: f64) {
    let axis = |(low, high): (f64, f64)| {
        let spacing = spacing_m.max((high - low) / 1e6);
        let count = ((high - low) / spacing).ceil().max(1.0) as u64;
        // Line i covers i - 1/2 to i + 1/2 spacings from the IARP's line, and line 0 begins at `low`.
        (spacing, count, -low / spacing - 0.5)
    };
    let (line_spacing, num_lines, line) = axis(extent.x_m);
    let (sample_spacing, num_samples, sample) = axis(extent.y_m);
    w.element("ImageGrid", "", |w| {
        w.element("IARPLocation", "", |w| {
            w.numbers(&[("Line", line), ("Sample", sample)]);
        });
        w.element("IAXExtent", "", |w| {
            w.number("LineSpacing", line_spacing);
            w.text("FirstLine", 0);
            w.text("NumLines", num_lines);
        });
        w.element("IAYExtent", "", |w| {
            w.number("SampleSpacing", sample_spacing);
            w.text("FirstSample", 0);
            w.text("NumSamples", num_samples);
        });
    });
}

/// The corners clockwise as seen from above: by X1Y1, X1Y2, X2Y2, X2Y1 if z points up.
fn corner_points(
    frame: &SceneFrame,
    coordinates: &ImageAreaCoordinates,
    extent: &Extent,
) -> [Geodetic; 4] {
    let ((x1, x2), (y1, y2)) = (extent.x_m, extent.y_m);
    let corner = |x, y| coordinates.place(x, y);
    let up = frame.to_ecf_m(DVec3::ZERO);
    let turned = frame.direction_to_ecf(DVec3::Z).dot(up) < 0.0;
    let (second, fourth) = (corner(x1, y2), corner(x2, y1));
    if turned {
        [corner(x1, y1), fourth, corner(x2, y2), second]
    } else {
        [corner(x1, y1), second, corner(x2, y2), fourth]
    }
}

fn data(w: &mut Writer, entries: &[Entry]) {
    w.element("Data", "", |w| {
        w.text("SignalArrayFormat", "CF8");
        w.text(
            "NumBytesPVP",
            record_bytes(entries[0].prepared.with_truth()),
        );
        w.text("NumCPHDChannels", entries.len());
        for entry in entries {
            w.element("Channel", "", |w| {
                w.text("Identifier", &entry.channel.id);
                w.text("NumVectors", entry.prepared.records.len());
                w.text("NumSamples", entry.prepared.stored_samples);
                w.text("SignalArrayByteOffset", entry.signal_offset);
                w.text("PVPArrayByteOffset", entry.pvp_offset);
            });
        }
        w.text("NumSupportArrays", 0);
    });
}

fn channels(w: &mut Writer, entries: &[Entry]) {
    let one_value = |range: (f64, f64)| range.0 == range.1;
    let all = |parameter: fn(&pvp::Record) -> f64| one_value(range(entries, parameter));
    let first_srp = entries[0].prepared.records[0].srp_pos;
    let srp_fixed = entries
        .iter()
        .all(|e| e.prepared.srp_fixed() && e.prepared.records[0].srp_pos == first_srp);
    w.element("Channel", "", |w| {
        w.text("RefChId", &entries[0].channel.id);
        w.text("FXFixedCPHD", all(|r| r.fx1) && all(|r| r.fx2));
        w.text("TOAFixedCPHD", all(|r| r.toa1) && all(|r| r.toa2));
        w.text("SRPFixedCPHD", srp_fixed);
        for entry in entries {
            let p = &entry.prepared;
            let (fx1, fx2) = (p.range(|r| r.fx1), p.range(|r| r.fx2));
            let (toa1, toa2) = (p.range(|r| r.toa1), p.range(|r| r.toa2));
            w.element("Parameters", "", |w| {
                w.text("Identifier", &entry.channel.id);
                w.text("RefVectorIndex", p.reference);
                w.text("FXFixed", one_value(fx1) && one_value(fx2));
                w.text("TOAFixed", one_value(toa1) && one_value(toa2));
                w.text("SRPFixed", p.srp_fixed());
                w.text("SignalNormal", true);
                w.element("Polarization", "", |w| {
                    w.text("TxPol", entry.channel.tx_polarization);
                    w.text("RcvPol", entry.channel.rcv_polarization);
                });
                w.numbers(&[
                    ("FxC", 0.5 * (fx1.0 + fx2.1)),
                    ("FxBW", fx2.1 - fx1.0),
                    ("TOASaved", toa2.1 - toa1.0),
                ]);
                w.element("DwellTimes", "", |w| {
                    w.text("CODId", &entry.channel.id);
                    w.text("DwellId", &entry.channel.id);
                });
                image_area(w, &p.extent);
                antenna_write::refer(w, entry);
            });
        }
    });
}

/// Centre and length of dwell, the same for all of the image area.
fn dwell(w: &mut Writer, entries: &[Entry]) {
    let constant = |w: &mut Writer, name: &str, value: f64| {
        w.element(name, "order1=\"0\" order2=\"0\"", |w| {
            let attributes = "exponent1=\"0\" exponent2=\"0\"";
            w.text_with("Coef", attributes, format_args!("{value:?}"));
        });
    };
    w.element("Dwell", "", |w| {
        w.text("NumCODTimes", entries.len());
        for entry in entries {
            w.element("CODTime", "", |w| {
                w.text("Identifier", &entry.channel.id);
                constant(w, "CODTimePoly", entry.prepared.dwell().0);
            });
        }
        w.text("NumDwellTimes", entries.len());
        for entry in entries {
            w.element("DwellTime", "", |w| {
                w.text("Identifier", &entry.channel.id);
                constant(w, "DwellTimePoly", entry.prepared.dwell().1);
            });
        }
    });
}
