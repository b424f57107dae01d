// What is to be mended: at its field, and in a list that leads there.

import { button, el } from "./ui.js";

const TABS = { scene: "section" };
const WORDS = { measurements: "Survey: ", inversion: "Question: ", diagnosis: "Diagnosis: ", blow_counts: "Blow counts: " };
const tabOf = ({ document: part }) => TABS[part] ?? "survey";

export const placeOf = (part, ...field) => [part, ...field].join("/");

/** What is said of a field, such as its faults, without the name of what it belongs to; empty: nothing. */
export function saidAt(lines, place) {
  return lines.filter(({ document: part, field }) => field.length && placeOf(part, ...field) === place)
    .map(({ message }) => message.slice(message.indexOf(": ") + 1).trim()).join("; ");
}

/** Place of a field, what is wrong with it, and what is doubtful. */
export function fieldAt(page, part, ...field) {
  const place = placeOf(part, ...field);
  return { place, wrong: saidAt(page.faults, place), doubt: saidAt(page.doubts, place) };
}

/** All faults, those of a tab first; a click leads to the field, or shows the zone. Without faults: what is checked, and what is doubtful. */
export function faultList(page, tab) {
  const { faults } = page;
  const ordered = [...faults.filter((one) => tabOf(one) === tab), ...faults.filter((one) => tabOf(one) !== tab)];
  return [el("h2", { textContent: faults.length ? "To mend" : "Checked" }),
    faults.length ? el("ul", { className: "faults" }, ...ordered.map((one) =>
      el("li", {}, button((WORDS[one.document] ?? "") + one.message, () => lead(page, one), { className: "fault" }))))
      : el("p", { className: "note faults", textContent: page.summary() }),
    ...page.doubts.map((one) => el("p", { className: "note doubt" },
      one.field.length ? button(`Doubtful: ${one.message}`, () => lead(page, one), { className: "fault" }) : `Doubtful: ${one.message}`))];
}

function lead(page, fault) {
  if (tabOf(fault) !== document.body.dataset.mode) page.setMode(tabOf(fault));
  const zone = page.documents.now.scene.zones.findIndex(({ name }) => fault.zones?.includes(name));
  if (zone >= 0) page.editor.choose({ zone });
  const field = document.querySelector(`[data-field="${CSS.escape(placeOf(fault.document, ...fault.field))}"]`);
  for (let fold = field?.closest("details"); fold; fold = fold.parentElement.closest("details")) fold.open = true;
  field?.focus();
}
