//! The keys of a job.

use subaperture_describe::schema::{
    Bounds, Key, Presence, Requirement, Schema, Section, ValueType,
};
use subaperture_model::units::Dimension;

const BOUND: ValueType = ValueType::Quantity(
    Dimension::Level,
    Bounds::Within(-120.0, -20.0, "-20 dB to -120 dB"),
);
const LEVEL: ValueType = ValueType::Quantity(Dimension::Level, Bounds::Any);
const SPAN: ValueType = ValueType::Quantity(Dimension::Level, Bounds::Positive);
const SOME: ValueType = ValueType::Count(1, u64::MAX);

/// Of track's `source`.
const FILE: &str = "file";
const MPGA: &str = "mpga";
const FUSED: &str = "fused";

static TOP: Section = Section {
    path: "",
    presence: Presence::Always,
    when: &[],
    selector: "",
    doc: "",
    keys: &[
        Key::new(
            "name",
            ValueType::Text,
            Requirement::Optional("\"Two degrees of Gotcha\""),
            "What the report is called. Left out, as this file.",
        ),
        Key::new(
            "out",
            ValueType::Path,
            Requirement::Optional("\"gotcha\""),
            "Folder for all that the job makes. Left out, beside this file, as it is called without its ending.",
        ),
    ],
};

static INPUT: Section = Section {
    path: "input",
    presence: Presence::Always,
    when: &[],
    selector: "",
    doc: "The recordings.",
    keys: &[
        Key::new(
            "files",
            ValueType::Paths,
            Requirement::Required("\"recording.cphd\""),
            "The recordings: CPHD, CRSD, GOTCHA .mat, arrays, or descriptions of raw samples (.toml). Several make one aperture, in the order of time.",
        ),
        Key::new(
            "channel",
            ValueType::Text,
            Requirement::Optional("\"T1R2\""),
            "One channel by its name, or its number from 1. Left out, a CPHD's reference channel, and of a description all.",
        ),
        Key::new(
            "channels",
            ValueType::Text,
            Requirement::Optional("\"all\""),
            "The coherent sum of channels that share their pulses: all, or some as T1R1,T1R2.",
        ),
    ],
};

static TRACK: Section = Section {
    path: "track",
    presence: Presence::Optional,
    when: &[],
    selector: "source",
    doc: "The radar's track in place of the recorded positions.",
    keys: &[
        Key::new(
            "source",
            ValueType::Choice(&[FILE, MPGA, FUSED]),
            Requirement::Required("\"mpga\""),
            "Where it is taken from: a file, the recording's own echoes, or these and navigation.",
        ),
        Key::new(
            "file",
            ValueType::Path,
            Requirement::Required("\"track.csv\""),
            "The track, as subap track writes it.",
        )
        .when(&[FILE]),
        Key::new(
            "navigation",
            ValueType::Paths,
            Requirement::Required("\"receiver.log\""),
            "Logs of navigation of the recording's time: positions, an inertial solution, or one of each.",
        )
        .when(&[FUSED]),
        Key::new(
            "navigation_start",
            ValueType::Text,
            Requirement::Optional("\"2209:502061.25\""),
            "When the recording's time 0 was by the log's clock: GPS week and seconds of it, or seconds. Left out, what the recording says.",
        )
        .when(&[FUSED]),
        Key::new(
            "lever_arm",
            ValueType::Vector(Dimension::Length),
            Requirement::Optional("\"0.1, 0, 0.3 m\""),
            "From the middle of the antennas to where the log's places are, along the radar's axes.",
        )
        .when(&[FUSED]),
    ],
};

static AUTOFOCUS: Section = Section {
    path: "autofocus",
    presence: Presence::Optional,
    when: &[],
    selector: "method",
    doc: "Phases or a track by which the image is sharper, found before it is formed.",
    keys: &[
        Key::new(
            "method",
            ValueType::Choice(&["pga", "mpga-image", "sharpness", "map-drift"]),
            Requirement::Default("\"pga\""),
            "Phase gradient; modified for near scenes; sharpness of patches; or drift of looks.",
        ),
        Key::new(
            "grid",
            ValueType::Text,
            Requirement::Optional("\"x=-20:20:0.2,y=-20:20:0.2\""),
            "Pixels that are to be sharp, fewer than the image's. Left out, the image's own.",
        ),
        Key::new(
            "measure",
            ValueType::Choice(&["entropy", "contrast", "sharpness", "peak"]),
            Requirement::Default("\"entropy\""),
            "What sharp means where a round is judged.",
        ),
        Key::new(
            "rounds",
            SOME,
            Requirement::Default("16"),
            "Rounds at most.",
        ),
        Key::new(
            "points",
            SOME,
            Requirement::Optional("64"),
            "Points looked at, at most, the brightest of their range bins.",
        )
        .when(&["pga", "mpga-image", "sharpness"]),
        Key::new(
            "within",
            SPAN,
            Requirement::Optional("\"30 dB\""),
            "How far below the brightest a point may be.",
        )
        .when(&["pga", "mpga-image", "sharpness"]),
        Key::new(
            "estimator",
            ValueType::Choice(&["likelihood", "eigenvector", "gradient"]),
            Requirement::Default("\"likelihood\""),
            "How phases are estimated.",
        )
        .when(&["pga"]),
        Key::new(
            "unknown",
            ValueType::Choice(&["phase", "track"]),
            Requirement::Default("\"phase\""),
            "What is sought.",
        )
        .when(&["sharpness"]),
        Key::new(
            "goal",
            ValueType::Choice(&["sharpness", "entropy"]),
            Requirement::Default("\"sharpness\""),
            "What patches are sharpened by.",
        )
        .when(&["sharpness"]),
        Key::new(
            "patch_pixels",
            SOME,
            Requirement::Default("24"),
            "Pixels that a patch has along either side, more than a point is blurred over.",
        )
        .when(&["sharpness"]),
        Key::new(
            "looks",
            ValueType::Count(2, 16),
            Requirement::Default("2"),
            "Looks, and the degree of the polynomial that is found.",
        )
        .when(&["map-drift"]),
    ],
};

static GRID: Section = Section {
    path: "grid",
    presence: Presence::Always,
    when: &[],
    selector: "",
    doc: "The pixels.",
    keys: &[
        Key::new(
            "pixels",
            ValueType::Text,
            Requirement::Optional("\"x=-50:50:0.2,y=-50:50:0.2\""),
            "Pixels, metres in the scene frame, stop excluded; or polar, r=..,theta=.. (degrees); also z, cx, cy, yaw, pitch, roll. Left out, \
             the scene's extent at half the resolution.",
        ),
        Key::new(
            "surface",
            ValueType::Text,
            Requirement::Default("\"plane\""),
            "Where pixels lie: plane, slant, hae or hae:HEIGHT (above the ellipsoid), or dem:FILE (an elevation model or a folder of them).",
        ),
        Key::new(
            "geoid",
            ValueType::Text,
            Requirement::Optional("\"43\""),
            "What lies between the ellipsoid and the level above which an elevation model states its heights: metres, or a file of undulations.",
        ),
        Key::new(
            "troposphere",
            ValueType::Text,
            Requirement::Default("\"none\""),
            "The air's delay that is taken away: none, exponential, or exponential:N with N parts in a million at sea level.",
        ),
    ],
};

static FORMER: Section = Section {
    path: "former",
    presence: Presence::Always,
    when: &[],
    selector: "algorithm",
    doc: "How the image is formed.",
    keys: &[
        Key::new(
            "algorithm",
            ValueType::Choice(&[
                "auto", "exact", "bp", "rdbp", "ffbp", "pfa", "omega-k", "rda",
            ]),
            Requirement::Default("\"auto\""),
            "The image former.",
        ),
        Key::new(
            "error",
            BOUND,
            Requirement::Optional("\"-60 dB\""),
            "Bound on the relative RMS error against the exact sum. Left out, -60 dB, and none of the thesis's mode.",
        )
        .when(&["auto", "bp", "rdbp", "ffbp", "pfa", "omega-k", "rda"]),
        Key::new(
            "allow_error",
            ValueType::Flag,
            Requirement::Default("false"),
            "Whether an image is kept whose predicted error is above the bound.",
        ),
        Key::new(
            "window",
            ValueType::Text,
            Requirement::Default("\"taylor:35\""),
            "Window over fast time: none, taylor, taylor:DB, hamming or kaiser:BETA.",
        ),
        Key::new(
            "slow_window",
            ValueType::Text,
            Requirement::Default("\"taylor:35\""),
            "Window over slow time, across all pulses.",
        ),
        Key::new(
            "beam",
            ValueType::Text,
            Requirement::Optional("\"2 deg\""),
            "Width of the antenna's beam along the track: each place is formed of the pulses that see it. auto estimates it, none takes all pulses for \
             all pixels. Left out, what the recording states or its Doppler spectrum clearly shows.",
        ),
        Key::new(
            "squint",
            ValueType::Quantity(Dimension::Angle, Bounds::Any),
            Requirement::Optional("\"-1.5 deg\""),
            "How far forward of broadside the middle of the beam looks.",
        ),
        Key::new(
            "velocity",
            ValueType::Vector(Dimension::Speed),
            Requirement::Optional("\"3, -2, 0 m/s\""),
            "Focus what moves so; pixels are places at the first pulse.",
        ),
        Key::new(
            "portable",
            ValueType::Flag,
            Requirement::Default("false"),
            "Whether the same bits are formed on every machine; transforms then take two to four times as long.",
        ),
        Key::new(
            "scratch",
            ValueType::Text,
            Requirement::Optional("\"48M\""),
            "Memory for tables and one thread's buffers, on which bits depend.",
        ),
        Key::new(
            "sub_cpi",
            SOME,
            Requirement::Optional("40"),
            "Pulses a sub-CPI. Left out, the most that the bound allows.",
        )
        .when(&["rdbp"]),
        Key::new(
            "patch",
            ValueType::Quantity(Dimension::Length, Bounds::Positive),
            Requirement::Optional("\"8 m\""),
            "Side of patches. Left out, from the bound.",
        )
        .when(&["rdbp"]),
        Key::new(
            "mode",
            ValueType::Choice(&["precise", "thesis"]),
            Requirement::Optional("\"precise\""),
            "How range-Doppler maps are made and read.",
        )
        .when(&["rdbp"]),
        Key::new(
            "no_keystone",
            ValueType::Flag,
            Requirement::Optional("false"),
            "Whether the thesis mode's Keystone is left out.",
        )
        .when(&["rdbp"]),
        Key::new(
            "no_src",
            ValueType::Flag,
            Requirement::Optional("false"),
            "Whether secondary range compression is left out.",
        )
        .when(&["rda"]),
    ],
};

static CHECK: Section = Section {
    path: "check",
    presence: Presence::Always,
    when: &[],
    selector: "",
    doc: "The image's error, against the exact sum.",
    keys: &[Key::new(
        "pixels",
        ValueType::Count(0, 1_000_000),
        Requirement::Default("64"),
        "Pixels, chosen by a fixed seed, that are formed by the exact sum too; 0 for none.",
    )],
};

static PICTURE: Section = Section {
    path: "picture",
    presence: Presence::Always,
    when: &[],
    selector: "",
    doc: "The report's picture of the image.",
    keys: &[
        Key::new(
            "remap",
            ValueType::Choice(&["db", "density"]),
            Requirement::Default("\"db\""),
            "How levels become greys: decibels from top down to 6 dB below the median, or about the mean magnitude, as sarpy's Density.",
        ),
        Key::new(
            "top",
            LEVEL,
            Requirement::Optional("\"-10 dB\""),
            "Upper level, of decibels. Left out, the level that 0.1 % of the pixels exceed, at most 12 dB below the peak.",
        ),
        Key::new(
            "span",
            SPAN,
            Requirement::Optional("\"50 dB\""),
            "Levels from the brightest to the darkest colour, of decibels. Left out, 40 to 60 dB.",
        ),
        Key::new(
            "colours",
            ValueType::Choice(&["grey", "viridis"]),
            Requirement::Default("\"grey\""),
            "Colours: black to white, or dark blue over green to yellow.",
        ),
    ],
};

static QUALITY: Section = Section {
    path: "quality",
    presence: Presence::Always,
    when: &[],
    selector: "",
    doc: "Which points are measured, and the image as a whole.",
    keys: &[
        Key::new(
            "points",
            ValueType::Count(0, 64),
            Requirement::Default("5"),
            "So many of the strongest points, apart from each other's side lobes; 0 for none.",
        ),
        Key::new(
            "at",
            ValueType::Rows(&[Dimension::Length, Dimension::Length], 1),
            Requirement::Optional("[\"10.5, -3 m\"]"),
            "Points in place of the strongest: x and y in the scene frame, the brightest pixel within 4.",
        ),
    ],
};

static PRODUCTS: Section = Section {
    path: "products",
    presence: Presence::Always,
    when: &[],
    selector: "",
    doc: "What is made of the image for other programs.",
    keys: &[
        Key::new(
            "formats",
            ValueType::Choices(&["sicd", "sidd", "cog", "kmz", "png", "zarr"]),
            Requirement::Optional("[\"sicd\", \"cog\"]"),
            "SICD and SIDD in NITF, a cloud-optimised GeoTIFF, an overlay for Google Earth, a picture with a world file, a stack in Zarr.",
        ),
        Key::new(
            "place",
            ValueType::Text,
            Requirement::Optional("\"39.78, -84.08, 230\""),
            "Where on the Earth the scene's origin is, in place of what the recording says: degrees north and east, metres above the WGS 84 \
             ellipsoid (x is then east and y north).",
        ),
    ],
};

/// Every key.
pub(super) static SCHEMA: Schema = Schema {
    sections: &[
        &TOP, &INPUT, &TRACK, &AUTOFOCUS, &GRID, &FORMER, &CHECK, &PICTURE, &QUALITY, &PRODUCTS,
    ],
    introduction: "A job: recordings, how they are focused, and what is made of the image.",
};

#[cfg(test)]
mod tests {
    use subaperture_focus::formers::FORMERS;

    use super::*;

    /// Keys whose names differ from the options'.
    const RENAMED: [(&str, &str); 1] = [("error_db", "error")];

    #[test]
    fn formers_and_all_their_options_can_be_asked_for() {
        let ValueType::Choice(names) = FORMER.key("algorithm").unwrap().kind else {
            panic!("not a choice");
        };
        for entry in &FORMERS {
            assert!(names.contains(&entry.name), "{}", entry.name);
            for option in entry.options {
                let renamed = RENAMED.iter().find(|(name, _)| *name == option.name);
                let name = renamed.map_or(option.name, |(_, key)| key);
                let key = FORMER.key(name).unwrap_or_else(|| panic!("no key {name}"));
                let takes = key.when.is_empty() || key.when.contains(&entry.name);
                assert!(takes, "{name} of {}", entry.name);
            }
        }
        assert_eq!(names.len(), FORMERS.len());
    }
}
