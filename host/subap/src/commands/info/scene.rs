//! Warning about recordings whose description states no scene.

use subaperture::io::recording::RecordingFile;

use crate::args::Input;
use crate::config::Session;
use crate::messages;

/// Warn about descriptions without the place of the scene, to which geometry and resolution refer.
pub(super) fn warn_without(session: &Session, input: &Input) {
    let described = input.files.iter();
    let described = described.filter(|path| path.extension().is_some_and(|e| e == "toml"));
    for path in described {
        let Ok(mut file) = RecordingFile::read_within(path, session.memory_bytes) else {
            continue;
        };
        let set = input
            .set
            .iter()
            .try_for_each(|(key, value)| file.set(key, value));
        if set.is_ok() && !file.states_scene() {
            messages::warning(format!(
                "{}: the description states no place of the scene, so that slant range, angles, resolution in the plane and default grid are those of x 0, y 0, z 0 m: \
                 write [scene] with x and y (extent, such as x = \"-4, 4 m\" and y = \"1, 9 m\") or with reference (a point, such as \"0, 5, 0 m\")",
                path.display()
            ));
        }
    }
}
