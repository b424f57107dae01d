// The page: a case that is drawn, surveyed, and flows at every move of a slider.

import { answers } from "./answer.js";
import { get, send, Sliders, upload } from "./api.js";
import { Documents } from "./documents.js";
import { Editor, TOOLS } from "./editor.js";
import { area } from "./section.js";
import { SectionPanel } from "./section_panel.js";
import { SurveyPanel } from "./survey_panel.js";
import { button } from "./ui.js";
import { Underlay } from "./underlay.js";
import { View } from "./view.js";

const $ = (id) => document.getElementById(id);
const view = new View($("canvas"), $("legend"));
const SPACINGS = [0.25, 0.5, 0.75, 1, 1.5, 2, 3, 4];
const GRIDS = [0.1, 0.25, 0.5, 1, 2, 5, 10];

const state = { workspace: null, name: "", found: null, changes: null, effects: {}, spacing: 2, playing: false, film: false, answered: 0,
  mode: "slide", fresh: false };
const sliders = new Sliders({
  connected(is) { say(is ? "connected" : "the server is gone: start it again, this page connects by itself", !is); },
  deposit: show,
  failed(message) { say(message, true); },
});

function say(words, bad = false) {
  $("status").textContent = words;
  $("status").className = bad ? "bad" : "";
}

// --- the case: drawn, surveyed, saved ---

const documents = new Documents({
  changed(words) {
    // Older answers are of another section.
    state.fresh = false;
    view.deposit = null;
    view.marks = [];
    view.preview(documents.now.scene);
    view.paintLegend();
    say(`${words}; saving ...`);
    refresh();
  },
  saved(found) {
    state.found = found;
    take(found);
    say(found.faults.length ? `kept as a draft: ${found.faults[0].message}` : "saved", found.faults.length > 0);
    document.body.dataset.saved = found.revision;
    proposeOnce();
    if (state.mode !== "section") flow();
  },
  conflict(found) { apart("This case was changed elsewhere while you edited it.", found); },
  elsewhere: async () => { say("changed elsewhere: shown as it is now"); await open(state.name, true); },
  failed(words) { say(words, true); },
});

const editor = new Editor(view, {
  scene: () => documents.now.scene,
  edit: (words, change) => documents.edit(words, change),
  select: () => sectionPanel.show(),
  drawing,
  say,
});

const page = {
  view, editor, documents, say, refresh,
  get materials() { return state.workspace.materials; },
  get forms() { return state.workspace.measurements; },
  summary() {
    const { derived, shipped } = state.found;
    if (shipped) return "This case ships with flowslide. Copy it to edit it.";
    if (!derived) return "Not checked yet.";
    return `Nothing is wrong. ${derived.points.toLocaleString("en")} points ${derived.spacing_m} m apart.`;
  },
  propose,
};
const underlay = page.underlay = new Underlay(page);
const sectionPanel = new SectionPanel($("section-left"), $("section-right"), page);
const surveyPanel = new SurveyPanel($("survey-left"), $("survey-right"), page);

function refresh() {
  sectionPanel.show();
  surveyPanel.show();
  $("undo").disabled = !documents.canUndo;
  $("redo").disabled = !documents.canRedo;
  view.draw();
}

/** What the server says of the documents: faults and marks, where they are shown. */
function take(found) {
  const of = (part) => found.faults.filter(({ document }) => document === part);
  editor.faults = sectionPanel.faults = of("scene");
  surveyPanel.faults = found.faults.filter(({ document }) => document !== "scene");
  showMarks();
  view.preview(documents.now.scene);
  view.paintLegend();
  refresh();
}

/** What was surveyed, over the section; in the slide the toes are marked as they compare. */
function showMarks() {
  const marks = state.found.derived?.marks ?? [];
  editor.marks = state.mode === "slide" ? marks.filter(({ kind }) => kind === "line") : marks;
}

async function propose(edit = "edit") {
  try {
    const { inversion } = await send(`/api/cases/${state.name}/question`, documents.now);
    documents[edit]("question", (now) => { now.inversion = inversion; });
  } catch (error) { say(error.message, true); }
}

/** A survey without a question gets that of a new case. */
function proposeOnce() {
  const { scene, measurements, inversion } = documents.now;
  const liquefied = Object.values(scene.materials).some((soil) => soil.liquefied);
  if (!inversion && measurements && liquefied && !state.found.faults.length) propose("amend");
}

let opening = 0;

async function open(name, again = false) {
  const turn = opening += 1;
  let found;
  try { found = await get(`/api/cases/${name}`); } catch (error) { say(error.message, true); return; }
  if (turn !== opening) return; // another one was asked for meanwhile
  Object.assign(state, { name, found, effects: {}, changes: { strengths_kpa: {}, friction_deg: {} }, fresh: false });
  history.replaceState(null, "", `#${name}`);
  $("origin").textContent = found.shipped ? "ships with flowslide, read only" : "";
  $("apart").hidden = true;
  documents.open(found);
  editor.selection = {};
  editor.drawn = [];
  view.deposit = null;
  view.level = undefined;
  view.marks = [];
  readings([]);
  take(found);
  if (!again) { await underlay.open(name); view.show(documents.now.scene); }
  if (found.faults.length) say(`${found.faults[0].document}: ${found.faults[0].message}`, true);
  setMode(again ? state.mode : found.scene.zones?.length ? state.mode : "section");
  document.body.dataset.case = name;
}

function apart(words, found) {
  $("apart").replaceChildren(words,
    button("Show what is there now", () => open(state.name, true)),
    button("Keep mine", () => { $("apart").hidden = true; documents.insist(found); }));
  $("apart").hidden = false;
}

function setMode(mode) {
  state.mode = mode;
  document.body.dataset.mode = mode;
  if (!state.found) return;
  for (const tab of $("modes").children) tab.setAttribute("aria-selected", String(tab.dataset.mode === mode));
  editor.active = mode === "section" && !state.found.shipped;
  editor.use("select");
  showMarks();
  if (mode === "section") { view.deposit = null; view.marks = []; state.fresh = false; view.preview(documents.now.scene); view.paintLegend(); }
  refresh();
  if (mode === "slide" || mode === "survey") flow();
}

/** Sliders of the section as it is, and its slide; nothing, where that is shown already. */
function flow() {
  if (state.fresh || state.found.faults.some(({ document }) => document === "scene") || documents.dirty) return;
  state.fresh = true;
  state.changes = { strengths_kpa: {}, friction_deg: {} };
  state.spacing = coarse(state.found.scene);
  fillSpacings();
  buildSliders();
  buildEffects();
  ask(false);
}

/** At most some thousand points, so that an answer comes at once. */
function coarse(scene) {
  const whole = scene.zones.reduce((sum, zone) => sum + area(zone.polygon), 0);
  const fits = SPACINGS.find((spacing) => whole / spacing ** 2 <= 1600) ?? SPACINGS.at(-1);
  return Math.max(fits, scene.spacing);
}

// --- drawing tools ---

function buildTools() {
  $("tool-buttons").replaceChildren(...Object.entries(TOOLS).map(([tool, { words, key, help }]) =>
    button(words, () => { editor.use(tool); $("canvas").focus(); }, { title: `${help} (key ${key})`, "data-tool": tool })));
  $("grid").append(new Option("auto", "0"), ...GRIDS.map((step) => new Option(`${step} m`, step)), new Option("off", "off"));
  $("grid").addEventListener("change", () => { const { value } = $("grid"); editor.step = value === "off" ? "off" : Number(value); });
  $("undo").addEventListener("click", () => documents.undo());
  $("redo").addEventListener("click", () => documents.redo());
  $("fit-section").addEventListener("click", () => { view.fit(); view.draw(); });
  $("coordinate").addEventListener("keydown", (event) => {
    if (event.key !== "Enter") return;
    const text = $("coordinate").value.trim();
    $("coordinate").value = "";
    if (!text) { editor.close(); return; }
    const place = text.split(/[\s,;]+/).map(Number);
    if (place.length !== 2 || !place.every(Number.isFinite)) { say(`${text}: a vertex is typed as x, y in metres`, true); return; }
    if (editor.tool === "select") editor.use("zone");
    editor.add(place);
  });
}

function drawing() {
  for (const one of $("tool-buttons").children) one.setAttribute("aria-pressed", String(one.dataset.tool === editor.tool));
  const { help } = TOOLS[editor.tool];
  $("tool-help").textContent = state.found?.shipped ? "This case ships with flowslide: copy it to edit it."
    : editor.drawn.length ? `${editor.drawn.length} vertices. ${help}` : help;
}

// --- new cases ---

function makeCase(kind) {
  const title = { new: "Draw a new section", copy: `Copy ${state.name.replaceAll("_", " ")}`, import: "Import a section" }[kind];
  $("make-title").textContent = title;
  $("make-import").hidden = kind !== "import";
  $("make-fault").textContent = "";
  $("make-name").value = kind === "copy" ? `${state.name}_mine` : "";
  $("make").dataset.kind = kind;
  $("make").showModal();
  $("make-name").focus();
}

async function madeCase() {
  const { kind } = $("make").dataset;
  const file = $("make-file").files[0];
  const name = $("make-name").value.trim() || (kind === "import" && file ? file.name.replace(/\.[^.]*$/, "").replace(/[^A-Za-z0-9_-]/g, "_") : "");
  try {
    await documents.flush();
    const asked = { name };
    if (kind === "copy") asked.copy_of = state.name;
    if (kind === "import") {
      if (!file) throw new Error("choose a drawing");
      const query = new URLSearchParams({ name: file.name, unit: $("make-unit").value });
      asked.scene = (await upload(`/api/import?${query}`, file)).scene;
    }
    await send("/api/cases", asked);
    $("make").close();
    state.workspace = await get("/api/workspace");
    fillCases(name);
    state.mode = "section";
    await open(name);
    if (kind === "new") editor.use("zone");
  } catch (error) { $("make-fault").textContent = error.message; }
}

function fillCases(name) {
  $("case").replaceChildren(...state.workspace.cases.map((one) => new Option(one.name.replaceAll("_", " "), one.name)));
  $("case").value = name;
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

/** What the sliders say becomes the case: its strengths, its pool, its effects. */
function keepValues() {
  const { strengths_kpa: strengths, friction_deg: frictions, water_level: level } = state.changes;
  const some = Object.keys({ ...strengths, ...frictions, ...state.effects }).length > 0 || level !== undefined;
  if (!some) { say("the case has these values already"); return; }
  documents.edit("values of the sliders", ({ scene }) => {
    for (const [name, value] of Object.entries(strengths)) scene.materials[name].cohesion_kpa = value;
    for (const [name, value] of Object.entries(frictions)) scene.materials[name].friction_deg = value;
    if (level !== undefined) scene.water_level = level;
    if (Object.keys(state.effects).length) scene.effects = { ...scene.effects, ...state.effects };
    state.effects = {};
  });
}

function fillSpacings() {
  const all = [...new Set([...SPACINGS, state.found.scene.spacing, state.spacing])].sort((a, b) => a - b);
  $("spacing").replaceChildren(...all.map((value) => new Option(`${value} m`, value, false, value === state.spacing)));
}

// --- the answer ---

const FILM_PAUSE = 250; // ms after a deposit until its film is asked for
let asked = 0;
let filming = 0;

/** The deposit first; the way there, with `film`, when it is shown. */
function ask(film) {
  if (state.found.faults.some(({ document }) => document === "scene") || documents.dirty) return;
  state.film = film;
  clearTimeout(filming);
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
  if (state.mode === "section") return;
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
  // Who moves on at once does not wait for a film.
  if (state.film) filming = setTimeout(() => question(true), FILM_PAUSE);
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
  if (/^(INPUT|SELECT|TEXTAREA)$/.test(event.target.tagName)) return;
  const { key } = event;
  if ((event.ctrlKey || event.metaKey) && /^[zy]$/i.test(key)) {
    if (key.toLowerCase() === "y" || event.shiftKey) documents.redo(); else documents.undo();
    event.preventDefault();
    return;
  }
  if (event.ctrlKey || event.metaKey || document.querySelector("dialog[open]")) return;
  if (editor.key(event)) { event.preventDefault(); return; }
  const modes = { 1: "section", 2: "survey", 3: "slide" };
  const tool = Object.keys(TOOLS).find((one) => TOOLS[one].key === key);
  const act = { t: theme, f: () => { view.fit(); view.draw(); }, " ": play }[key]
    ?? (modes[key] && (() => setMode(modes[key]))) ?? (tool && editor.active && (() => editor.use(tool)))
    ?? (key === "r" && state.mode === "slide" && (() => open(state.name, true)));
  if (act && !(key === " " && event.target.tagName === "BUTTON")) { act(); event.preventDefault(); }
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
  $("case").addEventListener("change", async () => { await documents.flush(); await open($("case").value); });
  for (const kind of ["new", "copy", "import"]) $(kind).addEventListener("click", () => makeCase(kind));
  $("make-go").addEventListener("click", madeCase);
  $("make-stop").addEventListener("click", () => $("make").close());
  $("make").querySelector("form").addEventListener("submit", (event) => { event.preventDefault(); madeCase(); });
  for (const tab of $("modes").children) tab.addEventListener("click", () => setMode(tab.dataset.mode));
  buildTools();
  $("spacing").addEventListener("change", () => { state.spacing = Number($("spacing").value); ask(false); });
  $("keep").addEventListener("click", keepValues);
  $("reset").addEventListener("click", () => open(state.name, true));
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
  if (!name) { say(`no case in ${state.workspace.folder}: draw one with New`); return; }
  fillCases(name);
  await open(name);
}

start().catch((error) => say(error.message, true));
