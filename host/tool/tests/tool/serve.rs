//! `serve` as seen by a client at its port: messages, refusals, and discarded frames.

use scarab::bus::Frame;
use scarab_base::random::Random;
use scarab_client::bus::{Bus, Object, RequestError};
use scarab_client::master;
use scarab_client::slcan;
use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use crate::command::{Folder, assert_contains};
use crate::largest_memory_kb;

const MS: Duration = Duration::from_millis(1);
/// Longest wait for an event; only a failure takes so long, on any machine.
const PATIENCE: Duration = Duration::from_secs(120);
const OFF: u32 = 0x40;
const SWITCHED_ON: u32 = 0x23;
pub const ENABLED: u32 = 0x27;

/// A running `serve` with its output.
pub struct Serve {
    child: Child,
    pub address: String,
    errors: Arc<Mutex<String>>,
}

impl Serve {
    pub fn at(address: &str, arguments: &str) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_scarab"))
            .args(["serve", "--slcan", address])
            .args(arguments.split_whitespace())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the tool runs");
        let errors = Arc::new(Mutex::new(String::new()));
        let (lines, kept) = (child.stderr.take().expect("piped"), Arc::clone(&errors));
        thread::spawn(move || {
            for line in BufReader::new(lines).lines().map_while(Result::ok) {
                kept.lock().expect("no thread panics").push_str(&format!("{line}\n"));
            }
        });
        let mut line = String::new();
        BufReader::new(child.stdout.take().expect("piped")).read_line(&mut line).expect("a line");
        let address = line.trim().strip_prefix("listening ").expect("it listens").to_owned();
        Self { child, address, errors }
    }

    pub fn new() -> Self {
        Self::at("127.0.0.1:0", "")
    }

    fn errors(&self) -> String {
        self.errors.lock().expect("no thread panics").clone()
    }

    pub fn waits_for(&self, words: &str) {
        let begin = Instant::now();
        while !self.errors().contains(words) {
            assert!(begin.elapsed() < PATIENCE, "{words:?} not found in:\n{}", self.errors());
            thread::sleep(5 * MS);
        }
    }

    fn signal(&self, name: &str) {
        let id = self.child.id().to_string();
        assert!(Command::new("kill").args([name, &id]).status().expect("kill").success());
    }

    fn memory_kb(&self) -> u64 {
        largest_memory_kb(self.child.id())
    }
}

impl Drop for Serve {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

pub struct Client {
    stream: TcpStream,
    received: Vec<u8>,
    begun: Instant,
}

impl Bus for Client {
    fn send(&mut self, frame: &Frame) -> Result<(), RequestError> {
        self.frame(frame.id(), frame.data());
        Ok(())
    }

    fn receive(&mut self, until: Duration) -> Result<Option<Frame>, RequestError> {
        loop {
            let left = until.saturating_sub(self.now());
            self.stream.set_nonblocking(left.is_zero()).expect("a socket");
            if !left.is_zero() {
                self.stream.set_read_timeout(Some(left)).expect("a socket");
            }
            let line = self.try_line();
            self.stream.set_nonblocking(false).expect("a socket");
            let Ok(line) = line else { return Ok(None) };
            if let Some(frame) = slcan::decode(&line.expect("a connection")).expect("slcan") {
                return Ok(Some(frame));
            }
        }
    }

    fn now(&self) -> Duration {
        self.begun.elapsed()
    }
}

impl Client {
    fn silent(address: &str) -> Self {
        let stream = TcpStream::connect(address).expect("it listens");
        stream.set_read_timeout(Some(PATIENCE)).expect("a socket");
        Self { stream, received: Vec::new(), begun: Instant::now() }
    }

    pub fn new(serve: &Serve) -> Self {
        Self::at(&serve.address)
    }

    pub fn at(address: &str) -> Self {
        let mut client = Self::silent(address);
        client.say("C\rS8\rO\r");
        // Frames of other participants may come between the three answers.
        for _ in 0..3 {
            while !client.line().expect("a connection").is_empty() {}
        }
        client
    }

    fn say(&mut self, text: &str) {
        self.stream.write_all(text.as_bytes()).expect("a connection");
    }

    /// The next line without its line ending; `None` at the end of the connection.
    fn line(&mut self) -> Option<String> {
        self.stream.set_read_timeout(Some(PATIENCE)).expect("a socket");
        self.try_line().expect("an answer")
    }

    /// Like [`Self::line`], with an error after the socket's time limit.
    fn try_line(&mut self) -> std::io::Result<Option<String>> {
        loop {
            if let Some(end) = self.received.iter().position(|byte| *byte == b'\r' || *byte == 7) {
                let line: Vec<u8> = self.received.drain(..=end).collect();
                let line = String::from_utf8(line).expect("ASCII");
                return Ok(Some(line.trim_end_matches('\r').to_owned()));
            }
            let mut bytes = [0; 4096];
            match self.stream.read(&mut bytes)? {
                0 => return Ok(None),
                count => self.received.extend(&bytes[..count]),
            }
        }
    }

    pub fn frame(&mut self, id: u16, data: &[u8]) {
        let mut line = Vec::new();
        slcan::encode(&Frame::new(id, data), &mut line);
        self.stream.write_all(&line).expect("a connection");
    }

    /// Repeats a request until it is answered: a busy machine drops a late one that could enable the leg.
    fn ask<T>(
        &mut self,
        object: Object,
        request: impl Fn(&mut master::Client<&mut Self>) -> Result<T, RequestError>,
    ) -> T {
        let begin = Instant::now();
        loop {
            match request(&mut master::Client::over(&mut *self)) {
                Err(RequestError::Silent(_)) => assert!(begin.elapsed() < PATIENCE, "{object:x?}: no answer"),
                answer => return answer.unwrap_or_else(|error| panic!("{object:x?}: {error:?}")),
            }
        }
    }

    pub fn read(&mut self, node: u16, index: u16, sub: u8) -> u32 {
        let object = Object(index, sub);
        self.ask(object, |client| client.try_read(node as u8, object))
    }

    pub fn write(&mut self, node: u16, index: u16, sub: u8, value: u32, size: u8) {
        let object = Object(index, sub);
        self.ask(object, |client| client.try_write(node as u8, object, value, size));
    }

    fn state(&mut self, node: u16) -> u32 {
        self.read(node, 0x6041, 0) & 0x806F
    }

    pub fn until(&mut self, state: u32) {
        for node in [1, 2] {
            let begin = Instant::now();
            loop {
                let found = self.state(node);
                if found == state {
                    break;
                }
                assert!(begin.elapsed() < PATIENCE, "node {node}: {found:x} instead of {state:x}");
            }
        }
    }

    /// Takes the leg up to "switched on", or further to "operation enabled".
    pub fn enable(&mut self, to: u32) {
        for (word, state) in [(6, 0x21), (7, SWITCHED_ON), (15, ENABLED)] {
            [1, 2].into_iter().for_each(|node| self.write(node, 0x6040, 0, word, 2));
            self.until(state);
            if state == to {
                break;
            }
        }
    }
}

#[test]
fn a_lost_client_disconnects_the_boards_and_stops_the_leg() {
    for closes in [false, true] {
        let serve = Serve::new();
        let mut client = Client::new(&serve);
        serve.waits_for("opened the channel");
        client.enable(ENABLED);
        client.write(1, 0x6060, 0, 3, 1);
        client.write(1, 0x60FF, 0, 100_000, 4);
        let begin = Instant::now();
        while (client.read(1, 0x606C, 0) as i32) < 60_000 {
            assert!(begin.elapsed() < PATIENCE, "the hip does not move");
        }
        if closes {
            client.say("C\r");
            serve.waits_for("closed the channel: the boards' plug is pulled");
        }
        drop(client);
        serve.waits_for("disconnected (");
        let mut client = Client::new(&serve);
        client.until(OFF);
        for node in [1, 2] {
            assert_eq!(client.read(node, 0x1003, 1) & 0xFFFF, 0x8120, "node {node}");
        }
        // The leg must not restart by itself.
        thread::sleep(200 * MS);
        client.until(OFF);
    }
}

#[test]
fn a_second_client_is_refused_a_silent_connection_blocks_no_client() {
    let serve = Serve::at("localhost:0", "");
    let _silent: Vec<Client> = (0..3).map(|_| Client::silent(&serve.address)).collect();
    let mut late = Client::silent(&serve.address);
    let mut client = Client::new(&serve);
    assert_eq!(client.state(1), OFF);
    let peer = client.stream.local_addr().expect("connected");
    // One connects now; the other one was silent before.
    let mut second = Client::silent(&serve.address);
    second.say("C\rS8\rO\r");
    late.say("O\r");
    for mut refused in [second, late] {
        assert_eq!(refused.line(), Some(format!("#refused: {peer} has the channel")));
        assert_eq!(refused.line().as_deref(), Some("\u{7}"));
        let mut rest = Vec::new();
        match refused.stream.read_to_end(&mut rest) {
            Ok(_) => assert_eq!(rest, b""),
            Err(error) => assert_eq!(error.kind(), ErrorKind::ConnectionReset),
        }
    }
    serve.waits_for(&format!("refused, {peer} has the channel"));
    assert_eq!(client.state(1), OFF);
    drop(client);
    serve.waits_for("the boards' plug is pulled");
    Client::new(&serve).until(OFF);
}

#[test]
fn a_listener_hears_host_and_boards_and_disturbs_neither() {
    let serve = Serve::new();
    let mut client = Client::new(&serve);
    let mut listener = Client::silent(&serve.address);
    listener.say("C\rS8\rL\r");
    for _ in 0..3 {
        assert_eq!(listener.line().as_deref(), Some(""));
    }
    serve.waits_for("listens");
    // Its own frames are refused.
    listener.frame(0x601, &[0x40, 0x41, 0x60, 0, 0, 0, 0, 0]);
    assert_eq!(client.state(1), OFF);
    let lines = core::iter::from_fn(|| listener.line()).filter(|line| !line.starts_with("t7"));
    let heard: Vec<String> = lines.take(3).collect();
    assert_eq!(heard[..2], ["\u{7}", "t60184041600000000000"], "{heard:?}");
    assert!(heard[2].starts_with("t58184B416000"), "{heard:?}");
    drop(listener);
    serve.waits_for("disconnected (end of the connection)");
    assert_eq!(client.state(1), OFF);
    assert!(!serve.errors().contains("plug is pulled"), "{}", serve.errors());
}

#[test]
fn a_ninth_listener_is_refused_and_the_others_go_on() {
    let serve = Serve::new();
    let listen = || {
        let mut listener = Client::silent(&serve.address);
        listener.say("L\r");
        listener
    };
    let mut listeners = Vec::new();
    for _ in 0..8 {
        let mut listener = listen();
        assert_eq!(listener.line().as_deref(), Some(""));
        listeners.push(listener);
    }
    let mut ninth = listen();
    assert_eq!(ninth.line().as_deref(), Some("#refused: 8 listen already"));
    let mut client = Client::new(&serve);
    client.frame(0x55, &[]);
    for listener in &mut listeners {
        while listener.line().expect("it still listens") != "t0550" {}
    }
}

#[test]
fn frames_delayed_by_a_stopped_process_still_stop_but_never_enable() {
    let serve = Serve::new();
    let mut client = Client::new(&serve);
    client.frame(0, &[1, 0]);
    client.enable(SWITCHED_ON);
    let late = |client: &mut Client, word: u8| {
        serve.signal("-STOP");
        [0x201, 0x202].into_iter().for_each(|id| client.frame(id, &[word, 0]));
        thread::sleep(300 * MS);
        serve.signal("-CONT");
        thread::sleep(300 * MS);
    };
    late(&mut client, 15);
    client.until(SWITCHED_ON);
    serve.waits_for(" 2 set-points older than that");
    serve.waits_for(" ms not simulated");
    // Fresh controlwords enable. On a busy machine one of them may grow old as well, so they are sent again.
    let begin = Instant::now();
    while [1, 2].into_iter().any(|node| client.state(node) != ENABLED) {
        assert!(begin.elapsed() < PATIENCE, "fresh controlwords do not enable");
        [0x201, 0x202].into_iter().for_each(|id| client.frame(id, &[15, 0]));
    }
    late(&mut client, 0);
    client.until(OFF);
}

#[test]
fn a_flood_is_answered_by_bells_within_bounded_memory() {
    const FRAMES: u32 = 200_000;
    let serve = Serve::new();
    let mut client = Client::new(&serve);
    client.until(OFF);
    let before = serve.memory_kb();
    let mut stream = client.stream.try_clone().expect("a socket");
    let begin = Instant::now();
    let flood = thread::spawn(move || {
        let mut random = Random::new("flood", 1);
        for _ in 0..FRAMES / 100 {
            let mut lines = String::new();
            for _ in 0..100 {
                // Below 0x780, and without network management: all of these are answered.
                lines.push_str(&format!("t{:03X}2{:04X}\r", 1 + random.below(0x77F), random.below(0x1_0000)));
            }
            stream.write_all(lines.as_bytes()).expect("a connection");
        }
    });
    let (mut taken, mut refused) = (0_u64, 0_u64);
    while taken + refused < u64::from(FRAMES) {
        match client.line().expect("an answer").as_str() {
            "z" => taken += 1,
            "\u{7}" => refused += 1,
            _ => {}
        }
    }
    flood.join().expect("sent");
    // The shortest of these frames have 63 bits.
    let most = (begin.elapsed().as_secs_f64() + 0.2) * 1e6 / 63.0;
    assert!(
        refused > 0 && (taken as f64) < most,
        "{taken} taken, {refused} refused, the wire carries {most:.0}"
    );
    let grown = serve.memory_kb() - before;
    assert!(grown < 20_000, "{grown} KB more");
    serve.waits_for(" refused (the queue held all that the wire carries in 100 ms)");
    thread::sleep(200 * MS);
    client.until(OFF);
}

/// Runs a command that must be refused before it listens; returns its messages.
fn refusal(command: &mut Command) -> String {
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the tool runs");
    let begin = Instant::now();
    while child.try_wait().expect("a child").is_none() && begin.elapsed() < PATIENCE {
        thread::sleep(5 * MS);
    }
    // A serving process was not refused.
    let _ = child.kill();
    let output = child.wait_with_output().expect("a child");
    let errors = String::from_utf8(output.stderr).expect("text");
    assert_eq!((output.status.code(), output.stdout.len()), (Some(2), 0), "{errors}");
    errors
}

#[test]
fn a_leg_that_the_contacts_have_enabled_has_no_host_yet() {
    let serve = Serve::at("127.0.0.1:0", "--enabled-by-contacts");
    let mut client = Client::new(&serve);
    client.until(ENABLED);
    for node in [1, 2] {
        assert_eq!((client.read(node, 0x6040, 0), client.read(node, 0x603F, 0)), (0, 0), "node {node}");
    }
    let before = client.read(2, 0x6064, 0) as i32;
    thread::sleep(300 * MS);
    assert!((client.read(2, 0x6064, 0) as i32 - before).abs() < 5000, "the leg does not hold its pose");
    client.until(ENABLED);
}

#[test]
fn an_uncalibrated_board_enables_nothing_and_says_why() {
    let serve = Serve::at("127.0.0.1:0", "--uncalibrated");
    let mut client = Client::new(&serve);
    // Neither calibrated nor with zeros, and the switch is open.
    assert_eq!(client.read(1, 0x2160, 2) & 0b111, 0);
    client.frame(0, &[1, 0]);
    // A frame that comes late enables nothing, so it is repeated.
    let begin = Instant::now();
    while !serve.errors().contains("leg 1: emergency FF0E: a step towards enabled is refused: ") {
        assert!(begin.elapsed() < PATIENCE, "{}", serve.errors());
        client.frame(0x201, &[6, 0]);
        thread::sleep(20 * MS);
    }
    assert_ne!(client.state(1), ENABLED);
    assert_ne!(client.read(1, 0x60FD, 0) & 1 << 19, 0, "not calibrated");
}

#[test]
#[ignore = "campaign: .ci/full"]
fn a_wearer_kicks_while_the_leg_assists() {
    let serve = Serve::at("127.0.0.1:0", "--motion kicking");
    let mut client = Client::new(&serve);
    let moved = |client: &mut Client, seconds: f64| {
        let begin = Instant::now();
        let [mut low, mut high] = [i32::MAX, i32::MIN];
        while begin.elapsed().as_secs_f64() < seconds {
            let position = client.read(2, 0x6064, 0) as i32;
            (low, high) = (low.min(position), high.max(position));
        }
        high - low
    };
    client.enable(ENABLED);
    assert!(moved(&mut client, 0.5) < 50_000, "the wearer moves before the session");
    client.write(1, 0x2150, 1, 500, 2);
    client.write(1, 0x2100, 1, 4, 1);
    let begin = Instant::now();
    while client.read(1, 0x2100, 2) != 11 {
        assert!(begin.elapsed() < PATIENCE, "no session: {}", serve.errors());
    }
    assert!(moved(&mut client, 4.0) > 200_000, "the wearer does not move the knee");
}

#[test]
fn impossible_options_are_refused_before_the_port_opens() {
    let tool = env!("CARGO_BIN_EXE_scarab");
    let serve = |arguments: &str| {
        let arguments = arguments.split_whitespace();
        refusal(Command::new(tool).args(["serve", "--slcan"]).args(arguments))
    };
    let words = serve("127.0.0.1:0 --legs 4 --speed 100");
    assert_contains(&words, "100 cannot be held; this machine simulates 4 legs at ");
    assert_contains(&serve("nowhere.invalid:0"), "nowhere.invalid:0");
    // A file without an end.
    assert_contains(&serve("127.0.0.1:0 --flash /dev/zero"), "/dev/zero: more than 32768 bytes");
    // Files may have 4 KB here; the flash has 256.
    let folder = Folder::new();
    let words = refusal(
        Command::new("sh")
            .args([
                "-c",
                "trap '' XFSZ; ulimit -f 8; exec \"$0\" serve --slcan 127.0.0.1:0 --flash \"$1\"",
                tool,
            ])
            .arg(folder.path("flash")),
    );
    assert_contains(&words, "flash");
}

#[test]
fn a_non_local_address_gives_a_warning() {
    let serve = Serve::at("0.0.0.0:0", "");
    serve.waits_for("warning: 0.0.0.0:0 can be reached from other machines");
    assert!(!Serve::new().errors().contains("can be reached"));
}
