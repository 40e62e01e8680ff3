//! Check of the declarations against the installed header.

use std::fmt::Write as _;
use std::mem::{offset_of, size_of};
use std::path::Path;
use std::process::Command;

use super::*;

/// C type of a Rust type in the list.
fn in_c(rust: &str, argument: &str) -> String {
    if let Some(of) = rust.strip_prefix("*mut ") {
        return format!("{} *", in_c(of, argument));
    }
    if let Some(of) = rust.strip_prefix("*const ") {
        return format!("const {} *", in_c(of, argument));
    }
    match rust {
        "c_char" => "char",
        "c_void" => "void",
        "usize" => "size_t",
        "i64" => "int64_t",
        "f64" => "double",
        "bool" => "bool",
        "Usrp" => "uhd_usrp_handle",
        "Strings" => "uhd_string_vector_handle",
        "Span" => "uhd_meta_range_handle",
        "Subdevice" => "uhd_subdev_spec_handle",
        "Sensor" => "uhd_sensor_value_handle",
        "RxStreamer" => "uhd_rx_streamer_handle",
        "TxStreamer" => "uhd_tx_streamer_handle",
        "RxMetadata" => "uhd_rx_metadata_handle",
        "TxMetadata" => "uhd_tx_metadata_handle",
        "AsyncMetadata" => "uhd_async_metadata_handle",
        "StreamArgs" => "uhd_stream_args_t",
        "StreamCommand" => "uhd_stream_cmd_t",
        "TuneRequest" => "uhd_tune_request_t",
        "TuneResult" => "uhd_tune_result_t",
        // Enumeration types are distinguished by the function's name.
        "c_uint" if argument.starts_with("uhd_rx_metadata") => "uhd_rx_metadata_error_code_t",
        "c_uint" if argument.starts_with("uhd_async") => "uhd_async_metadata_event_code_t",
        other => panic!("what is {other} in C?"),
    }
    .to_owned()
}

/// C program that compiles if and only if functions, layouts and constants match the header.
fn program(declared: &[(&str, &[&str])]) -> String {
    let mut text =
        "#include <stdbool.h>\n#include <stddef.h>\n#include <stdint.h>\n#include <uhd.h>\n"
            .to_owned();
    for (name, types) in declared {
        let types: Vec<String> = types.iter().map(|rust| in_c(rust, name)).collect();
        let types = types.join(", ");
        writeln!(text, "uhd_error (*check_{name})({types}) = {name};").unwrap();
    }
    macro_rules! layout {
        ($rust:ident, $c:literal, $($field:ident),*) => {
            writeln!(text, "_Static_assert(sizeof({}) == {}, \"\");", $c, size_of::<$rust>()).unwrap();
            $(writeln!(
                text,
                "_Static_assert(offsetof({}, {}) == {}, \"\");",
                $c, stringify!($field), offset_of!($rust, $field)
            ).unwrap();)*
        };
    }
    layout!(
        StreamArgs,
        "uhd_stream_args_t",
        cpu_format,
        otw_format,
        args,
        channel_list,
        n_channels
    );
    layout!(
        StreamCommand,
        "uhd_stream_cmd_t",
        stream_mode,
        num_samps,
        stream_now,
        time_spec_full_secs,
        time_spec_frac_secs
    );
    layout!(
        TuneRequest,
        "uhd_tune_request_t",
        target_freq,
        rf_freq_policy,
        rf_freq,
        dsp_freq_policy,
        dsp_freq,
        args
    );
    layout!(
        TuneResult,
        "uhd_tune_result_t",
        clipped_rf_freq,
        target_rf_freq,
        actual_rf_freq,
        target_dsp_freq,
        actual_dsp_freq
    );
    for (name, value) in [
        ("UHD_ERROR_NONE", 0),
        ("UHD_ERROR_USB", ERROR_USB),
        ("UHD_ERROR_IO", ERROR_IO),
        ("UHD_ERROR_OS", ERROR_OS),
        ("UHD_STREAM_MODE_NUM_SAMPS_AND_DONE", SAMPLES_AND_DONE),
        ("UHD_TUNE_REQUEST_POLICY_AUTO", POLICY_AUTO),
        ("UHD_RX_METADATA_ERROR_CODE_NONE", RX_NONE),
        ("UHD_RX_METADATA_ERROR_CODE_TIMEOUT", RX_TIMEOUT),
        ("UHD_RX_METADATA_ERROR_CODE_LATE_COMMAND", RX_LATE),
        ("UHD_RX_METADATA_ERROR_CODE_OVERFLOW", RX_OVERFLOW),
        ("UHD_ASYNC_METADATA_EVENT_CODE_BURST_ACK", TX_ACK),
        ("UHD_ASYNC_METADATA_EVENT_CODE_UNDERFLOW", TX_UNDERFLOW),
        ("UHD_ASYNC_METADATA_EVENT_CODE_SEQ_ERROR", TX_SEQUENCE),
        ("UHD_ASYNC_METADATA_EVENT_CODE_TIME_ERROR", TX_TIME),
        (
            "UHD_ASYNC_METADATA_EVENT_CODE_UNDERFLOW_IN_PACKET",
            TX_UNDERFLOW_IN_PACKET,
        ),
        (
            "UHD_ASYNC_METADATA_EVENT_CODE_SEQ_ERROR_IN_BURST",
            TX_SEQUENCE_IN_BURST,
        ),
    ] {
        writeln!(text, "_Static_assert({name} == {value}, \"\");").unwrap();
    }
    // Size of an enumeration as an argument.
    for name in [
        "uhd_error",
        "uhd_rx_metadata_error_code_t",
        "uhd_async_metadata_event_code_t",
    ] {
        let size = size_of::<c_uint>();
        writeln!(text, "_Static_assert(sizeof({name}) == {size}, \"\");").unwrap();
    }
    text
}

/// Diagnostics of the C compiler; empty if the program is valid.
fn diagnostics(text: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("check.c");
    std::fs::write(&path, text).unwrap();
    let output = Command::new("cc")
        .args(["-std=c11", "-Wall", "-Werror", "-fsyntax-only"])
        .arg(&path)
        .output()
        .unwrap();
    let output_text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(
        output.status.success(),
        output_text.is_empty(),
        "{output_text}"
    );
    output_text
}

#[test]
fn declarations_match_installed_header() {
    if !Path::new("/usr/include/uhd.h").exists()
        || Command::new("cc").arg("--version").output().is_err()
    {
        println!("skipped: needs a C compiler and uhd.h of libuhd-dev");
        return;
    }
    assert!(DECLARED.len() > 60);
    assert_eq!(diagnostics(&program(DECLARED)), "");
    // The check detects a single wrong type.
    let wrong = program(&[("uhd_usrp_set_rx_rate", &["Usrp", "f64", "f64"])]);
    assert!(diagnostics(&wrong).contains("check_uhd_usrp_set_rx_rate"));
}
