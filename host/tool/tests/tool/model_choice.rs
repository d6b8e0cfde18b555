//! Model terms left to the data: used if present, dropped if absent, and reported in words.

use scarab_identify::formats::leg_file::{DEFAULT_LEG, LegFile, Switch};
use scarab_identify::formats::model_file::ModelFile;
use scarab_identify::report::RunReport;
use scarab_identify::report::model_choice::ModelChoiceReport;
use scarab_rig::identify::identify_many;
use scarab_rig::options::SimulationOptions;

use crate::command::{Folder, base, scarab};
use serde_json::Value;

fn runs(leg: &LegFile, seeds: std::ops::RangeInclusive<u64>) -> Vec<RunReport> {
    let options: Vec<_> = seeds.map(SimulationOptions::with_seed).collect();
    identify_many::<2, 13>(leg, &options).expect("it runs")
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
    let (file, model) =
        (folder.write("leg.toml", &uneven(Switch::On, 0.8).to_toml()), folder.path("model.toml"));
    let arguments = format!(
        "identify --leg {} --json {} --save-model",
        file.display(),
        folder.path("run.json").display()
    );
    let printed = scarab(&arguments, &[&model]).ends_with(0).printed;
    assert!(printed.contains("Coulomb friction of joint 2: "), "{printed}");
    let half = base(&folder.json("run.json"), "FCA2", "value");
    let kept = ModelFile::load(&model).expect("just written");
    assert!(kept.base_set.parameters.iter().any(|base| base.carrier == "FCA2"));

    let states = "q1,q2,qd1,qd2,qdd1,qdd2\n0.3,-0.9,0,1.0,0,0\n0.3,-0.9,0,-1.0,0,0\n0.3,-0.9,0,0,0,0\n";
    let states = folder.write("states.csv", states);
    let out = folder.path("torque.csv");
    let arguments = format!("predict --dh --states {} --out {} --model", states.display(), out.display());
    scarab(&arguments, &[&model]).ends_with(0);
    let table = folder.table("torque.csv");
    let friction = table.column("tau2_friction_Nm");
    // One rounding per number below 10.
    assert!((friction[0] + friction[1] - 2.0 * half).abs() < 1e-6, "{friction:?} {half}");
    assert_eq!((friction[2], table.column("tau2_offset_Nm")), (0.0, vec![0.0; 3]), "not zero at rest");

    let urdf = folder.path("leg.urdf");
    let arguments = format!("export --model {} --urdf", model.display());
    scarab(&arguments, &[&urdf]).ends_with(0);
    let text = std::fs::read_to_string(&urdf).expect("written");
    assert!(text.contains("Coulomb friction that differs between the directions: 5."), "{text}");
}

#[test]
fn a_dropped_column_is_not_in_the_stored_model() {
    let folder = Folder::new();
    let file = folder.write("leg.toml", &leg().to_toml());
    let model = folder.path("model.toml");
    let json = folder.path("run.json");
    let arguments = format!("identify --leg {} --json {} --save-model", file.display(), json.display());
    scarab(&arguments, &[&model]).ends_with(0);
    let kept = ModelFile::load(&model).expect("a model without the dropped columns");
    for name in ["IA2", "OFF1", "OFF2"] {
        assert!(kept.conditions.not_estimated.iter().any(|other| other == name), "{name}");
        assert!(kept.base_set.parameters.iter().all(|base| base.carrier != name), "{name}");
        let full = kept.full_set.parameters.iter().find(|parameter| parameter.name == name).expect(name);
        assert_eq!((full.value, full.sigma, full.status.as_str()), (Some(0.0), None, "prior"), "{name}");
    }
    assert_eq!(kept.base_set.covariance.len(), 10);
    let report = folder.json("run.json");
    assert_eq!(
        (report["rank"].as_u64(), report["consistent"]["degrees_of_freedom"].as_u64()),
        (Some(10), Some(10))
    );
    // The hip's rotor is only determined in a sum, whatever its value.
    let choices = report["model_choice"].as_array().expect("choices");
    let hip =
        choices.iter().find(|choice| choice["joint"] == 1 && choice["option"] == "rotor").expect("the hip's");
    assert!(hip["used"] == "on" && hip["why"].as_str().is_some_and(|why| why.contains("ZZ1R")), "{hip}");
    scarab(&format!("export --model {} --urdf", model.display()), &[&folder.path("leg.urdf")]).ends_with(0);
}

#[test]
fn one_column_cannot_be_requested_twice() {
    let folder = Folder::new();
    let mut both = LegFile::load(DEFAULT_LEG).expect("shipped");
    both.joints[1].asymmetric_coulomb = Switch::On;
    let file = folder.write("leg.toml", &both.to_toml());
    let refusal = scarab("identify --leg", &[&file]).refusal();
    assert!(refusal.contains("leg.toml:"), "{refusal}");
    assert!(refusal.contains("joint `knee`: `asymmetric_coulomb` is on and so is `offset`"), "{refusal}");
    assert!(refusal.contains("are the same column"), "{refusal}");

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
        let refusal = scarab("identify --leg", &[&folder.write("leg.toml", &text)]).refusal();
        assert!(
            refusal.contains(&format!("unknown variant `{word}`, expected one of `auto`, `on`, `off`")),
            "{refusal}"
        );
    }
}

#[test]
fn the_temperature_is_stored_and_another_one_gives_a_warning() {
    let folder = Folder::new();
    let (model, json) = (folder.path("model.toml"), folder.path("run.json"));
    scarab(&format!("identify --temperature 21.5 --json {} --save-model", json.display()), &[&model])
        .ends_with(0);
    assert_eq!(folder.json("run.json")["temperature_c"], 21.5);
    assert_eq!(ModelFile::load(&model).expect("just written").conditions.temperature_c, Some(21.5));
    let compared = |arguments: &str| {
        let arguments = format!("identify {arguments} --json {} --compare-model", json.display());
        let printed = scarab(&arguments, &[&model]).ends_with(0).printed;
        let warned = folder.json("run.json")["compared"]["warning"].as_str().map(str::to_owned);
        assert_eq!(printed.contains("\nwarning: "), warned.is_some(), "{printed}");
        warned
    };
    assert_eq!((compared("--temperature 30"), compared("")), (None, None));
    assert_eq!(folder.json("run.json")["temperature_c"], Value::Null);
    let warning = compared("--temperature -10").expect("31.5 K");
    assert!(warning.contains("-31.5 K") && warning.contains("+3.5 %"), "{warning}");
    for bad in ["126", "nan", "warm"] {
        let refusal = scarab(&format!("identify --temperature {bad}"), &[]).refusal();
        assert!(refusal.contains("temperature from -40 to 125"), "{refusal}");
    }
}
