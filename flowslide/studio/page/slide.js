// The slide: sliders for strengths, pool and effects, the deposit that follows, its readings and its film.

import { Sliders } from "./api.js";
import { placeOf, saidAt } from "./faults.js";
import { frameAt, timeAt } from "./film_times.js";
import { numberBox } from "./numbers.js";
import { isFitted } from "./question.js";
import { area, ownMaterials } from "./section.js";
import { el, onChosen } from "./ui.js";
import { waterTableAt } from "./water.js";

const $ = (id) => document.getElementById(id);
const SIMULATING = "simulating ...";
const GONE = "the server is gone: if it does not come back, start it again and open the address that it prints";
const SPACINGS = [0.25, 0.5, 0.75, 1, 1.5, 2, 3, 4];
const MOST_POINTS = 20000; // as flowslide/studio/live.py has it
const FILM_PAUSE = 250; // ms after a deposit until its film is asked for

/** `page` has state, view, documents, say(words, bad) and reopen(), which goes back to the files. */
export function makeSlide({ state, view, documents, say, reopen }) {
  const sliders = new Sliders({
    connected(is) {
      if (!is) say(GONE, true);
      else if (["starting", GONE].includes($("status").textContent)) say(sliders.waiting ? SIMULATING : "connected"); // what else was said since then stays
    },
    deposit: show,
    forecast: showForecast,
    /** What is shown is still of the values before: its numbers stay pale. */
    failed(message) {
      view.forecast = null;
      waits = false;
      $("readings").classList.toggle("before", Boolean(view.deposit));
      view.draw();
      say(view.deposit ? `${message}; what is shown is of the values before` : message, true);
    },
  });

  /** Sliders of the section as it is, and its slide; nothing where that is shown already, or a fault is to be mended. */
  function flow() {
    if (documents.pending) return;
    if (state.fresh) { if (sliders.waiting) say(SIMULATING); return; }
    if (state.found.faults.length) { empty(); return; }
    pause();
    state.fresh = true;
    state.changes = { strengths_kpa: {}, friction_deg: {} };
    view.level = undefined;
    state.spacing = coarse(state.found.scene);
    fillSpacings();
    buildSliders();
    buildEffects();
    $("keep").disabled = documents.shipped;
    ask(false);
  }

  /** No sliders, no answer: those of another case, or of a section with a fault, are nobody's. */
  function empty() {
    forget();
    pause();
    for (const id of ["keep", "play"]) $(id).disabled = true;
    $("sliders").replaceChildren();
    $("effects").replaceChildren();
    $("misfit").textContent = "";
    readings([]);
    tell();
  }

  /** At most some thousand points, so that an answer comes at once. */
  function coarse(scene) {
    const fits = SPACINGS.find((spacing) => points(scene, spacing) <= 1600) ?? SPACINGS.at(-1);
    return Math.max(fits, scene.spacing);
  }

  const points = (scene, spacing) => scene.zones.reduce((sum, zone) => sum + area(zone.polygon), 0) / spacing ** 2;

  // --- sliders ---

  /** At the values of the case, or at those that somebody has set since. */
  function buildSliders() {
    const { scene } = state.found;
    const { strengths_kpa: strengths, friction_deg: frictions } = state.changes;
    // What liquefied first: it is what is looked for.
    const soils = Object.entries(scene.materials).sort(([, a], [, b]) => Boolean(b.liquefied) - Boolean(a.liquefied));
    // A strength ratio is the section's; a slider of S_r would replace it.
    const rows = soils.filter(([, soil]) => typeof soil.strength_ratio !== "number").map(([name, soil]) => {
      const words = name.replaceAll("_", " ");
      if (soil.liquefied || soil.friction_deg === 0) {
        const label = soil.liquefied ? `S_r, ${words}` : `strength, ${words}`;
        return slider(label, "kPa", strengths[name] ?? soil.cohesion_kpa, 0, nice(3 * Math.max(soil.cohesion_kpa, 10)), 0.1,
          (value) => { state.changes.strengths_kpa[name] = value; }, placeOf("scene", "materials", name, "cohesion_kpa"));
      }
      return slider(`friction, ${words}`, "deg", frictions[name] ?? soil.friction_deg, 15, 50, 0.5,
        (value) => { state.changes.friction_deg[name] = value; }, placeOf("scene", "materials", name, "friction_deg"));
    });
    const top = Math.max(...scene.zones.flatMap((zone) => zone.polygon.map(([, y]) => y)));
    const low = Math.min(...scene.ground.points.map(([, y]) => y));
    if (scene.water_level !== null && scene.water_level !== undefined) {
      rows.push(slider("pool level", "m", state.changes.water_level ?? scene.water_level, low, top, 0.1, (value) => {
        state.changes.water_level = value;
        view.level = value;
        view.draw();
      }));
    }
    $("sliders").replaceChildren(...rows);
  }

  let made = 0;

  /** `place` is that of the field in the case that the slider stands for. */
  function slider(words, unit, value, low, high, step, set, place = "") {
    const id = `slider-${made += 1}`;
    const row = document.createElement("div");
    row.className = "slider";
    row.dataset.place = place;
    const label = document.createElement("label");
    label.htmlFor = id;
    const number = document.createElement("input");
    number.setAttribute("aria-label", `${words} [${unit}]`);
    const right = document.createElement("span");
    right.append(number, " ", Object.assign(document.createElement("span"), { className: "unit", textContent: unit }));
    label.append(words, right);
    const range = Object.assign(document.createElement("input"), { type: "range", id, min: low, max: high, step, value });
    let last = value;
    const move = (now, film) => {
      number.value = range.value = now;
      Object.assign(number, { title: "", ariaInvalid: null });
      if (now === last) { if (film) wantFilm(); return; } // a key press is both an input and a change
      last = now;
      set(now);
      ask(film);
    };
    numberBox(number, { key: words, unit, value, step }, (now) => move(now ?? last, true), (fault) => { number.title = fault; });
    range.addEventListener("input", () => move(Number(range.value), false));
    range.addEventListener("change", () => move(Number(range.value), true));
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
    onChosen(choice, () => {
      const one = state.workspace.effects.find(({ name }) => name === choice.value);
      state.effects[one.name] = one.ladder[1];
      buildEffects();
      ask(true);
    });
    const rows = Object.entries(state.effects).map(([name, amplitude]) => {
      const one = state.workspace.effects.find((effect) => effect.name === name);
      const row = slider(name.replaceAll("_", " "), one.unit, amplitude, one.low < 0 ? -one.ladder[2] * 2 : 0,
        one.ladder[2] * 2, one.ladder[0] / 20, (value) => { state.effects[name] = value; tellEffects(); });
      row.title = one.meaning;
      const off = Object.assign(document.createElement("button"), { textContent: "remove" });
      off.addEventListener("click", () => { delete state.effects[name]; buildEffects(); ask(true); });
      row.append(off);
      return row;
    });
    const ofCase = Object.entries(state.found.scene.effects ?? {}).filter(([name]) => !(name in state.effects)).map(([name, one]) => Object.assign(document.createElement("p"),
      { className: "note", textContent: `${name.replaceAll("_", " ")}${typeof (one?.amplitude ?? one) === "number" ? ` ${one?.amplitude ?? one}` : ""}, in the case` }));
    $("effects").replaceChildren(...ofCase, ...rows, choice);
    tellEffects();
  }

  /** Who shows which effects are on hears of a change. */
  const tellEffects = () => document.dispatchEvent(new CustomEvent("effects"));

  /** Put effects, { name: amplitude }, on the sliders, and the values that were found with them. */
  function showEffects(effects, values, spacing) {
    state.effects = shortened(effects);
    buildEffects();
    showValues(values, spacing);
    tellEffects();
  }

  /** Put the values of an answer, [{ property, zones, value }], on the sliders; false: there is none for one of them. */
  function showValues(values, spacing) {
    const { scene } = state.found;
    const changes = { strengths_kpa: {}, friction_deg: {} };
    for (const { property, zones, value } of values) {
      const materials = new Set(scene.zones.filter(({ name }) => zones.includes(name)).map(({ material }) => material));
      const others = scene.zones.filter(({ name, material }) => materials.has(material) && !zones.includes(name));
      if (property === "density" || property === "strength_ratio" || others.length) {
        say(others.length ? `${others[0].name.replaceAll("_", " ")} is of the same soil, and has no such value: keep the answer to see it` : `no slider moves a ${property.replaceAll("_", " ")}: keep the answer to see it`, true);
        return;
      }
      if (property === "water_level") changes.water_level = view.level = short(value);
      else for (const name of materials) changes[property === "friction_deg" ? property : "strengths_kpa"][name] = short(value);
    }
    state.changes = changes;
    if (spacing && points(scene, spacing) <= MOST_POINTS) state.spacing = spacing;
    fillSpacings();
    buildSliders();
    ask(true);
  }

  /** The values and effects of a job's answer become those of the case; zones that share their soil with others get one of their own. */
  function keepAnswer(job, values, effects = {}) {
    const before = documents.now;
    documents.edit("answer", ({ scene }) => {
      if (Object.keys(effects).length) scene.effects = { ...scene.effects, ...shortened(effects) };
      for (const name of Object.keys(effects)) delete state.effects[name]; // the case has it from now on
      for (const { property, zones, value } of values) {
        if (property === "water_level") { Object.assign(scene, { phreatic_line: waterTableAt(scene, short(value)), water_level: short(value) }); continue; }
        const own = ownMaterials(scene, zones);
        for (const name of own) setProperty(scene.materials[name], property, short(value), zones);
      }
    }, job);
    if (documents.now === before && !documents.shipped) say("the case has this answer already");
  }

  /** One S_r replaces a ratio; a ratio comes with the least strength that the question states, or the usual 0.1 kPa. */
  function setProperty(soil, property, value, zones) {
    if (property === "residual_strength_kpa") { soil.cohesion_kpa = value; delete soil.strength_ratio; return; }
    soil[property] = value;
    if (property !== "strength_ratio") return;
    const asked = (state.found.inversion?.parameters ?? []).find((one) => one.property === property && one.zones.some((zone) => zones.includes(zone)));
    soil.cohesion_kpa = asked?.floor_kpa ?? 0.1;
  }

  const short = (value) => Number(value.toPrecision(4));
  const shortened = (effects) => Object.fromEntries(Object.entries(effects).map(([name, amplitude]) => [name, short(amplitude)]));

  /** What the sliders say becomes the case: its strengths, its pool, its effects. */
  function keepValues() {
    const { strengths_kpa: strengths, friction_deg: frictions, water_level: level } = state.changes;
    const some = Object.keys({ ...strengths, ...frictions, ...state.effects }).length > 0 || level !== undefined;
    if (!some) { say("the case has these values already"); return; }
    documents.edit("values of the sliders", ({ scene }) => {
      for (const [name, value] of Object.entries(strengths)) scene.materials[name].cohesion_kpa = value;
      for (const [name, value] of Object.entries(frictions)) scene.materials[name].friction_deg = value;
      if (level !== undefined) Object.assign(scene, { water_level: level, phreatic_line: waterTableAt(scene, level) });
      if (Object.keys(state.effects).length) scene.effects = { ...scene.effects, ...state.effects };
      state.effects = {};
    });
  }

  function fillSpacings() {
    const { scene } = state.found;
    const live = SPACINGS.filter((one) => points(scene, one) <= MOST_POINTS);
    const all = [...new Set([...live, scene.spacing, state.spacing])].sort((a, b) => a - b);
    $("spacing").replaceChildren(...all.map((value) => new Option(`${value} m`, value, false, value === state.spacing)));
  }

  // --- the answer ---

  let asked = 0;
  let waits = false; // for the deposit of what was asked
  let filming = 0;

  /** The deposit first; the way there, with `film`, when it is shown. */
  function ask(film) {
    if (state.found.faults.length || documents.pending) return;
    state.film = film;
    clearTimeout(filming);
    asked = performance.now();
    waits = true;
    if (sliders.isOpen) say(SIMULATING); else say(GONE, true);
    question(false);
  }

  function question(film) {
    sliders.ask({
      type: "run", case: state.name, spacing_m: state.spacing, film,
      changes: state.changes,
      effects: Object.entries(state.effects).map(([name, amplitude]) => ({ name, amplitude })),
    });
  }

  /** At the sliders: what of the values that were simulated is hardly meant. */
  function tellDoubts(doubts) {
    for (const row of $("sliders").children) {
      row.querySelector(".doubt")?.remove();
      const doubt = saidAt(doubts, row.dataset.place);
      if (doubt) row.append(el("p", { className: "doubt", textContent: doubt }));
    }
  }

  /** What a learned model says, as a band over what is still seen of the values before. */
  function showForecast(found) {
    if (state.mode === "section" || !waits || found.header.id < (view.forecast?.header.id ?? 0)) return;
    view.forecast = found;
    document.body.dataset.first = String(performance.now() - asked);
    tellForecast();
    view.draw();
  }

  function tellForecast() {
    const found = view.forecast?.header;
    $("readings").classList.toggle("before", Boolean(found));
    if (!found) return;
    const toes = ["left", "right"].map((side, k) => `${side} toe at ${found.toes[k].toFixed(0)} ± ${found.toe_interval[k].toFixed(0)} m`);
    say(`${SIMULATING} Band: the learned model, ${toes.join(", ")} (nine of ten slides)`);
  }

  function show(found, isNewest) {
    if (state.mode === "section") return;
    if (found.header.id >= (view.forecast?.header.id ?? 0)) view.forecast = null;
    waits = !isNewest;
    tellForecast();
    const way = view.deposit && found.header.times.length > 1;
    view.deposit = found;
    $("play").disabled = false;
    const last = found.header.times.length - 1;
    view.frame = last;
    // Without the film there is the end alone.
    Object.assign($("scrub"), { max: Math.max(last, 1), value: Math.max(last, 1), disabled: last === 0 });
    tell();
    readings(found.header.readings);
    tellDoubts(found.header.doubts);
    $("misfit").textContent = misfitWords(found.header.readings);
    describe(found.header);
    view.marks = marks(found.header.readings);
    // The view that nobody has moved shows the first deposit as large as it can be, and all of the later ones.
    if (view.isFitted && (state.first || !view.holdsAll)) view.fit();
    state.first = false;
    view.paintLegend();
    view.draw();
    if (way || !isNewest) return; // the film of what is shown already, or what a dragged slider has left behind
    const took = ((performance.now() - asked) / 1000).toFixed(2);
    const { points, computed_s: computed, cached, came_to_rest: rest } = found.header;
    say(`${points.toLocaleString("en")} points, ${rest ? "at rest" : "still moving"} after `
      + `${found.header.times[last].toFixed(1)} s; answered in ${took} s`
      + (cached ? ", kept from before" : `, ${computed.toFixed(2)} s of it simulated`));
    state.answered += 1;
    document.body.dataset.answered = String(state.answered);
    if (state.film) wantFilm();
  }

  /** Sums of squares of the last column: of the numbers that the question fits, and of the others. */
  function misfitWords(rows) {
    const numbers = rows.filter(({ in_std: off }) => off !== null);
    if (!numbers.length) return "";
    const fitted = numbers.filter((row) => isFitted(documents.now.inversion, row));
    const sum = (some) => some.reduce((all, { in_std: off }) => all + off ** 2, 0).toFixed(1);
    const others = numbers.filter((row) => !fitted.includes(row));
    return `The last column, squared and summed: ${[[fitted, "fitted"], [others, "compared"]].filter(([some]) => some.length)
      .map(([some, words]) => `${sum(some)} of ${some.length} ${words}`).join(", ")}. About 1 for each number is as good as the survey.`;
  }

  /** The result for who does not see the canvas. */
  function describe({ points: number, times, came_to_rest: rest, readings: rows }) {
    const read = rows.filter(({ simulated }) => simulated !== null).map((row) => `${row.label} ${row.simulated.toFixed(1)} ${row.unit}`
      + (row.measured === null ? "" : `, measured ${row.below}${row.measured.toFixed(1)}`));
    $("canvas").setAttribute("aria-label", [`Section before the slide, and the deposit: ${number} points, ${rest ? "at rest" : "still moving"} after ${times.at(-1).toFixed(1)} s`, ...Object.keys(state.effects).map((name) => `with ${name.replaceAll("_", " ")}`), ...read].join("; "));
  }

  /** Who moves on at once does not wait for a film. */
  function wantFilm() {
    state.film = true;
    clearTimeout(filming);
    if (view.deposit && !sliders.waiting) filming = setTimeout(() => question(true), FILM_PAUSE);
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

  /** A number of the table: one of volumes and areas in whole units. */
  const told = (value) => (Math.abs(value) >= 1000 ? Math.round(value).toLocaleString("en") : value.toFixed(1));

  const isOther = (row) => row.measured !== null && documents.now.inversion && !isFitted(documents.now.inversion, row);

  function readings(rows) {
    const body = $("readings").tBodies[0];
    body.replaceChildren(...rows.map((row) => {
      const line = document.createElement("tr");
      const off = row.in_std;
      const cells = [
        row.label.replace(/^ *by eye$/, "the same toe by eye") + (row.held_out ? " (held out)" : isOther(row) ? " (not fitted)" : ""),
        row.measured === null ? "" : `${row.below}${told(row.measured)}${row.std === null ? "" : ` ± ${row.std.toLocaleString("en")}`}`,
        row.trouble || row.simulated === null ? "not read" : `${told(row.simulated)} ${row.unit}`,
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
    $("time").value = times ? `${timeAt(times, view.frame).toFixed(1)} s` : "-";
  }

  let watching = 0; // for the film that was asked for
  let from = null; // the film has run since then: { at: [ms], time: [s] }

  /** The film stands still. */
  function pause() {
    clearInterval(watching);
    state.playing = false;
    $("play").textContent = "Play";
  }

  /** What is on its way is of another section than the one that is shown. */
  function forget() {
    sliders.forget();
    clearTimeout(filming);
    waits = false;
    view.deposit = view.forecast = null;
    view.marks = [];
  }

  /** Another tab is shown: nobody waits for an answer any more. */
  function leave() {
    if ($("status").textContent.startsWith(SIMULATING)) say("");
    pause();
  }

  function play() {
    if (!view.deposit) return;
    if (state.playing) { pause(); return; }
    if (view.deposit.header.times.length < 2) {
      // The sliders bring the deposit alone; the way there is asked for when somebody looks.
      state.playing = true;
      $("play").textContent = "Pause";
      ask(true);
      watching = setInterval(() => {
        if (view.deposit?.header.times.length > 1) { clearInterval(watching); view.frame = 0; run(); }
      }, 40);
      return;
    }
    state.playing = true;
    $("play").textContent = "Pause";
    if (view.frame >= view.deposit.header.times.length - 1) view.frame = 0;
    run();
  }

  /** From the frame that is shown on, at the speed that is chosen. */
  function run() {
    from = { at: performance.now(), time: timeAt(view.deposit.header.times, view.frame) };
    requestAnimationFrame(step);
  }

  function step(now) {
    if (!state.playing || !view.deposit) return;
    const { times } = view.deposit.header;
    const time = Math.min(from.time + (Math.max(now - from.at, 0) / 1000) * Number($("speed").value), times.at(-1));
    seek(frameAt(times, time));
    if (time === times.at(-1)) pause(); else requestAnimationFrame(step);
  }

  function seek(frame) {
    view.frame = frame;
    $("scrub").value = frame;
    tell();
    view.draw();
  }

  $("spacing").addEventListener("change", () => { state.spacing = Number($("spacing").value); ask(false); });
  $("keep").addEventListener("click", keepValues);
  $("reset").addEventListener("click", reopen);
  $("play").addEventListener("click", play);
  $("scrub").addEventListener("input", () => { seek(Number($("scrub").value)); if (state.playing) run(); });
  $("speed").addEventListener("change", () => { if (state.playing && from) run(); });
  $("colour").addEventListener("change", () => { view.colour = $("colour").value; view.paintLegend(); view.draw(); });
  $("before").addEventListener("change", () => { view.before = $("before").checked; view.draw(); });
  $("rise").addEventListener("change", () => {
    const { isFitted } = view;
    view.stretch(Number($("rise").value));
    if (isFitted) view.fit();
  });
  $("fit").addEventListener("click", () => { view.fit(); view.draw(); });
  return { flow, play, leave, forget, empty, readings, showValues, showEffects, keepAnswer };
}
