//! Datagrams over UDP.

use crate::error::Error;
use crate::transport::{Datagram, MAX_DATAGRAM, Transport};
use std::io::ErrorKind;
use std::net::{SocketAddr, ToSocketAddrs, UdpSocket};
use std::time::Duration;

/// Pause after an error that may pass.
const PAUSE: Duration = Duration::from_millis(100);
/// Largest number of errors of earlier datagrams that one read skips.
const MAX_ERRORS: usize = 64;

/// A UDP socket.
#[derive(Debug)]
pub struct Udp {
    socket: UdpSocket,
    address: SocketAddr,
    buffer: Vec<u8>,
    is_waiting: bool,
}

impl Udp {
    /// A socket bound to this address. Port 0 means any free port.
    ///
    /// # Errors
    /// If the address is in use or not an address of this machine.
    pub fn bind(address: impl ToSocketAddrs + std::fmt::Display) -> Result<Self, Error> {
        let bound = UdpSocket::bind(&address).and_then(|socket| Ok((socket.local_addr()?, socket)));
        let (address, socket) = bound.map_err(|source| Error::socket(address, source))?;
        Ok(Self {
            socket,
            address,
            buffer: vec![0; MAX_DATAGRAM],
            is_waiting: true,
        })
    }

    /// The address that the socket is bound to.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Sets the longest wait of the next read; zero means no wait.
    fn wait(&mut self, wait: Duration) -> std::io::Result<()> {
        // With zero wait the socket is non-blocking: a timeout would be rounded up to milliseconds.
        if self.is_waiting == wait.is_zero() {
            self.is_waiting = !wait.is_zero();
            self.socket.set_nonblocking(!self.is_waiting)?;
        }
        match self.is_waiting {
            true => self.socket.set_read_timeout(Some(wait)),
            false => Ok(()),
        }
    }
}

impl Transport for Udp {
    type Address = SocketAddr;

    fn send(&mut self, to: &SocketAddr, bytes: &[u8]) {
        let _ = self.socket.send_to(bytes, to);
    }

    fn receive(&mut self, wait: Duration) -> Result<Option<Datagram<'_, SocketAddr>>, Error> {
        self.wait(wait).map_err(|source| Error::socket(self.address, source))?;
        // Errors of earlier datagrams are bounded, so that a router that refuses all does not keep the caller here.
        for _ in 0..MAX_ERRORS {
            match self.socket.recv_from(&mut self.buffer) {
                Ok((length, from)) => return Ok(Some((from, &self.buffer[..length]))),
                Err(error) => match error.kind() {
                    ErrorKind::WouldBlock | ErrorKind::TimedOut => return Ok(None),
                    // The machine of a receiver that has ended, or a router before it, refused a datagram that was sent earlier: the error
                    // arrives here. It says nothing about those that come.
                    ErrorKind::Interrupted
                    | ErrorKind::ConnectionRefused
                    | ErrorKind::ConnectionReset
                    | ErrorKind::HostUnreachable
                    | ErrorKind::NetworkUnreachable => {}
                    // The interface may come back, and memory too. The pause keeps the caller from spinning.
                    ErrorKind::NetworkDown | ErrorKind::OutOfMemory => {
                        std::thread::sleep(wait.min(PAUSE));
                        return Ok(None);
                    }
                    _ => return Err(Error::socket(self.address, error)),
                },
            }
        }
        Ok(None)
    }
}
