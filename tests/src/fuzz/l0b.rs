//! NISAR L0B: raw echoes in HDF5.

use hdf5_pure::{AttrValue, FileBuilder};
use subaperture::io::l0b::{L0b, L0bInfo};
use subaperture::io::open::{Options, open_sum};

use super::MEMORY_BYTES;
use super::recordings::examine;
use super::scratch::with_files;

pub(super) const WORDS: &[&str] = &[
    "science",
    "RRSD",
    "frequencyA",
    "frequencyB",
    "lowRateTelemetry",
    "UTCtime",
    "seconds since 2026-01-01T00:00:00",
    "calType",
    "BFPQLUT",
    "slantRange",
    "validSamplesSubSwath1",
    "HDF",
    "OHDR",
    "TREE",
    "SNOD",
    "HEAP",
    "GCOL",
];

const PULSES: usize = 4;
const SAMPLES: usize = 96;
const C: f64 = 299_792_458.0;

/// Four pulses of 40 samples in windows of 96, from 700 km; one is of calibration.
fn seed(coded: bool) -> Vec<u8> {
    let mut file = FileBuilder::new();
    let rate = 1.06e-3;
    let times: Vec<f64> = (0..6).map(f64::from).collect();
    let states = |of: fn(f64, f64) -> [f64; 3]| -> Vec<f64> {
        times.iter().flat_map(|t| of(rate * t, 7.078e6)).collect()
    };
    let positions = states(|a, r| [r * a.cos(), 0.0, r * a.sin()]);
    let velocities = states(|a, r| [-r * 1.06e-3 * a.sin(), 0.0, r * 1.06e-3 * a.cos()]);

    let mut named = file.create_group("identification");
    named
        .create_dataset("diagnosticModeFlag")
        .with_u8_data(&[0]);
    named
        .create_dataset("lookDirection")
        .with_ascii_strings(&["right"])
        .expect("a text");
    let named = named.finish();

    let mut orbit = file.create_group("orbit");
    orbit
        .create_dataset("time")
        .with_f64_data(&times)
        .set_attr("units", units());
    for (name, values) in [("position", &positions), ("velocity", &velocities)] {
        orbit
            .create_dataset(name)
            .with_f64_data(values)
            .with_shape(&[6, 3]);
    }
    let orbit = orbit.finish();
    let mut telemetry = file.create_group("lowRateTelemetry");
    telemetry.add_group(orbit);
    let telemetry = telemetry.finish();

    let mut received = file.create_group("rxH");
    let shape = [PULSES as u64, SAMPLES as u64];
    if coded {
        let values: Vec<f32> = (0..1 << 16)
            .map(|code| (code & 255) as f32 - 127.5)
            .collect();
        received
            .create_dataset("BFPQLUT")
            .with_f32_data(&values)
            .with_chunks(&[4096])
            .with_deflate(4);
        let codes: Vec<(u16, u16)> = (0..PULSES * SAMPLES)
            .map(|i| (i as u16, 7 * i as u16))
            .collect();
        received
            .create_dataset("HH")
            .with_compound_values(&codes)
            .expect("a compound")
            .with_shape(&shape)
            .with_chunks(&[3, 40])
            .with_shuffle()
            .with_deflate(4);
    } else {
        let values: Vec<(f32, f32)> = (0..PULSES * SAMPLES)
            .map(|i| ((i as f32).cos(), (i as f32).sin()))
            .collect();
        received
            .create_dataset("HH")
            .with_compound_values(&values)
            .expect("a compound")
            .with_shape(&shape);
    }
    let received = received.finish();

    let mut sent = file.create_group("txH");
    let pulses: Vec<f64> = (0..PULSES).map(|n| 2.0 + 0.01 * n as f64).collect();
    sent.create_dataset("UTCtime")
        .with_f64_data(&pulses)
        .set_attr("units", units());
    sent.create_dataset("calType").with_u8_data(&[0, 0, 1, 0]);
    let step_m = C / 40e6;
    for (name, value) in [
        ("centerFrequency", 1.25e9),
        ("chirpSlope", -5e12),
        ("chirpDuration", 2e-6),
        ("rangeBandwidth", 10e6),
        ("slantRangeSpacing", step_m),
        ("numberOfSubSwaths", 1.0),
    ] {
        sent.create_dataset(name).with_f64_data(&[value]);
    }
    let ranges: Vec<f64> = (0..SAMPLES).map(|i| 850e3 + step_m * i as f64).collect();
    sent.create_dataset("slantRange").with_f64_data(&ranges);
    let valid: Vec<f64> = (0..PULSES).flat_map(|_| [3.0, 90.0]).collect();
    sent.create_dataset("validSamplesSubSwath1")
        .with_f64_data(&valid)
        .with_shape(&[PULSES as u64, 2]);
    sent.add_group(received);
    let sent = sent.finish();

    let mut band = file.create_group("frequencyA");
    band.add_group(sent);
    let band = band.finish();
    let mut swaths = file.create_group("swaths");
    swaths.add_group(band);
    let swaths = swaths.finish();
    let mut product = file.create_group("RRSD");
    product.add_group(telemetry);
    product.add_group(swaths);
    let product = product.finish();
    let mut radar = file.create_group("LSAR");
    radar.add_group(named);
    radar.add_group(product);
    let radar = radar.finish();
    let mut science = file.create_group("science");
    science.add_group(radar);
    file.add_group(science.finish());
    file.finish().expect("a file in memory")
}

fn units() -> AttrValue {
    AttrValue::AsciiString("seconds since 2026-01-01T00:00:00".to_owned())
}

pub(super) fn seeds() -> Vec<Vec<u8>> {
    vec![seed(false), seed(true)]
}

pub(super) fn read(bytes: &[u8]) -> String {
    with_files(&[("input.h5", bytes)], |folder| {
        let path = folder.join("input.h5");
        let info = match L0bInfo::read(&path, MEMORY_BYTES) {
            Ok(info) => format!("{} channels", info.channels.len()),
            Err(error) => return error.to_string(),
        };
        let opened = match L0b::open(&path, None, MEMORY_BYTES) {
            Ok(history) => examine(&history, bytes),
            Err(error) => error.to_string(),
        };
        let options = Options {
            memory_bytes: MEMORY_BYTES,
            ..Options::default()
        };
        let summed = match open_sum::<_, &str>(&[&path], None, &options) {
            Ok(sum) => examine(&sum, bytes),
            Err(error) => error.to_string(),
        };
        format!("{info} {opened} {summed}")
    })
}
