//! slcan over TCP for one client at a time, and for listeners.
//!
//! A connection becomes the client when it opens the channel, so a silent connection does not block others.
//! While a client has the channel, another connection that opens it is refused with a line that gives the
//! reason, and a bell. Connections that open it to listen only receive every frame of the bus.

use core::fmt::{Display, Formatter, Result as Formatted};
use std::collections::VecDeque;
use std::io::{ErrorKind, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::time::{Duration, Instant};

use scarab::bus::Frame;
use socket2::{SockRef, TcpKeepalive};

use scarab_client::slcan::{BELL, DONE, Line, Received, TAKEN, encode};

/// Unread bytes after which a client is disconnected.
const MOST_UNREAD: usize = 1 << 22;
/// Bytes read from a connection at once: several times what the bus carries until the next read.
const MOST_AT_ONCE: usize = 4096;
/// Limit of connections without a channel, of listeners, and of refused ones. A further connection displaces
/// the oldest; a further listener is refused.
const MOST_CONNECTIONS: usize = 8;
/// Time for a refused connection to read the reason.
const REFUSED_FOR: Duration = Duration::from_secs(1);
/// A connection without a byte for this time is probed; without an answer it ends after all probes.
const QUIET: Duration = Duration::from_secs(5);
const PROBE: Duration = Duration::from_secs(1);
const PROBES: u32 = 5;

/// Event of a connection.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum What {
    /// Connected, without a channel yet.
    Connected,
    /// Opened the channel: the connection is now the client.
    Opened,
    /// The client closed the channel; it may open the channel again.
    Closed,
    /// Listens only from now on.
    Listens,
    /// Listened, and closed the channel.
    Listened,
    /// Ended for this reason; `true` for the client's connection.
    Gone(&'static str, bool),
    /// Refused, because this client has the channel.
    Refused(SocketAddr),
    /// Refused, because as many listen as can.
    Full,
}

/// An event and its connection.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Event {
    /// Address of the connection.
    pub(crate) peer: SocketAddr,
    /// What happened.
    pub what: What,
}

impl Event {
    /// Whether the client has disconnected.
    pub const fn ends(&self) -> bool {
        matches!(self.what, What::Closed | What::Gone(_, true))
    }
}

impl Display for Event {
    fn fmt(&self, f: &mut Formatter<'_>) -> Formatted {
        write!(f, "client {}: ", self.peer)?;
        match self.what {
            What::Connected => f.write_str("connected"),
            What::Opened => f.write_str("opened the channel"),
            What::Closed => f.write_str("closed the channel: the boards' plug is pulled"),
            What::Listens => f.write_str("listens"),
            What::Listened => f.write_str("listens no longer"),
            What::Gone(why, true) => write!(f, "disconnected ({why}): the boards' plug is pulled"),
            What::Gone(why, false) => write!(f, "disconnected ({why})"),
            What::Refused(client) => write!(f, "refused, {client} has the channel"),
            What::Full => write!(f, "refused, {MOST_CONNECTIONS} listen already"),
        }
    }
}

struct Connection {
    stream: TcpStream,
    peer: SocketAddr,
    line: Line,
    /// Bytes read but not processed.
    received: VecDeque<u8>,
    out: Vec<u8>,
}

/// TCP port and its connections.
pub struct Server {
    listener: TcpListener,
    client: Option<Connection>,
    waiting: VecDeque<Connection>,
    listeners: VecDeque<Connection>,
    refused: VecDeque<(TcpStream, Instant)>,
    /// All bytes sent before this instant have been processed.
    drained: Instant,
}

impl Connection {
    /// Reads and processes bytes. Returns whether no more are pending: a read that does not fill its buffer
    /// has emptied the socket.
    fn receive(
        &mut self,
        client: Option<SocketAddr>,
        mut take: impl FnMut(Frame) -> bool,
    ) -> Result<bool, What> {
        let mut bytes = [0; MOST_AT_ONCE];
        let is_client = client == Some(self.peer);
        let gone = |why| Err(What::Gone(why, is_client));
        let (mut ended, mut is_drained) = (None, false);
        if self.received.is_empty() {
            match self.stream.read(&mut bytes) {
                Ok(0) => ended = Some("end of the connection"),
                Ok(count) => {
                    is_drained = count < MOST_AT_ONCE;
                    self.received.extend(&bytes[..count]);
                }
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {
                    return Ok(error.kind() == ErrorKind::WouldBlock);
                }
                Err(error) if error.kind() == ErrorKind::ConnectionReset => {
                    ended = Some("reset by the client")
                }
                Err(_) => ended = Some("error of the connection"),
            }
        }
        while let Some(byte) = self.received.pop_front() {
            match self.line.receive(byte, &mut self.out) {
                None => {}
                Some(Received::Frame(frame)) => {
                    let answer = if take(frame) { TAKEN } else { BELL };
                    self.out.extend_from_slice(answer);
                }
                Some(Received::Open) => {
                    if let Some(client) = client.filter(|_| !is_client) {
                        return Err(What::Refused(client));
                    }
                    self.out.extend_from_slice(DONE);
                    return Err(What::Opened);
                }
                Some(Received::Listen) => {
                    self.out.extend_from_slice(DONE);
                    return Err(What::Listens);
                }
                Some(Received::Close) => {
                    self.out.extend_from_slice(DONE);
                    return Err(What::Closed);
                }
            }
        }
        ended.map_or(Ok(is_drained), gone)
    }

    /// Sends pending bytes, as many as the other side accepts.
    fn flush(&mut self) -> Result<(), &'static str> {
        while !self.out.is_empty() {
            match self.stream.write(&self.out) {
                Ok(0) => return Err("end of the connection"),
                Ok(count) => {
                    self.out.drain(..count);
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(_) => return Err("error of the connection"),
            }
        }
        if self.out.len() > MOST_UNREAD { Err("4 MB left unread") } else { Ok(()) }
    }
}

/// Options of a connection. Without keep-alive, a client with a failed machine or cable would hold the
/// channel for ever.
fn set_up(stream: &TcpStream) -> std::io::Result<()> {
    stream.set_nonblocking(true)?;
    stream.set_nodelay(true)?;
    let socket = SockRef::from(stream);
    socket
        .set_tcp_keepalive(&TcpKeepalive::new().with_time(QUIET).with_interval(PROBE).with_retries(PROBES))?;
    // Unacknowledged frames replace the probes.
    #[cfg(target_os = "linux")]
    socket.set_tcp_user_timeout(Some(QUIET + PROBE * PROBES))?;
    Ok(())
}

impl Server {
    /// Listens at `address`; port 0 selects a free one.
    pub fn new(address: SocketAddr) -> std::io::Result<Self> {
        let listener = TcpListener::bind(address)?;
        listener.set_nonblocking(true)?;
        Ok(Self {
            listener,
            client: None,
            waiting: VecDeque::new(),
            listeners: VecDeque::new(),
            refused: VecDeque::new(),
            drained: Instant::now(),
        })
    }

    /// Returns the address of the port.
    pub fn address(&self) -> std::io::Result<SocketAddr> {
        self.listener.local_addr()
    }

    /// Accepts connections and processes bytes of the client. Each frame is passed to `take` with the
    /// earliest instant at which it may have been sent; a refused frame is answered by a bell. When a client
    /// ends, no frame of another one is processed in the same call.
    pub fn poll(&mut self, now: Instant, mut take: impl FnMut(Frame, Instant) -> bool) -> Vec<Event> {
        let mut events = Vec::new();
        self.forget_refused(now);
        let since = self.drained;
        let mut is_drained = true;
        if let Some(client) = &mut self.client {
            let peer = client.peer;
            match client.receive(Some(peer), |frame| take(frame, since)) {
                Ok(all) => is_drained = all,
                Err(what) => {
                    if let (What::Closed, Some(client)) = (&what, self.client.take()) {
                        self.waiting.push_back(client);
                    }
                    events.push(Event { peer, what });
                    return events;
                }
            }
        }
        // Accepted after the client was read, so that a client that has disconnected does not block the next
        // one.
        self.accept(&mut events);
        for _ in 0..self.waiting.len() {
            let Some(mut connection) = self.waiting.pop_front() else { break };
            let (peer, client) = (connection.peer, self.client.as_ref().map(|client| client.peer));
            match connection.receive(client, |_| false) {
                Ok(_) => self.waiting.push_back(connection),
                Err(What::Opened) => {
                    self.client = Some(connection);
                    is_drained = false;
                    events.push(Event { peer, what: What::Opened });
                }
                Err(What::Listens) if self.listeners.len() < MOST_CONNECTIONS => {
                    events.push(Event { peer, what: What::Listens });
                    self.listeners.push_back(connection);
                }
                Err(What::Listens) => {
                    self.refuse(connection.stream, &format!("{MOST_CONNECTIONS} listen already"), now);
                    events.push(Event { peer, what: What::Full });
                }
                Err(what) => {
                    if let What::Refused(client) = what {
                        self.refuse(connection.stream, &format!("{client} has the channel"), now);
                    }
                    events.push(Event { peer, what });
                }
            }
        }
        self.poll_listeners(&mut events);
        if is_drained {
            self.drained = now;
        }
        events
    }

    /// Accepts connections; one too many displaces the oldest.
    fn accept(&mut self, events: &mut Vec<Event>) {
        while let Ok((stream, peer)) = self.listener.accept() {
            if set_up(&stream).is_err() {
                continue;
            }
            events.push(Event { peer, what: What::Connected });
            let (received, out) = (VecDeque::new(), Vec::new());
            let connection = Connection { stream, peer, line: Line::default(), received, out };
            if self.waiting.len() >= MOST_CONNECTIONS
                && let Some(oldest) = self.waiting.pop_front()
            {
                let what = What::Gone("too many connections without a channel", false);
                events.push(Event { peer: oldest.peer, what });
            }
            self.waiting.push_back(connection);
        }
    }

    /// Processes bytes of the listeners, which may close the channel.
    fn poll_listeners(&mut self, events: &mut Vec<Event>) {
        for _ in 0..self.listeners.len() {
            let Some(mut listener) = self.listeners.pop_front() else { break };
            let peer = listener.peer;
            match listener.receive(None, |_| false) {
                Ok(_) => self.listeners.push_back(listener),
                Err(What::Closed) => {
                    events.push(Event { peer, what: What::Listened });
                    self.waiting.push_back(listener);
                }
                Err(what) => events.push(Event { peer, what }),
            }
        }
    }

    /// Sends the reason, and holds the connection open for a while: closing it at once would reset it.
    fn refuse(&mut self, mut stream: TcpStream, why: &str, now: Instant) {
        let _ = stream.write_all(format!("#refused: {why}\r\u{7}").as_bytes());
        let _ = stream.shutdown(Shutdown::Write);
        if self.refused.len() >= MOST_CONNECTIONS {
            self.refused.pop_front();
        }
        self.refused.push_back((stream, now));
    }

    fn forget_refused(&mut self, now: Instant) {
        let mut bytes = [0; MOST_AT_ONCE];
        self.refused.retain_mut(|(stream, since)| {
            let goes_on = match stream.read(&mut bytes) {
                Ok(count) => count > 0,
                Err(error) => error.kind() == ErrorKind::WouldBlock,
            };
            goes_on && now.saturating_duration_since(*since) < REFUSED_FOR
        });
    }

    /// Sends a frame to the client, if there is one.
    pub fn send(&mut self, frame: &Frame) {
        if let Some(client) = &mut self.client {
            encode(frame, &mut client.out);
        }
    }

    /// Shows a frame of the bus to the listeners.
    pub fn show(&mut self, frame: &Frame) {
        for listener in &mut self.listeners {
            encode(frame, &mut listener.out);
        }
    }

    /// Sends pending bytes of all connections, as many as they accept.
    pub fn flush(&mut self) -> Vec<Event> {
        let mut events = Vec::new();
        if let Some(client) = &mut self.client
            && let Err(why) = client.flush()
        {
            events.push(Event { peer: client.peer, what: What::Gone(why, true) });
            self.client = None;
        }
        for connections in [&mut self.waiting, &mut self.listeners] {
            connections.retain_mut(|connection| {
                let Err(why) = connection.flush() else { return true };
                events.push(Event { peer: connection.peer, what: What::Gone(why, false) });
                false
            });
        }
        events
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    /// A server and its client, which has opened the channel.
    fn opened() -> (Server, TcpStream, Instant) {
        let mut server = Server::new(([127, 0, 0, 1], 0).into()).expect("a free port");
        let mut client = TcpStream::connect(server.address().expect("it listens")).expect("it listens");
        client.write_all(b"C\rS8\rO\r").expect("a connection");
        let now = Instant::now();
        while server.client.is_none() {
            server.poll(now, |_, _| true);
        }
        // The last poll left its bytes unread.
        server.poll(now, |_, _| true);
        (server, client, now)
    }

    /// Waits until this number of the client's bytes has arrived.
    fn pending(server: &Server, count: usize) {
        let stream = &server.client.as_ref().expect("a client").stream;
        while stream.peek(&mut vec![0; count]).ok() != Some(count) {
            std::thread::sleep(MS / 10);
        }
    }

    #[test]
    fn frames_that_arrive_at_every_poll_do_not_age() {
        let (mut server, mut client, begin) = opened();
        let mut ages = Vec::new();
        for round in 1..=10 {
            client.write_all(b"t20120F00\r").expect("a connection");
            pending(&server, 10);
            let now = begin + round * 30 * MS;
            server.poll(now, |_, since| {
                ages.push(now - since);
                true
            });
        }
        // Each was sent after the previous poll, 30 ms before.
        assert_eq!(ages, [30 * MS; 10]);
    }

    #[test]
    fn bytes_left_in_the_socket_age_from_the_last_time_it_was_empty() {
        let (mut server, mut client, begin) = opened();
        // More than two reads take.
        client.write_all(&b"t20120F00\r".repeat(1000)).expect("a connection");
        pending(&server, 10_000);
        let mut ages = Vec::new();
        for round in 1..=3 {
            let now = begin + round * 30 * MS;
            server.poll(now, |_, since| {
                ages.push(now - since);
                true
            });
        }
        assert_eq!((ages.len(), ages[0], ages[999]), (1000, 30 * MS, 90 * MS));
    }

    #[test]
    fn the_connection_of_a_client_with_a_cut_cable_ends() {
        let (server, _client, _) = opened();
        let socket = SockRef::from(&server.client.as_ref().expect("a client").stream);
        assert!(socket.keepalive().expect("a socket"));
        assert_eq!(socket.tcp_keepalive_time().expect("a socket"), QUIET);
        assert_eq!(socket.tcp_keepalive_interval().expect("a socket"), PROBE);
        assert_eq!(socket.tcp_keepalive_retries().expect("a socket"), PROBES);
        #[cfg(target_os = "linux")]
        assert_eq!(socket.tcp_user_timeout().expect("a socket"), Some(10 * PROBE));
    }
}
