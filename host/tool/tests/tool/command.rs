//! Runs the tool as its users do and reads its outputs.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::atomic::{AtomicU32, Ordering};
use std::{env, fs};

use serde_json::Value;

/// Recording of the leg simulated by MuJoCo: 30 s at 500 Hz, period 10 s.
pub const MUJOCO: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/mujoco_leg/fourier.csv");

/// Output and exit code of a run.
pub struct Run {
    pub code: Option<i32>,
    pub printed: String,
    pub errors: String,
}

/// Runs the program under test with arguments separated by spaces, and paths.
pub fn scarab(arguments: &str, paths: &[&Path]) -> Run {
    let output: Output = Command::new(crate::PROGRAM)
        .args(arguments.split_whitespace())
        .args(paths)
        .output()
        .expect("the tool runs");
    Run {
        code: output.status.code(),
        printed: String::from_utf8(output.stdout).expect("text"),
        errors: String::from_utf8(output.stderr).expect("text"),
    }
}

impl Run {
    /// Fails unless the run ended with this code, and shows its output.
    pub fn ends_with(self, code: i32) -> Self {
        assert_eq!(self.code, Some(code), "{}{}", self.printed, self.errors);
        self
    }

    /// Message of a run rejected as bad input.
    pub fn refusal(self) -> String {
        let run = self.ends_with(2);
        assert_eq!(run.printed, "", "bad input prints only its message");
        run.errors
    }
}

/// Temporary folder.
pub struct Folder(PathBuf);

impl Folder {
    pub fn new() -> Self {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let path = env::temp_dir().join(format!("scarab-test-{}-{number}", std::process::id()));
        fs::create_dir_all(&path).expect("a temporary folder");
        Self(path)
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    pub fn write(&self, name: &str, text: &str) -> PathBuf {
        let path = self.path(name);
        fs::write(&path, text).expect("a temporary file");
        path
    }

    pub fn json(&self, name: &str) -> Value {
        let text = fs::read_to_string(self.path(name)).expect("the report was written");
        serde_json::from_str(&text).expect("JSON")
    }

    pub fn table(&self, name: &str) -> Table {
        Table::parse(&fs::read_to_string(self.path(name)).expect("the table was written"))
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// Numbers with their column names.
pub struct Table {
    pub header: Vec<String>,
    pub rows: Vec<Vec<f64>>,
}

impl Table {
    pub fn read(path: &str) -> Self {
        Self::parse(&fs::read_to_string(path).unwrap_or_else(|error| panic!("{path}: {error}")))
    }

    pub fn parse(text: &str) -> Self {
        let mut lines = text.lines();
        let header: Vec<String> = lines.next().expect("a header").split(',').map(str::to_owned).collect();
        let number =
            |field: &str| field.parse::<f64>().unwrap_or_else(|_| panic!("`{field}` is not a number"));
        let rows: Vec<Vec<f64>> = lines.map(|line| line.split(',').map(number).collect()).collect();
        assert!(rows.iter().all(|row| row.len() == header.len()), "lines of different lengths");
        Self { header, rows }
    }

    /// The table as a CSV file.
    pub fn text(&self) -> String {
        let line = |row: &Vec<f64>| row.iter().map(f64::to_string).collect::<Vec<_>>().join(",") + "\n";
        self.header.join(",") + "\n" + &self.rows.iter().map(line).collect::<String>()
    }

    pub fn index(&self, name: &str) -> usize {
        let index = self.header.iter().position(|present| present == name);
        index.unwrap_or_else(|| panic!("no column {name} in {:?}", self.header))
    }

    pub fn column(&self, name: &str) -> Vec<f64> {
        let index = self.index(name);
        self.rows.iter().map(|row| row[index]).collect()
    }
}

/// Folder with recordings of real machines, `SCARAB_RECORDINGS`; without it a notice that `what` is skipped.
pub fn recordings(what: &str) -> Option<PathBuf> {
    let folder = env::var_os("SCARAB_RECORDINGS").map(PathBuf::from);
    if folder.is_none() {
        // Bypasses the test harness, which suppresses the output of passing tests.
        let notice = format!("SKIPPED {what}: SCARAB_RECORDINGS is not set");
        writeln!(std::io::stderr(), "{notice}").expect("standard error");
    }
    folder
}

/// One number of a fit in a report.
pub fn fit(report: &Value, part: &str, joint: usize, field: &str) -> f64 {
    let entry = report[part].as_array().expect("a list").iter().find(|entry| entry["joint"] == joint);
    entry
        .and_then(|entry| entry[field].as_f64())
        .unwrap_or_else(|| panic!("{part} {joint} {field}: {report}"))
}

/// One number of a base parameter in a report.
pub fn base(report: &Value, name: &str, field: &str) -> f64 {
    let entry =
        report["base_parameters"].as_array().expect("a list").iter().find(|entry| entry["name"] == name);
    entry.and_then(|entry| entry[field].as_f64()).unwrap_or_else(|| panic!("{name} {field}: {report}"))
}

pub fn reasons(report: &Value) -> Vec<&str> {
    report["reasons"].as_array().expect("a list").iter().filter_map(Value::as_str).collect()
}
