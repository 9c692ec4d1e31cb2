//! A sensor's socket towards a centre whose name has several addresses.

use fewbits_link::{Datagram, Error, Transport, Udp};
use std::net::{IpAddr, SocketAddr};
use std::time::Duration;

/// Sends to the addresses of a centre in turn until a frame of the centre was accepted, then always to the one that answered. `localhost`
/// is one of IPv6 and one of IPv4 on most machines, and a centre listens at one of them.
pub(crate) struct Towards {
    socket: Udp,
    all: Vec<SocketAddr>,
    next: usize,
    is_found: bool,
    from: Option<SocketAddr>,
}

impl Towards {
    /// A socket that reaches the addresses; those of IPv6 are left out where the machine has none.
    ///
    /// # Errors
    /// If no socket can be opened, or `all` is empty.
    pub(crate) fn open(mut all: Vec<SocketAddr>) -> Result<Self, Error> {
        let four = || Udp::bind("0.0.0.0:0");
        let (has_four, has_six) = (all.iter().any(SocketAddr::is_ipv4), all.iter().any(SocketAddr::is_ipv6));
        let socket = match (has_six, has_four) {
            (true, false) => Udp::bind("[::]:0")?,
            // One of IPv6 reaches both.
            (true, true) => match Udp::bind("[::]:0") {
                Ok(socket) => socket,
                Err(_) => {
                    all.retain(SocketAddr::is_ipv4);
                    four()?
                }
            },
            _ => four()?,
        };
        Ok(Self {
            socket,
            all,
            next: 0,
            is_found: false,
            from: None,
        })
    }

    /// The address as the socket takes it.
    fn mapped(&self, to: SocketAddr) -> SocketAddr {
        match (self.socket.address().is_ipv6(), to.ip()) {
            (true, IpAddr::V4(ip)) => SocketAddr::new(ip.to_ipv6_mapped().into(), to.port()),
            _ => to,
        }
    }
}

fn canonical(address: SocketAddr) -> SocketAddr {
    SocketAddr::new(address.ip().to_canonical(), address.port())
}

impl Transport for Towards {
    type Address = SocketAddr;

    fn send(&mut self, to: &SocketAddr, bytes: &[u8]) {
        let to = self.mapped(self.all.get(self.next).copied().unwrap_or(*to));
        self.socket.send(&to, bytes);
        if !self.is_found {
            self.next = (self.next + 1) % self.all.len().max(1);
        }
    }

    fn receive(&mut self, wait: Duration) -> Result<Option<Datagram<'_, SocketAddr>>, Error> {
        let arrived = self.socket.receive(wait)?.map(|(from, bytes)| (canonical(from), bytes));
        self.from = arrived.as_ref().map(|(from, _)| *from);
        Ok(arrived)
    }

    fn accepted(&mut self) {
        if std::mem::replace(&mut self.is_found, true) {
            return;
        }
        let from = self
            .from
            .and_then(|from| self.all.iter().position(|own| canonical(*own) == from));
        // A centre may answer from an address that is none of these: then the last one that was tried has reached it.
        let count = self.all.len().max(1);
        self.next = from.unwrap_or((self.next + count - 1) % count);
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// Two addresses, of which the second answers: each is tried, then only the second.
    #[test]
    fn the_address_that_answers_is_kept() {
        let mut centre = Udp::bind("127.0.0.1:0").unwrap();
        let silent = Udp::bind("127.0.0.1:0").unwrap();
        let six = Udp::bind("[::1]:0");
        let mut all = vec![silent.address(), centre.address()];
        if let Ok(six) = &six {
            all.insert(0, six.address());
        }
        let count = all.len();
        let mut socket = Towards::open(all.clone()).unwrap();
        (0..count).for_each(|_| socket.send(&all[0], b"hello"));
        let (from, bytes) = centre.receive(Duration::from_secs(60)).unwrap().unwrap();
        assert_eq!(bytes, b"hello");
        centre.send(&from, b"answer");
        let arrived = socket
            .receive(Duration::from_secs(60))
            .unwrap()
            .map(|(from, bytes)| (from, bytes.to_vec()));
        assert_eq!(arrived, Some((centre.address(), b"answer".to_vec())));
        socket.accepted();
        for number in 0..5_u8 {
            socket.send(&all[0], &[number]);
            assert_eq!(centre.receive(Duration::from_secs(60)).unwrap().unwrap().1, [number]);
        }
    }
}
