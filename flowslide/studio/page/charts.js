// Small charts of what a job has found: what a search tried, which measurement asks for which strength.

import { el } from "./ui.js";

/** An element of SVG. */
export function draw(tag, attributes, text = "") {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.textContent = text;
  return made;
}

const short = (value) => (Math.abs(value) >= 100 ? value.toFixed(0) : value.toFixed(1));

/** What a search has tried: every parameter against the number of simulations. */
export function historyChart(history, now) {
  const [width, height, left, right, top, foot] = [308, 96, 34, 8, 8, 18];
  const names = Object.keys(history[0].values);
  const values = history.flatMap((one) => Object.values(one.values));
  let [low, high] = [Math.min(...values), Math.max(...values)];
  if (high - low < 1e-9) [low, high] = [low - 1, high + 1];
  const last = Math.max(history.at(-1).runs, 1);
  const x = (runs) => left + ((width - left - right) * runs) / last;
  const y = (value) => top + ((height - top - foot) * (high - value)) / (high - low);
  const chart = draw("svg", { viewBox: `0 0 ${width} ${height}`, class: "history", role: "img" });
  const end = names.map((name) => `${name.replaceAll("_", " ")} ${short(history.at(-1).values[name])}`).join(", ");
  chart.append(draw("title", {}, `tried so far, after ${last} simulations: ${end}`));
  for (const value of [low, high]) {
    chart.append(draw("line", { class: "axis", x1: left, x2: width - right, y1: y(value), y2: y(value) }));
    chart.append(draw("text", { x: left - 4, y: y(value) + 3, "text-anchor": "end" }, short(value)));
  }
  names.forEach((name, i) => {
    const points = history.map((one) => `${x(one.runs)},${y(one.values[name])}`).join(" ");
    chart.append(draw("polyline", { class: i ? "line other" : "line", points }));
  });
  for (const one of history) {
    chart.append(draw("circle", { class: "value", cx: x(one.runs), cy: y(one.values[names[0]]), r: 2.5 }));
  }
  const words = `${names[0].replaceAll("_", " ")}${names.length > 1 ? " and others (dashed)" : ""}, by simulation`;
  chart.append(draw("text", { x: left, y: height - 4 }, words));
  chart.append(draw("text", { x: width - right, y: height - 4, "text-anchor": "end" }, `${last}${now === "running" ? " ..." : ""}`));
  return chart;
}

const WIDTH = 308; // of a row of marks
const EDGE = 6; // on both sides

/** Round numbers for an axis from `low` to `high`: three to six of them. */
function ticks(low, high) {
  const rough = (high - low) / 4;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 2.5, 5, 10].map((one) => one * power).find((one) => one >= rough);
  const first = Math.ceil(low / step);
  return Array.from({ length: Math.floor(high / step) - first + 1 }, (_, k) => Number(((first + k) * step).toPrecision(6)));
}

const sign = { fitted: "circle", "held out": "diamond", compared: "square" };

/** A mark at (x, y); its shape says what it is, and the words next to it say it as well. */
export function mark(shape, x, y, more = "") {
  const at = (...points) => points.map(([a, b]) => `${x + a},${y + b}`).join(" ");
  const shapes = {
    circle: ["circle", { cx: x, cy: y, r: 4.5 }],
    square: ["polygon", { points: at([-4, -4], [4, -4], [4, 4], [-4, 4]) }],
    diamond: ["polygon", { points: at([0, -5.5], [5.5, 0], [0, 5.5], [-5.5, 0]) }],
    less: ["polygon", { points: at([-6, 0], [4, -5], [4, 5]) }],
    more: ["polygon", { points: at([6, 0], [-4, -5], [-4, 5]) }],
    cross: ["path", { d: `M${x - 4} ${y - 4}l8 8m0-8l-8 8` }],
  };
  const [tag, attributes] = shapes[shape];
  return draw(tag, { class: `mark ${shape} ${more}`, ...attributes });
}

/** The strengths that the axis shows [kPa]: the answer, its interval, and all that is asked for. */
function rangeOf({ value, low, high, tried, rows }) {
  const known = [value, low, high, ...tried, ...rows.flatMap((row) => [row.value, row.low, row.high, ...row.also])].filter((one) => one !== null);
  const [first, last] = [Math.min(...known), Math.max(...known)];
  const room = 0.08 * Math.max(last - first, 0.2 * value);
  return [Math.max(first - room, 0), last + room];
}

/** Which measurement asks for which strength [kPa]: in words, and as marks over the answer's interval. */
export function impliedChart(found, isOpen) {
  const [from, to] = rangeOf(found);
  const x = (value) => EDGE + ((WIDTH - 2 * EDGE) * (Math.min(Math.max(value, from), to) - from)) / (to - from);
  const strip = (height) => draw("svg", { viewBox: `0 0 ${WIDTH} ${height}`, "aria-hidden": "true" });
  const band = (height) => [
    draw("rect", { class: "band", x: x(found.low), width: Math.max(x(found.high ?? to) - x(found.low), 1), y: 0, height }),
    draw("line", { class: "answer", x1: x(found.value), x2: x(found.value), y1: 0, y2: height }),
  ];
  const rows = found.rows.map((row) => {
    const marks = strip(18);
    marks.append(...band(18), ...rowMarks(row, x, to));
    const item = el("div", { role: "listitem" }, el("span", {}, el("b", { textContent: row.name }), ` (${row.role}): ${row.words}`), marks);
    item.dataset.status = row.status;
    return item;
  });
  const axis = strip(16);
  axis.append(draw("line", { class: "axis", x1: EDGE, x2: WIDTH - EDGE, y1: 0.5, y2: 0.5 }));
  for (const value of ticks(from, to)) {
    axis.append(draw("line", { class: "axis", x1: x(value), x2: x(value), y1: 0, y2: 4 }));
    axis.append(draw("text", { x: x(value), y: 13, "text-anchor": "middle" }, String(value)));
  }
  return el("details", { className: "implied", open: isOpen, "data-key": "implied" },
    el("summary", { textContent: "Which measurement asks for which strength?" }),
    el("p", { className: "note", textContent: `Band: ${found.label}, ${found.words}.` }),
    el("div", { role: "list", "aria-label": `strength that each measurement asks for, ${found.label}` }, ...rows),
    axis,
    el("p", { className: "note", textContent: `kPa. ${found.how}` }));
}

function rowMarks(row, x, to) {
  if (row.status === "nothing") return [draw("line", { class: "silent", x1: EDGE, x2: WIDTH - EDGE, y1: 9, y2: 9 })];
  const made = [];
  if (row.status === "met") {
    const [low, high] = [row.is_limit ? row.value : row.low ?? 0, row.high ?? to];
    made.push(draw("line", { class: `bar ${sign[row.role]}`, x1: x(low), x2: x(high), y1: 9, y2: 9 }));
    made.push(...row.also.map((value) => mark(sign[row.role], x(value), 9, "hollow")));
  }
  const shape = row.is_limit ? "more" : { met: sign[row.role], unmet: "cross" }[row.status] ?? row.status;
  return [...made, mark(shape, x(row.value), 9, sign[row.role])];
}

/** How the hypotheses stand: a bar for what a score promises, a full one for what a refit has found. */
export function rankingChart({ ranking, looked_at: count, state }) {
  const falls = ranking.map(({ promised, refitted }) => [Math.max(promised ?? 0, 0), refitted === null ? null : Math.max(refitted, 0)]);
  const most = Math.max(1e-9, ...falls.flat().filter((one) => one !== null));
  const x = (value) => EDGE + ((WIDTH - 2 * EDGE) * value) / most;
  const items = ranking.map(({ words, promised, refitted }, i) => {
    const row = draw("svg", { viewBox: `0 0 ${WIDTH} 9`, "aria-hidden": "true" });
    row.append(draw("rect", { class: "promise", x: EDGE, y: 1, width: x(falls[i][0]) - EDGE, height: 7 }));
    if (refitted !== null) row.append(draw("rect", { class: "fall", x: EDGE, y: 2.5, width: Math.max(x(falls[i][1]) - EDGE, 1), height: 4 }));
    const told = refitted === null ? `${short(promised ?? 0)} promised` : `${short(refitted)} found`;
    return el("div", { role: "listitem" }, el("span", {}, `${words}: `, el("b", { textContent: told })), row);
  });
  const going = state === "running" ? " so far" : "";
  return el("details", { className: "ranking", open: true, "data-key": "ranking" },
    el("summary", { textContent: `Which hypothesis explains most? ${count} looked at${going}` }),
    el("div", { role: "list", "aria-label": "hypotheses, the best first" }, ...items),
    el("p", { className: "note", textContent: "By how much chi² falls: pale as scores promise, full as found when all is calibrated again. Noise alone promises some." }));
}
