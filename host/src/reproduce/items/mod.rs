//! The items, a file a figure or group of figures that share their data.

mod forming;
mod migration;
mod point;

use super::Item;

/// All items, in the order of the page.
pub fn items() -> Vec<Item> {
    [migration::ITEMS.as_slice(), point::ITEMS.as_slice()].concat()
}
