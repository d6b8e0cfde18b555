//! Questions whose answers make a leg file: gravity and, per joint, name, D-H numbers, direction and zero.
//!
//! On a terminal an invalid answer is asked for again. In a pipe it ends the command, since the next line
//! answers another question.

use std::io::{self, BufRead, IsTerminal, Read};

use crate::base::error::ToolError;
use crate::base::output;
use crate::formats::leg_file::check::{GRAVITY, LENGTH, TWIST, ZERO_OFFSET};
use crate::formats::leg_file::draft::{Draft, DraftJoint};
use crate::formats::leg_file::{DhFile, LegFile};

/// Longest answer, bytes.
const LONGEST_ANSWER: u64 = 1000;
/// Name of the file in messages before it exists.
const FILE: &str = "the answers";

/// Asks on standard input; returns the text of the leg file.
///
/// # Errors
/// Input ends before the last answer, or an answer from a pipe is invalid.
pub fn ask_on_terminal() -> Result<String, ToolError> {
    let stdin = io::stdin().lock();
    let is_terminal = stdin.is_terminal();
    leg(&mut Dialogue { input: stdin, is_terminal, print: output::print, asked: 0 })
}

/// Source of answers.
struct Dialogue<R, P> {
    input: R,
    /// Whether a person can correct an answer.
    is_terminal: bool,
    print: P,
    asked: u32,
}

fn leg<R: BufRead, P: FnMut(&str) -> Result<(), ToolError>>(
    ask: &mut Dialogue<R, P>,
) -> Result<String, ToolError> {
    ask.say(
        "Enter takes the value in brackets. Frames are modified Denavit-Hartenberg (docs/model.md): z is the joint's axis.\n",
    )?;
    let name = ask.word("name of the leg", Some("my-leg"), &[])?;
    let count = ask.question("number of joints, 1 to 3", Some("2"), |text| match text.parse::<usize>() {
        Ok(count @ 1..=3) => Ok(count),
        _ => Err("must be 1, 2 or 3".to_owned()),
    })?;
    ask.say("Gravity in the base frame; z of the base is the first joint's axis, x points down for a hanging leg.\n")?;
    let mut gravity = [0.0; 3];
    for ((slot, axis), usual) in gravity.iter_mut().zip(["x", "y", "z"]).zip(["9.81", "0", "0"]) {
        *slot = ask.number(&format!("gravity {axis} [m/s2]"), Some(usual), GRAVITY)?;
    }
    let mut joints: Vec<DraftJoint> = Vec::new();
    for number in 0..count {
        let usual = if number == 0 { Some("0") } else { None };
        let taken: Vec<&str> = joints.iter().map(|joint| joint.name.as_str()).collect();
        let called = ["hip", "knee", "ankle"].get(number).copied();
        let name = ask.word(&format!("name of joint {}", number + 1), called, &taken)?;
        let alpha =
            ask.number(&format!("{name}: alpha, twist from the axis before [rad]"), Some("0"), TWIST)?;
        let a = ask.number(&format!("{name}: a, distance from the joint before [m]"), usual, LENGTH)?;
        let d = ask.number(&format!("{name}: d, offset along the axis [m]"), Some("0"), LENGTH)?;
        let question = format!("{name}: direction, 1 if the angle grows about +z, else -1");
        let direction = ask.question(&question, Some("1"), |text| match text.parse::<i64>() {
            Ok(direction @ (1 | -1)) => Ok(direction),
            _ => Err("must be 1 or -1".to_owned()),
        })?;
        let question = format!("{name}: zero offset, D-H angle at the anatomical zero [degrees]");
        let zero_offset_deg = ask.number(&question, Some("0"), ZERO_OFFSET)?;
        joints.push(DraftJoint {
            name,
            dh: DhFile { alpha, a, d },
            direction,
            zero_offset_deg,
            range_deg: None,
            speed_limit_deg_s: None,
            torque_limit_nm: None,
            prior: None,
            remarks: Vec::new(),
        });
    }
    let remarks = vec![
        "Words in capitals are unknown: replace them and remove the `#`. `cargo sim leg --check FILE` says which".into(),
        "use needs which. All keys: docs/files.md.".into(),
    ];
    let text = Draft { name, gravity, remarks, joints }.to_toml();
    LegFile::parse(&text, FILE)?;
    Ok(text)
}

impl<R: BufRead, P: FnMut(&str) -> Result<(), ToolError>> Dialogue<R, P> {
    fn say(&mut self, text: &str) -> Result<(), ToolError> {
        (self.print)(text)
    }

    /// Asks until an answer is valid; an empty one is the usual value.
    fn question<T>(
        &mut self,
        question: &str,
        usual: Option<&str>,
        parse: impl Fn(&str) -> Result<T, String>,
    ) -> Result<T, ToolError> {
        let brackets = usual.map_or_else(String::new, |usual| format!(" ({usual})"));
        self.asked += 1;
        loop {
            self.say(&format!("{question}{brackets}: "))?;
            let line = self.line(question)?;
            let answer = match (line.trim(), usual) {
                ("", Some(usual)) => usual,
                (answer, _) => answer,
            };
            match parse(answer) {
                Ok(value) => {
                    // The answers of a pipe are not echoed, so the line would run on.
                    if !self.is_terminal {
                        self.say("\n")?;
                    }
                    return Ok(value);
                }
                Err(reason) if self.is_terminal => self.say(&format!("`{answer}`: {reason}\n"))?,
                Err(reason) => {
                    return Err(ToolError::input(format!(
                        "answer {} ({question}) is `{answer}`: {reason}; nothing was written",
                        self.asked
                    )));
                }
            }
        }
    }

    fn line(&mut self, question: &str) -> Result<String, ToolError> {
        let mut bytes = Vec::new();
        let read = self.input.by_ref().take(LONGEST_ANSWER).read_until(b'\n', &mut bytes);
        let count = read.map_err(|error| ToolError::input(format!("the answers cannot be read: {error}")))?;
        if count == 0 {
            return Err(ToolError::input(format!(
                "the input ended before answer {} ({question}); nothing was written",
                self.asked
            )));
        }
        if count as u64 == LONGEST_ANSWER {
            return Err(ToolError::input(format!(
                "answer {} ({question}) is longer than {LONGEST_ANSWER} bytes; nothing was written",
                self.asked
            )));
        }
        String::from_utf8(bytes)
            .map_err(|_| ToolError::input(format!("answer {} ({question}) is not text", self.asked)))
    }

    fn number(
        &mut self,
        question: &str,
        usual: Option<&str>,
        [low, high]: [f64; 2],
    ) -> Result<f64, ToolError> {
        self.question(question, usual, |text| match text.parse::<f64>() {
            Ok(value) if (low..=high).contains(&value) => Ok(value),
            Ok(value) => Err(format!("{value} is outside {low}..{high}")),
            Err(_) => Err(format!("not a number from {low} to {high}")),
        })
    }

    fn word(&mut self, question: &str, usual: Option<&str>, taken: &[&str]) -> Result<String, ToolError> {
        self.question(question, usual, |text| {
            if text.is_empty() || text.chars().any(char::is_control) {
                Err("must be one line that is not empty".to_owned())
            } else if taken.contains(&text) {
                Err("is the name of an earlier joint".to_owned())
            } else {
                Ok(text.to_owned())
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answered(answers: &str, is_terminal: bool) -> (Result<String, ToolError>, String) {
        let mut printed = String::new();
        let mut dialogue = Dialogue {
            input: answers.as_bytes(),
            is_terminal,
            print: |text: &str| {
                printed.push_str(text);
                Ok(())
            },
            asked: 0,
        };
        let result = leg(&mut dialogue);
        (result, printed)
    }

    #[test]
    fn a_terminal_asks_again_with_the_reason_and_a_pipe_ends() {
        let answers = "swing\n4\n1\n981\n9.81\n\n\npendulum\n\n\n\nup\n1\n\n";
        let (text, printed) = answered(answers, true);
        let leg = LegFile::parse(&text.expect("every answer was corrected"), "swing.toml").expect("valid");
        assert_eq!((leg.name.as_str(), leg.joints.len(), leg.gravity), ("swing", 1, [9.81, 0.0, 0.0]));
        for reason in ["`4`: must be 1, 2 or 3", "`981`: 981 is outside -30..30", "`up`: must be 1 or -1"] {
            assert!(printed.contains(reason), "{reason} missing in {printed}");
        }
        let (error, _) = answered(answers, false);
        let error = error.expect_err("a pipe cannot correct").to_string();
        assert_eq!(
            error,
            "answer 2 (number of joints, 1 to 3) is `4`: must be 1, 2 or 3; nothing was written"
        );
    }

    #[test]
    fn any_end_of_the_input_is_a_sentence_with_the_question() {
        let answers = "a\n2\n9.81\n0\n0\nhip\n0\n0\n0\n1\n0\nknee\n0\n0.45\n0\n-1\n0\n";
        let lines: Vec<&str> = answers.lines().collect();
        for count in 0..lines.len() {
            let some: String = lines[..count].iter().map(|line| format!("{line}\n")).collect();
            for is_terminal in [false, true] {
                let error = answered(&some, is_terminal).0.expect_err("too few answers").to_string();
                let begin = format!("the input ended before answer {} (", count + 1);
                assert!(error.starts_with(&begin) && error.ends_with("; nothing was written"), "{error}");
            }
        }
        assert!(answered(answers, false).0.is_ok());
    }

    #[test]
    fn hostile_answers_are_refused() {
        for (answers, reason) in [
            ("a\u{7}b\n", "one line that is not empty"),
            ("a\n2\nnan\n", "NaN is outside -30..30"),
            ("a\n2\n1e999\n", "inf is outside -30..30"),
            ("a\n2\n\n\n\nhip\n\n\n\n\n\nhip\n", "is the name of an earlier joint"),
            ("a\n2\n\n\n\nhip\n\n\n\n\n\nknee\n\n\n", "not a number from -5 to 5"),
        ] {
            let error = answered(answers, false).0.expect_err("invalid").to_string();
            assert!(error.contains(reason), "{answers:?}: {error}");
        }
        let endless = "x".repeat(1 << 20);
        let error = answered(&endless, true).0.expect_err("endless").to_string();
        assert!(error.contains("longer than 1000 bytes"), "{error}");
    }
}
