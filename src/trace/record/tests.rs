use super::super::Line;
use super::*;

/// Fixed buffer for one line of text, without a heap.
struct Text {
    bytes: [u8; 512],
    length: usize,
}

impl Text {
    fn of(record: &Record<2>, number: u32) -> Self {
        let mut text = Self { bytes: [0; 512], length: 0 };
        record.write(number, &mut text).expect("512 characters are enough");
        text
    }

    fn as_str(&self) -> &str {
        core::str::from_utf8(&self.bytes[..self.length]).expect("ASCII")
    }
}

impl Write for Text {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let end = self.length + text.len();
        self.bytes.get_mut(self.length..end).ok_or(fmt::Error)?.copy_from_slice(text.as_bytes());
        self.length = end;
        Ok(())
    }
}

/// Kind and keys of a format, the kind first.
fn keys(format: &str) -> impl Iterator<Item = &str> {
    format.split(' ').map(|pair| pair.split('=').next().expect("a key"))
}

#[test]
fn every_format_is_a_line_whose_first_key_is_its_number() {
    for format in Record::<2>::FORMATS {
        let mut keys = keys(format);
        let kind = keys.next().expect("a kind");
        assert_eq!(keys.next(), Some("n"), "{kind}");
        assert_eq!(
            Record::<2>::FORMATS.iter().filter(|other| other.starts_with(&format[..=kind.len()])).count(),
            1
        );
        // Every value is a placeholder with its type.
        for pair in format.split(' ').skip(1) {
            let (key, value) = pair.split_once('=').expect("key=value");
            assert!(value.starts_with("{=") && value.ends_with('}'), "{kind} {key}: {value}");
        }
        // Any text in the placeholders can be read back.
        let mut text = Text { bytes: [0; 512], length: 0 };
        fill(format, &[&7_u32; 24].map(|value| value as &dyn Value), &mut text).expect("fits");
        assert_eq!(Line::parse(text.as_str()).and_then(|line| line.number()), Ok(7), "{format}");
    }
}

/// Keys of the format are the fields, in the same order: a value behind the wrong key would be misread.
#[test]
fn keys_are_the_fields_in_their_order() {
    // The debug form of a struct variant lists its fields; one record of every
    // shape with more than one field.
    let text = |record: &Record<2>| {
        let mut text = Text { bytes: [0; 512], length: 0 };
        write!(text, "{record:?}").expect("fits");
        text
    };
    for (record, format) in EXAMPLES.iter().zip(Record::<2>::FORMATS) {
        let debug = text(record);
        let fields = debug.as_str().split_once('{').expect("fields").1;
        let fields = fields.split(": ").filter_map(|before| before.rsplit([' ', '{']).next());
        let count = keys(format).count() - 2;
        assert!(keys(format).skip(2).eq(fields.take(count)), "{format}\n{}", debug.as_str());
    }
    assert_eq!(EXAMPLES.len(), Record::<2>::FORMATS.len());
}

#[test]
fn what_is_written_is_read_back_bit_for_bit() {
    for value in [0.1_f32, -1.0 / 3.0, 1e-30, 3.4e38, f32::MIN_POSITIVE, 0.0, 12_345_679.0] {
        let text = Text::of(&Record::Covariance { row: 3, column: 2, value }, 9);
        let line = Line::parse(text.as_str()).expect("a line");
        assert_eq!(line.value::<f32>("value").map(f32::to_bits), Ok(value.to_bits()), "{}", text.as_str());
        assert_eq!((line.kind(), line.number(), line.value::<u8>("column")), ("covariance", Ok(9), Ok(2)));
    }
    let text = Text::of(&Record::Covariance { row: 0, column: 0, value: f32::NAN }, 0);
    assert!(Line::parse(text.as_str()).and_then(|line| line.value::<f32>("value")).is_ok_and(f32::is_nan));
    let counts = [i32::MIN, 17];
    let log = Record::Log {
        tick: 80_007,
        segment: "training",
        motion: 0,
        position_rad: [0.25, -1e-9],
        torque_nm: [f32::NAN, 3.0],
        counts,
    };
    let text = Text::of(&log, u32::MAX);
    let line = Line::parse(text.as_str()).expect("a line");
    assert_eq!(line.list::<f32, 2>("position_rad"), Ok([0.25, -1e-9]));
    assert_eq!((line.list::<i32, 2>("counts"), line.number()), (Ok(counts), Ok(u32::MAX)));
    assert!(line.list::<f32, 2>("torque_nm").is_ok_and(|torque| torque[0].is_nan() && torque[1] == 3.0));
}

#[test]
fn registers_are_written_in_base_sixteen() {
    let text = Text::of(&EXAMPLES[2], 4);
    let line = Line::parse(text.as_str()).expect("a line");
    assert_eq!((line.hex("pc"), line.text("status")), (Ok(0x0800_1234), Ok("0x9200")));
    assert_eq!(line.value::<u32>("line"), Ok(77));
}

/// One example of each kind, in the order of the list.
const EXAMPLES: [Record<2>; 29] = [
    Record::Boot {
        grammar: 1,
        version: "0.1.0",
        leg: "x2",
        joints: 2,
        base: 13,
        servo_hz: 4000,
        log_hz: 500,
        reset: "pin",
    },
    Record::Board {
        uid0: 1,
        uid1: 2,
        uid2: 3,
        version: 3,
        version_minor: 6,
        version_volt: 56,
        clock_hz: 168_000_000,
    },
    Record::Crash {
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
    Record::Refused { why: "-", value: 0 },
    Record::GateDriver { why: "-", joint: 1, status: 0x0400_0300 },
    Record::State { tick: 1, drive: "-", activity: "-", phase: "-", motion: 0 },
    Record::Request { tick: 1, name: "-", accepted: true },
    Record::NotEnabled { tick: 1, joint: 1, why: "-" },
    Record::Fault { tick: 1, code: 0x8400, name: "-", joint: 1 },
    Record::AxisFault { tick: 1, joint: 1, name: "-" },
    Record::Limit { tick: 1, code: 5, name: "-", joint: 1 },
    Record::Calibration {
        joint: 1,
        result: "done",
        number: 0,
        resistance_ohm: 0.1,
        direct_h: 1e-5,
        quadrature_h: 1e-5,
        offset_turns: 0.2,
        zero_b: 2048.0,
        zero_c: 2048.0,
    },
    Record::Progress { tick: 1, iterations: 1, evaluations: 20, excess_chi2: 0.5 },
    Record::Solver {
        plan: "-",
        swarm_seed: 1,
        state: "-",
        iterations: 1,
        evaluations: 1,
        steps: 1,
        rank: 13,
        base: 13,
        dropped: 0,
        condition: 1.0,
        consistency_chi2: 0.0,
    },
    Record::Parameter { joint: 1, symbol: "XX", value: 1.0, unit: "-", sigma: 1.0, status: "-" },
    Record::Base {
        index: 0,
        joint: 1,
        symbol: "ZZ",
        grouped: true,
        dropped: false,
        value: 1.0,
        unit: "-",
        sigma: 1.0,
        least_squares: 1.0,
    },
    Record::Covariance { row: 0, column: 0, value: 1.0 },
    Record::Stribeck {
        joint: 1,
        surplus_nm: 1.0,
        surplus_sigma_nm: 1.0,
        speed_rad_s: 1.0,
        speed_sigma_rad_s: 1.0,
        gain_chi2: 1.0,
    },
    Record::Motion { motion: 0, samples: 1, rejected: 0, longest_common_s: 0.0, row_information: 1.0 },
    Record::Fit {
        motion: 0,
        joint: 1,
        rows: 1,
        rms_nm: 1.0,
        mean_abs_nm: 1.0,
        torque_rms_nm: 1.0,
        speed_rms_rad_s: 1.0,
        disturbed_share: 0.0,
        disturbed_longest_s: 0.0,
        replaced: 0,
    },
    Record::Finding { reason: "-", test: "-", joint: 0, motion: 0, value: 1.0, limit: 1.0, passed: true },
    Record::Reason { reason: "-" },
    Record::Verdict { verdict: "-", reasons: 0 },
    Record::End { records: 1 },
    Record::Change { since_s: 1.0, joints: [true, false], statistic: [1.0, 2.0], limit: 1.0 },
    Record::Update { cause: "-", link: 0, verdict: "-", offered: false },
    Record::Loops {
        tick: 1,
        current_worst: 1,
        servo_worst: 1,
        current_missed: 0,
        servo_missed: 0,
        cycles_per_tick: 42_000,
        stack_used: 1,
        stack_bytes: 1,
        samples_lost: 0,
        records_lost: 0,
    },
    Record::Supply {
        tick: 1,
        bus_v: 48.0,
        bus_low_v: 47.0,
        bus_high_v: 49.0,
        bridge_c: [25.0; 2],
        chopper_c: 25.0,
        chopper_duty: 0.0,
    },
    Record::Log {
        tick: 1,
        segment: "-",
        motion: 0,
        position_rad: [0.0; 2],
        torque_nm: [0.0; 2],
        counts: [0; 2],
    },
];
