//! Whether a request was meant for this server.
//!
//! DNS rebinding: a page of `evil.example` has its name resolve to 127.0.0.1 once it is loaded, and then reads from there as its own. The
//! requests still carry its name. An address in digits resolves to nothing else, and `localhost` is the machine's own.

use std::net::{IpAddr, Ipv6Addr};

/// Whether a request with this `Host` header is served.
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
    fn addresses_in_digits_and_localhost_are_served() {
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
    fn names_of_others_are_not() {
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
