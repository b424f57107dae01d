// Small parts of the page.

import { numberBox, typedInto } from "./numbers.js";

/** A colour of the theme. */
export const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

/** An element with properties, attributes (aria-..., data-...) and children. */
export function el(tag, properties = {}, ...children) {
  const found = document.createElement(tag);
  for (const [key, value] of Object.entries(properties)) {
    if (key.includes("-")) found.setAttribute(key, value);
    else if (key === "on") for (const [event, act] of Object.entries(value)) found.addEventListener(event, act);
    else found[key] = value;
  }
  found.append(...children.filter((child) => child !== null && child !== undefined));
  return found;
}

export const button = (words, act, more = {}) => el("button", { type: "button", textContent: words, on: { click: act }, ...more });

/**
 * A field with a label; `set` gets its value where it can be one, and null where it is empty.
 *
 * `place` is that of the field in its document, `wrong` what is wrong with it, `doubt` what is hardly meant.
 */
export function field({ words, shown = words, key = words, place = "", wrong = "", doubt = "", kind = "number", value, unit = "", choices = [], names = {}, help = "", holder = "" }, set) {
  let input;
  const isNumber = kind === "number" || kind === "numbers";
  const label = el("label", { className: `field ${kind}`, title: help }, el("span", { textContent: shown }));
  const tellWrong = (fault) => { label.querySelector(".wrong")?.remove(); if (fault) label.append(el("span", { className: "wrong", textContent: fault })); };
  if (kind === "choice") {
    input = el("select", {}, ...(value === undefined ? [new Option("choose ...", "")] : []),
      ...choices.map((one) => new Option(names[one] ?? one.replaceAll("_", " "), one, false, one === value)));
    input.addEventListener("change", () => set(input.value || null));
  } else if (kind === "switch") {
    input = el("input", { type: "checkbox", checked: Boolean(value) });
    input.addEventListener("change", () => set(input.checked));
  } else {
    input = el("input", { type: "text", value: value ?? "", placeholder: holder });
    if (!isNumber) input.addEventListener("change", () => set(input.value.trim() || null));
  }
  input.setAttribute("aria-label", unit ? `${words} [${unit}]` : words);
  input.dataset.key = key;
  if (place) input.dataset.field = place;
  if (wrong) input.setAttribute("aria-invalid", "true");
  label.append(el("span", { className: "value" }, input, el("span", { className: "unit", textContent: unit })));
  if (wrong) tellWrong(wrong);
  if (doubt) label.append(el("span", { className: "doubt", textContent: doubt }));
  if (isNumber) {
    numberBox(input, { key: place || key, unit, value, list: kind === "numbers" }, set, tellWrong);
    const { words: converted } = typedInto(place || key, value);
    if (converted) label.append(el("span", { className: "converted", textContent: converted }));
  }
  return label;
}

/** Controls that change something do nothing here: what is shown can be read alone. */
export function readOnly(nodes) {
  for (const node of nodes) {
    for (const one of node?.querySelectorAll ? [node, ...node.querySelectorAll("*")] : []) {
      if (/^(INPUT|SELECT|TEXTAREA|BUTTON)$/.test(one.tagName)) one.disabled = true;
    }
  }
  return nodes;
}

/** Unit and words of a key such as youngs_modulus_mpa. */
export function keyWords(key) {
  const units = { _m_per_s: "m/s", _mpa: "MPa", _kpa: "kPa", _deg: "deg", _m: "m", _s: "s" };
  for (const [end, unit] of Object.entries(units)) {
    if (key.endsWith(end)) return [key.slice(0, -end.length).replaceAll("_", " "), unit];
  }
  return [key.replaceAll("_", " "), key.endsWith("density") ? "kg/m³" : ""];
}

const TYPE_AHEAD = 1000; // ms in which browsers take letters for the words of an entry

/** Words of an entry of a list, as they are shown, and as files have them. */
const namesOf = ({ text, value }) => [text, value.replaceAll("_", " ")].map((name) => name.toLowerCase());

/**
 * The entry of a list that typed letters mean; undefined: none does.
 *
 * It begins with them, or else one of its words does: “toe ran” is “How far the toe ran”. One letter that is typed
 * again goes on to the next entry.
 */
function meant(list, letters) {
  const entries = [...list.options].filter(({ value, disabled }) => value && !disabled);
  const again = letters.length > 1 && [...letters].every((one) => one === letters[0]);
  const begins = (wanted) => entries.filter((one) => namesOf(one).some((name) => name.startsWith(wanted)));
  if (again && !begins(letters).length) {
    const all = begins(letters[0]);
    return all[(all.indexOf(list.selectedOptions[0]) + 1) % all.length];
  }
  return begins(letters)[0] ?? entries.find((one) => namesOf(one).some((name) => name.includes(` ${letters}`)));
}

/**
 * Act when something is chosen in a list that does something at once, such as one that adds.
 *
 * Arrow keys in a list that is not unfolded change it at every press in most browsers: Enter then chooses, and who
 * goes on without it, or presses Escape, has chosen nothing: the list shows `rest()` again. Browsers take letters for
 * the first words of an entry alone, which nobody knows by heart: here they are looked for in all of its words.
 */
export function onChosen(list, act, rest = () => "") {
  let stepping = false; // by keys, in the folded list
  let unfolded = false; // by keys: the browser tells of the choice itself
  let lettered = -Infinity; // when a letter was typed: a blank that follows at once is one more
  let letters = "";
  const type = (letter, now) => {
    letters = (now - lettered < TYPE_AHEAD ? letters : "") + letter.toLowerCase();
    lettered = now;
    list.value = meant(list, letters)?.value ?? rest();
    stepping = true;
  };
  list.addEventListener("keydown", (event) => {
    const { key, altKey, ctrlKey, metaKey, timeStamp } = event;
    const isLetter = key.length === 1 && !(altKey || ctrlKey || metaKey) && (key !== " " || timeStamp - lettered < TYPE_AHEAD);
    if (unfolded) unfolded = !["Enter", "Escape", "Tab"].includes(key);
    else if (key === "Enter" && stepping) { event.preventDefault(); stepping = false; lettered = -Infinity; if (list.value !== rest()) act(); }
    else if (key === "Escape") { stepping = false; lettered = -Infinity; list.value = rest(); }
    else if (isLetter) { event.preventDefault(); type(key, timeStamp); }
    else if ([" ", "Enter", "F4"].includes(key) || (altKey && key.startsWith("Arrow"))) { unfolded = true; stepping = false; }
    else if (/^(Arrow|Page|Home|End)/.test(key)) stepping = true;
  });
  list.addEventListener("pointerdown", () => { stepping = unfolded = false; });
  list.addEventListener("change", () => { unfolded = false; if (!stepping) act(); });
  list.addEventListener("blur", () => { if (stepping) list.value = rest(); stepping = unfolded = false; lettered = -Infinity; });
}

/** Act when a canvas has another size, also in pixels of the screen alone: the window has gone to a finer screen. */
export function onSize(canvas, act) {
  new ResizeObserver(act).observe(canvas);
  const watch = () => matchMedia(`(resolution: ${devicePixelRatio}dppx)`).addEventListener("change", () => { watch(); act(); }, { once: true });
  watch();
}

// --- panels that are filled again: never under the hand of somebody who types or presses ---

const waiting = new Map(); // panel -> what it is to hold as soon as nobody is busy in it
let typing = null; // field whose value nobody has taken yet
let leaving = false; // a field was changed, and the focus is about to move on
let pressed = null; // element on which a button of the mouse is down
let left = -Infinity; // when a field was left
let refilling = false; // the focus moves by itself

addEventListener("input", ({ target }) => { typing = target; }, true);
addEventListener("change", () => { typing = null; leaving = true; setTimeout(() => { leaving = false; fillWaiting(); }); }, true);
addEventListener("focusout", ({ target }) => {
  if (target.matches?.("input, select, textarea")) left = performance.now();
  typing = null;
  setTimeout(fillWaiting);
}, true);
addEventListener("pointerdown", ({ target }) => { pressed = target; }, true);
for (const end of ["pointerup", "pointercancel"]) {
  addEventListener(end, () => setTimeout(() => { pressed = null; fillWaiting(); }), true); // after the click
}

// Keys come before timers: what the field before changed is shown before the next one takes a letter.
addEventListener("keydown", () => { if (leaving) { leaving = false; fillWaiting(); } }, true);

/** Something is being typed into a field that nobody has taken yet. */
export const isTyping = (field) => typing === field;

/** A field was left a moment ago: a key is meant for what follows it, and is no short cut. */
export const justTyped = () => performance.now() - left < 1000;

/** The focus goes back into a panel that was filled again: nobody has chosen anything. */
export const isRefilling = () => refilling;

/** Fill a panel again; who is in one of its fields stays there, and what was unfolded stays so. */
export function refill(panel, ...children) {
  waiting.set(panel, children.filter((child) => child !== null && child !== undefined));
  fillWaiting();
}

function fillWaiting() {
  for (const [panel, children] of waiting) {
    if (leaving || panel.contains(typing) || panel.contains(pressed)) continue;
    waiting.delete(panel);
    if (signature([...panel.childNodes]) !== signature(children)) replace(panel, children);
  }
}

/** What is seen of nodes, as text. */
function signature(nodes) {
  return nodes.map((node) => {
    if (typeof node === "string") return node;
    if (node.nodeType !== Node.ELEMENT_NODE) return node.data;
    const attributes = [...node.attributes].filter(({ name }) => name !== "open").map(({ name, value }) => `${name}=${value}`);
    return `<${node.tagName} ${attributes} ${node.value} ${node.checked}>${signature([...node.childNodes])}</>`;
  }).join("\n");
}

const folds = (panel) => [...panel.querySelectorAll("details[data-key]")];
const reachable = (panel) => [...panel.querySelectorAll("input, select, textarea, button, summary")];
/** Those of a panel that look like one of them, such as all that remove a vertex. */
const alike = (panel, one) => reachable(panel).filter((other) => ["tagName", "ariaLabel", "title"].every((key) => other[key] === one[key])
  && (one.tagName !== "BUTTON" || other.textContent === one.textContent));

function replace(panel, children) {
  const active = panel.contains(document.activeElement) ? document.activeElement : null;
  const place = reachable(panel).indexOf(active);
  const turn = active ? alike(panel, active).indexOf(active) : -1;
  // Also an empty one, which the program may fill under the hand of who is about to type.
  const whole = active?.selectionStart === 0 && active.selectionEnd === active.value.length;
  const before = folds(panel).map(({ dataset, open }) => [dataset.key, open]);
  panel.replaceChildren(...children);
  const now = folds(panel);
  now.forEach((one, i) => {
    // A name that was changed is part of its key: as many as before are the same ones.
    const known = before.find(([key]) => key === one.dataset.key) ?? (now.length === before.length ? before[i] : null);
    if (known) one.open = known[1];
  });
  if (!active) return;
  const { key } = active.dataset;
  const same = key === undefined ? null : panel.querySelector(`[data-key="${CSS.escape(key)}"]`);
  const there = reachable(panel)[place];
  // A list above may have grown: the one that looks the same comes before the one at the same place.
  const next = same ?? alike(panel, active)[turn] ?? (there?.tagName === active.tagName ? there : null);
  refilling = true;
  next?.focus();
  refilling = false;
  if (whole) next?.select?.();
}
