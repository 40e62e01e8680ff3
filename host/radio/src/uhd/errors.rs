//! What UHD's errors are here, and what to do about them.

use std::ffi::CString;

use super::ffi;
use crate::error::RadioError;

/// A text for C.
pub(super) fn name(text: &str) -> Result<CString, RadioError> {
    CString::new(text)
        .map_err(|_| RadioError::Driver(format!("'{}' has a zero byte in it", text.escape_debug())))
}

/// An error of UHD's by its call, its code and its text.
pub(super) fn driver_error(call: &str, code: ffi::Error, text: &str) -> RadioError {
    let said = format!("UHD's {call} says: {text}");
    let lower = text.to_lowercase();
    let any = |words: &[&str]| words.iter().any(|word| lower.contains(word));
    // Before what is gone: UHD gives these as errors of input and output too.
    if any(&["images", "image:", "firmware"]) {
        let do_ = "get the images of this very version of UHD by 'uhd_images_downloader' (Debian: package uhd-host), and set \
                   UHD_IMAGES_DIR to their folder if it is not UHD's own";
        return RadioError::Driver(format!("{said}; {do_}"));
    }
    if any(&["permission", "libusb_error_access"]) {
        let do_ = "allow users the device: copy uhd-usrp.rules (Debian: /usr/lib/uhd/utils or package uhd-host) to \
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

/// What to do where no device is found.
pub(super) const NO_DEVICE: &str = "check its USB 3 cable and its power; 'lsusb' shows a B210 as 2500:0020; users need UHD's udev rules (uhd-usrp.rules) to see it";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_say_what_to_do() {
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
