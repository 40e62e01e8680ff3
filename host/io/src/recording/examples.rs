//! Descriptions of public recordings as examples, printed by `subap recording --example NAME`.

/// Name and text of every example.
const EXAMPLES: [(&str, &str); 4] = [
    ("arcsar-8", include_str!("examples/arcsar-8.toml")),
    ("arcsar-10", include_str!("examples/arcsar-10.toml")),
    ("pulson-rail", include_str!("examples/pulson-rail.toml")),
    ("ti-mimo", include_str!("examples/ti-mimo.toml")),
];

/// Names of the examples.
pub fn names() -> [&'static str; 4] {
    EXAMPLES.map(|(name, _)| name)
}

/// Text of the example with this name.
pub fn text(name: &str) -> Option<&'static str> {
    let found = EXAMPLES.iter().find(|(known, _)| *known == name);
    found.map(|&(_, text)| text)
}
