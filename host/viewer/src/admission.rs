//! Limits on connections: in total and per client address, with eviction of connections that never authenticate.
//!
//! A connection is authenticated once it has requested a path with the page's secret. When the server is full, the
//! oldest connection that is still unauthenticated after [`GRACE`] is closed to make room for a new one. Idle
//! connections therefore cannot block the server.

use std::collections::BTreeMap;
use std::net::IpAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tokio::sync::Notify;

/// Maximum number of concurrent connections. A browser opens up to six per page.
pub const MAX_CONNECTIONS: usize = 48;

/// Maximum number of concurrent connections from one remote address. All programs of this machine share one address, so
/// the limit does not apply to loopback.
pub const MAX_OF_A_CLIENT: usize = 16;

/// Time before an unauthenticated connection may be evicted.
pub(crate) const GRACE: Duration = Duration::from_secs(1);

/// Open connections.
#[derive(Default)]
pub(crate) struct Admission {
    seats: Mutex<Seats>,
    /// Notified when a connection ends.
    gone: Notify,
}

#[derive(Default)]
struct Seats {
    /// Keyed by order of arrival.
    taken: BTreeMap<u64, Taken>,
    next: u64,
}

struct Taken {
    address: IpAddr,
    since: Instant,
    known: bool,
    leave: Arc<Notify>,
}

impl Seats {
    /// Evict the oldest unauthenticated connection older than [`GRACE`] whose address matches `of`. Returns whether one
    /// was evicted.
    fn evict(&mut self, now: Instant, of: impl Fn(IpAddr) -> bool) -> bool {
        let late = |seat: &Taken| !seat.known && now.duration_since(seat.since) >= GRACE;
        let mut seats = self.taken.iter();
        let number = seats.find(|(_, seat)| late(seat) && of(seat.address));
        let number = number.map(|(&number, _)| number);
        let seat = number.and_then(|number| self.taken.remove(&number));
        seat.inspect(|seat| seat.leave.notify_one()).is_some()
    }
}

/// Result of a connection attempt.
pub(crate) enum Entry {
    /// Accepted.
    In(Seat),
    /// The server is full: try again later.
    Later,
    /// The client address has reached its own limit.
    Refused,
}

impl Admission {
    fn seats(&self) -> MutexGuard<'_, Seats> {
        self.seats.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Admit a connection from `address` at time `now`.
    pub(crate) fn enter(self: &Arc<Self>, address: IpAddr, now: Instant) -> Entry {
        let mut seats = self.seats();
        let own = |other: IpAddr| other == address;
        let count = seats
            .taken
            .values()
            .filter(|seat| own(seat.address))
            .count();
        if !address.is_loopback() && count >= MAX_OF_A_CLIENT && !seats.evict(now, own) {
            return Entry::Refused;
        }
        if seats.taken.len() >= MAX_CONNECTIONS && !seats.evict(now, |_| true) {
            return Entry::Later;
        }
        let number = seats.next;
        seats.next += 1;
        let leave = Arc::new(Notify::new());
        let taken = Taken {
            address,
            since: now,
            known: false,
            leave: Arc::clone(&leave),
        };
        seats.taken.insert(number, taken);
        Entry::In(Seat {
            admission: Arc::clone(self),
            number,
            leave,
        })
    }

    /// Wait until a connection ends, or until one may have become evictable.
    pub(crate) async fn gone(&self) {
        let _ = tokio::time::timeout(GRACE / 10, self.gone.notified()).await;
    }
}

/// Slot of an open connection, released on drop.
pub(crate) struct Seat {
    admission: Arc<Admission>,
    number: u64,
    leave: Arc<Notify>,
}

impl Seat {
    /// Mark the connection as authenticated: it requested a path with the secret.
    pub(crate) fn is_known(&self) {
        if let Some(seat) = self.admission.seats().taken.get_mut(&self.number) {
            seat.known = true;
        }
    }

    /// Wait until the connection is evicted.
    pub(crate) async fn leave(&self) {
        self.leave.notified().await;
    }
}

impl Drop for Seat {
    fn drop(&mut self) {
        self.admission.seats().taken.remove(&self.number);
        self.admission.gone.notify_one();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HERE: IpAddr = IpAddr::V4(std::net::Ipv4Addr::LOCALHOST);

    fn there(last: u8) -> IpAddr {
        IpAddr::from([192, 0, 2, last])
    }

    fn seat(admission: &Arc<Admission>, address: IpAddr, now: Instant) -> Option<Seat> {
        match admission.enter(address, now) {
            Entry::In(seat) => Some(seat),
            Entry::Later | Entry::Refused => None,
        }
    }

    #[test]
    fn unauthenticated_connections_are_evicted_when_full() {
        let admission = Arc::new(Admission::default());
        let begun = Instant::now();
        let known = seat(&admission, HERE, begun).unwrap();
        known.is_known();
        let mut idle = Vec::new();
        for _ in 1..MAX_CONNECTIONS {
            idle.push(seat(&admission, HERE, begun).unwrap());
        }
        // None has exceeded the grace period yet.
        assert!(matches!(admission.enter(HERE, begun), Entry::Later));
        let later = begun + GRACE;
        let new = seat(&admission, HERE, later).unwrap();
        let there = |seat: &Seat| admission.seats().taken.contains_key(&seat.number);
        assert!(there(&known) && there(&new) && !there(&idle[0]) && there(&idle[1]));
        for _ in 1..idle.len() {
            let _ = seat(&admission, HERE, later).map(|seat| idle.push(seat));
        }
        assert_eq!(admission.seats().taken.len(), MAX_CONNECTIONS);
        assert!(there(&known));
        assert!(matches!(admission.enter(HERE, later), Entry::Later));
    }

    #[test]
    fn new_connections_wait_while_all_are_authenticated() {
        let admission = Arc::new(Admission::default());
        let begun = Instant::now();
        let mut seats: Vec<Seat> = Vec::new();
        for _ in 0..MAX_CONNECTIONS {
            let one = seat(&admission, HERE, begun).unwrap();
            one.is_known();
            seats.push(one);
        }
        let later = begun + 10 * GRACE;
        assert!(matches!(admission.enter(there(1), later), Entry::Later));
        seats.pop();
        assert!(seat(&admission, there(1), later).is_some());
    }

    #[test]
    fn remote_address_has_its_own_connection_limit() {
        let admission = Arc::new(Admission::default());
        let begun = Instant::now();
        let mut seats = Vec::new();
        for _ in 0..MAX_OF_A_CLIENT {
            let one = seat(&admission, there(1), begun).unwrap();
            one.is_known();
            seats.push(one);
        }
        assert!(matches!(admission.enter(there(1), begun), Entry::Refused));
        assert!(seat(&admission, there(2), begun).is_some());
        // An unauthenticated connection from the same address is evicted.
        seats.pop();
        let _idle = seat(&admission, there(1), begun).unwrap();
        assert!(seat(&admission, there(1), begun + GRACE).is_some());
    }
}
