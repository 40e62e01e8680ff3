//! Antenna patterns as gain polynomials, in hand-written XML.

use glam::DVec3;
use subaperture::io::cphd::Cphd;
use subaperture::phase_history::{BeamSource, NoBeam, PhaseHistory, ReadError};

use super::by_hand::{ByHand, POSITION, RECORD_WORDS, VECTORS, assemble, cf8};
use num_complex::Complex32;

/// Antenna elements in Earth-centred coordinates; the track of [`ByHand`] goes along ECF y.
struct Hand {
    /// Electrical boresight, direction cosines along X (ECF y) and Y (ECF z).
    boresight: [&'static str; 2],
    /// Terms of the gain of the transmitter: exponent of DCX, exponent of DCY, coefficient.
    array: &'static [(u32, u32, f64)],
    element: &'static [(u32, u32, f64)],
    receiver: &'static [(u32, u32, f64)],
    freq_zero: &'static str,
    switches: &'static str,
    acf: &'static str,
    eb: &'static str,
    /// Angle of the boresight forward of ECF x and its direction cosine along X, at each vector.
    vectors: Option<[[f64; 2]; VECTORS]>,
}

/// Half power at a direction cosine of 0.05: 10 log10(2) / 0.05^2.
const GAIN: f64 = -3.010_299_956_639_812 / 0.0025;

const PLAIN: Hand = Hand {
    boresight: ["0", "0"],
    array: &[(2, 0, GAIN)],
    element: &[(0, 0, 0.0)],
    receiver: &[(2, 0, GAIN)],
    freq_zero: "9.0015e9",
    switches: "",
    acf: "",
    eb: "",
    vectors: None,
};

/// Parameters of the antennas at a vector: X axis, Y axis and boresight of both, 16 words after those of [`ByHand`].
const ANTENNA_FIELDS: [(&str, [(&str, usize); 3]); 2] = [
    ("TxAntenna", [("TxACX", 0), ("TxACY", 3), ("TxEB", 6)]),
    ("RcvAntenna", [("RcvACX", 8), ("RcvACY", 11), ("RcvEB", 14)]),
];

/// XML elements that state the places of [`ANTENNA_FIELDS`] in a record.
fn antenna_fields() -> String {
    let field = |(name, word): (&str, usize)| {
        let (size, format) = match name.ends_with("EB") {
            true => (2, "DCX=F8;DCY=F8;"),
            false => (3, POSITION),
        };
        let offset = RECORD_WORDS + word;
        format!(
            "<{name}><Offset>{offset}</Offset><Size>{size}</Size><Format>{format}</Format></{name}>"
        )
    };
    let antenna = |(name, fields): (&str, [(&str, usize); 3])| {
        format!("<{name}>{}</{name}>", fields.map(field).concat())
    };
    ANTENNA_FIELDS.map(antenna).concat()
}

impl Hand {
    fn open(&self) -> Result<Cphd, ReadError> {
        let surface = |name: &str, terms: &[(u32, u32, f64)]| {
            let terms: String = terms
                .iter()
                .map(|(m, n, c)| format!("<Coef exponent1=\"{m}\" exponent2=\"{n}\">{c:e}</Coef>"))
                .collect();
            format!("<{name} order1=\"9\" order2=\"9\">{terms}</{name}>")
        };
        let line = |name: &str, value: &str| {
            format!("<{name} order1=\"0\"><Coef exponent1=\"0\">{value}</Coef></{name}>")
        };
        // X along ECF y, Y along ECF z, and so Z along ECF x.
        let axis = |name: &str, [x, y, z]: [&str; 3]| {
            let parts = line("X", x) + &line("Y", y) + &line("Z", z);
            format!("<{name}>{parts}</{name}>")
        };
        let pattern = |id: &str, array: &[(u32, u32, f64)], element: &[(u32, u32, f64)]| {
            let gain = |name: &str, terms: &[(u32, u32, f64)]| {
                let both = surface("GainPoly", terms) + &surface("PhasePoly", &[(0, 0, 0.0)]);
                format!("<{name}>{both}</{name}>")
            };
            format!(
                "<AntPattern><Identifier>{id}</Identifier><FreqZero>{}</FreqZero>{}<EB>{}{}{}</EB>{}{}</AntPattern>",
                self.freq_zero,
                self.switches,
                line("DCXPoly", self.boresight[0]),
                line("DCYPoly", self.boresight[1]),
                self.eb,
                gain("Array", array),
                gain("Element", element)
            )
        };
        let antenna = format!(
            "<Antenna><NumACFs>1</NumACFs><NumAPCs>1</NumAPCs><NumAntPats>2</NumAntPats>\
             <AntCoordFrame><Identifier>frame</Identifier>{}{}{}</AntCoordFrame>\
             <AntPhaseCenter><Identifier>centre</Identifier><ACFId>frame</ACFId></AntPhaseCenter>{}{}</Antenna>",
            axis("XAxisPoly", ["0", "1", "0"]),
            axis("YAxisPoly", ["0", "0", "1"]),
            self.acf,
            pattern("sent", self.array, self.element),
            pattern("received", self.receiver, &[(0, 0, 0.0)])
        );
        let parameters = "<RefChId>only</RefChId><Parameters><Identifier>only</Identifier><FxC>9.0015e9</FxC>\
             <Antenna><TxAPCId>centre</TxAPCId><TxAPATId>sent</TxAPATId>\
             <RcvAPCId>centre</RcvAPCId><RcvAPATId>received</RcvAPATId></Antenna></Parameters>";
        let hand = ByHand::new("CF8", cf8(&[Complex32::ONE; 12]));
        let xml = hand.xml().replace("<RefChId>only</RefChId>", parameters);
        let xml = xml.replace("<PVP>", &format!("{antenna}<PVP>"));
        assert!(xml.contains(POSITION) && xml.contains("TxAPATId"));
        let (xml, pvp) = match self.vectors {
            None => (xml, hand.pvp()),
            Some(vectors) => {
                let bytes = |words: usize| format!("<NumBytesPVP>{}</NumBytesPVP>", 8 * words);
                let xml = xml.replace(&bytes(RECORD_WORDS), &bytes(RECORD_WORDS + 16));
                let records = hand.pvp();
                let mut pvp = Vec::new();
                for (record, [angle, cosine]) in records.chunks_exact(8 * RECORD_WORDS).zip(vectors)
                {
                    pvp.extend_from_slice(record);
                    // Z = X x Y = (cos, sin, 0): forward along ECF y.
                    let axes = [-angle.sin(), angle.cos(), 0.0, 0.0, 0.0, 1.0, cosine, 0.0];
                    for word in axes.iter().chain(&axes) {
                        pvp.extend_from_slice(&word.to_be_bytes());
                    }
                }
                (xml.replace("</PVP>", &(antenna_fields() + "</PVP>")), pvp)
            }
        };
        let bytes = assemble(hand.version, &xml, &pvp, &hand.signal);
        super::by_hand::open_bytes(&bytes)
    }

    /// Width and squint, radians.
    fn beam(&self) -> [f64; 2] {
        let cphd = self.open().unwrap();
        assert!(cphd.warnings().is_empty(), "{:?}", cphd.warnings());
        let beam = cphd.beam().unwrap();
        assert_eq!(beam.source, BeamSource::Stated);
        [beam.width_rad, beam.squint_rad]
    }
}

fn assert_beam(found: [f64; 2], expected: [f64; 2]) {
    // Edges are bisected to 1e-9 of a step of 5 % of the angle.
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() < 1e-8, "{found} {expected}");
    }
}

#[test]
fn gain_polynomials_give_width_and_squint() {
    let half = 0.05f64.asin();
    assert_beam(PLAIN.beam(), [2.0 * half, 0.0]);
    // An isotropic receiver does not narrow the beam: that of the transmitter alone is wider by the square root of two.
    let one = Hand {
        receiver: &[(0, 0, 3.0)],
        ..PLAIN
    };
    assert_beam(one.beam(), [2.0 * half * 2f64.sqrt(), 0.0]);
    // Steered forward by 0.2, the lobe keeps its width in direction cosines. The cut goes through the boresight.
    let steered = Hand {
        boresight: ["0.2", "0"],
        ..PLAIN
    };
    let [back, forward] = [0.15f64.asin(), 0.25f64.asin()];
    assert_beam(steered.beam(), [forward - back, 0.5 * (back + forward)]);
    // The element pattern is a function of direction cosines, not of offsets from the boresight; gains in dB add.
    let element = Hand {
        boresight: ["0.2", "0"],
        array: &[(0, 0, 0.0)],
        element: &[(2, 0, GAIN)],
        receiver: &[(0, 0, 0.0)],
        ..PLAIN
    };
    let [width, squint] = element.beam();
    assert!((width - 2.0 * half * 2f64.sqrt()).abs() < 1e-6, "{width}");
    assert!(squint.abs() < 1e-6, "{squint}");
}

#[test]
fn frequency_scales_boresight_and_lobe() {
    // At twice the frequency of the pattern, boresight and lobe width are half as large.
    let scaled = Hand {
        boresight: ["0.2", "0"],
        freq_zero: "4.50075e9",
        switches: "<EBFreqShift>true</EBFreqShift><MLFreqDilation>true</MLFreqDilation>",
        ..PLAIN
    };
    let [back, forward] = [0.075f64.asin(), 0.125f64.asin()];
    assert_beam(scaled.beam(), [forward - back, 0.5 * (back + forward)]);
    let not_scaled = Hand {
        switches: "<EBFreqShift>false</EBFreqShift><EBFreqShiftSF><DCXSF>1</DCXSF><DCYSF>1</DCYSF></EBFreqShiftSF>",
        ..scaled
    };
    let [back, forward] = [0.15f64.asin(), 0.25f64.asin()];
    assert_beam(not_scaled.beam(), [forward - back, 0.5 * (back + forward)]);
}

#[test]
fn pattern_without_lobe_gives_no_beam_and_faults_are_named() {
    let flat = Hand {
        array: &[(2, 0, 1.0)],
        receiver: &[(0, 0, 0.0)],
        ..PLAIN
    };
    assert_eq!(flat.open().unwrap().beam(), None);
    for (hand, named) in [
        (
            Hand {
                acf: "<UseACFPVP>true</UseACFPVP>",
                ..PLAIN
            },
            "UseACFPVP",
        ),
        (
            Hand {
                freq_zero: "0",
                ..PLAIN
            },
            "FreqZero",
        ),
        (
            Hand {
                array: &[(65, 0, 1.0)],
                ..PLAIN
            },
            "exponent1 from 0 to 64",
        ),
        (
            Hand {
                boresight: ["much", "0"],
                ..PLAIN
            },
            "DCXPoly",
        ),
    ] {
        let cphd = hand.open().unwrap();
        assert_eq!(cphd.beam(), None);
        let warnings = cphd.warnings();
        assert!(
            warnings.len() == 1
                && warnings[0].contains("channel only: its antenna patterns are not used")
                && warnings[0].contains(named),
            "{warnings:?}"
        );
    }
    // A boresight beyond the unit circle.
    let beyond = Hand {
        boresight: ["0.9", "0.9"],
        ..PLAIN
    };
    let beyond = beyond.open().unwrap();
    assert_eq!(beyond.beam(), None);
    assert_eq!(beyond.stated_beam(), Err(NoBeam::NoAttitude));
}

#[test]
fn axes_and_boresights_per_vector_give_the_beam() {
    let half = 0.05f64.asin();
    // The polynomials of the axes point at a right angle to the track; the vectors do not.
    let axes = Hand {
        acf: "<UseACFPVP>true</UseACFPVP>",
        vectors: Some([[0.2, 0.7]; VECTORS]),
        ..PLAIN
    };
    assert_beam(axes.beam(), [2.0 * half, 0.2]);
    let boresights = Hand {
        eb: "<UseEBPVP>true</UseEBPVP>",
        vectors: Some([[0.7, 0.2]; VECTORS]),
        ..PLAIN
    };
    let [back, forward] = [0.15f64.asin(), 0.25f64.asin()];
    assert_beam(boresights.beam(), [forward - back, 0.5 * (back + forward)]);
    // Antennas that turn are followed.
    let angles = [-0.3, 0.1, 0.4];
    let turning = Hand {
        vectors: Some(angles.map(|angle| [angle, 0.0])),
        ..axes
    };
    let cphd = turning.open().unwrap();
    let beam = cphd.stated_beam().unwrap().unwrap();
    assert!((beam.width_rad - 2.0 * half).abs() < 1e-8);
    let times_s = cphd.collection().pulses.iter().map(|pulse| pulse.time_s);
    let squints = beam.squints_rad(&times_s.collect::<Vec<_>>(), &[DVec3::X; VECTORS]);
    for (squint, angle) in squints.iter().zip(angles) {
        assert!((squint - angle).abs() < 1e-9, "{squints:?}");
    }
    // Axes that are not numbers at one vector leave the pointing unknown there.
    let unknown = Hand {
        vectors: Some([[0.2, 0.0], [f64::NAN, 0.0], [0.2, 0.0]]),
        ..turning
    };
    assert_eq!(
        unknown.open().unwrap().stated_beam(),
        Err(NoBeam::NoAttitude)
    );
}
