//! Local web pages for any browser: a viewer for images of any size ([`product`]), and the live display of a capture.
//!
//! Part of [Subaperture](https://docs.rs/subaperture), radar image formation.
//!
//! # Capture page
//! ```text
//! radio::live::Board <── polled ten times a second per client ── Server (one thread) ── HTTP on loopback ──> page
//! ```
//! [`Server::start`] serves a [`LiveState`] until it is dropped. The page consists of three files embedded in the program:
//! it works offline and loads nothing from other servers. It shows the latest range profile, the waterfall, the levels
//! of both channels, fault counts, the free disk space, and the image while it forms, if there is one.
//!
//! | path | content |
//! |---|---|
//! | `/`, `/page.css`, `/page.js` | the page |
//! | `/colours` | colour maps, JSON: 256 colours each, dark to bright |
//! | `/events` | server-sent events, one JSON object each: the state, and the waterfall rows since the previous event |
//! | `/picture` | the image: 16-bit integers, little-endian, tenths of dB, rows in ascending y |
//!
//! No request changes any state.
//!
//! # Access control
//! The address of the page ([`Server::url`]) starts with a random secret. Requests without it are refused, so that
//! others who can reach the port see nothing: all users of this machine, and of the network if the caller listens on
//! it. Traffic is not encrypted. A foreign page open in the same browser may send requests to this server, but cannot
//! read the responses, since no header allows it. DNS rebinding would let it do so under its own host name; requests
//! are therefore served only if their `Host` is `localhost` or a numeric address ([`host::may_ask`]).
//!
//! # Limits
//! At most [`MAX_CONNECTIONS`] connections are open at a time, and at most [`MAX_OF_A_CLIENT`] from one remote
//! address. When the server is full, the oldest connection that has not yet sent the secret is closed. If all have sent
//! it, new connections wait. A request header is limited to 16 KiB and 10 s, and a connection is closed after 30 s
//! without traffic. A slow client receives fewer events, each with all that it missed and that the board still has:
//! nothing is queued for it, and it does not affect the capture. Images and events are encoded on one thread each, apart from the thread that
//! answers requests. Memory use is one message per client, 3 kB per waterfall row, the image, and its encoded copies: one per image that is
//! still being sent.
#![forbid(unsafe_code)]

mod admission;
mod connections;
mod guard;
pub mod host;
mod level;
mod message;
pub mod product;
mod routes;
mod secret;
mod server;

pub use admission::{MAX_CONNECTIONS, MAX_OF_A_CLIENT};
pub use server::{ServeError, Server};
pub use subaperture_radio::live::LiveState;
