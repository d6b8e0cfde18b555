//! Docstrings of the type stubs as files, so that `help` and the stubs show the same text.
//!
//! A file for each function and class that has a docstring: `Leg`, `Leg.identify`, `beetle_swarm`.

use std::path::Path;
use std::{env, fs};

const STUBS: &str = "scarab_ident/_native.pyi";
const QUOTES: &str = "\"\"\"";

fn main() {
    println!("cargo::rerun-if-changed={STUBS}");
    let out = env::var("OUT_DIR").expect("cargo sets it");
    let text = fs::read_to_string(STUBS).expect("the stubs are part of the package");
    let (mut class, mut item) = (String::new(), String::new());
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        let code = line.trim_start();
        let indent = line.len() - code.len();
        let name_of = |rest: &str| rest.split(['(', ':']).next().unwrap_or_default().to_owned();
        if let Some(rest) = code.strip_prefix("class ") {
            class = name_of(rest);
            item.clone_from(&class);
        } else if let Some(rest) = code.strip_prefix("def ") {
            item = if indent == 0 { name_of(rest) } else { format!("{class}.{}", name_of(rest)) };
        } else if let Some(first) = code.strip_prefix(QUOTES).filter(|_| !item.is_empty()) {
            let mut doc = vec![first.to_owned()];
            while !doc.last().is_some_and(|last| last.ends_with(QUOTES)) {
                let next = lines.next().expect("a docstring ends");
                doc.push(next.get(indent..).unwrap_or_default().to_owned());
            }
            let doc = doc.join("\n");
            let doc = doc.trim_end_matches(QUOTES).trim_end();
            fs::write(Path::new(&out).join(&item), doc).expect("the build folder can be written");
        }
    }
}
