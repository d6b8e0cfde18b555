//! HTTP server of the live page, on one thread.
//!
//! Limits: pages, connections, time for a request, time without reading. Beyond the limit of connections the
//! oldest without a complete request is closed, so connections that never ask keep no page out. Memory is
//! bounded: buffers of a connection have a limit, and messages come from the hub's ring.

use core::convert::Infallible;
use core::pin::Pin;
use core::task::{Context, Poll, ready};
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use hyper::body::{Body, Bytes, Frame, Incoming, SizeHint};
use hyper::header::{self, HeaderName, HeaderValue};
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper::{Request, Response, StatusCode};
use hyper_util::rt::{TokioIo, TokioTimer};
use scarab_base::error::ToolError;
use socket2::SockRef;
use tokio::net::{TcpListener, TcpStream};
use tokio::task::JoinHandle;
use tokio::time::{Interval, MissedTickBehavior, interval, sleep, timeout};

use crate::view::live::hub::{Cursor, Hub};
use crate::view::live::request::{Access, Answer, POLICY, check_token};

/// Pages that can be open at once.
pub const MOST_PAGES: usize = 16;
/// Connections at once, pages included.
pub const MOST_CONNECTIONS: usize = 64;
/// Time for the head of a request, and for an answer other than the stream.
const REQUEST_TIME: Duration = Duration::from_secs(10);
/// A page that reads nothing for this time is disconnected.
const STALLED: Duration = Duration::from_secs(30);
/// Period of the look for news.
const PERIOD: Duration = Duration::from_millis(20);
/// Longest silence of the stream, as a sign of life.
const SILENCE: Duration = Duration::from_secs(2);
/// Pause after a failed `accept`, for example without free file descriptors.
const PAUSE: Duration = Duration::from_millis(100);
/// Bytes of a connection's buffer, here and in the system.
const BUFFER: usize = 64 * 1024;

/// Headers of every answer.
const HEADERS: [(HeaderName, HeaderValue); 7] = [
    (header::CONTENT_SECURITY_POLICY, HeaderValue::from_static(POLICY)),
    (header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff")),
    (header::X_FRAME_OPTIONS, HeaderValue::from_static("DENY")),
    (header::REFERRER_POLICY, HeaderValue::from_static("no-referrer")),
    (header::CACHE_CONTROL, HeaderValue::from_static("no-store")),
    (HeaderName::from_static("cross-origin-resource-policy"), HeaderValue::from_static("same-origin")),
    (HeaderName::from_static("cross-origin-opener-policy"), HeaderValue::from_static("same-origin")),
];

/// Server with its open port.
pub(crate) struct Server {
    listener: std::net::TcpListener,
    access: Access,
}

/// State shared by the connections.
struct Shared {
    hub: Arc<Hub>,
    access: Access,
    pages: Arc<AtomicUsize>,
    begin: Instant,
}

/// Connection that is served, and whether its request is complete.
struct Guest {
    task: JoinHandle<()>,
    has_asked: Arc<AtomicBool>,
}

/// Counted slot of a page; freed when dropped.
struct PageSlot(Arc<AtomicUsize>);

impl PageSlot {
    fn take(count: &Arc<AtomicUsize>) -> Option<Self> {
        let add = |taken: usize| (taken < MOST_PAGES).then_some(taken + 1);
        count.fetch_update(Ordering::Relaxed, Ordering::Relaxed, add).ok()?;
        Some(Self(Arc::clone(count)))
    }
}

impl Drop for PageSlot {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

impl Server {
    /// Opens the port; port 0 selects a free one.
    ///
    /// # Errors
    /// The token is missing or invalid, or the port cannot be opened.
    pub fn new(address: SocketAddr, token: Option<String>) -> Result<Self, ToolError> {
        check_token(address, token.as_deref()).map_err(ToolError::input)?;
        let refused = |error: std::io::Error| {
            ToolError::input(format!("--listen {address}: {error}; port 0 selects a free one"))
        };
        let listener = std::net::TcpListener::bind(address).map_err(refused)?;
        listener.set_nonblocking(true).map_err(refused)?;
        let address = listener.local_addr().map_err(refused)?;
        Ok(Self { listener, access: Access { address, token } })
    }

    /// Address of the page, to be opened in a browser.
    pub(crate) fn url(&self) -> String {
        let Access { address, token } = &self.access;
        // A wildcard address is no destination.
        let host = match address.ip() {
            ip if ip.is_unspecified() => "localhost".into(),
            std::net::IpAddr::V6(ip) => format!("[{ip}]"),
            ip => ip.to_string(),
        };
        let token = token.as_ref().map_or_else(String::new, |token| format!("?token={token}"));
        format!("http://{host}:{}/{token}", address.port())
    }

    /// Serves until the process ends.
    ///
    /// # Errors
    /// The system refuses a thread's event queue.
    pub(crate) fn serve(self, hub: Arc<Hub>) -> Result<(), ToolError> {
        let failed =
            |error: std::io::Error| ToolError::input(format!("the live page cannot be served: {error}"));
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_io()
            .enable_time()
            .build()
            .map_err(failed)?;
        runtime.block_on(async {
            let listener = TcpListener::from_std(self.listener).map_err(failed)?;
            let pages = Arc::new(AtomicUsize::new(0));
            let shared = Arc::new(Shared { hub, access: self.access, pages, begin: Instant::now() });
            let mut guests: Vec<Guest> = Vec::new();
            loop {
                let Ok((stream, _)) = listener.accept().await else {
                    sleep(PAUSE).await;
                    continue;
                };
                guests.retain(|guest| !guest.task.is_finished());
                if guests.len() >= MOST_CONNECTIONS {
                    let idle = guests.iter().position(|guest| !guest.has_asked.load(Ordering::Relaxed));
                    // If all have asked, the new connection is closed.
                    let Some(oldest) = idle else { continue };
                    guests.remove(oldest).task.abort();
                }
                let has_asked = Arc::new(AtomicBool::new(false));
                let task = tokio::spawn(connection(stream, Arc::clone(&shared), Arc::clone(&has_asked)));
                guests.push(Guest { task, has_asked });
            }
        })
    }
}

/// Serves one request. A connection that stops reading ends.
async fn connection(stream: TcpStream, shared: Arc<Shared>, has_asked: Arc<AtomicBool>) {
    let _ = stream.set_nodelay(true);
    let _ = SockRef::from(&stream).set_send_buffer_size(BUFFER);
    let begin = shared.begin;
    let polled = Arc::new(AtomicU64::new(0));
    let seen = Arc::clone(&polled);
    let service = service_fn(move |request: Request<Incoming>| {
        has_asked.store(true, Ordering::Relaxed);
        let answer = respond(&shared, &request, &polled);
        core::future::ready(Ok::<_, Infallible>(answer))
    });
    let served = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(REQUEST_TIME)
        .keep_alive(false)
        .max_buf_size(BUFFER)
        .serve_connection(TokioIo::new(stream), service);
    let mut served = core::pin::pin!(served);
    let started = begin.elapsed();
    while timeout(REQUEST_TIME, served.as_mut()).await.is_err() {
        // The stream is polled while its page reads.
        let last = Duration::from_millis(seen.load(Ordering::Relaxed)).max(started);
        let limit = if last > started { STALLED } else { REQUEST_TIME };
        if begin.elapsed().saturating_sub(last) >= limit {
            return;
        }
    }
}

fn respond(shared: &Shared, request: &Request<Incoming>, polled: &Arc<AtomicU64>) -> Response<Content> {
    match shared.access.answer(request.method(), request.uri(), request.headers()) {
        Answer::File(kind, text) => response(StatusCode::OK, kind, Content::Text(Some(text))),
        Answer::Refused(status, why) => refusal(status, why),
        Answer::Events(cursor) => {
            let Some(slot) = PageSlot::take(&shared.pages) else {
                return refusal(
                    StatusCode::SERVICE_UNAVAILABLE,
                    "all 16 places for pages are taken: close another page, this one will try again",
                );
            };
            let events = Events::new(shared, cursor, Arc::clone(polled), slot);
            response(StatusCode::OK, "text/event-stream", Content::Events(Box::new(events)))
        }
    }
}

fn refusal(status: StatusCode, why: &'static str) -> Response<Content> {
    let mut refusal = response(status, "text/plain; charset=utf-8", Content::Text(Some(why)));
    if status == StatusCode::METHOD_NOT_ALLOWED {
        refusal.headers_mut().insert(header::ALLOW, HeaderValue::from_static("GET"));
    }
    refusal
}

fn response(status: StatusCode, kind: &'static str, content: Content) -> Response<Content> {
    let mut response = Response::new(content);
    *response.status_mut() = status;
    response.headers_mut().insert(header::CONTENT_TYPE, HeaderValue::from_static(kind));
    response.headers_mut().extend(HEADERS);
    response
}

/// Body of an answer.
enum Content {
    Text(Option<&'static str>),
    Events(Box<Events>),
}

impl Body for Content {
    type Data = Bytes;
    type Error = Infallible;

    fn poll_frame(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, Infallible>>> {
        match self.get_mut() {
            Self::Text(text) => {
                Poll::Ready(text.take().map(|text| Ok(Frame::data(Bytes::from_static(text.as_bytes())))))
            }
            Self::Events(events) => events.poll(context).map(|text| Some(Ok(Frame::data(Bytes::from(text))))),
        }
    }

    fn is_end_stream(&self) -> bool {
        matches!(self, Self::Text(None))
    }

    fn size_hint(&self) -> SizeHint {
        match self {
            Self::Text(text) => SizeHint::with_exact(text.map_or(0, |text| text.len() as u64)),
            Self::Events(_) => SizeHint::default(),
        }
    }
}

/// Endless stream of messages to one page.
struct Events {
    hub: Arc<Hub>,
    cursor: Cursor,
    interval: Interval,
    last: Option<Instant>,
    /// Milliseconds from `begin` to the last poll.
    polled: Arc<AtomicU64>,
    begin: Instant,
    _slot: PageSlot,
}

impl Events {
    fn new(shared: &Shared, cursor: Cursor, polled: Arc<AtomicU64>, slot: PageSlot) -> Self {
        let mut interval = interval(PERIOD);
        interval.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let (hub, begin) = (Arc::clone(&shared.hub), shared.begin);
        Self { hub, cursor, interval, last: None, polled, begin, _slot: slot }
    }

    /// Next message, or a comment after a silence.
    fn poll(&mut self, context: &mut Context<'_>) -> Poll<String> {
        loop {
            let since_begin = self.begin.elapsed().as_millis() as u64;
            self.polled.store(since_begin, Ordering::Relaxed);
            ready!(self.interval.poll_tick(context));
            let text = match self.hub.read(self.cursor) {
                Some((message, next)) => {
                    self.cursor = next;
                    let json = serde_json::to_string(&message).unwrap_or_default();
                    format!("data: {json}\n\n")
                }
                None if self.last.is_none_or(|last| last.elapsed() >= SILENCE) => ":\n\n".into(),
                None => continue,
            };
            self.last = Some(Instant::now());
            return Poll::Ready(text);
        }
    }
}
