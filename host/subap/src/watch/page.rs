//! Web page of a capture: its address, and a warning if other machines can open it.

use std::net::{Ipv4Addr, SocketAddr};
use std::sync::Arc;
use std::thread;
use std::time::Duration;

use subaperture::viewer::{LiveState, Server};

use crate::args::Watching;
use crate::messages;

/// Time to let clients receive the final state: they are updated ten times per second.
const LAST_WORD: Duration = Duration::from_millis(250);

/// Web page that reports the end to its clients before it closes.
pub(super) struct Page(#[expect(dead_code, reason = "it serves until it is dropped")] Server);

impl Drop for Page {
    fn drop(&mut self) {
        thread::sleep(LAST_WORD);
    }
}

/// Serve the page, if requested.
pub(super) fn serve(watching: &Watching, board: &Arc<LiveState>) -> anyhow::Result<Option<Page>> {
    if !watching.is_asked() {
        return Ok(None);
    }
    let here = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
    let server = Server::start(watching.listen.unwrap_or(here), Arc::clone(board))?;
    let address = server.address();
    if !address.ip().is_loopback() {
        messages::warning(format!(
            "--listen {address}: everyone who can reach this address and knows the full URL can see the capture, and the connection is not encrypted, \
             so that the access key can be read; leave --listen out to show it on this machine only"
        ));
    }
    messages::note(&format!("the page is at {}", server.url()));
    Ok(Some(Page(server)))
}
