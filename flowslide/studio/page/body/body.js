// A case in three dimensions: plan, block and section before the slide, a run with its film, what was measured.

import { bytes, get, unpack } from "../api.js";
import { download } from "../saving.js";
import { button, css, el } from "../ui.js";
import { Film } from "./film.js";
import { layerOf, layersOf, legendOf } from "./layers.js";
import { fillPanel } from "./panel.js";
import { contourStep, LINE_COLOUR, Plan } from "./plan.js";
import { Profile } from "./profile.js";
import { Relief } from "./relief.js";

const $ = (id) => document.getElementById(id);
const LOOK = 3000; // ms between two looks whether the files were changed
const PANES = [["relief", "Block"], ["plan", "Plan"], ["profile", "Section"]];
export const PREFIX = "3d/"; // of the name of a body in the list of cases

/**
 * `state` is that of the page, whose `body` is true while one is open; `say(words, bad)` shows a line,
 * `readings(rows)` fills the table, `ask()` has the questions told again, `unread(words)` says that its
 * files cannot be read, or with "" that they can.
 */
export function makeBody({ state, say, readings, ask, unread }) {
  let ground = null; // before the slide, at the spacing that is chosen
  let film = null; // what is shown: `ground`, a run, or a prediction
  let shown = null; // the job whose maps are shown
  let line = []; // of the section
  let playing = false;
  let turn = 0; // of what was asked for last
  const relief = new Relief($("relief"), {});
  const plan = new Plan($("plan"), { line: setLine, over: tellPlace });
  const profile = new Profile($("profile"), { over: (words) => { $("body-over").textContent = words; } });

  // --- opening ---

  /** Show a body; `again`: the one that is open, whose files were changed. */
  async function open(name, again = false) {
    const own = turn += 1;
    let found;
    try { found = await get(`/api/bodies/${name}`); } catch (error) { say(error.message, true); return false; }
    if (own !== turn) return false;
    pause();
    Object.assign(state, { name, found, body: true, effects: {}, changes: { strengths_kpa: {}, friction_deg: {} }, spacing: found.derived?.spacing_m });
    Object.assign(document.body.dataset, { mode: "body", case: `${PREFIX}${name}` });
    history.replaceState(null, "", `#${PREFIX}${name}`);
    $("origin").textContent = found.shipped ? "read only" : "";
    for (const kind of ["copy", "rename", "remove"]) Object.assign($(kind), { disabled: true });
    [ground, film, shown] = [null, null, null];
    if (!again) line = [];
    if (found.faults.length) say(`${found.faults[0].document}: ${found.faults[0].message}`, true);
    panel();
    ask();
    if (found.derived) await showGround(); else nothing();
    return true;
  }

  /** Another case is opened, of a section. */
  function close() {
    turn += 1;
    pause();
    Object.assign(state, { body: false });
    [ground, film, shown] = [null, null, null];
  }

  function nothing() {
    for (const id of ["relief", "plan", "profile"]) $(id).getContext("2d").clearRect(0, 0, $(id).width, $(id).height);
    for (const one of [relief, plan, profile]) one.film = null;
    $("body-told").textContent = "This case cannot be shown: what is wrong with its files stands on the left.";
    $("body-legend").replaceChildren();
    readings([]);
  }

  /** The ground and its soil before the slide, at the spacing that is chosen. */
  async function showGround() {
    const own = turn += 1;
    say("reading the ground ...");
    try {
      const found = new Film(unpack(await bytes(`/api/bodies/${state.name}/ground?spacing_m=${state.spacing}`)));
      if (own !== turn || !state.body) return;
      ground = found;
      show(ground, null);
      if (!state.found.faults.length) say(`${ground.header.points.toLocaleString("en")} points ${ground.header.spacing_m} m apart`);
    } catch (error) {
      if (own !== turn) return;
      say(error.message, true);
      if (ground) { state.spacing = ground.header.spacing_m; panel(); ask(); } // what is shown is as fine as before
    }
  }

  /** The maps that a job has left: the film of a run, or probabilities. */
  async function showMaps(job, file) {
    const own = turn += 1; // what was asked for before comes too late
    say("reading the maps of the job ...");
    try {
      const found = new Film(unpack(await bytes(`/api/jobs/${job.id}/files/${file}`)));
      if (own !== turn || !state.body) return;
      found.frame = found.last;
      show(found, job);
      say(`${job.words}: ${job.answer?.[0] ?? "shown"}`);
    } catch (error) { say(error.message, true); }
  }

  /** A run that has just ended is shown, where nobody looks at another one. */
  function ended(job) {
    const file = job.files.find((name) => name.endsWith(".bin"));
    if (state.body && job.state === "done" && file && !playing) showMaps(job, file);
  }

  /** Strengths of an answer, as the next run takes them. */
  function showValues(values, spacing) {
    const all = state.found.scene.zones;
    for (const { property, zones, value } of values) {
      const soils = new Set(all.filter(({ name }) => zones.includes(name)).map(({ material }) => material));
      const other = all.find(({ name, material }) => soils.has(material) && !zones.includes(name));
      if (!/cohesion|strength/.test(property) || property === "strength_ratio" || other) {
        say(other ? `${other.name.replaceAll("_", " ")} is of the same soil, and has no such value: write the answer into scene3d.yaml to see it` : `${property.replaceAll("_", " ")}: no field on the left sets it; write the answer into scene3d.yaml to see it`, true);
        return;
      }
      for (const material of soils) state.changes.strengths_kpa[material] = Number(value.toPrecision(4));
    }
    if (spacing && spacing !== state.spacing) { state.spacing = spacing; showGround(); }
    panel();
    say("the strengths of the answer are on the left: Simulate shows their slide");
  }

  // --- the panel on the left ---

  const panel = () => fillPanel($("body-left"), state, line, {
    strength(name, value) {
      if (value === null) delete state.changes.strengths_kpa[name];
      else state.changes.strengths_kpa[name] = value;
      panel();
    },
    spacing(value) { state.spacing = value; ask(); showGround(); },
    line: setLine,
  });

  // --- what is seen ---

  function show(found, job) {
    pause();
    film = found;
    shown = job;
    relief.side = state.found.derived.side;
    const names = layersOf(film);
    const kept = names.some(([name]) => name === $("body-colour").value) ? $("body-colour").value : film.isRun ? "thickness" : names[0][0].startsWith("chance") ? names[0][0] : "zone";
    const first = names[0][0].startsWith("chance") ? names[0][0] : kept;
    $("body-colour").replaceChildren(...names.map(([name, words]) => new Option(words, name, false, name === first)));
    Object.assign($("body-scrub"), { max: Math.max(film.last, 1), value: Math.max(film.frame, film.last ? 0 : 1), disabled: film.last === 0 });
    $("body-play").disabled = film.last === 0;
    if (line.length !== 2) {
      const way = Object.values(state.found.derived.paths)[0];
      plan.film = null; // another ground: the whole of it is seen
      line = [way[0], way.at(-1)].map((place) => film.inside(place)).sort(([a], [b]) => a - b); // A on the left, as in the plan
      relief.film = film;
      relief.home();
    }
    $("body-marks").parentElement.hidden = !state.found.marks?.some(({ places }) => places.length);
    readings(film.header.readings ?? []);
    $("misfit").textContent = film.isRun ? "" : film.exceedance ? "The numbers of the prediction stand at its job below." : "Before the slide there is nothing to read: Simulate, or Show it of a job below.";
    panel();
    tell();
    draw();
    document.body.dataset.shown = job ? job.id : "ground";
  }

  /** What is shown, of what, and how fine. */
  function tell() {
    if (!film) return;
    const { spacing_m: spacing, points, cell_m: cell, strengths_kpa: strengths, warning, frames_of_run: frames } = film.header;
    const ofRun = film.isRun ? Object.entries(state.found.scene.materials) : []; // what liquefied, and what the run has otherwise than the files
    const of = ofRun.filter(([name, soil]) => soil.liquefied || strengths[name] !== soil.cohesion_kpa).map(([name]) => `${name.replaceAll("_", " ")} ${strengths[name]} kPa`).join(", ");
    const at = `${points.toLocaleString("en")} points ${spacing} m apart, maps in cells of ${cell} m`;
    const what = { ground: "Before the slide", slide: "Simulated slide", exceedance: "Prediction" }[film.header.type];
    const when = shown ? ` of ${shown.id.slice(0, 8).replace(/(....)(..)(..)/, "$1-$2-$3")} ${shown.id.slice(9, 13).replace(/(..)(..)/, "$1:$2")}` : "";
    const rest = film.isRun ? `${film.header.came_to_rest ? "at rest" : "still moving"} after ${film.times.at(-1).toFixed(1)} s` : "";
    const some = frames > film.times.length ? `, ${film.times.length} of ${frames} frames` : "";
    const old = shown && shown.revision !== state.found.revision ? " The case has changed since." : "";
    $("body-told").replaceChildren(el("b", { textContent: `${what}${when}` }), `: ${[of, rest, film.exceedance && shown?.answer?.[0], at + some, film.exceedance && "over the ground before the slide"].filter(Boolean).join("; ")}.${old}`,
      warning ? el("span", { className: "bad", textContent: ` ${warning}` }) : "");
    const time = film.last ? `${film.time.toFixed(1)} s` : "-";
    $("body-time").value = time;
  }

  function draw() {
    if (!film) return;
    const layer = layerOf(film, $("body-colour").value, state.found.scene);
    const { derived } = state.found;
    const marks = $("body-marks").checked ? state.found.marks ?? [] : [];
    const drawn = [{ places: line, colour: LINE_COLOUR }, ...Object.values(derived.lines).map((places) => ({ places, colour: [179, 38, 30] }))];
    relief.show(film, layer, Number($("body-rise").value), drawn);
    plan.show(film, layer, line, { paths: derived.paths, lines: derived.lines, marks });
    profile.show(film, line);
    const extra = [el("span", { textContent: `contours every ${contourStep(film)} m` }), el("span", { textContent: `dotted: edge of the soil before, ${film.header.least_m} m thick${film.frame > 0 ? "; blue: now" : ""}` })];
    if (marks.some(({ places }) => places.length)) extra.push(el("span", { textContent: "violet: where it was surveyed" }));
    $("body-legend").replaceChildren(...legendOf(layer), ...extra);
    const { ends, words, unit = "" } = layer;
    $("plan").setAttribute("aria-label", `Plan with hillshade; colours: ${words}${ends ? `, ${ends[0].toFixed(1)} to ${ends[1].toFixed(1)} ${unit}` : ""}; section from x ${line[0].map(Math.round).join(", y ")} to x ${line[1].map(Math.round).join(", y ")} m`);
  }

  function setLine(wanted) {
    const places = film ? wanted.map((place) => film.inside(place)) : [];
    if (places.length !== 2 || Math.hypot(places[1][0] - places[0][0], places[1][1] - places[0][1]) < 0.5 * film.cell) return;
    line = places;
    panel();
    draw();
  }

  function tellPlace(place) {
    if (!place || !film) { $("body-over").textContent = ""; return; }
    const [x, y] = place;
    const [left, right, low, high] = film.ends;
    if (x < left || x > right || y < low || y > high) { $("body-over").textContent = ""; return; }
    const thickness = film.at(film.now("thickness"), x, y);
    const chance = film.exceedance ? film.header.thicker_than_m.map((metres, k) => `, more than ${metres} m with ${(100 * film.at(film.exceedance.subarray(k * film.cells, (k + 1) * film.cells), x, y)).toFixed(0)} %`).join("") : "";
    const moved = film.isRun ? ` (${(thickness - film.at(film.before, x, y)).toFixed(1)} m since the start)`.replace("(-", "(−") : "";
    $("body-over").textContent = `x ${x.toFixed(0)}, y ${y.toFixed(0)} m: surface ${(film.at(film.base, x, y) + thickness).toFixed(1)} m, soil ${thickness.toFixed(1)} m thick${moved}${zoneWords(x, y)}${chance}`;
  }

  /** Name of the zone that lies highest at a place [m]. */
  function zoneWords(x, y) {
    const cell = [x - film.x0, y - film.y0].map((way) => Math.round(way / film.cell));
    const zone = film.zoneAt(Math.min(cell[0], film.nx - 1) * film.ny + Math.min(cell[1], film.ny - 1));
    return zone < 0 ? "" : `, ${state.found.scene.zones[zone].name.replaceAll("_", " ")} on top`;
  }

  // --- the film ---

  let from = null; // the film has run since then: { at: [ms], time: [s] }

  function pause() {
    playing = false;
    $("body-play").textContent = "Play";
  }

  function play() {
    if (!film || film.last === 0) return;
    if (playing) { pause(); return; }
    playing = true;
    $("body-play").textContent = "Pause";
    if (film.frame >= film.last) film.frame = 0;
    from = { at: performance.now(), time: film.time };
    requestAnimationFrame(step);
  }

  function step(now) {
    if (!playing || !film) return;
    const end = film.times.at(-1);
    const time = Math.min(from.time + (Math.max(now - from.at, 0) / 1000) * Number($("body-speed").value), end);
    seek(film.frameAt(time));
    if (time >= end) pause(); else requestAnimationFrame(step);
  }

  function seek(frame) {
    film.frame = frame;
    $("body-scrub").value = frame;
    tell();
    draw();
  }

  /** Keys of the page: true where one was meant for a body. */
  function key({ key: name, target }) {
    if (name === " " && target.tagName !== "BUTTON") play();
    else if (name === "f") fit();
    else if (["1", "2", "3"].includes(name)) toggle(PANES[Number(name) - 1][0]);
    else return false;
    return true;
  }

  function fit() {
    relief.home();
    plan.fit();
    draw();
  }

  /** Show or hide one of the three pictures; the last one stays. */
  function toggle(name) {
    const panes = [...document.querySelectorAll(".pane")];
    const pane = panes.find(({ dataset }) => dataset.pane === name);
    if (!pane.hidden && panes.filter(({ hidden }) => !hidden).length === 1) return;
    pane.hidden = !pane.hidden;
    for (const one of $("body-panes").children) one.setAttribute("aria-pressed", String(!panes.find(({ dataset }) => dataset.pane === one.dataset.pane).hidden));
    draw();
  }

  /** What is seen as a file: the pictures one below the other, or the section as numbers. */
  async function save(kind) {
    const name = `${state.name}-${film ? film.header.type : "body"}`;
    if (!film) throw new Error("there is nothing to save yet");
    if (kind === "csv") return download(new Blob([profile.csv], { type: "text/csv" }), `${name}-section.csv`);
    const seen = [...document.querySelectorAll(".pane:not([hidden]) canvas")];
    const sheet = Object.assign(document.createElement("canvas"), { width: Math.max(...seen.map(({ width }) => width)), height: 30 + seen.reduce((sum, { height }) => sum + height, 0) });
    const pen = sheet.getContext("2d");
    pen.fillStyle = css("--paper");
    pen.fillRect(0, 0, sheet.width, sheet.height);
    Object.assign(pen, { fillStyle: css("--ink"), font: "12px system-ui, sans-serif" });
    pen.fillText(`${$("body-told").textContent} ${$("body-time").value === "-" ? "" : `At ${$("body-time").value}.`} Colours: ${$("body-legend").textContent.slice(0, 120)}`, 10, 19);
    let top = 30;
    for (const one of seen) { pen.drawImage(one, 0, top); top += one.height; }
    return download(await new Promise((done) => { sheet.toBlob(done, "image/png"); }), `${name}.png`);
  }

  async function look() {
    if (!state.body || document.hidden || playing) return;
    const { name, found } = state;
    try {
      const { revision } = await get(`/api/bodies/${name}/revision`);
      if (state.body && state.found === found) unread("");
      if (state.body && state.name === name && state.found === found && revision !== found.revision) {
        await open(name, true);
        if (!state.found.faults.length) say("changed elsewhere: shown as it is now");
      }
    } catch (error) { if (error.status === 400 && state.found === found) unread(error.message); /* a server that is gone is told elsewhere */ }
  }

  $("body-panes").replaceChildren(...PANES.map(([name, words], k) => button(words, () => toggle(name), { "data-pane": name, "aria-pressed": "true", title: `show or hide it (key ${k + 1})` })));
  $("body-play").addEventListener("click", play);
  $("body-scrub").addEventListener("input", () => { seek(Number($("body-scrub").value)); if (playing) from = { at: performance.now(), time: film.time }; });
  $("body-speed").addEventListener("change", () => { if (playing) from = { at: performance.now(), time: film.time }; });
  for (const id of ["body-colour", "body-rise", "body-marks"]) $(id).addEventListener("change", draw);
  $("body-fit").addEventListener("click", fit);
  setInterval(look, LOOK);
  return { open, close, draw, key, save, showMaps, showValues, ended };
}
