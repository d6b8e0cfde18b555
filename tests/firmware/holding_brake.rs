//! A holding brake on the whole firmware with the whole plant: power-up, enabling, stops and restarts.

use hal_sim::faults::{Channel, Form, Injection, Timing};
use scarab::hal::Contacts;
use scarab::leg::Activity;
use scarab::safety::DriveState;
use scarab_identify::formats::leg_file::{BrakeFile, DEFAULT_LEG, LegFile};
use scarab_rig::faulty_board::{PERIODS_PER_S, Rig};
use scarab_rig::options::{DriveModel, SimulationOptions};
use scarab_rig::pair::Context;

/// PWM periods per millisecond and per servo tick.
const MILLISECOND: u64 = PERIODS_PER_S / 1000;
const SERVO_TICK: u64 = 6;
const RELEASE_MS: u64 = 60;
const ENGAGE_MS: u64 = 40;

/// A leg with a brake whose invariants are checked in every period.
struct Braked(Rig<2, 13>);

impl Braked {
    fn new() -> Self {
        let mut leg = LegFile::load(DEFAULT_LEG).expect("shipped");
        leg.brake = Some(BrakeFile { release_ms: RELEASE_MS as f64, engage_ms: ENGAGE_MS as f64 });
        let options = SimulationOptions { drive: DriveModel::Full, ..SimulationOptions::with_seed(1) };
        let context = Context::new(&leg, &options).expect("a leg");
        Self(Rig::new(&leg, &context, 1).expect("a board"))
    }

    fn is_released(&self) -> bool {
        self.0.board.registers.holding_brake
    }

    fn is_off(&self) -> bool {
        self.0.commands().iter().any(|command| !command.enabled)
    }

    fn activity(&self) -> Activity {
        self.0.leg.control().activity()
    }

    /// Runs one period. No bridge is off under a released brake, and no motion is commanded against one that
    /// is engaged.
    fn advance(&mut self) {
        self.0.advance();
        assert!(!(self.is_off() && self.is_released()), "period {}: off and released", self.0.period);
        let moves = self.activity() != Activity::Idle && !self.is_off();
        assert!(!moves || self.is_released(), "period {}: moves and engaged", self.0.period);
    }

    /// Runs until a condition holds; returns the periods.
    fn until(&mut self, holds: impl Fn(&Self) -> bool) -> u64 {
        let begun = self.0.period;
        while !holds(self) {
            self.advance();
            assert!(self.0.period - begun < PERIODS_PER_S, "not within a second");
        }
        self.0.period - begun
    }

    fn run(&mut self, milliseconds: u64) {
        (0..milliseconds * MILLISECOND).for_each(|_| self.advance());
    }

    /// Enables the leg by the switch; the brake is released in the next servo tick.
    fn enabled() -> Self {
        let mut leg = Self::new();
        leg.run(200);
        assert!(!leg.is_released(), "engaged after power-up");
        leg.0.hand.enabling = true;
        leg.until(|leg| !leg.is_off());
        let released = leg.until(Self::is_released);
        assert!((1..=SERVO_TICK).contains(&released), "{released} periods");
        leg
    }

    /// A leg in motion, its brake open.
    fn moving() -> Self {
        let mut leg = Self::enabled();
        leg.run(RELEASE_MS + 1);
        leg.0.hand.start = true;
        leg.until(|leg| leg.activity() != Activity::Idle);
        leg.run(500);
        leg
    }

    fn inject(&mut self, channel: Channel) {
        for joint in 0..2 {
            let timing = Timing::from(self.0.period);
            assert!(self.0.injector.add(Injection { channel, joint, form: Form::Off, timing }));
        }
    }
}

#[test]
fn a_leg_moves_only_with_an_open_brake_and_is_held_at_the_end() {
    let mut leg = Braked::enabled();
    // Pressed while the brake opens, the button is refused.
    leg.0.hand.start = true;
    leg.run(RELEASE_MS - 5);
    assert_eq!((leg.0.state(), leg.activity()), (DriveState::OperationEnabled, Activity::Idle));
    leg.0.hand.start = false;
    leg.run(50);
    leg.0.hand.start = true;
    leg.until(|leg| leg.activity() != Activity::Idle);
    leg.run(500);
    leg.0.hand = Contacts::default();
    let damped = leg.until(|leg| !leg.is_released());
    let closing = leg.until(Braked::is_off);
    let closing_ms = closing as f64 / MILLISECOND as f64;
    assert!((closing_ms - ENGAGE_MS as f64).abs() <= 0.25, "{closing_ms} ms");
    assert!(damped + closing <= 303 * MILLISECOND, "damping is not prolonged: {} periods", damped + closing);
    leg.run(500);
    assert!(!leg.is_released());
}

#[test]
fn a_stop_engages_the_brake_in_the_period_in_which_the_bridges_go_off() {
    for channel in [Channel::EmergencyStop, Channel::Servo, Channel::GateRegisters] {
        let mut leg = Braked::moving();
        leg.inject(channel);
        leg.until(Braked::is_off);
        assert!(!leg.is_released(), "{channel:?}");
        leg.run(100);
        assert!(!leg.is_released(), "{channel:?}");
    }
}

#[test]
fn stopped_current_ticks_engage_the_brake_and_a_restart_keeps_it() {
    let mut leg = Braked::moving();
    leg.inject(Channel::Tick);
    leg.until(|leg| leg.0.commands().iter().all(|command| !command.enabled));
    assert!(!leg.is_released());
    // The watchdog resets the board, which then refuses to enable.
    leg.run(500);
    assert!(!leg.is_released() && leg.is_off());
}
