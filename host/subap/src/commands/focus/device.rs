//! Device of `--device`.

use serde_json::Value;
use subaperture::focus::device::Device;

use crate::args::DeviceChoice;
use crate::messages;

/// Open the chosen device; `None` for the processor, with a note where the choice cannot be followed.
pub(super) fn open(choice: DeviceChoice) -> Option<Box<dyn Device>> {
    let opened = match choice {
        DeviceChoice::Cpu => return None,
        DeviceChoice::Gpu => gpu(true),
        DeviceChoice::Automatic => gpu(false),
    };
    match opened {
        Ok(device) => Some(device),
        Err(why) => {
            messages::note(&format!(
                "--device: {why}; the image is formed on the processor"
            ));
            None
        }
    }
}

/// Open a GPU, or a driver on the processor if `any`.
#[cfg(feature = "gpu")]
fn gpu(any: bool) -> Result<Box<dyn Device>, String> {
    use subaperture::gpu::{Gpu, Kind};

    let kind = if any { Kind::Any } else { Kind::Hardware };
    match Gpu::open(kind) {
        Ok(gpu) => Ok(Box::new(gpu)),
        Err(error) => Err(error.to_string()),
    }
}

#[cfg(not(feature = "gpu"))]
fn gpu(_any: bool) -> Result<Box<dyn Device>, String> {
    Err("this program was built without the feature gpu".to_owned())
}

/// Note an image by the named former, with this summary of its plan or these settings, that does not use the device.
pub(super) fn note_unused(device: Option<&dyn Device>, former: &str, summary: &Value) {
    let Some(device) = device else { return };
    if summary.get("device").is_none() {
        let former = summary["former"].as_str().unwrap_or(former);
        let name = device.name();
        messages::note(&format!(
            "--device: {former} forms this image on the processor; bp and rdbp on Cartesian grids can use {name}"
        ));
    }
}
