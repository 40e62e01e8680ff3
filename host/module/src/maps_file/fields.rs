//! Encoding and decoding of the fields of a maps file.

use glam::DVec3;
use num_complex::Complex32;
use serde_json::{Map, Value};
use subaperture_core::Sc16;
use subaperture_core::stream::{BlockFloat, MapHeader, MapSamples, Node, Patch, PatchMap, Setup};

use super::{ANY_SIZE, samples_bytes};
use crate::maps::{Arithmetic, OwnedSamples, Run, RunTotals};
use subaperture_io::json::{self, Limits};
use subaperture_model::geometry::SceneFrame;
use subaperture_model::phase_history::physical::band_fault;

/// Limits of a JSON object: provenance and counters take some kilobytes.
const OBJECT_LIMITS: Limits = Limits {
    bytes: 1 << 20,
    string_bytes: 256 << 10,
    value_bytes: 2 << 20,
};

/// Reads fields from the front of a payload.
pub(super) struct Fields<'a>(pub(super) &'a [u8]);

/// Result of parsing a payload; the error describes the fault.
pub(super) type Parsed<T> = Result<T, String>;

impl<'a> Fields<'a> {
    pub(super) fn bytes(&mut self, count: usize) -> Parsed<&'a [u8]> {
        let (head, tail) = self
            .0
            .split_at_checked(count)
            .ok_or_else(|| "unexpected end".to_owned())?;
        self.0 = tail;
        Ok(head)
    }

    fn array<const N: usize>(&mut self) -> Parsed<[u8; N]> {
        let mut array = [0; N];
        array.copy_from_slice(self.bytes(N)?);
        Ok(array)
    }

    fn u8(&mut self) -> Parsed<u8> {
        self.array().map(u8::from_le_bytes)
    }

    fn u16(&mut self) -> Parsed<u16> {
        self.array().map(u16::from_le_bytes)
    }

    fn u32(&mut self) -> Parsed<u32> {
        self.array().map(u32::from_le_bytes)
    }

    pub(super) fn u64(&mut self) -> Parsed<u64> {
        self.array().map(u64::from_le_bytes)
    }

    fn f32(&mut self) -> Parsed<f32> {
        self.array().map(f32::from_le_bytes)
    }

    fn f64(&mut self) -> Parsed<f64> {
        self.array().map(f64::from_le_bytes)
    }

    fn point(&mut self) -> Parsed<[f64; 3]> {
        Ok([self.f64()?, self.f64()?, self.f64()?])
    }

    fn text(&mut self) -> Parsed<String> {
        let length = self.u32()? as usize;
        let bytes = self.bytes(length)?.to_vec();
        String::from_utf8(bytes).map_err(|_| "text is not valid UTF-8".to_owned())
    }

    fn object(&mut self) -> Parsed<Map<String, Value>> {
        let length = self.u32()? as usize;
        let text = self.bytes(length)?;
        match json::value(text, OBJECT_LIMITS) {
            Ok(Value::Object(object)) => Ok(object),
            Ok(_) => Err("JSON value is not an object".to_owned()),
            Err(error) => Err(format!("invalid JSON: {error}")),
        }
    }

    pub(super) fn end(self) -> Parsed<()> {
        if self.0.is_empty() {
            Ok(())
        } else {
            Err(format!("{} bytes too long", self.0.len()))
        }
    }
}

fn put_point(out: &mut Vec<u8>, point: [f64; 3]) {
    point
        .iter()
        .for_each(|x| out.extend_from_slice(&x.to_le_bytes()));
}

fn put_text(out: &mut Vec<u8>, text: &str) {
    out.extend_from_slice(&(text.len() as u32).to_le_bytes());
    out.extend_from_slice(text.as_bytes());
}

fn put_object(out: &mut Vec<u8>, object: &Map<String, Value>) {
    put_text(out, &Value::Object(object.clone()).to_string());
}

/// Payload of `HEAD`.
pub(super) fn put_run(out: &mut Vec<u8>, run: &Run) {
    let setup = &run.setup;
    for size in [
        setup.num_pulses,
        setup.num_frequencies,
        setup.range_length,
        setup.doppler_length,
    ] {
        out.extend_from_slice(&size.to_le_bytes());
    }
    out.extend_from_slice(&setup.start_hz.to_le_bytes());
    out.extend_from_slice(&setup.step_hz.to_le_bytes());
    out.push(match run.arithmetic {
        Arithmetic::Float => 0,
        Arithmetic::Fixed => 1,
    });
    match run.frame {
        SceneFrame::Local => out.push(0),
        SceneFrame::Earth {
            origin_ecf_m,
            x_axis_ecf,
            y_axis_ecf,
        } => {
            out.push(1);
            for vector in [origin_ecf_m, x_axis_ecf, y_axis_ecf] {
                put_point(out, vector.to_array());
            }
        }
    }
    put_text(out, &run.name);
    put_text(out, &run.fast_window);
    for weight in &run.fast_weights {
        out.extend_from_slice(&weight.to_le_bytes());
    }
    put_object(out, &run.provenance);
}

pub(super) fn run(payload: &[u8]) -> Parsed<Run> {
    let mut fields = Fields(payload);
    let setup = Setup {
        num_pulses: fields.u16()?,
        num_channels: 1,
        num_frequencies: fields.u16()?,
        range_length: fields.u16()?,
        doppler_length: fields.u16()?,
        start_hz: fields.f64()?,
        step_hz: fields.f64()?,
    };
    setup.check(&ANY_SIZE).map_err(|error| error.to_string())?;
    if let Some(what) = band_fault(setup.start_hz, setup.step_hz, setup.num_frequencies.into()) {
        return Err(what);
    }
    let arithmetic = match fields.u8()? {
        0 => Arithmetic::Float,
        1 => Arithmetic::Fixed,
        other => return Err(format!("unknown arithmetic {other}")),
    };
    let frame = match fields.u8()? {
        0 => SceneFrame::Local,
        1 => SceneFrame::Earth {
            origin_ecf_m: DVec3::from(fields.point()?),
            x_axis_ecf: DVec3::from(fields.point()?),
            y_axis_ecf: DVec3::from(fields.point()?),
        },
        other => return Err(format!("unknown scene frame {other}")),
    };
    if !frame.is_sound() {
        return Err(
            "scene frame: expected orthogonal unit vectors as axes and an origin near \
                    the Earth"
                .to_owned(),
        );
    }
    let name = fields.text()?;
    let fast_window = fields.text()?;
    let mut fast_weights = Vec::with_capacity(setup.num_frequencies.into());
    for _ in 0..setup.num_frequencies {
        fast_weights.push(fields.f32()?);
    }
    if !fast_weights.iter().all(|weight| weight.is_finite()) {
        return Err("window weight is not finite".to_owned());
    }
    let provenance = fields.object()?;
    fields.end()?;
    Ok(Run {
        name,
        setup,
        arithmetic,
        fast_window,
        fast_weights,
        frame,
        provenance,
    })
}

/// Front of the payload of a `MAP `, and of an entry in the index.
pub(super) fn put_header(out: &mut Vec<u8>, header: &MapHeader) {
    out.extend_from_slice(&header.sub_cpi.to_le_bytes());
    for number in [
        header.patch_index,
        header.num_pulses,
        header.patch.range_reach,
        header.patch.doppler_reach,
    ] {
        out.extend_from_slice(&number.to_le_bytes());
    }
    put_point(out, header.patch.centre_m);
    for time_s in header.time_s {
        out.extend_from_slice(&time_s.to_le_bytes());
    }
    out.extend_from_slice(&header.weight_sum.to_le_bytes());
    for node in &header.nodes {
        put_point(out, node.transmitter_m);
        put_point(out, node.receiver_m);
    }
}

pub(super) fn header(fields: &mut Fields) -> Parsed<MapHeader> {
    let sub_cpi = fields.u32()?;
    let (patch_index, num_pulses) = (fields.u16()?, fields.u16()?);
    let (range_reach, doppler_reach) = (fields.u16()?, fields.u16()?);
    let patch = Patch {
        centre_m: fields.point()?,
        range_reach,
        doppler_reach,
    };
    let time_s = [fields.f64()?, fields.f64()?];
    let weight_sum = fields.f32()?;
    let mut nodes = [Node::default(); 2];
    for node in &mut nodes {
        node.transmitter_m = fields.point()?;
        node.receiver_m = fields.point()?;
    }
    Ok(MapHeader {
        sub_cpi,
        patch_index,
        channel: 0,
        num_pulses,
        patch,
        time_s,
        weight_sum,
        nodes,
    })
}

/// Samples of a map whose lengths were checked.
pub(super) fn put_samples(out: &mut Vec<u8>, map: &PatchMap) {
    match map.samples {
        MapSamples::Float(samples) => {
            for value in samples {
                out.extend_from_slice(&value.re.to_le_bytes());
                out.extend_from_slice(&value.im.to_le_bytes());
            }
        }
        MapSamples::Fixed(block_float) => {
            for value in block_float.mantissas {
                out.extend_from_slice(&value.re.to_bits().to_le_bytes());
                out.extend_from_slice(&value.im.to_bits().to_le_bytes());
            }
            out.extend(block_float.exponents.iter().map(|e| e.to_le_bytes()[0]));
        }
    }
}

/// Parse the rest of a map's payload.
pub(super) fn samples(
    mut fields: Fields,
    header: &MapHeader,
    arithmetic: Arithmetic,
) -> Parsed<OwnedSamples> {
    let count = header.patch.map_len();
    if fields.0.len() as u64 != samples_bytes(&header.patch, arithmetic) {
        return Err("length does not match the number of bins".to_owned());
    }
    Ok(match arithmetic {
        Arithmetic::Float => {
            let values = fields.0.chunks_exact(8).map(|bytes| {
                let half = |i: usize| {
                    f32::from_le_bytes([bytes[i], bytes[i + 1], bytes[i + 2], bytes[i + 3]])
                };
                Complex32::new(half(0), half(4))
            });
            OwnedSamples::Float(values.collect())
        }
        Arithmetic::Fixed => {
            let values = fields.bytes(4 * count)?.chunks_exact(4).map(|bytes| {
                let half = |i: usize| i16::from_le_bytes([bytes[i], bytes[i + 1]]);
                Sc16::from_bits(half(0), half(2))
            });
            OwnedSamples::Fixed {
                mantissas: values.collect(),
                exponents: fields.0.iter().map(|e| i8::from_le_bytes([*e])).collect(),
            }
        }
    })
}

/// Whether a map's samples match the arithmetic and the dimensions in its header.
pub(super) fn is_whole(map: &PatchMap, arithmetic: Arithmetic) -> bool {
    let patch = &map.header.patch;
    match (map.samples, arithmetic) {
        (MapSamples::Float(samples), Arithmetic::Float) => samples.len() == patch.map_len(),
        (MapSamples::Fixed(block_float), Arithmetic::Fixed) => {
            let blocks = BlockFloat::blocks(patch.num_range_bins());
            block_float.mantissas.len() == patch.map_len()
                && block_float.exponents.len() == patch.num_doppler_bins() * blocks
        }
        _ => false,
    }
}

/// Front of the payload of a `TAIL`.
pub(super) fn put_closing(out: &mut Vec<u8>, closing: &RunTotals) {
    out.extend_from_slice(&closing.num_pulses.to_le_bytes());
    out.extend_from_slice(&closing.weight_sum.to_le_bytes());
    put_object(out, &closing.counters);
}

pub(super) fn closing(fields: &mut Fields) -> Parsed<RunTotals> {
    let num_pulses = fields.u64()?;
    let weight_sum = fields.f64()?;
    if !weight_sum.is_finite() {
        return Err("sum of weights is not finite".to_owned());
    }
    Ok(RunTotals {
        num_pulses,
        weight_sum,
        counters: fields.object()?,
    })
}
