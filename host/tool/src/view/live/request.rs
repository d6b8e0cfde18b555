//! Decides what a request gets, without I/O.
//!
//! Only GET is served, so nothing can be commanded. The Host header must be an address, not a name: a foreign
//! site cannot reach the page through a name that it lets point here (DNS rebinding). Outside loopback every
//! request for data needs the token. The page allows scripts, styles and connections of its own origin only.

use std::net::{IpAddr, SocketAddr};

use hyper::header::{HOST, HeaderMap};
use hyper::{Method, StatusCode, Uri};
use sha2::{Digest, Sha256};

use crate::view::live::hub::Cursor;

/// Content policy of every answer.
pub(crate) const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; \
                          img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
/// Fewest characters of a token.
pub(crate) const LEAST_TOKEN: usize = 16;

/// Parts of the page: path, type, content.
pub(crate) const FILES: [(&str, &str, &str); 9] = [
    ("/", "text/html; charset=utf-8", include_str!("page/index.html")),
    ("/palette.css", "text/css; charset=utf-8", include_str!("../palette.css")),
    ("/live.css", "text/css; charset=utf-8", include_str!("page/live.css")),
    ("/model.js", JAVASCRIPT, include_str!("page/model.js")),
    ("/live.js", JAVASCRIPT, include_str!("page/live.js")),
    ("/charts.js", JAVASCRIPT, include_str!("page/charts.js")),
    ("/uPlot.iife.min.js", JAVASCRIPT, include_str!("page/uplot/uPlot.iife.min.js")),
    ("/uPlot.min.css", "text/css; charset=utf-8", include_str!("page/uplot/uPlot.min.css")),
    ("/uplot-licence.txt", "text/plain; charset=utf-8", include_str!("page/uplot/LICENSE")),
];
const JAVASCRIPT: &str = "text/javascript; charset=utf-8";

/// Access to the page.
#[derive(Clone, Debug)]
pub(crate) struct Access {
    /// Address of the server.
    pub(crate) address: SocketAddr,
    /// Token of requests for data; none on loopback.
    pub(crate) token: Option<String>,
}

/// Answer to a request.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Answer {
    /// Part of the page: type and content.
    File(&'static str, &'static str),
    /// Stream of messages from this position on.
    Events(Cursor),
    /// Refusal with its reason.
    Refused(StatusCode, &'static str),
}

impl Access {
    /// Decides about a request.
    pub(crate) fn answer(&self, method: &Method, uri: &Uri, headers: &HeaderMap) -> Answer {
        if method != Method::GET {
            return Answer::Refused(
                StatusCode::METHOD_NOT_ALLOWED,
                "only GET is served: the page cannot command anything",
            );
        }
        if !self.is_own_host(headers) {
            return Answer::Refused(
                StatusCode::MISDIRECTED_REQUEST,
                "the Host header does not name this server by its address: open the printed address",
            );
        }
        if uri.path() == "/events" {
            return self.events(uri);
        }
        let file = FILES.iter().find(|(path, _, _)| *path == uri.path());
        file.map_or(Answer::Refused(StatusCode::NOT_FOUND, "no such page"), |(_, kind, content)| {
            Answer::File(kind, content)
        })
    }

    fn events(&self, uri: &Uri) -> Answer {
        let query = |key: &str| {
            let pairs = uri.query().unwrap_or("").split('&');
            pairs
                .filter_map(|pair| pair.split_once('='))
                .find(|(name, _)| *name == key)
                .map(|(_, value)| value)
        };
        if let Some(token) = &self.token
            && !query("token").is_some_and(|given| is_equal(given, token))
        {
            return Answer::Refused(
                StatusCode::UNAUTHORIZED,
                "the token is missing or wrong: open the printed address",
            );
        }
        match query("next").map(str::parse) {
            None => Answer::Events(Cursor::default()),
            Some(Ok(next)) => Answer::Events(Cursor::behind(next)),
            Some(Err(_)) => Answer::Refused(StatusCode::BAD_REQUEST, "`next` is not a number"),
        }
    }

    /// Whether the Host header is an address with the server's port; on loopback a loopback address.
    fn is_own_host(&self, headers: &HeaderMap) -> bool {
        let mut hosts = headers.get_all(HOST).iter();
        let (Some(host), None) = (hosts.next().and_then(|host| host.to_str().ok()), hosts.next()) else {
            return false;
        };
        let (name, port) = match host.rsplit_once(':') {
            Some((name, port)) if !port.contains(']') => (name, port.parse().ok()),
            _ => (host, Some(80)),
        };
        if port != Some(self.address.port()) {
            return false;
        }
        if name.eq_ignore_ascii_case("localhost") {
            return true;
        }
        let bare = name.strip_prefix('[').and_then(|name| name.strip_suffix(']')).unwrap_or(name);
        let address: Result<IpAddr, _> = bare.parse();
        address.is_ok_and(|address| address.is_loopback() || !self.address.ip().is_loopback())
    }
}

/// Compares digests, so that the time of the comparison says nothing about the token.
fn is_equal(given: &str, token: &str) -> bool {
    Sha256::digest(given) == Sha256::digest(token)
}

/// Checks the token of an address.
///
/// # Errors
/// An address outside loopback without a token, or an invalid token.
pub(crate) fn check_token(address: SocketAddr, token: Option<&str>) -> Result<(), String> {
    match token {
        None if address.ip().is_loopback() => Ok(()),
        None => Err(format!(
            "--listen {address}: other machines can reach this address: add --token with {LEAST_TOKEN} or more letters and \
             digits, for example from `openssl rand -hex 16`"
        )),
        Some(token)
            if token.len() < LEAST_TOKEN || !token.bytes().all(|byte| byte.is_ascii_alphanumeric()) =>
        {
            Err(format!(
                "--token: {} characters, at least {LEAST_TOKEN} are needed, letters and digits only",
                token.chars().count()
            ))
        }
        Some(_) => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hyper::header::HeaderValue;

    fn access(address: &str, token: Option<&str>) -> Access {
        Access { address: address.parse().expect("an address"), token: token.map(str::to_owned) }
    }

    fn get(access: &Access, path: &str, host: &str) -> Answer {
        let mut headers = HeaderMap::new();
        headers.insert(HOST, HeaderValue::from_str(host).expect("a header"));
        access.answer(&Method::GET, &path.parse().expect("a path"), &headers)
    }

    fn status(answer: Answer) -> u16 {
        match answer {
            Answer::Refused(status, _) => status.as_u16(),
            _ => 200,
        }
    }

    #[test]
    fn a_name_that_points_here_is_refused() {
        let own = access("127.0.0.1:8000", None);
        for (host, expected) in [
            ("127.0.0.1:8000", 200),
            ("localhost:8000", 200),
            ("LOCALHOST:8000", 200),
            ("[::1]:8000", 200),
            ("127.0.0.1:8001", 421),
            ("127.0.0.1", 421),
            ("evil.example:8000", 421),
            ("127.0.0.1.evil.example:8000", 421),
            ("localhost.evil.example:8000", 421),
            ("192.168.1.7:8000", 421),
            ("", 421),
            ("[::1", 421),
            (":8000", 421),
        ] {
            assert_eq!(status(get(&own, "/", host)), expected, "{host:?}");
        }
        let mut twice = HeaderMap::new();
        twice.append(HOST, HeaderValue::from_static("127.0.0.1:8000"));
        twice.append(HOST, HeaderValue::from_static("evil.example"));
        let uri = Uri::from_static("/");
        assert_eq!(status(own.answer(&Method::GET, &uri, &twice)), 421);
        assert_eq!(status(own.answer(&Method::GET, &uri, &HeaderMap::new())), 421);
        let open = access("0.0.0.0:8000", Some("0123456789abcdef"));
        assert_eq!(status(get(&open, "/", "192.168.1.7:8000")), 200);
        assert_eq!(status(get(&open, "/", "evil.example:8000")), 421);
    }

    #[test]
    fn every_method_but_get_is_refused() {
        let own = access("127.0.0.1:8000", None);
        let mut headers = HeaderMap::new();
        headers.insert(HOST, HeaderValue::from_static("127.0.0.1:8000"));
        for method in ["POST", "PUT", "DELETE", "PATCH", "HEAD", "OPTIONS", "TRACE", "CONNECT", "BREW"] {
            let method = Method::from_bytes(method.as_bytes()).expect("a method");
            assert_eq!(status(own.answer(&method, &Uri::from_static("/events"), &headers)), 405, "{method}");
        }
    }

    #[test]
    fn data_outside_loopback_need_the_token() {
        let open = access("0.0.0.0:8000", Some("0123456789abcdef"));
        let host = "10.0.0.1:8000";
        assert_eq!(status(get(&open, "/events", host)), 401);
        assert_eq!(status(get(&open, "/events?token=0123456789abcdeg", host)), 401);
        assert_eq!(status(get(&open, "/events?token=0123456789abcdef0", host)), 401);
        let allowed = get(&open, "/events?next=7&token=0123456789abcdef", host);
        assert_eq!(allowed, Answer::Events(Cursor::behind(7)));
        assert_eq!(status(get(&open, "/events?token=0123456789abcdef&next=-7", host)), 400);
    }

    #[test]
    fn a_token_is_long_and_needed_outside_loopback() {
        let (inside, outside) = (([127, 0, 0, 1], 80).into(), ([0, 0, 0, 0], 80).into());
        assert!(check_token(inside, None).is_ok());
        assert!(check_token(outside, None).expect_err("reachable").contains("--token"));
        assert!(check_token(outside, Some("0123456789abcdef")).is_ok());
        for token in ["short", "0123456789abcde&", "0123456789abcd\u{e9}f"] {
            assert!(check_token(inside, Some(token)).is_err(), "{token}");
        }
    }

    #[test]
    fn the_page_names_no_other_machine() {
        for (path, _, content) in FILES.iter().filter(|(path, ..)| !path.to_lowercase().contains("uplot")) {
            assert!(!content.contains("http:") && !content.contains("https:"), "{path}");
            assert!(!content.contains("innerHTML") && !content.contains("eval("), "{path}");
        }
    }
}
