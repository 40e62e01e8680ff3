//! Mapping from the axes of a track file to the scene axes.
//!
//! Written as the scene's x, y and z in axes of the file: `x, -z, y` uses the file's `-z` as the scene's y.
//! Motion-capture tracks have y up; `x, -z, y` makes z up and keeps the frame right-handed. Reflections are refused.

use std::str::FromStr;

use glam::{DMat3, DQuat, DVec3};

/// Permutation of axes with signs, a rotation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackAxes(DMat3);

impl TrackAxes {
    /// Identical axes.
    pub const PLAIN: Self = Self(DMat3::IDENTITY);

    /// Mapping for a file with y up.
    pub fn y_up() -> Self {
        Self(DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y))
    }

    /// Convert a vector of the file to scene axes.
    pub fn turn(&self, vector: DVec3) -> DVec3 {
        self.0 * vector
    }

    /// Convert an attitude of the file, for a body whose axes are the file's, to scene axes.
    pub fn turn_attitude(&self, attitude: DQuat) -> DQuat {
        let turn = DQuat::from_mat3(&self.0);
        (turn * attitude * turn.inverse()).normalize()
    }
}

impl FromStr for TrackAxes {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wanted = || {
            format!(
                "expected the scene's x, y and z as axes of the file, found '{text}': write for example \"x, -z, y\""
            )
        };
        let axis = |word: &str| {
            let (sign, letter) = match word.strip_prefix('-') {
                Some(letter) => (-1.0, letter),
                None => (1.0, word.strip_prefix('+').unwrap_or(word)),
            };
            let unit = match letter.trim() {
                "x" => DVec3::X,
                "y" => DVec3::Y,
                "z" => DVec3::Z,
                _ => return Err(wanted()),
            };
            Ok(unit * sign)
        };
        let rows = text
            .split(',')
            .map(|word| axis(word.trim()))
            .collect::<Result<Vec<_>, _>>()?;
        let [x, y, z] = rows[..] else {
            return Err(wanted());
        };
        let order = DMat3::from_cols(x, y, z).transpose();
        match order.determinant() {
            d if d > 0.5 => Ok(Self(order)),
            d if d < -0.5 => Err(format!(
                "'{text}' is a reflection: change one sign, as in \"x, -z, y\" for a file with y up"
            )),
            _ => Err(format!(
                "'{text}' repeats an axis: use each of x, y and z once"
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axis_mappings_are_rotations() {
        let order: TrackAxes = "x, -z, y".parse().unwrap();
        assert_eq!(order, TrackAxes::y_up());
        // 2 m up, 3 m towards the viewer.
        assert_eq!(
            order.turn(DVec3::new(1.0, 2.0, 3.0)),
            DVec3::new(1.0, -3.0, 2.0)
        );
        assert_eq!("x,y,z".parse(), Ok(TrackAxes::PLAIN));
        // A rotation about the file's vertical is one about the scene's.
        let turned = order.turn_attitude(DQuat::from_rotation_y(0.3)) * DVec3::X;
        assert!(
            turned.distance(DQuat::from_rotation_z(0.3) * DVec3::X) < 1e-12,
            "{turned}"
        );
        for (text, part) in [
            ("x, z, y", "reflection"),
            ("x, x, y", "repeats an axis"),
            ("x, y", "expected the scene's x, y and z"),
            ("a, y, z", "expected the scene's x, y and z"),
            ("", "expected the scene's x, y and z"),
        ] {
            let error = text.parse::<TrackAxes>().unwrap_err();
            assert!(error.contains(part), "{text}: {error}");
        }
    }
}
