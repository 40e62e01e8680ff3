//! Files made to need time or memory out of proportion to their length, and impossible numbers.

use std::fs;
use std::path::Path;

use num_complex::Complex32;
use serde_json::{Value, json};
use subaperture::image::Image;
use subaperture::io::cphd::CphdInfo;
use subaperture::io::product::{self, Product};
use subaperture::simulate::scenario::Scenario;
use subaperture_xtask::processor::{self, Of};

/// Limit of processor time for a file of some megabytes, seconds. A quadratic algorithm would take minutes.
const LIMIT_S: f64 = 2.0;

/// A CPHD document with these parts.
fn cphd_xml(attributes: &str, data: &str, parameters: &str, rest: &str) -> String {
    format!(
        "<CPHD xmlns=\"http://api.nsgreg.nga.mil/schema/cphd/1.1.0\"{attributes}>\
         <Global><DomainType>FX</DomainType><SGN>-1</SGN></Global>\
         <SceneCoordinates><IARP><ECF><X>6378137</X><Y>0</Y><Z>0</Z></ECF></IARP>\
         <ReferenceSurface><Planar><uIAX><X>0</X><Y>1</Y><Z>0</Z></uIAX>\
         <uIAY><X>0</X><Y>0</Y><Z>1</Z></uIAY></Planar></ReferenceSurface>\
         <ImageArea><X1Y1><X>-10</X><Y>-20</Y></X1Y1><X2Y2><X>30</X><Y>40</Y></X2Y2></ImageArea></SceneCoordinates>\
         <Data><SignalArrayFormat>CF8</SignalArrayFormat><NumBytesPVP>160</NumBytesPVP>{data}</Data>\
         <Channel><RefChId>c0</RefChId>{parameters}</Channel>{rest}</CPHD>"
    )
}

fn channel(n: usize) -> String {
    format!(
        "<Channel><Identifier>c{n}</Identifier><NumVectors>1</NumVectors><NumSamples>1</NumSamples>\
         <SignalArrayByteOffset>0</SignalArrayByteOffset><PVPArrayByteOffset>0</PVPArrayByteOffset></Channel>"
    )
}

/// Processor time of this thread so far, independent of other load.
fn taken_s() -> f64 {
    processor::seconds(Of::Thread).expect("the system measures processor time")
}

fn read(xml: &str) -> Result<CphdInfo, String> {
    assert!(
        xml.len() <= 8 << 20,
        "{} bytes are more than are read",
        xml.len()
    );
    let start_s = taken_s();
    let info = CphdInfo::from_xml(xml).map_err(|error| error.to_string());
    let took_s = taken_s() - start_s;
    println!("{} bytes in {took_s} s", xml.len());
    assert!(took_s < LIMIT_S, "{} bytes took {took_s} s", xml.len());
    info
}

/// A linear search of each channel's parameters once took 6 s for 4000 channels.
#[test]
fn reading_time_is_linear_in_number_of_channels() {
    const CHANNELS: usize = 25_000;
    let data: String = (0..CHANNELS).map(channel).collect();
    let parameters: String = (0..CHANNELS)
        .rev()
        .map(|n| format!("<Parameters><Identifier>c{n}</Identifier><FxC>{n}</FxC></Parameters>"))
        .collect();
    let info = read(&cphd_xml("", &data, &parameters, "")).unwrap();
    assert_eq!(info.channels.len(), CHANNELS);
    assert!((0..CHANNELS).all(|n| info.channels[n].fx_c_hz == Some(n as f64)));
}

/// Of two parameters with the same identifier the first counts.
#[test]
fn first_of_repeated_channel_parameters_is_used() {
    let parameters = "<Parameters><FxC>9</FxC></Parameters>\
                      <Parameters><Identifier>c0</Identifier><FxC>1</FxC></Parameters>\
                      <Parameters><Identifier>c0</Identifier><FxC>2</FxC></Parameters>";
    let info = read(&cphd_xml("", &channel(0), parameters, "")).unwrap();
    assert_eq!(info.channels[0].fx_c_hz, Some(1.0));
}

/// Comparing each attribute with every other once took 7 s for 40 000.
#[test]
fn many_attributes_are_refused_at_once() {
    let attributes: String = (0..200_000).map(|n| format!(" a{n}=\"=>\"")).collect();
    let error = read(&cphd_xml(&attributes, &channel(0), "", "")).unwrap_err();
    assert!(
        error.contains("byte 0: expected at most 100 attributes of one element"),
        "{error}"
    );
    // Hundreds of elements may have attributes, and text and comments any length.
    let some: String = (0..50).map(|n| format!(" a{n}='x>y'")).collect();
    let many = format!(
        "<a{some}>{}</a><!-- <{} --><![CDATA[<{}]]>",
        "=".repeat(500),
        "=".repeat(500),
        "=".repeat(500)
    );
    read(&cphd_xml("", &channel(0), "", &many.repeat(100))).unwrap();
}

/// Copying the namespaces of all parents into every element once needed gigabytes for a megabyte.
#[test]
fn many_namespaces_are_refused_at_once() {
    let begin: String = (0..20_000)
        .map(|n| format!("<a xmlns:n{n}=\"u\">"))
        .collect();
    let deep = begin + &"</a>".repeat(20_000);
    let error = read(&cphd_xml("", &channel(0), "", &deep)).unwrap_err();
    assert!(
        error.contains("at most 100 declarations of namespaces"),
        "{error}"
    );
}

/// The parser does not recurse.
#[test]
fn deeply_nested_elements_are_parsed() {
    let deep = "<a>".repeat(500_000) + &"</a>".repeat(500_000);
    read(&cphd_xml("", &channel(0), "", &deep)).unwrap();
}

#[test]
fn listed_channels_in_error_are_limited() {
    let data: String = (0..5000).map(channel).collect();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.cphd");
    let xml = cphd_xml("", &data, "", "<PVP></PVP>");
    let header = |at: usize| {
        format!(
            "CPHD/1.1.0\nXML_BLOCK_SIZE := {}\nXML_BLOCK_BYTE_OFFSET := {at}\nPVP_BLOCK_SIZE := 8\n\
             PVP_BLOCK_BYTE_OFFSET := {at}\nSIGNAL_BLOCK_SIZE := 8\nSIGNAL_BLOCK_BYTE_OFFSET := {at}\n\x0c\n",
            xml.len()
        )
    };
    let at = header(1000).len();
    let mut whole = header(1000).replace(":= 1000\n", &format!(":= {at:04}\n"));
    whole += &xml;
    fs::write(&path, whole).unwrap();
    let error = subaperture::io::cphd::Cphd::open(&path, Some("none"), u64::MAX);
    let error = error.err().unwrap().to_string();
    assert!(error.len() < 1000, "{} bytes", error.len());
}

fn product_with(folder: &Path, grid: &Value) -> Result<product::StoredProduct, String> {
    let image = Image {
        rows: 2,
        columns: 3,
        pixels: vec![Complex32::ONE; 6],
    };
    let product = Product {
        image: &image,
        metadata: &json!({ "grid": grid }),
        quicklook: b"none",
    };
    product.write(folder).unwrap();
    product::read(folder).map_err(|error| error.to_string())
}

/// Once all of these were accepted, with arbitrary positions of pixels.
#[test]
fn impossible_grid_of_a_product_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let good = json!({
        "kind": "cartesian",
        "origin_m": [0.0, 1.0, 2.0],
        "x_axis": [1.0, 0.0, 0.0],
        "y_axis": [0.0, 1.0, 0.0],
        "columns": { "start": 0.0, "step": 0.5, "count": 3 },
        "rows": { "start": 0.0, "step": 0.5, "count": 2 },
    });
    product_with(folder.path(), &good).unwrap();
    for (pointer, value, part) in [
        ("/x_axis", json!([2.0, 0.0, 0.0]), "orthogonal unit vectors"),
        ("/y_axis", json!([1.0, 0.0, 0.0]), "orthogonal unit vectors"),
        (
            "/y_axis",
            json!([0.0, 1e200, 1e200]),
            "orthogonal unit vectors",
        ),
        ("/x_axis", json!([0.0, 0.0, 0.0]), "orthogonal unit vectors"),
        (
            "/origin_m",
            json!([1e300, 0.0, 0.0]),
            "more than 1e9 m from the scene's origin",
        ),
        ("/columns/start", json!(-1e10), "its columns run from"),
        ("/rows/step", json!(1e308), "its rows run from"),
        ("/columns/step", json!(1e10), "its columns run from"),
    ] {
        let mut grid = good.clone();
        *grid.pointer_mut(pointer).unwrap() = value;
        let error = product_with(folder.path(), &grid).unwrap_err();
        assert!(
            error.contains("image.json") && error.contains(part),
            "{pointer}: {error}"
        );
    }
}

/// A search of suggestions for every key once took 10 s for 3 megabytes.
#[test]
fn many_unknown_keys_are_reported_at_once() {
    let keys: String = (0..300_000).map(|n| format!("k{n} = 1\n")).collect();
    let start_s = taken_s();
    let error = Scenario::new("a.toml", format!("[scene]\n{keys}"), ".").experiment();
    let took_s = taken_s() - start_s;
    println!("{took_s} s");
    assert!(took_s < LIMIT_S, "{took_s} s");
    assert!(error.unwrap_err().to_string().contains("unknown key"));
}

#[test]
fn metadata_beyond_limit_are_not_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("image.json");
    fs::File::create(&path).unwrap().set_len(1 << 40).unwrap();
    let start_s = taken_s();
    let error = product::read(folder.path()).unwrap_err().to_string();
    assert!(error.contains("at most 4194304 bytes"), "{error}");
    assert!(taken_s() - start_s < LIMIT_S);
}
