//! Frames of a `defmt` stream from defmt's own encoder, decoded with an image that holds the
//! records' formats.
//!
//! The image is created here: an ELF with symbols only, as a linker would write them for the formats of this
//! version. `cargo chip run` covers a real image.

use std::path::Path;

use object::write::{Object, Symbol, SymbolSection};
use object::{Architecture, BinaryFormat, Endianness, SectionKind, SymbolFlags, SymbolKind, SymbolScope};
use scarab::trace::{Line, Record};
use scarab_rig::trace::Decoder;
use scarab_rig::traced::run::StreamReader;

use super::session::{accepted, quiet, text};
use crate::command::Folder;

/// Formats of types used by records besides their own, and their addresses in the image.
const PRIMITIVES: [(u16, &str); 4] = [(1, "{=[?;2]}"), (2, "{=f32}"), (3, "{=i32}"), (4, "{=bool}")];
/// Address of the first record format.
const FIRST: u16 = 16;

fn image(version: &str, encoding: &str, formats: &[&str]) -> Vec<u8> {
    let mut object = Object::new(BinaryFormat::Elf, Architecture::Arm, Endianness::Little);
    let section = object.add_section(Vec::new(), b".defmt".to_vec(), SectionKind::ReadOnlyData);
    object.set_section_data(section, vec![0; 256], 1);
    let mut add = |address: u64, name: String, section| {
        object.add_symbol(Symbol {
            name: name.into_bytes(),
            value: address,
            size: 1,
            kind: SymbolKind::Data,
            scope: SymbolScope::Linkage,
            weak: false,
            section,
            flags: SymbolFlags::None,
        });
    };
    let symbol = |tag: &str, address: u64, format: &str| {
        let format = serde_json::to_string(format).expect("text");
        format!(
            r#"{{"package":"scarab","tag":"{tag}","data":{format},"disambiguator":"{address}","crate_name":"scarab"}}"#
        )
    };
    for (address, format) in PRIMITIVES {
        let name = symbol("defmt_prim", address.into(), format);
        add(address.into(), name, SymbolSection::Section(section));
    }
    for (index, format) in formats.iter().enumerate() {
        let address = u64::from(FIRST) + index as u64;
        add(address, symbol("defmt_info", address, format), SymbolSection::Section(section));
    }
    for name in [format!("_defmt_version_ = {version}"), format!("_defmt_encoding_ = {encoding}")] {
        add(0, name, SymbolSection::Absolute);
    }
    object.write().expect("an ELF")
}

fn own_image() -> Vec<u8> {
    image("4", "rzcobs", Record::<2>::FORMATS)
}

/// Encodes one value as the device sends it after its index.
fn value(hint: &str, text: &str, out: &mut Vec<u8>) {
    let number = || text.strip_prefix("0x").map_or_else(|| text.parse(), |hex| u64::from_str_radix(hex, 16));
    let number = || number().expect("a number").to_le_bytes();
    match hint.split(':').next().expect("a type") {
        "=u8" => out.extend(&number()[..1]),
        "=u16" => out.extend(&number()[..2]),
        "=u32" => out.extend(&number()[..4]),
        "=u64" => out.extend(&number()),
        "=bool" => out.push(u8::from(text == "true")),
        "=f32" => out.extend(text.parse::<f32>().expect("a number").to_le_bytes()),
        "=str" => {
            out.extend((text.len() as u32).to_le_bytes());
            out.extend(text.as_bytes());
        }
        "=?" => {
            let items: Vec<&str> = text.trim_matches(['[', ']']).split(", ").collect();
            let is = |test: fn(&str) -> bool| items.iter().all(|item| test(item));
            let (element, hint) = if is(|item| item.parse::<bool>().is_ok()) {
                (4_u16, "=bool")
            } else if is(|item| item.parse::<i32>().is_ok()) {
                (3, "=i32")
            } else {
                (2, "=f32")
            };
            out.extend(1_u16.to_le_bytes());
            out.extend(element.to_le_bytes());
            for item in items {
                match hint {
                    "=i32" => out.extend(item.parse::<i32>().expect("a number").to_le_bytes()),
                    hint => value(hint, item, out),
                }
            }
        }
        other => panic!("no record has {other}"),
    }
}

/// Encodes a line as a frame, with zeros before and after it.
fn frame(line: &str) -> Vec<u8> {
    let read = Line::parse(line).expect(line);
    let own = |format: &str| format.split(' ').next() == Some(read.kind());
    let index = Record::<2>::FORMATS.iter().position(|format| own(format)).expect("a kind");
    let mut bytes = (FIRST + index as u16).to_le_bytes().to_vec();
    for pair in Record::<2>::FORMATS[index].split(' ').skip(1) {
        let (key, hint) = pair.split_once('=').expect("key=value");
        value(hint.trim_matches(['{', '}']), read.text(key).expect(key), &mut bytes);
    }
    let (mut encoder, mut out) = (defmt::Encoder::new(), Vec::new());
    encoder.start_frame(|bytes| out.extend(bytes));
    encoder.write(&bytes, |bytes| out.extend(bytes));
    encoder.end_frame(|bytes| out.extend(bytes));
    out
}

fn stream(lines: &[String]) -> Vec<u8> {
    lines.iter().flat_map(|line| frame(line)).collect()
}

fn decoded(stream: &[u8], piece: usize) -> (Vec<String>, Decoder) {
    let mut decoder = Decoder::new(&own_image()).expect("an image");
    let mut lines = Vec::new();
    stream.chunks(piece).for_each(|piece| decoder.feed(piece, |line| lines.push(line.to_owned())));
    (lines, decoder)
}

/// Pairs with numbers as bits: different spellings of a number are equal.
fn meaning(line: &str) -> Vec<(String, Vec<String>)> {
    let line = Line::parse(line).expect(line);
    let bits =
        |item: &str| item.parse::<f32>().map_or(item.to_owned(), |number| format!("{:x}", number.to_bits()));
    let mut pairs = vec![("kind".to_owned(), vec![line.kind().to_owned()])];
    for pair in line.pairs() {
        let (key, value) = pair.expect("a pair");
        let items = value.trim_matches(['[', ']']).split(", ");
        pairs.push((key.to_owned(), items.map(bits).collect()));
    }
    pairs
}

#[test]
fn sent_records_are_decoded_bit_for_bit_in_pieces_of_any_size() {
    let log = accepted().iter().filter(|line| line.starts_with("log ")).step_by(97).cloned();
    let mut sent: Vec<String> = quiet().into_iter().chain(log).collect();
    for value in ["NaN", "inf", "-inf", "1e-45", "-0.0", "3.4028235e38", "1.1754944e-38", "0.1", "16777217"] {
        sent.push(format!("covariance n=9 row=1 column=1 value={value}"));
    }
    sent.push("change n=10 since_s=1.5 joints=[true, false] statistic=[NaN, 2.5] limit=9".into());
    sent.push(
        "log n=11 tick=8 segment=- motion=0 position_rad=[0, 0] torque_nm=[0, 0.5] counts=[-2147483648, 7]"
            .into(),
    );
    let bytes = stream(&sent);
    for piece in [1, 7, 64, bytes.len()] {
        let (lines, mut decoder) = decoded(&bytes, piece);
        assert_eq!(lines.len(), sent.len());
        for (line, sent) in lines.iter().zip(&sent) {
            assert_eq!(meaning(line), meaning(sent));
        }
        assert_eq!(decoder.finish(), scarab_rig::trace::decode::Skipped::default());
    }
}

#[test]
fn decoding_resumes_at_the_next_frame_after_lost_bytes() {
    let lines = quiet();
    let whole = stream(&lines);
    // Rest of a frame, noise, then everything.
    let mut late = frame(&lines[2])[9..].to_vec();
    late.extend((0..300_u32).map(|offset| (offset * 37 % 251) as u8));
    late.push(0);
    let first = late.len() as u64;
    late.extend(&whole);
    let (decoded_lines, mut decoder) = decoded(&late, 50);
    assert_eq!(decoded_lines.len(), lines.len());
    let skipped = decoder.finish();
    assert!(skipped.first_bytes > 0 && skipped.first_bytes <= first, "{skipped:?}");
    assert_eq!(skipped.bytes, skipped.first_bytes);

    let shortest = lines.iter().map(|line| frame(line).len()).min().expect("frames");
    // Truncated, lost or inverted bytes at any position: no panic, and the rest is read.
    for offset in (0..whole.len()).step_by(whole.len() / 200) {
        let (cut, mut decoder) = decoded(&whole[..offset], 64);
        assert!(cut.len() <= lines.len());
        let lost = decoder.finish();
        assert!(lost.frames == 0 && (lost.cut_bytes > 0 || whole[..offset].ends_with(&[0]) || offset == 0));
        let hole = [&whole[..offset], &whole[(offset + 90).min(whole.len())..]].concat();
        let left = decoded(&hole, 64).0.len();
        assert!(
            left + 90 / shortest + 2 >= lines.len(),
            "a gap loses only the frames it touches: {left} of {}",
            lines.len()
        );
        let mut turned = whole.clone();
        turned[offset] ^= 0x55;
        assert!(decoded(&turned, 64).0.len() + 3 >= lines.len());
    }
    // Without the end of a frame memory stays bounded, and the next frame is found.
    let mut endless = vec![0x5a; 1 << 20];
    endless.push(0);
    endless.extend(&whole);
    let (decoded_lines, mut decoder) = decoded(&endless, 4096);
    assert_eq!(decoded_lines.len(), lines.len());
    assert_eq!(decoder.finish().first_bytes, (1 << 20) + 1);
}

#[test]
fn a_stream_and_its_text_are_reported_alike() {
    let folder = Folder::new();
    let lines = quiet();
    folder.write("leg.elf", own_image());
    folder.write("trace.txt", text(&lines));
    folder.write("trace.bin", stream(&lines));
    let (decoded, one) = folder.reported("trace --image @leg.elf @trace.bin --text @again.txt", 0);
    let (read, other) = folder.reported("trace @trace.txt", 0);
    assert_eq!((decoded.printed, one), (read.printed, other));
    let again = folder.read("again.txt");
    assert!(again.lines().map(meaning).eq(lines.iter().map(|line| meaning(line))), "the lines need no image");
    // Stream without its image, text with one.
    folder.scarab("trace @trace.bin").ends_with(2).warns("--image");
    folder.scarab("trace --image @leg.elf @trace.txt").ends_with(2).warns("no frame of this image");
}

#[test]
fn an_image_of_another_stream_is_refused() {
    for (bytes, words) in [
        (b"not an image".to_vec(), "cannot be used as an image"),
        (image("99", "rzcobs", Record::<2>::FORMATS), "defmt"),
        (image("4", "raw", Record::<2>::FORMATS), "rzcobs is needed"),
        (image("4", "rzcobs", &["hello n={=u32}"]), "no Scarab trace records"),
        (
            Object::new(BinaryFormat::Elf, Architecture::Arm, Endianness::Little).write().expect("an ELF"),
            "no section .defmt",
        ),
    ] {
        let error = Decoder::new(&bytes).expect_err("refused");
        assert!(error.to_string().contains(words), "{error}");
        assert_eq!(error.exit_code(), 2);
    }
    // Right image with foreign bytes, which contain no record.
    let mut reader = StreamReader::new(Some(Decoder::new(&own_image()).expect("an image")));
    reader.feed(&[1, 2, 3, 0, 9, 9, 9, 9, 0, 0, 0, 7]).expect("nothing is written");
    assert!(reader.finish(Path::new("stream")).is_err());
}
