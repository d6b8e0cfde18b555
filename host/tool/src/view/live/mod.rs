//! Live page: a read-only HTTP server that shows the reports of a source in a browser.
//!
//! ```text
//! source --LiveUpdate--> Hub (one bounded ring) --Message, server-sent events--> page (charts by uPlot)
//! ```
//!
//! | part | content |
//! | --- | --- |
//! | [`hub`] | bounded distribution; a slow page is overtaken |
//! | `request` | which request gets what: methods, Host header, token |
//! | [`server`] | connections, on one thread of their own |
//! | `page` | HTML, styles, scripts; `page/uplot` is vendored |

pub mod hub;
pub(crate) mod request;
pub mod server;
