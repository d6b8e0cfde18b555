//! Model terms left to the data: used if present, dropped if absent, and reported in words.

use scarab_identify::formats::leg_file::{DEFAULT_LEG, LegFile, Switch};
use scarab_identify::formats::model_file::ModelFile;
use scarab_identify::report::RunReport;
use scarab_identify::report::model_choice::ModelChoiceReport;
use scarab_rig::identify::identify_many;
use scarab_rig::options::SimulationOptions;

use crate::command::{Folder, MUJOCO, assert_contains, base, list, scarab};
use serde_json::Value;

fn runs(leg: &LegFile, seeds: std::ops::RangeInclusive<u64>) -> Vec<RunReport> {
    let options: Vec<_> = seeds.map(SimulationOptions::with_seed).collect();
    identify_many(leg, &options).expect("it runs")
}

/// Default leg without offsets and without a rotor in the knee; the data choose both. Prior and servo match:
/// a loop that expects a rotor shakes a joint without one.
fn leg() -> LegFile {
    let mut leg = LegFile::load(DEFAULT_LEG).expect("shipped");
    for joint in &mut leg.joints {
        (joint.rotor, joint.offset) = (Switch::Auto, Switch::Auto);
        joint.truth.as_mut().expect("simulated").offset = 0.0;
    }
    let knee = &mut leg.joints[1];
    knee.truth.iter_mut().chain(&mut knee.prior).for_each(|link| link.rotor_inertia = 0.0);
    leg
}

fn choice<'a>(run: &'a RunReport, joint: usize, option: &str) -> &'a ModelChoiceReport {
    let found = run.model_choice.iter().find(|choice| (choice.joint, choice.option) == (joint, option));
    found.expect("every option of every joint")
}

/// Default leg with knee friction that differs by 1.6 N m between the directions, without an offset.
fn uneven(asked: Switch, half: f64) -> LegFile {
    let mut leg = LegFile::load(DEFAULT_LEG).expect("shipped");
    let knee = &mut leg.joints[1];
    (knee.offset, knee.asymmetric_coulomb) = (Switch::Off, asked);
    knee.truth.as_mut().expect("simulated").asymmetry = half;
    leg
}

#[test]
fn friction_that_differs_by_direction_is_identified_in_both() {
    identified_in_both(2);
}

#[test]
#[ignore = "campaign: .ci/full"]
fn friction_that_differs_by_direction_is_identified_with_five_seeds() {
    identified_in_both(5);
}

fn identified_in_both(seeds: u64) {
    for run in runs(&uneven(Switch::Auto, 0.8), 1..=seeds) {
        assert!(run.accepted(), "{:?}", run.reasons);
        assert_eq!(choice(&run, 2, "asymmetric_coulomb").used, "on");
        let found = &run.asymmetric_coulomb[..];
        assert_eq!((found.len(), found[0].joint), (1, 2));
        for (value, sigma, truth) in [
            (found[0].forward_nm, found[0].forward_sigma_nm, 4.67 + 0.8),
            (found[0].backward_nm, found[0].backward_sigma_nm, 4.67 - 0.8),
        ] {
            let (value, sigma) = (value.known().expect("found"), sigma.known().expect("found"));
            // One of ten normal errors exceeds four sigma in 0.06 % of all choices of seeds.
            assert!((value - truth).abs() < 4.0 * sigma && sigma < 0.2, "{value} +- {sigma}, {truth}");
        }
    }
    let dropped = runs(&uneven(Switch::Auto, 0.0), 1..=seeds);
    let used = dropped.iter().filter(|run| choice(run, 2, "asymmetric_coulomb").used == "on").count();
    assert!(used <= 1 && dropped.iter().any(|run| run.asymmetric_coulomb.is_empty()), "{used}");
}

#[test]
fn friction_of_two_directions_is_stored_exported_and_predicted() {
    let folder = Folder::new();
    folder.write("leg.toml", uneven(Switch::On, 0.8).to_toml());
    let (run, report) = folder.reported("identify --leg @leg.toml --save-model @model.toml", 0);
    run.prints("Coulomb friction of joint 2: ");
    let half = base(&report, "FCA2", "value");
    let kept = ModelFile::load(&folder.path("model.toml")).expect("just written");
    assert!(kept.base_set.parameters.iter().any(|base| base.carrier == "FCA2"));

    let states = "q1,q2,qd1,qd2,qdd1,qdd2\n0.3,-0.9,0,1.0,0,0\n0.3,-0.9,0,-1.0,0,0\n0.3,-0.9,0,0,0,0\n";
    folder.write("states.csv", states);
    folder.scarab("predict --dh --states @states.csv --out @torque.csv --model @model.toml").ends_with(0);
    let table = folder.table("torque.csv");
    let friction = table.column("tau2_friction_Nm");
    // One rounding per number below 10.
    assert!((friction[0] + friction[1] - 2.0 * half).abs() < 1e-6, "{friction:?} {half}");
    assert_eq!((friction[2], table.column("tau2_offset_Nm")), (0.0, vec![0.0; 3]), "not zero at rest");

    folder.scarab("export --model @model.toml --urdf @leg.urdf").ends_with(0);
    assert_contains(&folder.read("leg.urdf"), "Coulomb friction that differs between the directions: 5.");
}

#[test]
fn a_dropped_column_is_not_in_the_stored_model() {
    let folder = Folder::new();
    folder.write("leg.toml", leg().to_toml());
    let (_, report) = folder.reported("identify --leg @leg.toml --save-model @model.toml", 0);
    let kept = ModelFile::load(&folder.path("model.toml")).expect("a model without the dropped columns");
    for name in ["IA2", "OFF1", "OFF2"] {
        assert!(kept.conditions.not_estimated.iter().any(|other| other == name), "{name}");
        assert!(kept.base_set.parameters.iter().all(|base| base.carrier != name), "{name}");
        let full = kept.full_set.parameters.iter().find(|parameter| parameter.name == name).expect(name);
        assert_eq!((full.value, full.sigma, full.status.as_str()), (Some(0.0), None, "prior"), "{name}");
    }
    assert_eq!(kept.base_set.covariance.len(), 10);
    assert_eq!(
        (report["rank"].as_u64(), report["consistent"]["degrees_of_freedom"].as_u64()),
        (Some(10), Some(10))
    );
    // The hip's rotor is only determined in a sum, whatever its value.
    let choices = list(&report, "model_choice");
    let hip =
        choices.iter().find(|choice| choice["joint"] == 1 && choice["option"] == "rotor").expect("the hip's");
    assert!(hip["used"] == "on" && hip["why"].as_str().is_some_and(|why| why.contains("ZZ1R")), "{hip}");
    folder.scarab("export --model @model.toml --urdf @leg.urdf").ends_with(0);
}

#[test]
fn one_column_cannot_be_requested_twice() {
    let folder = Folder::new();
    let mut both = LegFile::load(DEFAULT_LEG).expect("shipped");
    both.joints[1].asymmetric_coulomb = Switch::On;
    folder.write("leg.toml", both.to_toml());
    let refusal = folder.scarab("identify --leg @leg.toml").refusal();
    assert_contains(&refusal, "leg.toml:");
    assert_contains(&refusal, "joint `knee`: `asymmetric_coulomb` is on and so is `offset`");
    assert_contains(&refusal, "are the same column");

    let words = |offset: Switch, asked: Switch, option: &str| {
        let mut leg = both.clone();
        (leg.joints[1].offset, leg.joints[1].asymmetric_coulomb) = (offset, asked);
        let run = runs(&leg, 1..=1).remove(0);
        let found = choice(&run, 2, option);
        (found.used, found.why.clone())
    };
    let taken = words(Switch::On, Switch::Auto, "asymmetric_coulomb");
    assert_eq!(taken, ("off", "not distinguishable from the offset, which includes it".into()));
    let (used, why) = words(Switch::Auto, Switch::On, "offset");
    assert!(used == "off" && why.contains("requested asymmetric Coulomb friction"), "{why}");
    for (key, word) in [("rotor", "maybe"), ("asymmetric_coulomb", "yes")] {
        let text = LegFile::load(DEFAULT_LEG).expect("shipped").to_toml().replacen(
            "name = \"hip\"",
            &format!("name = \"hip\"\n{key} = \"{word}\""),
            1,
        );
        // The written file already has the key; if so, only its value is replaced.
        let text = if key == "rotor" { text.replacen("rotor = \"on\"\n", "", 1) } else { text };
        folder.write("leg.toml", &text);
        folder
            .scarab("identify --leg @leg.toml")
            .refuses(&format!("unknown variant `{word}`, expected one of `auto`, `on`, `off`"));
    }
}

#[test]
fn an_offset_known_within_a_tolerance_is_estimated_with_what_is_known() {
    let folder = Folder::new();
    let text = include_str!("../../../legs/mujoco-leg.toml");
    let sigma = |offset: &str, name: &str| {
        folder.write("leg.toml", text.replace("{ within_nm = 0.02 }", offset));
        let (_, report) = folder.reported(&format!("replay {MUJOCO} --leg @leg.toml --split 0.67"), 0);
        base(&report, name, "sigma")
    };
    let [on, within] =
        ["\"on\"", "{ within_nm = 0.1 }"].map(|offset| [sigma(offset, "OFF1"), sigma(offset, "HY1")]);
    // Both kinds of knowledge add up.
    let expected = 1.0 / (1.0 / on[0]).hypot(1.0 / 0.1);
    assert!((within[0] / expected - 1.0).abs() < 0.1, "{within:?}, {on:?}");
    // The weight across the leg resembles an offset.
    assert!(within[1] < 0.6 * on[1], "{within:?}, {on:?}");
    for (offset, words) in [
        ("{ within_nm = 0 }", "within_nm"),
        ("{ within = 0.1 }", "leg.toml:16"),
        (
            "\"off\"\nspring = \"on\"",
            "joint `hip`: `spring` is on, and its torque at rest is measured in a sum",
        ),
        ("0.1", "leg.toml:16"),
        ("\"on\"\nrotor = { within_nm = 0.1 }", "`within_nm` belongs to `offset`"),
    ] {
        folder.write("leg.toml", text.replacen("{ within_nm = 0.02 }", offset, 1));
        folder.scarab(&format!("replay {MUJOCO} --leg @leg.toml")).refuses(words);
    }
}

#[test]
fn the_temperature_is_stored_and_another_one_gives_a_warning() {
    let folder = Folder::new();
    let (_, report) = folder.reported("identify --temperature 21.5 --save-model @model.toml", 0);
    assert_eq!(report["temperature_c"], 21.5);
    let model = ModelFile::load(&folder.path("model.toml")).expect("just written");
    assert_eq!(model.conditions.temperature_c, Some(21.5));
    let compared = |arguments: &str| {
        let (run, report) = folder.reported(&format!("identify {arguments} --compare-model @model.toml"), 0);
        let warned = report["compared"]["warning"].as_str().map(str::to_owned);
        assert_eq!(run.printed.contains("\nwarning: "), warned.is_some(), "{}", run.printed);
        warned
    };
    assert_eq!((compared("--temperature 30"), compared("")), (None, None));
    assert_eq!(folder.json("report.json")["temperature_c"], Value::Null);
    let warning = compared("--temperature -10").expect("31.5 K");
    assert_contains(&warning, "-31.5 K");
    assert_contains(&warning, "+3.5 %");
    for bad in ["126", "nan", "warm"] {
        scarab(&format!("identify --temperature {bad}")).refuses("temperature from -40 to 125");
    }
}
