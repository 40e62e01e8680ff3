// Phasors, common to the shaders.

// Cycles of the lowest bit of a fixed-point phase.
const TURN: f32 = 2.3283064365386963e-10;

// Cosine and sine of a phase in cycles, within half a cycle.
fn phasor(cycles: f32) -> vec2<f32> {
    let s = cycles * cycles;
    var sine = -12.27126;
    sine = fma(sine, s, 41.205395);
    sine = fma(sine, s, -76.5801);
    sine = fma(sine, s, 81.59618);
    sine = fma(sine, s, -41.341423);
    sine = fma(sine, s, 6.2831826);
    var cosine = 6.52962;
    cosine = fma(cosine, s, -25.96832);
    cosine = fma(cosine, s, 60.167835);
    cosine = fma(cosine, s, -85.450165);
    cosine = fma(cosine, s, 64.93912);
    cosine = fma(cosine, s, -19.739204);
    cosine = fma(cosine, s, 1.0);
    return vec2<f32>(cosine, sine * cycles);
}
