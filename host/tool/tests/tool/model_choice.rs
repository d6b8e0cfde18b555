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
    let options: Vec<_> = seeds.map(SimulationOptions::of_seed).collect();
    identify_many::<2, 13>(leg, &options).expect("it runs")
}

/// Default leg with this switch for rotor and offset of both joints, this offset in both, and optionally no
/// rotor in the knee. Prior and servo match: a loop that expects a rotor shakes a joint without one.
fn leg(switch: Switch, without_rotor: bool, offset: f64) -> LegFile {
    let mut leg = LegFile::load(DEFAULT_LEG).expect("shipped");
    for joint in &mut leg.joints {
        (joint.rotor, joint.offset) = (switch, switch);
        joint.truth.as_mut().expect("simulated").offset = offset;
    }
    if without_rotor {
        let knee = &mut leg.joints[1];
        knee.truth.iter_mut().chain(&mut knee.prior).for_each(|link| link.rotor_inertia = 0.0);
    }
    leg
}

fn choice<'a>(run: &'a RunReport, joint: usize, option: &str) -> &'a ModelChoiceReport {
    let found = run.model_choice.iter().find(|choice| (choice.joint, choice.option) == (joint, option));
    found.expect("every option of every joint")
}

fn sigma(run: &RunReport, name: &str) -> f64 {
    let found = run.base_parameters.iter().find(|base| base.name == name).expect(name);
    found.sigma.known().expect("determined")
}

#[test]
fn absent_rotor_and_offset_are_dropped_and_other_sigmas_fall() {
    dropped(1, 2);
}

#[test]
#[ignore = "campaign: .ci/full"]
fn absent_rotor_and_offset_are_dropped_with_20_seeds() {
    dropped(3, 20);
}

fn dropped(on_seeds: u64, seeds: u64) {
    let kept_on = runs(&leg(Switch::On, true, 0.0), 1..=on_seeds);
    let chosen = runs(&leg(Switch::Auto, true, 0.0), 1..=seeds);
    let candidates = [(2, "rotor"), (1, "offset"), (2, "offset")];
    let mut kept = 0;
    for run in &chosen {
        assert!(run.accepted(), "seed {:?}: {:?}", run.seed, run.reasons);
        for (joint, option) in candidates {
            let found = choice(run, joint, option);
            kept += usize::from(found.used == "on");
            assert_eq!(found.used == "on", found.gain_chi2.known() >= Some(9.0), "{found:?}");
        }
    }
    // 0.27 % of 60 is 0.16; three or more occur in one of 1,500 choices of seeds.
    assert!(kept <= 2, "{kept} of {} kept", 3 * seeds);
    for (on, auto) in kept_on.iter().zip(&chosen) {
        if auto.rank == 10 {
            // A hip offset resembles HY1, the knee's rotor its link's inertia.
            // Measured: 0.064 and 0.65 of it.
            assert!(sigma(auto, "HY1") < 0.1 * sigma(on, "HY1"));
            assert!(sigma(auto, "ZZ2") < 0.8 * sigma(on, "ZZ2"));
            assert_eq!((on.rank, auto.base_parameters.len(), auto.columns), (13, 10, on.columns - 3));
        }
    }
    // The hip's rotor is only determined in a sum, whatever its value.
    let hip = choice(&chosen[0], 1, "rotor");
    assert!(hip.used == "on" && hip.why.contains("ZZ1R"), "{hip:?}");
}

#[test]
fn present_rotor_and_offset_are_estimated_as_with_on() {
    estimated(1);
}

#[test]
#[ignore = "campaign: .ci/full"]
fn present_rotor_and_offset_are_estimated_with_five_seeds() {
    estimated(5);
}

fn estimated(seeds: u64) {
    // 6 N m are eight standard deviations of the hip's offset, the weakest of the terms.
    let of = |switch| runs(&leg(switch, false, 6.0), 1..=seeds);
    for (auto, on) in of(Switch::Auto).into_iter().zip(of(Switch::On)) {
        for (joint, option) in [(2, "rotor"), (1, "offset"), (2, "offset")] {
            assert_eq!(choice(&auto, joint, option).used, "on", "{option} of joint {joint}");
        }
        // The choice takes a tick, so the held-out motions begin one tick later and have another noise.
        let found = |run: &RunReport| {
            (run.base_parameters.clone(), run.parameters.clone(), run.least_squares.clone(), run.bso.clone())
        };
        assert_eq!(found(&auto), found(&on));
        assert_eq!((&auto.consistent, &auto.training), (&on.consistent, &on.training));
    }
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
    let file = folder.write("leg.toml", &leg(Switch::Auto, true, 0.0).to_toml());
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
