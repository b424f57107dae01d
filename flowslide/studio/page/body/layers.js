// What a map of a body shows by colours: its values, its scale, its legend.

import { el } from "../ui.js";
import { ramp, zoneColours } from "../view.js";

// From what sank over nothing to what rose: as in the pictures of the reports.
const APART = [[33, 102, 172], [146, 197, 222], [247, 247, 247], [244, 165, 130], [178, 24, 43]];
const CHANCES = [1, 5, 10, 25, 50, 75, 95, 100]; // ends of classes [%], as report/pictures/exceedance_map.py has them

const mix = (colours, share) => {
  const place = Math.min(Math.max(share, 0), 1) * (colours.length - 1);
  const k = Math.min(Math.floor(place), colours.length - 2);
  return colours[k].map((low, c) => low + (place - k) * (colours[k + 1][c] - low));
};
const rgb = (hex) => [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16));

/** Names and words of what a film can show. */
export function layersOf(film) {
  const found = [["thickness", "thickness of the soil"], ["zone", "soils"]];
  if (film.isRun) found.push(["change", "change of the surface"], ["speed", "largest speed"]);
  if (film.measured) found.push(["measured", "measured change"]);
  if (film.measured && film.isRun) found.push(["difference", "simulated less measured"]);
  const chances = (film.header.thicker_than_m ?? []).map((metres, k) => [`chance${k}`, `probability of more than ${metres} m`]);
  return [...chances, ...found];
}

/**
 * A layer at the frame that is shown: `value(c)` of a cell, NaN where nothing is to be seen, `colour(value)` [r, g, b],
 * and for the legend `words`, `unit`, and the ends of its scale or its `items`.
 */
export function layerOf(film, name, scene) {
  const thickness = film.now("thickness");
  const { least_m: least } = film.header;
  const { before, cells } = film;
  if (name === "zone") {
    const colours = zoneColours(scene).map(rgb);
    const items = [...new Map(scene.zones.map(({ material }, k) => [material, [colours[k], material.replaceAll("_", " ")]])).values()];
    return { value: (c) => (thickness[c] > 0.02 * film.cell && film.zoneAt(c) >= 0 ? film.zoneAt(c) : NaN), colour: (k) => colours[k], items, crisp: true, words: "soil that lies highest" };
  }
  if (name.startsWith("chance")) {
    const k = Number(name.slice(6));
    const metres = film.header.thicker_than_m[k];
    const of = (percent) => CHANCES.findLastIndex((end, n) => n < CHANCES.length - 1 && percent >= end);
    const colour = (percent) => ramp(of(percent) / (CHANCES.length - 2));
    const items = CHANCES.slice(0, -1).map((end, n) => [ramp(n / (CHANCES.length - 2)), `${end}-${CHANCES[n + 1]} %`]);
    const value = (c) => { const percent = 100 * film.exceedance[k * cells + c]; return before[c] >= metres || percent < CHANCES[0] ? NaN : percent; };
    return { value, colour, items, unit: "%", words: `probability of a deposit thicker than ${metres} m, where the soil was thinner before` };
  }
  if (name === "thickness") {
    const top = largest(film, "thickness", film.thickness, least);
    return { value: (c) => (thickness[c] >= least ? thickness[c] : NaN), colour: (m) => ramp(m / top), ends: [0, top], unit: "m", words: `thickness of the soil, where it is at least ${least} m` };
  }
  if (name === "speed") {
    const top = largest(film, "speed", film.speed, 0.1);
    return { value: (c) => film.speed[c], colour: (v) => ramp(v / top), ends: [0, top], unit: "m/s", words: "largest speed on its way, of the soil that came to lie there" };
  }
  const moved = (c) => thickness[c] - before[c];
  const risen = (c) => film.measured[c] - film.base[c] - before[c];
  const value = { change: moved, measured: risen, difference: (c) => moved(c) - risen(c) }[name];
  const top = widest(film, name);
  const words = { change: "change of the surface since the start", measured: "change of the surface as it was surveyed", difference: "surface simulated less surveyed" }[name];
  const seen = (c) => { const metres = value(c); return Math.abs(metres) < 0.02 * top ? NaN : metres; };
  return { value: seen, colour: (m) => mix(APART, 0.5 + (0.5 * m) / top), ends: [-top, top], unit: "m", words };
}

/** The upper end of a scale, that of the whole film, so that colours keep their meaning. */
function largest(film, name, values, least) {
  film.tops ??= {};
  if (!(name in film.tops)) film.tops[name] = values.reduce((top, one) => (one > top ? one : top), least);
  return film.tops[name];
}

/** The same of what rises and sinks: at the end of the film. */
function widest(film, name) {
  film.tops ??= {};
  if (!(name in film.tops)) {
    let top = 0.1;
    const end = film.last * film.cells;
    for (let c = 0; c < film.cells; c += 1) {
      const moved = film.thickness[end + c] - film.before[c];
      const risen = film.measured ? film.measured[c] - film.base[c] - film.before[c] : 0;
      for (const metres of { change: [moved], measured: [risen], difference: [moved - risen] }[name]) if (Math.abs(metres) > top) top = Math.abs(metres);
    }
    film.tops[name] = top;
  }
  return film.tops[name];
}

/** The legend of a layer. */
export function legendOf({ words, unit = "", items, ends, colour }) {
  const box = (one) => { const made = el("i"); made.style.background = `rgb(${one.map(Math.round).join(" ")})`; return made; };
  if (items) return [el("span", { textContent: words }), ...items.map(([one, text]) => el("span", {}, box(one), text))];
  const bar = el("span", { className: "scale" });
  const stops = [0, 0.25, 0.5, 0.75, 1].map((share) => `rgb(${colour(ends[0] + share * (ends[1] - ends[0])).map(Math.round).join(" ")}) ${100 * share}%`);
  bar.style.background = `linear-gradient(90deg, ${stops.join(", ")})`;
  const end = (value) => Number(value.toPrecision(3)).toString().replace("-", "−");
  return [el("span", {}, `${words}: ${end(ends[0])}`, bar, `${end(ends[1])} ${unit}`)];
}
