// Data of the live page, without DOM: checks messages, stores points in bounded arrays, writes CSV.
"use strict";

// Points of one track, and estimates of one leg. The oldest half goes when a track is full.
const MOST_POINTS = 12000;
const MOST_ESTIMATES = 3000;
const MOST_NOTES = 200;

// A time series of several columns.
class Track {
    constructor(columns) {
        this.time = [];
        this.columns = Array.from({ length: columns }, () => []);
    }

    // Times grow; a time before the last one belongs to another run of the program.
    push(time, values) {
        if (this.time.length > 0 && time <= this.time[this.time.length - 1]) {
            this.clear();
        }
        if (this.time.length >= MOST_POINTS) {
            this.time.splice(0, MOST_POINTS / 2);
            this.columns.forEach((column) => column.splice(0, MOST_POINTS / 2));
        }
        this.time.push(time);
        this.columns.forEach((column, index) => column.push(values[index]));
    }

    clear() {
        this.time.length = 0;
        this.columns.forEach((column) => { column.length = 0; });
    }

    // First index at or after a time.
    at(time) {
        let low = 0;
        let high = this.time.length;
        while (low < high) {
            const middle = (low + high) >> 1;
            if (this.time[middle] < time) {
                low = middle + 1;
            } else {
                high = middle;
            }
        }
        return low;
    }

    // Times and columns from one time to another, with a point beyond each end.
    slice(from, to) {
        const first = Math.max(this.at(from) - 1, 0);
        const last = this.at(to) + 1;
        return [this.time, ...this.columns].map((column) => column.slice(first, last));
    }

    // Values of the newest point.
    last() {
        return this.columns.map((column) => column[column.length - 1]);
    }
}

class Bad extends Error {}

function need(holds, what) {
    if (!holds) {
        throw new Bad(what);
    }
}

const isObject = (value) => typeof value === "object" && value !== null && !Array.isArray(value);
const isNumber = (value) => typeof value === "number" && Number.isFinite(value);
const isKnown = (value) => value === null || isNumber(value);
const isText = (value) => typeof value === "string" && value.length < 20000;

function list(message, key) {
    const value = message[key] === undefined ? [] : message[key];
    need(Array.isArray(value) && value.every(isObject), `${key} is not a list of objects`);
    return value;
}

function numbers(value, count, what, test = isNumber) {
    need(Array.isArray(value) && value.length === count && value.every(test), `${what} has not ${count} numbers`);
}

function texts(owner, keys, what) {
    keys.forEach((key) => need(isText(owner[key]), `${key} of ${what} is not a text`));
}

// Everything that the source reported.
class Model {
    constructor() {
        this.next = null;
        this.id = null;
        this.dropped = 0;
        this.reset(null);
    }

    reset(scene) {
        this.scene = scene;
        this.notes = [];
        this.legs = (scene ? scene.legs : []).map((leg) => ({
            name: leg.name,
            joints: leg.joints,
            samples: new Track(4 * leg.joints.length),
            rows: new Track(2 * leg.joints.length),
            points: [],
            estimates: [],
            estimate: null,
            status: null,
            outcome: null,
        }));
    }

    // Takes the text of one message; throws Bad, and then nothing of it was taken.
    take(text) {
        let message;
        try {
            message = JSON.parse(text);
        } catch (error) {
            throw new Bad("it is not JSON");
        }
        need(isObject(message), "it is not an object");
        need(Number.isSafeInteger(message.next) && message.next >= 0, "next is not a count");
        const scene = message.scene;
        const legs = scene === undefined ? this.legs : this.checkScene(message);
        const parts = this.checkParts(message, legs);
        if (scene !== undefined && (this.scene === null || message.id !== this.id)) {
            this.reset(scene);
            this.id = message.id;
        }
        this.store(message, parts);
    }

    checkScene(message) {
        const scene = message.scene;
        need(isObject(scene) && Array.isArray(scene.legs) && scene.legs.length > 0 && scene.legs.length <= 8, "the scene has no legs");
        texts(scene, ["source"], "the scene");
        need(isNumber(scene.speed) && isNumber(message.id), "the scene has no speed or no id");
        for (const leg of scene.legs) {
            need(isObject(leg) && Array.isArray(leg.joints) && leg.joints.length > 0 && leg.joints.length <= 8, "a leg has no joints");
            texts(leg, ["name"], "a leg");
            leg.joints.forEach((joint) => {
                need(isObject(joint), "a joint is not an object");
                texts(joint, ["name"], "a joint");
            });
        }
        return scene.legs;
    }

    checkParts(message, legs) {
        const parts = {};
        for (const key of ["samples", "rows", "estimates", "latest", "status", "outcomes"]) {
            parts[key] = list(message, key);
            const isLeg = (leg) => Number.isInteger(leg) && leg >= 0 && leg < legs.length;
            parts[key].forEach((part) => need(isLeg(part.leg), `${key} of an unknown leg`));
        }
        parts.notes = list(message, "notes");
        for (const key of ["samples", "rows", "estimates", "latest", "status", "notes"]) {
            parts[key].forEach((part) => need(isNumber(part.time_s), `${key} without a time`));
        }
        for (const sample of parts.samples) {
            const count = legs[sample.leg].joints.length;
            ["angle_rad", "commanded_rad", "torque_nm", "current_a"].forEach((key) => numbers(sample[key], count, key, isKnown));
            need(Array.isArray(sample.points_m) && sample.points_m.length <= 9, "points_m is not a list");
            sample.points_m.forEach((point) => numbers(point, 2, "a point"));
        }
        for (const row of parts.rows) {
            const count = legs[row.leg].joints.length;
            ["measured_nm", "predicted_nm"].forEach((key) => numbers(row[key], count, key, isKnown));
        }
        for (const estimate of [...parts.estimates, ...parts.latest]) {
            texts(estimate, ["origin"], "an estimate");
            need(Array.isArray(estimate.values) && estimate.values.length <= 200, "an estimate has no values");
            for (const value of estimate.values) {
                need(isObject(value), "a parameter is not an object");
                texts(value, ["name", "unit"], "a parameter");
                need([value.value, value.sigma, value.truth].every(isKnown), "a parameter is not a number");
            }
        }
        for (const status of parts.status) {
            texts(status, ["drive", "doing", "waits_for", "not_enabled", "processor", "bus"], "a status");
            need(status.fault === null || isText(status.fault), "fault is not a text");
            need(status.limits === null || (Array.isArray(status.limits) && status.limits.every(isText)), "limits are not texts");
            need([status.left_s, status.speed, status.run].every(isKnown), "a status has no numbers");
        }
        for (const outcome of parts.outcomes) {
            texts(outcome, ["verdict"], "an outcome");
            need(Array.isArray(outcome.reasons) && outcome.reasons.every(isText), "reasons are not texts");
            list(outcome, "findings").forEach((finding) => {
                texts(finding, ["test", "words"], "a test");
                need(isKnown(finding.value) && isKnown(finding.limit), "a test has no numbers");
            });
        }
        parts.notes.forEach((note) => texts(note, ["weight", "words"], "a note"));
        return parts;
    }

    store(message, parts) {
        this.next = message.next;
        this.dropped += isNumber(message.dropped) ? message.dropped : 0;
        for (const sample of parts.samples) {
            const leg = this.legs[sample.leg];
            leg.samples.push(sample.time_s, [...sample.angle_rad, ...sample.commanded_rad, ...sample.torque_nm, ...sample.current_a]);
            leg.points = sample.points_m;
        }
        for (const row of parts.rows) {
            this.legs[row.leg].rows.push(row.time_s, [...row.measured_nm, ...row.predicted_nm]);
        }
        for (const estimate of parts.estimates) {
            const { estimates } = this.legs[estimate.leg];
            const last = estimates[estimates.length - 1];
            if (last !== undefined && estimate.time_s < last.time_s) {
                estimates.length = 0;
            }
            if (estimates.length >= MOST_ESTIMATES) {
                estimates.splice(0, MOST_ESTIMATES / 2);
            }
            estimates.push(estimate);
        }
        for (const estimate of [...parts.estimates, ...parts.latest]) {
            const leg = this.legs[estimate.leg];
            if (leg.estimate === null || estimate.time_s >= leg.estimate.time_s) {
                leg.estimate = estimate;
            }
        }
        parts.status.forEach((status) => { this.legs[status.leg].status = status; });
        parts.outcomes.forEach((outcome) => { this.legs[outcome.leg].outcome = outcome; });
        this.notes.push(...parts.notes);
        this.notes.splice(0, Math.max(this.notes.length - MOST_NOTES, 0));
    }

    // Newest time of a leg, s.
    now(leg) {
        const { time } = this.legs[leg].samples;
        return time.length > 0 ? time[time.length - 1] : 0;
    }
}

// Samples of a leg from one time to another, in the format of `replay`.
function csv(leg, from, to) {
    const count = leg.joints.length;
    const joints = Array.from({ length: count }, (_, index) => index);
    const header = ["t_s", ...joints.map((joint) => `q${joint + 1}_rad`), ...joints.map((joint) => `tau${joint + 1}_Nm`)];
    const lines = [header.join(",")];
    const { time, columns } = leg.samples;
    for (let index = leg.samples.at(from); index < time.length && time[index] <= to; index += 1) {
        const values = joints.map((joint) => columns[joint][index]);
        values.push(...joints.map((joint) => columns[2 * count + joint][index]));
        if (values.every(isNumber)) {
            lines.push([time[index], ...values].join(","));
        }
    }
    return `${lines.join("\n")}\n`;
}
