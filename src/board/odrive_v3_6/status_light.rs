//! Status light on GPIO6 (PB2), in images that are built with it. The pin is that of the holding brake, so no
//! image has both.

use super::registers::{apply, store};
use super::settings::pins::{BSRR, STATUS_LIGHT, port};

/// Whether a light is connected; set when the image is built.
pub const HAS_LIGHT: bool = option_env!("SCARAB_STATUS_LIGHT").is_some();

/// Makes the pin an output, initially low.
pub fn prepare() {
    if HAS_LIGHT {
        apply(&STATUS_LIGHT.writes());
    }
}

/// Switches the light. Engaging a brake that is not there also turns it off, until the next call.
#[inline]
pub fn set(is_lit: bool) {
    if HAS_LIGHT {
        let shift = if is_lit { 0 } else { 16 };
        store(port(STATUS_LIGHT.port) + BSRR, 1 << (STATUS_LIGHT.number + shift));
    }
}
