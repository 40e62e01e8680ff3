//! The items, a file a figure or group of figures that share their data.

use super::Item;

/// All items, in the order of the page.
pub fn items() -> Vec<Item> {
    Vec::new()
}
