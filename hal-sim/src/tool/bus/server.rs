//! One client at a time that speaks slcan over TCP.

use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};

use scarab::bus::Frame;

use super::slcan::{Line, tell};

/// A client that leaves so many bytes unread is gone.
const MOST_UNREAD: usize = 1 << 22;

struct Client {
    stream: TcpStream,
    line: Line,
    out: Vec<u8>,
}

/// The port and who is connected.
pub struct Server {
    listener: TcpListener,
    client: Option<Client>,
}

impl Server {
    /// Listens; port 0 is any that is free.
    pub fn new(address: SocketAddr) -> std::io::Result<Self> {
        let listener = TcpListener::bind(address)?;
        listener.set_nonblocking(true)?;
        Ok(Self { listener, client: None })
    }

    /// Where.
    pub fn address(&self) -> std::io::Result<SocketAddr> {
        self.listener.local_addr()
    }

    /// Takes what the client sent, and a new client once there is none.
    pub fn poll(&mut self, mut take: impl FnMut(Frame)) {
        self.read(&mut take);
        while let Ok((stream, _)) = self.listener.accept() {
            // One at a time: whoever comes second is sent away.
            if self.client.is_none()
                && stream.set_nonblocking(true).is_ok()
                && stream.set_nodelay(true).is_ok()
            {
                self.client = Some(Client { stream, line: Line::default(), out: Vec::new() });
            }
        }
        self.read(&mut take);
    }

    fn read(&mut self, take: &mut impl FnMut(Frame)) {
        let Some(client) = &mut self.client else { return };
        let mut bytes = [0; 4096];
        loop {
            match client.stream.read(&mut bytes) {
                Ok(0) => break self.client = None,
                Ok(count) => {
                    for byte in &bytes[..count] {
                        if let Some(frame) = client.line.hear(*byte, &mut client.out) {
                            take(frame);
                        }
                    }
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(_) => break self.client = None,
            }
        }
    }

    /// A frame for the client, if it listens.
    pub fn tell(&mut self, frame: &Frame) {
        if let Some(client) = self.client.as_mut().filter(|client| client.line.is_open()) {
            tell(frame, &mut client.out);
        }
    }

    /// Sends what waits, as much as the client takes.
    pub fn flush(&mut self) {
        let Some(client) = &mut self.client else { return };
        while !client.out.is_empty() {
            match client.stream.write(&client.out) {
                Ok(0) => return self.client = None,
                Ok(count) => {
                    client.out.drain(..count);
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(_) => return self.client = None,
            }
        }
        if client.out.len() > MOST_UNREAD {
            self.client = None;
        }
    }
}
