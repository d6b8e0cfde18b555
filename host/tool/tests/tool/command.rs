//! Runs the tool as its users do and reads its outputs.

use std::io::Write;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::{env, fs};

use serde_json::Value;

/// Recording of the leg simulated by MuJoCo: 30 s at 500 Hz, period 10 s.
pub const MUJOCO: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/mujoco_leg/fourier.csv");

/// Output and exit code of a run.
pub struct Run {
    /// Arguments of the run, shown where a check fails.
    line: String,
    pub code: Option<i32>,
    pub printed: String,
    pub errors: String,
}

/// Runs the program under test with arguments separated by spaces.
pub fn scarab(arguments: &str) -> Run {
    run(arguments.split_whitespace().map(str::to_owned).collect(), "")
}

/// Runs the program under test with these arguments and this text as its standard input.
pub fn run(arguments: Vec<String>, input: &str) -> Run {
    let mut child = Command::new(crate::PROGRAM)
        .args(&arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the tool runs");
    // A refused command line ends the run before it reads.
    let _ = child.stdin.take().expect("a pipe").write_all(input.as_bytes());
    let output = child.wait_with_output().expect("the tool ends");
    Run {
        line: arguments.join(" "),
        code: output.status.code(),
        printed: String::from_utf8(output.stdout).expect("text"),
        errors: String::from_utf8(output.stderr).expect("text"),
    }
}

impl Run {
    /// Fails unless the run ended with this code, and shows its output.
    #[track_caller]
    pub fn ends_with(self, code: i32) -> Self {
        assert_eq!(self.code, Some(code), "{}\n{}{}", self.line, self.printed, self.errors);
        self
    }

    /// Message of a run rejected as bad input.
    #[track_caller]
    pub fn refusal(self) -> String {
        let run = self.ends_with(2);
        assert_eq!(run.printed, "", "bad input prints only its message");
        run.errors
    }

    /// Fails unless the run was rejected as bad input by a message with these words.
    #[track_caller]
    pub fn refuses(self, words: &str) {
        let line = self.line.clone();
        let message = self.refusal();
        assert!(message.contains(words), "{line}\nexpected: {words}\n{message}");
    }

    /// Fails unless standard output contains these words.
    #[track_caller]
    pub fn prints(&self, words: &str) {
        assert!(self.printed.contains(words), "{}\nexpected: {words}\n{}", self.line, self.printed);
    }

    /// Fails unless standard error contains these words.
    #[track_caller]
    pub fn warns(&self, words: &str) {
        assert!(self.errors.contains(words), "{}\nexpected: {words}\n{}", self.line, self.errors);
    }
}

/// Fails unless the text contains these words.
#[track_caller]
pub fn assert_contains(text: &str, words: &str) {
    assert!(text.contains(words), "expected: {words}\n{text}");
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

    /// Runs the program under test; an argument `@name` is a path in this folder.
    pub fn scarab(&self, arguments: &str) -> Run {
        let argument = |word: &str| match word.strip_prefix('@') {
            Some(name) => self.path(name).display().to_string(),
            None => word.to_owned(),
        };
        run(arguments.split_whitespace().map(argument).collect(), "")
    }

    /// Runs a command that ends with this code, and reads its report.
    #[track_caller]
    pub fn reported(&self, arguments: &str, code: i32) -> (Run, Value) {
        let run = self.scarab(&format!("{arguments} --json @report.json")).ends_with(code);
        (run, self.json("report.json"))
    }

    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path(name);
        fs::write(&path, content).expect("a temporary file");
        path
    }

    pub fn read(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    pub fn json(&self, name: &str) -> Value {
        serde_json::from_str(&self.read(name)).expect("JSON")
    }

    pub fn table(&self, name: &str) -> Table {
        Table::parse(&self.read(name))
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

/// List under this key.
pub fn list<'a>(report: &'a Value, key: &str) -> &'a [Value] {
    report[key].as_array().unwrap_or_else(|| panic!("{key} is not a list: {report}"))
}

/// Number under this key.
pub fn number(entry: &Value, key: &str) -> f64 {
    entry[key].as_f64().unwrap_or_else(|| panic!("{key} is not a number: {entry}"))
}

/// One number of a fit in a report.
pub fn fit(report: &Value, part: &str, joint: usize, field: &str) -> f64 {
    let entry = list(report, part).iter().find(|entry| entry["joint"] == joint);
    number(entry.unwrap_or_else(|| panic!("no {part} of joint {joint}: {report}")), field)
}

/// One number of a base parameter in a report.
pub fn base(report: &Value, name: &str, field: &str) -> f64 {
    let entry = list(report, "base_parameters").iter().find(|entry| entry["name"] == name);
    number(entry.unwrap_or_else(|| panic!("no {name}: {report}")), field)
}

pub fn reasons(report: &Value) -> Vec<&str> {
    list(report, "reasons").iter().filter_map(Value::as_str).collect()
}
