//! NumPy files and image folders: content, and state after failed writes.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

use num_complex::Complex32;
use serde_json::{Value, json};
use subaperture::image::Image;
use subaperture::io::atomic::{WriteError, write_atomically};
use subaperture::io::npy;
use subaperture::io::product::Product;
use subaperture_tests::tiny_disk::TinyDisk;

fn image(rows: usize, columns: usize) -> Image {
    let pixel = |i: usize| Complex32::new(i as f32 + 0.25, -(i as f32));
    Image {
        rows,
        columns,
        pixels: (0..rows * columns).map(pixel).collect(),
    }
}

/// Names in a folder, hidden ones too, sorted.
fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

fn write(folder: &Path, image: &Image) -> Result<(), WriteError> {
    Product {
        image,
        metadata: &json!({ "algorithm": "exact" }),
        quicklook: b"not a picture",
    }
    .write(folder)
    .map(|_| ())
}

/// An array as numpy.save writes it, by the format's description.
fn npy_bytes(header: &str, pixels: &[Complex32]) -> Vec<u8> {
    let mut text = header.as_bytes().to_vec();
    while !(10 + text.len() + 1).is_multiple_of(64) {
        text.push(b' ');
    }
    text.push(b'\n');
    let mut out = b"\x93NUMPY\x01\x00".to_vec();
    out.extend((text.len() as u16).to_le_bytes());
    out.extend(text);
    for z in pixels {
        out.extend(z.re.to_le_bytes());
        out.extend(z.im.to_le_bytes());
    }
    out
}

const HEADER: &str = "{'descr': '<c8', 'fortran_order': False, 'shape': (2, 3), }";

#[test]
fn npy_file_equals_numpy_format() {
    let image = image(2, 3);
    let mut written = Vec::new();
    npy::write_to(&mut written, &image).unwrap();
    let expected = npy_bytes(HEADER, &image.pixels);
    assert_eq!(expected.len(), 128 + 48);
    assert_eq!(written, expected);
    assert!(written.len() as u64 <= npy::file_bytes(6));

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npy");
    npy::write(&path, &image).unwrap();
    assert_eq!(npy::read(&path).unwrap(), image);
    fs::write(&path, expected).unwrap();
    assert_eq!(npy::read(&path).unwrap(), image);
    assert_eq!(names(folder.path()), ["a.npy"]);
}

#[test]
fn numpy_reads_npy_file() {
    let folder = tempfile::tempdir().unwrap();
    let (ours, theirs) = (
        folder.path().join("ours.npy"),
        folder.path().join("theirs.npy"),
    );
    npy::write(&ours, &image(2, 3)).unwrap();
    let script = "import sys, numpy as n; a = n.load(sys.argv[1]); \
        assert a.dtype == 'complex64' and a.shape == (2, 3) and a[1, 2] == 5.25 - 5j; \
        n.save(sys.argv[2], 2 * a)";
    // A Python that was named must do; one that happens to be there may lack NumPy.
    let named = std::env::var_os("SUBAPERTURE_PYTHON");
    let python = named.clone().unwrap_or_else(|| "python3".into());
    let output = match Command::new(&python)
        .args(["-c", script])
        .arg(&ours)
        .arg(&theirs)
        .output()
    {
        Err(_) if named.is_none() => {
            println!("skipped: python3 not found");
            return;
        }
        output => output.unwrap_or_else(|e| panic!("SUBAPERTURE_PYTHON, {python:?}: {e}")),
    };
    let text = String::from_utf8_lossy(&output.stderr);
    if named.is_none() && text.contains("No module named 'numpy'") {
        println!("skipped: numpy not found");
        return;
    }
    assert!(output.status.success(), "{text}");
    let doubled: Vec<Complex32> = image(2, 3).pixels.iter().map(|z| z * 2.0).collect();
    assert_eq!(npy::read(&theirs).unwrap().pixels, doubled);
}

#[test]
fn npy_reader_rejects_other_types_and_damage() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npy");
    let read = |bytes: &[u8]| {
        fs::write(&path, bytes).unwrap();
        npy::read(&path).map_err(|e| e.to_string())
    };
    let pixels = image(2, 3).pixels;
    for (header, part) in [
        (
            "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }",
            "type '<f4'",
        ),
        (
            "{'descr': '>c8', 'fortran_order': False, 'shape': (2, 3), }",
            ">c8",
        ),
        (
            "{'descr': '<c8', 'fortran_order': True, 'shape': (2, 3), }",
            "fortran_order True",
        ),
        (
            "{'descr': '<c8', 'fortran_order': False, 'shape': (6,), }",
            "shape (6,)",
        ),
        (
            "{'descr': '<c8', 'fortran_order': False, 'shape': (2, 4), }",
            "expected 64 bytes",
        ),
        (
            "{'descr': '<c8', 'fortran_order': False, 'shape': (4294967296, 4294967296), }",
            "bytes after the header",
        ),
        (
            "{'descr': '<c8', 'fortran_order': False, 'shape': (18446744073709551615, 99), }",
            "bytes after the header",
        ),
        (
            "{'descr': '<c8', 'fortran_order': False, 'shape': (18446744073709551615, 18446744073709551615), }",
            "bytes after the header",
        ),
        (
            "{'descr': '<c8', 'fortran_order': False, 'shape': (-1, 3), }",
            "shape (-1,3)",
        ),
        ("nonsense", "damaged"),
    ] {
        let text = read(&npy_bytes(header, &pixels)).unwrap_err();
        assert!(text.contains(part) && text.contains("a.npy"), "{text}");
    }
    let double = HEADER
        .replace('\'', "\"")
        .replace("{", "{ ")
        .replace("False", "False \t");
    assert_eq!(read(&npy_bytes(&double, &pixels)).unwrap(), image(2, 3));
    assert!(read(&npy_bytes(&"(".repeat(60_000), &pixels)).is_err());
    let text = read(b"\x93NUMPY\x02\x00\xff\xff\xff\xff").unwrap_err();
    assert!(
        text.contains("expected NumPy format 1.0, as numpy.save writes a plain array, found 2.0"),
        "{text}"
    );

    let good = npy_bytes(HEADER, &pixels);
    for cut in 0..good.len() {
        assert!(read(&good[..cut]).is_err(), "cut at {cut}");
    }
    for at in 0..good.len() {
        for flip in [1, 0x10, 0x80] {
            let mut bytes = good.clone();
            bytes[at] ^= flip;
            let _ = read(&bytes);
        }
    }
    assert!(
        npy::read(&folder.path().join("absent.npy"))
            .unwrap_err()
            .to_string()
            .contains("absent.npy")
    );
    assert!(npy::read(folder.path()).is_err());
}

#[test]
fn new_image_folder_appears_atomically() {
    let base = tempfile::tempdir().unwrap();
    let folder = base.path().join("deep/er/out");
    Product::prepare(&folder, 15).unwrap();
    assert_eq!(names(base.path()), [""; 0], "prepare leaves no file");
    let image = image(3, 5);
    write(&folder, &image).unwrap();
    assert_eq!(names(&folder), ["image.json", "image.npy", "image.png"]);
    assert_eq!(names(base.path()), ["deep"]);
    assert_eq!(names(&base.path().join("deep/er")), ["out"]);
    assert_eq!(npy::read(&folder.join("image.npy")).unwrap(), image);
    let metadata: Value =
        serde_json::from_slice(&fs::read(folder.join("image.json")).unwrap()).unwrap();
    assert_eq!(metadata["algorithm"], "exact");
    for name in ["image.npy", "image.png"] {
        let bytes = fs::read(folder.join(name)).unwrap();
        assert_eq!(metadata["files"][name]["bytes"], bytes.len());
        let crc32 = format!("{:08x}", crc32fast::hash(&bytes));
        assert_eq!(metadata["files"][name]["crc32"], crc32);
    }
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // Permissions are those of a folder and a file made under the same umask.
        fs::create_dir(base.path().join("plain")).unwrap();
        fs::write(base.path().join("plain/file"), "").unwrap();
        let mode = |p: PathBuf| fs::metadata(p).unwrap().permissions().mode();
        assert_eq!(mode(folder.clone()), mode(base.path().join("plain")));
        assert_eq!(
            mode(folder.join("image.npy")),
            mode(base.path().join("plain/file"))
        );
        npy::write(&base.path().join("a.npy"), &image).unwrap();
        assert_eq!(
            mode(base.path().join("a.npy")),
            mode(base.path().join("plain/file"))
        );
    }
}

#[test]
fn existing_folder_keeps_foreign_files() {
    let base = tempfile::tempdir().unwrap();
    fs::write(base.path().join("notes.txt"), "mine").unwrap();
    write(base.path(), &image(2, 2)).unwrap();
    let first = fs::read(base.path().join("image.json")).unwrap();
    write(base.path(), &image(4, 4)).unwrap();
    assert_eq!(
        names(base.path()),
        ["image.json", "image.npy", "image.png", "notes.txt"]
    );
    assert_eq!(fs::read(base.path().join("notes.txt")).unwrap(), b"mine");
    assert_eq!(
        npy::read(&base.path().join("image.npy")).unwrap(),
        image(4, 4)
    );
    assert_ne!(fs::read(base.path().join("image.json")).unwrap(), first);
}

#[test]
fn foreign_files_in_the_way_are_reported_before_processing() {
    let base = tempfile::tempdir().unwrap();
    let file = base.path().join("file");
    fs::write(&file, "mine").unwrap();
    for folder in [file.clone(), file.join("sub")] {
        for result in [Product::prepare(&folder, 1), write(&folder, &image(1, 1))] {
            let text = result.unwrap_err().to_string();
            assert!(
                text.contains("expected a folder, but it or a part of its path is a file"),
                "{text}"
            );
            assert!(text.contains("file"), "{text}");
        }
    }
    fs::create_dir_all(base.path().join("out/image.png")).unwrap();
    let text = Product::prepare(&base.path().join("out"), 1)
        .unwrap_err()
        .to_string();
    assert!(
        text.contains("image.png") && text.contains("a folder of that name exists"),
        "{text}"
    );
    assert!(write(&base.path().join("out"), &image(1, 1)).is_err());
    assert!(!base.path().join("out/image.json").exists());
    // A product larger than any disk: 10^18 pixels of 8 bytes.
    match Product::prepare(&base.path().join("new"), 1_000_000_000_000_000_000) {
        Err(WriteError::NoSpace {
            needed_bytes,
            free_bytes,
            ..
        }) => {
            assert_eq!(needed_bytes, 8_000_000_000_000_000_128);
            assert!(free_bytes > 0);
        }
        other => panic!("{other:?}"),
    }
    assert_eq!(names(base.path()), ["file", "out"]);
    assert_eq!(fs::read(&file).unwrap(), b"mine");
}

#[test]
fn unwritable_folder_is_reported_before_processing() {
    // Not even root can make a folder in /proc.
    if !Path::new("/proc/self").exists() {
        println!("skipped: /proc not found");
        return;
    }
    let folder = Path::new("/proc/subap-out");
    for result in [Product::prepare(folder, 1), write(folder, &image(1, 1))] {
        let text = result.unwrap_err().to_string();
        assert!(text.starts_with("cannot write /proc/subap-out"), "{text}");
    }
    assert!(npy::write(Path::new("/proc/a.npy"), &image(1, 1)).is_err());
}

#[test]
fn failed_write_keeps_previous_file() {
    let base = tempfile::tempdir().unwrap();
    let path = base.path().join("a.bin");
    for old in [None, Some("old")] {
        if let Some(old) = old {
            fs::write(&path, old).unwrap();
        }
        // An error of the closure, a full disk, a panic.
        let interrupted = write_atomically(&path, 0, |file| {
            file.write_all(b"half")?;
            Err::<(), _>(std::io::Error::other("interrupted"))
        });
        assert!(interrupted.unwrap_err().to_string().contains("interrupted"));
        if Path::new("/dev/full").exists() {
            let full = write_atomically(&path, 12_345, |file| {
                file.write_all(b"half")?;
                fs::OpenOptions::new()
                    .write(true)
                    .open("/dev/full")?
                    .write_all(b"half")
            });
            let text = full.unwrap_err().to_string();
            assert!(
                text.contains("a.bin") && text.contains("12345 bytes are needed"),
                "{text}"
            );
        }
        let panicked = std::panic::catch_unwind(|| {
            let _ = write_atomically(&path, 0, |_| -> std::io::Result<()> {
                panic!("as planned")
            });
        });
        assert!(panicked.is_err());
        assert_eq!(fs::read_to_string(&path).ok().as_deref(), old);
        assert_eq!(names(base.path()).len(), usize::from(old.is_some()));
    }
    write_atomically(&path, 3, |file| file.write_all(b"new")).unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"new");
    assert!(
        write_atomically(base.path(), 0, |_| Ok(())).is_err(),
        "a folder is not replaced"
    );
    assert!(
        write_atomically(Path::new("/dev/null"), 0, |_| Ok(())).is_err(),
        "nor a device"
    );
    // Missing folders are made, and removed if no file is written.
    let absent = base.path().join("absent/deep/a.bin");
    let failed = write_atomically(&absent, 0, |_| -> std::io::Result<()> {
        Err(std::io::Error::other("no"))
    });
    assert!(
        failed
            .unwrap_err()
            .to_string()
            .contains("absent/deep/a.bin")
    );
    assert_eq!(names(base.path()), ["a.bin"]);
    write_atomically(&absent, 0, |file| file.write_all(b"new")).unwrap();
    assert_eq!(names(&base.path().join("absent/deep")), ["a.bin"]);
}

#[cfg(unix)]
#[test]
fn symbolic_links_are_followed() {
    let base = tempfile::tempdir().unwrap();
    let (target, link) = (base.path().join("target"), base.path().join("link"));
    fs::write(&target, "old").unwrap();
    std::os::unix::fs::symlink(&target, &link).unwrap();
    write_atomically(&link, 0, |file| file.write_all(b"new")).unwrap();
    assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
    assert_eq!(fs::read(&target).unwrap(), b"new");
}

#[test]
fn full_disk_leaves_no_partial_product() {
    let Some(disk) = TinyDisk::mount() else {
        return;
    };
    let disk_path = disk.path();
    let (small, large) = (image(50, 50), image(300, 300));
    for folder in [disk_path.join("out"), disk_path.to_owned()] {
        // 300 x 300 x 8 bytes and a header exceed 256 KiB; detected beforehand and while writing.
        let text = Product::prepare(&folder, 90_000).unwrap_err().to_string();
        assert!(text.contains("720128 bytes are needed"), "{text}");
        let text = write(&folder, &large).unwrap_err().to_string();
        assert!(
            text.contains("image.npy") && text.contains("720141 bytes are needed"),
            "{text}"
        );
        assert_eq!(names(disk_path), [""; 0]);
    }
    // An older product survives a failed replacement.
    Product::prepare(disk_path, 2500).unwrap();
    write(disk_path, &small).unwrap();
    assert!(write(disk_path, &large).is_err());
    assert_eq!(names(disk_path), ["image.json", "image.npy", "image.png"]);
    assert_eq!(npy::read(&disk_path.join("image.npy")).unwrap(), small);
    assert!(npy::write(&disk_path.join("large.npy"), &large).is_err());
    assert_eq!(names(disk_path).len(), 3);
}
