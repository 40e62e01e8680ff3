//! SIDD XML, in the order of the schema.

use glam::DVec3;

use subaperture_io::ours::NITF_MARK;
use subaperture_io::xml::Writer;
use subaperture_model::PROGRAM;

use super::Greys;
use super::angles::Angles;
use crate::dates::iso;
use crate::describe::{corners, polarizations, valid_data};
use crate::formed::Formed;
use crate::laid::Laid;
use crate::nitf::SIDD_NAMESPACE;

/// XML namespaces of types shared with SICD, and of classification.
const OTHERS: &str = "xmlns:sicommon=\"urn:SICommon:1.0\" xmlns:ism=\"urn:us:gov:ic:ism:13\"";

/// Element names of latitude and longitude.
const SHARED: [&str; 2] = ["sicommon:Lat", "sicommon:Lon"];

pub(super) fn document(formed: &Formed, laid: &Laid, greys: &Greys, created_ns: i64) -> String {
    let mut w = Writer::new();
    w.element(
        "SIDD",
        &format!("xmlns=\"{SIDD_NAMESPACE}\" {OTHERS}"),
        |w| {
            creation(w, formed, created_ns);
            display(w, greys);
            geography(w, laid);
            measurement(w, laid);
            exploitation(w, formed, laid);
            processing(w, formed, laid, greys);
        },
    );
    w.finish()
}

fn creation(w: &mut Writer, formed: &Formed, created_ns: i64) {
    let created = iso(created_ns);
    w.element("ProductCreation", "", |w| {
        w.element("ProcessorInformation", "", |w| {
            w.text("Application", PROGRAM);
            w.text("ProcessingDateTime", &created);
            w.text("Site", "unknown");
        });
        let date = &created[..10];
        let unclassified = format!(
            "ism:DESVersion=\"13\" ism:ISMCATCESVersion=\"201903\" ism:resourceElement=\"true\" ism:createDate=\"{date}\" \
             ism:compliesWith=\"USIC\" ism:classification=\"U\" ism:ownerProducer=\"USA\""
        );
        w.element("Classification", &unclassified, |_| {});
        w.text("ProductName", &formed.name);
        w.text("ProductClass", "Detected image");
    });
}

/// Write `Display`: greys need no further processing.
fn display(w: &mut Writer, greys: &Greys) {
    let filter = |w: &mut Writer, name: &str, operation: &str, kernel: &str| {
        w.element(name, "", |w| {
            w.text("FilterName", kernel);
            w.element("FilterKernel", "", |w| {
                w.element("Predefined", "", |w| w.text("DatabaseName", kernel));
            });
            w.text("Operation", operation);
        });
    };
    w.element("Display", "", |w| {
        w.text("PixelType", "MONO8I");
        w.text("NumBands", 1);
        w.element("NonInteractiveProcessing", "band=\"1\"", |w| {
            w.element("ProductGenerationOptions", "", |w| {
                w.element("DataRemapping", "", |w| {
                    w.text("LUTName", greys.name);
                    w.element("Predefined", "", |w| w.text("DatabaseName", greys.name));
                });
            });
            w.element("RRDS", "", |w| w.text("DownsamplingMethod", "AVERAGE"));
        });
        w.element("InteractiveProcessing", "band=\"1\"", |w| {
            w.element("GeometricTransform", "", |w| {
                w.element("Scaling", "", |w| {
                    filter(w, "AntiAlias", "CONVOLUTION", "BILINEAR");
                    filter(w, "Interpolation", "CORRELATION", "BILINEAR");
                });
                // Rows run away from the radar.
                w.element("Orientation", "", |w| w.text("ShadowDirection", "DOWN"));
            });
            w.element("SharpnessEnhancement", "", |w| {
                filter(
                    w,
                    "ModularTransferFunctionCompensation",
                    "CONVOLUTION",
                    "NEAREST NEIGHBOR",
                );
            });
            w.element("DynamicRangeAdjustment", "", |w| {
                w.text("AlgorithmType", "NONE");
                w.text("BandStatsSource", 1);
            });
        });
    });
}

fn geography(w: &mut Writer, laid: &Laid) {
    w.element("GeoData", "", |w| {
        w.text("EarthModel", "WGS_84");
        corners(w, &laid.corners, SHARED);
        valid_data(w, &laid.placed, &laid.sensor, SHARED);
    });
}

fn measurement(w: &mut Writer, laid: &Laid) {
    let placed = &laid.placed;
    let row_column = |w: &mut Writer, name: &str, [row, column]: [f64; 2]| {
        w.element(name, "", |w| {
            w.number("sicommon:Row", row);
            w.number("sicommon:Col", column);
        });
    };
    w.element("Measurement", "", |w| {
        w.element("PlaneProjection", "", |w| {
            w.element("ReferencePoint", "", |w| {
                xyz(w, "sicommon:ECEF", placed.scp_ecf_m);
                row_column(w, "sicommon:Point", placed.scp_pixel.map(|n| n as f64));
            });
            row_column(w, "SampleSpacing", placed.layout.spacings_m);
            w.element("TimeCOAPoly", "order1=\"0\" order2=\"0\"", |w| {
                let at = "exponent1=\"0\" exponent2=\"0\"";
                let coa_s = laid.aperture.coa_s;
                w.text_with("sicommon:Coef", at, format_args!("{coa_s:?}"));
            });
            w.element("ProductPlane", "", |w| {
                let [row, column] = directions(laid);
                xyz(w, "RowUnitVector", row);
                xyz(w, "ColUnitVector", column);
            });
        });
        w.element("PixelFootprint", "", |w| {
            w.text("sicommon:Row", placed.size[0]);
            w.text("sicommon:Col", placed.size[1]);
        });
        let path = &laid.aperture.path.coefficients;
        w.element("ARPPoly", "", |w| {
            let part = |w: &mut Writer, name: &str, of: fn(&DVec3) -> f64| {
                let about = format!("order1=\"{}\"", path.len() - 1);
                w.element(name, &about, |w| {
                    for (k, c) in path.iter().enumerate() {
                        let at = format!("exponent1=\"{k}\"");
                        w.text_with("sicommon:Coef", &at, format_args!("{:?}", of(c)));
                    }
                });
            };
            part(w, "sicommon:X", |c| c.x);
            part(w, "sicommon:Y", |c| c.y);
            part(w, "sicommon:Z", |c| c.z);
        });
        let vertices = placed.vertices();
        w.element("ValidData", &format!("size=\"{}\"", vertices.len()), |w| {
            for (n, [row, column]) in vertices.into_iter().enumerate() {
                w.element("Vertex", &format!("index=\"{}\"", n + 1), |w| {
                    w.text("sicommon:Row", row);
                    w.text("sicommon:Col", column);
                });
            }
        });
    });
}

/// Directions of ascending rows and columns, unit vectors, ECF.
fn directions(laid: &Laid) -> [DVec3; 2] {
    let frame = &laid.placed.frame;
    laid.placed
        .layout
        .directions
        .map(|v| frame.direction_to_ecf(v))
}

fn xyz(w: &mut Writer, name: &str, v: DVec3) {
    w.element(name, "", |w| {
        w.numbers(&[
            ("sicommon:X", v.x),
            ("sicommon:Y", v.y),
            ("sicommon:Z", v.z),
        ]);
    });
}

fn exploitation(w: &mut Writer, formed: &Formed, laid: &Laid) {
    let [tx, rx] = polarizations(formed);
    let angles = Angles::new(laid.placed.scp_ecf_m, &laid.seen, directions(laid));
    let mode = |w: &mut Writer| w.text("sicommon:ModeType", "SPOTLIGHT");
    let angle = |w: &mut Writer, name: &str, [angle, magnitude]: [f64; 2]| {
        w.element(name, "", |w| {
            w.number("sicommon:Angle", angle);
            w.number("sicommon:Magnitude", magnitude);
        });
    };
    w.element("ExploitationFeatures", "", |w| {
        w.element("Collection", "identifier=\"1\"", |w| {
            w.element("Information", "", |w| {
                w.text("SensorName", NITF_MARK);
                w.element("RadarMode", "", mode);
                w.text("CollectionDateTime", iso(laid.aperture.start_ns));
                w.number("CollectionDuration", laid.aperture.duration_s);
                w.element("Polarization", "", |w| {
                    w.text("TxPolarization", &tx);
                    w.text("RcvPolarization", &rx);
                });
            });
            w.element("Geometry", "", |w| {
                w.number("Azimuth", angles.azimuth);
                w.number("Slope", angles.slope);
                w.number("Squint", angles.squint);
                // The schema allows no negative grazing angle.
                w.number("Graze", angles.graze.max(0.0));
                w.number("Tilt", angles.tilt);
                w.number("DopplerConeAngle", angles.doppler_cone);
            });
            w.element("Phenomenology", "", |w| {
                angle(w, "Shadow", angles.shadow);
                angle(w, "Layover", angles.layover);
                w.number("MultiPath", angles.multipath);
                w.number("GroundTrack", angles.ground_track);
            });
        });
        w.element("Product", "", |w| {
            let widths = [0, 1].map(|k| laid.spectra[k].width_m);
            w.element("Resolution", "", |w| {
                w.numbers(&[("sicommon:Row", widths[0]), ("sicommon:Col", widths[1])]);
            });
            // Ratio of widths along rows and columns; the principal axes may differ more.
            let [less, more] = [widths[0].min(widths[1]), widths[0].max(widths[1])];
            w.number("Ellipticity", more / less);
            w.element("Polarization", "", |w| {
                w.text("TxPolarizationProc", &tx);
                w.text("RcvPolarizationProc", &rx);
            });
            w.number("North", angles.north);
        });
    });
}

/// Write `ProductProcessing`: processing steps and assumptions.
fn processing(w: &mut Writer, formed: &Formed, laid: &Laid, greys: &Greys) {
    let module = |w: &mut Writer, name: &str, parameters: &[(&str, String)]| {
        w.element("ProcessingModule", "", |w| {
            w.text_with("ModuleName", "name=\"module\"", name);
            for (key, value) in parameters {
                w.text_with("ModuleParameter", &format!("name=\"{key}\""), value);
            }
        });
    };
    w.element("ProductProcessing", "", |w| {
        let [fast, slow] = formed.windows;
        let mut parameters = vec![
            ("former", formed.former.clone()),
            ("window", fast.to_string()),
            ("slow_window", slow.to_string()),
        ];
        let assumed = laid.aperture.assumed.iter();
        parameters.extend(assumed.map(|sentence| ("assumed", sentence.clone())));
        module(w, "image formation", &parameters);
        let [black, white] = greys.levels_db.map(|level| format!("{level:.2}"));
        let levels = [
            ("remap", greys.name.to_owned()),
            ("black_db", black),
            ("white_db", white),
        ];
        module(w, "detection", &levels);
    });
}
