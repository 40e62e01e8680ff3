// Interpolation of the range-Doppler map of a patch at its pixels, in range and then in Doppler; `subaperture_kernels::patch_map` has the equations. `phasor.wgsl` precedes it.

const RANGE_TAPS: u32 = 6u;
const DOPPLER_TAPS: u32 = 12u;
// Doppler bins of a block.
const BLOCK: u32 = 16u;

struct Sizes {
    bins: u32,
    range_bins: u32,
    lines: u32,
    stations: u32,
    // Number of the first Doppler bin, and distance of the planes of pixels.
    first_bin: i32,
    plane: u32,
    // Spacing of the lines, and factor and limits of the argument of the curves.
    line_step: f32,
    bin_scale: f32,
    low: f32,
    high: f32,
    reserved: vec2<u32>,
}

@group(0) @binding(0) var<uniform> sizes: Sizes;
// Polynomials of the kernels in range and in Doppler: even and odd part of each tap of the first half.
@group(0) @binding(1) var<storage, read> kernels: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> values: array<f32>;
// First range bin, five coefficients, two unused.
@group(0) @binding(3) var<storage, read> curves: array<array<u32, 8>>;
// First Doppler bin, five coefficients; fixed-point phase of the first line and its step, three coefficients, one unused.
@group(0) @binding(4) var<storage, read> stations: array<array<u32, 12>>;
// [bin][line]
@group(0) @binding(5) var<storage, read_write> crossed: array<vec2<f32>>;
@group(0) @binding(6) var<storage, read_write> pixels: array<f32>;

fn polynomial(terms: vec4<f32>, x: f32) -> f32 {
    return fma(x, fma(x, fma(x, terms.w, terms.z), terms.y), terms.x);
}

// Polynomial of five terms.
fn quartic(terms: vec4<u32>, last: u32, x: f32) -> f32 {
    let s = x * x;
    return fma(s, s * bitcast<f32>(last), polynomial(bitcast<vec4<f32>>(terms), x));
}

// Even and odd part of the weight of a tap at the fraction `u`, minus a half; the mirrored tap has their difference.
fn parts(tap: u32, u: f32) -> vec2<f32> {
    let s = u * u;
    return vec2<f32>(polynomial(kernels[2u * tap], s), u * polynomial(kernels[2u * tap + 1u], s));
}

@compute @workgroup_size(16, 16)
fn in_range(@builtin(global_invocation_id) id: vec3<u32>) {
    let bin = id.x;
    let line = id.y;
    if bin >= sizes.bins || line >= sizes.lines {
        return;
    }
    let curve = curves[line];
    let at = clamp(f32(sizes.first_bin + i32(bin)) * sizes.bin_scale, sizes.low, sizes.high);
    let above = quartic(vec4<u32>(curve[1], curve[2], curve[3], curve[4]), curve[5], at) - 0.5;
    let whole = round(above);
    let u = above - whole;
    let period = i32(sizes.range_bins);
    // The remainder has the sign of the dividend.
    let first = u32((bitcast<i32>(curve[0]) + i32(whole) - i32(RANGE_TAPS / 2u - 1u)) % period + period);
    let block = bin / BLOCK * sizes.range_bins;
    var sum = vec2<f32>(0.0, 0.0);
    for (var tap = 0u; tap < RANGE_TAPS / 2u; tap += 1u) {
        let weight = parts(tap, u);
        let low = 2u * BLOCK * (block + (first + tap) % sizes.range_bins) + bin % BLOCK;
        let high = 2u * BLOCK * (block + (first + RANGE_TAPS - 1u - tap) % sizes.range_bins) + bin % BLOCK;
        sum += (weight.x + weight.y) * vec2<f32>(values[low], values[low + BLOCK]);
        sum += (weight.x - weight.y) * vec2<f32>(values[high], values[high + BLOCK]);
    }
    crossed[bin * sizes.lines + line] = sum;
}

@compute @workgroup_size(16, 16)
fn in_doppler(@builtin(global_invocation_id) id: vec3<u32>) {
    let line = id.x;
    let station = id.y;
    if line >= sizes.lines || station >= sizes.stations {
        return;
    }
    let own = stations[station];
    let at = fma(f32(line), sizes.line_step, -1.0);
    let above = quartic(vec4<u32>(own[1], own[2], own[3], own[4]), own[5], at) - 0.5;
    let whole = round(above);
    let u = above - whole;
    let first = u32(bitcast<i32>(own[0]) - sizes.first_bin + i32(whole) - i32(DOPPLER_TAPS / 2u - 1u));
    var sum = vec2<f32>(0.0, 0.0);
    for (var tap = 0u; tap < DOPPLER_TAPS / 2u; tap += 1u) {
        let weight = parts(RANGE_TAPS / 2u + tap, u);
        sum += (weight.x + weight.y) * crossed[(first + tap) * sizes.lines + line];
        sum += (weight.x - weight.y) * crossed[(first + DOPPLER_TAPS - 1u - tap) * sizes.lines + line];
    }
    // Linear terms of the phase, modulo a cycle, in integers.
    let fixed = f32(bitcast<i32>(own[6] + own[7] * line)) * TURN;
    let terms = bitcast<vec4<f32>>(vec4<u32>(own[8], own[9], own[10], 0u));
    let cycles = fma(at * at, polynomial(terms, at), fixed);
    let turned = phasor(cycles - round(cycles));
    let to = 2u * sizes.plane * station + line;
    pixels[to] += fma(turned.x, sum.x, -turned.y * sum.y);
    pixels[to + sizes.plane] += fma(turned.x, sum.y, turned.y * sum.x);
}
