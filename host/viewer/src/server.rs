//! The server: a thread with a runtime of its own.

use std::io;
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::thread::{self, JoinHandle};

use axum::Router;
use tokio::sync::oneshot;

use crate::Board;
use crate::connections::{Bounded, MOST_CONNECTIONS};
use crate::product::{Gallery, product_routes};
use crate::routes::routes;

/// Why there is no page.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ServeError {
    /// The address cannot be listened at.
    #[error(
        "cannot listen at {address}: {source}; another address or port may do, and port 0 takes any that is free"
    )]
    Listen {
        /// The address.
        address: SocketAddr,
        /// What the system says.
        source: io::Error,
    },
    /// The system has no thread for it.
    #[error("cannot start the page's thread: {0}")]
    Thread(#[from] io::Error),
}

/// A page that is served until this is dropped.
#[derive(Debug)]
pub struct Server {
    address: SocketAddr,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Server {
    /// Serves a board at an address; of port 0 the system chooses one.
    ///
    /// # Errors
    /// [`ServeError`], before anything is served.
    pub fn start(address: SocketAddr, board: Arc<Board>) -> Result<Self, ServeError> {
        Self::serve(address, routes(board))
    }

    /// Serves images at an address; of port 0 the system chooses one.
    ///
    /// # Errors
    /// [`ServeError`], before anything is served.
    pub fn show(address: SocketAddr, gallery: Arc<Gallery>) -> Result<Self, ServeError> {
        gallery.begin()?;
        Self::serve(address, product_routes(gallery))
    }

    fn serve(address: SocketAddr, routes: Router) -> Result<Self, ServeError> {
        let fault = |source| ServeError::Listen { address, source };
        let listener = TcpListener::bind(address).map_err(fault)?;
        listener.set_nonblocking(true).map_err(fault)?;
        let address = listener.local_addr().map_err(fault)?;
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_io()
            .enable_time()
            .build()?;
        let (stop, stopped) = oneshot::channel();
        let serve = async move {
            let listener = tokio::net::TcpListener::from_std(listener)?;
            let listener = Bounded::new(listener, MOST_CONNECTIONS);
            axum::serve(listener, routes).await
        };
        let thread = thread::Builder::new()
            .name("page".to_owned())
            .spawn(move || {
                runtime.block_on(async {
                    tokio::select! {
                        _ = serve => {}
                        _ = stopped => {}
                    }
                });
                // Clients that are still there are left: their tasks end with the runtime, which waits for nothing that is being computed for them.
                runtime.shutdown_background();
            })?;
        Ok(Self {
            address,
            stop: Some(stop),
            thread: Some(thread),
        })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// The page's address for a browser of this machine.
    pub fn url(&self) -> String {
        let mut address = self.address;
        if address.ip().is_unspecified() {
            address.set_ip(match address {
                SocketAddr::V4(_) => std::net::Ipv4Addr::LOCALHOST.into(),
                SocketAddr::V6(_) => std::net::Ipv6Addr::LOCALHOST.into(),
            });
        }
        format!("http://{address}/")
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        if let Some(stop) = self.stop.take() {
            let _ = stop.send(());
        }
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
