//! Server thread with its own runtime.

use std::io;
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::thread::{self, JoinHandle};

use axum::Router;
use tokio::sync::oneshot;

use crate::LiveState;
use crate::connections;
use crate::product::{Gallery, product_routes};
use crate::routes::{CAPTURE_THREADS, routes};
use crate::secret::Secret;

/// Error starting a page server.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ServeError {
    /// The address cannot be bound.
    #[error(
        "cannot listen at {address}: {source}; choose another address or port, or port 0 for any free port"
    )]
    Listen {
        /// Requested address.
        address: SocketAddr,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The operating system provided no thread, runtime or random numbers.
    #[error("cannot start the page server: {0}")]
    Thread(#[from] io::Error),
}

/// Web page server; stops when dropped.
#[derive(Debug)]
pub struct Server {
    address: SocketAddr,
    secret: Secret,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Server {
    /// Serve the live display of a capture at `address`. Port 0 selects a free port.
    ///
    /// # Errors
    /// [`ServeError`] if the address cannot be bound or the server cannot start.
    pub fn start(address: SocketAddr, board: Arc<LiveState>) -> Result<Self, ServeError> {
        Self::serve(address, routes(board), CAPTURE_THREADS)
    }

    /// Serve images at `address`. Port 0 selects a free port.
    ///
    /// # Errors
    /// [`ServeError`] if the address cannot be bound or the server cannot start.
    pub fn show(address: SocketAddr, gallery: Arc<Gallery>) -> Result<Self, ServeError> {
        gallery.begin()?;
        // One thread in addition for the state, which waits for no tile.
        let computing = gallery.bounds.computing.max(1) + 1;
        Self::serve(address, product_routes(gallery), computing)
    }

    /// Start the server with `computing` threads for responses that take more than a millisecond.
    fn serve(address: SocketAddr, routes: Router, computing: usize) -> Result<Self, ServeError> {
        let fault = |source| ServeError::Listen { address, source };
        let listener = TcpListener::bind(address).map_err(fault)?;
        listener.set_nonblocking(true).map_err(fault)?;
        let address = listener.local_addr().map_err(fault)?;
        let secret = Secret::new()?;
        let mut runtime = tokio::runtime::Builder::new_current_thread();
        runtime
            .enable_io()
            .enable_time()
            .max_blocking_threads(computing);
        let runtime = runtime.build()?;
        let (stop, stopped) = oneshot::channel();
        let known = secret.clone();
        let serve = async move {
            if let Ok(listener) = tokio::net::TcpListener::from_std(listener) {
                connections::serve(listener, routes, known).await;
            }
        };
        let thread = thread::Builder::new()
            .name("page".to_owned())
            .spawn(move || {
                runtime.block_on(async {
                    tokio::select! {
                        () = serve => {}
                        _ = stopped => {}
                    }
                });
                // Remaining client tasks end with the runtime. Computations in progress are not waited for.
                runtime.shutdown_background();
            })?;
        Ok(Self {
            address,
            secret,
            stop: Some(stop),
            thread: Some(thread),
        })
    }

    /// Address that the server listens on, with the selected port.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Address of the page for a browser on this machine. It contains the secret: give it only to people who may see
    /// the page.
    pub fn url(&self) -> String {
        let mut address = self.address;
        if address.ip().is_unspecified() {
            address.set_ip(match address {
                SocketAddr::V4(_) => std::net::Ipv4Addr::LOCALHOST.into(),
                SocketAddr::V6(_) => std::net::Ipv6Addr::LOCALHOST.into(),
            });
        }
        format!("http://{address}/{}/", self.secret.word())
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
