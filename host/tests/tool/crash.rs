//! Crashes of the whole firmware on the emulated microcontroller: outputs off first, a record that
//! survives one reset, a refusal.
//!
//! Tests that need QEMU and a compiler for the microcontroller run in a step of .ci/run:
//! `cargo test -p scarab-host --test tool emulated -- --ignored`.

use std::path::Path;

use scarab_host::image::emulate::crash::{CrashKind, CrashReport, Witness};

use crate::command::{Folder, Run, scarab};
use crate::emulation::{changed_leg, the_image};

const REHEARSAL: &str = include_str!("../../../emulated/src/bin/emulated/rehearsal.rs");

/// Crash in the middle of the excitation, while a current tick is due; fails if a requirement is violated.
fn crashed(kind: &str) -> Run {
    let _image = the_image();
    let folder = Folder::new();
    // Leg of the other emulated test, so that nothing is built twice.
    let leg = changed_leg(&folder);
    let kept = folder.path("trace");
    let run = scarab("emulate --crash", &[kind.as_ref(), "--leg".as_ref(), &leg, "--trace".as_ref(), &kept]);
    println!("{}{}", run.printed, run.errors);
    let run = run.ends_with(0);
    // Requirements behind the report's checks, as shown by the timeline.
    let reported = run.printed.matches("the image CRASHED before this start").count();
    assert_eq!((reported, run.printed.matches("start (software)").count()), (1, 2));
    assert_eq!(run.printed.matches("identify, REFUSED").count(), 1);
    run
}

#[test]
#[ignore = "needs an emulator and a compiler for the microcontroller: a step of .ci/run"]
fn an_emulated_panic_turns_bridges_off_first_and_reports_file_and_line() {
    let line = 1 + REHEARSAL.lines().position(|line| line.ends_with("// here")).expect("the marked line");
    let place = format!("panic: emulated/src/bin/emulated/rehearsal.rs line {line}\n");
    let run = crashed("panic");
    assert!(run.printed.contains(&place), "{}", run.printed);
}

#[test]
#[ignore = "needs an emulator and a compiler for the microcontroller: a step of .ci/run"]
fn an_emulated_hard_fault_turns_bridges_off_first_and_reports_its_address() {
    let run = crashed("hard_fault");
    let place = "hard_fault: in emulated::rehearsal::read_nowhere, address 0x10000000\n";
    assert!(run.printed.contains(place), "{}", run.printed);
}

#[test]
#[ignore = "needs an emulator and a compiler for the microcontroller: a step of .ci/run"]
fn an_emulated_stack_overflow_faults_and_turns_bridges_off_first() {
    let run = crashed("stack_overflow");
    // The stack ends at the start of the memory, and the overflowing word is within one call of it. Its
    // caller may be a function that the compiler has outlined, so its name is not checked.
    let reported = run.printed.split_once("stack_overflow").map_or("", |(_, rest)| rest);
    let address = reported.split_once("address 0x");
    let digits = address.and_then(|(_, rest)| rest.lines().next()).expect("its address is reported");
    let address = u32::from_str_radix(digits, 16).expect("a number");
    assert!((0x2000_0000 - 0x800..0x2000_0000).contains(&address), "{address:#x}");
}

#[test]
#[ignore = "needs an emulator and a compiler for the microcontroller: a step of .ci/run"]
fn an_unhandled_emulated_interrupt_turns_bridges_off_first_and_reports_its_number() {
    let run = crashed("interrupt");
    // Interrupt 49 is SDIO, RM0090 table 62.
    assert!(run.printed.contains("interrupt: number 49\n"), "{}", run.printed);
}

const LOG: [&str; 7] = [
    "CPU Reset (CPU 0)",
    "Taking exception 4 [Data Abort] on CPU 0",
    "timer[1]: unimplemented device write (size 4, offset 0x044, value 0x00000c14)",
    "timer[8]: unimplemented device write (size 4, offset 0x044, value 0x00000c14)",
    "CPU Reset (CPU 0)",
    "Taking exception 5 [IRQ] on CPU 0",
    "CPU Reset (CPU 0)",
];

#[test]
fn a_current_tick_after_bridges_off_is_detected() {
    let whole = LOG.join("\n");
    assert_eq!(Witness::of(&whole), Witness { released: true, exceptions: 0, resets: 2 });
    let interrupted = whole.replacen("\nCPU Reset", "\nTaking exception 5 [IRQ] on CPU 0\nCPU Reset", 1);
    assert_eq!(Witness::of(&interrupted).exceptions, 1);
    let half = whole.replace("timer[8]", "timer[9]");
    assert!(!Witness::of(&half).released);
}

const RECORDS: &str = "\
boot n=0 grammar=1 version=0.1.0 leg=x2 joints=2 base=13 servo_hz=4000 log_hz=500 reset=power
state n=1 tick=1 drive=operation_enabled activity=identify phase=excite motion=0
boot n=0 grammar=1 version=0.1.0 leg=x2 joints=2 base=13 servo_hz=4000 log_hz=500 reset=software
board n=1 uid0=0x0 uid1=0x0 uid2=0x0 version=0 version_minor=0 version_volt=0 clock_hz=125000000
crash n=2 cause=panic pc=0x0 lr=0x0 status=0x0 address=0xffffffff line=7 file=a.rs released=1100 kept=1300
refused n=3 why=crash value=0x400
request n=4 tick=1 name=identify accepted=false
state n=5 tick=2 drive=operation_enabled activity=identify phase=excite motion=0
boot n=0 grammar=1 version=0.1.0 leg=x2 joints=2 base=13 servo_hz=4000 log_hz=500 reset=pin
state n=1 tick=3 drive=operation_enabled activity=identify phase=excite motion=0
";

#[test]
fn every_violated_requirement_of_a_crash_is_reported() {
    let report = |records: &str, begun| {
        CrashReport::new(CrashKind::Panic, records, &LOG.join("\n"), begun, Path::new("-")).expect("complete")
    };
    let good = report(RECORDS, 1_000);
    assert_eq!((good.released_after, good.kept_after), (100, 300));
    assert!(good.complaints.is_empty(), "{:?}", good.complaints);
    for (from, to, complaint) in [
        ("cause=panic", "cause=hard_fault", "the reported cause"),
        ("released=1100", "released=1400", "the bridges turned off after the record"),
        ("why=crash", "why=watchdog", "not refused before"),
        ("accepted=false", "accepted=true", "not refused before"),
        ("tick=1 drive=operation", "tick=1 drive=switch", "not identifying when it crashed"),
        ("tick=2 drive=operation", "tick=2 drive=switch", "not enabled after"),
    ] {
        let complaints = report(&RECORDS.replacen(from, to, 1), 1_000).complaints;
        assert!(complaints.iter().any(|words| words.contains(complaint)), "{from}: {complaints:?}");
    }
    // 10 us are 1,250 instructions of 8 ns.
    assert!(report(&RECORDS.replace("1100", "2250").replace("1300", "2300"), 1_000).complaints.len() == 1);
    let crash = RECORDS.lines().find(|line| line.starts_with("crash")).expect("a crash");
    let again = format!("{RECORDS}{crash}\n");
    assert!(report(&again, 1_000).complaints.iter().any(|words| words.contains("a second time")));
    // One start too many.
    let boot = RECORDS.lines().next().expect("a start");
    let more = format!("{RECORDS}{boot}\n");
    assert!(CrashReport::new(CrashKind::Panic, &more, "", 1_000, Path::new("-")).is_err());
}
