// The live page: reads messages from /events, keeps the model, draws. Texts from the source are set as text only.
"use strict";

// Longest silence of the stream, and largest unread message.
const SILENCE_MS = 10000;
const MOST_TEXT = 8 << 20;
// Time spans in seconds, and pauses in ms before another try and between two readouts.
const SPANS = [2, 5, 10, 20, 40, 80];
const LEAST_SPAN = 0.05;
const RETRY_MS = 2000;
const READOUT_MS = 100;
const CALM_MS = 500;
const UNKNOWN = "not known from this source";

const at = (id) => document.getElementById(id);
const model = new Model();
const view = { leg: 0, paused: false, end: null, span: 20, charts: [], laid: null, parameter: null, errors: 0 };
const calm = window.matchMedia("(prefers-reduced-motion: reduce)");
let convergence = null;
let stale = true;

// Text with a class, as a table cell or another element.
function element(kind, text, className) {
    const made = document.createElement(kind);
    made.textContent = text;
    if (className) {
        made.className = className;
    }
    return made;
}

function cell(value, digits, className = "n") {
    const made = element("td", value === null || value === undefined ? "–" : value.toPrecision(digits), className);
    made.dataset.value = String(value);
    return made;
}

function setText(id, text) {
    const target = at(id);
    if (target.textContent !== text) {
        target.textContent = text;
    }
}

// Error of one message or of the connection; the page goes on.
function complain(words) {
    view.errors += 1;
    at("error").hidden = false;
    setText("error", `${words} (${view.errors} so far)`);
}

function link(words) {
    setText("link", `· ${words}`);
}

// Reads the stream once, to its end.
async function read() {
    const wanted = new URLSearchParams();
    const token = new URLSearchParams(window.location.search).get("token");
    if (token !== null) {
        wanted.set("token", token);
    }
    if (model.next !== null) {
        wanted.set("next", String(model.next));
    }
    const stop = new AbortController();
    let timer = setTimeout(() => stop.abort(), SILENCE_MS);
    try {
        const answer = await fetch(`events?${wanted}`, { cache: "no-store", signal: stop.signal });
        if (!answer.ok) {
            throw new Error(`${answer.status}: ${(await answer.text()).slice(0, 300)}`);
        }
        link("connected");
        const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
        let text = "";
        for (;;) {
            const { done, value } = await reader.read();
            if (done) {
                return;
            }
            clearTimeout(timer);
            timer = setTimeout(() => stop.abort(), SILENCE_MS);
            const parts = (text + value).split("\n\n");
            text = parts.pop();
            if (text.length > MOST_TEXT) {
                throw new Error("a message has no end");
            }
            parts.forEach(receive);
        }
    } finally {
        clearTimeout(timer);
        stop.abort();
    }
}

// Takes one message of the stream; a bad one is reported and skipped.
function receive(part) {
    const data = part.split("\n").filter((line) => line.startsWith("data:")).map((line) => line.slice(5).trimStart()).join("\n");
    if (data === "") {
        return;
    }
    try {
        model.take(data);
        stale = true;
    } catch (error) {
        if (!(error instanceof Bad)) {
            throw error;
        }
        complain(`A message of the source was ignored: ${error.message}.`);
    }
}

async function follow() {
    for (;;) {
        try {
            await read();
            link("the source has ended; trying again");
        } catch (error) {
            const silent = error.name === "AbortError";
            link(silent ? "the source is silent; trying again" : `not connected (${error.message}); trying again`);
        }
        await new Promise((resume) => { setTimeout(resume, RETRY_MS); });
    }
}

// Shown times of the present view, from the first sample on.
function range() {
    const end = view.end === null ? model.now(view.leg) : view.end;
    const first = model.legs[view.leg].samples.time[0];
    const from = first === undefined ? end - view.span : Math.max(end - view.span, first);
    return [Math.min(from, end - LEAST_SPAN), end];
}

function zoom(from, to) {
    view.paused = true;
    view.end = to;
    view.span = Math.max(to - from, LEAST_SPAN);
    stale = true;
}

function setPaused(paused) {
    view.end = paused && model.scene !== null ? range()[1] : null;
    view.paused = paused;
    stale = true;
}

function setSpan(step) {
    if (model.scene === null) {
        return;
    }
    // What is shown may be shorter than the span: the source has just begun.
    const [from, to] = range();
    const shown = step > 0 ? view.span : to - from;
    const longer = SPANS.filter((span) => span > shown * 1.001);
    const shorter = SPANS.filter((span) => span < shown * 0.999);
    const span = step > 0 ? longer[0] : shorter[shorter.length - 1];
    view.span = span === undefined ? view.span : span;
    stale = true;
}

function pan(share) {
    if (model.scene === null) {
        return;
    }
    const [, end] = range();
    view.paused = true;
    view.end = Math.min(end + share * view.span, model.now(view.leg));
    stale = true;
}

function save() {
    if (model.legs.length === 0) {
        return;
    }
    const leg = model.legs[view.leg];
    const [from, to] = range();
    const target = document.createElement("a");
    target.href = URL.createObjectURL(new Blob([csv(leg, from, to)], { type: "text/csv" }));
    target.download = `${leg.name.replace(/[^A-Za-z0-9._-]+/g, "-").slice(0, 60) || "leg"}-${to.toFixed(2)}s.csv`;
    target.click();
    setTimeout(() => URL.revokeObjectURL(target.href), RETRY_MS);
}

// Builds charts and choices for a new scene or another leg.
function layOut() {
    const key = [model.id, view.leg];
    if (view.laid !== null && view.laid.every((part, index) => part === key[index])) {
        return;
    }
    view.laid = key;
    view.leg = Math.min(view.leg, model.legs.length - 1);
    const leg = model.legs[view.leg];
    setText("name", model.legs.map((one) => one.name).join(", "));
    document.title = `Scarab live: ${leg.name}`;
    view.charts.forEach((chart) => chart.remove());
    view.charts = layouts(leg).map((layout) => new Chart(at("charts"), layout, zoom));
    const channels = at("channels");
    channels.replaceChildren(element("legend", "Channels"));
    for (const chart of view.charts) {
        chart.layout.curves.forEach((one, number) => {
            const box = document.createElement("input");
            box.type = "checkbox";
            box.checked = true;
            box.addEventListener("change", () => { chart.show(number, box.checked); stale = true; });
            const label = document.createElement("label");
            label.append(box, `${chart.layout.key}: ${one.label}`);
            channels.append(label);
        });
    }
    at("legs").hidden = model.legs.length < 2;
    at("leg").replaceChildren(...model.legs.map((one, index) => new Option(one.name, String(index), false, index === view.leg)));
    if (convergence === null) {
        convergence = new Convergence(at("convergence"), () => {});
    }
}

function showStatus(leg) {
    const { status } = leg;
    if (status === null) {
        return;
    }
    setText("doing", status.doing);
    setText("waits", status.left_s === null ? status.waits_for : `${status.waits_for}, ${status.left_s.toFixed(1)} s left`);
    setText("drive", status.drive);
    at("why").hidden = status.not_enabled === "";
    setText("not-enabled", status.not_enabled);
    setText("fault", status.fault === null ? UNKNOWN : status.fault || "none");
    at("fault").className = status.fault ? "alarm" : "";
    setText("limits", status.limits === null ? UNKNOWN : status.limits.join("; ") || "none acts");
    const speed = status.speed === null ? "" : `, ${status.speed.toFixed(status.speed < 10 ? 1 : 0)} of ${model.scene.speed} times real time`;
    setText("time", `${status.time_s.toFixed(1)} s${speed}, run ${status.run}`);
    setText("processor", status.processor || UNKNOWN);
    at("wire").hidden = status.bus === "";
    setText("bus", status.bus);
}

function showJoints(leg) {
    const count = leg.joints.length;
    const sample = leg.samples.last();
    const row = leg.rows.last();
    const degrees = (radian) => (radian === null || radian === undefined ? null : radian * 180 / Math.PI);
    const rows = leg.joints.map((joint, index) => {
        const line = document.createElement("tr");
        line.append(element("th", joint.name));
        const angle = cell(degrees(sample[index]), 4);
        angle.dataset.value = String(sample[index]);
        const commanded = cell(degrees(sample[count + index]), 4);
        commanded.dataset.value = String(sample[count + index]);
        line.append(angle, commanded, cell(row[index], 4), cell(row[count + index], 4), cell(sample[3 * count + index], 4));
        return line;
    });
    at("joints").tBodies[0].replaceChildren(...rows);
}

const ORIGINS = {
    motion: "Least squares over the exciting motion so far.",
    search: "Best of the running search",
    candidate: "Result of the search, not judged yet",
    result: "Judged result",
};

function showParameters(leg) {
    const { estimate } = leg;
    if (estimate === null || at("parameters").shown === estimate) {
        return;
    }
    at("parameters").shown = estimate;
    const search = estimate.iterations > 0 ? `, ${estimate.iterations} iterations.` : "";
    setText("origin", `${ORIGINS[estimate.origin] || estimate.origin}${search} At ${estimate.time_s.toFixed(1)} s. Sigma is one standard deviation.`);
    const rows = estimate.values.map((value) => {
        const line = document.createElement("tr");
        const known = value.value !== null && value.truth !== null && value.sigma > 0;
        line.append(element("th", value.name), cell(value.value, 4), cell(value.sigma, 2), element("td", value.unit));
        line.append(cell(value.truth, 4), cell(known ? (value.value - value.truth) / value.sigma : null, 2));
        return line;
    });
    at("parameters").tBodies[0].replaceChildren(...rows);
    const names = estimate.values.map((value) => value.name);
    const choice = at("parameter");
    if (names.join("\n") !== [...choice.options].map((option) => option.value).join("\n")) {
        view.parameter = names.includes(view.parameter) ? view.parameter : names[0];
        choice.replaceChildren(...names.map((name) => new Option(name, name, false, name === view.parameter)));
    }
}

function showOutcome(leg) {
    const { outcome } = leg;
    if (outcome === null || at("findings").shown === outcome) {
        return;
    }
    at("findings").shown = outcome;
    const verdict = at("verdict");
    verdict.hidden = outcome.verdict === "";
    verdict.className = `verdict ${outcome.verdict === "accepted" ? "accepted" : "refused"}`;
    const reasons = outcome.reasons.length === 0 ? "" : `: ${outcome.reasons.join(", ").replaceAll("_", " ")}`;
    const validated = outcome.verdict === "accepted" && !outcome.validated ? ", not validated" : "";
    setText("verdict", `Verdict: ${outcome.verdict}${validated}${reasons}`);
    const findings = outcome.findings || [];
    const failed = findings.filter((finding) => finding.passed !== true);
    setText("tests", findings.length === 0 ? "None evaluated yet." : `${findings.length} evaluated, ${failed.length} failed.`);
    const sorted = [...failed, ...findings.filter((finding) => finding.passed === true)];
    at("findings").tBodies[0].replaceChildren(...sorted.flatMap((finding) => {
        const line = element("tr", "", finding.passed === true ? "" : "failed");
        const joint = leg.joints[finding.joint - 1];
        line.append(element("td", finding.test.replaceAll("_", " ")), element("td", joint ? joint.name : ""));
        line.append(element("td", typeof finding.motion === "string" ? finding.motion : ""), cell(finding.value, 3), cell(finding.limit, 3));
        line.append(element("td", finding.passed === true ? "passed" : "failed"));
        if (finding.words === "") {
            return [line];
        }
        const why = element("tr", "", "failed");
        const words = element("td", finding.words, "words");
        words.colSpan = 6;
        why.append(words);
        return [line, why];
    }));
}

function showNotes() {
    const list = at("notes");
    const newest = model.notes[model.notes.length - 1];
    if (list.shown === newest) {
        return;
    }
    list.shown = newest;
    list.replaceChildren(...[...model.notes].reverse().map((note) => {
        const kind = ["note", "warning", "fault"].includes(note.weight) ? note.weight : "note";
        return element("li", `${note.time_s.toFixed(2)} s  ${note.words}`, kind);
    }));
}

function draw() {
    layOut();
    const leg = model.legs[view.leg];
    const [from, to] = range();
    drawStick(at("stick"), model.legs);
    view.charts.forEach((chart) => chart.draw(leg, from, to));
    convergence.draw(leg.estimates, view.parameter);
    at("pause").setAttribute("aria-pressed", String(view.paused));
    setText("span", `${from.toFixed(2)} to ${to.toFixed(2)} s`);
}

function readOut() {
    const leg = model.legs[view.leg];
    setText("source", model.scene.source);
    setText("dropped", String(model.dropped));
    showStatus(leg);
    showJoints(leg);
    showParameters(leg);
    showOutcome(leg);
    showNotes();
}

let drawn = 0;
let shown = 0;

// Draws at the screen's rate, or twice a second where motion shall be reduced.
function frame(now) {
    if (model.scene !== null && stale && (!calm.matches || now - drawn >= CALM_MS)) {
        stale = false;
        drawn = now;
        draw();
        if (now - shown >= READOUT_MS) {
            shown = now;
            readOut();
        } else {
            stale = true;
        }
    }
    window.requestAnimationFrame(frame);
}

const ACTIONS = {
    " ": () => setPaused(!view.paused),
    "+": () => setSpan(-1),
    "-": () => setSpan(1),
    ArrowLeft: () => pan(-0.25),
    ArrowRight: () => pan(0.25),
    Home: () => setPaused(false),
    e: save,
};

document.addEventListener("keydown", (event) => {
    const action = ACTIONS[event.key];
    const isControl = event.target instanceof Element && event.target.closest("button, select, input, a") !== null;
    if (action === undefined || event.ctrlKey || event.altKey || event.metaKey || (isControl && event.key !== "Home")) {
        return;
    }
    event.preventDefault();
    action();
});
at("pause").addEventListener("click", () => setPaused(!view.paused));
at("now").addEventListener("click", () => setPaused(false));
at("closer").addEventListener("click", () => setSpan(-1));
at("wider").addEventListener("click", () => setSpan(1));
at("export").addEventListener("click", save);
at("leg").addEventListener("change", (event) => { view.leg = Number(event.target.value); stale = true; });
at("parameter").addEventListener("change", (event) => { view.parameter = event.target.value; stale = true; });
new ResizeObserver(() => { stale = true; }).observe(at("stick"));
window.requestAnimationFrame(frame);
follow();
