// Charts of the live page: uPlot over the tracks of a leg. All charts share one time axis.
"use strict";

// Okabe and Ito's blue, vermilion and darkened bluish green, as in the figures of the reports.
const COLOURS = ["#0072b2", "#d55e00", "#00805f", "#1a1a1a"];
// Tints of them for wide curves, which thin ones of the full colour cross visibly.
const PALE = ["#9ec6e6", "#f3bd94", "#96ccbb", "#c8c8c8"];
const WIDE = 4;
const THIN = 1.4;
const DASH = [6, 4];
// Longer steps are gaps, s.
const GAP_S = 0.3;
const HEIGHT = 210;

// One curve: column of the track, factor to the shown unit.
function curve(label, colour, width, index, factor, dash) {
    return { label, colour, width, index, factor, dash, shown: true };
}

// The charts of one leg: title, unit, source track, curves.
function layouts(leg) {
    const count = leg.joints.length;
    const degrees = 180 / Math.PI;
    const pair = (first, second, words, factor) => leg.joints.flatMap((joint, index) => {
        const [colour, pale] = [COLOURS, PALE].map((palette) => palette[index % palette.length]);
        if (second === null) {
            return [curve(`${joint.name} ${words[0]}`, colour, THIN, first * count + index, factor)];
        }
        return [
            curve(`${joint.name} ${words[0]}`, pale, WIDE, first * count + index, factor),
            curve(`${joint.name} ${words[1]}`, colour, THIN, second * count + index, factor),
        ];
    });
    return [
        { key: "angle", title: "Angle, degrees", track: "samples", curves: pair(0, 1, ["measured", "commanded"], degrees) },
        { key: "torque", title: "Filtered torque, N m", track: "rows", curves: pair(0, 1, ["measured", "predicted"], 1) },
        { key: "current", title: "Current, A", track: "samples", curves: pair(3, null, ["measured"], 1) },
    ];
}

function plot(parent, curves, zoom, legend) {
    const options = {
        width: Math.max(parent.clientWidth, 200),
        height: HEIGHT,
        scales: { x: { time: false } },
        legend: { show: legend },
        cursor: { drag: { x: true, y: false, setScale: false } },
        axes: [{ label: null, values: (_, ticks) => ticks.map((tick) => `${tick} s`) }, { size: 58 }],
        series: [
            { label: "t", value: (_, value) => (value === null ? "–" : `${value.toFixed(2)} s`) },
            ...curves.map((one) => ({
                label: one.label,
                stroke: one.colour,
                width: one.width,
                dash: one.dash,
                points: { show: false },
                value: (_, value) => (value === null || value === undefined ? "–" : value.toPrecision(4)),
            })),
        ],
        hooks: {
            setSelect: [(chart) => {
                const { left, width } = chart.select;
                if (width > 3) {
                    zoom(chart.posToVal(left, "x"), chart.posToVal(left + width, "x"));
                    chart.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
                }
            }],
        },
    };
    return new uPlot(options, [[], ...curves.map(() => [])], parent);
}

// Columns with an empty point in every gap, so that no line crosses it.
function withGaps(columns) {
    const [time, ...values] = columns;
    for (let index = time.length - 1; index > 0; index -= 1) {
        if (time[index] - time[index - 1] > GAP_S) {
            time.splice(index, 0, (time[index] + time[index - 1]) / 2);
            values.forEach((column) => column.splice(index, 0, null));
        }
    }
    return columns;
}

// A chart of curves over one track.
class Chart {
    constructor(parent, layout, zoom) {
        this.layout = layout;
        this.box = document.createElement("div");
        this.box.className = "chart";
        const title = document.createElement("h3");
        title.textContent = layout.title;
        this.box.append(title);
        parent.append(this.box);
        this.plot = plot(this.box, layout.curves, zoom, true);
        this.resizing = new ResizeObserver(() => this.plot.setSize({ width: Math.max(this.box.clientWidth, 200), height: HEIGHT }));
        this.resizing.observe(this.box);
    }

    draw(leg, from, to) {
        if (this.box.hidden) {
            return;
        }
        const [time, ...columns] = withGaps(leg[this.layout.track].slice(from, to));
        const scaled = this.layout.curves.map(({ index, factor }) => columns[index].map((value) => (value === null ? null : value * factor)));
        this.plot.batch(() => {
            this.plot.setData([time, ...scaled], false);
            this.plot.setScale("x", { min: from, max: to });
        });
    }

    // Shows or hides a curve; a chart without curves disappears.
    show(number, shown) {
        this.layout.curves[number].shown = shown;
        this.plot.setSeries(number + 1, { show: shown });
        this.box.hidden = this.layout.curves.every((one) => !one.shown);
    }

    remove() {
        this.resizing.disconnect();
        this.plot.destroy();
        this.box.remove();
    }
}

// Value of one parameter over time, with one sigma to both sides.
class Convergence {
    constructor(parent, zoom) {
        const curves = [
            curve("value", COLOURS[0], 2, 0, 1),
            curve("+ sigma", COLOURS[0], 1, 1, 1, DASH),
            curve("- sigma", COLOURS[0], 1, 2, 1, DASH),
            curve("truth", COLOURS[1], THIN, 3, 1),
        ];
        this.plot = plot(parent, curves, zoom, true);
        this.resizing = new ResizeObserver(() => this.plot.setSize({ width: Math.max(parent.clientWidth, 200), height: HEIGHT }));
        this.resizing.observe(parent);
    }

    draw(estimates, name) {
        const points = [];
        for (const estimate of estimates) {
            const found = estimate.values.find((value) => value.name === name);
            if (found !== undefined && found.value !== null && found.sigma !== null) {
                points.push([estimate.time_s, found.value, found.value + found.sigma, found.value - found.sigma, found.truth]);
            }
        }
        const columns = [0, 1, 2, 3, 4].map((column) => points.map((point) => point[column]));
        this.plot.batch(() => {
            this.plot.setData(columns, false);
            if (points.length > 0) {
                const [first, last] = [points[0][0], points[points.length - 1][0]];
                this.plot.setScale("x", { min: first, max: Math.max(last, first + 1) });
            }
        });
    }
}

// Draws joints and links; the scale keeps the stretched leg inside.
function drawStick(canvas, legs) {
    const ratio = window.devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
        [canvas.width, canvas.height] = [Math.round(width * ratio), Math.round(height * ratio)];
    }
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    const length = (points) => points.slice(1).reduce((sum, point, index) => sum + Math.hypot(point[0] - points[index][0], point[1] - points[index][1]), 0);
    const reach = Math.max(0.1, ...legs.map((leg) => length(leg.points)));
    const scale = Math.min((height - 60) / (1.15 * reach), width / (1.6 * reach));
    legs.forEach((leg, number) => {
        const x0 = width * (number + 0.5) / legs.length;
        const place = (point) => [x0 + scale * point[0], 36 + scale * (0.15 * reach + point[1])];
        pen.lineCap = "round";
        leg.points.slice(1).forEach((point, index) => {
            pen.strokeStyle = COLOURS[index % COLOURS.length];
            pen.lineWidth = 9 - 2 * Math.min(index, 3);
            pen.beginPath();
            pen.moveTo(...place(leg.points[index]));
            pen.lineTo(...place(point));
            pen.stroke();
        });
        leg.points.slice(0, -1).forEach((point, index) => {
            const [x, y] = place(point);
            pen.fillStyle = "#fff";
            pen.strokeStyle = "#1a1a1a";
            pen.lineWidth = 2;
            pen.beginPath();
            pen.arc(x, y, 6, 0, 2 * Math.PI);
            pen.fill();
            pen.stroke();
            pen.fillStyle = "#1a1a1a";
            pen.font = "13px system-ui, sans-serif";
            pen.fillText(leg.joints[index] ? leg.joints[index].name.slice(0, 24) : "", x + 12, y - 8);
        });
    });
}
