//! Resumption within an item.

use std::fs;
use std::path::Path;
use std::sync::Mutex;

use subaperture::focus::FormError;
use subaperture::monitor::Monitor;
use subaperture_gallery::{Context, Item, ItemError, RunError, items, run};

use super::MEMORY_BYTES;

/// Share of the item at which its second image is being formed: two images, equal shares.
const SECOND_IMAGE: f64 = 0.6;

/// Records the first reported share of the item; cancels from `until` on.
struct Interrupting {
    until: f64,
    first: Mutex<Option<f64>>,
    last: Mutex<f64>,
}

impl Interrupting {
    fn new(until: f64) -> Self {
        Self {
            until,
            first: Mutex::new(None),
            last: Mutex::new(0.0),
        }
    }
}

impl Monitor for Interrupting {
    fn progress(&self, fraction: f64) {
        self.first.lock().unwrap().get_or_insert(fraction);
        *self.last.lock().unwrap() = fraction;
    }

    fn cancelled(&self) -> bool {
        *self.last.lock().unwrap() >= self.until
    }
}

fn compute(item: Item, folder: &Path, monitor: &Interrupting) -> Result<(), RunError> {
    let context = Context {
        memory_bytes: MEMORY_BYTES,
        monitor,
        gotcha: &[],
        full: false,
        unfinished: Some(folder),
    };
    run(&[item], folder, &context, |_| {}).map(drop)
}

fn files(folder: &Path, start: &str) -> Vec<String> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let names = entries.map(|entry| entry.file_name().into_string().unwrap());
    names.filter(|name| name.starts_with(start)).collect()
}

#[test]
fn interrupted_item_resumes_with_its_second_image() {
    let item = items()
        .into_iter()
        .find(|item| item.id == "s-4-10")
        .unwrap();
    let [whole, parts] = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
    let [whole, parts] = [whole.path(), parts.path()];
    let through = Interrupting::new(f64::INFINITY);
    compute(item, whole, &through).unwrap();
    assert!(through.first.into_inner().unwrap().unwrap() < 0.5);

    let error = compute(item, parts, &Interrupting::new(SECOND_IMAGE)).unwrap_err();
    assert!(
        matches!(
            &error,
            RunError::Item {
                source: ItemError::Form(FormError::Cancelled),
                ..
            }
        ),
        "{error}"
    );
    let kept = files(parts, ".subap-unfinished-");
    assert_eq!(kept.len(), 1, "{kept:?}");
    let resumed = Interrupting::new(f64::INFINITY);
    compute(item, parts, &resumed).unwrap();
    assert!(resumed.first.into_inner().unwrap().unwrap() >= 0.5);
    // The finished item equals that of an uninterrupted run, and its images are removed.
    assert_eq!(files(parts, ".subap-unfinished-"), [""; 0]);
    for name in files(whole, "s-4-10") {
        assert_eq!(
            fs::read(whole.join(&name)).unwrap(),
            fs::read(parts.join(&name)).unwrap(),
            "{name}"
        );
    }
}
