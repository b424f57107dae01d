// What was measured, and what is asked of it: forms for every type of measurement, profiles by paste or file.

import { blowCounts } from "./blow_counts.js";
import { faultList, fieldAt } from "./faults.js";
import { cellsOf, numbersOf } from "./numbers.js";
import { isFitted } from "./question.js";
import { button, el, field, keyWords, onChosen, readOnly, refill } from "./ui.js";

const words = (name) => name.replaceAll("_", " ");
const TITLES = {
  toe_runout: "How far the toe ran", surface_profile: "Profile after the slide", crest_settlement: "Drop of the crest",
  freeboard: "Freeboard left", marker_displacement: "A marker that moved", toe_history: "The toe in time",
  velocity: "Speed at a place", slide_duration: "How long it moved", no_flow: "It did not flow",
  heave: "Heave before the toe", slip_depth: "Depth of the slip", final_slope: "How steep it lies now",
};
const STD_HELP = "One standard deviation: two thirds of repeated surveys would lie within it. A levelled line 0.1 to 0.3 m, "
  + "a runout read from a map a tenth of it, a range from several papers a quarter of its width.";
const BOUNDS = { low: "lower bound", start: "first guess", high: "upper bound" };
const LOSSES = { runout: "the toes", misfit: "all that is fitted" };
const READINGS = { residual_strength_kpa: "one S_r", strength_ratio: "a ratio S_r/σ′v0" };
const RATIO = { property: "strength_ratio", low: 0.02, start: 0.1, high: 0.5 };
const SHARE = 0.1; // of a length, where nobody states its error

/** `page` has documents, editor, faults, forms (of measurements) and say(words, bad). */
export class SurveyPanel {
  constructor(left, right, page) {
    Object.assign(this, { left, right, page, unfolded: null });
  }

  get documents() { return this.page.documents.now; }
  get survey() { return this.documents.measurements; }
  get set() { return this.survey?.default_set; }
  get entries() { return this.survey?.sets?.[this.set] ?? []; }

  at(part, ...keys) { return fieldAt(this.page, part, ...keys); }

  edit(what, change) {
    this.page.documents.edit(what, (documents) => {
      documents.measurements ??= { case: this.page.documents.name, upstream: "left", initial: {}, default_set: "field", sets: { field: [] } };
      change(documents.measurements.sets[documents.measurements.default_set] ??= [], documents);
      // A survey without a measurement is none.
      if (Object.values(documents.measurements.sets).every((entries) => !entries.length)) documents.measurements = null;
    });
  }

  show() {
    const add = el("select", { "aria-label": "add a measurement", "data-key": "add" }, new Option("add a measurement ...", ""),
      ...this.page.forms.map(({ type }) => new Option(TITLES[type] ?? words(type), type)));
    onChosen(add, () => this.add(add.value));
    const children = [
      el("h2", { textContent: "Measured after the slide" }),
      ...(this.entries.length ? this.entries.map((entry, i) => this.entry(entry, i))
        : [el("p", { className: "note", textContent: "Nothing yet. How far the toe ran, or a surveyed profile, is what a back-analysis needs." })]),
      add,
      ...(this.survey ? [field({ words: "upstream", kind: "choice", choices: ["left", "right"], value: this.survey.upstream },
        (value) => this.edit("upstream", (_, documents) => { documents.measurements.upstream = value; }))] : []),
    ];
    children.push(...blowCounts(this.page));
    refill(this.left, ...(this.page.documents.shipped ? readOnly(children) : children));
    this.showRight();
  }

  add(type) {
    if (!type) return;
    const form = this.page.forms.find((one) => one.type === type);
    const names = new Set(this.entries.map(({ name }) => name));
    let name = words(type);
    for (let k = 2; names.has(name); k += 1) name = `${words(type)} ${k}`;
    const entry = { name, type, std_is: "assumed", confidence: "assumed", source: "" };
    for (const { key, kind, choices, required } of form.fields) {
      if (required && kind === "choice" && !(key in entry)) [entry[key]] = choices;
    }
    const { scene } = this.documents;
    if (type === "freeboard" && scene.water_level !== null && scene.water_level !== undefined) entry.water_level_m = scene.water_level;
    this.unfolded = name;
    this.edit("measurement added", (entries, documents) => {
      if (type === "surface_profile") {
        for (let k = 1; !entry.file || entry.file in documents.tables; k += 1) entry.file = k === 1 ? "post_failure_profile.csv" : `post_failure_profile_${k}.csv`;
        documents.tables[entry.file] = "x_m,y_m\n";
      }
      entries.push(entry);
    });
  }

  entry(entry, i) {
    const form = this.page.forms.find(({ type }) => type === entry.type);
    const { inversion } = this.documents;
    // A number that is given, or that is wanted, is not looked for in a fold.
    const isSeen = ({ key, kind, required: must }) => must || key === "held_out" || key === "std_is"
      || (kind === "number" && entry[key] !== undefined) || this.at("measurements", "sets", this.set, i, entry.type, key).wrong;
    const required = (form?.fields ?? []).filter(isSeen);
    const rest = (form?.fields ?? []).filter((one) => !required.includes(one) && !(entry.type === "surface_profile" && one.key === "part"));
    const set = (key) => (value) => this.edit(keyWords(key)[0], (entries, documents) => {
      if (key === "name" && documents.inversion?.fit) documents.inversion.fit = documents.inversion.fit.map((one) => (one === entries[i].name ? value : one));
      if (value === null) delete entries[i][key]; else entries[i][key] = value;
    });
    const one = ({ key, kind, choices, meaning, default: usual }) => {
      if (key === "file") return this.profile(entry, i);
      const [label, unit] = keyWords(key);
      const isStd = key.startsWith("std_") && kind === "number";
      const plain = label.replace(/^std is$/, "this deviation is").replace(/^std$/, "standard deviation");
      const made = field({ words: `${plain} of ${entry.name}`, shown: plain, key: `${i}.${key}`, kind, choices, unit,
        value: entry[key], help: isStd ? STD_HELP : meaning, holder: Array.isArray(usual) ? usual.join(", ") : usual ?? "",
        ...this.at("measurements", "sets", this.set, i, entry.type, key) }, set(key));
      const extra = isStd ? this.assumed(entry, i, key) : /^(x|y|water_level)_m$/.test(key) && key !== "y_m" ? this.pick(entry, i, key) : null;
      return extra ? el("div", { className: "with" }, made, extra) : made;
    };
    const fitted = isFitted(inversion, entry);
    return el("details", { className: "entry", "data-key": `entry-${entry.name}`, open: this.unfolded === entry.name },
      el("summary", {}, `${entry.name} `, el("span", { className: "note", textContent: this.brief(entry) })),
      ...required.map(one),
      inversion?.fit ? field({ words: `${entry.name} is fitted`, shown: "is fitted", key: `${i}.fit`, kind: "switch", value: fitted,
        help: "it takes part in the fit; the others are compared with the answer" }, (value) => this.page.documents.edit("fitted", (documents) => {
        documents.inversion.fit = documents.inversion.fit.filter((name) => name !== entry.name);
        if (value) documents.inversion.fit.push(entry.name);
      })) : null,
      el("details", { "data-key": `more-${entry.name}` }, el("summary", { textContent: "more" }), ...rest.map(one)),
      button("Remove", () => this.edit("measurement removed", (entries, documents) => {
        entries.splice(i, 1);
        if (documents.inversion?.fit) documents.inversion.fit = documents.inversion.fit.filter((name) => name !== entry.name);
      }), { title: `remove ${entry.name}` }));
  }

  brief(entry) {
    const value = entry.value_m ?? entry.value_s ?? entry.value_m_per_s ?? entry.value_deg ?? entry.limit_m;
    const std = entry.std_m ?? entry.std_s ?? entry.std_m_per_s ?? entry.std_deg;
    const number = value === undefined ? TITLES[entry.type] ?? words(entry.type) : `${entry.type === "no_flow" ? "< " : ""}${value}`;
    return `${number}${std === undefined ? "" : ` ± ${std}`}${entry.held_out ? ", held out" : ""}`;
  }

  /** A standard deviation for who has none: a tenth of a length, at least one spacing. */
  assumed(entry, i, key) {
    const value = entry.value_m;
    if (value === undefined || entry[key] !== undefined) return null;
    const { scene } = this.documents;
    const std = Number(Math.max(SHARE * Math.abs(value), scene.spacing ?? 0).toPrecision(3));
    return button(`assume ${std}`, () => this.edit("standard deviation", (entries) => { Object.assign(entries[i], { [key]: std, std_is: "assumed" }); }),
      { className: "small", title: "a tenth, at least one spacing of points" });
  }

  pick(entry, i, key) {
    return button("click it", () => {
      this.page.say("click the place on the section");
      this.page.editor.askPlace(([x, y]) => this.edit("place", (entries) => {
        if (key === "water_level_m") entries[i].water_level_m = y;
        else { entries[i].x_m = x; if (entry.type === "marker_displacement") entries[i].y_m = y; }
      }));
    }, { className: "small", title: "take the place from the section" });
  }

  /** The surveyed line: two columns pasted, or a file. */
  profile(entry, i) {
    const text = this.documents.tables[entry.file] ?? "";
    const set = (content) => {
      let table;
      try { table = tableOf(content); } catch (error) { this.page.say(error.message, true); return; }
      this.page.documents.edit("profile", (documents) => { documents.tables[entry.file] = table; });
    };
    const area = el("textarea", { rows: 7, value: text, "aria-label": `points of ${entry.name}`, "data-key": `${i}.file`,
      placeholder: "x and y [m] of the surface, a point a line", on: { change: ({ target }) => set(target.value),
        paste: ({ target }) => setTimeout(() => set(target.value)) } }); // it is seen at once
    const file = el("input", { type: "file", accept: ".csv,.txt", "aria-label": `file of ${entry.name}` });
    file.addEventListener("change", async () => { if (file.files[0]) set(await file.files[0].text()); });
    return el("div", {}, el("p", { className: "note", textContent: "Paste two columns, x and y in metres, from left to right, or choose a file:" }), area, file);
  }

  showRight() {
    const { inversion } = this.documents;
    const asked = inversion ? this.question(inversion) : [
      el("p", { className: "note", textContent: "S_r of what liquefied, such that the slide runs as far as measured. It is asked as soon as section and survey hold together." })];
    refill(this.right, ...faultList(this.page, "survey"),
      el("h2", { textContent: "Asked" }), ...(this.page.documents.shipped ? readOnly(asked) : asked));
  }

  /** Something liquefies in a section without a fault: else there is nothing to ask for. */
  get canPropose() {
    return !this.page.faults.some(({ document: part }) => part === "scene")
      && Object.values(this.documents.scene.materials).some(({ liquefied }) => liquefied);
  }

  question(inversion) {
    const set = (i, key) => (value) => this.page.documents.edit(key, (documents) => { documents.inversion.parameters[i][key] = value; });
    return [
      ...inversion.parameters.map((one, i) => el("div", { className: "parameter" },
        el("p", {}, one.label || words(one.name), " ",
          button("✕", () => this.forget(i), { title: `do not ask for ${one.label || one.name}`, className: "small" })),
        ...(one.property in READINGS ? [field({ words: `how the strength of ${one.label || one.name} is asked`, shown: "as", key: `${one.name}.property`,
          kind: "choice", choices: Object.keys(READINGS), names: READINGS, value: one.property,
          help: "one strength everywhere in its zones, or one that follows the vertical effective stress before the slide" },
        (value) => this.askAs(i, value))] : []),
        ...["low", "start", "high"].map((key) => field({ words: `${BOUNDS[key]} of ${one.label ?? one.name}`, shown: BOUNDS[key], key: `${one.name}.${key}`, value: one[key], unit: keyWords(one.property)[1],
          ...this.at("inversion", "parameters", i, key) }, set(i, key))))),
      field({ words: "fitted to", kind: "choice", choices: ["runout", "misfit"], names: LOSSES, value: inversion.loss ?? "runout",
        help: "the toes alone, in metres; or everything that is ticked as fitted, each in standard deviations of its survey" },
      (value) => this.page.documents.edit("loss", (documents) => { documents.inversion.loss = value; })),
      button("Ask as for a new case", () => this.page.propose(), { title: "S_r of every liquefied material, fitted to the toes; replaces what is asked now",
        disabled: !this.canPropose }),
    ];
  }

  /** A ratio in place of S_r, with the bounds of published flow slides and room; back: S_r as for a new case. */
  askAs(i, property) {
    if (property !== "strength_ratio") { this.page.propose(); return; }
    this.page.documents.edit("strength ratio", (documents) => {
      const now = documents.inversion.parameters[i];
      Object.assign(now, RATIO, { name: now.name.replace(/^residual_strength/, "strength_ratio") });
      if (now.label) now.label = now.label.replace(/^S_r of/, "S_r/σ'v0 of");
      delete now.prior; // it was in kPa
    });
  }

  /** Without any unknown nothing is asked, until section and survey hold together and S_r is proposed again. */
  forget(i) {
    this.page.documents.edit("no longer asked", (documents) => {
      documents.inversion.parameters.splice(i, 1);
      if (!documents.inversion.parameters.length) documents.inversion = null;
    });
  }
}

/**
 * Pasted columns as the CSV of a profile; one that has its header and nothing else than CSV is kept as it is.
 *
 * A row that is not two numbers is an error, but for titles before the first one, whose units count.
 */
export function tableOf(text) {
  const rows = text.replaceAll("\r", "").split("\n").map((row) => row.trim()).filter(Boolean);
  if (rows.some((row) => /^x_m\s*,/.test(row)) && !rows.some((row) => /[\t;]/.test(row))) return `${rows.join("\n")}\n`;
  let points;
  try {
    points = numbersOf(rows.map(cellsOf), ["m", "m"]);
    if (points.some(({ length }) => length !== 2)) throw new Error(rows[0]);
  } catch (error) { throw new Error(`${error.message}: a point is two numbers, x and y in metres`); }
  return `x_m,y_m\n${points.map((row) => `${row.join(",")}\n`).join("")}`;
}
