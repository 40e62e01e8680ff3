//! Tests of the server by hand-written requests.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::{Duration, Instant};

use serde_json::Value;
use subaperture_radio::live::Picture;
use subaperture_viewer::{MAX_CONNECTIONS, Server};

use crate::running::{Running, STEPS, captured};

pub(crate) fn serve(running: &Running) -> Server {
    Server::start(([127, 0, 0, 1], 0).into(), running.board.clone()).unwrap()
}

fn connect(address: SocketAddr) -> TcpStream {
    let stream = TcpStream::connect(address).unwrap();
    stream
        .set_read_timeout(Some(Duration::from_secs(20)))
        .unwrap();
    stream
}

fn ask(stream: &mut TcpStream, path: &str, host: &str) {
    let request = format!("GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n");
    stream.write_all(request.as_bytes()).unwrap();
}

/// Path with the page's secret prepended.
pub(crate) fn secret(server: &Server, path: &str) -> String {
    let url = server.url();
    let rest = url.strip_prefix(&format!("http://{}/", server.address()));
    format!("/{}{path}", rest.unwrap().trim_end_matches('/'))
}

/// Headers and body of the response to a request with the secret.
fn answer(server: &Server, path: &str, host: &str) -> (String, Vec<u8>) {
    answer_to(server.address(), &secret(server, path), host)
}

/// Headers and body of a response.
fn answer_to(address: SocketAddr, path: &str, host: &str) -> (String, Vec<u8>) {
    let mut stream = connect(address);
    ask(&mut stream, path, host);
    let mut all = Vec::new();
    stream.read_to_end(&mut all).unwrap();
    let end = all.windows(4).position(|four| four == b"\r\n\r\n").unwrap();
    let head = String::from_utf8(all[..end].to_vec()).unwrap();
    (head.to_lowercase(), all.split_off(end + 4))
}

/// Next event of an event stream, up to the blank line that ends it.
fn event(stream: &mut TcpStream, kept: &mut String) -> Value {
    let begun = Instant::now();
    loop {
        if let Some(at) = kept.find("data: ")
            && let Some(end) = kept[at..].find("\n\n")
        {
            let read = serde_json::from_str(&kept[at + 6..at + end]).unwrap();
            kept.drain(..at + end + 2);
            return read;
        }
        let mut some = [0; 1 << 16];
        let count = stream.read(&mut some).unwrap();
        assert!(count > 0 && begun.elapsed() < Duration::from_secs(20));
        // Chunk sizes lie between events; each event is one chunk here.
        kept.push_str(&String::from_utf8_lossy(&some[..count]));
    }
}

fn sweeps(event: &Value) -> Vec<u64> {
    let rows = event["rows"].as_array().unwrap().iter();
    rows.map(|row| row["sweep"].as_u64().unwrap()).collect()
}

/// The page and its resources are served with the protective headers. Other paths and other host names are refused.
#[test]
fn page_is_served_under_its_own_names_only() {
    let running = captured("names", 1);
    let server = serve(&running);
    let address = server.address();
    assert!(address.ip().is_loopback() && server.url().starts_with(&format!("http://{address}/")));
    for (path, kind) in [
        ("/", "text/html"),
        ("/page.css", "text/css"),
        ("/page.js", "text/javascript"),
        ("/colours", "application/json"),
    ] {
        let (head, body) = answer(&server, path, &format!("localhost:{}", address.port()));
        assert!(
            head.starts_with("http/1.1 200") && head.contains(kind),
            "{path}: {head}"
        );
        for header in [
            "content-security-policy: default-src 'none'",
            "x-content-type-options: nosniff",
            "same-origin",
        ] {
            assert!(head.contains(header), "{path}: {head}");
        }
        assert!(
            !head.contains("access-control") && body.len() > 1000,
            "{path}: {head}"
        );
        // Nothing is loaded from elsewhere.
        let text = String::from_utf8(body).unwrap();
        assert!(!text.contains("http://") && !text.contains("https://") && !text.contains("//cdn"));
    }
    for path in ["/picture", "/../Cargo.toml", "/page.js/"] {
        let (head, _) = answer(&server, path, "127.0.0.1");
        assert!(head.starts_with("http/1.1 404"), "{path}: {head}");
    }
    for host in ["evil.example", "127.0.0.1.evil.example:80", ""] {
        for path in ["/", "/events", "/picture"] {
            let (head, body) = answer(&server, path, host);
            assert!(head.starts_with("http/1.1 421"), "{host}: {head}");
            assert!(
                String::from_utf8(body)
                    .unwrap()
                    .contains("http://127.0.0.1")
            );
        }
    }
    let colours: Value =
        serde_json::from_slice(&answer(&server, "/colours", "localhost").1).unwrap();
    let [first, last] = [0, 255].map(|i| colours["viridis"][i].clone());
    assert_eq!(
        (first, last),
        (
            serde_json::json!([68, 1, 84]),
            serde_json::json!([253, 231, 37])
        )
    );
}

/// A client receives the state at once and then each new row once. A later client receives the rows that are kept.
#[test]
fn events_send_each_sweep_once() {
    let mut running = captured("events", 9);
    running.show(0..2);
    let server = serve(&running);
    let mut stream = connect(server.address());
    ask(&mut stream, &secret(&server, "/events"), "localhost");
    let mut kept = String::new();
    let first = event(&mut stream, &mut kept);
    assert_eq!(
        (sweeps(&first), first["sweep"].as_u64()),
        (vec![0, 1], Some(1))
    );
    assert_eq!(first["name"], "events");
    let row = running.board.latest_row().unwrap();
    let levels = first["rows"][1]["levels"].as_array().unwrap();
    assert_eq!(levels.len(), row.levels_db.len());
    for (sent, db) in levels.iter().zip(&row.levels_db) {
        // Rounded to tenths.
        assert!((sent.as_f64().unwrap() / 10.0 - f64::from(*db)).abs() < 0.051);
    }
    let (status, _) = running.board.status();
    for (channel, level) in [&first["reference"], &first["echo"]]
        .into_iter()
        .zip(status.levels)
    {
        assert!((channel["rms_db"].as_f64().unwrap() - 20.0 * level.rms.log10()).abs() < 1e-9);
    }
    assert_eq!(first["taken"], 2 * STEPS as u64);
    // While nothing changes, only a keep-alive comment is sent, after five seconds. Then a sweep follows.
    running.show(2..3);
    let second = event(&mut stream, &mut kept);
    assert_eq!(sweeps(&second), [2]);
    running.show(3..9);
    running.board.end("done");
    let mut received = Vec::new();
    let last = loop {
        let next = event(&mut stream, &mut kept);
        received.extend(sweeps(&next));
        if !next["ended"].is_null() {
            break next;
        }
    };
    // Six rows are kept: none is missing if all are sent in time.
    assert_eq!(
        (received, last["ended"].as_str()),
        ((3..9).collect(), Some("done"))
    );
    let counts = &running.summary;
    assert_eq!(last["events"]["overflows"], counts.events[0]);
    assert_eq!(last["events"]["lost_packets"], counts.events[3]);
    assert_eq!(last["flagged_ever"]["late"], counts.flagged[0]);
    assert_eq!(
        (last["lost_samples"].as_u64(), last["bursts"].as_u64()),
        (Some(counts.lost_samples), Some(counts.bursts))
    );
    let mut late = connect(server.address());
    ask(&mut late, &secret(&server, "/events"), "localhost");
    assert_eq!(
        sweeps(&event(&mut late, &mut String::new())),
        (3..9).collect::<Vec<_>>()
    );
}

/// The image is sent in tenths of dB with rows in ascending y, and its size and position in the events.
#[test]
fn image_is_announced_in_events_and_fetched() {
    let running = captured("image", 1);
    let server = serve(&running);
    running.board.show_picture(Picture {
        columns: 3,
        x_m: [-1.0, 1.0],
        y_m: [2.0, 3.0],
        levels_db: vec![-3.04, 0.0, f32::NEG_INFINITY, f32::NAN, -99.96, 12.5],
        pulses: 7,
    });
    let mut stream = connect(server.address());
    ask(&mut stream, &secret(&server, "/events"), "localhost");
    let about = event(&mut stream, &mut String::new())["picture"].clone();
    assert_eq!(
        (
            about["columns"].as_u64(),
            about["rows"].as_u64(),
            about["pulses"].as_u64()
        ),
        (Some(3), Some(2), Some(7))
    );
    assert_eq!(about["highest_db"], 12.5);
    let (_, body) = answer(&server, "/picture", "localhost");
    let levels: Vec<i16> = body
        .chunks(2)
        .map(|two| i16::from_le_bytes([two[0], two[1]]))
        .collect();
    assert_eq!(levels, [-30, 0, -32767, -32768, -1000, 125]);
}

/// With the maximum number of clients that read nothing, plus one: the board accepts sweeps as before, the extra client
/// is served once another disconnects, and the server stops at once with all of them connected.
#[test]
fn clients_that_do_not_read_block_neither_capture_nor_shutdown() {
    let mut running = captured("slow", 9);
    let server = serve(&running);
    let mut idle: Vec<TcpStream> = (0..MAX_CONNECTIONS)
        .map(|_| connect(server.address()))
        .collect();
    for stream in &mut idle {
        ask(stream, &secret(&server, "/events"), "localhost");
    }
    // All are accepted: each has received the start of a response.
    for stream in &mut idle {
        assert_eq!(stream.read(&mut [0; 1]).unwrap(), 1);
    }
    let mut more = connect(server.address());
    ask(&mut more, &secret(&server, "/colours"), "localhost");
    more.set_read_timeout(Some(Duration::from_millis(300)))
        .unwrap();
    assert!(more.read(&mut [0; 1]).is_err());
    running.show(0..9);
    assert_eq!(running.board.status().0.sweep, Some(8));
    idle.pop();
    more.set_read_timeout(Some(Duration::from_secs(20)))
        .unwrap();
    assert_eq!(more.read(&mut [0; 1]).unwrap(), 1);
    drop(server);
    assert!(
        TcpStream::connect_timeout(&idle[0].peer_addr().unwrap(), Duration::from_millis(500))
            .is_err()
    );
}

/// Requests without the secret, or with that of another page, are refused: no page, events or image.
#[test]
fn requests_without_secret_are_refused() {
    let running = captured("secret", 1);
    let (server, other) = (serve(&running), serve(&running));
    assert_ne!(secret(&server, ""), secret(&other, ""));
    for path in ["/", "/page.js", "/colours", "/events", "/picture"] {
        let cut = &secret(&server, "")[..20];
        for path in [
            path.to_owned(),
            secret(&other, path),
            format!("{cut}{path}"),
        ] {
            let (head, body) = answer_to(server.address(), &path, "localhost");
            assert!(head.starts_with("http/1.1 403"), "{path}: {head}");
            assert!(
                head.contains("connection: close") && body.len() < 200,
                "{path}: {head}"
            );
        }
    }
    let (head, _) = answer_to(server.address(), "/favicon.ico", "localhost");
    assert!(head.starts_with("http/1.1 204"), "{head}");
}

/// More clients than the maximum that start a request and never finish it do not lock out others.
#[test]
fn unfinished_requests_do_not_lock_out_other_clients() {
    let running = captured("begun", 1);
    let server = serve(&running);
    let mut begun = Vec::new();
    for _ in 0..2 * MAX_CONNECTIONS {
        let mut stream = connect(server.address());
        stream.write_all(b"GET / HTTP/1.1\r\nHost: local").unwrap();
        begun.push(stream);
    }
    let (head, _) = answer(&server, "/colours", "localhost");
    assert!(head.starts_with("http/1.1 200"), "{head}");
    // The first connections were evicted.
    let ended = begun[0].read(&mut [0; 1]);
    assert!(!matches!(ended, Ok(1..)), "{ended:?}");
}

/// A header longer than any browser sends is refused instead of buffered.
#[test]
fn endless_header_is_refused() {
    let running = captured("header", 1);
    let server = serve(&running);
    let mut stream = connect(server.address());
    stream.write_all(b"GET / HTTP/1.1\r\n").unwrap();
    let line = format!("X: {}\r\n", "x".repeat(1000));
    let mut sent = 0;
    // The server closes the connection after 16 KiB plus what the operating system buffers.
    while stream.write_all(line.as_bytes()).is_ok() {
        sent += line.len();
        assert!(sent < 64 << 20);
    }
    let (head, _) = answer(&server, "/colours", "localhost");
    assert!(head.starts_with("http/1.1 200"), "{head}");
}

/// The error for an address already in use names the address.
#[test]
fn address_in_use_is_reported() {
    let running = captured("taken", 1);
    let server = serve(&running);
    let error = Server::start(server.address(), running.board.clone())
        .unwrap_err()
        .to_string();
    assert!(
        error.contains(&server.address().to_string()) && error.contains("port 0"),
        "{error}"
    );
}
