//! A CPHD file assembled byte by byte, independent of the writer under test.

use num_complex::Complex32;
use subaperture::io::cphd::Cphd;
use subaperture::phase_history::ReadError;

use super::scene::read_all;

/// By default one channel of 3 vectors with 4 samples. The PVP record has its own order, a gap before TxPos and padding at the end.
#[derive(Clone)]
pub(crate) struct ByHand {
    pub(crate) version: &'static str,
    pub(crate) domain: &'static str,
    pub(crate) sgn: &'static str,
    pub(crate) format: &'static str,
    pub(crate) surface: String,
    pub(crate) num_vectors: String,
    pub(crate) num_samples: usize,
    /// SC0, SCSS, FX1, FX2.
    pub(crate) axis: [f64; 4],
    pub(crate) amp_sf: Option<[f64; 3]>,
    pub(crate) signal_pvp: Option<[i64; 3]>,
    pub(crate) signal: Vec<u8>,
}

pub(crate) const POSITION: &str = "X=F8;Y=F8;Z=F8;";
pub(crate) const RECORD_WORDS: usize = 20;
pub(crate) const VECTORS: usize = 3;

impl ByHand {
    pub(crate) fn new(format: &'static str, signal: Vec<u8>) -> Self {
        Self {
            version: "1.1.0",
            domain: "FX",
            sgn: "-1",
            format,
            surface: "<Planar><uIAX><X>0</X><Y>1</Y><Z>0</Z></uIAX>\
                      <uIAY><X>0</X><Y>0</Y><Z>1</Z></uIAY></Planar>"
                .to_owned(),
            num_vectors: VECTORS.to_string(),
            num_samples: 4,
            axis: [9e9, 1e6, 9e9, 9.003e9],
            amp_sf: None,
            signal_pvp: None,
            signal,
        }
    }

    pub(crate) fn xml(&self) -> String {
        let mut pvp = String::new();
        let mut field = |name: &str, offset: usize, size: usize, format: &str| {
            pvp += &format!(
                "<{name}><Offset>{offset}</Offset><Size>{size}</Size><Format>{format}</Format>\
                 </{name}>\n"
            );
        };
        field("SC0", 0, 1, "F8");
        field("SCSS", 1, 1, "F8");
        field("TxTime", 2, 1, "F8");
        field("TxPos", 4, 3, POSITION);
        field("RcvPos", 7, 3, POSITION);
        field("SRPPos", 10, 3, POSITION);
        field("FX1", 13, 1, "F8");
        field("FX2", 14, 1, "F8");
        if self.amp_sf.is_some() {
            field("AmpSF", 15, 1, "F8");
        }
        if self.signal_pvp.is_some() {
            field("SIGNAL", 16, 1, "I8");
        }
        format!(
            "<CPHD xmlns=\"http://api.nsgreg.nga.mil/schema/cphd/{}\">\n\
             <Global><DomainType>{}</DomainType><SGN>{}</SGN></Global>\n\
             <SceneCoordinates><IARP><ECF><X>6378137</X><Y>0</Y><Z>0</Z></ECF></IARP>\n\
             <ReferenceSurface>{}</ReferenceSurface>\n\
             <ImageArea><X1Y1><X>-10</X><Y>-20</Y></X1Y1><X2Y2><X>30</X><Y>40</Y></X2Y2>\
             </ImageArea></SceneCoordinates>\n\
             <Data><SignalArrayFormat>{}</SignalArrayFormat><NumBytesPVP>{}</NumBytesPVP>\n\
             <Channel><Identifier>only</Identifier><NumVectors>{}</NumVectors>\
             <NumSamples>{}</NumSamples><SignalArrayByteOffset>0</SignalArrayByteOffset>\
             <PVPArrayByteOffset>0</PVPArrayByteOffset></Channel></Data>\n\
             <Channel><RefChId>only</RefChId></Channel>\n\
             <PVP>{pvp}</PVP>\n</CPHD>",
            self.version,
            self.domain,
            self.sgn,
            self.surface,
            self.format,
            RECORD_WORDS * 8,
            self.num_vectors,
            self.num_samples,
        )
    }

    pub(crate) fn pvp(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        for v in 0..VECTORS {
            // Bytes between the parameters are not valid numbers.
            let mut words = [0x7ff8_dead_beef_0000u64; RECORD_WORDS];
            let mut put = |offset: usize, values: &[f64]| {
                for (i, value) in values.iter().enumerate() {
                    words[offset + i] = value.to_bits();
                }
            };
            let along = 10.0 * v as f64;
            put(0, &self.axis[..2]);
            put(2, &[0.5 + 0.1 * v as f64]);
            put(4, &[6_378_137.0 + 3000.0, along, 4000.0]);
            put(7, &[6_378_137.0 + 12.0, along, 5.0]);
            put(10, &[6_378_137.0, 0.0, 0.0]);
            put(13, &self.axis[2..]);
            if let Some(amp_sf) = self.amp_sf {
                put(15, &[amp_sf[v]]);
            }
            if let Some(signal) = self.signal_pvp {
                words[16] = signal[v] as u64;
            }
            for word in words {
                bytes.extend_from_slice(&word.to_be_bytes());
            }
        }
        bytes
    }

    pub(crate) fn bytes(&self) -> Vec<u8> {
        assemble(self.version, &self.xml(), &self.pvp(), &self.signal)
    }
}

/// Header and blocks, with the XML at byte 512.
pub(crate) fn assemble(version: &str, xml: &str, pvp: &[u8], signal: &[u8]) -> Vec<u8> {
    let pvp_offset = 512 + xml.len() + 2 + 5;
    let signal_offset = pvp_offset + pvp.len() + 3;
    let mut file = format!(
        "CPHD/{version}\nXML_BLOCK_SIZE := {}\nXML_BLOCK_BYTE_OFFSET := 512\n\
         PVP_BLOCK_SIZE := {}\nPVP_BLOCK_BYTE_OFFSET := {pvp_offset}\n\
         SIGNAL_BLOCK_SIZE := {}\nSIGNAL_BLOCK_BYTE_OFFSET := {signal_offset}\n\
         CLASSIFICATION := SECRET NOT\nRELEASE_INFO := ALL\n\x0c\n",
        xml.len(),
        pvp.len(),
        signal.len()
    )
    .into_bytes();
    file.resize(512, 0);
    file.extend_from_slice(xml.as_bytes());
    file.extend_from_slice(b"\x0c\n");
    file.resize(pvp_offset, 0);
    file.extend_from_slice(pvp);
    file.resize(signal_offset, 0);
    file.extend_from_slice(signal);
    file
}

pub(crate) fn open_bytes(bytes: &[u8]) -> Result<Cphd, ReadError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hand.cphd");
    std::fs::write(&path, bytes).unwrap();
    Cphd::open(path, None, u64::MAX)
}

pub(crate) fn assert_refused(bytes: &[u8], part: &str) {
    match open_bytes(bytes).and_then(|cphd| read_all(&cphd).map(|_| ())) {
        Ok(()) => panic!("read in spite of {part}"),
        Err(error) => {
            let text = error.to_string();
            assert!(
                text.contains(part) && text.contains("hand.cphd"),
                "wanted '{part}' in: {text}"
            );
        }
    }
}

pub(crate) fn integers() -> Vec<i16> {
    (0..2 * VECTORS as i16 * 4).map(|i| 5 * i - 61).collect()
}

pub(crate) fn pairs(parts: impl IntoIterator<Item = f32>) -> Vec<Complex32> {
    let parts: Vec<f32> = parts.into_iter().collect();
    parts
        .as_chunks()
        .0
        .iter()
        .map(|&[re, im]| Complex32::new(re, im))
        .collect()
}

pub(crate) fn cf8(samples: &[Complex32]) -> Vec<u8> {
    samples
        .iter()
        .flat_map(|z| [z.re.to_be_bytes(), z.im.to_be_bytes()].concat())
        .collect()
}
