//! Check of the `Host` header against DNS rebinding.
//!
//! In DNS rebinding, a page of `evil.example` changes its own name to resolve to 127.0.0.1 after it is loaded, and then
//! reads from this server as its own origin. Such requests still carry the name `evil.example`. A numeric address
//! cannot be rebound, and `localhost` belongs to this machine.

use std::net::{IpAddr, Ipv6Addr};

/// Whether a request with this `Host` header is served: `localhost` or a numeric IP address, with or without a port.
pub fn may_ask(host: &str) -> bool {
    let name = match host.strip_prefix('[') {
        // [::1]:8080
        Some(rest) => {
            let Some((address, port)) = rest.split_once(']') else {
                return false;
            };
            let ours = address.parse::<Ipv6Addr>().is_ok();
            return ours && (port.is_empty() || port.strip_prefix(':').is_some_and(is_port));
        }
        None => match host.split_once(':') {
            Some((name, port)) if is_port(port) => name,
            Some(_) => return false,
            None => host,
        },
    };
    let is_v4 = matches!(name.parse(), Ok(IpAddr::V4(_)));
    is_v4 || name.eq_ignore_ascii_case("localhost")
}

fn is_port(text: &str) -> bool {
    text.parse::<u16>().is_ok() && text.bytes().all(|byte| byte.is_ascii_digit())
}

#[cfg(test)]
mod tests {
    use super::may_ask;

    #[test]
    fn localhost_and_numeric_addresses_are_accepted() {
        for host in [
            "localhost",
            "localhost:8080",
            "LOCALHOST:1",
            "127.0.0.1:8080",
            "127.0.0.1",
            "[::1]:8080",
            "[::1]",
            "192.168.1.20:80",
        ] {
            assert!(may_ask(host), "{host}");
        }
    }

    #[test]
    fn other_host_names_are_rejected() {
        for host in [
            "",
            ":",
            "evil.example",
            "evil.example:8080",
            "localhost.evil.example",
            "127.0.0.1.evil.example",
            "127.1",
            "2130706433",
            "0x7f000001",
            "localhost:",
            "localhost:99999",
            "localhost:+1",
            "localhost:1:2",
            "[::1",
            "[::1]x",
            "[localhost]:1",
            "::1",
            "[127.0.0.1]",
            "user@127.0.0.1",
            "localhost ",
            "127.0.0.1:80 ",
        ] {
            assert!(!may_ask(host), "{host}");
        }
    }
}
