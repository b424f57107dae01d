// The page: a case that is drawn, surveyed, and flows at every move of a slider.

import { answers } from "./answer.js";
import { get, send, upload } from "./api.js";
import { makeBody, PREFIX } from "./body/body.js";
import { CHOOSE, Documents } from "./documents.js";
import { Editor, TOOLS } from "./editor.js";
import { blockOf, cellsOf, forget, knowUnits, numbersOf, pasteInto, setUp } from "./numbers.js";
import { SectionPanel } from "./section_panel.js";
import { saveView } from "./saving.js";
import { makeSlide } from "./slide.js";
import { SurveyPanel } from "./survey_panel.js";
import { button, el, isTyping, justTyped, onChosen } from "./ui.js";
import { Underlay } from "./underlay.js";
import { View } from "./view.js";
import { waterWords } from "./water.js";

const $ = (id) => document.getElementById(id);
const view = new View($("canvas"), $("legend"));
const AGAIN = 3000; // ms until a first case that cannot be read is looked at again
const GRIDS = [0.1, 0.25, 0.5, 1, 2, 5, 10];

const state = { workspace: null, name: "", found: null, changes: null, effects: {}, spacing: 2, playing: false, film: false, answered: 0,
  mode: "slide", fresh: false, told: "", body: false };

function say(words, bad = false) {
  $("status").textContent = words;
  $("status").className = bad ? "bad" : "";
}

/** What became of what somebody has typed or pasted: said until it is saved, and then once more. */
function tellTyped(words, bad = false) {
  say(words, bad);
  state.told = bad ? "" : words;
}

// --- the case: drawn, surveyed, saved ---

const documents = new Documents({
  changed(words, isOther) {
    state.fresh = false;
    if (isOther) slide.forget();
    view.preview(documents.now.scene);
    view.paintLegend();
    say(`${words}; saving ...`);
    refresh();
  },
  /** What is undone out of sight is shown. */
  stepped(parts) {
    const [drawn, asked] = [parts.includes("scene"), parts.some((part) => part !== "scene")];
    if (state.mode === "section" && asked && !drawn) setMode("survey");
    if (state.mode === "survey" && drawn && !asked) setMode("section");
  },
  same() { refresh(); },
  saved(found) {
    state.found = found;
    take(found);
    // An edit that came meanwhile is not among what was saved: its own words stay.
    if (!documents.dirty) {
      say(found.faults.length ? `kept as a draft: ${found.faults[0].message}` : ["saved", state.told].filter(Boolean).join(": "), found.faults.length > 0);
      state.told = "";
    }
    document.body.dataset.saved = found.revision;
    questions?.refresh(); // which answers are of the case now
    proposeOnce();
    if (state.mode !== "section") slide.flow();
  },
  conflict(found) {
    say(`not saved: ${CHOOSE}`, true);
    apart("This case was changed elsewhere while you edited it.", found,
      async () => { if (await open(state.name, true) && !state.found.faults.length) say("shown as it is now"); });
  },
  elsewhere: async () => { if (await open(state.name, true, true) && !state.found.faults.length) say("changed elsewhere: shown as it is now"); },
  failed(words) { say(words, true); },
  unread,
});

const editor = new Editor(view, {
  scene: () => documents.now.scene,
  edit: (words, change) => documents.edit(words, change),
  select: () => sectionPanel.show(),
  drawing,
  say,
});

const page = {
  view, editor, documents, say, tellTyped, refresh, setMode,
  get faults() { return state.found?.faults ?? []; },
  get doubts() { return state.found?.derived?.doubts ?? []; },
  get materials() { return state.workspace.materials; },
  get forms() { return state.workspace.measurements; },
  derived: () => state.found?.derived,
  summary() {
    const { derived, shipped } = state.found;
    if (shipped) return "This case ships with flowslide. Copy it to edit it.";
    if (!derived) return "Not checked yet.";
    return `It holds together: ${derived.points.toLocaleString("en")} points ${derived.spacing_m} m apart. ${waterWords(documents.now.scene)}`.trim();
  },
  propose,
};
const underlay = page.underlay = new Underlay(page);
const sectionPanel = new SectionPanel($("section-left"), $("section-right"), page);
const surveyPanel = new SurveyPanel($("survey-left"), $("survey-right"), page);

const slide = makeSlide({ state, view, documents, say, reopen: () => open(state.name, true) });
const body = makeBody({ state, say, readings: (rows) => slide.readings(rows), ask: () => questions?.refresh(), unread });
let questions = null;

function refresh() {
  sectionPanel.show();
  surveyPanel.show();
  $("undo").disabled = !documents.canUndo;
  $("redo").disabled = !documents.canRedo;
  view.draw();
}

/** What the server says of the documents: faults and marks, where they are shown. */
function take(found) {
  editor.faults = found.faults.filter(({ document }) => document === "scene");
  showMarks();
  view.ends = found.derived?.ends ?? {};
  view.preview(documents.now.scene);
  view.paintLegend();
  questions?.tell();
  refresh();
}

/** What was surveyed, over the section; in the slide the toes are marked as they compare. */
function showMarks() {
  const marks = state.found.derived?.marks ?? [];
  editor.marks = state.mode === "slide" ? marks.filter(({ kind }) => kind === "line") : marks;
}

async function propose(edit = "edit") {
  try {
    const { inversion } = await send("/api/question", documents.now);
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

/** Show a case, or the one that is open `again`; false: it is not shown, as nobody has asked for it (`unasked`) and it would undo an edit. */
async function open(name, again = false, unasked = false) {
  const turn = opening += 1;
  if (name.startsWith(PREFIX)) return openBody(name.slice(PREFIX.length));
  let found;
  try { found = await get(`/api/cases/${name}`); } catch (error) {
    say(error.message, true);
    if (!state.found) setTimeout(() => { if (turn === opening) open(name); }, AGAIN); // its files may be mended meanwhile
    return false;
  }
  if (turn !== opening) return false; // another one was asked for meanwhile
  if (unasked && documents.pending) return false; // to be saved is a conflict: somebody chooses
  if (state.body) body.close();
  Object.assign(state, { name, found, effects: {}, changes: { strengths_kpa: {}, friction_deg: {} }, fresh: false });
  history.replaceState(null, "", `#${name}`);
  $("origin").textContent = found.shipped ? "read only" : "";
  $("apart").hidden = true;
  for (const kind of ["copy", "rename", "remove"]) $(kind).disabled = kind !== "copy" && found.shipped;
  documents.open(found);
  if (found.beside) {
    documents.hold();
    apart("The files of this case were changed elsewhere, beside the draft that is shown.", found, () => documents.drop(found.beside));
  }
  if (!again) { editor.use("select"); forget(); }
  if (!again || !editor.hasSelected()) editor.selection = {};
  view.level = undefined;
  slide.empty();
  take(found);
  if (!again) { await underlay.open(name); state.first = true; view.show(documents.now.scene); }
  if (found.faults.length) say(`${found.faults[0].document}: ${found.faults[0].message}`, true);
  else if (!again) say(""); // what was said of another case is nothing of this one
  setMode(again ? state.mode : found.scene.zones?.length ? state.mode : "section");
  document.body.dataset.case = name;
  questions?.refresh(); // its answers
  return true;
}

/** A case in three dimensions is looked at: nothing of a section is edited or asked meanwhile. */
async function openBody(name) {
  slide.leave();
  slide.empty();
  editor.active = false;
  view.scene = null; // nothing of it is painted any more
  documents.open({ name: "", shipped: true, revision: "" });
  $("apart").hidden = true;
  return body.open(name);
}

/** Somebody must choose: what the files have now, as `show` does, or what is here. */
function apart(words, found, show) {
  $("apart").replaceChildren(words,
    button("Show what is there now", () => { $("apart").hidden = true; show(); }),
    button("Keep mine", () => { $("apart").hidden = true; documents.insist(found); }));
  $("apart").hidden = false;
}

/** The files of the case cannot be read, since they are half written or gone; empty `words`: they can be again. */
async function unread(words) {
  const told = words && `${words}. The page shows what was there before.`;
  if (words && $("apart").textContent === told && !$("apart").hidden) return;
  $("apart").hidden = !words;
  $("apart").textContent = told;
  if (!words) return;
  try { state.workspace = await get("/api/workspace"); } catch { return; }
  fillCases(nameNow()); // a folder may have another name now
}

function setMode(mode) {
  if (!state.found || state.body) return;
  const isOther = state.mode !== mode;
  if (isOther) slide.leave();
  state.mode = mode;
  sessionStorage.setItem("mode", mode); // a reload goes on in it
  document.body.dataset.mode = mode;
  for (const tab of $("modes").children) tab.setAttribute("aria-selected", String(tab.dataset.mode === mode));
  editor.active = mode === "section" && !state.found.shipped;
  if (isOther) editor.use("select"); else drawing();
  showMarks();
  view.stretch(mode === "section" ? 1 : Number($("rise").value)); // what is drawn has equal scales
  if (mode === "section") { slide.forget(); view.level = undefined; state.fresh = false; view.preview(documents.now.scene); view.paintLegend(); }
  refresh();
  if (mode === "slide" || mode === "survey") slide.flow();
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
    if (event.key !== "Enter" || !state.found) return;
    const text = $("coordinate").value.trim();
    if (text) addVertices([cellsOf(text)]); else editor.close();
  });
  $("coordinate").addEventListener("paste", (event) => {
    const block = blockOf(event.clipboardData.getData("text"));
    if (!block || !state.found) return;
    event.preventDefault();
    addVertices(block);
  });
}

/** Vertices of the line that is drawn; one that is typed wrong stays to be mended. */
function addVertices(block) {
  let places;
  try {
    places = numbersOf(block, ["m", "m"]);
    if (places.some(({ length }) => length !== 2)) throw new Error(`${block[0].join(" ")}: a vertex is x, y in metres`);
  } catch (error) { say(error.message, true); return; }
  $("coordinate").value = "";
  if (editor.tool === "select") editor.use("zone");
  for (const place of places) editor.add(place);
  if (places.length > 1 && editor.drawn.length) tellTyped(`${places.length} vertices: Enter ends the line`);
}

function drawing() {
  for (const one of $("tool-buttons").children) one.setAttribute("aria-pressed", String(one.dataset.tool === editor.tool));
  const { help } = TOOLS[editor.tool];
  $("tool-help").textContent = state.found?.shipped ? "This case ships with flowslide: copy it to edit it."
    : editor.drawn.length ? `${editor.drawn.length} vertices. ${help}` : help;
}

// --- new cases ---

const MAKING = {
  new: { title: () => "Draw a new section", go: "Make it" },
  copy: { title: (name) => `Copy ${name}`, go: "Make it", name: () => `${state.name}_mine` },
  import: { title: () => "Import a section", go: "Make it" },
  rename: { title: (name) => `Rename ${name}`, go: "Rename it", name: () => state.name },
  remove: { title: (name) => `Remove ${name}?`, go: "Remove it" },
};

/** Ask what a case is to be made from, or what becomes of this one. */
function makeCase(kind) {
  const { title, go, name } = MAKING[kind];
  $("make-title").textContent = title(state.name.replaceAll("_", " "));
  $("make-go").textContent = go;
  $("make-import").hidden = kind !== "import";
  $("make-named").hidden = kind === "remove";
  $("make-fault").textContent = "";
  $("make-name").value = name?.() ?? "";
  $("make").dataset.kind = kind;
  tellFolder();
  if (kind === "remove") $("make-folder").textContent = "Its files, edits and jobs are kept in .studio/removed.cases of this folder.";
  $("make").showModal();
  (kind === "remove" ? $("make-stop") : $("make-name")).focus();
}

/** The folder of a case from a title, or from the name of a drawing. */
function folderName() {
  const file = $("make").dataset.kind === "import" ? $("make-file").files[0] : null;
  const title = $("make-name").value.trim() || (file?.name.replace(/\.[^.]*$/, "") ?? "");
  // Umlauts and accents lose their marks; what is no letter or digit separates words.
  return title.normalize("NFKD").replace(/\p{M}/gu, "").replace(/[^A-Za-z0-9_-]+/g, "_").replace(/^_+|_+$/g, "").slice(0, 64);
}

function tellFolder() {
  const name = folderName();
  $("make-folder").textContent = name && name !== $("make-name").value ? `its folder will be ${name}` : "";
}

/** Rename or remove the case that is open. */
async function changeCase(kind) {
  const { name } = state;
  if (kind === "remove") {
    await send(`/api/cases/${name}`, {}, "DELETE");
    documents.open({ name: "", shipped: true, revision: "" });
  } else await send(`/api/cases/${name}/name`, { name: folderName() }, "PUT");
  return kind === "remove" ? "" : folderName();
}

/** The list of cases, and one of them open. */
async function reopenWith(name) {
  state.workspace = await get("/api/workspace");
  const wanted = name || state.workspace.cases.find(({ shipped }) => !shipped)?.name;
  if (!wanted) { location.hash = ""; location.reload(); return; }
  fillCases(wanted);
  await open(wanted);
}

async function madeCase() {
  const { kind } = $("make").dataset;
  const file = $("make-file").files[0];
  const name = folderName();
  let read = [];
  try {
    const trouble = await documents.flush();
    if (trouble) throw new Error(trouble);
    if (kind === "import" && !file) throw new Error("choose a drawing");
    if (!name && kind !== "remove") throw new Error("give it a name");
    if (kind === "rename" || kind === "remove") {
      const now = await changeCase(kind);
      $("make").close();
      await reopenWith(now);
      return;
    }
    const asked = { name };
    if (kind === "copy") asked.copy_of = state.name;
    if (kind === "import") {
      const query = new URLSearchParams({ name: file.name, unit: $("make-unit").value });
      ({ scene: asked.scene, read } = await upload(`/api/import?${query}`, file));
    }
    await send("/api/cases", asked);
    $("make").close();
    $("welcome").close("chosen");
    state.mode = "section";
    await reopenWith(name);
    if (kind === "new") { editor.use("zone"); $("canvas").focus(); } // keys go on from here: the dialog had the focus
    if (read.length) say(read.join("; "));
  } catch (error) { $("make-fault").textContent = error.message; }
}

/** The case that is open, as the list has it. */
const nameNow = () => (state.body ? PREFIX : "") + state.name;

/** Every case that can be opened, those in three dimensions last. */
const allCases = () => [...state.workspace.cases, ...state.workspace.bodies.map((one) => ({ ...one, name: PREFIX + one.name }))];

function fillCases(name) {
  const option = (one, value = one.name) => new Option(one.name.replaceAll("_", " "), value);
  const solid = el("optgroup", { label: "three dimensions" }, ...state.workspace.bodies.map((one) => option(one, PREFIX + one.name)));
  $("case").replaceChildren(...state.workspace.cases.map((one) => option(one)), solid);
  $("case").value = name;
}

// --- the page ---

function keys(event) {
  const { key, target } = event;
  // A text that is being typed has the browser's own undo, a slider changes no document; a list or a box has none.
  const isTyped = target.matches("input:not([type=checkbox]), textarea") && (isTyping(target) || !target.closest("#section-left, #section-right, #survey-left, #survey-right"));
  if (!isTyped && (event.ctrlKey || event.metaKey) && /^[zy]$/i.test(key) && !document.querySelector("dialog[open]")) {
    if (key.toLowerCase() === "y" || event.shiftKey) documents.redo(); else documents.undo();
    event.preventDefault();
    return;
  }
  if (/^(INPUT|SELECT|TEXTAREA)$/.test(target.tagName)) return;
  if (event.ctrlKey || event.metaKey || document.querySelector("dialog[open]")) return;
  if (justTyped() || event.target.closest("#section-left, #section-right, #survey-left, #survey-right, #body-left")) return;
  if (state.body && body.key(event)) { event.preventDefault(); return; }
  if (editor.key(event)) { event.preventDefault(); return; }
  const modes = { 1: "section", 2: "survey", 3: "slide" };
  const tool = Object.keys(TOOLS).find((one) => TOOLS[one].key === key);
  const act = { t: theme, "[": () => fold("left"), "]": () => fold("right"), f: () => { view.fit(); view.draw(); }, " ": state.body ? null : slide.play }[key]
    ?? (modes[key] && (() => setMode(modes[key]))) ?? (tool && editor.active && (() => editor.use(tool)))
    ?? (key === "r" && state.mode === "slide" && !state.body && (() => open(state.name, true)));
  if (act && !(key === " " && event.target.tagName === "BUTTON")) { act(); event.preventDefault(); }
}

/** Show or hide a panel at a side, for a larger picture. */
function fold(side, folded = document.body.dataset[side] !== "folded") {
  document.body.dataset[side] = folded ? "folded" : "";
  $(`fold-${side}`).setAttribute("aria-pressed", String(!folded));
  localStorage.setItem(`panel-${side}`, document.body.dataset[side]);
}

function theme() {
  const root = document.documentElement;
  const dark = root.dataset.theme === "dark";
  root.dataset.theme = dark ? "light" : "dark";
  localStorage.setItem("theme", root.dataset.theme);
  view.draw();
  body.draw();
}

async function start() {
  document.documentElement.dataset.theme = localStorage.getItem("theme")
    ?? (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
  state.workspace = await get("/api/workspace");
  knowUnits(state.workspace.units);
  setUp(tellTyped, (words, act) => documents.together(words, act));
  document.addEventListener("paste", pasteInto);
  const cases = allCases();
  onChosen($("case"), async () => {
    const wanted = $("case").value;
    const trouble = await documents.flush();
    if (trouble) say(trouble, true); else await open(wanted);
    if ($("case").value === wanted) $("case").value = nameNow(); // one that cannot be opened is not shown
  }, nameNow);
  for (const kind of Object.keys(MAKING)) $(kind).addEventListener("click", () => makeCase(kind));
  $("make-go").addEventListener("click", madeCase);
  $("make-stop").addEventListener("click", () => $("make").close());
  $("make").querySelector("form").addEventListener("submit", (event) => { event.preventDefault(); madeCase(); });
  for (const tab of $("modes").children) tab.addEventListener("click", () => setMode(tab.dataset.mode));
  buildTools();
  $("theme").addEventListener("click", theme);
  for (const one of $("save").querySelectorAll("button")) {
    one.addEventListener("click", async () => {
      $("save").open = false;
      if (!state.found) return;
      if (state.body) { say(`${await body.save(one.dataset.kind)} is with your downloads`); return; }
      say(`${await saveView(one.dataset.kind, view, `${state.name}-${state.mode}`)} is with your downloads`);
    });
  }
  $("save").addEventListener("keydown", ({ key }) => { if (key === "Escape") $("save").open = false; });
  addEventListener("pointerdown", ({ target }) => { if (!$("save").contains(target)) $("save").open = false; });
  for (const side of ["left", "right"]) {
    fold(side, localStorage.getItem(`panel-${side}`) === "folded");
    $(`fold-${side}`).addEventListener("click", () => fold(side));
  }
  for (const event of ["input", "change"]) $("make").addEventListener(event, tellFolder);
  document.addEventListener("keydown", keys);
  questions = answers(state, say, { showValues: (...asked) => (state.body ? body : slide).showValues(...asked), showEffects: slide.showEffects, keepAnswer: slide.keepAnswer, showMaps: body.showMaps, ended: body.ended });
  const wanted = decodeURIComponent(location.hash.slice(1)) || state.workspace.first;
  const name = cases.some((one) => one.name === wanted) ? wanted : cases.find((one) => !one.shipped)?.name;
  fillCases(name);
  tellLeftOut();
  if (!name) { welcome(); return; }
  state.mode = sessionStorage.getItem("mode") ?? state.mode;
  await open(name);
}

function tellLeftOut() {
  const names = state.workspace.left_out.map((name) => `“${name}”`).join(", ");
  if (names) $("left-out").textContent = `not shown: ${names}; the name of a case has letters, digits, _ and - alone`;
}

/** A folder without a case: what can be done, in place of a dam that nobody has asked for. */
function welcome() {
  const dialog = $("welcome");
  const go = (act) => () => { dialog.close("chosen"); act(); };
  dialog.querySelector("form").replaceChildren(
    el("h2", { textContent: "No case in this folder yet" }),
    el("p", { className: "note", textContent: state.workspace.folder }),
    el("div", { className: "buttons" }, button("Draw a section", () => makeCase("new"), { className: "main" }),
      button("Import a drawing", () => makeCase("import"))), // over this one: Escape leads back
    el("p", { textContent: "Or look at one that ships with flowslide:" }),
    el("div", { className: "buttons" }, ...state.workspace.cases.map(({ name }) => button(name.replaceAll("_", " "), go(() => { fillCases(name); open(name); }))),
      ...state.workspace.bodies.map(({ name }) => button(`${name.replaceAll("_", " ")} in 3-D`, go(() => { fillCases(PREFIX + name); open(PREFIX + name); })))));
  document.body.dataset.mode = "section";
  for (const kind of ["copy", "rename", "remove"]) $(kind).disabled = true;
  say("draw a section, import one, or look at a case that ships");
  dialog.showModal();
}

start().catch((error) => say(error.message, true));
