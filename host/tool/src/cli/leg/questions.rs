//! Questions whose answers make a leg file: gravity and, per joint, name, D-H numbers, direction and zero.
//!
//! `<` goes back to the question before. On a terminal an invalid answer is asked for again, and an
//! implausible one is accepted when it is given twice. In a pipe an invalid answer ends the command, since
//! the next line answers another question, and an implausible one is named.

use std::io::{self, BufRead, IsTerminal, Read};

use scarab_base::error::ToolError;
use scarab_base::output;
use scarab_identify::formats::leg_file::check::{GRAVITY, LENGTH, TWIST, ZERO_OFFSET};
use scarab_identify::formats::leg_file::draft::{Draft, DraftJoint};
use scarab_identify::formats::leg_file::{DhFile, LegFile};

/// Longest answer, bytes.
const LONGEST_ANSWER: u64 = 1000;
/// Name of the file in messages before it exists.
const FILE: &str = "the answers";
/// Answer that goes back to the question before.
const BACK: &str = "<";
/// Magnitude of gravity, m/s2.
const STANDARD_GRAVITY: f64 = 9.81;
/// Magnitudes of gravity on the ground, m/s2.
const ON_GROUND: [f64; 2] = [9.7, 9.9];
/// Longest plausible link, m.
const LONG_LINK: f64 = 1.5;

/// Asks on standard input; returns the text of the leg file.
///
/// # Errors
/// Input ends before the last answer, or an answer from a pipe is invalid.
pub(crate) fn ask_on_terminal() -> Result<String, ToolError> {
    let stdin = io::stdin().lock();
    let is_terminal = stdin.is_terminal();
    asked(&mut Dialogue { input: stdin, is_terminal, print: output::print, asked: 0, given: Vec::new() })
}

/// Reason to leave the questions before the last one.
enum Interrupt {
    /// The user corrects the answer before.
    Back,
    Ended(ToolError),
}

impl From<ToolError> for Interrupt {
    fn from(error: ToolError) -> Self {
        Self::Ended(error)
    }
}

/// Source of answers.
struct Dialogue<R, P> {
    input: R,
    /// Whether a person can correct an answer.
    is_terminal: bool,
    print: P,
    /// Questions of this pass.
    asked: usize,
    /// Valid answers, which are not asked for again after a step back.
    given: Vec<String>,
}

/// Asks from the beginning after every step back; the answers that remain are taken as given.
fn asked<R: BufRead, P: FnMut(&str) -> Result<(), ToolError>>(
    ask: &mut Dialogue<R, P>,
) -> Result<String, ToolError> {
    loop {
        ask.asked = 0;
        match leg(ask) {
            Ok(text) => return Ok(text),
            Err(Interrupt::Back) => {
                ask.given.pop();
            }
            Err(Interrupt::Ended(error)) => return Err(error),
        }
    }
}

fn leg<R: BufRead, P: FnMut(&str) -> Result<(), ToolError>>(
    ask: &mut Dialogue<R, P>,
) -> Result<String, Interrupt> {
    ask.say(
        "Enter takes the value in brackets, `<` goes back to the question before.\n\
         Frames are modified Denavit-Hartenberg (docs/model.md): z is the joint's axis.\n",
    )?;
    let name = ask.word("name of the leg", Some("my-leg"), &[])?;
    let count = ask.question("number of joints, 1 to 3", Some("2"), |text| match text.parse::<usize>() {
        Ok(count @ 1..=3) => Ok(count),
        _ => Err("must be 1, 2 or 3".to_owned()),
    })?;
    ask.say(
        "Where is down while all angles are zero? z is the first joint's axis; x points along the first link to the\n\
         second joint. A leg that hangs: x. An arm stretched out level: y or -y. Else three numbers in m/s2: 9.5 0 -2.4\n",
    )?;
    let gravity = ask.doubted(
        "direction of gravity (x, -x, y, -y, z, -z) or its three numbers",
        Some("x"),
        gravity,
        |sum| {
            let size = sum.iter().map(|part| part * part).sum::<f64>().sqrt();
            let is_along_axis = sum[2].abs() > 0.999 * size;
            if !(ON_GROUND[0]..=ON_GROUND[1]).contains(&size) {
                Some(format!("its magnitude is {size:.2} m/s2, on the ground it is {STANDARD_GRAVITY}"))
            } else if is_along_axis {
                Some("it is along the first joint's axis, so this joint holds no weight".to_owned())
            } else {
                None
            }
        },
    )?;
    let mut joints: Vec<DraftJoint> = Vec::new();
    for number in 0..count {
        let joint = joint(ask, number, &joints)?;
        joints.push(joint);
    }
    let remarks = vec![
        "Words in capitals are unknown: replace them and remove the `#`. `leg --check FILE` says which"
            .into(),
        "use needs which. All keys: docs/files.md.".into(),
    ];
    let text = Draft { name, gravity, remarks, joints }.to_toml();
    LegFile::parse(&text, FILE).map_err(ToolError::from)?;
    Ok(text)
}

fn joint<R: BufRead, P: FnMut(&str) -> Result<(), ToolError>>(
    ask: &mut Dialogue<R, P>,
    number: usize,
    before: &[DraftJoint],
) -> Result<DraftJoint, Interrupt> {
    let taken: Vec<&str> = before.iter().map(|joint| joint.name.as_str()).collect();
    let called = ["hip", "knee", "ankle"].get(number).copied();
    let name = ask.word(&format!("name of joint {}", number + 1), called, &taken)?;
    let question = format!("{name}: alpha, twist from the axis before [rad]");
    let alpha = ask.doubted(&question, Some("0"), |text| within(text, TWIST, from_degrees), |_| None)?;
    let question = format!("{name}: a, distance from the joint before [m]");
    let usual = if number == 0 { Some("0") } else { None };
    let a = ask.doubted(&question, usual, |text| within(text, LENGTH, from_mm), |a| match before.last() {
        None if *a != 0.0 => Some(
            "the first joint has none before it, so this has no effect; the length of its link is `a` of the next joint"
                .to_owned(),
        ),
        Some(last) if *a == 0.0 && alpha.sin().abs() < 1e-6 => Some(format!(
            "then its axis is that of `{}`, and one axis cannot have two joints",
            last.name
        )),
        _ => long(*a),
    })?;
    let question = format!("{name}: d, offset along the axis [m]");
    let d = ask.doubted(&question, Some("0"), |text| within(text, LENGTH, from_mm), |d| long(*d))?;
    let question = format!("{name}: direction, 1 if the angle grows about +z, else -1");
    let direction = ask.question(&question, Some("1"), |text| match text.parse::<i64>() {
        Ok(direction @ (1 | -1)) => Ok(direction),
        _ => Err("must be 1 or -1".to_owned()),
    })?;
    let question = format!("{name}: zero offset, D-H angle at the anatomical zero [degrees]");
    let zero_offset_deg =
        ask.doubted(&question, Some("0"), |text| within(text, ZERO_OFFSET, |_| None), |zero| radians(*zero))?;
    Ok(DraftJoint {
        name,
        dh: DhFile { alpha, a, d },
        direction,
        zero_offset_deg,
        range_deg: None,
        speed_limit_deg_s: None,
        torque_limit_nm: None,
        prior: None,
        remarks: Vec::new(),
    })
}

/// Gravity as a direction or as three numbers.
fn gravity(text: &str) -> Result<[f64; 3], String> {
    let (sign, axis) = match text.strip_prefix('-') {
        Some(rest) => (-1.0, rest.trim()),
        None => (1.0, text.strip_prefix('+').unwrap_or(text)),
    };
    if let Some(axis) = ["x", "y", "z"].iter().position(|name| axis.eq_ignore_ascii_case(name)) {
        let mut gravity = [0.0; 3];
        gravity[axis] = sign * STANDARD_GRAVITY;
        return Ok(gravity);
    }
    let by_comma: Vec<&str> = text.split(',').map(str::trim).collect();
    let by_space: Vec<&str> = text.split_whitespace().map(|word| word.trim_end_matches(',')).collect();
    let words = if by_space.len() == 3 { by_space } else { by_comma };
    let [x, y, z] = words[..] else {
        return Err(
            "must be a direction, for example -y, or three numbers in m/s2, for example 9.81 0 0".to_owned()
        );
    };
    let part = |text| within(text, GRAVITY, |_| None);
    Ok([part(x)?, part(y)?, part(z)?])
}

/// Number within bounds; `hint` explains one outside.
fn within(text: &str, [low, high]: [f64; 2], hint: impl Fn(f64) -> Option<String>) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (low..=high).contains(&value) => Ok(value),
        Ok(value) => Err(format!("{value} is outside {low}..{high}{}", hint(value).unwrap_or_default())),
        Err(_) => match text.replacen(',', ".", 1).parse::<f64>() {
            Ok(value) => Err(format!("write it with a decimal point: {value}")),
            Err(_) => Err(format!("not a number from {low} to {high}")),
        },
    }
}

fn from_degrees(value: f64) -> Option<String> {
    let is_angle = value.abs() <= 360.0;
    is_angle.then(|| format!(": is it in degrees? {value} degrees are {:.6} rad", value.to_radians()))
}

fn from_mm(value: f64) -> Option<String> {
    let is_length = (10.0..=1000.0 * LENGTH[1]).contains(&value.abs());
    is_length.then(|| format!(": is it in mm? {value} mm are {} m", value / 1000.0))
}

fn long(length: f64) -> Option<String> {
    (length.abs() > LONG_LINK).then(|| format!("{length} m is long for a leg: is it in metres?"))
}

/// Doubt about an angle in degrees that is a usual angle in radians.
fn radians(degrees: f64) -> Option<String> {
    let in_degrees = degrees.to_degrees();
    let usual = (in_degrees / 15.0).round() * 15.0;
    let is_usual = usual != 0.0 && usual.abs() <= 360.0 && (in_degrees - usual).abs() < 0.1;
    let is_whole = degrees == degrees.round();
    (is_usual && !is_whole).then(|| format!("it is in degrees; {degrees} rad would be {usual} degrees"))
}

impl<R: BufRead, P: FnMut(&str) -> Result<(), ToolError>> Dialogue<R, P> {
    /// Prints what belongs to the next question, unless its answer is given.
    fn say(&mut self, text: &str) -> Result<(), Interrupt> {
        if self.asked < self.given.len() { Ok(()) } else { Ok((self.print)(text)?) }
    }

    /// Asks until an answer is valid; an empty one is the usual value.
    fn question<T>(
        &mut self,
        question: &str,
        usual: Option<&str>,
        parse: impl Fn(&str) -> Result<T, String>,
    ) -> Result<T, Interrupt> {
        self.doubted(question, usual, parse, |_| None)
    }

    /// Asks until an answer is valid and no reason makes it implausible, or the same is given twice.
    fn doubted<T>(
        &mut self,
        question: &str,
        usual: Option<&str>,
        parse: impl Fn(&str) -> Result<T, String>,
        doubt: impl Fn(&T) -> Option<String>,
    ) -> Result<T, Interrupt> {
        self.asked += 1;
        if let Some(Ok(value)) = self.given.get(self.asked - 1).map(|answer| parse(answer)) {
            return Ok(value);
        }
        let brackets = usual.map_or_else(String::new, |usual| format!(" ({usual})"));
        let mut doubted = None;
        loop {
            (self.print)(&format!("{question}{brackets}: "))?;
            let line = self.line(question)?;
            let answer = match (line.trim(), usual) {
                ("", Some(usual)) => usual,
                (answer, _) => answer,
            };
            // The answers of a pipe are not echoed, so the line would run on.
            if !self.is_terminal {
                (self.print)("\n")?;
            }
            if answer == BACK {
                if self.given.is_empty() {
                    (self.print)("this is the first question\n")?;
                    continue;
                }
                return Err(Interrupt::Back);
            }
            match (parse(answer), doubted.as_deref() == Some(answer)) {
                (Ok(value), is_repeated) => {
                    let reason = doubt(&value).filter(|_| !is_repeated);
                    if let Some(reason) = reason {
                        if self.is_terminal {
                            (self.print)(&format!("`{answer}`: {reason}. To keep it, give it again\n"))?;
                            doubted = Some(answer.to_owned());
                            continue;
                        }
                        (self.print)(&format!("warning: {question}: `{answer}`: {reason}\n"))?;
                    }
                    self.given.push(answer.to_owned());
                    return Ok(value);
                }
                (Err(reason), _) if self.is_terminal => (self.print)(&format!("`{answer}`: {reason}\n"))?,
                (Err(reason), _) => {
                    let asked = self.asked;
                    return Err(Interrupt::Ended(ToolError::input(format!(
                        "answer {asked} ({question}) is `{answer}`: {reason}; nothing was written"
                    ))));
                }
            }
        }
    }

    fn line(&mut self, question: &str) -> Result<String, ToolError> {
        let mut bytes = Vec::new();
        let read = self.input.by_ref().take(LONGEST_ANSWER).read_until(b'\n', &mut bytes);
        let count = read.map_err(|error| ToolError::input(format!("the answers cannot be read: {error}")))?;
        let answer = format!("answer {} ({question})", self.asked);
        if count == 0 {
            return Err(ToolError::input(format!("the input ended before {answer}; nothing was written")));
        }
        if count as u64 == LONGEST_ANSWER {
            let reason = format!("{answer} is longer than {LONGEST_ANSWER} bytes; nothing was written");
            return Err(ToolError::input(reason));
        }
        String::from_utf8(bytes).map_err(|_| ToolError::input(format!("{answer} is not text")))
    }

    fn word(&mut self, question: &str, usual: Option<&str>, taken: &[&str]) -> Result<String, Interrupt> {
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
            given: Vec::new(),
        };
        let result = asked(&mut dialogue);
        (result, printed)
    }

    #[test]
    fn a_terminal_asks_again_with_the_reason_and_a_pipe_ends() {
        let answers = "swing\n4\n1\n981 0 0\n9.81 0 0\npendulum\n\n\n\nup\n1\n\n";
        let (text, printed) = answered(answers, true);
        let leg = LegFile::parse(&text.expect("every answer was corrected"), "swing.toml").expect("valid");
        assert_eq!((leg.name.as_str(), leg.joints.len(), leg.gravity), ("swing", 1, [9.81, 0.0, 0.0]));
        for reason in ["`4`: must be 1, 2 or 3", "`981 0 0`: 981 is outside -30..30", "`up`: must be 1 or -1"]
        {
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
        let answers = "a\n2\nx\nhip\n0\n0\n0\n1\n0\nknee\n0\n0.45\n0\n-1\n0\n";
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
    fn a_step_back_asks_the_question_before_again_and_keeps_the_others() {
        // Back from the direction to d, and to a, which is corrected.
        let answers = "swing\n1\n-y\nelbow\n\n\n\n<\n<\n<\n0.5\n\n\n\n\n\n";
        let (text, printed) = answered(answers, true);
        let leg = LegFile::parse(&text.expect("every question is answered"), "swing.toml").expect("valid");
        assert_eq!((leg.joints[0].dh.alpha, leg.joints[0].dh.a), (0.5, 0.0));
        assert_eq!((leg.joints[0].name.as_str(), leg.gravity), ("elbow", [0.0, -9.81, 0.0]));
        let count = |question: &str| printed.matches(question).count();
        assert_eq!((count("name of joint 1"), count("elbow: alpha"), count("elbow: direction")), (1, 2, 2));
        let (text, printed) = answered(&format!("<\n{}", answers), true);
        assert!(text.is_ok() && printed.contains("this is the first question\n"), "{printed}");
    }

    #[test]
    fn an_implausible_answer_is_accepted_when_it_is_given_twice() {
        let (text, printed) = answered("a\n2\n\nhip\n\n\n\n\n1.5708\n90\nknee\n\n0\n0\n\n\n\n", true);
        let leg = LegFile::parse(&text.expect("every question is answered"), "a.toml").expect("valid");
        assert_eq!((leg.joints[0].zero_offset_deg, leg.joints[1].dh.a), (90.0, 0.0));
        for doubt in [
            "`1.5708`: it is in degrees; 1.5708 rad would be 90 degrees. To keep it, give it again\n",
            "`0`: then its axis is that of `hip`, and one axis cannot have two joints. To keep it, give it again\n",
        ] {
            assert!(printed.contains(doubt), "{doubt} missing in {printed}");
        }
        // Intersecting axes are usual.
        let (_, printed) = answered("a\n2\n\nhip\n\n\n\n\n\nknee\n1.5708\n0\n\n\n\n", true);
        assert!(!printed.contains("To keep it"), "{printed}");
        for (answers, doubt) in [
            ("a\n1\n0 0 1\n", "its magnitude is 1.00 m/s2, on the ground it is 9.81"),
            ("a\n1\n-z\n", "it is along the first joint's axis, so this joint holds no weight"),
            ("a\n1\n\nhip\n\n0.4\n", "the length of its link is `a` of the next joint"),
            ("a\n2\n\nhip\n\n\n\n\n\nknee\n\n4.5\n", "4.5 m is long for a leg: is it in metres?"),
        ] {
            let (_, printed) = answered(answers, false);
            assert!(
                printed.contains(&format!(": {doubt}\n")) || printed.contains(doubt),
                "{doubt}: {printed}"
            );
            assert!(printed.contains("\nwarning: "), "{printed}");
        }
    }

    #[test]
    fn hostile_answers_are_refused() {
        for (answers, reason) in [
            ("a\u{7}b\n", "one line that is not empty"),
            ("a\n2\nnan 0 0\n", "NaN is outside -30..30"),
            ("a\n2\n1e999,0,0\n", "inf is outside -30..30"),
            ("a\n2\ndown\n", "must be a direction, for example -y, or three numbers"),
            ("a\n2\n9,81\n", "must be a direction, for example -y, or three numbers"),
            ("a\n2\n9,81 0 0\n", "write it with a decimal point: 9.81"),
            ("a\n2\n\nhip\n\n\n\n\n\nhip\n", "is the name of an earlier joint"),
            ("a\n2\n\nhip\n\n\n\n\n\nknee\n\n\n", "not a number from -5 to 5"),
            ("a\n2\n\nhip\n90\n", "90 is outside -7..7: is it in degrees? 90 degrees are 1.570796 rad"),
            ("a\n2\n\nhip\n\n450\n", "450 is outside -5..5: is it in mm? 450 mm are 0.45 m"),
            ("a\n2\n\nhip\n\n0,45\n", "write it with a decimal point: 0.45"),
        ] {
            let error = answered(answers, false).0.expect_err("invalid").to_string();
            assert!(error.contains(reason), "{answers:?}: {error}");
        }
        let endless = "x".repeat(1 << 20);
        let error = answered(&endless, true).0.expect_err("endless").to_string();
        assert!(error.contains("longer than 1000 bytes"), "{error}");
    }
}
