// Switches of a diagnosis' effects: on shows the slide with one of them as it was found, off the slide without.

import { el } from "./ui.js";

const plain = (name) => name.replaceAll("_", " ");

/** Values by parameter, as sliders take them: [{ property, zones, value }]. */
export function asValues(values, { found }) {
  return (found.inversion?.parameters ?? []).filter(({ name }) => name in values)
    .map(({ name, property, zones }) => ({ property, zones: zones ?? [], value: values[name] }));
}

const canBeShown = (one, state) => state.workspace.effects.some(({ name }) => name === one.name);
/** What an answer names, { name: amplitude }; nothing where the picture cannot have one of them. */
export function namedEffects({ effects }, state) {
  const named = effects.each.filter((one) => one.how === "named");
  return named.every((one) => canBeShown(one, state)) ? Object.fromEntries(named.map(({ name, amplitude }) => [name, amplitude])) : null;
}

/** Amplitudes of the picture's effects by name: those of the case, and those of the sliders. */
const shownEffects = (state) => Object.fromEntries(Object.entries({ ...state.found?.scene?.effects, ...state.effects }).map(([name, one]) => [name, one?.amplitude ?? one]));
const isOn = ({ name, amplitude }, state) => Math.abs((shownEffects(state)[name] ?? 0) - amplitude) <= 1e-3 * Math.abs(amplitude);
const isOfCase = (one, state) => isOn(one, state) && !(one.name in state.effects);

/** A switch for each effect that the answer of a job names or has tried. */
export function switches(job, state, slide) {
  const { base, final, each } = job.effects;
  const turn = (one, on) => {
    const kept = Object.fromEntries(Object.entries(state.effects).filter(([name]) => name !== one.name));
    // Effects that are named belong together; one that was only tried was calibrated alone.
    if (on) for (const other of each) if (one.how !== "named" || other.how !== "named") delete kept[other.name];
    if (on) kept[one.name] = one.amplitude;
    const others = each.filter(({ name }) => name in kept);
    const values = on ? one.values : others.length ? final : base;
    slide.showEffects(kept, asValues(values, state), job.options.spacing_m);
  };
  const rows = each.map((one) => {
    const knob = el("button", { type: "button", role: "switch", className: "switch", "aria-label": plain(one.name) });
    knob.addEventListener("click", () => turn(one, knob.getAttribute("aria-checked") !== "true"));
    knob.effect = one;
    return el("div", { role: "listitem" }, knob, el("span", { title: one.words },
      el("b", { textContent: plain(one.name) }), ` ${one.told}`, el("span", { className: "how" }), canBeShown(one, state) ? "" : ": not in the picture"));
  });
  const told = el("output", { className: "note seen" });
  told.effects = each;
  const made = el("details", { className: "switches", open: true, "data-key": "switches" },
    el("summary", { textContent: "See the slide with each effect" }),
    el("div", { role: "list", "aria-label": "effects" }, ...rows), told,
    el("p", { className: "note", textContent: "Each with the strength that was found with it. The diagnosis allows for the size of the cells, the picture does not." }));
  tellSwitches(made, state);
  return made;
}

/** Say of all switches in a part of the page which effects the picture has now. */
export function tellSwitches(part, state) {
  for (const knob of part.querySelectorAll("[role=switch]")) {
    const one = knob.effect;
    knob.setAttribute("aria-checked", String(isOn(one, state)));
    knob.title = !canBeShown(one, state) ? "another section, soil or survey: it is no effect that the picture can switch"
      : isOfCase(one, state) ? "the case has it: undo takes out what was kept" : "";
    knob.disabled = Boolean(knob.title);
    const how = isOfCase(one, state) ? "in the case" : one.how === "named" ? "" : one.how;
    knob.parentElement.querySelector(".how").textContent = how && `, ${how}`;
  }
  const strengths = Object.values(state.changes?.strengths_kpa ?? {});
  for (const told of part.querySelectorAll(".seen")) {
    const now = Object.entries(shownEffects(state)).filter(([, amplitude]) => amplitude > 0 || amplitude < 0).map(([name, amplitude]) => `${plain(name)} ${Number(amplitude.toPrecision(3))}`);
    const with_ = now.length ? `with ${now.join(" and ")}` : "without any effect";
    const strength = strengths.length === 1 ? `, strength ${Number(strengths[0].toPrecision(3))} kPa` : "";
    const named = told.effects.filter(({ how }) => how === "named");
    const lacks = named.some((one) => isOn(one, state)) ? named.filter((one) => !isOn(one, state)).map(({ name }) => plain(name)) : [];
    told.value = `Seen now: ${with_}${strength}${lacks.length ? `, and without ${lacks.join(" and ")}, found together with it` : ""}.`;
  }
}
