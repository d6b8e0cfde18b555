//! The trace of an identification reports the identification's values.

use scarab::model::Parameter;
use scarab::trace::{Line, Record, Report};

use super::*;

/// All lines of the report on this leg's identification, as written.
fn told(pair: &Pair) -> Vec<String> {
    let mut report = Report::default();
    let mut lines = Vec::new();
    while let Some(record) = report.advance(pair.leg.identification()) {
        let mut line = String::new();
        Record::<JOINTS>::write(&record, lines.len() as u32, &mut line)
            .expect("writing to a string cannot fail");
        lines.push(line);
    }
    lines
}

#[test]
fn a_report_contains_every_parameter_finding_and_fit_and_its_length() {
    let pair = identified();
    let identification = pair.leg.identification();
    let lines = told(&pair);
    let lines: Vec<Line> = lines.iter().map(|line| Line::parse(line).expect(line)).collect();
    let of = |kind: &str| lines.iter().filter(|line| line.kind() == kind).copied().collect::<Vec<_>>();

    let estimate = identification.estimate().expect("identified");
    let parameters = of("parameter");
    assert_eq!(parameters.len(), JOINTS * Parameter::ALL.len());
    for (index, line) in parameters.iter().enumerate() {
        let (joint, parameter) = (index / 14, Parameter::ALL[index % 14]);
        let found = identification.parameter(&estimate, joint, parameter).expect("identified");
        assert_eq!(
            (line.value::<usize>("joint"), line.text("symbol")),
            (Ok(joint + 1), Ok(parameter.symbol()))
        );
        for (key, value) in [("value", found.value), ("sigma", found.sigma)] {
            let told = line.value::<f32>(key).expect(key);
            assert_eq!(value.unwrap_or(f32::NAN).to_bits(), told.to_bits(), "{line:?}");
        }
        assert_eq!(line.text("status"), Ok(found.status.name()));
    }

    let base = of("base");
    assert_eq!(base.len(), BASE);
    for (line, value) in base.iter().zip(estimate.values) {
        assert_eq!(line.value::<f32>("value").map(f32::to_bits), Ok(value.to_bits()));
    }
    let covariance = of("covariance");
    assert_eq!(covariance.len(), BASE * (BASE + 1) / 2);
    for line in covariance {
        let field = |key| line.value::<usize>(key).expect(key);
        assert_eq!(line.value("value"), Ok(estimate.covariance[field("row")][field("column")]));
    }

    let mut evidence = Vec::new();
    let verdict = identification.judge_with(&mut |found| evidence.push(*found));
    let findings = of("finding");
    assert_eq!(findings.len(), evidence.len());
    for (line, found) in findings.iter().zip(&evidence) {
        assert_eq!((line.text("test"), line.value("passed")), (Ok(found.test.name()), Ok(found.passed)));
        assert_eq!((line.value("value"), line.value("limit")), (Ok(found.value), Ok(found.limit)));
        let joint = found.joint.map_or(0, |joint| joint + 1);
        let motion = found.motion.map_or(0, |motion| motion + 1);
        assert_eq!((line.value("joint"), line.value("motion")), (Ok(joint), Ok(motion)));
    }

    // The training motion and three others, each with both joints.
    assert_eq!((of("motion").len(), of("fit").len()), (4, 4 * JOINTS));
    let word = if verdict.is_accepted() { "accepted" } else { "refused" };
    assert_eq!(of("verdict")[0].text("verdict"), Ok(word));
    assert_eq!(of("reason").len(), verdict.reasons().count());
    let end = lines.last().expect("a record");
    assert_eq!((end.kind(), end.value("records")), ("end", Ok(lines.len() - 1)));
    for (number, line) in lines.iter().enumerate() {
        assert_eq!(line.number(), Ok(number as u32));
    }
}

#[test]
fn no_report_before_there_is_a_result() {
    assert_eq!(told(&during_excitation()), [""; 0]);
    // Before the end of the search there are values but no verdict.
    let lines = told(&before_the_search());
    assert!(lines.iter().any(|line| line.starts_with("solver ") && line.contains(" state=running ")));
    assert!(!lines.iter().any(|line| line.starts_with("verdict ")));
}
