//! Lines of `candump` (can-utils): CAN frames with their time stamps.
//!
//! ```text
//! (1795246347.081643) can0 601#2300180181010080                     candump -L, and python-can's log files
//! (1795246347.081643)  can0  601   [8]  23 00 18 01 81 01 00 80     candump -ta
//! ```
//!
//! Frames with 29-bit identifier, remote frames, error frames and CAN FD are skipped.

use scarab::bus::Frame;

/// Digits of an identifier of 11 and of 29 bits.
const SHORT_IDENTIFIER: usize = 3;
const LONG_IDENTIFIER: usize = 8;

/// Reads one line: time stamp in seconds and frame; `None` for an empty line, a comment or a skipped frame.
///
/// # Errors
/// What is wrong with the line.
pub fn parse(line: &str) -> Result<Option<(f64, Frame)>, String> {
    let line = line.trim();
    if line.is_empty() || line.starts_with('#') {
        return Ok(None);
    }
    let stamp = line.strip_prefix('(').and_then(|rest| rest.split_once(')'));
    let Some((time, rest)) = stamp else {
        return Err("no time stamp in brackets; record with `candump -L can0`".into());
    };
    let time_s: f64 = time.trim().parse().map_err(|_| format!("`{time}` is not a time in seconds"))?;
    if !time_s.is_finite() {
        return Err(format!("`{time}` is not a time in seconds"));
    }
    let mut words = rest.split_whitespace().skip(1);
    let first = words.next().ok_or("no frame behind the time stamp")?;
    let (identifier, data) = match first.split_once('#') {
        Some((_, data)) if data.starts_with(['#', 'R']) => return Ok(None),
        Some((identifier, data)) => (identifier, data.replace('.', "")),
        None => {
            let length = words.next().and_then(|word| word.strip_prefix('[')?.strip_suffix(']'));
            let length: usize =
                length.and_then(|digits| digits.parse().ok()).ok_or("no length in square brackets")?;
            let rest: Vec<&str> = words.collect();
            if rest.first() == Some(&"remote") || length > 8 {
                return Ok(None);
            }
            let bytes = &rest[..length.min(rest.len())];
            if bytes.len() < length {
                return Err(format!("{} data bytes, {length} announced", bytes.len()));
            }
            (first, bytes.concat())
        }
    };
    let is_hexadecimal = |text: &str| text.bytes().all(|byte| byte.is_ascii_hexdigit());
    if identifier.len() == LONG_IDENTIFIER && is_hexadecimal(identifier) {
        return Ok(None);
    }
    let id = Some(identifier).filter(|id| id.len() == SHORT_IDENTIFIER && is_hexadecimal(id));
    let id = id.and_then(|id| u16::from_str_radix(id, 16).ok());
    let id = id.ok_or_else(|| format!("`{identifier}` is not an identifier"))?;
    if id > 0x7FF {
        return Err(format!("`{identifier}` exceeds 7FF"));
    }
    let digits = data.as_bytes();
    if !digits.len().is_multiple_of(2) || digits.len() > 16 {
        return Err(format!("`{data}` is not up to eight bytes"));
    }
    let byte = |pair: &[u8]| u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok();
    let bytes: Option<Vec<u8>> = digits.chunks(2).map(byte).collect();
    let bytes =
        bytes.filter(|_| is_hexadecimal(&data)).ok_or_else(|| format!("`{data}` is not hexadecimal"))?;
    Ok(Some((time_s, Frame::new(id, &bytes))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use scarab_base::random::Random;

    #[test]
    fn both_forms_give_the_same_frame() {
        let expected = Frame::new(0x601, &[0x23, 0, 0x18, 1, 0x81, 1, 0, 0x80]);
        for line in [
            "(12.5) can0 601#2300180181010080",
            "(12.5) can0 601#23.00.18.01.81.01.00.80 T",
            " (12.5)  vcan0  601   [8]  23 00 18 01 81 01 00 80",
            "(12.5)  vcan0  601   [8]  23 00 18 01 81 01 00 80   '#.......'",
        ] {
            assert_eq!(parse(line), Ok(Some((12.5, expected))), "{line}");
        }
        assert_eq!(parse("(0) can0 080#"), Ok(Some((0.0, Frame::new(0x80, &[])))));
    }

    #[test]
    fn other_kinds_are_skipped_and_bad_lines_refused() {
        for line in [
            "",
            "# comment",
            "(1.0) can0 601#R",
            "(1.0) can0 00000601#01",
            "(1.0) can0 601##0112233",
            "(1.0) can0 20000080#0000000000000000",
            "(1.0)  can0  601   [0]  remote request",
        ] {
            assert_eq!(parse(line), Ok(None), "{line}");
        }
        for (line, words) in [
            ("can0  601   [1]  23", "no time stamp"),
            ("(x) can0 601#00", "`x` is not a time"),
            ("(inf) can0 601#00", "`inf` is not a time"),
            ("(1.0) can0", "no frame"),
            ("(1.0) can0 6G1#00", "`6G1` is not an identifier"),
            ("(1.0) can0 +81#00", "`+81` is not an identifier"),
            ("(1.0) can0 081#+1+1", "`+1+1` is not hexadecimal"),
            ("(1.0) can0 801#00", "`801` exceeds 7FF"),
            ("(1.0) can0 601#001", "`001` is not up to eight bytes"),
            ("(1.0) can0 601#0x", "`0x` is not hexadecimal"),
            ("(1.0) can0 601 [2] 00", "1 data bytes, 2 announced"),
            ("(1.0) can0 601 00", "no length"),
        ] {
            let refused = parse(line).expect_err(line);
            assert!(refused.contains(words), "{line}: {refused}");
        }
    }

    #[test]
    fn random_lines_cause_no_panic() {
        let mut random = Random::new("candump", 1);
        let letters: Vec<char> = "()[]#.R 0123456789abcdefäcan\t-+".chars().collect();
        for _ in 0..50_000 {
            let length = random.below(40);
            let line: String =
                (0..length).map(|_| letters[random.below(letters.len() as u64) as usize]).collect();
            let _ = parse(&line);
            let _ = parse(&format!("(1.0) can0 {line}"));
        }
    }
}
