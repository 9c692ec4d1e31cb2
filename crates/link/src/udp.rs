//! Datagrams over UDP.

use crate::error::Error;
use crate::transport::{Datagram, MAX_DATAGRAM, Transport};
use std::io::ErrorKind;
use std::net::{SocketAddr, ToSocketAddrs, UdpSocket};
use std::time::Duration;

/// A UDP socket.
#[derive(Debug)]
pub struct Udp {
    socket: UdpSocket,
    address: SocketAddr,
    buffer: Vec<u8>,
    is_waiting: bool,
}

impl Udp {
    /// A socket bound to this address; port 0 is any that is free.
    ///
    /// # Errors
    /// If the address is taken or none of this machine.
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

    /// Where it is bound.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Waits for so long at most; not at all if that is zero.
    fn wait(&mut self, wait: Duration) -> std::io::Result<()> {
        // What is there is taken without waiting: a timeout is rounded up to milliseconds.
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
        loop {
            match self.socket.recv_from(&mut self.buffer) {
                Ok((length, from)) => return Ok(Some((from, &self.buffer[..length]))),
                // A sensor that is gone is refused by its machine, and the error comes back here.
                Err(error) if error.kind() == ErrorKind::ConnectionRefused => {}
                // Nothing is there.
                Err(_) => return Ok(None),
            }
        }
    }
}
