//! Links the firmware with the memory map of its board. Does nothing for a host.

use std::path::PathBuf;
use std::{env, fs};

fn main() {
    println!("cargo::rerun-if-changed=../memory.x");
    println!("cargo::rerun-if-changed=memory-an500.x");
    println!("cargo::rerun-if-changed=memory-h743.x");
    println!("cargo::rerun-if-changed=memory-microbit.x");
    println!("cargo::rerun-if-changed=memory-virt.x");
    println!("cargo::rustc-check-cfg=cfg(defmt_log)");
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    if env::var("CARGO_CFG_TARGET_ARCH").as_deref() == Ok("riscv32") {
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/memory-virt.x");
        println!("cargo::rustc-link-arg-bins=-T{script}");
        return;
    }
    let has = |feature: &str| env::var_os(format!("CARGO_FEATURE_{feature}")).is_some();
    let defmt_log = has("DEFMT") && !has("NO_LOG");
    if defmt_log {
        println!("cargo::rustc-cfg=defmt_log");
    }
    let map = if has("BOARD_H743") {
        "memory-h743.x"
    } else if has("BOARD_MICROBIT") {
        "memory-microbit.x"
    } else {
        "memory-an500.x"
    };
    // The script of cortex-m-rt includes the workspace's memory.x, which includes board.x.
    let folder = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    fs::copy(map, folder.join("board.x")).expect("the memory map can be copied");
    println!("cargo::rustc-link-search={}", folder.display());
    println!("cargo::rustc-link-search={}/..", env!("CARGO_MANIFEST_DIR"));
    for kind in ["bins", "examples"] {
        println!("cargo::rustc-link-arg-{kind}=-Tlink.x");
        if defmt_log {
            println!("cargo::rustc-link-arg-{kind}=-Tdefmt.x");
        }
    }
}
