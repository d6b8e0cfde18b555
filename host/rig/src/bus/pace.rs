//! Real-time pace of the simulation, and the report of delays.

use std::time::{Duration, Instant};

use scarab::bus::Frame;

use crate::bus::board::TICK_NS;
use crate::bus::network::Network;

/// Delay beyond which the simulation skips the missing time.
const MOST_LATE: Duration = Duration::from_millis(100);
/// Delay and speed deviation that are reported.
const LATE: Duration = Duration::from_millis(10);
const SPEED_DIFFERS: f64 = 0.01;
const SECOND: Duration = Duration::from_secs(1);
/// Length of the speed measurement in chunks and their ticks: 0.2 s.
const CHUNKS: u32 = 20;
const CHUNK_TICKS: u32 = 40;
/// Ticks for each step of enabling before it.
const STEP_TICKS: u32 = 20;
/// Ticks after which all nodes have sent their boot-up messages.
pub(crate) const BOOT_TICKS: u32 = 20;

/// Figures of one second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Second {
    /// Simulated seconds per second.
    pub speed: f64,
    /// Largest delay behind the clock.
    pub(crate) late: Duration,
    /// Time of the clock that was skipped.
    pub(crate) let_go: Duration,
}

/// Pace of a simulation relative to the clock.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    speed: f64,
    /// Common start of clock and simulated time.
    start: (Instant, u64),
    /// Start of the current second.
    second: (Instant, u64),
    late: Duration,
    let_go: Duration,
}

impl Pace {
    /// Starts now.
    pub fn new(speed: f64, now: Instant, now_ns: u64) -> Self {
        let start = (now, now_ns);
        Self { speed, start, second: start, late: Duration::ZERO, let_go: Duration::ZERO }
    }

    /// Number of ticks due at `now`, with the simulation at `now_ns`.
    pub fn due(&mut self, now: Instant, now_ns: u64) -> u64 {
        let (start, start_ns) = self.start;
        let simulated = Duration::from_nanos(now_ns - start_ns).div_f64(self.speed);
        let late = now.saturating_duration_since(start).saturating_sub(simulated);
        self.late = self.late.max(late);
        if late > MOST_LATE {
            self.let_go += late;
            self.start = (now, now_ns);
            return 0;
        }
        (late.mul_f64(self.speed).as_nanos() / u128::from(TICK_NS)) as u64
    }

    /// Returns the figures of a second that has just ended.
    pub fn second(&mut self, now: Instant, now_ns: u64) -> Option<Second> {
        let (begin, begin_ns) = self.second;
        let lasted = now.saturating_duration_since(begin);
        if lasted < SECOND {
            return None;
        }
        let simulated = Duration::from_nanos(now_ns - begin_ns);
        let figures = Second {
            speed: simulated.as_secs_f64() / lasted.as_secs_f64(),
            late: self.late,
            let_go: self.let_go,
        };
        (self.second, self.late, self.let_go) = ((now, now_ns), Duration::ZERO, Duration::ZERO);
        Some(figures)
    }
}

impl Second {
    /// Returns the report, if the pace was not held.
    pub fn report(&self, speed: f64) -> Option<String> {
        let differs = (self.speed / speed - 1.0).abs() > SPEED_DIFFERS;
        if !differs && self.late < LATE && self.let_go.is_zero() {
            return None;
        }
        Some(format!(
            "speed {:.2} of {speed}, at most {} ms late, {} ms not simulated",
            self.speed,
            self.late.as_millis(),
            self.let_go.as_millis()
        ))
    }
}

/// Copy of a network whose legs hold their position, since a leg costs most while its drive is on.
fn enabled<const N: usize, const B: usize>(network: &Network<N, B>) -> Network<N, B> {
    let mut network = network.clone();
    let nodes: Vec<u16> = network
        .boards()
        .iter()
        .flat_map(|board| board.nodes().iter().map(|node| u16::from(node.id().number())))
        .collect();
    (0..BOOT_TICKS).for_each(|_| network.tick(|_| {}));
    for word in [6, 7, 15] {
        for node in &nodes {
            let controlword = [0x2B, 0x40, 0x60, 0, word, 0, 0, 0];
            network.send(Frame::new(0x600 + node, &controlword));
        }
        (0..STEP_TICKS).for_each(|_| network.tick(|_| {}));
    }
    network
}

/// Processor time of this thread so far; where the system does not report it, the time since `begin`. Other
/// programs that are busy for a moment are no reason to refuse a speed.
#[cfg_attr(unix, expect(unused_variables, reason = "only other systems need it"))]
fn spent(begin: Instant) -> Duration {
    #[cfg(unix)]
    {
        let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
        Duration::new(time.tv_sec.unsigned_abs(), time.tv_nsec as u32)
    }
    #[cfg(not(unix))]
    begin.elapsed()
}

/// Speeds that this machine reaches with enabled drives if nothing else runs, in simulated seconds per second
/// of the processor, in ascending order.
pub(crate) fn reachable<const N: usize, const B: usize>(network: &Network<N, B>) -> Vec<f64> {
    let mut network = enabled(network);
    let start = Instant::now();
    let mut speeds: Vec<f64> = (0..CHUNKS)
        .map(|_| {
            let begin = spent(start);
            (0..CHUNK_TICKS).for_each(|_| network.tick(|_| {}));
            f64::from(CHUNK_TICKS) * TICK_NS as f64 * 1e-9 / (spent(start) - begin).as_secs_f64().max(1e-9)
        })
        .collect();
    speeds.sort_by(f64::total_cmp);
    speeds
}

/// Checks a speed against measured ones, in ascending order. Returns a warning above the lower quartile.
///
/// # Errors
/// The speed exceeds the median of the measurements.
pub(crate) fn judge(speed: f64, speeds: &[f64], legs: usize) -> Result<Option<String>, String> {
    let s = if legs == 1 { "" } else { "s" };
    let [quartile, median] = [4, 2].map(|part| speeds.get(speeds.len() / part).copied().unwrap_or(0.0));
    if speed > median {
        return Err(format!(
            "--speed: {speed} cannot be held; this machine simulates {legs} leg{s} at {median:.1} times real time"
        ));
    }
    Ok((speed > quartile).then(|| {
        format!("--speed {speed} is not always held: this machine sometimes simulates {legs} leg{s} at only {quartile:.1} times real time")
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bus::serve::{ServeOptions, network};
    use scarab::leg::Permission;
    use scarab_identify::formats::leg_file::{DEFAULT_LEG, LegFile};

    const MS: Duration = Duration::from_millis(1);

    #[test]
    fn a_simulation_in_real_time_reports_nothing() {
        let begin = Instant::now();
        let (mut pace, mut now_ns, mut seconds) = (Pace::new(2.0, begin, 0), 0, 0);
        for ms in 1..=3000 {
            let now = begin + ms * MS;
            now_ns += pace.due(now, now_ns) * TICK_NS;
            if let Some(second) = pace.second(now, now_ns) {
                assert_eq!(second.report(2.0), None, "{second:?}");
                seconds += 1;
            }
        }
        assert_eq!((seconds, now_ns), (3, 6_000_000_000));
    }

    #[test]
    fn a_slow_simulation_and_a_delay_are_reported_with_their_figures() {
        let begin = Instant::now();
        let (mut pace, mut now_ns, mut reports) = (Pace::new(1.0, begin, 0), 0, Vec::new());
        // The second of three seconds is simulated at half the speed; the third has a gap of 30 ms.
        for ms in 1..=3000 {
            let now = begin + ms * MS;
            let slow = (1000..2000).contains(&ms);
            if !(2500..2530).contains(&ms) {
                now_ns += pace.due(now, now_ns).min(if slow { 2 } else { u64::MAX }) * TICK_NS;
            }
            if let Some(second) = pace.second(now, now_ns) {
                reports.push(second);
            }
        }
        let [first, second, third] = reports[..] else { panic!("{reports:?}") };
        assert_eq!(first.report(1.0), None);
        assert!((second.speed - 0.5).abs() < 0.01 && second.late > MOST_LATE, "{second:?}");
        assert!(second.let_go > 400 * MS && second.let_go < 510 * MS, "{second:?}");
        let report = second.report(1.0).expect("half the speed");
        assert!(report.starts_with("speed 0.50 of 1, at most 10"), "{report}");
        assert!(third.late >= 30 * MS && third.report(1.0).is_some(), "{third:?}");
    }

    #[test]
    fn a_speed_above_the_median_is_refused_and_above_the_quartile_warned_about() {
        // One chunk of 20 was fast by chance, six were slow.
        let mut speeds = [9.0; 20];
        speeds[19] = 30.0;
        speeds[..6].fill(5.0);
        assert_eq!(judge(5.0, &speeds, 1), Ok(None));
        assert!(judge(8.5, &speeds, 1).expect("held most of the time").is_some());
        let refusal = judge(20.0, &speeds, 2).expect_err("not held");
        assert_eq!(
            refusal,
            "--speed: 20 cannot be held; this machine simulates 2 legs at 9.0 times real time"
        );
    }

    #[test]
    fn the_measured_legs_have_their_drives_on() {
        let options = ServeOptions::local(2);
        let leg = LegFile::load(DEFAULT_LEG).expect("shipped");
        let network = network::<2, 13>(&leg, &options, None, &[]).expect("the default leg");
        let mut measured = enabled(&network);
        for board in measured.boards() {
            assert_eq!(board.rig.state().permission(), Permission::Follow);
        }
    }
}
