//! Filter for requests while an inhibit reason is active.

use super::control::ControlRequest;
use crate::motor::AxisFault;
use crate::safety::{DriveState, FaultCode, PowerRequest};

/// Passes every request if there is no inhibit reason, otherwise only those that switch off.
///
/// With an inhibit reason, a drive that is not off is switched off even without a request.
#[must_use]
pub fn permitted(
    request: Option<&ControlRequest>,
    is_clear: bool,
    state: DriveState,
) -> Option<&ControlRequest> {
    use PowerRequest::{DisableOperation, DisableVoltage, QuickStop, ResetFault};
    if is_clear {
        return request;
    }
    let is_off = matches!(
        state,
        DriveState::NotReadyToSwitchOn | DriveState::SwitchOnDisabled | DriveState::Fault { .. }
    );
    match request {
        Some(ControlRequest::Power(DisableOperation | QuickStop | DisableVoltage | ResetFault)) if is_off => {
            request
        }
        _ if is_off => None,
        _ => Some(&ControlRequest::Power(DisableVoltage)),
    }
}

/// Fault code of an axis that switched its outputs off.
#[must_use]
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
            assert_eq!(permitted(request, true, DriveState::SwitchedOn), request);
            assert_eq!(permitted(request, false, DriveState::SwitchOnDisabled), None);
            for state in [DriveState::ReadyToSwitchOn, DriveState::SwitchedOn, DriveState::OperationEnabled] {
                assert_eq!(permitted(request, false, state), off);
                assert_eq!(permitted(None, false, state), off);
            }
        }
    }
}
