// The page: a case, its sliders, the deposit that follows, its measurements.

import { answers } from "./answer.js";
import { get, Sliders } from "./api.js";
import { View } from "./view.js";

const $ = (id) => document.getElementById(id);
const view = new View($("canvas"), $("legend"));
const SPACINGS = [0.5, 0.75, 1, 1.5, 2, 3, 4];

const state = { workspace: null, name: "", found: null, changes: null, effects: {}, spacing: 2, playing: false, film: false, answered: 0 };
const sliders = new Sliders({
  connected(is) { say(is ? "connected" : "the server is gone: start it again, this page connects by itself", !is); },
  deposit: show,
  failed(message) { say(message, true); },
});

function say(words, bad = false) {
  $("status").textContent = words;
  $("status").className = bad ? "bad" : "";
}

// --- the case ---

async function open(name) {
  const found = await get(`/api/cases/${name}`);
  Object.assign(state, { name, found, effects: {} });
  history.replaceState(null, "", `#${name}`);
  $("origin").textContent = found.shipped ? "ships with flowslide, read only" : found.draft ? "draft with faults" : "";
  view.deposit = null;
  if (found.faults.length) {
    say(`${found.faults[0].document}: ${found.faults[0].message}`, true);
  }
  state.changes = { strengths_kpa: {}, friction_deg: {} };
  view.level = undefined;
  state.spacing = coarse(found.scene);
  fillSpacings();
  buildSliders();
  buildEffects();
  readings([]);
  view.marks = [];
  view.show(found.scene);
  view.paintLegend();
  ask(false);
}

/** At most some thousand points, so that an answer comes at once. */
function coarse(scene) {
  const area = scene.zones.reduce((sum, zone) => sum + Math.abs(shoelace(zone.polygon)), 0);
  const fits = SPACINGS.find((spacing) => area / spacing ** 2 <= 1600) ?? SPACINGS.at(-1);
  return Math.max(fits, scene.spacing);
}

function shoelace(ring) {
  return ring.reduce((sum, [x, y], i) => {
    const [u, v] = ring[(i + 1) % ring.length];
    return sum + 0.5 * (x * v - u * y);
  }, 0);
}

// --- sliders ---

function buildSliders() {
  const { scene } = state.found;
  // What liquefied first: it is what is looked for.
  const soils = Object.entries(scene.materials).sort(([, a], [, b]) => Boolean(b.liquefied) - Boolean(a.liquefied));
  const rows = soils.map(([name, soil]) => {
    const words = name.replaceAll("_", " ");
    if (soil.liquefied || soil.friction_deg === 0) {
      const label = soil.liquefied ? `S_r, ${words}` : `strength, ${words}`;
      return slider(label, "kPa", soil.cohesion_kpa, 0, nice(3 * Math.max(soil.cohesion_kpa, 10)), 0.1,
        (value) => { state.changes.strengths_kpa[name] = value; });
    }
    return slider(`friction, ${words}`, "deg", soil.friction_deg, 15, 50, 0.5,
      (value) => { state.changes.friction_deg[name] = value; });
  });
  const top = Math.max(...scene.zones.flatMap((zone) => zone.polygon.map(([, y]) => y)));
  const low = Math.min(...scene.ground.points.map(([, y]) => y));
  if (scene.water_level !== null && scene.water_level !== undefined) {
    rows.push(slider("pool level", "m", scene.water_level, low, top, 0.1, (value) => {
      state.changes.water_level = value;
      view.level = value;
      view.draw();
    }));
  }
  $("sliders").replaceChildren(...rows);
}

let made = 0;

function slider(words, unit, value, low, high, step, set) {
  const id = `slider-${made += 1}`;
  const row = document.createElement("div");
  row.className = "slider";
  const label = document.createElement("label");
  label.htmlFor = id;
  const number = Object.assign(document.createElement("input"), { type: "number", value, step, min: low });
  number.setAttribute("aria-label", `${words} [${unit}]`);
  const right = document.createElement("span");
  right.append(number, " ", Object.assign(document.createElement("span"), { className: "unit", textContent: unit }));
  label.append(words, right);
  const range = Object.assign(document.createElement("input"), { type: "range", id, min: low, max: high, step, value });
  const change = (source, other, film) => {
    const now = Number(source.value);
    if (source.value === "" || !Number.isFinite(now)) return;
    other.value = now;
    set(now);
    ask(film);
  };
  range.addEventListener("input", () => change(range, number, false));
  range.addEventListener("change", () => change(range, number, true));
  number.addEventListener("change", () => change(number, range, true));
  row.append(label, range);
  return row;
}

const nice = (value) => Math.ceil(value / 10) * 10;

function buildEffects() {
  const choice = document.createElement("select");
  choice.setAttribute("aria-label", "add an effect");
  choice.append(new Option("add an effect ...", ""));
  for (const one of state.workspace.effects) {
    if (!(one.name in state.effects)) choice.append(new Option(one.name.replaceAll("_", " "), one.name));
  }
  choice.addEventListener("change", () => {
    const one = state.workspace.effects.find(({ name }) => name === choice.value);
    state.effects[one.name] = one.ladder[1];
    buildEffects();
    ask(true);
  });
  const rows = Object.entries(state.effects).map(([name, amplitude]) => {
    const one = state.workspace.effects.find((effect) => effect.name === name);
    const row = slider(name.replaceAll("_", " "), one.unit, amplitude, one.low < 0 ? -one.ladder[2] * 2 : 0,
      one.ladder[2] * 2, one.ladder[0] / 20, (value) => { state.effects[name] = value; });
    row.title = one.meaning;
    const off = Object.assign(document.createElement("button"), { textContent: "remove" });
    off.addEventListener("click", () => { delete state.effects[name]; buildEffects(); ask(true); });
    row.append(off);
    return row;
  });
  $("effects").replaceChildren(...rows, choice);
}

function fillSpacings() {
  const all = [...new Set([...SPACINGS, state.found.scene.spacing, state.spacing])].sort((a, b) => a - b);
  $("spacing").replaceChildren(...all.map((value) => new Option(`${value} m`, value, false, value === state.spacing)));
}

// --- the answer ---

let asked = 0;

/** The deposit first; the way there, with `film`, when it is shown. */
function ask(film) {
  if (state.found.faults.some(({ document }) => document === "scene")) return;
  state.film = film;
  asked = performance.now();
  say("simulating ...");
  question(false);
}

function question(film) {
  sliders.ask({
    type: "run", case: state.name, spacing_m: state.spacing, film,
    changes: state.changes,
    effects: Object.entries(state.effects).map(([name, amplitude]) => ({ name, amplitude })),
  });
}

function show(found) {
  const way = view.deposit && found.header.times.length > 1;
  view.deposit = found;
  const last = found.header.times.length - 1;
  view.frame = last;
  $("scrub").max = last;
  $("scrub").value = last;
  tell();
  readings(found.header.readings);
  const { fitted, held_out: held } = found.header.chi2;
  const numbers = found.header.readings.filter((one) => one.in_std !== null);
  $("misfit").textContent = numbers.length
    ? `Squared, in standard deviations of the survey: ${fitted.toFixed(1)} fitted, ${held.toFixed(1)} held out.` : "";
  view.marks = marks(found.header.readings);
  view.paintLegend();
  view.draw();
  if (way) return; // the film of what is shown already
  const took = ((performance.now() - asked) / 1000).toFixed(2);
  const { points, computed_s: computed, cached, came_to_rest: rest } = found.header;
  say(`${points.toLocaleString("en")} points, ${rest ? "at rest" : "still moving"} after `
    + `${found.header.times[last].toFixed(1)} s; answered in ${took} s`
    + (cached ? ", kept from before" : `, ${computed.toFixed(2)} s of it simulated`));
  state.answered += 1;
  document.body.dataset.answered = String(state.answered);
  if (state.film) setTimeout(() => question(true));
}

/** Toes, measured and simulated, as places on the section. */
function marks(rows) {
  const feet = state.found.derived?.feet ?? {};
  return rows.filter((row) => row.measured !== null && /toe runout/.test(row.label)).flatMap((row) => {
    const entry = Object.values(state.found.measurements.sets).flat().find(({ name }) => name === row.name);
    const side = entry?.side ?? "left";
    const place = (way) => (side === "left" ? feet[side] - way : feet[side] + way);
    const found = [{ x: place(row.measured), words: "measured toe", colour: "--ink" }];
    if (row.simulated !== null) found.push({ x: place(row.simulated), words: "simulated", colour: "--accent", low: true });
    return found;
  });
}

function readings(rows) {
  const body = $("readings").tBodies[0];
  body.replaceChildren(...rows.map((row) => {
    const line = document.createElement("tr");
    const off = row.in_std;
    const cells = [
      row.label + (row.held_out ? " (held out)" : ""),
      row.measured === null ? "" : `${row.below}${row.measured.toFixed(1)}${row.std === null ? "" : ` ± ${row.std}`}`,
      row.trouble || row.simulated === null ? "not read" : `${row.simulated.toFixed(1)} ${row.unit}`,
      off === null ? "" : (off > 0 ? "+" : "") + off.toFixed(1),
    ];
    cells.forEach((text, i) => {
      const cell = Object.assign(line.insertCell(), { textContent: text });
      if (i === 3 && off !== null) cell.className = Math.abs(off) > 2 ? "far" : Math.abs(off) < 1 ? "near" : "";
    });
    return line;
  }));
}

// --- the film ---

function tell() {
  const times = view.deposit?.header.times;
  $("time").value = times ? `${times[view.frame].toFixed(1)} s` : "-";
}

function play() {
  if (!view.deposit) return;
  if (view.deposit.header.times.length < 2) {
    // The sliders bring the deposit alone; the way there is asked for when somebody looks.
    state.playing = true;
    $("play").textContent = "Pause";
    ask(true);
    const wait = setInterval(() => {
      if (view.deposit.header.times.length > 1) { clearInterval(wait); view.frame = 0; step(); }
    }, 40);
    return;
  }
  state.playing = !state.playing;
  $("play").textContent = state.playing ? "Pause" : "Play";
  if (state.playing && view.frame >= view.deposit.header.times.length - 1) view.frame = 0;
  if (state.playing) step();
}

function step() {
  if (!state.playing) return;
  const last = view.deposit.header.times.length - 1;
  view.frame = Math.min(view.frame + 1, last);
  $("scrub").value = view.frame;
  tell();
  view.draw();
  if (view.frame === last) { state.playing = false; $("play").textContent = "Play"; return; }
  setTimeout(step, 60);
}

// --- the page ---

function keys(event) {
  if (/^(INPUT|SELECT|TEXTAREA)$/.test(event.target.tagName) || event.ctrlKey || event.metaKey) return;
  const act = { t: theme, f: () => { view.fit(); view.draw(); }, r: () => open(state.name), " ": play }[event.key];
  if (act && !(event.key === " " && event.target.tagName === "BUTTON")) { act(); event.preventDefault(); }
}

function theme() {
  const root = document.documentElement;
  const dark = root.dataset.theme === "dark";
  root.dataset.theme = dark ? "light" : "dark";
  localStorage.setItem("theme", root.dataset.theme);
  view.draw();
}

async function start() {
  document.documentElement.dataset.theme = localStorage.getItem("theme")
    ?? (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
  state.workspace = await get("/api/workspace");
  const { cases } = state.workspace;
  $("case").replaceChildren(...cases.map(({ name }) => new Option(name.replaceAll("_", " "), name)));
  $("case").addEventListener("change", () => open($("case").value));
  $("spacing").addEventListener("change", () => { state.spacing = Number($("spacing").value); ask(false); });
  $("reset").addEventListener("click", () => open(state.name));
  $("theme").addEventListener("click", theme);
  $("play").addEventListener("click", play);
  $("scrub").addEventListener("input", () => { view.frame = Number($("scrub").value); tell(); view.draw(); });
  $("colour").addEventListener("change", () => { view.colour = $("colour").value; view.paintLegend(); view.draw(); });
  $("before").addEventListener("change", () => { view.before = $("before").checked; view.draw(); });
  $("fit").addEventListener("click", () => { view.fit(); view.draw(); });
  document.addEventListener("keydown", keys);
  answers(state, say);
  const wanted = decodeURIComponent(location.hash.slice(1)) || state.workspace.first;
  const name = cases.some((one) => one.name === wanted) ? wanted : cases[0]?.name;
  if (!name) { say(`no case in ${state.workspace.folder}`, true); return; }
  $("case").value = name;
  await open(name);
}

start().catch((error) => say(error.message, true));
