//! Land cover: mean backscatter of the ground against the angle of incidence.
//!
//! The mean radar cross section per square metre of ground, `sigma0`, at the angle of incidence `theta` from the normal of the ground:
//!
//! | model | `sigma0` | source |
//! |---|---|---|
//! | [`Backscatter::Constant`] | constant | |
//! | [`Backscatter::Gamma`] | `gamma cos theta` | Long, "Radar Reflectivity of Land and Sea", 3rd ed., 2001 |
//! | [`Backscatter::Fit`] | `P1 + P2 exp(-P3 theta) + P4 cos(P5 theta + P6)`, dB, theta in radians | Ulaby and Dobson, "Handbook of Radar Scattering Statistics for Terrain", 1989 |
//!
//! **Classes by gamma** ([`Cover::Flatland`] to [`Cover::Metropolitan`]), at 10 GHz, and 5 dB more per decade of frequency: flatland -20 dB, farmland
//! -15 dB, wooded hills -10 dB (Nathanson, Reilly and Cohen, "Radar Design Principles", 2nd ed., 1999); woods -15 dB, mountains and metropolitan areas
//! 0 dB (Long 2001).
//!
//! **Classes of the handbook** ([`Cover::Soil`] to [`Cover::WetSnow`]): fits to measured means at L (1 to 2 GHz), S (2 to 4 GHz) and C band
//! (4 to 8 GHz) for HH, HV and VV, and of grass at X band (8 to 12 GHz) for HH. The coefficients are those of two open programs that use the
//! fits; they were not compared with the printed tables. Sets that give impossible levels there are left out: soil at L band, HH, and shrubs at S
//! band. The handbook's angles end at 70 degrees from the normal; beyond, the level of 70 degrees falls as `cos theta`.
//!
//! Ground beyond 90 degrees, on slopes away from the radar, has no backscatter.

use std::f64::consts::{FRAC_PI_2, PI};

use subaperture_describe::declare::Choice;
use subaperture_model::quantity::hertz;
use subaperture_model::units::power_of_db;

use super::SceneError;

/// Largest angle of the handbook's data, radians.
const MEASURED_RAD: f64 = 70.0 / 180.0 * PI;

/// Class of land cover.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Choice)]
pub enum Cover {
    /// Soil and rock, from the handbook.
    Soil,
    /// Grass, from the handbook.
    Grass,
    /// Short vegetation: crops and meadows.
    ShortVegetation,
    /// Shrubs, from the handbook.
    Shrubs,
    /// Dry snow, from the handbook.
    DrySnow,
    /// Wet snow, from the handbook.
    WetSnow,
    /// Flat land without vegetation, by constant gamma.
    Flatland,
    /// Farmland, by constant gamma.
    Farmland,
    /// Woods, by constant gamma.
    Woods,
    /// Wooded hills, by constant gamma.
    WoodedHills,
    /// Mountains, by constant gamma.
    Mountains,
    /// City, by constant gamma.
    Metropolitan,
}

/// Polarisations of transmission and reception.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Choice)]
pub enum Polarisation {
    /// Horizontal for transmission and reception.
    #[default]
    Hh,
    /// Horizontal for one, vertical for the other.
    Hv,
    /// Vertical for transmission and reception.
    Vv,
}

/// Mean cross section per square metre of ground against the angle of incidence.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Backscatter {
    /// Independent of the angle, dB.
    Constant(f64),
    /// Gamma, dB: proportional to the cosine of the angle of incidence.
    Gamma(f64),
    /// Parameters P1 to P6 of the handbook's fit: dB, dB, 1/rad, dB, 1 and rad.
    Fit([f64; 6]),
}

impl Backscatter {
    /// Whether all parameters are finite.
    pub fn is_finite(&self) -> bool {
        match self {
            Self::Constant(db) | Self::Gamma(db) => db.is_finite(),
            Self::Fit(p) => p.iter().all(|p| p.is_finite()),
        }
    }

    /// Mean cross section per square metre of ground, m²/m², at an angle of incidence, radians; 0 from behind.
    pub fn sigma0(&self, incidence_rad: f64) -> f64 {
        if let Self::Constant(db) = self {
            return power_of_db(*db);
        }
        if incidence_rad >= FRAC_PI_2 {
            return 0.0;
        }
        let cosine = libm::cos(incidence_rad);
        match self {
            Self::Constant(db) => power_of_db(*db),
            Self::Gamma(db) => power_of_db(*db) * cosine,
            Self::Fit(p) => {
                let theta = incidence_rad.min(MEASURED_RAD);
                let db =
                    p[0] + p[1] * libm::exp(-p[2] * theta) + p[3] * libm::cos(p[4] * theta + p[5]);
                power_of_db(db) * (cosine / libm::cos(MEASURED_RAD)).min(1.0)
            }
        }
    }
}

impl Cover {
    /// Backscatter of the class at the radar's centre frequency.
    ///
    /// # Errors
    /// [`SceneError`] if the class has no data for this band and polarisation.
    pub fn backscatter(
        self,
        centre_hz: f64,
        polarisation: Polarisation,
    ) -> Result<Backscatter, SceneError> {
        if let Some(db) = self.gamma_db() {
            return Ok(Backscatter::Gamma(db + 5.0 * libm::log10(centre_hz / 10e9)));
        }
        let band = BANDS
            .iter()
            .position(|[from_hz, to_hz]| (*from_hz..*to_hz).contains(&centre_hz));
        let found = band.and_then(|band| {
            let sets = FITS.iter();
            let mut own = sets.filter(|fit| fit.cover == self && fit.band == band);
            own.find(|fit| fit.polarisation == polarisation)
        });
        found.map(|fit| Backscatter::Fit(fit.parameters)).ok_or_else(|| {
            SceneError(format!(
                "the table of mean backscatter has no values of {self:?} at {} for {polarisation:?}: expected a centre frequency of 1 to 8 GHz (of \
                 grass to 12 GHz for Hh; of soil from 2 GHz for Hh; of shrubs none from 2 to 4 GHz); choose a class by gamma (flatland, farmland, woods, \
                 wooded-hills, mountains, metropolitan), or give gamma or sigma0",
                hertz(centre_hz)
            ))
        })
    }

    /// Gamma at 10 GHz, dB, of classes by constant gamma.
    fn gamma_db(self) -> Option<f64> {
        match self {
            Self::Flatland => Some(-20.0),
            Self::Farmland | Self::Woods => Some(-15.0),
            Self::WoodedHills => Some(-10.0),
            Self::Mountains | Self::Metropolitan => Some(0.0),
            _ => None,
        }
    }
}

/// First and last frequencies of L, S, C and X band, hertz.
const BANDS: [[f64; 2]; 4] = [[1e9, 2e9], [2e9, 4e9], [4e9, 8e9], [8e9, 12e9]];

/// Fit of one class, band and polarisation.
struct Fit {
    cover: Cover,
    /// Index of the band into [`BANDS`].
    band: usize,
    polarisation: Polarisation,
    parameters: [f64; 6],
}

/// Parameters of the fits; phases of 3.142 are pi.
const FITS: [Fit; 51] = [
    fit(
        Cover::Soil,
        0,
        Polarisation::Hv,
        [-30.2, 15.261, 3.56, -0.424, 0.0, 0.0],
    ),
    fit(
        Cover::Soil,
        0,
        Polarisation::Vv,
        [-94.36, 99.0, 0.365, -3.398, 5.0, -1.739],
    ),
    fit(
        Cover::Soil,
        1,
        Polarisation::Hh,
        [-91.2, 99.0, 0.433, 5.063, 2.941, -PI],
    ),
    fit(
        Cover::Soil,
        1,
        Polarisation::Hv,
        [-46.467, 31.788, 2.189, -17.99, 1.34, 1.583],
    ),
    fit(
        Cover::Soil,
        1,
        Polarisation::Vv,
        [-97.016, 99.0, 0.27, -2.056, 5.0, -1.754],
    ),
    fit(
        Cover::Soil,
        2,
        Polarisation::Hh,
        [-24.855, 26.351, 1.146, 0.204, 0.0, 0.0],
    ),
    fit(
        Cover::Soil,
        2,
        Polarisation::Hv,
        [-26.7, 15.055, 1.816, -0.499, 0.0, 0.0],
    ),
    fit(
        Cover::Soil,
        2,
        Polarisation::Vv,
        [-24.951, 28.742, 1.043, -1.681, 0.0, 0.0],
    ),
    fit(
        Cover::Grass,
        0,
        Polarisation::Hh,
        [-29.325, 37.55, 2.332, -2.615, 5.0, -1.616],
    ),
    fit(
        Cover::Grass,
        0,
        Polarisation::Hv,
        [-40.166, 26.833, 2.029, -1.473, 3.738, -1.324],
    ),
    fit(
        Cover::Grass,
        0,
        Polarisation::Vv,
        [-28.022, 36.59, 2.53, -1.53, 5.0, -1.513],
    ),
    fit(
        Cover::Grass,
        1,
        Polarisation::Hh,
        [-20.361, 25.727, 2.979, -1.13, 5.0, -1.916],
    ),
    fit(
        Cover::Grass,
        1,
        Polarisation::Hv,
        [-29.035, 18.055, 2.8, -1.556, 4.554, -0.464],
    ),
    fit(
        Cover::Grass,
        1,
        Polarisation::Vv,
        [-21.198, 26.694, 2.828, -0.612, 5.0, -2.079],
    ),
    fit(
        Cover::Grass,
        2,
        Polarisation::Hh,
        [-15.75, 17.931, 2.369, -1.502, 4.592, -PI],
    ),
    fit(
        Cover::Grass,
        2,
        Polarisation::Hv,
        [-23.109, 13.591, 1.508, -0.757, 4.491, -PI],
    ),
    fit(
        Cover::Grass,
        2,
        Polarisation::Vv,
        [-93.606, 99.0, 0.22, -5.509, -2.964, 1.287],
    ),
    fit(
        Cover::Grass,
        3,
        Polarisation::Hh,
        [-33.288, 32.98, 0.51, -1.343, 4.874, -PI],
    ),
    fit(
        Cover::ShortVegetation,
        0,
        Polarisation::Hh,
        [-27.265, 32.39, 2.133, 1.438, -3.847, PI],
    ),
    fit(
        Cover::ShortVegetation,
        0,
        Polarisation::Hv,
        [-41.6, 22.872, 0.689, -1.238, 0.0, 0.0],
    ),
    fit(
        Cover::ShortVegetation,
        0,
        Polarisation::Vv,
        [-24.614, 27.398, 2.265, -1.08, 5.0, -1.999],
    ),
    fit(
        Cover::ShortVegetation,
        1,
        Polarisation::Hh,
        [-20.779, 21.867, 2.434, 0.347, -0.013, -0.393],
    ),
    fit(
        Cover::ShortVegetation,
        1,
        Polarisation::Hv,
        [-99.0, 85.852, 0.179, 3.687, 2.121, -PI],
    ),
    fit(
        Cover::ShortVegetation,
        1,
        Polarisation::Vv,
        [-20.367, 21.499, 2.151, -1.069, 5.0, -1.95],
    ),
    fit(
        Cover::ShortVegetation,
        2,
        Polarisation::Hh,
        [-87.727, 99.0, 0.322, 10.188, -1.747, 3.143],
    ),
    fit(
        Cover::ShortVegetation,
        2,
        Polarisation::Hv,
        [-99.0, 93.293, 0.181, 5.359, 1.948, -PI],
    ),
    fit(
        Cover::ShortVegetation,
        2,
        Polarisation::Vv,
        [-88.593, 99.0, 0.326, 9.574, 1.969, -PI],
    ),
    fit(
        Cover::Shrubs,
        0,
        Polarisation::Hh,
        [-26.688, 29.454, 1.814, 0.873, 4.135, -PI],
    ),
    fit(
        Cover::Shrubs,
        0,
        Polarisation::Hv,
        [-99.0, 99.0, 0.086, -21.298, 0.0, 0.0],
    ),
    fit(
        Cover::Shrubs,
        0,
        Polarisation::Vv,
        [-81.371, 99.0, 0.567, 16.2, -1.948, PI],
    ),
    fit(
        Cover::Shrubs,
        2,
        Polarisation::Hh,
        [-91.95, 99.0, 0.27, 6.98, 1.922, -PI],
    ),
    fit(
        Cover::Shrubs,
        2,
        Polarisation::Hv,
        [-99.0, 91.003, 0.156, 3.948, 2.239, -PI],
    ),
    fit(
        Cover::Shrubs,
        2,
        Polarisation::Vv,
        [-91.133, 99.0, 0.294, 8.107, 2.112, -PI],
    ),
    fit(
        Cover::DrySnow,
        0,
        Polarisation::Hh,
        [-74.019, 99.0, 1.592, -30.0, 1.928, 0.905],
    ),
    fit(
        Cover::DrySnow,
        0,
        Polarisation::Hv,
        [-91.341, 99.0, 1.202, 30.0, 1.79, -2.304],
    ),
    fit(
        Cover::DrySnow,
        0,
        Polarisation::Vv,
        [-77.032, 99.0, 1.415, -30.0, 1.72, 0.997],
    ),
    fit(
        Cover::DrySnow,
        1,
        Polarisation::Hh,
        [-47.055, 30.164, 5.788, 30.0, 1.188, -0.629],
    ),
    fit(
        Cover::DrySnow,
        1,
        Polarisation::Hv,
        [-54.29, 13.292, 10.0, -30.0, -0.715, PI],
    ),
    fit(
        Cover::DrySnow,
        1,
        Polarisation::Vv,
        [-40.652, 18.826, 9.211, 30.0, 0.69, 0.214],
    ),
    fit(
        Cover::DrySnow,
        2,
        Polarisation::Hh,
        [-42.864, 20.762, 10.0, 30.0, 0.763, -0.147],
    ),
    fit(
        Cover::DrySnow,
        2,
        Polarisation::Hv,
        [-25.543, 16.64, 10.0, -2.959, 3.116, 2.085],
    ),
    fit(
        Cover::DrySnow,
        2,
        Polarisation::Vv,
        [-19.765, 19.83, 10.0, 7.089, 1.54, -0.012],
    ),
    fit(
        Cover::WetSnow,
        0,
        Polarisation::Hh,
        [-73.069, 95.221, 1.548, 30.0, 1.795, -2.126],
    ),
    fit(
        Cover::WetSnow,
        0,
        Polarisation::Hv,
        [-90.98, 99.0, 1.129, 30.0, 1.827, -2.308],
    ),
    fit(
        Cover::WetSnow,
        0,
        Polarisation::Vv,
        [-75.156, 99.0, 1.446, 30.0, 1.793, -2.179],
    ),
    fit(
        Cover::WetSnow,
        1,
        Polarisation::Hh,
        [-45.772, 25.16, 5.942, 30.0, 0.929, -0.284],
    ),
    fit(
        Cover::WetSnow,
        1,
        Polarisation::Hv,
        [-42.94, 9.935, 15.0, 30.0, 0.438, 0.712],
    ),
    fit(
        Cover::WetSnow,
        1,
        Polarisation::Vv,
        [-39.328, 18.594, 8.046, 30.0, 0.666, 0.269],
    ),
    fit(
        Cover::WetSnow,
        2,
        Polarisation::Hh,
        [-31.91, 17.749, 11.854, 30.0, 0.421, 0.74],
    ),
    fit(
        Cover::WetSnow,
        2,
        Polarisation::Hv,
        [-24.622, 15.102, 15.0, -3.401, 2.431, PI],
    ),
    fit(
        Cover::WetSnow,
        2,
        Polarisation::Vv,
        [4.288, 15.642, 15.0, 30.0, 0.535, 1.994],
    ),
];

const fn fit(cover: Cover, band: usize, polarisation: Polarisation, parameters: [f64; 6]) -> Fit {
    Fit {
        cover,
        band,
        polarisation,
        parameters,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn level_db(backscatter: Backscatter, degrees: f64) -> f64 {
        10.0 * backscatter.sigma0(degrees.to_radians()).log10()
    }

    #[test]
    fn gamma_falls_with_cosine_and_rises_with_root_of_frequency() {
        let farmland = Cover::Farmland.backscatter(10e9, Polarisation::Vv).unwrap();
        assert_eq!(farmland, Backscatter::Gamma(-15.0));
        // cos 60 deg is -3.01 dB.
        assert!((level_db(farmland, 60.0) + 18.0103).abs() < 1e-4);
        let lower = Cover::Farmland
            .backscatter(2.5e9, Polarisation::Hh)
            .unwrap();
        assert!((level_db(lower, 0.0) - (-15.0 - 3.0103)).abs() < 1e-4);
        assert_eq!(farmland.sigma0(1.6), 0.0);
        assert_eq!(Backscatter::Constant(-10.0).sigma0(1.6), 0.1);
    }

    #[test]
    fn fits_have_levels_of_their_curves() {
        // P1 + P2 exp(-P3 theta) + P4 cos(P5 theta + P6), by hand at 40 deg: grass at C band, HH.
        let grass = Cover::Grass.backscatter(5.4e9, Polarisation::Hh).unwrap();
        let theta = 40f64.to_radians();
        let by_hand = -15.75 + 17.931 * (-2.369 * theta).exp() - 1.502 * (4.592 * theta - PI).cos();
        assert!((level_db(grass, 40.0) - by_hand).abs() < 1e-9);
        assert!((by_hand + 13.8).abs() < 0.05, "{by_hand}");
        // Beyond 70 deg as the cosine: cos 80 / cos 70 = 0.5077, -2.94 dB.
        assert!((level_db(grass, 80.0) - level_db(grass, 70.0) + 2.944).abs() < 1e-3);
    }

    #[test]
    fn every_fit_falls_from_the_vertical_and_cross_polarisation_is_weaker() {
        for fit in &FITS {
            let here = Backscatter::Fit(fit.parameters);
            let name = format!("{:?} {} {:?}", fit.cover, fit.band, fit.polarisation);
            // Plausible levels of natural ground, monotone to 1.5 dB from 0 to 70 degrees.
            assert!((-25.0..10.0).contains(&level_db(here, 0.0)), "{name}");
            assert!((-40.0..-8.0).contains(&level_db(here, 50.0)), "{name}");
            for degrees in 0..70 {
                let fall =
                    level_db(here, f64::from(degrees)) - level_db(here, f64::from(degrees + 1));
                assert!(fall > -0.1, "{name} at {degrees}: {fall}");
            }
            if fit.polarisation == Polarisation::Hv {
                let [from_hz, _] = BANDS[fit.band];
                let like = fit
                    .cover
                    .backscatter(1.1 * from_hz, Polarisation::Vv)
                    .unwrap();
                assert!(level_db(here, 40.0) < level_db(like, 40.0) - 3.0, "{name}");
            }
        }
    }

    #[test]
    fn missing_bands_are_refused_with_alternatives() {
        for (cover, hz, polarisation) in [
            (Cover::Shrubs, 3e9, Polarisation::Hh),
            (Cover::Soil, 1.3e9, Polarisation::Hh),
            (Cover::Grass, 9.6e9, Polarisation::Vv),
            (Cover::WetSnow, 35e9, Polarisation::Hh),
        ] {
            let error = cover.backscatter(hz, polarisation).unwrap_err();
            assert!(
                error.to_string().contains("choose a class by gamma"),
                "{error}"
            );
        }
        assert!(Cover::Grass.backscatter(9.6e9, Polarisation::Hh).is_ok());
    }
}
