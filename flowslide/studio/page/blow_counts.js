// Blow counts of what liquefied, zone by zone: what published relations make strengths of.

import { fieldAt } from "./faults.js";
import { el, field } from "./ui.js";

const KINDS = { n1_60cs: "N1,60cs, of clean sand", n1_60: "N1,60" };
const words = (name) => name.replaceAll("_", " ");

/** Fields for a panel; `page` has documents and faults. None where nothing liquefies. */
export function blowCounts(page) {
  const { scene, blow_counts: counts } = page.documents.now;
  const layers = counts?.layers ?? [];
  const layerOf = (zone) => layers.findIndex(({ zones }) => zones?.includes(zone));
  const names = scene.zones.map(({ name }) => name).filter((name) => layerOf(name) >= 0
    || scene.materials[scene.zones.find((zone) => zone.name === name).material]?.liquefied);
  if (!names.length) return [];
  const kind = layers.length && layers.every((one) => one.n1_60cs === undefined) ? "n1_60" : "n1_60cs";
  const at = (number, key) => {
    return number < 0 ? {} : fieldAt(page, "blow_counts", "layers", number, key);
  };
  const sources = [...new Set(layers.map(({ source }) => source ?? ""))];
  const edit = (what, change) => page.documents.edit(what, (documents) => {
    documents.blow_counts ??= { layers: [] };
    change(documents.blow_counts);
    if (!documents.blow_counts.layers.length) documents.blow_counts = null;
  });
  return [el("details", { "data-key": "blow-counts", open: layers.length > 0 },
    el("summary", {}, "Blow counts ", el("span", { className: "note", textContent: "for From blow counts, under Ask" })),
    field({ words: "kind of the blow counts", shown: "kind", kind: "choice", choices: Object.keys(KINDS), names: KINDS, value: kind,
      help: "corrected to one atmosphere and 60 % of the energy; cs: for residual strengths of sand with fines" },
    (value) => edit("kind of blow counts", (to) => {
      for (const layer of to.layers) {
        if (layer[kind] === undefined) continue;
        layer[value] = layer[kind];
        delete layer[kind];
      }
    })),
    ...names.map((zone) => {
      const number = layerOf(zone);
      return field({ words: `blow count of ${words(zone)}`, shown: words(zone), key: `blow-${zone}`, value: layers[number]?.[kind] ?? layers[number]?.n1_60, ...at(number, kind) },
        (value) => edit("blow count", (to) => setCount(to, zone, kind, value, sources.length === 1 ? sources[0] : "")));
    }),
    layers.length ? field({ words: "source of the blow counts", shown: "source", kind: "text", key: "blow-source", value: sources.length === 1 ? sources[0] : "",
      holder: sources.length > 1 ? "several" : "where they are written", ...at(layers.findIndex(({ source }) => !source), "source") },
    (value) => edit("source of blow counts", (to) => { for (const layer of to.layers) layer.source = value ?? ""; })) : null)];
}

/** A zone of a layer of several gets one of its own. */
function setCount(to, zone, kind, value, source) {
  const old = to.layers.find(({ zones }) => zones.includes(zone));
  if (old?.zones.length === 1 && value !== null) { old[kind] = value; return; }
  if (old) old.zones = old.zones.filter((one) => one !== zone);
  to.layers = to.layers.filter(({ zones }) => zones.length);
  if (value !== null) to.layers.push({ confidence: "assumed", source, ...old, zones: [zone], [kind]: value });
}
