// Backprojection of a block of pulses onto tiles of pixels; the crate's documentation has the equations. `phasor.wgsl` precedes it.

override degree: u32 = 3u;

const SIDE: u32 = 16u;
// Vectors of parameters per tile and pulse, and pulses loaded at a time.
const PATH: u32 = 4u;
const LOADED: u32 = 64u;

struct Block {
    pulses: u32,
    // Values per profile, and values before its first bin.
    stride: u32,
    margin: u32,
    reserved: u32,
}

@group(0) @binding(0) var<uniform> block: Block;
@group(0) @binding(1) var<storage, read> profiles: array<vec2<f32>>;
@group(0) @binding(2) var<storage, read> paths: array<vec4<u32>>;
// First sum, columns and rows.
@group(0) @binding(3) var<storage, read> tiles: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> sums: array<vec2<f32>>;

var<workgroup> loaded: array<vec4<u32>, 256>;

// Spline of the coefficients of a profile, `position` bins after the value at `first`.
fn value(first: u32, position: f32) -> vec2<f32> {
    if degree == 2u {
        let whole = floor(position + 0.5);
        let u = position - whole;
        let at = u32(i32(first) + i32(whole) - 1);
        let a = 0.5 - u;
        let b = 0.5 + u;
        return 0.5 * a * a * profiles[at] + (0.75 - u * u) * profiles[at + 1u] + 0.5 * b * b * profiles[at + 2u];
    }
    let whole = floor(position);
    let u = position - whole;
    let at = u32(i32(first) + i32(whole) - 1);
    let v = 1.0 - u;
    let sixth = 1.0 / 6.0;
    let a = v * v * v * sixth;
    let d = u * u * u * sixth;
    let b = fma(u * u, 0.5 * u - 1.0, 2.0 / 3.0);
    let c = fma(v * v, 0.5 * v - 1.0, 2.0 / 3.0);
    return a * profiles[at] + b * profiles[at + 1u] + c * profiles[at + 2u] + d * profiles[at + 3u];
}

@compute @workgroup_size(16, 16)
fn backproject(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(local_invocation_index) index: u32,
) {
    let tile = tiles[group.z];
    let x = group.x * SIDE + local.x;
    let y = group.y * SIDE + local.y;
    let i = f32(x) - 0.5 * (f32(tile.y) - 1.0);
    let j = f32(y) - 0.5 * (f32(tile.z) - 1.0);
    var sum = vec2<f32>(0.0, 0.0);
    for (var first = 0u; first < block.pulses; first += LOADED) {
        let count = min(LOADED, block.pulses - first);
        workgroupBarrier();
        if index < PATH * count {
            loaded[index] = paths[PATH * (group.z * block.pulses + first) + index];
        }
        workgroupBarrier();
        for (var n = 0u; n < count; n += 1u) {
            let carrier = loaded[PATH * n];
            let line = bitcast<vec4<f32>>(loaded[PATH * n + 1u]);
            let second = bitcast<vec4<f32>>(loaded[PATH * n + 2u]);
            let third = bitcast<vec4<f32>>(loaded[PATH * n + 3u]);
            // Terms of second and third degree, bins.
            let bend = i * i * fma(i, second.w, second.x) + j * (fma(i, fma(i, third.x, second.y), j * fma(i, third.y, fma(j, third.z, second.z))));
            let position = line.x + fma(i, line.y, fma(j, line.z, bend));
            // Linear terms of the phase, modulo a cycle, in integers.
            let fixed = bitcast<i32>(carrier.x + carrier.y * x + carrier.z * y);
            let cycles = fma(line.w, bend, f32(fixed) * TURN);
            let turned = phasor(cycles - round(cycles));
            let z = value((first + n) * block.stride + block.margin + carrier.w, position);
            sum += vec2<f32>(fma(turned.x, z.x, -turned.y * z.y), fma(turned.x, z.y, turned.y * z.x));
        }
    }
    if x < tile.y && y < tile.z {
        let at = tile.x + y * tile.y + x;
        sums[at] += sum;
    }
}
