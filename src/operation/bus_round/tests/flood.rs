//! Many and expensive frames: processing shares and timeouts.

use super::*;

/// Runs a round triggered by frames only.
fn frames_alone(bench: &mut Bench, frames: &[Frame]) -> Option<LegOrder<2>> {
    bench.arrive(frames);
    bench.bus.status.dequeue();
    bench.host.orders.dequeue();
    bench.round();
    bench.host.orders.dequeue()
}

#[test]
fn a_frame_for_no_own_node_costs_nothing_else() {
    let mut bench = Bench::new();
    bench.enable();
    for frame in [Frame::new(0x7F0, &[1]), Frame::new(0x205, &[15, 0]), Frame::new(0x605, &[0x40; 8])] {
        assert_eq!(frames_alone(&mut bench, &[frame]), None, "{frame:?}");
        assert_eq!(bench.unheard(), 0);
    }
    for frame in
        [Frame::new(0x80, &[]), Frame::new(0x201, &[15, 0]), Frame::new(0, &[1, 5]), Frame::new(0, &[1, 1])]
    {
        let concerns = frame.data() != [1, 5];
        assert_eq!(frames_alone(&mut bench, &[frame]).is_some(), concerns, "{frame:?}");
    }
    // Timeouts are checked nevertheless.
    bench.hardware.now_us += 1000;
    bench.send(0x601, &[0x23, 0x16, 0x10, 1, 2, 0, 0x70, 0]);
    bench.arrive(&[Frame::new(0x770, &[5])]);
    bench.run(1);
    bench.emergencies();
    for _ in 0..8 {
        bench.hardware.now_us += 500;
        frames_alone(&mut bench, &[Frame::new(0x7F0, &[])]);
        bench.hardware.empty_mailboxes();
    }
    assert_eq!(bench.emergencies(), [(0x81, 0x8130)]);
}

#[test]
fn expensive_frames_get_half_of_the_time_and_the_leg_its_reports() {
    let mut bench = Bench::new();
    bench.enable();
    bench.hardware.reception().frame_us = 700;
    let begin_us = bench.hardware.now_us();
    let (mut received, mut rounds) = (0, 0);
    while bench.hardware.now_us() < begin_us + 100_000 {
        bench.arrive(&[Frame::new(0x80, &[])]);
        let before = bench.unheard();
        bench.run(1);
        received += before - bench.unheard();
        rounds += 1;
        // Without a balance the leg's reports and orders still pass, at every tick.
        assert!(bench.host.orders.ready() && bench.host.status.ready());
    }
    let share = received as f64 * 700.0 / 100_000.0;
    assert!((0.4..0.6).contains(&share), "{share}, {rounds} rounds");
    // All frames of the burst are processed one after the other.
    bench.hardware.reception().frame_us = 0;
    bench.run(40);
    assert_eq!(bench.unheard(), 0);
    bench.hardware.reception().frame_us = 700;
    bench.arrive(&[Frame::new(0x80, &[]); 33]);
    bench.run(1);
    assert!((30..33).contains(&bench.unheard()));
    bench.run(100);
    assert_eq!(bench.unheard(), 0);
}

#[test]
fn waiting_frames_prevent_a_timeout_and_a_lost_host_causes_one() {
    let mut bench = Bench::new();
    // The host's controlword has a timeout of 3 ms.
    bench.send(0x601, &[0x2B, 0x00, 0x14, 5, 3, 0, 0, 0]);
    bench.arrive(&[Frame::new(0x201, &[0, 0])]);
    bench.run(4);
    bench.emergencies();
    // An expensive frame, and behind it one that was sent in time.
    bench.hardware.reception().frame_us = 2_500;
    bench.arrive(&[Frame::new(0x80, &[])]);
    bench.run(1);
    bench.hardware.reception().frame_us = 0;
    for _ in 0..12 {
        bench.arrive(&[Frame::new(0x201, &[0, 0])]);
        bench.run(1);
    }
    assert_eq!(bench.emergencies(), []);
    bench.run(10);
    assert_eq!(bench.emergencies(), [(0x81, 0x8250)]);
    // The timeout acts, however expensive the other frames are.
    bench.send(0, &[1, 0]);
    bench.arrive(&[Frame::new(0x201, &[0, 0])]);
    bench.run(2);
    bench.emergencies();
    bench.hardware.reception().frame_us = 900;
    for _ in 0..80 {
        bench.arrive(&[Frame::new(0x80, &[])]);
        bench.run(1);
    }
    assert!(bench.emergencies().contains(&(0x81, 0x8250)));
}
