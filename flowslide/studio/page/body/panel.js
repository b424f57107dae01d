// What stands on the left of a body: what it is, the strengths and the spacing of the next run, the ends of the section.

import { numberBox } from "../numbers.js";
import { button, el, field, refill } from "../ui.js";

const MOST_POINTS = 2_000_000; // as flowslide/studio/bodies.py has it
const SHARES = [0.5, 2 / 3, 1, 4 / 3, 2, 3]; // of the spacing of the case
const EDITING = "A case in three dimensions is looked at, run and asked here. It cannot be edited here: "
  + "its soil and ground are in scene3d.yaml and the files that it names, and are shown again when those change.";

const spaced = (name) => name.replaceAll("_", " ");
const heading = (textContent) => el("h2", { textContent });
const note = (textContent, more = {}) => el("p", { className: "note", textContent, ...more });

/** `on` has strength(name, value), spacing(value) and line(places); `line` are the ends of the section. */
export function fillPanel(panel, state, line, on) {
  const { found } = state;
  const { derived, scene, faults } = found;
  const wrong = faults.map(({ document, message }) => el("li", { textContent: `${document}: ${message}` }));
  refill(panel,
    heading(found.title ?? spaced(state.name)),
    found.description ? note(found.description) : null,
    wrong.length ? el("ul", { className: "faults" }, ...wrong) : null,
    derived ? facts(derived) : null,
    note(EDITING, { id: "body-editing" }),
    ...(derived ? [
      heading("Strengths of the next run"),
      ...Object.entries(scene.materials).sort(([, a], [, b]) => Number(b.liquefied) - Number(a.liquefied)).map((soil) => strengthField(soil, state.changes.strengths_kpa, on.strength)),
      note("They count for Simulate alone; the other questions take what the files say."),
      heading("Resolution"),
      spacingField(derived, state.spacing, on.spacing),
      heading("Section from A to B"),
      ...lineFields(derived, line, on.line),
    ] : []));
}

function facts({ volume_m3: volume, size_m: size, origin, duration_s: duration, water_level: level, sloping_water: slopes }) {
  const rows = [
    ["soil", `${Math.round(volume).toLocaleString("en")} m³`],
    ["size in plan", size.map((metres) => `${Math.round(metres)} m`).join(" × ")],
    ["coordinates less", origin.some(Boolean) ? origin.join(", ") : ""],
    ["slide of at most", duration === null ? "" : `${duration} s`],
    ["water level", level === null ? "none" : `${level} m${slopes ? ", sloping: it stays where it is" : ""}`],
  ];
  const row = ([words, value]) => el("tr", {}, el("td", { textContent: words }), el("td", { textContent: value }));
  return el("table", {}, el("tbody", {}, ...rows.filter(([, value]) => value).map(row)));
}

/** The cohesion of a material in the next run; that of the files is no change. */
function strengthField([name, soil], changed, set) {
  if (typeof soil.strength_ratio === "number") {
    return field({ words: `S_r, ${spaced(name)}, instead of its ratio ${soil.strength_ratio}`, key: `strength-${name}`, unit: "kPa", value: changed[name] },
      (value) => set(name, value));
  }
  const label = soil.liquefied ? `S_r, ${spaced(name)}`
    : soil.friction_deg ? `cohesion, ${spaced(name)} (${soil.friction_deg}°)` : `strength, ${spaced(name)}`;
  return field({ words: label, key: `strength-${name}`, unit: "kPa", value: changed[name] ?? soil.cohesion_kpa },
    (value) => set(name, value === soil.cohesion_kpa ? null : value));
}

function spacingField(derived, chosen, set) {
  const points = (spacing) => derived.points * (derived.spacing_m / spacing) ** 3;
  const own = derived.spacing_m;
  const others = SHARES.map((share) => Number((share * own).toPrecision(2)));
  const all = [...new Set([...others, own, chosen])].filter((one) => points(one) <= MOST_POINTS).sort((a, b) => a - b);
  const words = (spacing) => (spacing === own ? `${spacing} m, ${derived.points.toLocaleString("en")} points, as the case has it`
    : `${spacing} m, about ${Number(points(spacing).toPrecision(2)).toLocaleString("en")} points`);
  const choice = el("select", { "aria-label": "Spacing of the points", title: "half the spacing takes about sixteen times as long" },
    ...all.map((one) => new Option(words(one), one, false, one === chosen)));
  choice.addEventListener("change", () => set(Number(choice.value)));
  return choice;
}

function lineFields({ paths, lines }, line, set) {
  const told = el("p", { className: "wrong", "aria-live": "polite" });
  const box = (k, axis) => {
    const words = `${"xy"[axis]} of ${"AB"[k]}`;
    const input = el("input", { "aria-label": `${words} [m]`, "data-key": `end-${k}-${axis}` });
    return numberBox(input, { key: `end-${k}-${axis}`, unit: "m", value: line[k] ? Number(line[k][axis].toFixed(1)) : "" },
      (value) => set(line.map((place, n) => place.map((old, m) => (n === k && m === axis ? value ?? old : old)))),
      (fault) => { told.textContent = fault && `${words}: ${fault}`; });
  };
  const along = ([name, way]) => button(spaced(name), () => set([way[0], way.at(-1)]), { className: "small", title: "from its first place straight to its last" });
  return [
    el("div", { className: "ends" }, "A", box(0, 0), box(0, 1), "B", box(1, 0), box(1, 1)), told,
    note("x and y in m; or drag A, B or the line in the plan, or move it with the arrow keys there."),
    el("div", { className: "buttons" }, ...Object.entries({ ...paths, ...lines }).map(along),
      button("across", () => set(turned(line)), { className: "small", title: "a quarter turn about its middle" })),
  ];
}

/** A line turned by a quarter about its middle. */
function turned([[ax, ay], [bx, by]]) {
  const [mx, my, dx, dy] = [0.5 * (ax + bx), 0.5 * (ay + by), 0.5 * (bx - ax), 0.5 * (by - ay)];
  return [[mx + dy, my - dx], [mx - dy, my + dx]];
}
