//! Keys of `[scene]` and the sections within.

use subaperture_describe::schema::{Bounds, Key, Kind, Need, Presence, Section};
use subaperture_model::units::Dimension;

pub(crate) static SCENE: Section = Section {
    path: "scene",
    presence: Presence::Always,
    when: &[],
    selector: "",
    doc: "Where the scene is and what it holds.",
    keys: &[
        Key::new(
            "reference",
            Kind::Vector(Dimension::Length),
            Need::Optional("\"0, 0, 0 m\""),
            "The point that phases and amplitudes are referred to: without a beam, 1 m^2 reads 1 in an \
             image, there if echoes weaken with range, else anywhere. If left out, the scene's origin, \
             unless reference_range is given.",
        ),
        Key::new(
            "reference_range",
            Kind::Quantity(Dimension::Length, Bounds::Positive),
            Need::Optional("\"5 km\""),
            "In place of a point: the same range from the radar for all pulses, as a receiver with one \
             range gate has it.",
        ),
        Key::new(
            "x",
            Kind::Interval(Dimension::Length),
            Need::Optional("\"-50, 50 m\""),
            "Extent of the scene in x, for default image grids. Give x and y, or neither.",
        ),
        Key::new(
            "y",
            Kind::Interval(Dimension::Length),
            Need::Optional("\"-50, 50 m\""),
            "Extent of the scene in y.",
        ),
    ],
};

const POSITION: Key = Key::new(
    "position",
    Kind::Vector(Dimension::Length),
    Need::Required("\"10, 5, 0 m\""),
    "Where it is.",
);
const CROSS_SECTION: Key = Key::new(
    "cross_section",
    Kind::Quantity(Dimension::CrossSection, Bounds::NotNegative),
    Need::Default("\"1 m^2\""),
    "Radar cross section.",
);
const PHASE: Key = Key::new(
    "phase",
    Kind::Quantity(Dimension::Angle, Bounds::Any),
    Need::Default("\"0 deg\""),
    "Phase of its reflection.",
);

pub(crate) static POINT: Section = Section {
    path: "scene.point",
    presence: Presence::Many,
    when: &[],
    selector: "",
    doc: "A point that scatters alike in all directions.",
    keys: &[POSITION, CROSS_SECTION, PHASE],
};

pub(crate) static CORNER: Section = Section {
    path: "scene.corner",
    presence: Presence::Many,
    when: &[],
    selector: "",
    doc: "A triangular trihedral corner reflector.",
    keys: &[
        POSITION,
        Key::new(
            "boresight",
            Kind::Vector(Dimension::Ratio),
            Need::Required("\"0, -1, 0.6\""),
            "Where it looks, scene axes.",
        ),
        Key::new(
            "edge",
            Kind::Quantity(Dimension::Length, Bounds::Positive),
            Need::Required("\"30 cm\""),
            "Length of an inner edge.",
        ),
    ],
};

const X: Key = Key::new(
    "x",
    Kind::Interval(Dimension::Length),
    Need::Required("\"-20, 20 m\""),
    "Its extent in x.",
);
const Y: Key = Key::new(
    "y",
    Kind::Interval(Dimension::Length),
    Need::Required("\"-20, 20 m\""),
    "Its extent in y.",
);
const HEIGHT: Key = Key::new(
    "height",
    Kind::Quantity(Dimension::Length, Bounds::Any),
    Need::Default("\"0 m\""),
    "Its height, z.",
);
const SPACING: Key = Key::new(
    "spacing",
    Kind::Quantity(Dimension::Length, Bounds::Positive),
    Need::Required("\"2 m\""),
    "Distance from point to point.",
);
const LEVEL: Bounds = Bounds::Within(-300.0, 300.0, "-300 to 300 dB");

pub(crate) static CLUTTER: Section = Section {
    path: "scene.clutter",
    presence: Presence::Many,
    when: &[],
    selector: "kind",
    doc: "Many weak points on a level plane that together look like ground.",
    keys: &[
        Key::new(
            "kind",
            Kind::Choice(&["rectangle", "disc"]),
            Need::Default("\"rectangle\""),
            "The shape of its area.",
        ),
        X.when(&["rectangle"]),
        Y.when(&["rectangle"]),
        Key::new(
            "centre",
            Kind::Vector(Dimension::Length),
            Need::Required("\"0, 0, 0 m\""),
            "Centre of the disc; z is its height.",
        )
        .when(&["disc"]),
        Key::new(
            "radius",
            Kind::Quantity(Dimension::Length, Bounds::Positive),
            Need::Required("\"20 m\""),
            "Radius of the disc.",
        )
        .when(&["disc"]),
        HEIGHT.when(&["rectangle"]),
        Key::new(
            "density",
            Kind::Quantity(Dimension::Ratio, Bounds::Positive),
            Need::Optional("1"),
            "Points on a square metre: ten a resolution cell make speckle. Either this or count.",
        ),
        Key::new(
            "count",
            Kind::Count(1, 1 << 26),
            Need::Optional("1000"),
            "Points in all. Either this or density.",
        ),
        Key::new(
            "sigma0",
            Kind::Quantity(Dimension::Level, LEVEL),
            Need::Required("\"-20 dB\""),
            "Mean cross section of a square metre.",
        ),
    ],
};

pub(crate) static PICTURE: Section = Section {
    path: "scene.picture",
    presence: Presence::Many,
    when: &[],
    selector: "",
    doc: "A picture laid on a level plane, its brightness proportional to amplitude.",
    keys: &[
        Key::new(
            "file",
            Kind::Path,
            Need::Required("\"picture.png\""),
            "A grey PNG of 8 or 16 bits, or a NumPy array of real numbers.",
        ),
        X,
        Y,
        HEIGHT,
        SPACING,
        Key::new(
            "sigma0",
            Kind::Quantity(Dimension::Level, LEVEL),
            Need::Required("\"0 dB\""),
            "Cross section of a square metre of white.",
        ),
        Key::new(
            "speckle",
            Kind::Flag,
            Need::Default("true"),
            "Whether amplitudes are complex Gaussian, as of rough ground.",
        ),
    ],
};

pub(crate) static BUILDING: Section = Section {
    path: "scene.building",
    presence: Presence::Many,
    when: &[],
    selector: "",
    doc: "An upright box with walls, roof edge and foot that reflect; it hides what is behind it.",
    keys: &[
        Key::new(
            "position",
            Kind::Vector(Dimension::Length),
            Need::Required("\"10, 5, 0 m\""),
            "Middle of its ground plan, at the foot.",
        ),
        Key::new(
            "size",
            Kind::Vector(Dimension::Length),
            Need::Required("\"12, 8, 6 m\""),
            "Length, width and height.",
        ),
        Key::new(
            "yaw",
            Kind::Quantity(Dimension::Angle, Bounds::Any),
            Need::Default("\"0 deg\""),
            "Angle from the scene's x axis to its length, towards y.",
        ),
        SPACING,
        Key::new(
            "wall",
            Kind::Quantity(Dimension::Level, LEVEL),
            Need::Default("\"-10 dB\""),
            "Mean cross section of a square metre of wall.",
        ),
        Key::new(
            "edge",
            Kind::Quantity(Dimension::Level, LEVEL),
            Need::Default("\"-10 dB\""),
            "Of a metre of roof edge.",
        ),
        Key::new(
            "foot",
            Kind::Quantity(Dimension::Level, LEVEL),
            Need::Default("\"0 dB\""),
            "Of a metre of foot, where wall and ground make a dihedral.",
        ),
    ],
};
