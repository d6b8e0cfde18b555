//! Lines about faults and emergency messages of the legs. Each is printed once, although every node of a leg
//! sends it.

use scarab::bus::Frame;
use scarab::leg::{FaultCode, NO_ERROR, NoticeCode, RefusalReason};

/// Messages that are remembered; a node that forgets to end its errors loses the oldest.
const MOST_ACTIVE: usize = 32;

/// Active messages of one leg.
#[derive(Clone, Debug, Default)]
pub struct Alarms {
    fault: Option<FaultCode>,
    /// COB-ID, code and information of each active message.
    active: Vec<(u16, u16, [u8; 5])>,
}

/// Reason of a refused step, by its bit of 60FD.
pub fn reason(bit: u8) -> &'static str {
    use RefusalReason as Reason;
    match bit {
        bit if bit == Reason::SwitchOpen as u8 => "the enabling switch is open",
        bit if bit == Reason::Blocked as u8 => "an inhibit reason is active",
        bit if bit == Reason::NoReference as u8 => "the joints' zeros are unknown",
        bit if bit == Reason::NotCalibrated as u8 => "an axis is not calibrated",
        bit if bit == Reason::OutOfRange as u8 => "outside its range",
        bit if bit == Reason::Moving as u8 => "too fast",
        bit if bit == Reason::Encoder as u8 => "encoder reading rejected",
        bit if bit == Reason::NoTransition as u8 => {
            "no such step from this state; send controlword 6 first, without bit 7"
        }
        bit if bit == Reason::NoAssistance as u8 => "assistance: no fitting model, or the joints move",
        _ => "unknown reason",
    }
}

/// Sentence about an emergency message; information: see `bus::device`.
pub(crate) fn words(code: u16, information: [u8; 5]) -> String {
    let fault = FaultCode::ALL.into_iter().find(|fault| fault.number() == code);
    let notice = NoticeCode::ALL.into_iter().find(|notice| notice.number() == code);
    let [joint, bit, ..] = information;
    match (fault, notice) {
        (Some(fault), _) => fault.words().into(),
        (_, Some(NoticeCode::NotEnabled)) if joint == 0 => {
            format!("a step towards enabled is refused: {}", reason(bit))
        }
        (_, Some(NoticeCode::NotEnabled)) => {
            format!("a step towards enabled is refused: joint {joint}, {}", reason(bit))
        }
        (_, Some(NoticeCode::Overrun)) => "received frames were lost".into(),
        (_, Some(NoticeCode::ShortPdo)) => "a received PDO is shorter than its mapping".into(),
        (_, Some(NoticeCode::SyncLength)) => "a SYNC has no counter, which 1019 expects".into(),
        (_, Some(NoticeCode::StoreFailed)) => "objects could not be stored or read back".into(),
        (_, Some(NoticeCode::Storing)) => "sends nothing while it writes its flash".into(),
        (None, None) => "unknown code".into(),
    }
}

impl Alarms {
    /// Takes the leg's present fault. Returns its line when it is new.
    pub fn fault(&mut self, fault: Option<FaultCode>) -> Option<String> {
        let new = fault.filter(|_| fault != self.fault);
        self.fault = fault;
        new.map(|code| format!("{} ({:#06x}): {}", code.name(), code.number(), code.words()))
    }

    /// Words of the newest active fault; `None` without one.
    pub fn active_fault(&self) -> Option<&'static str> {
        let faults = || FaultCode::ALL.into_iter();
        let words = |(_, code, _): &(u16, u16, [u8; 5])| {
            faults().find(|fault| fault.number() == *code).map(FaultCode::words)
        };
        self.fault.map(FaultCode::words).or_else(|| self.active.iter().rev().find_map(words))
    }

    /// Forgets the messages of this COB-ID: the node has started again.
    pub fn restarted(&mut self, emergency: u16) {
        self.active.retain(|(id, ..)| *id != emergency);
    }

    /// Takes an emergency message. Returns its line, unless the fault or another node's message already gave
    /// it.
    pub fn emergency(&mut self, message: &Frame) -> Option<String> {
        let [low, high, _, information @ ..] = message.full()?;
        let (node, code) = (message.id(), u16::from_le_bytes([low, high]));
        if code == NO_ERROR {
            self.active.retain(|(id, ..)| *id != node);
            return None;
        }
        let is_known = self.fault.is_some_and(|fault| fault.number() == code)
            || self.active.iter().any(|(_, other, with)| (*other, *with) == (code, information));
        self.active.retain(|message| *message != (node, code, information));
        if self.active.len() >= MOST_ACTIVE {
            self.active.remove(0);
        }
        self.active.push((node, code, information));
        (!is_known).then(|| format!("emergency {code:04X}: {}", words(code, information)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_emergency_is_reported_once_per_leg_until_it_ends() {
        let message = |id, code: u16, information: [u8; 5]| {
            let [low, high] = code.to_le_bytes();
            let [a, b, c, d, e] = information;
            Frame::new(id, &[low, high, 0x81, a, b, c, d, e])
        };
        let refused = |id| message(id, 0xFF0E, [1, 23, 0, 0, 0]);
        let words = Some(
            "emergency FF0E: a step towards enabled is refused: joint 1, no such step from this state; \
             send controlword 6 first, without bit 7"
                .to_owned(),
        );
        let mut alarms = Alarms::default();
        assert_eq!([0x81, 0x82].map(|id| alarms.emergency(&refused(id))), [words.clone(), None]);
        for id in [0x81, 0x82] {
            assert_eq!(alarms.emergency(&message(id, 0, [0; 5])), None);
        }
        assert_eq!(alarms.emergency(&refused(0x82)), words);
        let silent = alarms.emergency(&message(0x81, 0xFF0F, [0; 5]));
        assert_eq!(silent.as_deref(), Some("emergency FF0F: its host fell silent"));
        // A fault of the leg has its own line.
        let fault = alarms.fault(Some(FaultCode::Overspeed));
        assert_eq!(
            fault.as_deref(),
            Some("overspeed (0x8400): it was faster than 1.1 times its speed limit")
        );
        assert_eq!(alarms.fault(Some(FaultCode::Overspeed)), None);
        assert_eq!(alarms.emergency(&message(0x81, 0x8400, [1, 0, 0, 0, 0])), None);
    }

    #[test]
    fn every_code_and_reason_has_words() {
        let faults = FaultCode::ALL.into_iter().map(FaultCode::number);
        for code in faults.chain(NoticeCode::ALL.map(NoticeCode::number)) {
            assert!(!words(code, [0; 5]).contains("unknown code"), "{code:04X}");
        }
        assert!((16..=23).all(|bit| reason(bit) != "unknown reason"));
    }
}
