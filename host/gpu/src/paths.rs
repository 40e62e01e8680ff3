//! Parameters of the shader of backprojection for a pulse and a tile.

use subaperture_focus::device::Expansion;

/// Values per pulse and tile.
pub(crate) const VALUES: usize = 16;

/// Cycles as a fraction of 2^32, modulo a cycle.
pub(crate) fn fixed(cycles: f64) -> u32 {
    // The fraction may round up to a whole cycle, which is 0.
    ((cycles - cycles.floor()) * 4_294_967_296.0).round() as u64 as u32
}

/// Parameters of a path over a tile, in the order in which the shader reads them. Profiles have `length` bins of `kappa` carrier cycles.
pub(crate) fn parameters(
    path: &Expansion,
    [rows, columns]: [usize; 2],
    kappa: f64,
    length: usize,
) -> [u32; VALUES] {
    let bins = length as f64;
    let half = |count: usize| 0.5 * (count as f64 - 1.0);
    let ([i, j], [a, b, c], [d, e, f, g]) = (path.first, path.second, path.third);
    let corner = path.at - i * half(columns) - j * half(rows);
    let position = path.at - (path.at / bins).floor() * bins;
    // Rounding may make the position the length itself, the first bin of the next period.
    let bin = (position.floor() as usize).min(length - 1);
    let bits = |value: f64| (value as f32).to_bits();
    [
        fixed(kappa * corner),
        fixed(kappa * i),
        fixed(kappa * j),
        bin as u32,
        bits(position - bin as f64),
        bits(i),
        bits(j),
        bits(kappa),
        bits(a),
        bits(b),
        bits(c),
        bits(d),
        bits(e),
        bits(f),
        bits(g),
        0,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cycles_become_fractions() {
        assert_eq!(fixed(0.25), 1 << 30);
        assert_eq!(fixed(-7.25), 3 << 30);
        assert_eq!(fixed(1e-12), 0);
        assert_eq!(fixed(-1e-12), 0);
        assert_eq!(fixed(123_456.5), 1 << 31);
    }
}
