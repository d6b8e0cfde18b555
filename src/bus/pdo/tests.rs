use super::*;

fn transmitted() -> Parameters {
    Parameters::new(Mapping::Transmit, 0x181, 1, 0, &[0x6041_0010])
}

/// A disabled PDO with an empty mapping.
fn open(direction: Mapping) -> Parameters {
    let mut parameters = Parameters::new(direction, 0x181, 1, 0, &[0x6041_0010]);
    assert_eq!(parameters.set_communication(1, 0x8000_0181), Ok(()));
    assert_eq!(parameters.set_mapping(0, 0), Ok(()));
    parameters
}

#[test]
fn an_existing_pdo_keeps_its_mapping_and_cob_id() {
    let mut parameters = transmitted();
    assert_eq!(parameters.set_mapping(0, 0), Err(Abort::Access));
    assert_eq!(parameters.set_mapping(1, 0x6064_0020), Err(Abort::Access));
    assert_eq!(parameters.set_communication(1, 0x182), Err(Abort::Range));
    assert_eq!(parameters.set_communication(1, 0x8000_0182), Ok(()));
    assert_eq!(parameters.identifier(), None);
    // Entries can be written only while the count is 0.
    assert_eq!(parameters.set_mapping(1, 0x6064_0020), Err(Abort::Access));
    assert_eq!(parameters.set_mapping(0, 0), Ok(()));
    assert_eq!(parameters.set_mapping(1, 0x6064_0020), Ok(()));
    assert_eq!(parameters.set_mapping(0, 1), Ok(()));
    assert_eq!(parameters.set_communication(1, 0x182), Ok(()));
    assert_eq!((parameters.identifier(), parameters.length()), (Some(0x182), 4));
}

#[test]
fn only_mappable_objects_of_the_right_size_are_mapped() {
    let mut parameters = open(Mapping::Transmit);
    let refused = [
        (0x5555_0020, Abort::NoObject),
        (0x1018_0920, Abort::NoSubindex),
        (0x6064_0010, Abort::NotMappable),
        (0x6064_0021, Abort::NotMappable),
        (0x6076_0020, Abort::NotMappable),
        (0x1008_0008, Abort::NotMappable),
        // Dummy entries are allowed only in received PDOs.
        (0x0005_0008, Abort::NotMappable),
    ];
    for (entry, abort) in refused {
        assert_eq!(parameters.set_mapping(1, entry), Err(abort), "{entry:x}");
    }
    let mut received = open(Mapping::Receive);
    assert_eq!(received.set_mapping(1, 0x6041_0010), Err(Abort::NotMappable));
    assert_eq!(received.set_mapping(1, 0x0005_0008), Ok(()));
    assert_eq!(received.set_mapping(2, 0x6040_0010), Ok(()));
    assert_eq!((received.set_mapping(0, 2), received.length()), (Ok(()), 3));
}

#[test]
fn a_pdo_holds_eight_bytes() {
    let mut parameters = open(Mapping::Transmit);
    for sub in 1..=3 {
        assert_eq!(parameters.set_mapping(sub, 0x6064_0020), Ok(()));
    }
    assert_eq!(parameters.set_mapping(0, 3), Err(Abort::PdoLength));
    assert_eq!(parameters.set_mapping(0, 9), Err(Abort::PdoLength));
    assert_eq!(parameters.set_mapping(0, 4), Err(Abort::NotMappable));
    assert_eq!((parameters.set_mapping(0, 2), parameters.length()), (Ok(()), 8));
}

#[test]
fn restricted_cob_ids_are_refused() {
    let mut parameters = open(Mapping::Transmit);
    for taken in [0, 0x80, 0x85, 0x180, 0x581, 0x601, 0x701, 0x7E5] {
        assert_eq!(parameters.set_communication(1, taken), Err(Abort::Range), "{taken:x}");
    }
    assert_eq!(parameters.set_communication(1, 0x2000_0181), Err(Abort::Range));
    assert_eq!(parameters.set_communication(1, 0x4000_0181), Ok(()));
}

#[test]
fn transmission_types_with_remote_frames_are_refused() {
    let mut parameters = transmitted();
    for kind in 0..=255 {
        let expected = if (241..=253).contains(&kind) { Err(Abort::Range) } else { Ok(()) };
        assert_eq!(parameters.set_communication(2, kind), expected, "{kind}");
    }
}

/// Bit mask of the SYNCs at which the PDO was sent; `counters` are the SYNC counters.
fn sent(kind: u32, start: u32, counters: impl Iterator<Item = Option<u8>>) -> u64 {
    let mut parameters = transmitted();
    assert_eq!(parameters.set_communication(2, kind), Ok(()));
    assert_eq!(parameters.set_communication(6, start), Ok(()));
    let mut transmit = transmit::Transmit::new(parameters);
    let mut which = 0;
    for (number, counter) in counters.enumerate() {
        transmit.at_sync(counter);
        if transmit.is_wanted(0) && transmit.frame([number as u8; 8], 0).is_some() {
            which |= 1 << number;
        }
    }
    which
}

#[test]
fn a_synchronous_pdo_is_sent_every_nth_sync_from_its_start_value() {
    let uncounted = || core::iter::repeat_n(None, 8);
    assert_eq!(sent(1, 0, uncounted()), 0b1111_1111);
    assert_eq!(sent(3, 0, uncounted()), 0b0010_0100);
    assert_eq!(sent(0, 0, uncounted()), 0b1111_1111);
    assert_eq!(sent(255, 0, uncounted()), 0b1111_1111);
    let counted = || (0..8).map(|number| Some(number % 4 + 1));
    assert_eq!(sent(2, 3, counted()), 0b0101_0100);
    assert_eq!(sent(1, 4, counted()), 0b1111_1000);
}

#[test]
fn an_event_is_sent_once_per_inhibit_time_and_by_the_event_timer() {
    let mut parameters = Parameters::new(Mapping::Transmit, 0x181, 255, 10, &[0x6041_0010]);
    assert_eq!(parameters.set_communication(5, 20), Ok(()));
    let mut transmit = transmit::Transmit::new(parameters);
    let mut times = Vec::new();
    for now_us in (0..60_000).step_by(500) {
        // The value changes for 3 ms, then stays.
        let value = now_us.min(3000) as u16;
        let [low, high] = value.to_le_bytes();
        let data = [low, high, 0, 0, 0, 0, 0, 0];
        if transmit.is_wanted(now_us) && transmit.frame(data, now_us).is_some() {
            times.push(now_us);
        }
    }
    assert_eq!(times, [0, 1000, 2000, 3000, 20_000, 40_000]);
}

#[test]
fn a_received_pdo_takes_effect_by_its_type_and_can_time_out() {
    use crate::hal::Frame;
    use receive::{Receive, Received};
    let mut parameters = Parameters::new(Mapping::Receive, 0x201, 1, 0, &[0x6040_0010]);
    assert_eq!(parameters.set_communication(5, 10), Ok(()));
    let mut receive = Receive::new(parameters);
    assert_eq!(receive.take(&Frame::new(0x201, &[6]), 0), Received::TooShort);
    assert!(!receive.at_sync(5_000));
    assert_eq!(receive.take(&Frame::new(0x201, &[6, 0, 9]), 0), Received::AtSync);
    assert!(receive.at_sync(5_000) && !receive.at_sync(5_000));
    assert!(!receive.is_missed(15_000) && receive.is_missed(15_001) && !receive.is_missed(30_000));
    assert_eq!(receive.parameters.set_communication(2, 254), Ok(()));
    assert_eq!(receive.take(&Frame::new(0x201, &[6, 0]), 0), Received::Now);
}
