// Asks for the strengths of a prediction: mean, standard deviation and distribution, with help.

import { numberBox } from "./numbers.js";
import { el } from "./ui.js";

/** Of the choice of strengths: those of the joint relation, no number of a job. */
const JOINT = "joint";
const [STRENGTH, RATIO] = ["residual_strength_kpa", "strength_ratio"];
const unitOf = ({ property }) => (property === RATIO ? "" : "kPa");
const wordsOf = (row) => (row.property === RATIO ? `${row.label} / σ'v0` : row.label);

/**
 * Zones that share a strength: those whose strength the question of the case asks for, else the
 * soils that liquefy. The same choice as that of `flowslide predict`.
 */
function groups({ found, changes }) {
  const { materials } = found.scene;
  const ratioOf = (material) => (typeof materials[material]?.strength_ratio === "number" ? materials[material].strength_ratio : "");
  // The cohesion of a soil with a ratio is the least that it has, no strength that is expected.
  const now = (material, property) => (property === RATIO ? ratioOf(material) : changes.strengths_kpa[material] ?? (ratioOf(material) === "" ? materials[material].cohesion_kpa : ""));
  const ofZone = (name) => found.scene.zones.find((zone) => zone.name === name)?.material;
  const asked = (found.inversion?.parameters ?? []).filter((one) => [STRENGTH, RATIO].includes(one.property));
  if (asked.length) {
    return asked.map(({ label, zones, property }) => ({ label: label || `S_r of ${zones.join(", ")}`, zones, property, mean: now(ofZone(zones[0]), property) }));
  }
  return Object.entries(found.scene.materials).filter(([, soil]) => soil.liquefied).map(([name]) => ({
    label: `S_r, ${name.replaceAll("_", " ")}`, property: ratioOf(name) === "" ? STRENGTH : RATIO,
    zones: found.scene.zones.filter((zone) => zone.material === name).map((zone) => zone.name),
  })).filter((one) => one.zones.length).map((one) => ({ ...one, mean: now(ofZone(one.zones[0]), one.property) }));
}

/** Ends of 95 % of a distribution with this mean and standard deviation [kPa]. */
function ends(mean, std, distribution) {
  if (distribution === "normal") return [Math.max(mean - 1.96 * std, 0.1 * mean), mean + 1.96 * std];
  const variance = Math.log1p((std / mean) ** 2);
  return [-1.96, 1.96].map((score) => mean * Math.exp(score * Math.sqrt(variance) - 0.5 * variance));
}

/** `done`: jobs on the case as it is; `start(options)` gives a fault in words, or nothing. */
export function askStrengths(state, done, start) {
  const dialog = el("dialog", { className: "form" });
  dialog.setAttribute("aria-label", "Predict");
  const rows = groups(state).map((group) => ({ ...group, ...fields(group) }));
  // By the jobs of before: strengths in kPa, and ratios.
  const known = done.flatMap((job) => [...(job.strengths ?? []).map((one) => ({ ...one, property: STRENGTH })), ...(job.ratios ?? [])])
    .filter((one) => one.std && rows.some((row) => isOf(one, row)));
  const drawn = done.filter((job) => job.kind === "posterior");
  const { joint } = state.found.derived ?? {};
  const kind = el("select", {}, new Option("lognormal: never negative, longer to the right", "lognormal"),
    new Option("normal: as far above as below", "normal"));
  const source = el("select", {}, new Option("the values below", ""),
    ...drawn.map((job) => new Option(`draws of the posterior at ${job.options.spacing_m} m`, job.id)),
    ...(joint ? [new Option(`the ratio that other slides tell, ${joint}`, JOINT)] : []));
  const thicker = el("input", { type: "text", size: 12, value: state.body ? state.found.derived.least_m : "", "aria-label": "thicknesses of the deposit [m]" });
  const fault = el("p", { className: "fault" });
  fault.setAttribute("role", "alert");
  const table = el("table", {},
    el("thead", {}, el("tr", {}, ...["soil", "mean", "std", "95 % of the slides"].map((text, i) => (rows.every(unitOf) && (i === 1 || i === 2) ? `${text}, kPa` : text)).map((text) => el("th", { textContent: text })))),
    el("tbody", {}, ...rows.map((row) => el("tr", {},
      el("td", { textContent: wordsOf(row) + (unitOf(row) && !rows.every(unitOf) ? ", kPa" : ""), title: row.zones.join(", ") }), el("td", {}, row.mean), el("td", {}, row.std), el("td", {}, row.range)))));
  const tell = () => {
    table.hidden = Boolean(source.value);
    for (const { mean, std, range, property } of rows) {
      const [a, b] = [Number(mean.value), Number(std.value)];
      range.value = a > 0 && b > 0 ? ends(a, b, kind.value).map((end) => end.toFixed(property === RATIO ? 3 : 1)).join(" to ") : "-";
    }
  };
  const fill = el("button", { type: "button", textContent: "As found for this case", hidden: !known.length });
  fill.title = known.length ? `${known[0].method}: ${known[0].label}` : "";
  fill.addEventListener("click", () => {
    for (const row of rows) {
      const one = known.find((found) => isOf(found, row));
      if (!one) continue;
      row.mean.value = Number(one.value.toPrecision(4));
      row.std.value = Number(one.std.toPrecision(3));
    }
    fault.textContent = "";
    tell();
  });
  const run = el("button", { className: "main", textContent: "Predict" });
  const close = el("button", { type: "button", textContent: "Close" });
  close.addEventListener("click", () => dialog.close());
  const form = el("form", {},
    el("h2", { textContent: "How far would it run?" }),
    el("p", { textContent: "The strength of a soil that liquefies is known within a range only. Give the value that you expect "
      + "and its standard deviation: two slides of three then have a strength within one standard deviation of the mean. The "
      + "result is the probability that the toe passes any distance." }),
    el("p", { className: "note", textContent: "Where from: a back-analysis of this slope or of a similar one gives both numbers."
      + (state.body ? "" : " From blow counts alone, close this and ask \"From blow counts\": published relations bring their own scatter.") }),
    ...(drawn.length || joint ? [el("label", { className: "row" }, "Strengths ", source)] : []),
    table,
    el("label", { className: "row" }, "Distribution ", kind),
    state.body ? el("label", { className: "row", title: "several with spaces; empty: that from which soil counts as a deposit" }, "Map where the deposit is thicker than, m ", thicker) : "",
    fault,
    el("div", { className: "buttons" }, fill, close, run));
  form.addEventListener("input", () => { fault.textContent = ""; tell(); });
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    const empty = source.value ? undefined : rows.find(({ mean, std }) => !(mean.value > 0 && std.value > 0));
    if (empty) {
      fault.textContent = `${empty.label}: mean and standard deviation must be greater than 0.`;
      (empty.mean.value > 0 ? empty.std : empty.mean).focus();
      return;
    }
    const wide = source.value ? undefined : rows.find(({ mean, std }) => Number(std.value) > Number(mean.value));
    if (wide) {
      fault.textContent = `${wide.label}: the standard deviation must be at most the mean. What is known no better is no strength to predict from.`;
      wide.std.focus();
      return;
    }
    const given = (property) => rows.filter((row) => row.property === property).map(({ zones, mean, std }) => `${zones.join(",")}=${mean.value}+-${std.value}`);
    const options = source.value === JOINT ? { joint: true } : source.value ? { posterior: source.value } : {
      strengths: given(STRENGTH), ratios: given(RATIO), distribution: kind.value,
    };
    if (state.body) {
      options.thicker_than_m = thicker.value.split(/[\s;]+/).filter(Boolean).map((text) => Number(text.replace(",", ".")));
      if (!options.thicker_than_m.every((metres) => metres > 0)) { fault.textContent = "Thicknesses are numbers greater than 0, with spaces between them."; thicker.focus(); return; }
    }
    fault.textContent = await start(options);
    if (!fault.textContent) dialog.close();
  });
  if (!rows.length) {
    fault.textContent = "No soil of this section liquefies: mark one as liquefied first.";
    run.disabled = true;
  }
  dialog.append(form);
  dialog.addEventListener("close", () => dialog.remove());
  document.body.append(dialog);
  tell();
  dialog.showModal();
}

const isOf = (found, row) => found.property === row.property && found.zones.join() === row.zones.join();

function fields(row) {
  const [unit, label] = [unitOf(row), wordsOf(row)];
  const { mean } = row;
  const field = (value, words) => {
    const made = el("input", { "aria-label": `${words} of ${label}${unit && ` [${unit}]`}` });
    return numberBox(made, { key: `${words} of ${label}`, unit, value }, (now) => { made.value = now ?? ""; }, (fault) => { made.title = fault; });
  };
  return { mean: field(mean, "mean"), std: field("", "standard deviation"), range: el("output", { value: "-" }) };
}
