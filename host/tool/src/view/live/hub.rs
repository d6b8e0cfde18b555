//! Distributes the reports of a source to any number of pages, in bounded memory.
//!
//! The source appends to one ring; each page reads from its own position. A page that reads too slowly is
//! overtaken: it loses the oldest points, and their number is counted. The source therefore never waits for a
//! page. Latest states (status, estimate, outcome) are stored apart from the ring and are never lost.

use core::ops::Deref;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{SystemTime, UNIX_EPOCH};

use serde::{Serialize, Serializer};

use crate::live::report::{
    LiveEstimate, LiveNote, LiveOutcome, LiveRow, LiveSample, LiveStatus, LiveUpdate, Scene,
};

/// Points in the ring: 80 s of samples and rows of one leg at the speed of the clock.
pub(crate) const MOST_POINTS: usize = 8192;
/// Lines of the timeline.
pub(crate) const MOST_NOTES: usize = 200;
/// Points in one message.
pub const MOST_IN_MESSAGE: usize = 400;

/// Report shared by the ring and the messages that contain it.
#[derive(Debug)]
pub(crate) struct Shared<T>(Arc<T>);

impl<T> Shared<T> {
    fn new(report: T) -> Self {
        Self(Arc::new(report))
    }
}

impl<T> Clone for Shared<T> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<T> Deref for Shared<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.0
    }
}

impl<T: Serialize> Serialize for Shared<T> {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        self.0.serialize(to)
    }
}

/// Element of the ring.
#[derive(Clone, Debug)]
enum Point {
    Sample(Shared<LiveSample>),
    Row(Shared<LiveRow>),
    Estimate(Shared<LiveEstimate>),
}

/// Latest state of one leg, each with the number of its version.
#[derive(Clone, Debug, Default)]
struct Latest {
    status: Option<(u64, Shared<LiveStatus>)>,
    estimate: Option<Shared<LiveEstimate>>,
    outcome: Option<(u64, Shared<LiveOutcome>)>,
}

#[derive(Debug, Default)]
struct State {
    scene: Option<(u64, Shared<Scene>)>,
    ring: VecDeque<Point>,
    /// Number of the ring's first point.
    first: u64,
    notes: VecDeque<(u64, Shared<LiveNote>)>,
    legs: Vec<Latest>,
    /// Number of the newest version of any state or note.
    version: u64,
}

/// Reports of a source, for any number of pages.
#[derive(Debug)]
pub(crate) struct Hub {
    state: Mutex<State>,
    /// Distinguishes the sources of successive processes.
    id: u64,
}

/// Position of a page.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Cursor {
    /// Number of the next point.
    point: u64,
    /// Newest version that was read.
    version: u64,
    /// Whether anything was read; a new page has lost nothing.
    started: bool,
}

impl Cursor {
    /// Position behind this point, for a page that returns.
    pub(crate) fn behind(point: u64) -> Self {
        Self { point, version: 0, started: true }
    }
}

/// One message to a page. Absent keys have not changed.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Message {
    /// Number of the next point.
    pub(crate) next: u64,
    /// Points lost since the last message.
    #[serde(skip_serializing_if = "is_zero")]
    pub(crate) dropped: u64,
    /// Number of the source, with the scene.
    #[serde(skip_serializing_if = "is_zero")]
    pub(crate) id: u64,
    /// Description of the source.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) scene: Option<Shared<Scene>>,
    /// New samples.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) samples: Vec<Shared<LiveSample>>,
    /// New rows.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) rows: Vec<Shared<LiveRow>>,
    /// New estimates.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) estimates: Vec<Shared<LiveEstimate>>,
    /// For a new page: the newest estimate of each leg, which may have left the ring.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) latest: Vec<Shared<LiveEstimate>>,
    /// Changed states.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) status: Vec<Shared<LiveStatus>>,
    /// Changed outcomes.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) outcomes: Vec<Shared<LiveOutcome>>,
    /// New lines of the timeline.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) notes: Vec<Shared<LiveNote>>,
}

fn is_zero(value: &u64) -> bool {
    *value == 0
}

impl State {
    fn next(&self) -> u64 {
        self.first + self.ring.len() as u64
    }

    fn push(&mut self, point: Point) {
        if self.ring.len() == MOST_POINTS {
            self.ring.pop_front();
            self.first += 1;
        }
        self.ring.push_back(point);
    }

    fn leg(&mut self, leg: usize) -> Option<&mut Latest> {
        self.legs.get_mut(leg)
    }
}

impl Default for Hub {
    fn default() -> Self {
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        Self { state: Mutex::default(), id: (now.as_millis() as u64).max(1) }
    }
}

impl Hub {
    /// A panic elsewhere leaves the state whole: every change is one assignment.
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }

    /// Takes one report of the source. Reports about a leg that the scene lacks are ignored.
    pub(crate) fn push(&self, update: LiveUpdate) {
        let state = &mut *self.lock();
        let version = state.version + 1;
        match update {
            LiveUpdate::Sample(sample) => return state.push(Point::Sample(Shared::new(sample))),
            LiveUpdate::Row(row) => return state.push(Point::Row(Shared::new(row))),
            LiveUpdate::Scene(scene) => {
                state.legs.resize_with(scene.legs.len(), Latest::default);
                state.scene = Some((version, Shared::new(scene)));
            }
            LiveUpdate::Estimate(estimate) => {
                let estimate = Shared::new(estimate);
                state.push(Point::Estimate(estimate.clone()));
                if let Some(leg) = state.leg(estimate.leg) {
                    leg.estimate = Some(estimate);
                }
            }
            LiveUpdate::Status(status) => {
                if let Some(leg) = state.leg(status.leg) {
                    leg.status = Some((version, Shared::new(status)));
                }
            }
            LiveUpdate::Outcome(outcome) => {
                if let Some(leg) = state.leg(outcome.leg) {
                    leg.outcome = Some((version, Shared::new(outcome)));
                }
            }
            LiveUpdate::Note(note) => {
                if state.notes.len() == MOST_NOTES {
                    state.notes.pop_front();
                }
                state.notes.push_back((version, Shared::new(note)));
            }
        }
        state.version = version;
    }

    /// Next message for a page, and its new position; `None` without news, and before the scene.
    pub(crate) fn read(&self, cursor: Cursor) -> Option<(Message, Cursor)> {
        let state = self.lock();
        state.scene.as_ref()?;
        // A position ahead of the ring belongs to an earlier source.
        let begin = if cursor.point > state.next() { 0 } else { cursor.point };
        let from = begin.max(state.first);
        let dropped = if cursor.started { from - begin } else { 0 };
        let skipped = (from - state.first) as usize;
        let mut message = Message { dropped, ..Message::default() };
        let mut next = from;
        for point in state.ring.iter().skip(skipped).take(MOST_IN_MESSAGE) {
            next += 1;
            match point {
                Point::Sample(sample) => message.samples.push(sample.clone()),
                Point::Row(row) => message.rows.push(row.clone()),
                Point::Estimate(estimate) => message.estimates.push(estimate.clone()),
            }
        }
        let is_new = |version: u64| version > cursor.version;
        message.scene =
            state.scene.as_ref().filter(|(version, _)| is_new(*version)).map(|(_, scene)| scene.clone());
        message.id = if message.scene.is_some() { self.id } else { 0 };
        for leg in &state.legs {
            let status = leg.status.iter().filter(|(version, _)| is_new(*version));
            message.status.extend(status.map(|(_, status)| status.clone()));
            let outcome = leg.outcome.iter().filter(|(version, _)| is_new(*version));
            message.outcomes.extend(outcome.map(|(_, outcome)| outcome.clone()));
            let estimate = leg.estimate.iter().filter(|_| cursor.version == 0);
            message.latest.extend(estimate.cloned());
        }
        let notes = state.notes.iter().filter(|(version, _)| is_new(*version));
        message.notes.extend(notes.map(|(_, note)| note.clone()));
        message.next = next;
        let after = Cursor { point: next, version: state.version, started: true };
        (after != cursor || dropped > 0).then_some((message, after))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::live::report::{LegScene, Severity};

    fn scene() -> LiveUpdate {
        let legs = vec![LegScene { name: "leg".into(), joints: Vec::new() }];
        LiveUpdate::Scene(Scene { source: "test".into(), speed: 1.0, legs })
    }

    fn row(time_s: f64) -> LiveUpdate {
        LiveUpdate::Row(LiveRow { leg: 0, time_s, measured_nm: vec![1.0], predicted_nm: vec![None] })
    }

    /// All messages until there is no news.
    fn read_all(hub: &Hub, mut cursor: Cursor) -> (Vec<Message>, Cursor) {
        let mut messages = Vec::new();
        while let Some((message, next)) = hub.read(cursor) {
            messages.push(message);
            cursor = next;
        }
        (messages, cursor)
    }

    #[test]
    fn a_slow_page_loses_the_oldest_points_and_learns_how_many() {
        let hub = Hub::default();
        hub.push(scene());
        let (first, cursor) = hub.read(Cursor::default()).expect("a scene");
        assert!(first.scene.is_some() && first.dropped == 0);
        let pushed = MOST_POINTS + 1000;
        (0..pushed).for_each(|index| hub.push(row(index as f64)));
        let (messages, cursor) = read_all(&hub, cursor);
        assert_eq!(messages.iter().map(|message| message.dropped).sum::<u64>(), 1000);
        let times: Vec<f64> =
            messages.iter().flat_map(|message| &message.rows).map(|row| row.time_s).collect();
        assert_eq!((times.len(), times[0]), (MOST_POINTS, 1000.0));
        assert!(messages.iter().all(|message| message.rows.len() <= MOST_IN_MESSAGE));
        assert!(hub.read(cursor).is_none());
    }

    #[test]
    fn a_returning_page_continues_behind_its_last_point() {
        let hub = Hub::default();
        hub.push(scene());
        (0..10).for_each(|index| hub.push(row(f64::from(index))));
        let (messages, _) = read_all(&hub, Cursor::behind(7));
        assert!(messages[0].scene.is_some(), "it needs the states again");
        let times: Vec<f64> =
            messages.iter().flat_map(|message| &message.rows).map(|row| row.time_s).collect();
        assert_eq!(times, [7.0, 8.0, 9.0]);
        // A position of an earlier source starts over.
        let (messages, _) = read_all(&hub, Cursor::behind(1_000_000));
        assert_eq!(messages[0].rows.len(), 10);
    }

    #[test]
    fn notes_are_bounded_and_a_new_page_gets_the_latest_states() {
        let hub = Hub::default();
        hub.push(scene());
        for index in 0..MOST_NOTES + 50 {
            let words = index.to_string();
            hub.push(LiveUpdate::Note(LiveNote { time_s: 0.0, weight: Severity::Note, words }));
            hub.push(LiveUpdate::Outcome(LiveOutcome {
                verdict: index.to_string(),
                ..LiveOutcome::default()
            }));
        }
        let (message, _) = hub.read(Cursor::default()).expect("states");
        assert_eq!((message.notes.len(), message.notes[0].words.as_str()), (MOST_NOTES, "50"));
        assert_eq!(message.outcomes.len(), 1);
        assert_eq!(message.outcomes[0].verdict, (MOST_NOTES + 49).to_string());
    }

    #[test]
    fn an_estimate_that_left_the_ring_still_reaches_a_new_page() {
        let hub = Hub::default();
        hub.push(scene());
        let origin = crate::live::report::EstimateOrigin::Result;
        let estimate = LiveEstimate { leg: 0, time_s: 1.0, origin, iterations: 3, values: Vec::new() };
        hub.push(LiveUpdate::Estimate(estimate.clone()));
        (0..MOST_POINTS).for_each(|index| hub.push(row(index as f64)));
        let (messages, _) = read_all(&hub, Cursor::default());
        assert!(messages.iter().all(|message| message.estimates.is_empty()), "it left the ring");
        assert_eq!(*messages[0].latest[0], estimate);
        assert!(messages[1..].iter().all(|message| message.latest.is_empty()));
    }
}
