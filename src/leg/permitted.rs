//! Filter for requests while an inhibit reason is active.

use super::control::ControlRequest;
use crate::motor::AxisFault;
use crate::safety::{DriveState, FaultCode, InhibitReason, PowerRequest};

/// Whether a fault may be reset: no inhibit reason is active but a flash write, which is no fault.
pub(crate) const fn may_reset(causes: u32) -> bool {
    causes & !InhibitReason::Storing.bit() == 0
}

/// Passes every request if there is no inhibit reason, otherwise only those that switch off, and the reset of
/// a fault where [`may_reset`] permits it.
///
/// With an inhibit reason, a drive that is not off is switched off even without a request.
pub(crate) fn permitted(
    request: Option<&ControlRequest>,
    causes: u32,
    state: DriveState,
) -> Option<&ControlRequest> {
    use PowerRequest::{DisableOperation, DisableVoltage, QuickStop, ResetFault};
    if causes == 0 {
        return request;
    }
    let is_off = matches!(
        state,
        DriveState::NotReadyToSwitchOn | DriveState::SwitchOnDisabled | DriveState::Fault { .. }
    );
    match request {
        Some(ControlRequest::Power(DisableOperation | QuickStop | DisableVoltage)) if is_off => request,
        Some(ControlRequest::Power(ResetFault)) if is_off && may_reset(causes) => request,
        _ if is_off => None,
        _ => Some(&ControlRequest::Power(DisableVoltage)),
    }
}

/// Fault code of an axis that switched its outputs off.
pub const fn axis_code(fault: AxisFault) -> FaultCode {
    match fault {
        AxisFault::CurrentSense => FaultCode::CurrentSense,
        AxisFault::Overcurrent => FaultCode::Overcurrent,
        AxisFault::BusVoltage => FaultCode::BusVoltage,
        AxisFault::Encoder => FaultCode::EncoderPosition,
        AxisFault::NotANumber => FaultCode::NotFinite,
        AxisFault::EncoderFrozen => FaultCode::EncoderFrozen,
        AxisFault::OpenPhase => FaultCode::OpenPhase,
        AxisFault::CurrentOffset => FaultCode::CurrentOffset,
        AxisFault::StuckConversion => FaultCode::StuckConversion,
        AxisFault::Parameters => FaultCode::Parameters,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_inhibit_reason_prevents_enabling() {
        let enabling = [PowerRequest::Shutdown, PowerRequest::SwitchOn, PowerRequest::EnableOperation]
            .map(ControlRequest::Power);
        let off = Some(&ControlRequest::Power(PowerRequest::DisableVoltage));
        for request in enabling.into_iter().chain([ControlRequest::Identify]) {
            let request = Some(&request);
            assert_eq!(permitted(request, 0, DriveState::SwitchedOn), request);
            assert_eq!(permitted(request, 1, DriveState::SwitchOnDisabled), None);
            for state in [DriveState::ReadyToSwitchOn, DriveState::SwitchedOn, DriveState::OperationEnabled] {
                assert_eq!(permitted(request, 1, state), off);
                assert_eq!(permitted(None, 1, state), off);
            }
        }
    }

    #[test]
    fn a_fault_is_reset_once_its_reason_is_gone() {
        let fault = crate::safety::Fault { code: FaultCode::EmergencyStop, joint: 0 };
        let reset = ControlRequest::Power(PowerRequest::ResetFault);
        for cause in InhibitReason::ALL {
            let passes = permitted(Some(&reset), cause.bit(), DriveState::Fault { fault }).is_some();
            assert_eq!(passes, cause == InhibitReason::Storing, "{cause:?}");
        }
        assert!(permitted(Some(&reset), 0, DriveState::Fault { fault }).is_some());
    }
}
