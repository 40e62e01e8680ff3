//! Mapping of UHD's errors to errors of this crate, with advice.

use std::ffi::CString;

use super::ffi;
use crate::error::RadioError;

/// Convert to a C string.
pub(super) fn name(text: &str) -> Result<CString, RadioError> {
    CString::new(text)
        .map_err(|_| RadioError::Driver(format!("'{}' contains a zero byte", text.escape_debug())))
}

/// Convert an error of UHD, given its call, code and message.
pub(super) fn driver_error(call: &str, code: ffi::Error, text: &str) -> RadioError {
    let said = format!("UHD {call}: {text}");
    let lower = text.to_lowercase();
    let any = |words: &[&str]| words.iter().any(|word| lower.contains(word));
    // Checked before the codes: UHD reports these faults with the codes of I/O errors too.
    if any(&["images", "image:", "firmware"]) {
        let do_ = "install the images of this version of UHD with 'uhd_images_downloader' (Debian: package uhd-host), and set \
                   UHD_IMAGES_DIR to their folder if it is not UHD's default";
        return RadioError::Driver(format!("{said}; {do_}"));
    }
    if any(&["permission", "libusb_error_access"]) {
        let do_ = "give users access to the device: copy uhd-usrp.rules (Debian: /usr/lib/uhd/utils or package uhd-host) to \
                   /etc/udev/rules.d, run 'udevadm control --reload-rules' and 'udevadm trigger', and plug the radio in again";
        return RadioError::Driver(format!("{said}; {do_}"));
    }
    if any(&["no devices found"]) {
        return RadioError::Driver(format!("{said}; {NO_DEVICE}"));
    }
    match code {
        ffi::ERROR_USB | ffi::ERROR_IO | ffi::ERROR_OS => RadioError::Gone(said),
        code => RadioError::Driver(format!("{said} (error {code})")),
    }
}

/// Advice if no device is found.
pub(super) const NO_DEVICE: &str = "check the USB 3 cable and the power; 'lsusb' shows a B210 as 2500:0020; users need UHD's udev rules (uhd-usrp.rules) for access";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn driver_errors_contain_advice() {
        let text = |code, text| driver_error("uhd_usrp_make", code, text).to_string();
        let images = "RuntimeError: Could not find path for image: usrp_b200_fw.hex\n\nUsing images directory: <no images directory located>";
        assert!(text(ffi::ERROR_IO, images).contains("uhd_images_downloader"));
        assert!(text(ffi::ERROR_IO, images).contains("UHD_IMAGES_DIR"));
        assert!(
            text(ffi::ERROR_USB, "USB open failed: insufficient permissions.").contains("udev")
        );
        assert!(text(41, "LookupError: KeyError: No devices found for ----->").contains("cable"));
        let gone = driver_error(
            "uhd_rx_streamer_recv",
            ffi::ERROR_IO,
            "LIBUSB_TRANSFER_NO_DEVICE",
        );
        assert!(matches!(gone, RadioError::Gone(_)));
        assert!(matches!(
            driver_error("x", 43, "ValueError"),
            RadioError::Driver(_)
        ));
        assert!(matches!(name("a\0b"), Err(RadioError::Driver(_))));
    }
}
