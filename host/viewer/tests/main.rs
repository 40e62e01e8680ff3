//! The page as its clients see it: by HTTP written out here, and by a browser without a screen.

mod browser;
mod driver;
mod http;
mod images;
mod images_page;
mod running;
