//! `live` without a browser: its requests, its messages against `identify`, slow and superfluous pages.
//! `scripts/render-live` tests the page itself.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use scarab_base::stats::rms;
use scarab_tool::view::live::hub::MOST_IN_MESSAGE;
use scarab_tool::view::live::server::{MOST_CONNECTIONS, MOST_PAGES};
use serde_json::Value;
use socket2::{Domain, SockAddr, Socket, Type};

use crate::command::{Folder, MUJOCO, assert_contains, fit, number, scarab};
use crate::serve::{Client, ENABLED, Serve};
use crate::trace::session;
use crate::{PROGRAM, largest_memory_kb};

const PATIENCE: Duration = Duration::from_secs(120);

/// A running `live` and its address.
struct Live {
    child: Child,
    output: BufReader<std::process::ChildStdout>,
    host: String,
}

impl Live {
    fn new(arguments: &str) -> Self {
        let mut child = Command::new(PROGRAM)
            .arg("live")
            .args(arguments.split_whitespace())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("the tool runs");
        let mut output = BufReader::new(child.stdout.take().expect("piped"));
        let mut line = String::new();
        output.read_line(&mut line).expect("a line");
        let url = line.trim().strip_prefix("live: http://").expect("an address");
        let host = url.split('/').next().expect("a host").to_owned();
        Self { child, output, host }
    }

    /// Sends a request and returns the connection.
    fn ask(&self, request: &str) -> BufReader<TcpStream> {
        let mut stream = TcpStream::connect(&self.host).expect("it listens");
        stream.set_read_timeout(Some(PATIENCE)).expect("a socket");
        stream.write_all(request.replace("{host}", &self.host).as_bytes()).expect("a connection");
        BufReader::new(stream)
    }

    /// Whole answer to a request that ends.
    fn answer(&self, request: &str) -> String {
        let mut text = String::new();
        self.ask(request).read_to_string(&mut text).expect("text");
        text
    }

    fn events(&self) -> Events {
        Events(self.ask("GET /events HTTP/1.1\r\nHost: {host}\r\n\r\n"))
    }

    /// Waits for a line of the output.
    fn prints(&mut self, words: &str) {
        let mut line = String::new();
        while !line.contains(words) {
            line.clear();
            assert!(self.output.read_line(&mut line).expect("text") > 0, "{words:?} is not printed");
        }
    }

    fn memory_kb(&self) -> u64 {
        largest_memory_kb(self.child.id())
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Messages of a stream.
struct Events(BufReader<TcpStream>);

impl Iterator for Events {
    type Item = Value;

    fn next(&mut self) -> Option<Value> {
        let mut line = String::new();
        loop {
            line.clear();
            if self.0.read_line(&mut line).ok()? == 0 {
                return None;
            }
            if let Some(data) = line.strip_prefix("data: ") {
                return Some(serde_json::from_str(data).expect("JSON"));
            }
        }
    }
}

impl Events {
    /// Messages up to the end of the source, and its last point.
    fn until_the_end(self) -> Vec<Value> {
        let begin = Instant::now();
        let (mut messages, mut ended) = (Vec::new(), false);
        for message in self {
            assert!(begin.elapsed() < PATIENCE, "the source does not end");
            ended |= all(&message, "notes").any(|note| note["words"] == "the source has ended");
            let is_full = points(&message) == MOST_IN_MESSAGE;
            messages.push(message);
            if ended && !is_full {
                break;
            }
        }
        messages
    }
}

/// Points in a message.
fn points(message: &Value) -> usize {
    ["samples", "rows", "estimates"].iter().map(|key| all(message, key).count()).sum()
}

/// Elements of a list in a message.
fn all<'a>(message: &'a Value, key: &str) -> impl Iterator<Item = &'a Value> {
    message[key].as_array().into_iter().flatten()
}

/// Entries of all messages under this key.
fn every<'a>(messages: &'a [Value], key: &str) -> Vec<&'a Value> {
    messages.iter().flat_map(|message| all(message, key)).collect()
}

/// Last entry of all messages under this key.
fn last_of<'a>(messages: &'a [Value], key: &str) -> &'a Value {
    every(messages, key).pop().unwrap_or_else(|| panic!("no {key}"))
}

/// Number of rows after this time, s, and the root mean square error of a joint's torque in them, N m.
fn torque_error(messages: &[Value], joint: usize, after_s: f64) -> (usize, f64) {
    let rows = every(messages, "rows").into_iter();
    let errors: Vec<f64> = rows
        .filter(|row| row["time_s"].as_f64().is_some_and(|time| time > after_s))
        .filter_map(|row| Some(row["predicted_nm"][joint].as_f64()? - row["measured_nm"][joint].as_f64()?))
        .collect();
    (errors.len(), rms(errors))
}

#[test]
fn the_page_is_served_with_its_policy_and_nothing_can_be_sent() {
    let live = Live::new("--speed 1");
    let page = live.answer("GET / HTTP/1.1\r\nHost: {host}\r\n\r\n");
    assert!(page.starts_with("HTTP/1.1 200 OK\r\n"), "{page}");
    for header in [
        "content-security-policy: default-src 'none'; script-src 'self';",
        "x-content-type-options: nosniff",
        "referrer-policy: no-referrer",
        "cache-control: no-store",
    ] {
        assert_contains(&page, header);
    }
    for path in
        ["live.js", "model.js", "charts.js", "palette.css", "live.css", "uPlot.iife.min.js", "uPlot.min.css"]
    {
        assert!(page.contains(&format!("\"/{path}\"")), "{path} is not used");
        let part = live.answer(&format!("GET /{path} HTTP/1.1\r\nHost: {{host}}\r\n\r\n"));
        assert!(part.starts_with("HTTP/1.1 200 OK\r\n"), "{path}");
    }
    for (request, status) in [
        ("POST / HTTP/1.1\r\nHost: {host}\r\nContent-Length: 0\r\n\r\n", "405"),
        ("PUT /events HTTP/1.1\r\nHost: {host}\r\nContent-Length: 2\r\n\r\n{}", "405"),
        ("GET /events HTTP/1.1\r\nHost: evil.example\r\n\r\n", "421"),
        ("GET /events HTTP/1.1\r\n\r\n", "421"),
        ("GET /events?next=x HTTP/1.1\r\nHost: {host}\r\n\r\n", "400"),
        ("GET /secret HTTP/1.1\r\nHost: {host}\r\n\r\n", "404"),
        ("garbage\r\n\r\n", "400"),
    ] {
        let answer = live.answer(request);
        assert!(answer.starts_with(&format!("HTTP/1.1 {status} ")), "{request:?}: {answer}");
    }
}

#[test]
fn connections_that_never_ask_keep_no_page_out() {
    let live = Live::new("--speed 1");
    let mut events = live.events();
    assert!(events.next().is_some());
    // Twice as many as can be open, each with half a request.
    let half: Vec<_> = (0..2 * MOST_CONNECTIONS).map(|_| live.ask("GET / HTTP/1.1\r\n")).collect();
    let begin = Instant::now();
    let page = live.answer("GET / HTTP/1.1\r\nHost: {host}\r\n\r\n");
    assert!(page.starts_with("HTTP/1.1 200 OK\r\n"), "{page}");
    // Half-open connections end by themselves after 10 s.
    assert!(begin.elapsed() < Duration::from_secs(5), "{:?}", begin.elapsed());
    // An open page is not displaced.
    assert!(events.next().is_some());
    drop(half);
}

#[test]
fn messages_end_with_the_result_of_identify() {
    let folder = Folder::new();
    let (_, expected) = folder.reported("identify --seed 3", 0);
    let live = Live::new("--seed 3 --speed 1000");
    let messages = live.events().until_the_end();
    let estimates = every(&messages, "estimates");
    let result = estimates.last().expect("estimates");
    assert_eq!(result["origin"], "result");
    let base = expected["base_parameters"].as_array().expect("a list");
    let values = result["values"].as_array().expect("a list");
    assert_eq!(values.len(), base.len());
    for (value, base) in values.iter().zip(base) {
        for key in ["name", "unit", "value", "sigma", "truth"] {
            assert_eq!(value[key], base[key], "{}", base["name"]);
        }
    }
    let outcome = last_of(&messages, "outcomes");
    assert_eq!((&outcome["verdict"], &outcome["findings"]), (&expected["verdict"], &expected["findings"]));
    // While the leg moves, sigma shrinks, and the motion determines all parameters long before its end.
    let moving: Vec<_> = estimates.iter().filter(|estimate| estimate["origin"] == "motion").collect();
    assert!(moving.len() > 10, "{} estimates", moving.len());
    let sigma = |estimate: &Value, base: usize| estimate["values"][base]["sigma"].as_f64();
    let (early, late) = (moving[moving.len() / 2], moving[moving.len() - 1]);
    for base in 0..values.len().min(12) {
        let (early, late) = (sigma(early, base).expect("determined"), sigma(late, base).expect("determined"));
        assert!(late < early, "{}: sigma {early} and later {late}", values[base]["name"]);
    }
    // Predictions of unused motions: the mean error is that of the report.
    let mut notes = every(&messages, "notes").into_iter();
    let begin = notes.rfind(|note| note["words"] == "the leg runs unused motion 3 of 3 (fourier)");
    let (count, rms) = torque_error(&messages, 0, number(begin.expect("a motion"), "time_s") + 0.5);
    let mut fits = all(&expected, "validation");
    let fit = fits.find(|fit| fit["motion"] == "fourier" && fit["joint"] == 1).expect("a fit");
    let reported = number(fit, "rms_nm");
    assert!(count > 300 && (rms / reported - 1.0).abs() < 0.15, "{rms} N m, reported {reported}");
}

#[test]
fn a_recording_is_played_back_and_judged_as_by_replay() {
    let folder = Folder::new();
    let arguments = format!("--leg mujoco-leg --split 0.67 --seed 1 --speed 1000 --recording {MUJOCO}");
    let (_, expected) = folder.reported(&format!("replay {MUJOCO} --leg mujoco-leg --split 0.67"), 0);
    let live = Live::new(&arguments);
    let messages = live.events().until_the_end();
    let estimates = every(&messages, "estimates");
    let result = estimates.last().expect("estimates");
    assert_eq!(result["origin"], "result");
    for (value, base) in all(result, "values").zip(all(&expected, "base_parameters")) {
        assert_eq!((&value["name"], &value["value"]), (&base["name"], &base["value"]));
    }
    let outcome = last_of(&messages, "outcomes");
    assert_eq!((&outcome["verdict"], &outcome["findings"]), (&expected["verdict"], &expected["findings"]));
    // 30 s at 50 Hz, from the recording's first sample on; command and current are unknown.
    let samples = every(&messages, "samples");
    assert!((1490..=1501).contains(&samples.len()), "{} samples", samples.len());
    assert!(samples[0]["time_s"].as_f64().is_some_and(|time| (0.0..0.02).contains(&time)));
    assert!(samples[9]["commanded_rad"][0].is_null() && samples[9]["current_a"][0].is_null());
    // The held-out part is predicted by the result.
    let (count, rms) = torque_error(&messages, 1, 21.0);
    let reported = fit(&expected, "validation", 2, "rms_nm");
    assert!(count > 200 && (rms / reported - 1.0).abs() < 0.3, "{rms} N m, reported {reported}");
}

#[test]
fn a_board_s_trace_is_shown_as_it_arrives_and_from_a_file() {
    let text = session::text(session::accepted());
    let folder = Folder::new();
    let path = folder.write("trace.txt", &text);
    let arguments = format!("--leg x2-wearer-75kg --speed 1000 --trace {}", path.display());
    let from_file = Live::new(&arguments).events().until_the_end();
    let mut live = Live::new("--leg x2-wearer-75kg --trace -");
    live.child.stdin.take().expect("piped").write_all(text.as_bytes()).expect("a pipe");
    let arrived = live.events().until_the_end();
    let (_, expected) = folder.reported("identify --seed 1", 0);
    for messages in [from_file, arrived] {
        let result = last_of(&messages, "estimates");
        assert_eq!(result["origin"], "result");
        let values = |of: &Value| of.as_f64().map(|value| value as f32);
        for (value, base) in all(result, "values").zip(all(&expected, "base_parameters")) {
            assert_eq!((&value["name"], values(&value["value"])), (&base["name"], values(&base["value"])));
        }
        let outcome = last_of(&messages, "outcomes");
        assert_eq!(outcome["verdict"], "accepted");
        // The log has the exciting motion and the three unused ones.
        let samples = every(&messages, "samples");
        assert!(samples.len() > 2000, "{} samples", samples.len());
        let drives = every(&messages, "status");
        let last = drives.last().expect("states");
        assert_eq!(
            (&last["drive"], &last["doing"]),
            (&"operation enabled".into(), &"drive operation enabled; idle".into())
        );
        assert!(last["processor"].as_str().is_some_and(|words| !words.is_empty()), "{last}");
        let notes = every(&messages, "notes");
        assert!(
            notes.iter().any(|note| note["words"] == "the operator asks: identify, accepted"),
            "{notes:?}"
        );
    }
}

/// Lines of `candump -L`: two nodes in the compact mapping, 100 Hz, hip at `hip` and knee at `knee` (rad).
fn compact(seconds: u32, hip: impl Fn(f64) -> f64, knee: impl Fn(f64) -> f64) -> String {
    let mut lines = String::new();
    let mut line = |time_s: f64, id: u16, data: &[u8]| {
        let bytes: String = data.iter().map(|byte| format!("{byte:02X}")).collect();
        lines += &format!("({:.6}) can0 {id:03X}#{bytes}\n", 1.7e9 + time_s);
    };
    for node in [1_u8, 2] {
        for (index, sub, value) in
            [(0x1A00_u16, 0, 0_u32), (0x1A00, 2, 0x6064_0020), (0x1A00, 3, 0x2010_0010), (0x1A00, 0, 3)]
        {
            let ([low, high], [a, b, c, d]) = (index.to_le_bytes(), value.to_le_bytes());
            line(0.0, 0x600 + u16::from(node), &[0x23, low, high, sub, a, b, c, d]);
            line(0.0, 0x580 + u16::from(node), &[0x60, low, high, sub, 0, 0, 0, 0]);
        }
    }
    for cycle in 0..100 * seconds {
        let time_s = f64::from(cycle) * 0.01;
        line(time_s, 0x80, &[]);
        for (node, angle) in [(1, hip(time_s)), (2, knee(time_s))] {
            let [a, b, c, d] = ((angle * 1e6).round() as i32).to_le_bytes();
            line(time_s + 1e-4 * f64::from(node), 0x180 + node, &[0x37, 0x1A, a, b, c, d, 0, 0]);
        }
    }
    lines
}

#[test]
fn frames_of_a_bus_give_angles_states_and_load() {
    let folder = Folder::new();
    let (hip, knee) = (|time: f64| 0.2 + 0.1 * time, |time: f64| 0.9 - 0.2 * time);
    let path = folder.write("compact.log", compact(3, hip, knee));
    let arguments = format!("--leg x2-wearer-75kg --speed 1 --candump {}", path.display());
    let messages = Live::new(&arguments).events().until_the_end();
    let samples = every(&messages, "samples");
    assert!((145..=150).contains(&samples.len()), "{} samples", samples.len());
    for sample in &samples {
        let time = sample["time_s"].as_f64().expect("a time");
        for (joint, expected) in [hip(time), knee(time)].into_iter().enumerate() {
            let angle = sample["angle_rad"][joint].as_f64().expect("an angle");
            // Each frame is a little late, and time stamps begin with the first frame.
            assert!((angle - expected).abs() < 1e-4, "{angle} instead of {expected} at {time} s");
            assert!(sample["torque_nm"][joint].is_null() && sample["commanded_rad"][joint].is_null());
        }
    }
    let states = every(&messages, "status");
    let end = states.last().expect("states");
    assert_eq!(
        (&end["drive"], &end["doing"]),
        (&"unknown".into(), &"is unknown: the source has ended".into())
    );
    let last = states.iter().rev().find(|status| status["drive"] != "unknown").expect("a state");
    assert_eq!((&last["drive"], &last["fault"]), (&"operation enabled".into(), &"".into()));
    assert_eq!(
        last["limits"],
        serde_json::json!(["hip: internal limit active", "knee: internal limit active"])
    );
    // SYNC has 47 bits, the others 111, and some stuffed bits.
    assert!(
        last["bus"].as_str().is_some_and(|words| words.starts_with("3 % of 1000 kbit/s, 300 frames/s")),
        "{last}"
    );
}

#[test]
fn lines_that_are_no_frames_are_named_and_a_file_without_any_is_refused() {
    let folder = Folder::new();
    let text = compact(1, |_| 0.0, |_| 0.5).replacen("can0 080#", "can0 0", 1);
    let path = folder.write("bad.log", &text);
    let arguments = format!("--leg x2-wearer-75kg --speed 1000 --candump {}", path.display());
    let messages = Live::new(&arguments).events().until_the_end();
    let notes = every(&messages, "notes");
    let words = "line 17: no length in square brackets";
    assert!(
        notes.iter().any(|note| note["words"].as_str().is_some_and(|line| line.ends_with(words))),
        "{notes:?}"
    );
    folder.write("none.log", "t_s,q1_rad\n0,0\n");
    for (arguments, words) in [
        (
            "--candump @none.log",
            "no CAN frame: the frames have ended; 2 lines are none, the first: line 1: no time stamp in brackets",
        ),
        ("--nodes 1,2", "required arguments"),
        ("--slcan 127.0.0.1:1", "does a program serve that port?"),
        ("--slcan nowhere", "it must be HOST:PORT or a serial device"),
        ("--slcan /dev/absent", "/dev/absent: No such file"),
        ("--candump - --nodes 1,2,3", "--nodes: 3 node-IDs; x2-wearer-75kg has 2 joints"),
        ("--candump - --nodes 1,1", "--nodes: 1 occurs twice"),
    ] {
        folder.scarab(&format!("live --once --leg x2-wearer-75kg {arguments}")).ends_with(2).warns(words);
    }
}

/// Moves nodes 1 and 2 in cyclic position to 0.1 and 0.2 rad, 100 cycles a second, until the flag is set.
fn move_hip_and_knee(mut host: Client, stop: Arc<AtomicBool>) -> thread::JoinHandle<()> {
    host.enable(ENABLED);
    for node in [1, 2] {
        // A target far from the joint would be a following error (8611).
        let position = host.read(node, 0x6064, 0);
        host.write(node, 0x607A, 0, position, 4);
        host.write(node, 0x6060, 0, 8, 1);
        // This host may be slow.
        host.write(node, 0x2013, 0, 0, 1);
    }
    thread::spawn(move || {
        while !stop.load(Ordering::Relaxed) {
            for node in [1_u16, 2] {
                host.frame(0x300 + node, &(100_000 * i32::from(node)).to_le_bytes());
            }
            host.frame(0x80, &[]);
            thread::sleep(Duration::from_millis(10));
        }
    })
}

#[test]
fn two_served_legs_are_shown_while_a_host_moves_one() {
    let serve = Serve::at("127.0.0.1:0", "--legs 2");
    let mut host = Client::new(&serve);
    let live = Live::new(&format!("--leg x2-wearer-75kg --nodes 1,2,3,4 --slcan {}", serve.address));
    serve.waits_for("listens");
    for node in 1..=4 {
        host.frame(0, &[1, node]);
    }
    let stop = Arc::new(AtomicBool::new(false));
    let host = move_hip_and_knee(host, Arc::clone(&stop));
    let begin = Instant::now();
    let is_there = |sample: &Value| {
        let angles = [0, 1].map(|joint| sample["angle_rad"][joint].as_f64().unwrap_or(f64::NAN));
        sample["leg"] == 0 && (angles[0] - 0.1).abs() < 0.006 && (angles[1] - 0.2).abs() < 0.006
    };
    let (mut messages, mut arrived) = (Vec::new(), false);
    for message in live.events() {
        arrived |= all(&message, "samples").any(is_there);
        let is_followed = all(&message, "status")
            .any(|status| status["leg"] == 0 && status["drive"] == "operation enabled");
        messages.push(message);
        if arrived && is_followed {
            break;
        }
        assert!(begin.elapsed() < PATIENCE, "the page does not show the motion");
    }
    let scene = messages.iter().find_map(|message| message["scene"]["legs"].as_array()).expect("a scene");
    let names: Vec<_> = scene.iter().map(|leg| leg["name"].as_str().unwrap_or("")).collect();
    assert_eq!(names, ["x2-wearer-75kg, nodes 1 and 2", "x2-wearer-75kg, nodes 3 and 4"]);
    let mut samples = every(&messages, "samples").into_iter();
    let sample = samples.rfind(|sample| sample["leg"] == 0).expect("samples");
    assert_eq!(sample["commanded_rad"], serde_json::json!([0.1_f32, 0.2_f32]), "{sample}");
    assert!(sample["torque_nm"][0].is_number() && sample["current_a"][1].is_number(), "{sample}");
    let states = every(&messages, "status");
    let last = |leg: u64| states.iter().rev().find(|status| status["leg"] == leg).expect("a status");
    assert_eq!(last(0)["doing"], "follows its host: cyclic position");
    assert_eq!(
        (&last(1)["drive"], &last(1)["waits_for"]),
        (&"switch on disabled".into(), &"controlword 6 of its host".into())
    );
    // A host that is lost: the plug is pulled, and the boards say so once it is back.
    stop.store(true, Ordering::Relaxed);
    host.join().expect("the host ends");
    serve.waits_for("plug is pulled");
    let _host = Client::new(&serve);
    for message in live.events() {
        if all(&message, "notes").any(|note| {
            note["words"].as_str().is_some_and(|words| words.starts_with("leg 1: emergency 8120"))
        }) {
            return;
        }
        assert!(begin.elapsed() < PATIENCE, "the page does not tell the emergency");
    }
}

#[test]
fn a_trace_without_records_is_refused() {
    let folder = Folder::new();
    let run = |text: &str| {
        folder.write("trace.txt", text);
        folder.scarab("live --once --leg x2-wearer-75kg --trace @trace.txt").ends_with(2)
    };
    run("no record\n").warns("contains no trace record");
    run(&session::text(&session::accepted()[..3])).prints("the trace has no complete result");
}

#[test]
fn a_recording_that_cannot_be_read_is_refused_with_its_line() {
    let folder = Folder::new();
    folder.write("bad.csv", "t_s,q1_rad,q2_rad,tau1_Nm,tau2_Nm\n0,0,0,0,zero\n");
    folder.scarab("live --leg mujoco-leg --recording @bad.csv").ends_with(2).warns("bad.csv:2: ");
    folder.scarab("live --recording @bad.csv").refuses("--leg is missing");
}

#[test]
fn a_page_that_does_not_read_is_overtaken_and_slows_nothing() {
    let mut live = Live::new("--speed 1000 --runs 4");
    // A small buffer, so that the page is behind at once.
    let socket = Socket::new(Domain::IPV4, Type::STREAM, None).expect("a socket");
    socket.set_recv_buffer_size(4096).expect("a socket");
    let address: std::net::SocketAddr = live.host.parse().expect("an address");
    socket.connect(&SockAddr::from(address)).expect("it listens");
    let mut stalled = TcpStream::from(socket);
    write!(stalled, "GET /events HTTP/1.1\r\nHost: {}\r\n\r\n", live.host).expect("a connection");
    // 220 s of motion: more points than ring and buffers hold.
    live.prints("verdict: ");
    assert!(live.memory_kb() < 300_000, "{} KB", live.memory_kb());
    stalled.set_read_timeout(Some(PATIENCE)).expect("a socket");
    let messages = Events(BufReader::new(stalled)).until_the_end();
    let dropped: u64 = messages.iter().filter_map(|message| message["dropped"].as_u64()).sum();
    let received: usize = messages.iter().map(points).sum();
    let last = messages.last().expect("messages")["next"].as_u64().expect("a count");
    assert!(dropped > 1000, "{received} of {last} points received, {dropped} lost");
    // What was not received was counted, up to the position of the first message.
    let before = messages[0]["next"].as_u64().expect("a count") - points(&messages[0]) as u64;
    assert_eq!(before + received as u64 + dropped, last);
    let outcome = last_of(&messages, "outcomes");
    assert_eq!(outcome["verdict"], "accepted");
}

#[test]
fn one_page_too_many_is_refused_and_served_when_a_place_is_free() {
    let live = Live::new("--speed 1");
    let mut pages: Vec<Events> = (0..MOST_PAGES).map(|_| live.events()).collect();
    for page in &mut pages {
        assert!(page.next().is_some_and(|message| message["scene"].is_object()));
    }
    let refused = live.answer("GET /events HTTP/1.1\r\nHost: {host}\r\n\r\n");
    assert!(refused.starts_with("HTTP/1.1 503 ") && refused.contains("close another page"), "{refused}");
    pages.pop();
    let begin = Instant::now();
    // The server notices the end of a connection at its next write.
    while live.events().next().is_none_or(|message| !message["scene"].is_object()) {
        assert!(begin.elapsed() < PATIENCE, "the place stays taken");
        thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn an_address_outside_this_machine_needs_a_token() {
    for (arguments, words) in [
        ("--listen 0.0.0.0:0", "add --token"),
        ("--listen 0.0.0.0:0 --token short", "5 characters, at least 16"),
        ("--speed 0", "--speed: 0.0 must be from 0.001 to 1000"),
        ("--speed 1e-300", "--speed: 1e-300 must be from 0.001 to 1000"),
    ] {
        scarab(&format!("live {arguments}")).refuses(words);
    }
    let live = Live::new("--token 0123456789abcdef");
    let refused = live.answer("GET /events HTTP/1.1\r\nHost: {host}\r\n\r\n");
    assert!(refused.starts_with("HTTP/1.1 401 "), "{refused}");
    let allowed = "GET /events?token=0123456789abcdef HTTP/1.1\r\nHost: {host}\r\n\r\n";
    let mut events = Events(live.ask(allowed));
    assert!(events.next().is_some_and(|message| message["scene"].is_object()));
}
