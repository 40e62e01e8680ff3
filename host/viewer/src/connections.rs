//! Connection handling: accept within the limits, and serve until the connection ends, idles too long or is evicted.

use std::convert::Infallible;
use std::io;
use std::pin::{Pin, pin};
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use axum::Router;
use axum::body::Body;
use axum::extract::Request;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::time::{Instant, Sleep, sleep};

use crate::admission::{Admission, Entry, Seat};
use crate::guard::answer;
use crate::secret::Secret;

/// Idle timeout: a connection without reads or writes for this long is closed. The event stream sends at least every
/// five seconds.
const IDLE: Duration = Duration::from_secs(30);

/// Timeout for a complete request header, from the start of waiting for it.
const HEADER: Duration = Duration::from_secs(10);

/// Maximum length of a request header, and of read-ahead, bytes.
const HEADER_BYTES: usize = 16 << 10;

/// Pause after a failed accept, such as one caused by too many open files.
const PAUSE: Duration = Duration::from_millis(200);

/// Accept and serve connections within the limits. Never returns.
pub(crate) async fn serve(listener: TcpListener, routes: Router, secret: Secret) {
    let admission = Arc::new(Admission::default());
    loop {
        let (stream, from) = match listener.accept().await {
            Ok(accepted) => accepted,
            Err(_) => {
                sleep(PAUSE).await;
                continue;
            }
        };
        let seat = loop {
            match admission.enter(from.ip(), std::time::Instant::now()) {
                Entry::In(seat) => break Some(seat),
                Entry::Later => admission.gone().await,
                Entry::Refused => break None,
            }
        };
        if let Some(seat) = seat {
            tokio::spawn(converse(stream, seat, routes.clone(), secret.clone()));
        }
    }
}

/// Serve one connection.
async fn converse(stream: TcpStream, seat: Seat, routes: Router, secret: Secret) {
    let service = service_fn(|request: Request<Incoming>| {
        let asked = answer(&routes, &secret, &seat, request.map(Body::new));
        async { Ok::<_, Infallible>(asked.await) }
    });
    let mut http = http1::Builder::new();
    let connection = http
        .timer(TokioTimer::new())
        .header_read_timeout(HEADER)
        .max_buf_size(HEADER_BYTES)
        .serve_connection(TokioIo::new(Connection::new(stream)), service);
    let mut connection = pin!(connection);
    tokio::select! {
        // Errors here are the client's.
        _ = connection.as_mut() => {}
        () = seat.leave() => {}
    }
}

/// Connection that times out when idle.
struct Connection {
    stream: TcpStream,
    idle: Pin<Box<Sleep>>,
}

impl Connection {
    fn new(stream: TcpStream) -> Self {
        Self {
            stream,
            idle: Box::pin(sleep(IDLE)),
        }
    }

    /// Restart the idle timer after a read or write made progress, and check it otherwise.
    fn watch<T>(
        &mut self,
        context: &mut Context,
        came: Poll<io::Result<T>>,
    ) -> Poll<io::Result<T>> {
        if came.is_ready() {
            self.idle.as_mut().reset(Instant::now() + IDLE);
            return came;
        }
        match self.idle.as_mut().poll(context) {
            Poll::Ready(()) => Poll::Ready(Err(io::ErrorKind::TimedOut.into())),
            Poll::Pending => Poll::Pending,
        }
    }
}

impl AsyncRead for Connection {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context,
        buffer: &mut ReadBuf,
    ) -> Poll<io::Result<()>> {
        let came = Pin::new(&mut self.stream).poll_read(context, buffer);
        self.watch(context, came)
    }
}

impl AsyncWrite for Connection {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let came = Pin::new(&mut self.stream).poll_write(context, bytes);
        self.watch(context, came)
    }

    // With vectored writes, the body is not copied into a second buffer.
    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context,
        buffers: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let came = Pin::new(&mut self.stream).poll_write_vectored(context, buffers);
        self.watch(context, came)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }
}
