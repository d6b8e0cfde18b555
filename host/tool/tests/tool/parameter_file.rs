//! Stored data of a board, exported from its flash and imported: equal text, rejections, and a
//! board that starts with it.

use std::fs;

use scarab::leg::{Assured, Wearing};
use scarab_identify::formats::leg_file::geometry::fingerprint;
use scarab_identify::formats::leg_file::{DEFAULT_LEG, LegFile};
use scarab_rig::bus::serve::{ServeOptions, network};
use scarab_rig::parameter_file::memory::{BYTES, Memory};

use crate::command::{Folder, Run, assert_contains};

const NODES: &str = r#"
[[node]]
joint = "hip"
objects = [
  { index = 0x1017, subindex = 0, name = "Producer heartbeat time", value = 50 },
  { index = 0x1800, subindex = 1, name = "COB-ID used by TPDO 1", value = 0x40000281 },
  { index = 0x1801, subindex = 1, name = "COB-ID used by TPDO 2", value = 0xC0000181 },
  { index = 0x2001, subindex = 0, name = "Node-ID after the next start", value = 9 },
  { index = 0x607D, subindex = 1, name = "Min position limit", value = -500000 },
  { index = 0x607D, subindex = 2, name = "Max position limit", value = 1500000 },
  { index = 0x60C2, subindex = 2, name = "Interpolation time index", value = -4 },
]

[[node]]
joint = "knee"
objects = []
"#;

const CALIBRATIONS: &str = r#"
[[calibration]]
joint = "hip"
resistance_ohm = 0.0487
direct_inductance_h = 1.57e-5
quadrature_inductance_h = 1.61e-5
offset_rad = -3.141592653589793
encoder = { counter = "down", pole_pairs = 7, counts_per_turn = 8192 }

[[calibration]]
joint = "knee"
resistance_ohm = 0.1
direct_inductance_h = 0.0001
quadrature_inductance_h = 0.00012
offset_rad = 1.4629180792671596e-9
encoder = { counter = "up", pole_pairs = 20, counts_per_turn = 16384, absolute = true }
winding_c = 25.3
joint_zero = { rotor_counts = -1234, joint_steps = 16383, setting = 200 }
"#;

/// Model of this table, `model` or `worn_model`; the hip's ZZ differs.
fn model(table: &str, fingerprint: &str) -> String {
    let is_worn = table == "worn_model";
    let joint = |name: &str, zz: &str, more: &str| {
        format!(
            "\n[[{table}.joint]]\njoint = \"{name}\"\nparameters = {{ XX = 0.0, XY = 0.0, XZ = -0.0, YY = 0.0, YZ = 0.0, ZZ = {zz}, \
             HX = 2.75, HY = -0.125, HZ = 0.0, M = 0.0, IA = 1e-10, FC = 3.3333333, FV = 1.1, OFF = -0.2 }}\n\
             stribeck = {{ excess = 0.25, velocity_rad_s = 0.1 }}\nconstant = \"asymmetry\"\n\
             friction_lower_bound = {{ coulomb_nm = 3.1, viscous_nm_s_rad = 0.9 }}\nlength_m = 0.43\n\
             torque_per_ampere = 1.9\n{more}"
        )
    };
    let head = format!(
        "\n[{table}]\nfingerprint = \"{fingerprint}\"\nfirmware = \"0.1.0\"\ngeneration = 4294967295\n\
         swarm_seed = \"18446744073709551615\"\nbridge_temperature_c = 41.3\nworn = {is_worn}\n\
         inertia_lower_bound = 0.95\n"
    );
    let zz = if is_worn { "2.5" } else { "1.2345679" };
    let hip = joint("hip", zz, "rms_nm = 0.31\nmean_absolute_nm = 17.2\n");
    format!("{head}{hip}{}", joint("knee", "0.4", ""))
}

fn own_fingerprint() -> String {
    fingerprint(&LegFile::load(DEFAULT_LEG).expect("shipped")).expect("two joints")
}

/// Complete file in a person's formatting.
fn text() -> String {
    let own = own_fingerprint();
    format!("schema = 1\n{NODES}{CALIBRATIONS}{}{}", model("model", &own), model("worn_model", &own))
}

/// Text after the leading comment.
fn content(exported: &str) -> &str {
    &exported[exported.find("schema").expect("a schema")..]
}

fn export(folder: &Folder) -> Run {
    folder.scarab("kept export @flash.bin")
}

fn import(folder: &Folder, text: &str) -> Run {
    folder.write("kept.toml", text);
    folder.scarab("kept import @kept.toml @flash.bin")
}

#[test]
fn a_repeated_export_after_import_has_the_same_text() {
    let folder = Folder::new();
    let (first, second) = (folder.path("flash.bin"), folder.path("second.bin"));
    import(&folder, &text()).ends_with(0);
    let exported = export(&folder).ends_with(0);
    assert_eq!(exported.errors, "");
    assert_eq!(content(&exported.printed), text());
    folder.write("kept.toml", &exported.printed);
    folder.scarab("kept import @kept.toml @second.bin").ends_with(0);
    folder.scarab("kept export --out @out.toml @second.bin").ends_with(0);
    assert_eq!(folder.read("out.toml"), exported.printed);
    assert_eq!(fs::read(&first).expect("written"), fs::read(&second).expect("written"));

    // Second board of a file; the first is unchanged, and a repeated import writes nothing.
    let before = fs::read(&second).expect("written");
    for _ in 0..2 {
        folder.scarab("kept import --board 2 @kept.toml @second.bin").ends_with(0);
    }
    let after = fs::read(&second).expect("written");
    assert_eq!((after.len(), &after[..BYTES], &after[BYTES..]), (2 * BYTES, &before[..], &before[..]));
    let beyond = folder.scarab("kept export --board 3 @second.bin").refusal();
    assert_contains(&beyond, "--board 3:");
    assert_contains(&beyond, "holds the flash of 2");
}

#[test]
fn a_file_without_bounds_gives_models_without_bounds() {
    let folder = Folder::new();
    let bounds = |line: &&str| !line.contains("lower_bound");
    let older: Vec<String> = text().lines().filter(bounds).map(|line| format!("{line}\n")).collect();
    import(&folder, &older.concat()).ends_with(0);
    let none = text()
        .replace("inertia_lower_bound = 0.95", "inertia_lower_bound = 0.0")
        .replace("coulomb_nm = 3.1, viscous_nm_s_rad = 0.9", "coulomb_nm = 0.0, viscous_nm_s_rad = 0.0");
    assert_eq!(content(&export(&folder).ends_with(0).printed), none);
}

#[test]
fn unnamed_parts_stay_and_calibrations_of_different_age_are_not_mixed() {
    let folder = Folder::new();
    let flash = folder.path("flash.bin");
    let exported = import(&folder, "schema = 1\n").ends_with(0);
    assert!(exported.printed.starts_with("flash: "), "{}", exported.printed);
    let empty = export(&folder).ends_with(0);
    assert_eq!((content(&empty.printed), empty.errors.matches("absent: ").count()), ("schema = 1\n", 6));

    import(&folder, &text()).ends_with(0);
    let knee =
        "schema = 1\n[[node]]\njoint = \"knee\"\nobjects = [{ index = 0x6065, subindex = 0, value = 7 }]\n";
    import(&folder, knee).ends_with(0);
    let line =
        "objects = [\n  { index = 0x6065, subindex = 0, name = \"Following error window\", value = 7 },\n]\n";
    assert_eq!(content(&export(&folder).ends_with(0).printed), text().replace("objects = []\n", line));

    let before = fs::read(&flash).expect("written");
    let alone = CALIBRATIONS.find("\n[[calibration]]\njoint = \"knee\"").expect("the second");
    let refused = import(&folder, &format!("schema = 1\n{}", &CALIBRATIONS[..alone])).ends_with(3);
    refused.warns("the knee has an older one");
    assert_eq!(fs::read(&flash).expect("still there"), before);
}

#[test]
fn a_board_uses_an_imported_flash_but_refuses_another_leg_s_model() {
    // Boards are moved over the stack, whose frames are large without optimisation.
    let test = std::thread::Builder::new().stack_size(64 << 20).spawn(board_with_imported_flash);
    test.expect("a thread").join().expect("the test passes");
}

fn board_with_imported_flash() {
    let leg = LegFile::load(DEFAULT_LEG).expect("shipped");
    let start = |text: &str| {
        let folder = Folder::new();
        import(&folder, text).ends_with(0);
        let options = ServeOptions::local(1);
        let bytes = fs::read(folder.path("flash.bin")).expect("written");
        let mut network = network::<2, 13>(&leg, &options, Some(&bytes), &[]).expect("the default leg");
        let board = &mut network.boards()[0];
        let control = board.rig.leg.control();
        let [empty, worn] = [Wearing::Empty, Wearing::Worn].map(|wearing| control.model_of(wearing).copied());
        assert_eq!(control.model(), empty.as_ref(), "the feedforward");
        (board.nodes().each_ref().map(|node| node.id().number()), [empty, worn])
    };
    let (numbers, models) = start(&text());
    let [empty, worn] = models.map(|model| model.expect("a model of this leg"));
    let [hip, knee] = empty.equivalent_parameters();
    assert_eq!(numbers, [9, 2]);
    assert_eq!((hip[5], hip[6], hip[13], knee[5]), (1.234_567_9, 2.75, -0.2, 0.4));
    assert_eq!(worn.equivalent_parameters()[0][5], 2.5);
    let bounds = Assured { coulomb_nm: [3.1; 2], viscous: [0.9; 2], inertia_share: 0.95 };
    assert_eq!([empty.assured(), worn.assured()], [&bounds; 2]);

    let [model, worn_model] = ["model", "worn_model"].map(|table| model(table, "0123456789abcdef"));
    let (numbers, models) = start(&format!("schema = 1\n{NODES}{model}{worn_model}"));
    assert_eq!((numbers, models), ([9, 2], [None; 2]));
}

#[test]
fn damaged_parts_are_reported_and_the_rest_is_exported() {
    let folder = Folder::new();
    let flash = folder.path("flash.bin");
    // The hip's key holds a truncated entry, a controlword, and a value that no node accepts; the
    // calibrations are valid.
    let off = scarab::leg::DriveState::SwitchOnDisabled;
    for (bytes, why) in [
        (&[0x17, 0x10, 0, 2, 50, 0, 0x17][..], "bytes that are not an entry"),
        (&[0x17, 0x10, 0, 4, 50, 0, 0, 0], "bytes that are not an entry"),
        (&[0x40, 0x60, 0, 2, 15, 0], "0x6040:0: is a command"),
        (&[0x55, 0x55, 0, 1, 1], "0x5555:0: there is no such object"),
        (&[0x02, 0x20, 0, 2, 1, 0], "0x2002:0 (Bit rate after the next start): a node refuses this value"),
    ] {
        fs::remove_file(&flash).ok();
        import(&folder, &format!("schema = 1\n{CALIBRATIONS}")).ends_with(0);
        let mut memory = Memory::new(Some(&fs::read(&flash).expect("written")));
        assert!(memory.keep_objects(off, 0, bytes) && memory.keep_objects(off, 1, &[]));
        fs::write(&flash, memory.bytes()).expect("a temporary file");
        let run = export(&folder).ends_with(3);
        let expected = format!("schema = 1\n\n[[node]]\njoint = \"knee\"\nobjects = []\n{CALIBRATIONS}");
        assert_eq!(content(&run.printed), expected);
        let said: Vec<&str> = run.errors.lines().collect();
        assert!(said.len() == 3 && said[..2].iter().all(|line| line.starts_with("absent: ")), "{said:?}");
        assert!(said[0].ends_with(" model") && said[1].ends_with("model of the worn leg"), "{said:?}");
        assert!(said[2].contains("objects of the hip: ") && said[2].contains(why), "{said:?}");
    }

    // Unrelated data: nothing is read, and nothing is overwritten.
    let noise: Vec<u8> =
        (0..BYTES as u32).map(|index| (index.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
    fs::write(&flash, &noise).expect("a temporary file");
    let run = export(&folder).ends_with(3);
    assert_eq!((content(&run.printed), run.errors.matches("damaged: ").count()), ("schema = 1\n", 1));
    import(&folder, &text()).ends_with(3).warns("no record in it can be read: nothing was written");
    assert_eq!(fs::read(&flash).expect("still there"), noise);

    // A damaged record (followed by zeros that fill the word) without a copy: the log cannot repair it, and
    // the file is not erased.
    fs::remove_file(&flash).ok();
    import(&folder, "schema = 1\n[[node]]\njoint = \"hip\"\nobjects = []\n").ends_with(0);
    let mut bytes = fs::read(&flash).expect("written");
    let last = bytes.iter().take(BYTES / 4).rposition(|byte| !matches!(byte, 0 | 0xFF)).expect("a record");
    bytes[last] ^= 1;
    fs::write(&flash, &bytes).expect("a temporary file");
    export(&folder).ends_with(3).warns("damaged: ");
}

/// Replacements in a complete file, each with the words of the refusal.
const REPLACEMENTS: &[(&str, &str, &str)] = &[
    ("schema = 1", "schema = 2", "schema 2 is unknown; this program reads 1"),
    ("schema = 1\n", "", "has no `schema`"),
    ("schema = 1\n", "schema = 1\nbord = 1\n", "unknown field `bord`"),
    ("value = 50", "valeu = 50", "unknown field `valeu`"),
    ("value = 50 }", "}", "missing field `value`"),
    ("value = 50", "value = 65536", "0x1017:0: 65536 is not from 0 to 65535"),
    ("value = 50", "value = -1", "0x1017:0: -1 is not from 0 to 65535"),
    ("value = 50", "value = 50.5", ":6: "),
    ("0x1017,", "0x1717,", "0x1717:0: there is no such object"),
    ("0x1017,", "0x6041,", "0x6041:0: is read-only"),
    ("0x1017,", "0x6040,", "0x6040:0: is a command"),
    ("\"Producer heartbeat time\"", "\"Device type\"", "is `Producer heartbeat time`, not `Device type`"),
    ("value = 9", "value = 200", "0x2001:0 (Node-ID after the next start): a node refuses this value"),
    (
        "value = 0x40000281",
        "value = 0x40000001",
        "0x1800:1 (COB-ID used by TPDO 1): a node refuses this value",
    ),
    ("value = -500000", "value = 1500001", "0x607D:1 is 1500001, above 0x607D:2 with 1500000"),
    ("0x607D, subindex = 2, name = \"Max", "0x607D, subindex = 1, name = \"Min", "0x607D:1: occurs twice"),
    ("joint = \"knee\"\nobjects", "joint = \"hip\"\nobjects", "node: the hip occurs twice"),
    ("joint = \"knee\"\nobjects", "joint = \"ankle\"\nobjects", "a board does not store data of the ankle"),
    ("joint = \"knee\"\nobjects", "joint = \"toe\"\nobjects", "unknown variant `toe`"),
    ("resistance_ohm = 0.1\n", "resistance_ohm = nan\n", "calibration of the knee: `resistance_ohm` is NaN"),
    ("resistance_ohm = 0.1\n", "resistance_ohm = 0.0\n", "`resistance_ohm` is 0; it must be above 0"),
    ("inductance_h = 0.0001\n", "inductance_h = 1e300\n", "which a board cannot store"),
    ("winding_c = 25.3", "winding_c = 1e4", "outside -100..1000"),
    ("joint_steps = 16383", "joint_steps = 16384", "it must be below 16384"),
    ("offset_rad = -3.14", "offset_rad = -3.15", "it must be from -pi to pi"),
    ("pole_pairs = 20", "pole_pairs = 0", "pole pairs and counts per turn must be above 0"),
    ("pole_pairs = 20", "pole_pairs = 300", "expected u8"),
    ("ZZ = 0.4", "ZZ = inf", "model: knee: `ZZ` is inf"),
    ("ZZ = 0.4,", "", "missing field `ZZ`"),
    ("velocity_rad_s = 0.1", "velocity_rad_s = 0.0", "it must be above 0"),
    ("excess = 0.25", "excess = -0.25", "`excess` is -0.25; it must not be below 0"),
    ("constant = \"asymmetry\"", "constant = \"none\"", "unknown variant `none`"),
    ("rms_nm = 0.31", "rms_nm = nan", "model: hip: `rms_nm` is NaN"),
    ("firmware = \"0.1.0\"", "firmware = \"0.1\"", "three numbers up to 255"),
    ("\"18446744073709551615\"", "\"18446744073709551616\"", "the digits of a number of 64 bits"),
    ("bridge_temperature_c = 41.3", "bridge_temperature_c = 300", "it must be from -40 to 125"),
    ("[[model.joint]]\njoint = \"hip\"", "[[model.joint]]\njoint = \"knee\"", "`joint`: knee instead of hip"),
    ("worn = false", "worn = true", "model: `worn` is true: the model of a worn leg is `worn_model`"),
    ("worn = true", "worn = false", "worn_model: `worn` must be true"),
    ("worn = true\n", "", "worn_model: `worn` must be true"),
    ("inertia_lower_bound = 0.95", "inertia_lower_bound = 1.05", "it must be from 0 to 1"),
    ("inertia_lower_bound = 0.95", "inertia_lower_bound = nan", "`inertia_lower_bound` is NaN"),
    ("{ coulomb_nm = 3.1", "{ coulomb_nm = -3.1", "`coulomb_nm` is -3.1; it must not be below 0"),
    (", viscous_nm_s_rad = 0.9", "", "missing field `viscous_nm_s_rad`"),
    ("[model]", "[model", ":"),
];

#[test]
fn an_invalid_file_is_refused_with_its_reason_and_the_flash_unchanged() {
    let folder = Folder::new();
    let flash = folder.path("flash.bin");
    import(&folder, &text()).ends_with(0);
    let before = fs::read(&flash).expect("written");
    let whole = text();
    let own = own_fingerprint();
    let short = (own.as_str(), "12345", "`fingerprint` is `12345`; it must be 16 hexadecimal digits");
    for (old, new, why) in REPLACEMENTS.iter().copied().chain([short]) {
        let bad = whole.replacen(old, new, 1);
        assert_ne!(bad, whole, "{old}");
        let said = import(&folder, &bad).refusal();
        assert!(
            said.starts_with("error: ") && said.contains("kept.toml:") && said.contains(why),
            "{new}: {said}"
        );
        assert_eq!(fs::read(&flash).expect("still there"), before, "{new}");
    }
}

#[test]
fn too_many_objects_and_a_file_of_another_size_are_refused() {
    let folder = Folder::new();
    let flash = folder.path("flash.bin");
    // More than a board stores for a node.
    let many: Vec<String> = (0x1A00..0x1A04)
        .flat_map(|index| {
            (1..9).map(move |sub| format!("{{ index = {index}, subindex = {sub}, value = 0x60410010 }}"))
        })
        .chain((0x1600..0x1604).flat_map(|index| {
            (1..9).map(move |sub| format!("{{ index = {index}, subindex = {sub}, value = 0x60400010 }}"))
        }))
        .collect();
    let many = format!("schema = 1\n[[node]]\njoint = \"hip\"\nobjects = [{}]\n", many.join(", "));
    import(&folder, &many).refuses("more than the 400 bytes that a board stores for a node");
    // A file of another size is not a flash and stays unchanged.
    fs::write(&flash, [0xFF; 100]).expect("a temporary file");
    import(&folder, &text()).refuses("100 bytes; the flash of 1 to 4 boards has 32768 each");
    assert_eq!(fs::read(&flash).expect("still there"), [0xFF; 100]);
    folder.scarab("kept export @none.bin").refuses("does not exist");
}
