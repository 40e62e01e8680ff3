//! Keys of `[scene]` and its subsections.

use subaperture_describe::schema::{Bounds, Key, Kind, Need, Presence, Section};
use subaperture_model::units::Dimension;

pub(crate) static SCENE: Section = Section {
    path: "scene",
    presence: Presence::Always,
    when: &[],
    selector: "",
    doc: "Position, extent and reference of the scene.",
    keys: &[
        Key::new(
            "reference",
            Kind::Vector(Dimension::Length),
            Need::Optional("\"0, 0, 0 m\""),
            "Motion compensation reference point, also for amplitudes: with isotropic antennas, 1 m^2 has \
                        amplitude 1 in an image; with spreading loss, at this point only. Default: the scene's origin, \
                        unless reference_range is given.",
        ),
        Key::new(
            "reference_range",
            Kind::Quantity(Dimension::Length, Bounds::Positive),
            Need::Optional("\"5 km\""),
            "Alternative to a reference point: a constant range from the radar for all pulses, as with a \
                        receiver with one range gate.",
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
    "Position in the scene frame.",
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
    "Phase of the reflection.",
);

pub(crate) static POINT: Section = Section {
    path: "scene.point",
    presence: Presence::Many,
    when: &[],
    selector: "",
    doc: "Isotropic point scatterer.",
    keys: &[POSITION, CROSS_SECTION, PHASE],
};

pub(crate) static CORNER: Section = Section {
    path: "scene.corner",
    presence: Presence::Many,
    when: &[],
    selector: "",
    doc: "Triangular trihedral corner reflector.",
    keys: &[
        POSITION,
        Key::new(
            "boresight",
            Kind::Vector(Dimension::Ratio),
            Need::Required("\"0, -1, 0.6\""),
            "Boresight direction in scene axes.",
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
    "Extent in x.",
);
const Y: Key = Key::new(
    "y",
    Kind::Interval(Dimension::Length),
    Need::Required("\"-20, 20 m\""),
    "Extent in y.",
);
const HEIGHT: Key = Key::new(
    "height",
    Kind::Quantity(Dimension::Length, Bounds::Any),
    Need::Default("\"0 m\""),
    "Height (z).",
);
const SPACING: Key = Key::new(
    "spacing",
    Kind::Quantity(Dimension::Length, Bounds::Positive),
    Need::Required("\"2 m\""),
    "Spacing of the points.",
);
const LEVEL: Bounds = Bounds::Within(-300.0, 300.0, "-300 to 300 dB");

pub(crate) static CLUTTER: Section = Section {
    path: "scene.clutter",
    presence: Presence::Many,
    when: &[],
    selector: "kind",
    doc: "Ground clutter: many weak points on a horizontal plane.",
    keys: &[
        Key::new(
            "kind",
            Kind::Choice(&["rectangle", "disc"]),
            Need::Default("\"rectangle\""),
            "Shape of the area.",
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
            "Points per square metre; ten per resolution cell give speckle. Give either this or count.",
        ),
        Key::new(
            "count",
            Kind::Count(1, 1 << 26),
            Need::Optional("1000"),
            "Total number of points. Give either this or density.",
        ),
        Key::new(
            "sigma0",
            Kind::Quantity(Dimension::Level, LEVEL),
            Need::Required("\"-20 dB\""),
            "Mean radar cross section per square metre (sigma nought).",
        ),
    ],
};

pub(crate) static PICTURE: Section = Section {
    path: "scene.picture",
    presence: Presence::Many,
    when: &[],
    selector: "",
    doc: "Picture on a horizontal plane, with brightness proportional to amplitude.",
    keys: &[
        Key::new(
            "file",
            Kind::Path,
            Need::Required("\"picture.png\""),
            "Greyscale PNG with 8 or 16 bits, or NumPy array of real numbers.",
        ),
        X,
        Y,
        HEIGHT,
        SPACING,
        Key::new(
            "sigma0",
            Kind::Quantity(Dimension::Level, LEVEL),
            Need::Required("\"0 dB\""),
            "Radar cross section per square metre of white pixels.",
        ),
        Key::new(
            "speckle",
            Kind::Flag,
            Need::Default("true"),
            "Use complex Gaussian amplitudes (speckle), as of rough ground.",
        ),
    ],
};

pub(crate) static BUILDING: Section = Section {
    path: "scene.building",
    presence: Presence::Many,
    when: &[],
    selector: "",
    doc: "Building: an upright box with reflecting walls, roof edges and foot, which occludes objects behind it.",
    keys: &[
        Key::new(
            "position",
            Kind::Vector(Dimension::Length),
            Need::Required("\"10, 5, 0 m\""),
            "Centre of the ground plan, at the foot.",
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
            "Angle from the scene's x axis to the length of the building, towards y.",
        ),
        SPACING,
        Key::new(
            "wall",
            Kind::Quantity(Dimension::Level, LEVEL),
            Need::Default("\"-10 dB\""),
            "Mean radar cross section per square metre of wall.",
        ),
        Key::new(
            "edge",
            Kind::Quantity(Dimension::Level, LEVEL),
            Need::Default("\"-10 dB\""),
            "Radar cross section per metre of roof edge.",
        ),
        Key::new(
            "foot",
            Kind::Quantity(Dimension::Level, LEVEL),
            Need::Default("\"0 dB\""),
            "Radar cross section per metre of foot, where wall and ground form a dihedral.",
        ),
    ],
};
