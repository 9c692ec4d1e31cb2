//! Datagrams over UDP.
//!
//! A thread reads the socket and does nothing else. The socket's own buffer holds some hundred datagrams. It would overflow while the owner
//! computes an update or writes a state, and reports would be lost together with whatever filled it.

use crate::error::Error;
use crate::transport::{Datagram, MAX_DATAGRAM, Transport};
use socket2::SockRef;
use std::io::ErrorKind;
use std::net::{SocketAddr, ToSocketAddrs, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError, TryRecvError};
use std::thread::JoinHandle;
use std::time::Duration;

/// Pause after an error that may pass.
const PAUSE: Duration = Duration::from_millis(100);
/// The reading thread looks this often whether its owner still exists.
const LOOK_EVERY: Duration = Duration::from_millis(100);
/// Longest wait for room to send.
const SEND_WITHIN: Duration = Duration::from_millis(1);
/// Size of the socket's buffer that is asked for, in bytes. Systems grant less unless they are told to.
const SOCKET_BUFFER: usize = 4 << 20;
/// Largest size of the datagrams that wait for the owner, in bytes.
const MAX_QUEUED: usize = 32 << 20;
/// What a datagram takes beside its bytes: address, length, allocation.
const ENTRY: usize = 96;

/// A UDP socket.
#[derive(Debug)]
pub struct Udp {
    socket: UdpSocket,
    address: SocketAddr,
    arrived: mpsc::Receiver<Arrived>,
    /// The datagram that was read last.
    last: Vec<u8>,
    queue: Arc<Queue>,
    reader: Option<JoinHandle<()>>,
}

/// A datagram, or the error that ended the reading.
type Arrived = std::io::Result<(SocketAddr, Vec<u8>)>;

/// What the reading thread and the owner share.
#[derive(Debug, Default)]
struct Queue {
    bytes: AtomicUsize,
    dropped: AtomicU64,
    is_over: AtomicBool,
}

impl Udp {
    /// A socket bound to this address. Port 0 means any free port.
    ///
    /// # Errors
    /// If the address is in use or not an address of this machine, or no thread can be started.
    pub fn bind(address: impl ToSocketAddrs + std::fmt::Display) -> Result<Self, Error> {
        let bound = UdpSocket::bind(&address).and_then(|socket| Ok((socket.local_addr()?, socket)));
        let (address, socket) = bound.map_err(|source| Error::socket(address, source))?;
        Self::reading(socket, address).map_err(|source| Error::socket(address, source))
    }

    fn reading(socket: UdpSocket, address: SocketAddr) -> std::io::Result<Self> {
        // A smaller buffer is no error: the thread empties it.
        let _ = SockRef::from(&socket).set_recv_buffer_size(SOCKET_BUFFER);
        socket.set_read_timeout(Some(LOOK_EVERY))?;
        socket.set_write_timeout(Some(SEND_WITHIN))?;
        let queue = Arc::new(Queue::default());
        let (sender, arrived) = mpsc::channel();
        let (own, shared) = (socket.try_clone()?, queue.clone());
        let thread = std::thread::Builder::new().name("udp".into());
        let reader = thread.spawn(move || read(&own, &shared, &sender))?;
        Ok(Self {
            socket,
            address,
            arrived,
            last: Vec::new(),
            queue,
            reader: Some(reader),
        })
    }

    /// The address that the socket is bound to.
    pub fn address(&self) -> SocketAddr {
        self.address
    }
}

/// Reads datagrams into the queue until the owner is gone or the socket fails.
fn read(socket: &UdpSocket, queue: &Queue, sender: &mpsc::Sender<Arrived>) {
    let mut buffer = vec![0; MAX_DATAGRAM];
    while !queue.is_over.load(Ordering::Relaxed) {
        match socket.recv_from(&mut buffer) {
            Ok((length, from)) => {
                let size = length + ENTRY;
                if queue.bytes.fetch_add(size, Ordering::Relaxed) + size > MAX_QUEUED {
                    queue.bytes.fetch_sub(size, Ordering::Relaxed);
                    queue.dropped.fetch_add(1, Ordering::Relaxed);
                } else if sender.send(Ok((from, buffer[..length].to_vec()))).is_err() {
                    return;
                }
            }
            Err(error) => match error.kind() {
                ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted => {}
                // The machine of a receiver that has ended, or a router before it, refused a datagram that was sent earlier: the error
                // arrives here. It says nothing about those that come.
                ErrorKind::ConnectionRefused
                | ErrorKind::ConnectionReset
                | ErrorKind::HostUnreachable
                | ErrorKind::NetworkUnreachable => {}
                // The interface may come back, and memory too. The pause keeps the thread from spinning.
                ErrorKind::NetworkDown | ErrorKind::OutOfMemory => {
                    tracing::warn!(%error, "the socket cannot be read for a moment");
                    std::thread::sleep(PAUSE);
                }
                _ => {
                    let _ = sender.send(Err(error));
                    return;
                }
            },
        }
    }
}

impl Drop for Udp {
    /// Waits for the thread, so that the address is free again.
    fn drop(&mut self) {
        self.queue.is_over.store(true, Ordering::Relaxed);
        // Wakes the thread. If this does not arrive, it wakes by its own clock.
        let mut own = self.address;
        if own.ip().is_unspecified() {
            own.set_ip(match own {
                SocketAddr::V4(_) => std::net::Ipv4Addr::LOCALHOST.into(),
                SocketAddr::V6(_) => std::net::Ipv6Addr::LOCALHOST.into(),
            });
        }
        let _ = self.socket.send_to(&[], own);
        if let Some(reader) = self.reader.take() {
            let _ = reader.join();
        }
    }
}

impl Transport for Udp {
    type Address = SocketAddr;

    fn send(&mut self, to: &SocketAddr, bytes: &[u8]) {
        let _ = self.socket.send_to(bytes, to);
    }

    fn receive(&mut self, wait: Duration) -> Result<Option<Datagram<'_, SocketAddr>>, Error> {
        let arrived = match wait.is_zero() {
            true => self
                .arrived
                .try_recv()
                .map_err(|none| none == TryRecvError::Disconnected),
            false => self
                .arrived
                .recv_timeout(wait)
                .map_err(|none| none == RecvTimeoutError::Disconnected),
        };
        match arrived {
            Ok(Ok((from, bytes))) => {
                self.queue.bytes.fetch_sub(bytes.len() + ENTRY, Ordering::Relaxed);
                self.last = bytes;
                Ok(Some((from, &self.last)))
            }
            Ok(Err(source)) => Err(Error::socket(self.address, source)),
            Err(false) => Ok(None),
            // The thread ended with an error that was returned before.
            Err(true) => Err(Error::socket(self.address, ErrorKind::NotConnected.into())),
        }
    }

    /// Datagrams that arrived while 32 MiB waited. What the system dropped before is not counted.
    fn dropped(&self) -> u64 {
        self.queue.dropped.load(Ordering::Relaxed)
    }
}
