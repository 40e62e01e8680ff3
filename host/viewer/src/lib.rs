//! Local web pages, for any browser: images of any size ([`product`]), and a capture as it runs.
//!
//! A part of [Subaperture](https://docs.rs/subaperture), radar image formation.
//!
//! # A capture
//! ```text
//! radio::live::Board <── asked ten times a second, a client ── Server (a thread) ── HTTP on loopback ──> the page
//! ```
//!
//! [`Server::start`] serves a [`Board`] until it is dropped. The page is three files in the program: it needs no network and loads
//! nothing from anywhere else. It draws the latest range profile, the waterfall, both channels' levels, what went wrong, the room on the
//! disk, and the image as it forms where there is one.
//!
//! | path | what it is |
//! |---|---|
//! | `/`, `/page.css`, `/page.js` | the page |
//! | `/colours` | colour maps, JSON: 256 colours each, dark to bright |
//! | `/events` | server-sent events, a JSON object each: the state, and all rows of the waterfall since the last |
//! | `/picture` | the image: 16-bit integers, little-endian, tenths of dB, rows of y ascending |
//!
//! Nothing that a client asks changes anything.
//!
//! # Who may look
//! Whoever can reach the address: loopback unless the caller says otherwise. A page of somebody else's, open in the same browser, may send
//! requests here, but reads no answer, for no header allows it; and by DNS rebinding it comes under a name of its own, so that
//! requests are served only if their `Host` is `localhost` or an address in digits ([`host::may_ask`]).
//!
//! # Bounds
//! At most [`MOST_CONNECTIONS`] connections, others wait to be accepted; one on which nothing moves for 30 s is closed. A slow client
//! gets fewer events, each with what it missed, as far as the board has it: nothing is queued for it, and the capture knows nothing of clients.
//! Memory: a message for each client, 3 kB a row, and the picture.
#![forbid(unsafe_code)]

mod connections;
mod guard;
pub mod host;
mod level;
mod message;
pub mod product;
mod routes;
mod server;

pub use connections::MOST_CONNECTIONS;
pub use server::{ServeError, Server};
pub use subaperture_radio::live::Board;
