use super::super::Line;
use super::*;

/// The line of a record.
fn line_of(record: &Record<2>, number: u32) -> String {
    let mut text = String::new();
    record.write(number, &mut text).expect("writing to a string cannot fail");
    text
}

#[test]
fn every_kind_has_one_format_and_any_values_in_it_are_a_line() {
    for format in Record::<2>::FORMATS {
        let (kind, _) = format.split_once(' ').expect("a kind");
        let same = |other: &&&str| other.split(' ').next() == Some(kind);
        assert_eq!(Record::<2>::FORMATS.iter().filter(same).count(), 1, "{kind}");
        let mut text = String::new();
        fill(format, &[&7_u32; 24].map(|value| value as &dyn Value), &mut text).expect("fits");
        assert_eq!(Line::parse(&text).and_then(|line| line.number()), Ok(7), "{format}");
    }
}

#[test]
fn what_is_written_is_read_back_bit_for_bit() {
    for value in [0.1_f32, -1.0 / 3.0, 1e-30, 3.4e38, f32::MIN_POSITIVE, 0.0, 12_345_679.0] {
        let text = line_of(&Record::Covariance { row: 3, column: 2, value }, 9);
        let line = Line::parse(&text).expect("a line");
        assert_eq!(line.value::<f32>("value").map(f32::to_bits), Ok(value.to_bits()), "{text}");
        assert_eq!((line.kind(), line.number(), line.value::<u8>("column")), ("covariance", Ok(9), Ok(2)));
    }
    let text = line_of(&Record::Covariance { row: 0, column: 0, value: f32::NAN }, 0);
    assert!(Line::parse(&text).and_then(|line| line.value::<f32>("value")).is_ok_and(f32::is_nan));
    let counts = [i32::MIN, 17];
    let log = Record::Log {
        tick: 80_007,
        segment: "training",
        motion: 0,
        position_rad: [0.25, -1e-9],
        torque_nm: [f32::NAN, 3.0],
        counts,
    };
    let text = line_of(&log, u32::MAX);
    let line = Line::parse(&text).expect("a line");
    let values =
        [("position_rad", "[0.25, -1e-9]"), ("counts", "[-2147483648, 17]"), ("torque_nm", "[NaN, 3.0]")];
    values.into_iter().for_each(|(key, value)| assert_eq!(line.text(key), Ok(value)));
    assert_eq!(line.number(), Ok(u32::MAX));
}

#[test]
fn registers_are_written_in_base_sixteen() {
    let text = line_of(
        &Record::Crash {
            cause: "panic",
            pc: 0x0800_1234,
            lr: 0,
            status: 0x9200,
            address: u32::MAX,
            line: 77,
            file: "a.rs",
            released: 1_000,
            kept: 2_000,
        },
        4,
    );
    let line = Line::parse(&text).expect("a line");
    assert_eq!((line.text("pc"), line.text("status")), (Ok("0x8001234"), Ok("0x9200")));
    assert_eq!(line.value::<u32>("line"), Ok(77));
}
