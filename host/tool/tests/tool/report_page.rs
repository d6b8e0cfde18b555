//! Report page: complete, well-formed, explicit about unknown values, and safe against the contents of files.

use crate::command::{Folder, MUJOCO, Run, Table, assert_contains, list, number};
use scraper::{Html, Selector};
use serde_json::Value;

const LEG: &str = include_str!("../../../legs/x2-wearer-75kg.toml");

/// Page as parsed by a browser.
struct Page {
    text: String,
    document: Html,
}

impl Page {
    fn read(folder: &Folder) -> Self {
        let text = folder.read("report.html");
        let document = Html::parse_document(&text);
        assert_eq!(document.errors, Vec::<String>::new(), "invalid HTML");
        Self { text, document }
    }

    fn all(&self, selector: &str) -> Vec<String> {
        let selector = Selector::parse(selector).expect("a selector");
        self.document.select(&selector).map(|found| found.text().collect()).collect()
    }

    fn one(&self, selector: &str) -> String {
        let found = self.all(selector);
        assert_eq!(found.len(), 1, "{selector}");
        found.into_iter().next().expect("one")
    }
}

fn reported(folder: &Folder, arguments: &str, code: i32) -> (Run, Value, Page) {
    let (run, report) = folder.reported(&format!("{arguments} --report @report.html"), code);
    (run, report, Page::read(folder))
}

#[test]
fn a_page_shows_the_whole_run_and_fetches_nothing() {
    let (run, report, page) = reported(&Folder::new(), "identify --seed 2", 0);
    assert!(run.printed.trim_end().ends_with("report.html"), "the last line names the page: {}", run.printed);
    assert_eq!(page.one(".verdict .word"), "Accepted");
    assert!(page.all("tr.failed").is_empty() && page.all("table.tests tbody tr").len() > 10);
    let names = page.all("tbody th");
    let (parameters, bases) = (list(&report, "parameters"), list(&report, "base_parameters"));
    assert_eq!((parameters.len(), bases.len()), (28, 13));
    for parameter in parameters.iter().chain(bases) {
        let name = parameter["name"].as_str().expect("a name");
        assert!(names.iter().any(|shown| shown == name), "{name}");
    }
    // Every parameter has its bar, every figure its drawing.
    assert_eq!(page.all("svg.bar").len(), 28);
    let figures = page.all("figure svg");
    assert_eq!(figures.len(), 7);
    for words in [
        "excitation (identified from)",
        "gait-6.5 (unused, predicted)",
        "autocorrelation",
        "swarm, cold start",
    ] {
        assert!(figures.iter().any(|figure| figure.contains(words)), "{words}");
    }
    let text = page.text.replace("xmlns=\"http://www.w3.org/2000/svg\"", "");
    for reference in ["http:", "https:", "<script", "src=", "@import", "url("] {
        assert!(!text.contains(reference), "{reference}");
    }
    let limits = page.one(".limits");
    for name in ["ZZ1", "HX1", "IA1", "M2", "XX1", "HY1", "OFF1"] {
        assert_contains(&limits, name);
    }
}

#[test]
fn counts_are_whole_numbers_and_values_have_the_digits_of_their_sigma() {
    let (_, report, page) = reported(&Folder::new(), "identify --seed 1", 0);
    let replaced = &report["outliers"]["replaced"];
    let rows = page.all("table.outliers tbody tr");
    assert_eq!(rows.len(), 2);
    for (row, (joint, count)) in rows.iter().zip([("hip", &replaced[0]), ("knee", &replaced[1])]) {
        assert!(row.starts_with(&format!("{joint}{count}")), "{row}");
    }
    let cells = page.all("table td");
    for cell in ["1.000", "2.000", "3.000"] {
        assert!(!cells.iter().any(|found| found == cell), "a count is shown as {cell}");
    }
    // Rounding remainder of a prior's zero.
    let hidden = report["parameters"][2]["value"].as_f64().expect("XZ1");
    assert!(hidden != 0.0 && hidden.abs() < 1e-12, "XZ1 of this run is rounding: {hidden}");
    for row in page.all("table.parameters tbody tr") {
        assert!(!row.contains("e\u{2212}1"), "rounding is shown as a value: {row}");
    }
    let row = |name: &str| {
        let rows = page.all("table.parameters tbody tr");
        rows.into_iter().find(|row| row.starts_with(name)).unwrap_or_else(|| panic!("no {name}"))
    };
    assert!(row("XZ1").starts_with("XZ10\u{2013}"), "{}", row("XZ1"));
    // Two digits of sigma and the value to the same decimal place; three digits without sigma.
    let digits = |name: &str| row(name)[name.len()..].split_once(['k', 'N']).expect("a unit").0.to_owned();
    let known = list(&report, "parameters").iter().find(|one| one["name"] == "FC1").expect("FC1");
    let of = |key: &str| number(known, key);
    assert!((0.01..0.1).contains(&of("sigma")));
    assert_eq!(digits("FC1"), format!("{:.3}{:.3}", of("value"), of("sigma")));
    assert_eq!(digits("YY1").chars().filter(char::is_ascii_digit).count(), 4, "0.xxx: {}", digits("YY1"));
}

#[test]
fn every_section_has_a_title_and_no_reason_is_truncated() {
    let (_, report, page) = reported(&Folder::new(), "identify --seed 1", 0);
    let titles = page.all("h2");
    for key in ["Validated", "Model choice", "Outliers", "Drive"] {
        assert!(!titles.iter().any(|title| title == key), "{key} is a key of the JSON");
    }
    let facts = page.all(".facts div");
    assert!(facts.iter().any(|fact| fact.starts_with("Drivesimulated; currents follow")), "{facts:?}");
    let choices = list(&report, "model_choice");
    let reasons = page.all("table.choices td.words");
    assert_eq!(reasons.len(), choices.len());
    for (reason, choice) in reasons.iter().zip(choices) {
        assert_eq!(choice["why"], reason.as_str());
    }
    assert!(page.text.contains(".words, .any td:not(.n) { white-space: normal; }"), "reasons may not wrap");
}

#[test]
fn the_name_of_a_leg_is_escaped() {
    let folder = Folder::new();
    let hostile = "</title></svg><script>alert(1)</script><b>&\\\"'";
    let text = LEG.replacen("name = \"x2-wearer-75kg\"", &format!("name = \"{hostile}\""), 1).replacen(
        "name = \"hip\"",
        "name = \"<i>hip</i>\"",
        1,
    );
    assert!(text.contains("<script>") && text.contains("<i>hip</i>"), "the leg file has other names");
    folder.write("leg.toml", &text);
    let (_, _, page) = reported(&folder, "identify --leg @leg.toml", 0);
    assert_eq!(page.one("h1"), "</title></svg><script>alert(1)</script><b>&\"'");
    assert_eq!((page.all("script").len(), page.all("b").len(), page.all("i").len()), (0, 0, 0));
    assert!(page.one("head title").contains("<script>"), "the name is shown unchanged");
    assert!(page.all("figure svg text").iter().any(|words| words.contains("<i>hip</i>")));
}

#[test]
fn a_refused_run_is_marked_first_and_gives_every_reason() {
    let folder = Folder::new();
    // Recording with another joint's torque, which no model explains.
    let mut table = Table::read(MUJOCO);
    let torque = table.index("tau1_Nm");
    for (number, row) in table.rows.iter_mut().enumerate() {
        row[torque] = (number % 480) as f64 / 6.0 - 40.0;
    }
    folder.write("wrong.csv", table.text());
    let (_, report, page) = reported(&folder, "replay @wrong.csv --leg mujoco-leg", 3);
    assert_eq!(page.one(".verdict.refused .word"), "Refused");
    assert!(page.one("head title").contains("refused"));
    let given = page.all(".verdict > ul > li");
    let reasons = crate::command::reasons(&report);
    assert!(reasons.contains(&"residual"), "{reasons:?}");
    assert_eq!(given.len(), reasons.len());
    for (words, reason) in given.iter().zip(reasons) {
        assert!(words.starts_with(&reason.replace('_', " ")), "{words}");
        assert!(words.len() > reason.len() + 20, "not a sentence: {words}");
    }
    let residual = given.iter().find(|words| words.starts_with("residual")).expect("a reason");
    assert_contains(residual, "joint 1: ");
    assert_contains(residual, "limit");
    // Every failure is listed, and the table marks it.
    for finding in list(&report, "findings") {
        let words = finding["words"].as_str().expect("a sentence");
        assert!(finding["passed"] == true || page.one(".verdict").contains(words), "{words}");
    }
    assert!(page.all("tr.failed").iter().any(|row| row.starts_with("residual")));
}

#[test]
fn values_unknown_without_a_prior_are_dashes() {
    let folder = Folder::new();
    let options = "--leg mujoco-leg --prior none --json @run.json --report @report.html";
    // The verdict is irrelevant in this test.
    folder.scarab(&format!("replay {MUJOCO} {options}"));
    let page = Page::read(&folder);
    let report = folder.json("run.json");
    let unknown = list(&report, "parameters").iter();
    let unknown: Vec<_> = unknown.filter(|parameter| parameter["value"].is_null()).collect();
    assert!(unknown.len() > 10, "without a prior few parameters of a planar leg are known");
    // Name, value and sigma of each parameter; an unknown value has no bar.
    let rows = page.all("table.parameters tbody tr");
    assert_eq!((rows.len(), page.all("svg.bar").len()), (28, 28 - unknown.len()));
    for parameter in unknown {
        let name = parameter["name"].as_str().expect("a name");
        let row = rows.iter().find(|row| row.starts_with(name)).expect("a row");
        assert!(row.starts_with(&format!("{name}\u{2013}\u{2013}")), "{row}");
    }
    assert!(!page.text.contains("NaN") && !page.text.contains("null"), "an unknown number is printed");
    // Nothing is attributed to a prior, no key of the JSON is a title, and no test is without a limit.
    for words in ["come from the prior", "prior splits", "prior's limits", "by the prior", "Bandwidth"] {
        assert!(!page.text.contains(words), "{words}");
    }
    assert!(
        !page.all("table.tests td").iter().any(|cell| cell.ends_with("\u{a0}\u{2013}")),
        "a test without a limit"
    );
    assert!(page.all("table td").iter().any(|cell| cell.ends_with("fourier.csv")), "no source");
}

#[test]
fn many_runs_are_a_page_of_their_errors() {
    let (_, report, page) = reported(&Folder::new(), "identify --seeds 1..6", 0);
    let runs = list(&report, "runs");
    assert_eq!((page.one(".verdict .word"), page.all("figure svg").len()), ("6 of 6 accepted".into(), 1));
    let rows = page.all("table.spread tbody tr");
    assert_eq!(rows.len(), 13);
    for (row, base) in rows.iter().zip(list(&runs[0], "base_parameters")) {
        assert!(row.starts_with(base["name"].as_str().expect("a name")) && row.ends_with('6'), "{row}");
    }
    // Mean error of the first parameter in the sigma of each run, as printed on the page.
    let errors = runs.iter().map(|run| {
        let of = |key: &str| number(&run["base_parameters"][0], key);
        (of("value") - of("truth")) / of("sigma")
    });
    let mean = format!("{:+.1}", errors.sum::<f64>() / 6.0).replace('-', "\u{2212}");
    assert_contains(&rows[0], &mean);
    assert!(page.all("figure svg").iter().all(|figure| figure.contains("mean") && figure.contains("spread")));
    let title = "x2-wearer-75kg: errors of the base parameters in 6 runs";
    assert!(page.all("figure svg").iter().all(|figure| figure.contains(title)), "the figure has no title");
    assert!(!page.text.contains("NaN") && !page.text.contains("<script"));
    let tests = page.all("table.tests tbody tr");
    assert!(tests.len() > 10 && tests.iter().any(|row| row.contains("36 of 36")), "{tests:?}");
}

#[test]
fn refused_runs_are_reported_with_their_seeds() {
    let (_, _, page) = reported(&Folder::new(), "identify --seeds 3..4 --perturb stuck=knee", 3);
    assert_eq!(page.one(".verdict.refused .word"), "0 of 2 accepted");
    assert!(page.one(".verdict.refused").contains("unexcited: 2 runs, seeds 3, 4"));
}

#[test]
fn a_recording_without_held_out_part_is_not_called_validated() {
    let unvalidated = |options: &str| {
        let arguments = format!("replay {MUJOCO} --leg mujoco-leg {options}");
        let (_, _, page) = reported(&Folder::new(), &arguments, 0);
        page.one(".verdict.accepted").contains("Not validated")
    };
    assert_eq!((unvalidated(""), unvalidated("--split 0.7")), (true, false));
}
