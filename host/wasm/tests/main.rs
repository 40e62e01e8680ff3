//! The interface of the page against the library: natively, and in headless Chromium.

#[path = "../../viewer/tests/driver.rs"]
mod driver;
mod input;
mod native;
mod page;
mod server;
