//! Procedures of the client beside another host, and on a hostile adapter.

use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use scarab_boot::{HEADER_AT, Header, seal};
use scarab_client::adapter::open;
use scarab_client::bus::{Object, RequestError};
use scarab_client::master;

use crate::command::{Folder, Run, assert_contains, scarab};
use crate::serve::{Client, Serve};

const MS: Duration = Duration::from_millis(1);

/// Wire of a bus: each host hears the boards and the other hosts.
struct Wire {
    address: String,
    /// Frames of the hosts.
    sent: Arc<Mutex<String>>,
}

/// Lines of one direction, without bells.
fn lines(stream: TcpStream) -> impl Iterator<Item = String> {
    let parts = BufReader::new(stream).split(b'\r').map_while(Result::ok);
    parts.map(|line| String::from_utf8_lossy(&line).trim_start_matches('\u{7}').to_owned())
}

impl Wire {
    fn new(serve: &Serve) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let address = listener.local_addr().expect("bound").to_string();
        let mut bus = TcpStream::connect(&serve.address).expect("it listens");
        bus.write_all(b"C\rS8\rO\r").expect("a connection");
        let hosts: Arc<Mutex<Vec<TcpStream>>> = Arc::default();
        let sent: Arc<Mutex<String>> = Arc::default();
        let (all, boards) = (Arc::clone(&hosts), bus.try_clone().expect("a socket"));
        thread::spawn(move || {
            for line in lines(boards).filter(|line| line.starts_with('t')) {
                for host in all.lock().expect("no thread panics").iter_mut() {
                    let _ = host.write_all(format!("{line}\r").as_bytes());
                }
            }
        });
        let kept = Arc::clone(&sent);
        thread::spawn(move || {
            for stream in listener.incoming().map_while(Result::ok) {
                let [mut bus, mut own, another] =
                    [&bus, &stream, &stream].map(|socket| socket.try_clone().expect("a socket"));
                hosts.lock().expect("no thread panics").push(another);
                let (hosts, kept) = (Arc::clone(&hosts), Arc::clone(&kept));
                thread::spawn(move || {
                    let peer = stream.peer_addr().ok();
                    for line in lines(stream) {
                        let is_frame = line.starts_with('t');
                        let _ = own.write_all(if is_frame { &b"z\r"[..] } else { b"\r" });
                        if is_frame {
                            let text = format!("{line}\r");
                            let _ = bus.write_all(text.as_bytes());
                            let mut hosts = hosts.lock().expect("no thread panics");
                            for host in hosts.iter_mut().filter(|host| host.peer_addr().ok() != peer) {
                                let _ = host.write_all(text.as_bytes());
                            }
                            kept.lock().expect("no thread panics").push_str(&text);
                        }
                    }
                    hosts.lock().expect("no thread panics").retain(|host| host.peer_addr().ok() != peer);
                });
            }
        });
        Self { address, sent }
    }

    fn run(&self, command: &str) -> Run {
        scarab(&format!("{command} --slcan {}", self.address))
    }
}

/// Program that passes the checks of a file.
fn image(folder: &Folder) -> std::path::PathBuf {
    let mut program = vec![7; 2000];
    for (index, word) in Header::UNSEALED.into_iter().enumerate() {
        program[HEADER_AT as usize + 4 * index..][..4].copy_from_slice(&word.to_le_bytes());
    }
    seal(&mut program).expect("an image");
    let path = folder.path("image.bin");
    std::fs::write(&path, program).expect("a temporary file");
    path
}

#[test]
#[ignore = "campaign: .ci/full"]
fn every_procedure_refuses_beside_another_host_and_names_it() {
    let (serve, folder) = (Serve::new(), Folder::new());
    let wire = Wire::new(&serve);
    let update = format!("update {}", image(&folder).display());
    let procedures = ["commission", update.as_str(), "node-ids"];
    // What the host sends, and the words of each refusal.
    let cases: [(u16, &[u8], &str); 4] = [
        (0x80, &[], "SYNC (identifier 080)"),
        (0x301, &[0; 4], "PDO"),
        (0x601, &[0x40, 0x41, 0x60, 0, 0, 0, 0, 0], "SDO requests to node 1 (identifier 601)"),
        (0x770, &[5], "a second run of this program (identifier 770)"),
    ];
    for (identifier, data, words) in cases {
        let ends = AtomicBool::new(false);
        let runs = thread::scope(|scope| {
            scope.spawn(|| {
                let mut host = Client::at(&wire.address);
                while !ends.load(Ordering::Relaxed) {
                    host.frame(identifier, data);
                    thread::sleep(20 * MS);
                }
            });
            let runs = procedures.map(|procedure| wire.run(procedure));
            ends.store(true, Ordering::Relaxed);
            runs
        });
        for run in runs {
            let run = run.ends_with(3);
            let all = run.printed + &run.errors;
            assert_contains(&all, "another host uses the bus: ");
            assert_contains(&all, words);
            assert_contains(&all, "run the command again");
        }
    }
    // A silent host whose controlword stands.
    let mut host = Client::at(&wire.address);
    host.write(1, 0x6040, 0, 6, 2);
    for procedure in ["commission", update.as_str(), "node-ids --set 00000001=3,4"] {
        let run = wire.run(procedure).ends_with(3);
        let all = run.printed + &run.errors;
        assert_contains(&all, "node 1: another host controls the drive (ready to switch on");
    }
    // A new connection: the other one has heard the answers to the procedures.
    Client::at(&wire.address).write(1, 0x6040, 0, 0, 2);
    // Alone, each of them does its work; this board never takes an image.
    let errors = wire.run(&update).ends_with(3).errors;
    assert_contains(&errors, "a simulated board (`serve`), which never takes an image");
    wire.run("node-ids").ends_with(0);
    wire.run("commission --until wiring").ends_with(0);
}

#[test]
fn a_drive_that_the_contacts_turned_on_is_neither_updated_nor_renumbered() {
    let (serve, folder) = (Serve::at("127.0.0.1:0", "--enabled-by-contacts"), Folder::new());
    let wire = Wire::new(&serve);
    for procedure in [format!("update {}", image(&folder).display()), "node-ids --set 00000001=3,4".into()] {
        let errors = wire.run(&procedure).ends_with(3).errors;
        assert_contains(&errors, "the drive is on (operation enabled), by the operator's contacts");
    }
    // The operator is the partner of this one.
    wire.run("commission --until wiring").ends_with(0);
}

#[test]
fn a_watch_of_another_host_stays_and_a_free_one_is_given_back() {
    let serve = Serve::new();
    let wire = Wire::new(&serve);
    let theirs = 0x50 << 16 | 5000;
    // A new connection each time: an older one has heard the answers to the procedure.
    let host = || Client::at(&wire.address);
    let watches = || {
        let mut host = host();
        [1, 2].map(|node| [1, 2].map(|sub| host.read(node, 0x1016, sub)))
    };
    [1, 2].into_iter().for_each(|node| host().write(node, 0x1016, 1, theirs, 4));
    let run = wire.run("commission --until enable").ends_with(0);
    run.prints("enabled; the leg holds its pose");
    assert_eq!(watches(), [[theirs, 0]; 2]);
    // This host's watch: node 112, 500 ms.
    let sent = wire.sent.lock().expect("no thread panics").clone();
    for node in [1, 2] {
        assert!(sent.contains(&format!("t60{node}823161002F4017000")), "node {node}");
    }
    // Without a free entry nothing is replaced.
    [1, 2].into_iter().for_each(|node| host().write(node, 0x1016, 2, 0x51 << 16 | 5000, 4));
    let run = wire.run("commission --until enable").ends_with(3);
    run.prints("node 1 watches the heartbeats of nodes 80 and 81");
    assert_eq!(watches(), [[theirs, 0x51 << 16 | 5000]; 2]);
}

#[test]
fn waiting_says_what_the_board_says() {
    let serve = Serve::at("127.0.0.1:0", "--uncalibrated");
    let run =
        scarab(&format!("commission --patience 2 --until calibrate --slcan {}", serve.address)).ends_with(3);
    run.prints("the board says: the enabling switch is open\n");
    run.prints("waited 2 s, the board says: the enabling switch is open");
}

/// Adapter that answers each line of a client by these bytes.
fn adapter(answer: impl Fn(&str) -> Vec<u8> + Send + 'static) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let address = listener.local_addr().expect("bound").to_string();
    thread::spawn(move || {
        let (stream, _) = listener.accept().expect("a client");
        let mut out = stream.try_clone().expect("a socket");
        for line in lines(stream) {
            if out.write_all(&answer(&line)).is_err() {
                return;
            }
        }
    });
    address
}

#[test]
fn texts_of_a_node_are_escaped_and_bounded() {
    let ask = |ends: bool| {
        let address = adapter(move |line| {
            let answer = match line.get(..7) {
                Some("t601840") => "t58184108100000000000\r",
                // Escape, clear the screen, a line end.
                Some("t601860") if ends => "t5818011B5B324A0D0A41\r",
                Some("t601860") => "t5818001B5B324A0D0A41\r",
                Some("t601870") => "t5818101B5B324A0D0A41\r",
                _ => "",
            };
            answer.into()
        });
        master::Client::new(open(&address, 1000).expect("it listens")).expect("a reader")
    };
    let name = Object(0x1008, 0);
    assert_eq!(ask(true).text(1, name).expect("a text"), "\\u{1b}[2J\\r\\nA");
    assert_eq!(ask(false).bytes(1, name), Err(RequestError::Endless));
}

#[test]
fn a_line_without_end_ends_the_procedure_by_one_sentence() {
    let address = adapter(|_| [&b"t\x1b[2J"[..], &[b'A'; 4 << 20], b"\r"].concat());
    let errors = scarab(&format!("node-ids --slcan {address}")).ends_with(2).errors;
    assert!(errors.contains("a line of 256 bytes or more") && errors.len() < 400, "{errors}");
    let address = adapter(|_| b"x\x1b]0;owned\x07\r".to_vec());
    let errors = scarab(&format!("node-ids --slcan {address}")).ends_with(2).errors;
    assert!(errors.contains(r"the adapter says `x\u{1b}]0;owned`") && !errors.contains('\x1b'), "{errors}");
}
