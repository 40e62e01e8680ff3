//! Scenarios to start from: what `subap simulate --example NAME` prints.

/// Name and text of every example.
const EXAMPLES: [(&str, &str); 8] = [
    ("spotlight", include_str!("examples/spotlight.toml")),
    ("stripmap", include_str!("examples/stripmap.toml")),
    ("circular", include_str!("examples/circular.toml")),
    ("rail", include_str!("examples/rail.toml")),
    ("stepped", include_str!("examples/stepped.toml")),
    ("mover", include_str!("examples/mover.toml")),
    ("arc", include_str!("examples/arc.toml")),
    ("distributed", include_str!("examples/distributed.toml")),
];

/// The names of the examples.
pub fn names() -> [&'static str; 8] {
    EXAMPLES.map(|(name, _)| name)
}

/// The example of this name.
pub fn text(name: &str) -> Option<&'static str> {
    let found = EXAMPLES.iter().find(|(known, _)| *known == name);
    found.map(|&(_, text)| text)
}
