//! Robot descriptions of others become leg files: torque against Pinocchio, refusals, hostile texts.

use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::formats::leg_file::geometry::{anatomy, chain};
use scarab_identify::formats::robot::Robot;
use scarab_identify::leg::from_robot::{FromRobot, RobotOptions, leg};
use scarab_identify::leg::setup::links;
use std::time::{Duration, Instant};

use crate::command::{Folder, assert_contains, scarab};
use nalgebra::Vector3;
use scarab::ident::prior_parameters;
use scarab::model::{JointState, rigid_body_torques};
use serde::Deserialize;

/// Robots with torques by Pinocchio 4.1.0; `scripts/robot_vectors.py` writes them.
const ROBOTS: &str = include_str!("../data/robots.json");

#[derive(Deserialize)]
pub struct Vectors {
    pub robots: Vec<Described>,
}

#[derive(Deserialize)]
pub struct Described {
    pub name: String,
    pub urdf: String,
    pub joints: Vec<String>,
    pub lock: std::collections::BTreeMap<String, f64>,
    pub gravity: [f64; 3],
    pub states: Vec<State>,
}

#[derive(Deserialize)]
pub struct State {
    pub q: Vec<f64>,
    pub qd: Vec<f64>,
    pub qdd: Vec<f64>,
    pub torque: Vec<f64>,
}

pub fn vectors() -> Vec<Described> {
    serde_json::from_str::<Vectors>(ROBOTS).expect("written by the script").robots
}

pub fn options(robot: &Described) -> RobotOptions {
    RobotOptions {
        joints: robot.joints.clone(),
        locked: robot.lock.iter().map(|(name, at)| (name.clone(), *at)).collect(),
        gravity: Vector3::from(robot.gravity),
        parallel_rad: 0.0,
        with_prior: true,
    }
}

/// Options of a description whose joints that turn are the leg.
pub fn plain() -> RobotOptions {
    RobotOptions {
        joints: Vec::new(),
        locked: Vec::new(),
        gravity: Vector3::new(0.0, 0.0, -9.81),
        parallel_rad: 0.0,
        with_prior: true,
    }
}

fn converted(urdf: &str, options: &RobotOptions) -> Result<FromRobot, String> {
    let robot = Robot::parse(urdf, "robot.urdf").map_err(|error| error.to_string())?;
    leg(&robot, options).map_err(|error| error.to_string())
}

/// Anatomical torques of a leg's prior, rigid bodies only.
pub fn torques<const N: usize>(leg: &LegFile, state: &State) -> [f64; N] {
    let (chain, anatomy) = (chain::<N>(leg).expect("N joints"), anatomy::<N>(leg).expect("checked"));
    let bodies = prior_parameters(&links::<N>(leg, |joint| joint.prior.as_ref()).expect("every joint"));
    let state = JointState {
        q: core::array::from_fn(|joint| anatomy[joint].angle_to_chain(state.q[joint])),
        qd: core::array::from_fn(|joint| anatomy[joint].to_chain(state.qd[joint])),
        qdd: core::array::from_fn(|joint| anatomy[joint].to_chain(state.qdd[joint])),
    };
    let torques = rigid_body_torques(&chain, &bodies, &state, &Vector3::from(leg.gravity));
    core::array::from_fn(|joint| anatomy[joint].from_chain(torques[joint]))
}

/// Largest difference of torque over the largest torque of the states.
fn error(leg: &LegFile, states: &[State]) -> f64 {
    let largest =
        states.iter().flat_map(|state| &state.torque).fold(0.0, |most: f64, one| most.max(one.abs()));
    let mut worst = 0.0_f64;
    for state in states {
        let found: Vec<f64> = match leg.joints.len() {
            1 => torques::<1>(leg, state).into(),
            2 => torques::<2>(leg, state).into(),
            _ => torques::<3>(leg, state).into(),
        };
        for (found, expected) in found.iter().zip(&state.torque) {
            worst = worst.max((found - expected).abs() / largest);
        }
    }
    worst
}

#[test]
fn the_leg_file_of_a_robot_gives_the_torque_of_pinocchio() {
    let robots = vectors();
    assert_eq!(robots.len(), 16);
    for robot in &robots {
        let found =
            converted(&robot.urdf, &options(robot)).unwrap_or_else(|error| panic!("{}: {error}", robot.name));
        // The file, not the numbers in memory.
        let leg = LegFile::parse(&found.text, "leg.toml").expect("a leg file");
        assert_eq!(leg, found.leg);
        assert_eq!(
            leg.joints.iter().map(|joint| &joint.name).collect::<Vec<_>>(),
            robot.joints.iter().collect::<Vec<_>>()
        );
        let error = error(&leg, &robot.states);
        // Rounding: measured 2e-15 at most.
        assert!(error < 1e-13, "{}: {error:e}\n{}", robot.name, found.text);
    }
}

#[test]
fn parallel_axes_become_planar_numbers_with_direction() {
    for robot in vectors()
        .iter()
        .filter(|robot| robot.name.starts_with("opposite") || robot.name.starts_with("parallel"))
    {
        let leg = converted(&robot.urdf, &options(robot)).expect("a leg").leg;
        for joint in &leg.joints {
            assert_eq!((joint.dh.alpha, joint.dh.d), (0.0, 0.0), "{}: {:?}", robot.name, joint.dh);
        }
        let directions: Vec<_> = leg.joints.iter().map(|joint| joint.direction).collect();
        let expected: &[i64] = if robot.name.starts_with("parallel") { &[1, 1, 1] } else { &[1, -1, 1] };
        assert_eq!(directions, expected[..directions.len()], "{}", robot.name);
    }
}

/// Leg of two parallel joints; the placeholders of a test replace parts.
pub const SIMPLE: &str = r#"<?xml version="1.0"?>
<robot name="arm">
  <link name="base"/>
  <link name="thigh">
    <inertial><origin xyz="0 0 -0.2"/><mass value="5"/>
      <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.02"/></inertial>
  </link>
  <link name="shank">
    <inertial><origin xyz="0 0 -0.2"/><mass value="3"/>
      <inertia ixx="0.05" ixy="0" ixz="0" iyy="0.05" iyz="0" izz="0.01"/></inertial>
  </link>
  <joint name="hip" type="revolute">
    <parent link="base"/><child link="thigh"/><origin xyz="0 0 1" rpy="0 0 0"/><axis xyz="0 -1 0"/>
    <limit lower="-0.5" upper="1.5" effort="80" velocity="4"/><dynamics damping="1.25" friction="3.5"/>
  </joint>
  <joint name="knee" type="revolute">
    <parent link="thigh"/><child link="shank"/><origin xyz="0 0 -0.4" rpy="0 0 0"/><axis xyz="0 1 0"/>
    <limit lower="0" upper="2" effort="60" velocity="5"/><dynamics damping="0.75" friction="2.5"/>
  </joint>
</robot>
"#;

fn with(from: &str, to: &str) -> String {
    assert!(SIMPLE.contains(from), "{from}");
    SIMPLE.replacen(from, to, 1)
}

#[test]
fn limits_friction_and_gravity_are_those_of_the_description() {
    let found = converted(SIMPLE, &plain()).expect("a leg");
    let [hip, knee] = &found.leg.joints[..] else { panic!("two joints") };
    // The base's x points to the knee, which hangs below the hip.
    assert_eq!(found.leg.gravity, [9.81, 0.0, 0.0]);
    assert_eq!((knee.dh.a, knee.direction, hip.direction), (0.4, -1, 1));
    assert_eq!(hip.range_deg, [-0.5_f64, 1.5].map(f64::to_degrees));
    assert_eq!((hip.torque_limit_nm, knee.torque_limit_nm), (80.0, 60.0));
    assert_eq!(knee.speed_limit_deg_s, 5.0_f64.to_degrees());
    let prior = hip.prior.expect("a body");
    assert_eq!((prior.mass, prior.coulomb, prior.viscous), (5.0, 3.5, 1.25));
    assert!((prior.com[0] - 0.2).abs() < 1e-15 && prior.com[1].abs() < 1e-15, "{:?}", prior.com);
    assert!(found.remarks.is_empty(), "{:?}", found.remarks);
    // What the description does not know is not stated.
    for key in ["torque_per_ampere", "encoder", "side", "acceleration_limit_deg_s2"] {
        assert_contains(&found.text, &format!("\n# {key} = "));
    }
}

#[test]
fn a_leg_file_holds_short_numbers_where_the_description_does() {
    // Turned frames and a tilted axis leave rounding in every number of the conversion.
    let text = with("xyz=\"0 0 -0.4\" rpy=\"0 0 0\"", "xyz=\"0.3 0 -0.4\" rpy=\"0 0.7 0\"");
    let found = converted(&text, &plain()).expect("a leg");
    let [hip, knee] = &found.leg.joints[..] else { panic!("two joints") };
    assert_eq!((knee.dh.a, knee.dh.d, knee.dh.alpha), (0.5, 0.0, 0.0), "{}", found.text);
    assert_eq!(hip.prior.expect("a body").com, [0.16, -0.12, 0.0], "{}", found.text);
    for noise in ["00000000", "99999999"] {
        assert!(!found.text.contains(noise), "{noise}: {}", found.text);
    }
}

#[test]
fn a_range_beyond_a_turn_is_narrowed_to_what_the_firmware_takes() {
    let text = with("lower=\"-0.5\" upper=\"1.5\"", "lower=\"-10\" upper=\"10\"")
        .replace("lower=\"0\" upper=\"2\"", "lower=\"-6.28318530718\" upper=\"6.28318530718\"");
    let found = converted(&text, &plain()).expect("a leg");
    assert_eq!(found.leg.joints[0].range_deg, [-360.0, 360.0]);
    assert_eq!(found.leg.joints[1].range_deg, [-360.0, 360.0]);
    // A turn written with twelve digits needs no remark.
    let [remark] = &found.remarks[..] else { panic!("one remark: {:?}", found.remarks) };
    assert!(
        remark.starts_with("joint `hip`: `limit` is -573.0 to 573.0 degrees, narrowed to -360.0"),
        "{remark}"
    );
}

#[test]
fn a_range_that_looks_like_degrees_is_doubted() {
    let text = with("lower=\"-0.5\" upper=\"1.5\"", "lower=\"-20\" upper=\"120\"");
    let found = converted(&text, &plain()).expect("a leg");
    let [remark] = &found.remarks[..] else { panic!("one remark: {:?}", found.remarks) };
    assert!(remark.ends_with("Are its numbers degrees? A URDF states rad"), "{remark}");
    let text = with("lower=\"-0.5\" upper=\"1.5\"", "lower=\"-10\" upper=\"10\"");
    assert!(!converted(&text, &plain()).expect("a leg").remarks.concat().contains("degrees?"));
}

#[test]
fn values_that_a_leg_file_cannot_hold_are_left_out_with_a_remark() {
    let text = with("effort=\"80\" velocity=\"4\"", "effort=\"0\" velocity=\"1000\"")
        .replace("lower=\"0\" upper=\"2\"", "lower=\"0\" upper=\"0\"");
    let found = converted(&text, &plain()).expect("a leg");
    for remark in [
        "joint `hip`: `limit` has effort = 0, a leg file takes above 0, to 1000: left out",
        "joint `hip`: `limit` has velocity = 1000, a leg file takes above 0, to 48.8",
        "joint `knee`: `limit` is 0 to 0 degrees",
    ] {
        assert!(found.remarks.iter().any(|found| found.starts_with(remark)), "{remark}: {:?}", found.remarks);
    }
    for key in ["speed_limit_deg_s", "torque_limit_nm", "range_deg"] {
        assert_contains(&found.text, &format!("\n# {key} = "));
    }
}

#[test]
fn rounded_parallel_axes_are_refused_until_they_are_declared_parallel() {
    // A right angle with five digits: the axes meet 109 km away.
    let text = with(
        "xyz=\"0 0 -0.4\" rpy=\"0 0 0\"/><axis xyz=\"0 1 0\"",
        "xyz=\"0 0 -0.4\" rpy=\"1.5708 0 0\"/><axis xyz=\"0 0 -1\"",
    );
    let text = text.replace(
        "<origin xyz=\"0 0 -0.2\"/><mass value=\"3\"/>",
        "<origin xyz=\"0 -0.2 0\" rpy=\"-1.5708 0 0\"/><mass value=\"3\"/>",
    );
    let refused = converted(&text, &plain()).expect_err("no common normal nearby");
    for word in [
        "robot.urdf:16: joint `knee`: its axis is 3.7e-6 rad from parallel to that of `hip`",
        "3.7e-6 rad from parallel to that of `hip`",
        "--parallel 7e-6",
    ] {
        assert_contains(&refused, word);
    }
    let found = converted(&text, &RobotOptions { parallel_rad: 7e-6, ..plain() }).expect("declared parallel");
    assert_eq!((found.leg.joints[1].dh.alpha, found.leg.joints[1].dh.d), (0.0, 0.0));
    assert!(
        found.remarks[0].contains("3.7e-6 rad from parallel to that of `hip` and taken as parallel"),
        "{:?}",
        found.remarks
    );
    // Axes that meet within the format's lengths are converted as they are, with a remark.
    let near = text.replace("xyz=\"0 0 -0.4\"", "xyz=\"0 0 0\"");
    let kept = converted(&near, &plain()).expect("intersecting axes");
    assert!(kept.leg.joints[1].dh.alpha.abs() > 3e-6, "{:?}", kept.leg.joints[1].dh);
    assert!(
        kept.remarks[0].contains("if its `rpy` is rounded, --parallel 7e-6 takes it as parallel"),
        "{:?}",
        kept.remarks
    );
    // The torque differs by about that angle.
    let exact = converted(SIMPLE, &plain()).expect("a leg").leg;
    let state = State { q: vec![0.3, 0.7], qd: vec![1.0, -2.0], qdd: vec![5.0, 9.0], torque: vec![] };
    let [one, other] = [torques::<2>(&exact, &state), torques::<2>(&found.leg, &state)];
    for (one, other) in one.iter().zip(&other) {
        assert!((one - other).abs() < 2e-5 * one.abs(), "{one} {other}");
    }
}

/// The simple robot with an ankle.
fn ankle(kind: &str) -> String {
    let joint = format!(
        "<link name=\"foot\"/><joint name=\"ankle\" type=\"{kind}\"><parent link=\"shank\"/><child link=\"foot\"/></joint>\n</robot>"
    );
    SIMPLE.replace("</robot>", &joint)
}

fn joints(names: &[&str]) -> RobotOptions {
    RobotOptions { joints: names.iter().map(|name| (*name).to_owned()).collect(), ..plain() }
}

/// Joints chosen of the simple robot, each with the words of the refusal.
const CHOICES: [(&[&str], &str); 6] = [
    (&["knee", "hip"], "joint `knee`: hangs on `hip`: name the joints proximal first"),
    (&["hip", "hip"], "joint `hip`: is named twice by --joints"),
    (
        &["hip", "kne"],
        "--joints: no joint is called `kne`. Joints that move, from the root on:\n  hip (revolute)\n  knee (revolute, on hip)",
    ),
    (&["knee"], "joint `hip`: moves the leg and is neither chosen nor held"),
    (&["hip"], "joint `knee`: moves the leg and is neither chosen nor held"),
    (&["hip", "knee", "a", "b"], "no joint is called `a`"),
];

/// Replacements in the simple robot, each with the words of the refusal.
const REPLACEMENTS: [(&str, &str, &str); 5] = [
    (
        "<dynamics damping=\"0.75\"",
        "<mimic joint=\"hip\"/><dynamics damping=\"0.75\"",
        "joint `knee`: follows another joint (`mimic`)",
    ),
    (
        "xyz=\"0 0 -0.4\"",
        "xyz=\"0 0 -400\"",
        "joint `knee`: D-H `a` from joint `hip` is 4.0000e2 m, a leg file takes -5..5: is `xyz` in metres?",
    ),
    ("izz=\"0.02\"", "izz=\"0.5\"", "`prior.inertia_com` is impossible: a principal moment of 0.5"),
    (
        "damping=\"1.25\"",
        "damping=\"-1\"",
        "joint `hip`: `damping` of `dynamics` is -1; it must not be negative",
    ),
    ("damping=\"1.25\"", "damping=\"5000\"", "`prior.viscous` is 5000, outside 0..1000"),
];

#[test]
fn every_joint_that_is_no_leg_is_refused_by_name() {
    let both = || joints(&["hip", "knee"]);
    let lock = |name: &str, at: f64| RobotOptions { locked: vec![(name.to_owned(), at)], ..both() };
    let cases = [
        (
            ankle("revolute"),
            both(),
            "joint `ankle`: moves the leg and is neither chosen nor held: choose it (--joints), or hold at a position \
             in rad or m, for example\n  --lock ankle=0",
        ),
        (ankle("floating"), both(), "joint `ankle`: is floating and moves the leg, and cannot be held"),
        (
            ankle("floating"),
            lock("ankle", 0.0),
            "joint `ankle`: is floating: --lock holds joints that turn or slide",
        ),
        (ankle("fixed"), lock("ankle", 0.0), "joint `ankle`: is fixed"),
        (
            ankle("prismatic"),
            joints(&["hip", "knee", "ankle"]),
            "joint `ankle`: is prismatic; a leg's joints are revolute or continuous. Joints that move, from the root on:\n  \
             hip (revolute)\n  knee (revolute, on hip)\n  ankle (prismatic, on knee)",
        ),
        (ankle("screw"), plain(), "joint `ankle`: `type` is `screw`, not one of revolute"),
        (ankle("revolute"), plain(), "joint `ankle`: the links that it moves have no mass"),
        (SIMPLE.into(), lock("knee", 0.5), "joint `knee`: is both chosen (--joints) and held (--lock)"),
        (
            SIMPLE.into(),
            RobotOptions { joints: vec!["hip".into()], ..lock("knee", 2.5) },
            "joint `knee`: --lock holds it at 2.5, outside its limits 0..2",
        ),
        (SIMPLE.replace("type=\"revolute\"", "type=\"fixed\""), plain(), "0 joints turn, a leg has 1 to 3"),
    ];
    let choices = CHOICES.map(|(names, reason)| (SIMPLE.to_owned(), joints(names), reason));
    let replaced = REPLACEMENTS.map(|(from, to, reason)| (with(from, to), plain(), reason));
    for (text, options, reason) in cases.into_iter().chain(choices).chain(replaced) {
        let refused = converted(&text, &options).expect_err(reason);
        assert!(refused.starts_with("robot.urdf:") && refused.contains(reason), "{reason}: {refused}");
    }
}

#[test]
fn all_joints_to_be_held_are_named_at_once_each_at_a_position_within_its_range() {
    let crowd = SIMPLE.replace(
        "</robot>",
        "<link name=\"foot\"/><joint name=\"ankle roll\" type=\"revolute\"><parent link=\"shank\"/><child link=\"foot\"/>\
         <limit lower=\"0.2\" upper=\"0.5\"/></joint>\
         <link name=\"toe\"/><joint name=\"toes\" type=\"continuous\"><parent link=\"foot\"/><child link=\"toe\"/></joint>\
         <link name=\"hand\"/><joint name=\"aside\" type=\"revolute\"><parent link=\"base\"/><child link=\"hand\"/></joint></robot>",
    );
    let refused = converted(&crowd, &joints(&["knee"])).expect_err("three joints are loose");
    assert_contains(
        &refused,
        "joint `hip`: moves the leg and is neither chosen nor held, and so are `ankle roll`, `toes`: choose them \
             (--joints), or hold at a position in rad or m, for example\n  --lock hip=0 --lock 'ankle roll=0.35' --lock toes=0",
    );
    let held = [("hip", 0.0), ("ankle roll", 0.35), ("toes", 0.0)].map(|(name, at)| (name.to_owned(), at));
    let held = RobotOptions { locked: held.into(), ..joints(&["knee"]) };
    assert_eq!(converted(&crowd, &held).expect("as proposed").leg.joints[0].name, "knee");
}

#[test]
fn fixed_and_held_joints_and_bodies_left_out_are_accepted() {
    // Many robots state an axis of length 0 at joints that do not move.
    let welded =
        ankle("fixed").replace("<child link=\"foot\"/>", "<child link=\"foot\"/><axis xyz=\"0 0 0\"/>");
    converted(&welded, &plain()).expect("the axis has no meaning");
    converted(SIMPLE, &RobotOptions { locked: vec![("knee".into(), 0.5)], ..joints(&["hip"]) })
        .expect("a pendulum");
    converted(&ankle("revolute"), &RobotOptions { with_prior: false, ..plain() })
        .expect("no bodies, three joints");
}

#[test]
fn every_broken_description_is_refused_with_line_and_element() {
    let cases = [
        (String::new(), "robot.urdf: is empty"),
        ("<urdf/>".into(), "robot.urdf:1: the first element is `urdf`; a robot description (URDF) has `robot`"),
        ("<robot name=\"a\">".into(), "is not XML"),
        ("<robot name=\"a\"/>".into(), "has no `link`"),
        (SIMPLE[..SIMPLE.len() / 2].into(), "is not XML"),
        (with("<mass value=\"5\"/>", ""), "robot.urdf:5: link `thigh`: `inertial` has no `mass`"),
        (with("<mass value=\"5\"/>", "<mass/>"), "link `thigh`: `mass` has no `value`"),
        (with("<mass value=\"5\"/>", "<mass value=\"5\"/><mass value=\"6\"/>"), "link `thigh`: has two `mass`"),
        (with("value=\"5\"", "value=\"-5\""), "`mass` is -5 kg; it must not be negative"),
        (with("value=\"5\"", "value=\"5 kg\""), "`value` of `mass` is `5 kg`, not one number"),
        (with("value=\"5\"", "value=\"nan\""), "`value` of `mass` is NaN, outside"),
        (with("value=\"5\"", "value=\"1e999\""), "`value` of `mass` is inf, outside"),
        (with("ixy=\"0\"", ""), "link `thigh`: `inertia` has no `ixy`"),
        (with("xyz=\"0 0 -0.4\"", "xyz=\"0 0\""), "robot.urdf:17: joint `knee`: `xyz` of `origin` is `0 0`, not 3 numbers"),
        (with("xyz=\"0 0 -0.4\"", "xyz=\"0 0 0 0\""), "not 3 numbers"),
        (with("xyz=\"0 0 -0.4\"", "xyz=\"${leg} 0 0\""), "is a macro of xacro: expand the file first"),
        (with("<axis xyz=\"0 1 0\"/>", "<axis xyz=\"0 0 0\"/>"), "joint `knee`: `axis` has no direction"),
        (with("<child link=\"shank\"/>", "<child link=\"thigh\"/>"), "joint `knee`: parent and child are the same link"),
        (with("<child link=\"shank\"/>", "<child link=\"foot\"/>"), "joint `knee`: `child` is `foot`, which is no link"),
        (with("<child link=\"shank\"/>", "<child link=\"base\"/>"), "joint `hip`: no chain leads to it from the root `shank`"),
        (SIMPLE.replace("</robot>", "<link name=\"spare\"/></robot>"), "2 links are moved by no joint (`base`, `spare`): only the root may be"),
        (with("<parent link=\"base\"/>", "<parent link=\"shank\"/>"), "joint `hip`: no chain leads to it from the root `base`"),
        (with("<parent link=\"base\"/>", ""), "joint `hip`: has no `parent`"),
        (with("name=\"knee\"", "name=\"hip\""), "joint `hip`: is the name of an earlier joint"),
        (with("link name=\"shank\"", "link name=\"thigh\""), "link `thigh`: is the name of an earlier link"),
        (with("name=\"knee\"", ""), "a `joint` has no `name`"),
        (
            SIMPLE.replace("</robot>", "<joint name=\"loop\" type=\"fixed\"><parent link=\"base\"/><child link=\"shank\"/></joint></robot>"),
            "joint `loop`: moves link `shank`, which joint `knee` moves already",
        ),
    ];
    for (text, reason) in cases {
        let refused = converted(&text, &plain()).expect_err(reason);
        assert!(refused.starts_with("robot.urdf:") && refused.contains(reason), "{reason}: {refused}");
    }
}

#[test]
fn bombs_and_endless_nesting_end_in_a_sentence() {
    let begin = Instant::now();
    let mut bomb = String::from("<!DOCTYPE robot [<!ENTITY a0 \"ha\">");
    for level in 1..30 {
        bomb += &format!("<!ENTITY a{level} \"{}\">", format!("&a{};", level - 1).repeat(20));
    }
    bomb += "]><robot name=\"&a29;\"><link name=\"a\"/></robot>";
    let refused = converted(&bomb, &plain()).expect_err("entities");
    assert_contains(&refused, "has a document type (`<!DOCTYPE`): entities are not expanded");
    let outside = "<!DOCTYPE robot [<!ENTITY a SYSTEM \"file:///etc/passwd\">]><robot name=\"&a;\"/>";
    assert!(converted(outside, &plain()).expect_err("entities").contains("<!DOCTYPE"));
    let nested = "<robot>".repeat(200_000);
    assert!(converted(&nested, &plain()).expect_err("open elements").contains("is not XML"));
    let closed = format!("{}{}", "<robot>".repeat(200_000), "</robot>".repeat(200_000));
    assert!(converted(&closed, &plain()).expect_err("no links").contains("has no `link`"));
    let crowd = format!("<robot>{}</robot>", "<a/>".repeat(1_100_000));
    assert!(converted(&crowd, &plain()).expect_err("elements").contains("more than 1000000 elements"));
    let huge = " ".repeat((16 << 20) + 1);
    assert!(converted(&huge, &plain()).expect_err("size").contains("at most 16777216 are read"));
    // A chain of fixed joints; each link and joint has a line of its own.
    let mut long = String::from("<robot name=\"long\">\n<link name=\"l0\"/>\n");
    for link in 1..40_000 {
        long += &format!(
            "<link name=\"l{link}\"/>\n<joint name=\"j{link}\" type=\"fixed\"><parent link=\"l{}\"/><child link=\"l{link}\"/></joint>\n",
            link - 1
        );
    }
    long += "</robot>";
    assert!(converted(&long, &plain()).expect_err("no joint turns").contains("0 joints turn"));
    assert!(begin.elapsed() < Duration::from_secs(300), "{:?}", begin.elapsed());
}

#[test]
fn the_command_writes_a_leg_that_every_other_command_takes_and_overwrites_nothing() {
    let folder = Folder::new();
    folder.write("robot.urdf", SIMPLE);
    let run = folder.scarab("leg --joints hip,knee --urdf @robot.urdf --out @leg.toml").ends_with(0);
    let begin = format!("leg file: {}\n", folder.path("leg.toml").display());
    assert!(run.printed.starts_with(&begin), "{}", run.printed);
    folder.write("states.csv", "q1,qd1,qdd1,q2,qd2,qdd2\n0.3,1,5,0.7,-2,9\n");
    folder.scarab("regressor --leg @leg.toml --states @states.csv").ends_with(0);
    let text = folder.read("leg.toml");
    folder
        .scarab("leg --urdf @robot.urdf --out @leg.toml")
        .refuses("exists and is not overwritten: name another file, or remove it first");
    assert_eq!(folder.read("leg.toml"), text);
    folder.scarab("leg --urdf @robot.urdf --out @robot.urdf").refuses("is the same file as --urdf");
    for (arguments, reason) in [
        ("--lock knee", "is not NAME=POSITION"),
        ("--lock knee=nan", "is not a position"),
        ("--gravity 1,2", "is not three numbers X,Y,Z"),
        ("--gravity 0,0,-981", "is not three numbers X,Y,Z from -30 to 30"),
        ("--parallel 1", "is not an angle from 0 to 0.01 rad"),
        ("--check sp", "cannot be used with"),
    ] {
        folder.scarab(&format!("leg --urdf @robot.urdf --out @no.toml {arguments}")).refuses(reason);
    }
    let none = scarab("leg").refusal();
    assert_contains(&none, "--urdf");
    assert_contains(&none, "--new");
    assert_contains(&none, "--check");
}
