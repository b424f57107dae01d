// Asks for the strengths of a prediction: mean, standard deviation and distribution, with help.

import { numberBox } from "./numbers.js";
import { el } from "./ui.js";

/** Of the choice of strengths: those of the joint relation, no number of a job. */
const JOINT = "joint";

/**
 * Zones that share a strength: those whose strength the question of the case asks for, else the
 * soils that liquefy. The same choice as that of `flowslide predict`.
 */
function groups({ found, changes }) {
  const now = (material) => changes.strengths_kpa[material] ?? found.scene.materials[material].cohesion_kpa;
  const ofZone = (name) => found.scene.zones.find((zone) => zone.name === name)?.material;
  const asked = (found.inversion?.parameters ?? []).filter((one) => ["residual_strength_kpa", "strength_ratio"].includes(one.property));
  if (asked.length) {
    return asked.map((one) => ({ label: one.label || `S_r of ${one.zones.join(", ")}`, zones: one.zones, mean: now(ofZone(one.zones[0])) }));
  }
  return Object.entries(found.scene.materials).filter(([, soil]) => soil.liquefied).map(([name]) => ({
    label: `S_r, ${name.replaceAll("_", " ")}`, mean: now(name),
    zones: found.scene.zones.filter((zone) => zone.material === name).map((zone) => zone.name),
  })).filter((one) => one.zones.length);
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
  const known = done.flatMap((job) => job.strengths ?? []).filter((one) => one.std);
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
    el("thead", {}, el("tr", {}, ...["soil", "mean, kPa", "std, kPa", "95 % of the slides"].map((text) => el("th", { textContent: text })))),
    el("tbody", {}, ...rows.map((row) => el("tr", {},
      el("td", { textContent: row.label, title: row.zones.join(", ") }), el("td", {}, row.mean), el("td", {}, row.std), el("td", {}, row.range)))));
  const tell = () => {
    table.hidden = Boolean(source.value);
    for (const { mean, std, range } of rows) {
      const [a, b] = [Number(mean.value), Number(std.value)];
      range.value = a > 0 && b > 0 ? ends(a, b, kind.value).map((end) => end.toFixed(1)).join(" to ") : "-";
    }
  };
  const fill = el("button", { type: "button", textContent: "As found for this case", hidden: !known.length });
  fill.title = known.length ? `${known[0].method}: ${known[0].label}` : "";
  fill.addEventListener("click", () => {
    for (const row of rows) {
      const one = known.find(({ zones }) => zones.join() === row.zones.join());
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
    const options = source.value === JOINT ? { joint: true } : source.value ? { posterior: source.value } : {
      strengths: rows.map(({ zones, mean, std }) => `${zones.join(",")}=${mean.value}+-${std.value}`), distribution: kind.value,
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

function fields({ label, mean }) {
  const field = (value, words) => {
    const made = el("input", { "aria-label": `${words} of ${label} [kPa]` });
    return numberBox(made, { key: `${words} of ${label}`, unit: "kPa", value }, (now) => { made.value = now ?? ""; }, (fault) => { made.title = fault; });
  };
  return { mean: field(mean, "mean"), std: field("", "standard deviation"), range: el("output", { value: "-" }) };
}
