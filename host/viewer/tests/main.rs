//! Tests of the pages as clients see them: by hand-written HTTP, and by a headless browser.

mod browser;
mod driver;
mod http;
mod images;
mod images_page;
mod running;
