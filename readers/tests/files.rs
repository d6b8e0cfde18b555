//! Files of foreign software are read, damaged ones are refused. `tests/data/make.py` wrote the files.

#![expect(clippy::disallowed_methods, reason = "a test on the host may use std's mathematics")]

use std::borrow::Cow;
use std::cell::Cell;
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
use scarab_readers::mcap::Mcap;
use scarab_readers::parquet::Parquet;
use scarab_readers::{Column, Error, Row, Table};

const SAMPLES: usize = 120;

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name)
}

/// Temporary file.
struct Temporary(PathBuf);

impl Temporary {
    fn new(bytes: &[u8]) -> Self {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let path = std::env::temp_dir().join(format!("scarab-readers-{}-{number}", std::process::id()));
        std::fs::write(&path, bytes).expect("a temporary file");
        Self(path)
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

/// Rows of these columns, with their numbers.
fn rows(table: &dyn Table, names: &[&str]) -> Result<Vec<(u64, Vec<f64>)>, Error> {
    let index = |name: &&str| table.columns().iter().position(|column| column.name == *name).expect(name);
    let chosen: Vec<usize> = names.iter().map(index).collect();
    let mut rows = Vec::new();
    table.read(&chosen, &mut |Row { number, values, done }| {
        assert!((0.0..=1.0).contains(&done), "{done}");
        rows.push((number, values.to_vec()));
        ControlFlow::Continue(())
    })?;
    Ok(rows)
}

fn refusal<T>(result: Result<T, Error>) -> String {
    match result {
        Ok(_) => panic!("accepted"),
        Err(error) => error.to_string(),
    }
}

/// Time, angle and torque of sample `k`, as `make.py` computes them.
fn sample(k: usize) -> [f64; 3] {
    let time = k as f64 / 64.0;
    [time, 0.5 * (3.0 * time).sin(), 4.0 - k as f64 / 8.0]
}

#[test]
fn parquet_of_pyarrow_is_read_with_nulls_units_and_several_row_groups() {
    for name in ["snappy.parquet", "zstd.parquet", "lz4.parquet"] {
        let table = Parquet::open(&data(name)).expect(name);
        let column = |name: &str, unit| Column { name: name.to_owned(), unit };
        assert_eq!(table.columns()[..2], [column("stamp", Some("ns")), column("time", None)]);
        let found = rows(&table, &["tau1_Nm", "time", "q1_rad", "stamp", "count"]).expect(name);
        assert_eq!(found.len(), SAMPLES);
        for (k, (number, values)) in found.iter().enumerate() {
            let [time, angle, torque] = sample(k);
            assert_eq!(*number, k as u64 + 1);
            assert_eq!(values[1], time);
            // Another library's sine may differ in the last place.
            assert!((values[2] - angle).abs() < 1e-15, "{k}: {} {angle}", values[2]);
            assert_eq!((values[3], values[4]), ((1e9 * time).floor(), k as f64));
            assert!(values[0] == torque || k == 7 && values[0].is_nan(), "{k}: {}", values[0]);
        }
    }
}

#[test]
fn columns_without_numbers_and_unbounded_codecs_are_refused() {
    let table = Parquet::open(&data("snappy.parquet")).expect("pyarrow's");
    assert_eq!(refusal(rows(&table, &["note"])), "column `note` holds BYTE_ARRAY, not plain numbers");
    let table = Parquet::open(&data("gzip.parquet")).expect("pyarrow's");
    let message = refusal(rows(&table, &["time"]));
    assert!(message.contains("compressed by GZIP") && message.contains("snappy, zstd"), "{message}");
}

#[test]
fn a_page_that_claims_more_than_the_limit_is_not_decoded() {
    let mut bytes = std::fs::read(data("snappy.parquet")).expect("shipped");
    // The first page header: type DICTIONARY_PAGE or DATA_PAGE, then the size as a zigzag number.
    let header = 4;
    assert_eq!((bytes[header], bytes[header + 2]), (0x15, 0x15));
    let sizes = &bytes[header + 3..header + 5];
    assert!(sizes[0] & 0x80 != 0 && sizes[1] & 0x80 == 0, "two bytes: {sizes:?}");
    // Five bytes in place of two: the file's later offsets are wrong, which no longer matters.
    bytes.splice(header + 3..header + 5, [0xFE, 0xFF, 0xFF, 0xFF, 0x0F]);
    let file = Temporary::new(&bytes);
    let table = Parquet::open(&file.0).expect("the footer is intact");
    let message = refusal(rows(&table, &["stamp"]));
    assert!(message.contains("a page claims 2147483647 bytes, at most 67108864 are decoded"), "{message}");
}

#[test]
fn joint_states_of_rosbag2_are_read_by_name_of_the_joint() {
    for name in ["plain.mcap", "zstd.mcap"] {
        let table = Mcap::open(&data(name)).expect(name);
        let names: Vec<_> = table.columns().iter().map(|column| column.name.as_str()).collect();
        assert_eq!(names[..4], ["time", "log_time", "position[hip_joint]", "velocity[hip_joint]"]);
        assert_eq!(names.len(), 8);
        assert_eq!(table.columns()[0].unit, Some("s"));
        let chosen = [
            "time",
            "log_time",
            "position[hip_joint]",
            "effort[hip_joint]",
            "position[knee_joint]",
            "effort[knee_joint]",
            "velocity[knee_joint]",
        ];
        let found = rows(&table, &chosen).expect(name);
        assert_eq!(found.len(), SAMPLES);
        for (k, (_, values)) in found.iter().enumerate() {
            let [time, angle, torque] = sample(k);
            // Seconds since 1970 resolve a quarter of a microsecond.
            assert!((values[0] - 1.7e9 - time).abs() < 5e-7, "{k}: {}", values[0]);
            assert!((values[1] - time).abs() < 1e-9, "{k}: {}", values[1]);
            for (scale, pair) in [(1.0, &values[2..4]), (2.0, &values[4..6])] {
                assert!(
                    (pair[0] - scale * angle).abs() < 1e-15 && pair[1] == scale * torque,
                    "{k}: {pair:?}"
                );
            }
            assert!(values[6].is_nan(), "no speed was published");
        }
    }
}

/// MCAP file with one message for each channel: topic, schema, encoding, data.
fn mcap_of(channels: &[(&str, &str, &str, &[u8])]) -> Temporary {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let mut writer = mcap::Writer::new(&mut bytes).expect("memory");
    for (number, (topic, schema, encoding, data)) in channels.iter().enumerate() {
        let schema = mcap::Schema {
            id: number as u16 + 1,
            name: (*schema).to_owned(),
            encoding: "ros2msg".to_owned(),
            data: Cow::Borrowed(b""),
        };
        let channel = mcap::Channel {
            id: number as u16,
            topic: (*topic).to_owned(),
            schema: Some(Arc::new(schema)),
            message_encoding: (*encoding).to_owned(),
            metadata: BTreeMap::new(),
        };
        let message = mcap::Message {
            channel: Arc::new(channel),
            sequence: 1,
            log_time: 1,
            publish_time: 1,
            data: Cow::Borrowed(data),
        };
        writer.write(&message).expect("memory");
    }
    writer.finish().expect("memory");
    drop(writer);
    Temporary::new(&bytes.into_inner())
}

/// State of one joint, big endian.
fn state(joint: &str) -> Vec<u8> {
    let mut bytes = vec![0, 0, 0, 0];
    let align =
        |bytes: &mut Vec<u8>, size: usize| bytes.resize(4 + (bytes.len() - 4).next_multiple_of(size), 0);
    let text = |bytes: &mut Vec<u8>, text: &str| {
        align(bytes, 4);
        bytes.extend((text.len() as u32 + 1).to_be_bytes());
        bytes.extend(text.bytes().chain([0]));
    };
    bytes.extend(5_i32.to_be_bytes());
    bytes.extend(250_000_000_u32.to_be_bytes());
    text(&mut bytes, "base");
    align(&mut bytes, 4);
    bytes.extend(1_u32.to_be_bytes());
    text(&mut bytes, joint);
    for value in [0.5_f64, 0.25, -3.0] {
        align(&mut bytes, 4);
        bytes.extend(1_u32.to_be_bytes());
        align(&mut bytes, 8);
        bytes.extend(value.to_be_bytes());
    }
    bytes
}

const STATE: &str = "sensor_msgs/msg/JointState";

#[test]
fn topics_are_named_where_there_are_several_and_never_mixed() {
    let (hip, knee) = (state("hip"), state("knee"));
    let file = mcap_of(&[("/a", STATE, "cdr", &hip), ("/b", STATE, "cdr", &knee)]);
    let table = Mcap::open(&file.0).expect("two topics");
    let found = rows(&table, &["/b:time", "/b:position[knee]", "/b:effort[knee]"]).expect("one topic");
    assert_eq!(found, [(1, vec![5.25, 0.5, -3.0])]);
    let message = refusal(rows(&table, &["/a:time", "/b:position[knee]"]));
    assert!(message.contains("topics /a and /b"), "{message}");
}

#[test]
fn the_files_of_a_split_bag_are_read_in_the_order_of_their_numbers() {
    let states = |joint: &str| {
        let bytes = state(joint);
        std::fs::read(&mcap_of(&[("/states", "sensor_msgs/msg/JointState", "cdr", &bytes)]).0)
            .expect("written")
    };
    let folder = Temporary::new(b"");
    std::fs::remove_file(&folder.0).expect("its name is free");
    std::fs::create_dir(&folder.0).expect("a temporary folder");
    let part = |name: &str, bytes: &[u8]| std::fs::write(folder.0.join(name), bytes).expect("a file");
    assert!(refusal(Mcap::open(&folder.0)).contains("no `.mcap` file"));
    part("metadata.yaml", b"");
    for (name, joint) in [("bag_0.mcap", "a"), ("bag_10.mcap", "c"), ("bag_9.mcap", "b")] {
        part(name, &states(joint));
    }
    let table = Mcap::open(&folder.0).expect("a bag of three files");
    let names = ["position[a]", "position[b]", "position[c]"];
    let found = rows(&table, &names).expect("three messages");
    let order: Vec<_> = found
        .iter()
        .map(|(number, values)| (*number, values.iter().position(|value| !value.is_nan())))
        .collect();
    assert_eq!(order, [(1, Some(0)), (2, Some(1)), (3, Some(2))]);
    // A damaged part is named.
    part("bag_9.mcap", &states("b")[..60]);
    part("bag_11.mcap", b"\x89MCAP0\r\nno record");
    let message = refusal(Mcap::open(&folder.0).and_then(|table| rows(&table, &names)));
    assert!(message.contains("bag_"), "{message}");
    std::fs::remove_dir_all(&folder.0).expect("the folder exists");
}

#[test]
fn other_messages_and_encodings_are_refused_with_a_sentence() {
    let hip = state("hip");
    let opened = |channels: &[(&str, &str, &str, &[u8])]| refusal(Mcap::open(&mcap_of(channels).0));
    let message = opened(&[("/a", "std_msgs/msg/String", "cdr", b"")]);
    assert!(
        message.contains("no message of the type sensor_msgs/msg/JointState")
            && message.contains("std_msgs/msg/String"),
        "{message}"
    );
    let message = opened(&[("/a", "sensor_msgs/JointState", "ros1", &hip)]);
    assert!(message.contains("messages of ROS 1: convert the bag"), "{message}");
    assert!(opened(&[("/a", STATE, "json", b"{}")]).contains("encoding `json`"));
    let mut other = hip.clone();
    other[1] = 7;
    assert!(opened(&[("/a", STATE, "cdr", &other)]).contains("encapsulation 7; only plain CDR"));
    assert!(
        opened(&[("/a", STATE, "cdr", &hip[..hip.len() - 4])]).contains("damaged message of joint states")
    );
    let long = state(&"j".repeat(2000));
    assert!(opened(&[("/a", STATE, "cdr", &long)]).contains("a name of 2000 bytes, at most 1000"));
}

#[test]
fn a_record_beyond_the_limit_is_refused_before_it_is_unpacked() {
    let message = vec![0; 80 << 20];
    let file = mcap_of(&[("/a", STATE, "cdr", &message)]);
    assert!(std::fs::metadata(&file.0).expect("written").len() < 1 << 20, "a bomb is small");
    let refused = refusal(Mcap::open(&file.0));
    assert!(refused.contains("damaged MCAP file"), "{refused}");
}

/// One change of a file: kind, position and content.
type Change = (u8, f64, u32);

fn damaged(good: &[u8], changes: &[Change]) -> Vec<u8> {
    let mut bytes = good.to_vec();
    for &(kind, share, what) in changes {
        if bytes.is_empty() {
            break;
        }
        let at = ((share * bytes.len() as f64) as usize).min(bytes.len() - 1);
        let end = (at + what as usize % 40).min(bytes.len());
        match kind {
            0 => bytes[at] ^= 1 << (what % 8),
            1 => bytes[at] = what as u8,
            2 => bytes.insert(at, what as u8),
            3 => drop(bytes.drain(at..end)),
            4 => bytes.truncate(at),
            5 => bytes[at..end].fill(0xFF),
            _ => {
                let copy = bytes[at..end].to_vec();
                let to = what as usize % bytes.len();
                bytes.splice(to..to, copy);
            }
        }
    }
    bytes
}

/// Reads every column of a file; returns the largest number of rows that one of them gave.
fn read_all(table: Result<Box<dyn Table>, Error>) -> usize {
    let Ok(table) = table else { return 0 };
    let mut most = 0;
    for index in 0..table.columns().len().min(20) {
        let mut rows = 0;
        let _ = table.read(&[0, index], &mut |_| {
            rows += 1;
            if rows < 100_000 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        });
        most = most.max(rows);
    }
    most
}

/// Largest resident memory of this process so far, bytes.
fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix(" kB")?.trim().parse::<u64>().ok().map(|kilobytes| kilobytes << 10)
}

/// Damages a file at random and reads it: no panic, and no memory beyond a few pieces.
fn fuzz(names: &[&str], open: fn(&Path) -> Result<Box<dyn Table>, Error>) {
    let good: Vec<Vec<u8>> = names.iter().map(|name| std::fs::read(data(name)).expect("shipped")).collect();
    let cases = std::env::var("SCARAB_FUZZ_CASES").ok().and_then(|cases| cases.parse().ok()).unwrap_or(1000);
    let config = Config { cases, failure_persistence: None, ..Config::default() };
    let mut runner = TestRunner::new_with_rng(config, TestRng::deterministic_rng(RngAlgorithm::ChaCha));
    let change = (0_u8..7, 0.0..1.0_f64, any::<u32>());
    let strategy = (0..good.len(), prop::collection::vec(change, 1..3), any::<bool>());
    let (read, whole) = (Cell::new(0_u32), Cell::new(0_u32));
    let result = runner.run(&strategy, |(file, changes, is_random)| {
        let bytes = if is_random && changes.len() == 1 {
            let begin = [&good[file][..8], &changes[0].2.to_le_bytes().repeat(50)].concat();
            damaged(&begin, &changes)
        } else {
            damaged(&good[file], &changes)
        };
        let file = Temporary::new(&bytes);
        let rows = read_all(open(&file.0));
        read.set(read.get() + u32::from(rows > 0));
        whole.set(whole.get() + u32::from(rows == SAMPLES));
        Ok(())
    });
    if let Err(failure) = result {
        panic!("{failure}");
    }
    // The changes reach the decoders, and neither miss nor destroy every file.
    let (read, whole) = (read.get(), whole.get());
    println!("of {cases} files {read} gave rows, {whole} all of them");
    assert!(read > cases / 50 && whole < cases * 19 / 20, "{read} and {whole} of {cases}");
    if let Some(peak) = peak_memory() {
        assert!(peak < 1 << 30, "{} MB at the peak", peak >> 20);
    }
}

#[test]
fn damaged_parquet_files_end_in_rows_or_an_error() {
    fuzz(&["snappy.parquet", "zstd.parquet", "lz4.parquet", "gzip.parquet"], |path| {
        Parquet::open(path).map(|table| Box::new(table) as Box<dyn Table>)
    });
}

#[test]
fn damaged_mcap_files_end_in_rows_or_an_error() {
    fuzz(&["plain.mcap", "zstd.mcap"], |path| {
        Mcap::open(path).map(|table| Box::new(table) as Box<dyn Table>)
    });
}
