//! Sections of the scene of a scenario.

use std::path::PathBuf;

use glam::DVec3;
use subaperture_describe::declare::{Located, section};
use subaperture_describe::error::Location;
use subaperture_describe::place::OriginKeys;
use subaperture_describe::track::{At, TurnKeys};

use crate::scene::{Cover, MAX_SPREAD_M_S, Polarisation};

/// Position, extent and reference of the scene.
#[section]
pub(super) struct SceneKeys {
    /// Motion compensation reference point, also for amplitudes: with isotropic antennas, 1 m^2 has amplitude 1 in an image; with spreading
    /// loss, at this point only. Default: the scene's origin, unless reference_range is given.
    #[key(example = "0, 0, 0 m")]
    pub(super) reference_m: Option<DVec3>,
    /// Alternative to a reference point: a constant range from the radar for all pulses, as with a receiver with one range gate.
    #[key(example = "5 km", positive)]
    pub(super) reference_range_m: Option<Located<f64>>,
    /// Extent of the scene in x, for default image grids. Give x and y, or neither.
    #[key(example = "-50, 50 m")]
    pub(super) x_m: Option<Located<(f64, f64)>>,
    /// Extent of the scene in y.
    #[key(example = "-50, 50 m")]
    pub(super) y_m: Option<Located<(f64, f64)>>,
    #[section]
    pub(super) origin: OriginKeys,
    #[section]
    pub(super) terrain: TerrainKeys,
    #[section]
    pub(super) point: Vec<PointKeys>,
    #[section]
    pub(super) corner: Vec<CornerKeys>,
    #[section]
    pub(super) clutter: Vec<ClutterKeys>,
    #[section]
    pub(super) picture: Vec<PictureKeys>,
    #[section]
    pub(super) building: Vec<BuildingKeys>,
    #[section]
    pub(super) vehicle: Vec<VehicleKeys>,
    #[section]
    pub(super) tree: Vec<TreeKeys>,
    #[section]
    pub(super) mover: Vec<MoverKeys>,
}

/// Terrain: heights of the ground. The heights of clutter, pictures, buildings, vehicles and trees are above it, and it casts shadows. Points,
/// corner reflectors and movers keep their heights. Without heights the ground is the plane z = 0.
#[section]
pub(super) struct TerrainKeys {
    #[at]
    pub(super) header: Location,
    /// Sum of functions, or a file to which hills and ridges are added.
    #[key(default = "function", select(Function, File))]
    pub(super) kind: TerrainSource,
    /// Extent in x; default: that of the scene. The height of the edge continues beyond it.
    #[key(example = "-200, 200 m")]
    pub(super) x_m: Option<Located<(f64, f64)>>,
    /// Extent in y; default: that of the scene.
    #[key(example = "-200, 200 m")]
    pub(super) y_m: Option<Located<(f64, f64)>>,
    /// Distance of the nodes, bilinear in between; greater where more than 262144 nodes would be needed.
    #[key(default = "1 m", positive)]
    pub(super) spacing_m: Located<f64>,
    /// Elevation model (HGT, GeoTIFF, or a folder of them), which needs the latitude and longitude of [scene.origin]; or a NumPy array of
    /// heights in metres over the extent, row 0 with the smallest y.
    #[key(required = "heights.npy", when(File))]
    pub(super) file: Located<PathBuf>,
    /// Height of the geoid above the ellipsoid, added to the heights of an elevation model: in metres, or a raster.
    #[key(example = "47.2", when(File))]
    pub(super) geoid: Option<Located<PathBuf>>,
    /// Slope along x, rise over distance.
    #[key(default = 0, when(Function))]
    pub(super) slope_x: f64,
    /// Slope along y.
    #[key(default = 0, when(Function))]
    pub(super) slope_y: f64,
    /// RMS of random Gaussian relief.
    #[key(default = "0 m", not_negative, when(Function))]
    pub(super) rms_m: f64,
    /// Correlation length of the random relief: heights at the distance d have the correlation exp(-d^2 / correlation^2).
    #[key(default = "50 m", positive, when(Function))]
    pub(super) correlation_m: f64,
    #[section]
    pub(super) hill: Vec<HillKeys>,
    #[section]
    pub(super) ridge: Vec<RidgeKeys>,
}

/// Hill of Gaussian shape on the terrain.
#[section]
pub(super) struct HillKeys {
    /// Position of the summit; z is its height above the surrounding ground, negative for a hollow.
    #[key(required = "20, 10, 8 m")]
    pub(super) summit_m: DVec3,
    /// Radius at which the height has fallen to exp(-1/2).
    #[key(required = "30 m", positive)]
    pub(super) radius_m: f64,
}

/// Parallel ridges of sinusoidal section on the terrain.
#[section]
pub(super) struct RidgeKeys {
    /// Direction across the ridges, from x towards y.
    #[key(default = "90 deg")]
    pub(super) direction_rad: f64,
    /// Distance of a crest from the origin along the direction.
    #[key(default = "0 m")]
    pub(super) crest_m: f64,
    /// Distance between crests.
    #[key(required = "100 m", positive)]
    pub(super) wavelength_m: f64,
    /// Height of the crests above the mean.
    #[key(required = "4 m")]
    pub(super) height_m: f64,
}

/// Strength of a reflection.
#[section]
pub(super) struct ReflectionKeys {
    /// Radar cross section.
    #[key(default = "1 m^2", not_negative)]
    pub(super) cross_section_m2: f64,
    /// Phase of the reflection.
    #[key(default = "0 deg")]
    pub(super) phase_rad: f64,
}

/// Isotropic point scatterer.
#[section]
pub(super) struct PointKeys {
    /// Position in the scene frame.
    #[key(required = "10, 5, 0 m")]
    pub(super) position_m: DVec3,
    #[keys]
    pub(super) reflection: ReflectionKeys,
}

/// Triangular trihedral corner reflector.
#[section]
pub(super) struct CornerKeys {
    /// Position in the scene frame.
    #[key(required = "10, 5, 0 m")]
    pub(super) position_m: DVec3,
    /// Boresight direction in scene axes.
    #[key(required = "0, -1, 0.6")]
    pub(super) boresight: Located<DVec3>,
    /// Length of an inner edge.
    #[key(required = "30 cm", positive)]
    pub(super) edge_m: f64,
}

/// Extent of an area.
#[section]
pub(super) struct ExtentKeys {
    /// Extent in x.
    #[key(required = "-20, 20 m")]
    pub(super) x_m: (f64, f64),
    /// Extent in y.
    #[key(required = "-20, 20 m")]
    pub(super) y_m: (f64, f64),
}

/// Ground clutter: many weak points on the ground.
#[section]
pub(super) struct ClutterKeys {
    /// Shape of the area.
    #[key(default = "rectangle", select(Rectangle, Disc))]
    pub(super) kind: AreaKeys,
    #[keys(when(Rectangle))]
    pub(super) extent: ExtentKeys,
    /// Centre of the disc; z is its height above the ground.
    #[key(required = "0, 0, 0 m", when(Disc))]
    pub(super) centre_m: DVec3,
    /// Radius of the disc.
    #[key(required = "20 m", positive, when(Disc))]
    pub(super) radius_m: f64,
    /// Height above the ground.
    #[key(default = "0 m", when(Rectangle))]
    pub(super) height_m: f64,
    /// Points per square metre; ten per resolution cell give speckle. Give either this or count.
    #[key(example = 1, positive)]
    pub(super) density: Located<Option<f64>>,
    /// Total number of points. Give either this or density.
    #[key(example = 1000, whole(1, 1 << 26))]
    pub(super) count: Option<Located<usize>>,
    /// Mean radar cross section per square metre (sigma nought), the same at all angles. Give this, gamma or cover.
    #[key(example = "-20 dB", within(-300.0, 300.0, "-300 to 300 dB"))]
    pub(super) sigma0_db: Located<Option<f64>>,
    /// Mean radar cross section per square metre over the cosine of the angle of incidence on the ground, at the middle of the collection.
    #[key(example = "-15 dB", within(-300.0, 300.0, "-300 to 300 dB"))]
    pub(super) gamma_db: Option<Located<f64>>,
    /// Class of land cover, with a mean by the angle of incidence at the middle of the collection and by the centre frequency. From 1 to 8 GHz, grass to
    /// 12 GHz (Ulaby and Dobson 1989): soil, grass, short-vegetation, shrubs, dry-snow, wet-snow. By gamma: flatland, farmland, woods,
    /// wooded-hills, mountains, metropolitan.
    #[key(example = "farmland")]
    pub(super) cover: Option<Located<Cover>>,
    /// Polarisations of transmission and reception, for the means of land cover.
    #[key(default = "hh")]
    pub(super) polarisation: Polarisation,
    /// Order (shape) of gamma-distributed texture, for K-distributed amplitudes: the intensity of a pixel has the moments
    /// mean(I^2) / mean(I)^2 = 2 (1 + 1 / texture_shape). Default: none, Gaussian amplitudes.
    #[key(example = 2, within(0.05, 1000.0, "0.05 to 1000"))]
    pub(super) texture_shape: Option<Located<f64>>,
    /// Correlation length of the texture. Five resolution cells or more keep it constant over a cell.
    #[key(default = "10 m", positive)]
    pub(super) texture_length_m: f64,
    /// Map of classes over the area, a greyscale PNG file or a NumPy array: points lie only where its value is map_value. Density and count are
    /// those of the whole area.
    #[key(example = "cover.png")]
    pub(super) map: Option<Located<PathBuf>>,
    /// Value of the class in the map: grey level or number.
    #[key(default = 0, whole(0, 65535))]
    pub(super) map_value: usize,
    /// Internal clutter motion, as by wind: standard deviation of the radial velocity of the points, Gaussian. Each point has a constant
    /// velocity; positions are those at the middle of the collection. Echoes at a lag tau have the correlation
    /// exp(-8 pi^2 velocity_spread^2 tau^2 / wavelength^2). Give many points per resolution cell: the residue of few after cancellation is
    /// not Gaussian.
    #[key(default = "0 m/s", within(0.0, MAX_SPREAD_M_S, "0 to 100 m/s"))]
    pub(super) velocity_spread_m_s: Located<f64>,
}

/// Picture on a horizontal plane, with brightness proportional to amplitude.
#[section]
pub(super) struct PictureKeys {
    /// Greyscale PNG with 8 or 16 bits, or NumPy array of real numbers.
    #[key(required = "picture.png")]
    pub(super) file: Located<PathBuf>,
    #[keys]
    pub(super) extent: ExtentKeys,
    /// Height above the ground.
    #[key(default = "0 m")]
    pub(super) height_m: f64,
    /// Spacing of the points.
    #[key(required = "2 m", positive)]
    pub(super) spacing_m: Located<f64>,
    /// Radar cross section per square metre of white pixels.
    #[key(required = "0 dB", within(-300.0, 300.0, "-300 to 300 dB"))]
    pub(super) sigma0_db: f64,
    /// Use complex Gaussian amplitudes (speckle), as of rough ground.
    #[key(default = true)]
    pub(super) speckle: bool,
}

/// Building: an upright box with reflecting walls, roof edges and foot, which occludes objects behind it.
#[section]
pub(super) struct BuildingKeys {
    /// Centre of the ground plan, at the foot; z is above the ground.
    #[key(required = "10, 5, 0 m")]
    pub(super) position_m: DVec3,
    /// Length, width and height.
    #[key(required = "12, 8, 6 m")]
    pub(super) size_m: Located<DVec3>,
    /// Angle from the scene's x axis to the length of the building, towards y.
    #[key(default = "0 deg")]
    pub(super) yaw_rad: f64,
    /// Spacing of the points.
    #[key(required = "2 m", positive)]
    pub(super) spacing_m: f64,
    /// Mean radar cross section per square metre of wall.
    #[key(default = "-10 dB", within(-300.0, 300.0, "-300 to 300 dB"))]
    pub(super) wall_db: f64,
    /// Radar cross section per metre of roof edge.
    #[key(default = "-10 dB", within(-300.0, 300.0, "-300 to 300 dB"))]
    pub(super) edge_db: f64,
    /// Radar cross section per metre of foot, where wall and ground form a dihedral.
    #[key(default = "0 dB", within(-300.0, 300.0, "-300 to 300 dB"))]
    pub(super) foot_db: f64,
    /// Mean radar cross section per square metre of the flat roof. Default: a roof without points.
    #[key(example = "-15 dB", within(-300.0, 300.0, "-300 to 300 dB"))]
    pub(super) roof_db: Option<f64>,
}

/// Vehicle: an opaque box with plates that flash broadside, wheel wells and corners of the roof. It may move along its heading.
#[section]
pub(super) struct VehicleKeys {
    /// Middle of the ground plan, at the middle of the collection; z is above the ground there.
    #[key(required = "10, 5, 0 m")]
    pub(super) position_m: DVec3,
    /// Angle from the scene's x axis to the length of the vehicle, towards y.
    #[key(default = "0 deg")]
    pub(super) heading_rad: f64,
    /// Length, width and height.
    #[key(default = "4.4, 1.8, 1.5 m")]
    pub(super) size_m: Located<DVec3>,
    /// Speed along the heading, at constant height.
    #[key(default = "0 m/s")]
    pub(super) speed_m_s: f64,
    /// Sum of the radar cross sections of all parts, averaged over the azimuth, without occlusion.
    #[key(default = "10 m^2", not_negative)]
    pub(super) cross_section_m2: f64,
    /// Half-power width of the flashes of the plates.
    #[key(default = "10 deg", within(1e-3, 1.047, "0.001 rad to 60 deg"))]
    pub(super) flash_rad: Located<f64>,
}

/// Tree, or stand of equal trees at random places: trunk with the ground, and a crown that attenuates.
#[section]
pub(super) struct TreeKeys {
    /// One tree, or a stand in a rectangle.
    #[key(default = "single", select(Single, Stand))]
    pub(super) kind: TreePlaces,
    /// Foot; z is above the ground.
    #[key(required = "10, 5, 0 m", when(Single))]
    pub(super) position_m: DVec3,
    #[keys(when(Stand))]
    pub(super) extent: ExtentKeys,
    /// Number of trees.
    #[key(required = 10, whole(1, 1_000_000), when(Stand))]
    pub(super) trees: usize,
    /// Height of the top above the foot.
    #[key(default = "8 m", positive)]
    pub(super) height_m: Located<f64>,
    /// Height of the lower end of the crown above the foot.
    #[key(default = "2 m", not_negative)]
    pub(super) crown_base_m: f64,
    /// Radius of the crown.
    #[key(default = "2 m", positive)]
    pub(super) crown_radius_m: f64,
    /// Sum of the radar cross sections of all points of a tree, without attenuation.
    #[key(default = "5 m^2", not_negative)]
    pub(super) cross_section_m2: f64,
    /// Share of the trunk, with the ground, in the cross section.
    #[key(default = 0.2, within(0.0, 1.0, "0 to 1"))]
    pub(super) trunk_share: f64,
    /// Points of the crown.
    #[key(default = 60, whole(1, 100_000))]
    pub(super) points: usize,
    /// One-way attenuation of the crown per metre.
    #[key(default = "0 dB", within(0.0, 100.0, "0 to 100 dB"))]
    pub(super) attenuation_db: f64,
}

/// Moving point target.
#[section]
pub(super) struct MoverKeys {
    /// Straight line, horizontal circle, straight segments between timed waypoints, or segments of constant acceleration.
    #[key(required = "linear", select(Linear, Circular, Waypoints, Profile))]
    pub(super) kind: MoverMotion,
    /// Position at the time given by 'at'.
    #[key(required = "10, 5, 0 m", when(Linear, Profile))]
    pub(super) position_m: DVec3,
    /// Velocity at the position; for a profile, before its first segment.
    #[key(required = "0, 8, 0 m/s", when(Linear, Profile))]
    pub(super) velocity_m_s: DVec3,
    /// Time of the position: time 0, or the middle of the collection.
    #[key(default = "middle", when(Linear, Circular))]
    pub(super) at: At,
    /// Centre of the circle, at the height of the track.
    #[key(required = "0, 0, 3 km", when(Circular))]
    pub(super) centre_m: DVec3,
    /// Radius of the circle, or length of the arm.
    #[key(required = "20 m", positive, when(Circular))]
    pub(super) radius_m: f64,
    /// Speed along the track.
    #[key(required = "5 m/s", positive, when(Circular))]
    pub(super) speed_m_s: f64,
    #[keys(when(Circular))]
    pub(super) turn: TurnKeys,
    /// Times and positions, connected by straight segments, or by a smooth curve for a spline.
    #[key(
        required = ["0 s, -3, -5000, 3000 m", "60 ms, 3, -5000, 3000 m"],
        rows(2, Time, Length, Length, Length),
        when(Waypoints)
    )]
    pub(super) points: Located<Vec<[f64; 4]>>,
    /// Start time.
    #[key(default = "0 s", when(Profile))]
    pub(super) start_s: f64,
    /// Durations and accelerations of consecutive segments from 'start' on, beginning at 'position' with 'velocity'.
    #[key(
        required = ["20 ms, 0, 2, 0 m/s^2", "20 ms, 0, -2, 0 m/s^2"],
        rows(1, Time, Acceleration, Acceleration, Acceleration),
        when(Profile)
    )]
    pub(super) pieces: Located<Vec<[f64; 4]>>,
    #[keys]
    pub(super) reflection: ReflectionKeys,
}
