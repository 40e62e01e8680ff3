//! Keys of `[scene]` and its subsections.

use subaperture_describe::schema::{Bounds, Key, Presence, Requirement, Section, ValueType};
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
            ValueType::Vector(Dimension::Length),
            Requirement::Optional("\"0, 0, 0 m\""),
            "Motion compensation reference point, also for amplitudes: with isotropic antennas, 1 m^2 has \
                        amplitude 1 in an image; with spreading loss, at this point only. Default: the scene's origin, \
                        unless reference_range is given.",
        ),
        Key::new(
            "reference_range",
            ValueType::Quantity(Dimension::Length, Bounds::Positive),
            Requirement::Optional("\"5 km\""),
            "Alternative to a reference point: a constant range from the radar for all pulses, as with a \
                        receiver with one range gate.",
        ),
        Key::new(
            "x",
            ValueType::Interval(Dimension::Length),
            Requirement::Optional("\"-50, 50 m\""),
            "Extent of the scene in x, for default image grids. Give x and y, or neither.",
        ),
        Key::new(
            "y",
            ValueType::Interval(Dimension::Length),
            Requirement::Optional("\"-50, 50 m\""),
            "Extent of the scene in y.",
        ),
    ],
};

const POSITION: Key = Key::new(
    "position",
    ValueType::Vector(Dimension::Length),
    Requirement::Required("\"10, 5, 0 m\""),
    "Position in the scene frame.",
);
const CROSS_SECTION: Key = Key::new(
    "cross_section",
    ValueType::Quantity(Dimension::CrossSection, Bounds::NotNegative),
    Requirement::Default("\"1 m^2\""),
    "Radar cross section.",
);
const PHASE: Key = Key::new(
    "phase",
    ValueType::Quantity(Dimension::Angle, Bounds::Any),
    Requirement::Default("\"0 deg\""),
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
            ValueType::Vector(Dimension::Ratio),
            Requirement::Required("\"0, -1, 0.6\""),
            "Boresight direction in scene axes.",
        ),
        Key::new(
            "edge",
            ValueType::Quantity(Dimension::Length, Bounds::Positive),
            Requirement::Required("\"30 cm\""),
            "Length of an inner edge.",
        ),
    ],
};

const X: Key = Key::new(
    "x",
    ValueType::Interval(Dimension::Length),
    Requirement::Required("\"-20, 20 m\""),
    "Extent in x.",
);
const Y: Key = Key::new(
    "y",
    ValueType::Interval(Dimension::Length),
    Requirement::Required("\"-20, 20 m\""),
    "Extent in y.",
);
const HEIGHT: Key = Key::new(
    "height",
    ValueType::Quantity(Dimension::Length, Bounds::Any),
    Requirement::Default("\"0 m\""),
    "Height (z).",
);
const SPACING: Key = Key::new(
    "spacing",
    ValueType::Quantity(Dimension::Length, Bounds::Positive),
    Requirement::Required("\"2 m\""),
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
            ValueType::Choice(&["rectangle", "disc"]),
            Requirement::Default("\"rectangle\""),
            "Shape of the area.",
        ),
        X.when(&["rectangle"]),
        Y.when(&["rectangle"]),
        Key::new(
            "centre",
            ValueType::Vector(Dimension::Length),
            Requirement::Required("\"0, 0, 0 m\""),
            "Centre of the disc; z is its height.",
        )
        .when(&["disc"]),
        Key::new(
            "radius",
            ValueType::Quantity(Dimension::Length, Bounds::Positive),
            Requirement::Required("\"20 m\""),
            "Radius of the disc.",
        )
        .when(&["disc"]),
        HEIGHT.when(&["rectangle"]),
        Key::new(
            "density",
            ValueType::Quantity(Dimension::Ratio, Bounds::Positive),
            Requirement::Optional("1"),
            "Points per square metre; ten per resolution cell give speckle. Give either this or count.",
        ),
        Key::new(
            "count",
            ValueType::Count(1, 1 << 26),
            Requirement::Optional("1000"),
            "Total number of points. Give either this or density.",
        ),
        Key::new(
            "sigma0",
            ValueType::Quantity(Dimension::Level, LEVEL),
            Requirement::Required("\"-20 dB\""),
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
            ValueType::Path,
            Requirement::Required("\"picture.png\""),
            "Greyscale PNG with 8 or 16 bits, or NumPy array of real numbers.",
        ),
        X,
        Y,
        HEIGHT,
        SPACING,
        Key::new(
            "sigma0",
            ValueType::Quantity(Dimension::Level, LEVEL),
            Requirement::Required("\"0 dB\""),
            "Radar cross section per square metre of white pixels.",
        ),
        Key::new(
            "speckle",
            ValueType::Flag,
            Requirement::Default("true"),
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
            ValueType::Vector(Dimension::Length),
            Requirement::Required("\"10, 5, 0 m\""),
            "Centre of the ground plan, at the foot.",
        ),
        Key::new(
            "size",
            ValueType::Vector(Dimension::Length),
            Requirement::Required("\"12, 8, 6 m\""),
            "Length, width and height.",
        ),
        Key::new(
            "yaw",
            ValueType::Quantity(Dimension::Angle, Bounds::Any),
            Requirement::Default("\"0 deg\""),
            "Angle from the scene's x axis to the length of the building, towards y.",
        ),
        SPACING,
        Key::new(
            "wall",
            ValueType::Quantity(Dimension::Level, LEVEL),
            Requirement::Default("\"-10 dB\""),
            "Mean radar cross section per square metre of wall.",
        ),
        Key::new(
            "edge",
            ValueType::Quantity(Dimension::Level, LEVEL),
            Requirement::Default("\"-10 dB\""),
            "Radar cross section per metre of roof edge.",
        ),
        Key::new(
            "foot",
            ValueType::Quantity(Dimension::Level, LEVEL),
            Requirement::Default("\"0 dB\""),
            "Radar cross section per metre of foot, where wall and ground form a dihedral.",
        ),
    ],
};
