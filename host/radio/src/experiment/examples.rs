//! Example experiments, as printed by `subap capture --example NAME`.

/// Name and text of every example.
const EXAMPLES: [(&str, &str); 9] = [
    ("thesis", include_str!("examples/thesis.toml")),
    ("thesis-scene", include_str!("examples/thesis-scene.toml")),
    ("rail", include_str!("examples/rail.toml")),
    ("rail-scene", include_str!("examples/rail-scene.toml")),
    ("walk", include_str!("examples/walk.toml")),
    ("walk-scene", include_str!("examples/walk-scene.toml")),
    ("chirp", include_str!("examples/chirp.toml")),
    ("b210", include_str!("examples/b210.toml")),
    ("vna", include_str!("examples/vna.toml")),
];

/// Names of the examples.
pub fn names() -> [&'static str; 9] {
    EXAMPLES.map(|(name, _)| name)
}

/// Text of the example called `name`; `None` if there is none.
pub fn text(name: &str) -> Option<&'static str> {
    let found = EXAMPLES.iter().find(|(known, _)| *known == name);
    found.map(|&(_, text)| text)
}
