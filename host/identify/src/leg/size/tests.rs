use crate::formats::leg_file::DEFAULT_LEG;
use crate::leg::size::*;
use crate::leg::x2;

fn default_leg() -> LegFile {
    LegFile::load(DEFAULT_LEG).expect("shipped")
}

fn size(thigh: Option<f64>, shank: Option<f64>, wearer: Option<(f64, f64)>) -> Size {
    Size { thigh, shank, wearer: wearer.map(|(mass, height)| Person { mass, height }) }
}

fn sized(thigh: Option<f64>, shank: Option<f64>, wearer: Option<(f64, f64)>) -> LegFile {
    size(thigh, shank, wearer).apply_to(&default_leg()).expect("within the ranges")
}

#[test]
fn stretching_is_close_to_a_telescope() {
    // The derivation moves the lower parts of the exoskeleton as a whole, the rule stretches the
    // file's body.
    for (mass, height) in [(60.0, 1.65), (75.0, 1.75), (95.0, 2.05)] {
        let ruled = sized(None, None, Some((mass, height)));
        let derived = x2::leg_file_of(&Wearer::from_height(mass, height), 70.0 / 75.0 * mass);
        assert!((ruled.joints[1].dh.a - derived.joints[1].dh.a).abs() < 1e-12);
        for (ruled, derived) in ruled.joints.iter().zip(&derived.joints) {
            for (ruled, derived) in [(ruled.truth, derived.truth), (ruled.prior, derived.prior)] {
                let (ruled, derived) = (ruled.expect("simulated"), derived.expect("simulated"));
                let [mass, hx, hy, zz] = ruled.sums();
                let [mass_derived, hx_derived, hy_derived, zz_derived] = derived.sums();
                // The file has six decimals.
                assert!((mass - mass_derived).abs() < 2e-6 && (hy - hy_derived).abs() < 1e-5);
                // Largest at 29 % more than the file's thigh: 0.6 % of HX, 2.1 % of ZZ.
                assert!((hx / hx_derived - 1.0).abs() < 0.008, "{hx} {hx_derived}");
                assert!((zz / zz_derived - 1.0).abs() < 0.025, "{zz} {zz_derived}");
                assert_eq!(ruled.rotor_inertia, derived.rotor_inertia);
            }
        }
    }
}

#[test]
fn lengths_alone_keep_the_mass_and_stretch_its_positions() {
    let (before, after) = (default_leg(), sized(Some(0.45), Some(0.44), None));
    assert_eq!(after.joints[1].dh.a, 0.45);
    assert_eq!(after.segments.expect("kept").shank_m, 0.44);
    for (joint, stretch) in [(0, 0.45 / 0.39), (1, 0.44 / 0.40)] {
        let (old, new) =
            (before.joints[joint].truth.expect("there"), after.joints[joint].truth.expect("there"));
        assert_eq!(old.mass, new.mass);
        assert!((new.com[0] / old.com[0] - stretch).abs() < 1e-12);
        assert_eq!(
            (old.com[1], old.rotor_inertia, old.coulomb),
            (new.com[1], new.rotor_inertia, new.coulomb)
        );
        // About the long axis only the inertia across it changes.
        assert!((new.inertia_com[0] - old.inertia_com[0]).abs() < 1e-12);
        // The integral of x2 dm about the centre of mass, (YY + ZZ - XX) / 2, is stretched twice.
        let spread = |link: &LinkParameters| link.inertia_com[3] + link.inertia_com[5] - link.inertia_com[0];
        assert!((spread(&new) / spread(&old) - stretch * stretch).abs() < 1e-12);
    }
}

#[test]
fn the_prior_of_another_wearer_keeps_its_relative_error() {
    let leg = sized(None, None, Some((90.0, 1.8)));
    let segments = leg.segments.expect("kept");
    assert_eq!(segments.wearer_kg, 90.0);
    assert!((segments.prior_wearer_kg - 84.0).abs() < 1e-12);
    // The exoskeleton's 2.84 kg are in both; 10 % of 90 kg and of 84 kg belong to the wearer.
    let mass = |link: &Option<LinkParameters>| link.expect("there").mass;
    assert!((mass(&leg.joints[0].truth) - 11.84).abs() < 1e-6);
    assert!((mass(&leg.joints[0].prior) - 11.24).abs() < 1e-6);
}

#[test]
fn every_size_in_the_range_gives_a_valid_leg_file() {
    for thigh in [0.402, 0.45, 0.505] {
        for shank in [0.397, 0.506] {
            for wearer in [None, Some((30.0, 1.65)), Some((160.0, 2.05))] {
                let leg = sized(Some(thigh), Some(shank), wearer);
                assert_eq!(LegFile::parse(&leg.to_toml(), "sized").as_ref(), Ok(&leg));
            }
        }
    }
}

#[test]
fn without_options_the_leg_is_unchanged() {
    assert_eq!(Size::default().apply_to(&default_leg()).expect("unchanged"), default_leg());
}

#[test]
fn impossible_sizes_are_refused_with_option_and_range() {
    let refusal = |size: Size, leg: &LegFile| size.apply_to(leg).expect_err("refused").to_string();
    let leg = default_leg();
    for (size, reason) in [
        (size(Some(0.39), None, None), "--thigh 0.39 is outside 0.402..0.505 m"),
        (size(Some(f64::NAN), None, None), "--thigh NaN is outside"),
        (size(None, Some(0.6), None), "--shank 0.6 is outside 0.397..0.506 m"),
        (
            size(None, None, Some((60.0, 1.55))),
            "--wearer 60,1.55: a thigh of 0.380 m is outside 0.402..0.505 m",
        ),
        // With the thigh given, the shank is still too short.
        (size(Some(0.402), None, Some((60.0, 1.55))), "--wearer 60,1.55: a shank of 0.381 m is outside"),
    ] {
        let text = refusal(size, &leg);
        assert!(text.contains(reason), "{text}");
    }
    let sp = LegFile::load("sp").expect("shipped");
    let text = refusal(size(Some(0.45), None, None), &sp);
    assert!(text.contains("sp: --thigh, --shank and --wearer need the key `segments`"), "{text}");
    let mut heavy = default_leg();
    heavy.segments.as_mut().expect("there").wearer_kg = 150.0;
    let text = refusal(size(None, None, Some((80.0, 1.8))), &heavy);
    assert!(text.contains("joint `hip`: its link is lighter than the thigh of a wearer of 150 kg"), "{text}");
    for (text, reason) in [
        ("80", "is not KG,M"),
        ("80,x", "is not KG,M"),
        ("800,1.8", "a body mass of 800 kg"),
        ("80,180", "a height of 180 m"),
        ("nan,1.8", "a body mass of NaN kg"),
    ] {
        assert!(text.parse::<Person>().expect_err("refused").contains(reason), "{text}");
    }
}
