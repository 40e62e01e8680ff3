//! Example scenarios, as printed by `subap simulate --example NAME`.

/// Name and text of every example.
const EXAMPLES: [(&str, &str); 12] = [
    ("spotlight", include_str!("examples/spotlight.toml")),
    ("stripmap", include_str!("examples/stripmap.toml")),
    ("circular", include_str!("examples/circular.toml")),
    ("rail", include_str!("examples/rail.toml")),
    ("stepped", include_str!("examples/stepped.toml")),
    ("mover", include_str!("examples/mover.toml")),
    ("gmti", include_str!("examples/gmti.toml")),
    ("arc", include_str!("examples/arc.toml")),
    ("walk", include_str!("examples/walk.toml")),
    ("truck", include_str!("examples/truck.toml")),
    ("fusion", include_str!("examples/fusion.toml")),
    ("distributed", include_str!("examples/distributed.toml")),
];

/// Names of the examples.
pub fn names() -> [&'static str; 12] {
    EXAMPLES.map(|(name, _)| name)
}

/// Example called `name`; `None` if there is none.
pub fn text(name: &str) -> Option<&'static str> {
    let found = EXAMPLES.iter().find(|(known, _)| *known == name);
    found.map(|&(_, text)| text)
}
