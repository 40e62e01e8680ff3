//! SICD XML, in the order of the schema.

use glam::DVec3;

use subaperture_io::xml::Writer;
use subaperture_model::PROGRAM;
use subaperture_model::geometry::Geodetic;
use subaperture_signal::window::Window;

use crate::aperture::{Aperture, Scpcoa};
use crate::bistatic::Bistatic;
use crate::contour::Sensor;
use crate::dates::iso;
use crate::formed::Formed;
use crate::grid::Placed;
use crate::polynomial::{Path, Surface};
use crate::spectrum::Spectrum;
use crate::version::SicdVersion;

/// Samples of the weighting function (`WgtFunct`).
const WEIGHTS: usize = 512;

/// Content of the XML.
pub(crate) struct Description<'a> {
    pub(crate) version: SicdVersion,
    pub(crate) formed: &'a Formed,
    pub(crate) placed: &'a Placed,
    pub(crate) aperture: &'a Aperture,
    pub(crate) seen: &'a Scpcoa,
    pub(crate) sensor: &'a Sensor,
    pub(crate) bistatic: Option<&'a Bistatic>,
    pub(crate) spectra: &'a [Spectrum; 2],
    /// Image corners on the ground: first row and column, then clockwise.
    pub(crate) corners: &'a [Geodetic; 4],
    pub(crate) created_ns: i64,
}

impl Description<'_> {
    pub(crate) fn document(&self) -> String {
        let mut w = Writer::new();
        let namespace = self.version.namespace();
        w.element("SICD", &format!("xmlns=\"{namespace}\""), |w| {
            self.collection(w);
            self.image(w);
            self.geography(w);
            self.grid(w);
            self.timeline(w);
            self.radar(w);
            self.formation(w);
            self.scpcoa(w);
        });
        w.finish()
    }

    fn collection(&self, w: &mut Writer) {
        w.element("CollectionInfo", "", |w| {
            w.text("CollectorName", "Subaperture");
            let collect_type = match self.bistatic {
                None => "MONOSTATIC",
                Some(_) => {
                    w.text("IlluminatorName", UNKNOWN);
                    "BISTATIC"
                }
            };
            w.text("CoreName", &self.formed.name);
            w.text("CollectType", collect_type);
            w.element("RadarMode", "", |w| w.text("ModeType", "SPOTLIGHT"));
            w.text("Classification", "UNCLASSIFIED");
            for sentence in &self.aperture.assumed {
                w.text_with("Parameter", "name=\"Assumed\"", sentence);
            }
        });
        w.element("ImageCreation", "", |w| {
            w.text("Application", PROGRAM);
            w.text("DateTime", iso(self.created_ns));
        });
    }

    fn image(&self, w: &mut Writer) {
        let [rows, columns] = self.placed.size;
        let pixel = |w: &mut Writer, [row, column]: [usize; 2]| {
            w.text("Row", row);
            w.text("Col", column);
        };
        w.element("ImageData", "", |w| {
            w.text("PixelType", "RE32F_IM32F");
            w.text("NumRows", rows);
            w.text("NumCols", columns);
            w.text("FirstRow", 0);
            w.text("FirstCol", 0);
            w.element("FullImage", "", |w| {
                w.text("NumRows", rows);
                w.text("NumCols", columns);
            });
            w.element("SCPPixel", "", |w| pixel(w, self.placed.scp_pixel));
            let vertices = self.placed.vertices();
            w.element("ValidData", &format!("size=\"{}\"", vertices.len()), |w| {
                for (n, at) in vertices.into_iter().enumerate() {
                    w.element("Vertex", &index(n), |w| pixel(w, at));
                }
            });
        });
    }

    fn geography(&self, w: &mut Writer) {
        let scp = self.placed.scp_ecf_m;
        w.element("GeoData", "", |w| {
            w.text("EarthModel", "WGS_84");
            w.element("SCP", "", |w| {
                w.xyz("ECF", scp);
                let place = Geodetic::from_ecf_m(scp);
                w.element("LLH", "", |w| {
                    latitude_longitude(w, &place, PLAIN);
                    w.number("HAE", place.height_m);
                });
            });
            corners(w, self.corners, PLAIN);
            valid_data(w, self.placed, self.sensor, PLAIN);
        });
    }

    fn grid(&self, w: &mut Writer) {
        w.element("Grid", "", |w| {
            w.text("ImagePlane", self.placed.plane(self.seen));
            w.text("Type", "PLANE");
            w.element("TimeCOAPoly", "order1=\"0\" order2=\"0\"", |w| {
                let at = "exponent1=\"0\" exponent2=\"0\"";
                w.text_with("Coef", at, format_args!("{:?}", self.aperture.coa_s));
            });
            for (name, spectrum) in ["Row", "Col"].into_iter().zip(self.spectra) {
                w.element(name, "", |w| self.direction(w, spectrum));
            }
        });
    }

    fn direction(&self, w: &mut Writer, spectrum: &Spectrum) {
        w.xyz(
            "UVectECF",
            self.placed.frame.direction_to_ecf(spectrum.direction),
        );
        w.number("SS", spectrum.spacing_m);
        w.number("ImpRespWid", spectrum.width_m);
        w.text("Sgn", -1);
        w.numbers(&[
            ("ImpRespBW", spectrum.bandwidth),
            ("KCtr", spectrum.centre),
            ("DeltaK1", spectrum.edges[0]),
            ("DeltaK2", spectrum.edges[1]),
        ]);
        surface(w, "DeltaKCOAPoly", &spectrum.middle);
        let (name, parameter) = match spectrum.window {
            Window::None => ("UNIFORM", None),
            Window::Hamming => ("HAMMING", None),
            Window::Taylor { side_lobe_db } => ("TAYLOR", Some(("SLL", -side_lobe_db))),
            Window::Kaiser { beta } => ("KAISER", Some(("BETA", beta))),
        };
        w.element("WgtType", "", |w| {
            w.text("WindowName", name);
            if let Some((key, value)) = parameter {
                w.text_with("Parameter", &format!("name=\"{key}\""), value);
            }
        });
        if spectrum.window != Window::None {
            w.element("WgtFunct", &format!("size=\"{WEIGHTS}\""), |w| {
                for (n, weight) in spectrum.window.weights(WEIGHTS).into_iter().enumerate() {
                    w.text_with("Wgt", &index(n), format_args!("{weight:?}"));
                }
            });
        }
    }

    fn timeline(&self, w: &mut Writer) {
        w.element("Timeline", "", |w| {
            w.text("CollectStart", iso(self.aperture.start_ns));
            w.number("CollectDuration", self.aperture.duration_s);
        });
        w.element("Position", "", |w| {
            positions(w, "ARPPoly", "", &self.aperture.path);
            if let Some(pair) = &self.aperture.pair {
                positions(w, "GRPPoly", "", &pair.reference);
                positions(w, "TxAPCPoly", "", &pair.transmitter);
                w.element("RcvAPC", "size=\"1\"", |w| {
                    positions(w, "RcvAPCPoly", &index(0), &pair.receiver);
                });
            }
        });
    }

    fn both_polarizations(&self) -> String {
        match polarizations(self.formed) {
            [tx, _] if tx == UNKNOWN => tx,
            [tx, rx] => format!("{tx}:{rx}"),
        }
    }

    fn band_hz(&self) -> [f64; 2] {
        let bands = self.formed.looks.bands_hz.iter();
        bands.fold([f64::INFINITY, 0.0], |[low, high], [a, b]| {
            [low.min(*a), high.max(*b)]
        })
    }

    fn radar(&self, w: &mut Writer) {
        let [tx, _] = polarizations(self.formed);
        let both = self.both_polarizations();
        let [low, high] = self.band_hz();
        w.element("RadarCollection", "", |w| {
            w.element("TxFrequency", "", |w| {
                w.numbers(&[("Min", low), ("Max", high)])
            });
            w.text("TxPolarization", tx);
            w.element("RcvChannels", "size=\"1\"", |w| {
                w.element("ChanParameters", "index=\"1\"", |w| {
                    w.text("TxRcvPolarization", both);
                    if self.bistatic.is_some() {
                        w.text("RcvAPCIndex", 1);
                    }
                });
            });
        });
    }

    fn formation(&self, w: &mut Writer) {
        let both = self.both_polarizations();
        let [low, high] = self.band_hz();
        w.element("ImageFormation", "", |w| {
            w.element("RcvChanProc", "", |w| {
                w.text("NumChanProc", 1);
                w.text("ChanIndex", 1);
            });
            w.text("TxRcvPolarizationProc", both);
            w.numbers(&[("TStartProc", 0.0), ("TEndProc", self.aperture.duration_s)]);
            w.element("TxFrequencyProc", "", |w| {
                w.numbers(&[("MinProc", low), ("MaxProc", high)]);
            });
            w.text("ImageFormAlgo", "OTHER");
            for not_done in ["STBeamComp", "ImageBeamComp", "AzAutofocus", "RgAutofocus"] {
                w.text(not_done, "NO");
            }
            w.element("Processing", "", |w| {
                w.text("Type", format!("Image formation by {}", self.formed.former));
                w.text("Applied", true);
                let [fast, slow] = self.formed.windows;
                w.text_with("Parameter", "name=\"window\"", fast);
                w.text_with("Parameter", "name=\"slow_window\"", slow);
            });
        });
    }

    fn scpcoa(&self, w: &mut Writer) {
        let seen = self.seen;
        w.element("SCPCOA", "", |w| {
            w.number("SCPTime", self.aperture.coa_s);
            w.xyz("ARPPos", seen.place);
            w.xyz("ARPVel", seen.velocity);
            w.xyz("ARPAcc", seen.acceleration);
            seen.write_sides(w);
            w.numbers(&[
                ("TwistAng", seen.twist),
                ("SlopeAng", seen.slope),
                ("AzimAng", seen.azimuth),
                ("LayoverAng", seen.layover),
            ]);
            if let Some(bistatic) = self.bistatic {
                bistatic.write(w);
            }
        });
    }
}

/// Element names of latitude and longitude.
const PLAIN: [&str; 2] = ["Lat", "Lon"];

/// Value of an unknown polarisation or name.
const UNKNOWN: &str = "UNKNOWN";

/// Transmit and receive polarisation; both `UNKNOWN` unless both are known.
pub(crate) fn polarizations(formed: &Formed) -> [String; 2] {
    let known = |name: &Option<String>| {
        let name = name.as_deref()?;
        let listed = ["V", "H", "X", "Y", "S", "E", "RHC", "LHC"].contains(&name);
        listed.then(|| name.to_owned())
    };
    match [0, 1].map(|k| known(&formed.polarizations[k])) {
        [Some(tx), Some(rx)] => [tx, rx],
        _ => [UNKNOWN, UNKNOWN].map(str::to_owned),
    }
}

/// Write `ImageCorners`: first row and column, then clockwise.
pub(crate) fn corners(w: &mut Writer, corners: &[Geodetic; 4], names: [&str; 2]) {
    w.element("ImageCorners", "", |w| {
        let indices = ["1:FRFC", "2:FRLC", "3:LRLC", "4:LRFC"];
        for (name, corner) in indices.into_iter().zip(corners) {
            w.element("ICP", &format!("index=\"{name}\""), |w| {
                latitude_longitude(w, corner, names);
            });
        }
    });
}

/// Write `ValidData`: the image outline on the ground.
pub(crate) fn valid_data(w: &mut Writer, placed: &Placed, sensor: &Sensor, names: [&str; 2]) {
    let vertices = placed.vertices();
    w.element("ValidData", &format!("size=\"{}\"", vertices.len()), |w| {
        for (n, at) in vertices.into_iter().enumerate() {
            let place = placed.on_ground(at, sensor);
            w.element("Vertex", &index(n), |w| {
                latitude_longitude(w, &place, names)
            });
        }
    });
}

/// `index` attribute, counted from 1.
fn index(n: usize) -> String {
    format!("index=\"{}\"", n + 1)
}

fn latitude_longitude(w: &mut Writer, place: &Geodetic, [latitude, longitude]: [&str; 2]) {
    w.numbers(&[
        (latitude, place.latitude_deg),
        (longitude, place.longitude_deg),
    ]);
}

fn surface(w: &mut Writer, name: &str, surface: &Surface) {
    w.element(name, "order1=\"3\" order2=\"3\"", |w| {
        for (i, row) in surface.coefficients.iter().enumerate() {
            for (j, c) in row.iter().enumerate() {
                let at = format!("exponent1=\"{i}\" exponent2=\"{j}\"");
                w.text_with("Coef", &at, format_args!("{c:?}"));
            }
        }
    });
}

/// Write a polynomial of positions over time.
fn positions(w: &mut Writer, name: &str, attributes: &str, path: &Path) {
    let path = &path.coefficients;
    w.element(name, attributes, |w| {
        let part = |w: &mut Writer, name: &str, of: fn(&DVec3) -> f64| {
            let order = format!("order1=\"{}\"", path.len() - 1);
            w.element(name, &order, |w| {
                for (k, c) in path.iter().enumerate() {
                    let at = format!("exponent1=\"{k}\"");
                    w.text_with("Coef", &at, format_args!("{:?}", of(c)));
                }
            });
        };
        part(w, "X", |c| c.x);
        part(w, "Y", |c| c.y);
        part(w, "Z", |c| c.z);
    });
}
