//! `cargo sim monitor` from the command line.

use crate::command::{Folder, scarab};

#[test]
fn a_payload_is_detected_and_estimated_while_pushes_raise_no_alarm() {
    let folder = Folder::new();
    let arguments = "monitor --payload 3@knee:0.2 --seed 2 --at 5 --hours 0.02 --pushes 6:20";
    let (_, report) = folder.reported(arguments, 0);
    let run = &report["runs"][0];
    assert_eq!(run["false_alarms_at_s"].as_array().map(Vec::len), Some(0));
    assert!(run["alarm"]["after_s"].as_f64().is_some_and(|after| (3.0..10.0).contains(&after)), "{run}");
    let update = &run["update"];
    assert_eq!((update["cause"].as_str(), update["link"].as_str()), (Some("payload"), Some("knee")));
    let mass = &update["values"][0];
    assert_eq!((mass["name"].as_str(), mass["truth"].as_f64()), (Some("M2"), Some(3.0)));
    // Five standard deviations.
    assert!(mass["value"].as_f64().is_some_and(|value| (value - 3.0).abs() < 0.09), "{mass}");
}

#[test]
fn bad_input_names_the_option() {
    for (arguments, words) in [
        ("--payload 3@foot:0.2", "`foot` is not a joint"),
        ("--payload -50@knee:0.2", "--payload -50@knee:0.2: removes more than the link's 6.935 kg"),
        ("--payload nan@knee:0.2", "--payload nan@knee:0.2"),
        ("--friction nan", "--friction: NaN"),
        ("--hours 1e9", "--hours"),
        ("--at -1", "--at"),
        ("--pushes 6", "--pushes 6: is not PER_MINUTE:PEAK_NM"),
        ("--pushes 0:5", "--pushes PER_MINUTE"),
        ("--leg sp", "has no `truth`"),
    ] {
        scarab(&format!("monitor {arguments}")).refuses(words);
    }
}
