//! Stored models: their contents and rejections.
#![expect(clippy::disallowed_methods, reason = "runs on the host only and may use std's mathematics")]

use scarab_identify::formats::leg_file::geometry::fingerprint;
use scarab_identify::formats::leg_file::{DEFAULT_LEG, LegFile};
use scarab_identify::formats::model_file::ModelFile;
use scarab_identify::leg::setup::{PriorChoice, background, configuration};

use crate::command::{Folder, assert_contains};
use crate::kept::{STATES, kept, model, predict, text};
use scarab::ident::Plan;
use serde_json::Value;

#[test]
fn a_model_contains_the_report_s_numbers_and_reads_back_unchanged() {
    let (model, report) = (model(), &kept().report);
    // The test's JSON reader may miss the last bit; results of single precision must be equal after
    // rounding to it.
    let number = |entry: &Value, key: &str| entry[key].as_f64().map(|value| value as f32);
    let base = report["base_parameters"].as_array().expect("a list");
    assert_eq!(model.base_set.parameters.len(), base.len());
    for (index, (stored, reported)) in model.base_set.parameters.iter().zip(base).enumerate() {
        assert_eq!(Some(stored.name.as_str()), reported["name"].as_str());
        assert_eq!(Some(stored.value as f32), number(reported, "value"));
        assert_eq!(Some(stored.sigma as f32), number(reported, "sigma"));
        // The root was computed in single precision.
        let variance = model.base_set.covariance[index][index];
        assert!((variance.sqrt() / stored.sigma - 1.0).abs() < 1e-6, "{}", stored.name);
    }
    let parameters = report["parameters"].as_array().expect("a list");
    assert_eq!((parameters.len(), model.full_set.parameters.len()), (28, 28));
    for (stored, reported) in model.full_set.parameters.iter().zip(parameters) {
        assert_eq!(Some(stored.name.as_str()), reported["name"].as_str());
        assert_eq!(
            (stored.value.map(|value| value as f32), stored.sigma.map(|sigma| sigma as f32)),
            (number(reported, "value"), number(reported, "sigma")),
            "{}",
            stored.name
        );
        assert_eq!(Some(stored.status.as_str()), reported["status"].as_str());
    }
    assert_eq!(model.conditions.fits.len(), 8);
    let of_now = model.created.parse::<jiff::Timestamp>().expect("RFC 3339").as_second();
    assert!((jiff::Timestamp::now().as_second() - of_now).abs() < 3600, "{}", model.created);

    assert_eq!(text(), model.to_toml());
    assert_eq!(ModelFile::parse(&model.to_toml(), "again").expect("own text"), model);
}

#[test]
fn the_fingerprint_equals_the_board_s() {
    let leg = LegFile::load(DEFAULT_LEG).expect("shipped");
    let known = background::<2, 13>(&leg, PriorChoice::Default, 1).expect("a base set");
    let (board, _) = configuration(&leg, &known, Plan::OneTime, 1).expect("simulated");
    let board = board.fingerprint();
    assert_eq!(model().fingerprint, format!("{:016x}", board.0));
    assert_eq!(fingerprint(&leg).expect("a chain"), model().fingerprint);
}

#[test]
fn a_refused_result_is_not_stored() {
    let folder = Folder::new();
    // With 8 s of one resting joint no held-out part is possible: refused for many reasons.
    let rows: String = (0..4000).map(|row| format!("{},0.1,1.0\n", f64::from(row) * 0.002)).collect();
    folder.write("still.csv", format!("t_s,q1_rad,tau1_Nm\n{rows}"));
    let run = folder.scarab("replay --leg sp --save-model @model.toml @still.csv").ends_with(3);
    let path = folder.path("model.toml");
    assert!(
        run.printed.ends_with(&format!("model: not saved to {}, the result was refused\n", path.display()))
    );
    assert!(!path.exists());
}

/// Refusal of a model file with this text, without the folder's path.
fn refusal(folder: &Folder, text: &str) -> String {
    let message = predict(folder, text, "").refusal();
    message.replace(&folder.path("model.toml").display().to_string(), "model.toml")
}

#[test]
fn a_file_that_ends_early_is_refused() {
    let folder = Folder::new();
    let good = text();
    for cut in (1..good.len() - 2).step_by(997) {
        let cut = (cut..).find(|&cut| good.is_char_boundary(cut)).expect("an end");
        assert!(refusal(&folder, &good[..cut]).starts_with("error: model.toml"), "cut at {cut}");
    }
}

#[test]
fn hostile_files_are_refused_with_file_line_and_reason() {
    let folder = Folder::new();
    let good = text();
    let line_of = |needle: &str| 1 + good[..good.find(needle).expect(needle)].matches('\n').count();
    let changed = |old: &str, new: &str| {
        assert_eq!(good.matches(old).count(), 1, "{old}");
        refusal(&folder, &good.replacen(old, new, 1))
    };
    let base = model().base_set;
    let hx2 = base.parameters.iter().position(|base| base.name == "HX2").expect("the knee's");
    let (value, sigma) = (base.parameters[hx2].value.to_string(), base.parameters[hx2].sigma.to_string());
    let row = good.lines().position(|line| line == "covariance = [").expect("a key") + 1;

    assert_eq!(refusal(&folder, ""), "error: model.toml: is empty\n");
    assert_eq!(refusal(&folder, "name = \"x\"\n"), "error: model.toml: has no `schema`: not a model file\n");
    let own = good.lines().nth(row + hx2).expect("a row").to_owned();
    let variance = base.covariance[hx2][hx2].to_string();
    let elements = |text: &str| own.replacen(&variance, text, 1);
    let lopsided = own.replacen(&base.covariance[hx2][0].to_string(), "0.00001", 1);
    let (in_list, in_matrix) = (line_of("name = \"HX2\", carrier"), row + hx2 + 1);
    for (old, new, line, reason) in [
        ("schema = 1", "schema = 2", 3, "this schema is unknown; this program reads 1"),
        (
            &format!("carrier = \"HX2\", value = {value}"),
            "carrier = \"HX2\", value = nan",
            in_list,
            "`value` is NaN",
        ),
        (
            &format!("value = {value}, sigma = {sigma}, unit = \"kg m\", terms"),
            "value = 1.0, sigma = -1.0, unit = \"kg m\", terms",
            in_list,
            "`sigma` is -1; it must be above 0",
        ),
        ("carrier = \"HX2\"", "carrier = \"HX3\"", in_list, "`HX3` is not a parameter of this leg"),
        ("carrier = \"HX2\"", "carrier = \"HY2\"", in_list, "`HY2` must occur once in its own sum"),
        (&own, &elements("-1e-6"), in_matrix, "the variance of HX2 is -0.000001; it must be above 0"),
        (&own, &elements("4.0"), in_matrix, "the variance of HX2 is 4, not the square of its `sigma`"),
        (&own, &elements("inf"), in_matrix, "an element of `covariance` is inf"),
        (&format!("{own}\n"), "", row, "`covariance` has 12 rows for 13 base parameters"),
        (&own, &own.replacen("],", ", 0.0],", 1), in_matrix, "14 elements in a row for 13 base parameters"),
        (&own, &lopsided, in_matrix, "`covariance` is not symmetric: ZZ1R with HX2 differs from the reverse"),
        (
            "direction = -1",
            "direction = -2",
            line_of("[leg]"),
            "joint `knee`: `direction` is -2; it must be 1 or -1",
        ),
    ] {
        assert_eq!(changed(old, new), format!("error: model.toml:{line}: {reason}\n"));
    }
    assert!(changed("a = 0.39", "a = 0.40").contains("`fingerprint` is"));
    assert!(changed("[full_set]", "[full_set]\ncolour = 1").contains("unknown field `colour`"));
    assert!(changed("name = \"M2\"", "name = \"M1\"").ends_with("`M1` instead of `M2`\n"));
    folder.scarab("predict --states x.csv --model @none.toml").refuses("none.toml: cannot be read");
}

#[test]
fn a_covariance_that_is_not_positive_definite_is_refused() {
    let mut model = model();
    let (one, other) = (0, 1);
    let together =
        1.5 * (model.base_set.covariance[one][one] * model.base_set.covariance[other][other]).sqrt();
    model.base_set.covariance[one][other] = together;
    model.base_set.covariance[other][one] = together;
    let error = ModelFile::parse(&model.to_toml(), "model.toml").expect_err("correlated by 1.5").to_string();
    assert_contains(&error, "some sum of base parameters would have a negative variance");
}

#[test]
fn an_edited_number_is_detected_an_added_comment_is_permitted() {
    let folder = Folder::new();
    let good = text();
    predict(&folder, &format!("# seen by a person\n\n{}", good.replace(" = ", "=")), "").ends_with(0);
    for (old, new) in [
        ("prior = \"file\"", "prior = \"none\""),
        ("motion_s = 55.", "motion_s = 65."),
        ("status = \"grouped\"", "status = \"identified\""),
        ("verdict = \"accepted\"", "verdict = \"refused\""),
    ] {
        assert!(good.contains(old), "{old}");
        let run = predict(&folder, &good.replacen(old, new, 1), "").ends_with(3);
        assert!(run.errors.starts_with("refused: "), "{}", run.errors);
        run.warns("the file was edited or damaged: its checksum is crc-64:");
        assert_eq!(run.printed, "");
    }
}

#[test]
fn a_model_of_another_leg_is_refused_with_the_differences() {
    let folder = Folder::new();
    let leg = LegFile::load(DEFAULT_LEG).expect("shipped");
    let refusal = |leg: &LegFile| {
        folder.write("leg.toml", leg.to_toml());
        let run = predict(&folder, &text(), "--leg @leg.toml").ends_with(3);
        let (_, reason) = run.errors.split_once("not a model of this leg: ").expect("the reason");
        reason.trim_end().to_owned()
    };
    let with = |change: &dyn Fn(&mut LegFile)| {
        let mut changed = leg.clone();
        change(&mut changed);
        refusal(&changed)
    };
    assert_eq!(
        with(&|leg| leg.joints[1].dh.a = 0.429),
        "length `a` from the joint before of joint `knee`: 0.39 m in the model, 0.429 m in the leg (-9.09 %)"
    );
    assert_eq!(
        with(&|leg| leg.joints[0].torque_per_ampere = 1.2),
        "torque constant of joint `hip`: 1.5 N m/A in the model, 1.2 N m/A in the leg (+25.00 %)"
    );
    assert_eq!(
        with(&|leg| leg.gravity = [9.81 * 0.5_f64.sqrt(), 0.0, 9.81 * 0.5_f64.sqrt()]),
        "gravity: 9.8100 m/s2 in the model, 9.8100 m/s2 in the leg, turned by 45.00 deg"
    );
    assert_eq!(
        with(&|leg| leg.joints[1].direction = 1),
        "direction of joint `knee`: -1 in the model, 1 in the leg"
    );
    assert_eq!(
        with(&|leg| leg.joints[1].zero_offset_deg = 5.0),
        "zero offset of joint `knee`: 0 deg in the model, 5 deg in the leg"
    );
    assert_eq!(with(&|leg| leg.name = "left".into()), "it is of `x2-wearer-75kg`, the leg is `left`");
    let options = |options: &str| predict(&folder, &text(), options).ends_with(3).errors;
    assert!(options("--side left").ends_with("it is of a right leg, the leg is a left one\n"));
    assert!(
        options("--thigh 0.42")
            .contains("from the joint before of joint `knee`: 0.39 m in the model, 0.42 m")
    );
    assert!(options("--trunk-pitch 5").ends_with("turned by 5.00 deg\n"));
    let swapped = with(&|leg| {
        let name = leg.joints[0].name.clone();
        leg.joints[0].name = std::mem::replace(&mut leg.joints[1].name, name);
    });
    assert_eq!(swapped, "its joints are hip, knee, the leg's are knee, hip");
    // Keys without influence on the parameters' meaning cause no rejection.
    let mut same = leg.clone();
    same.joints[0].torque_limit_nm = 50.0;
    same.joints[0].encoder.counts = 4096;
    folder.write("leg.toml", same.to_toml());
    predict(&folder, &text(), "--leg @leg.toml").ends_with(0);
    let run = kept().folder.scarab("replay nothing.csv --leg sp --compare-model @model.toml").ends_with(3);
    run.warns("it is of `x2-wearer-75kg`, the leg is `sp`");
}

#[test]
fn a_known_mass_makes_the_model_absolute_with_identified_constants() {
    let folder = Folder::new();
    folder.scarab("identify --payload 5@2:0.3 --save-model @model.toml").ends_with(0);
    let model = ModelFile::load(&folder.path("model.toml")).expect("just written");
    assert_eq!(model.conditions.scale, "absolute");
    for joint in &model.leg.joints {
        // Identified within 2 %, and not equal to the assumed number.
        assert!((joint.torque_per_ampere / 1.5 - 1.0).abs() < 0.02 && joint.torque_per_ampere != 1.5);
    }
    // A leg that assumes 1.5 does not match these parameters until its file states the identified constant.
    folder.write("states.csv", STATES);
    let run =
        |leg: &str| folder.scarab(&format!("predict --states @states.csv --leg {leg} --model @model.toml"));
    run(DEFAULT_LEG).ends_with(3).warns("torque constant of joint `hip`");
    let mut identified = LegFile::load(DEFAULT_LEG).expect("shipped");
    for (joint, stored) in identified.joints.iter_mut().zip(&model.leg.joints) {
        joint.torque_per_ampere = stored.torque_per_ampere;
    }
    folder.write("leg.toml", identified.to_toml());
    run("@leg.toml").ends_with(0);
}

#[test]
fn the_same_leg_is_recognised_and_a_heavier_shank_is_named() {
    let folder = Folder::new();
    let compared = |leg: &str, seed: u64| {
        let model = kept().model.display();
        let arguments = format!("identify --leg {leg} --seed {seed} --compare-model {model}");
        let (run, report) = folder.reported(&arguments, 0);
        let compared = report["compared"].clone();
        run.prints(compared["line"].as_str().expect("words"));
        compared
    };
    for seed in 2..5 {
        let same = compared(DEFAULT_LEG, seed);
        assert_eq!(same["verdict"], "same", "seed {seed}: {same}");
        assert_eq!(same["differences"].as_array().map(Vec::len), Some(13));
        assert_eq!(same["line"], format!("the same leg as on {}", model().created));
    }
    // 0.1 kg at 0.3 m of the knee: 0.03 kg m against a sigma of 0.0044 of the difference.
    let mut heavier = LegFile::load(DEFAULT_LEG).expect("shipped");
    let truth = heavier.joints[1].truth.as_mut().expect("simulated");
    let moment = truth.mass * truth.com[0] + 0.1 * 0.3;
    truth.mass += 0.1;
    truth.com[0] = moment / truth.mass;
    folder.write("leg.toml", heavier.to_toml());
    let changed = compared("@leg.toml", 2);
    assert_eq!(changed["verdict"], "changed", "{changed}");
    assert_eq!(changed["differences"][0]["name"], "HX2", "{changed}");
    let sigmas = changed["differences"][0]["sigmas"].as_f64().expect("a number");
    assert!((4.0..10.0).contains(&sigmas), "{sigmas}");
    assert_eq!(kept().report.get("compared"), None, "only where a model was given");
    assert!(kept().folder.path("model.toml").exists());
}
