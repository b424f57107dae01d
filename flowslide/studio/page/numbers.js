// Numbers as engineers write them: with a decimal comma, in another unit, or as a block from a spreadsheet.

const SPELLINGS = { "'": "ft", foot: "ft", feet: "ft", '"': "in", inch: "in", "°": "deg", degrees: "deg" };
const NUMBER = /^([-+]?)(\d[\d.,]*|[.,]\d+)(?:e([-+]?\d+))?/i;

let units = {}; // unit of a field -> other units -> how many of the field's one of them is

/** `known` are those of flowslide/studio/units.py. */
export function knowUnits(known) { units = known; }

const plain = (unit) => {
  const short = unit.trim().replace("²", "2").replace("³", "3").replace(/[\s^.]/g, "");
  return SPELLINGS[short.toLowerCase()] ?? short;
};

/** How many of `unit` one of `other` is; null: it is no unit of that kind. */
function factor(other, unit) {
  const known = Object.entries({ ...units[unit], [unit]: 1 });
  const found = known.find(([name]) => plain(name).toLowerCase() === plain(other).toLowerCase());
  return found ? found[1] : null;
}

/** What the commas of some numbers are: "decimal", "thousands", "unclear" or, where there is none, "". */
function commas(texts) {
  const found = texts.map((text) => NUMBER.exec(text.trim())?.[2] ?? "").filter((digits) => digits.includes(","));
  if (!found.length) return "";
  const grouped = (digits) => /^[1-9]\d{0,2}(,\d{3})+(\.\d*)?$/.test(digits);
  if (!found.every(grouped)) return "decimal";
  return found.some((digits) => /,.*[,.]/.test(digits)) ? "thousands" : "unclear";
}

/**
 * A text as a number in `unit`: { value, words }, where `words` tell what was converted.
 *
 * Throws what cannot be understood without doubt. `meant` is what commas are.
 */
export function numberOf(text, unit = "", meant = commas([text])) {
  const written = text.trim().replace("−", "-");
  const [whole, sign, digits, power = "0"] = NUMBER.exec(written) ?? [];
  if (digits === undefined) throw new Error(written ? `“${written}” is no number` : "a number is missing");
  if (digits.includes(",") && meant === "unclear") {
    throw new Error(`“${whole}” may be ${digits.replaceAll(",", "")} or ${digits.replace(",", ".")}: write it without a comma`);
  }
  const pointed = meant === "decimal" ? digits.replace(/\.(?=.*,)/g, "").replace(",", ".") : digits.replaceAll(",", "");
  const number = Number(`${sign}${pointed}e${power}`);
  if (!Number.isFinite(number)) throw new Error(`“${whole}” is no number`);
  const other = written.slice(whole.length).trim();
  if (!other) return { value: number, words: "" };
  const scale = factor(other, unit);
  if (scale === null) {
    const known = Object.keys(units[unit] ?? {}).filter((name) => name !== unit);
    throw new Error(`“${other}” is not understood here: ${unit ? `it is in ${[unit, ...known].join(", ")}` : "it has no unit"}`);
  }
  const value = scale === 1 ? number : Number((number * scale).toPrecision(6));
  return { value, words: scale === 1 ? "" : `${written} = ${value} ${unit}` };
}

/** A text as numbers in `unit`, one after another: { value, words } as of `numberOf`. */
function listOf(text, unit) {
  const cells = cellsOf(text).filter(Boolean);
  const found = cells.map((cell) => numberOf(cell, unit, commas(cells)));
  return { value: found.map(({ value }) => value), words: found.map(({ words }) => words).filter(Boolean).join(", ") };
}

/** Cells of a text with several numbers, such as a block from a spreadsheet; null: it is none. `split` reads a row without tabs. */
export function blockOf(text, split = cellsOf) {
  const rows = text.replaceAll("\r", "").split("\n").filter((row) => row.trim());
  if (rows.length < 2 && !/[\t;]/.test(text.trim())) return null;
  return rows.map(/[\t;]/.test(text) ? cellsOf : split);
}

/** Where tabs or semicolons separate, or blanks between numbers with commas, a comma is part of its number. */
export function cellsOf(row) {
  if (/[\t;]/.test(row)) return row.replace(/[\t; ]+$/, "").split(/[\t;]/).map((cell) => cell.trim());
  const blanks = row.trim().split(/\s+/);
  // "12,5 3,2": a comma that separates would have no digit on one of its sides, or stand alone.
  if (blanks.length === 2 && blanks.every((cell) => /^[-+]?\d+,\d+$/.test(cell))) return blanks;
  return row.trim().split(row.includes(",") ? /\s*,\s*|(?<=\d)\s+(?=[-+.\d])/ : /\s+(?=[-+.\d])/);
}

const startsAsNumber = (cell) => NUMBER.test(cell.replace("−", "-"));

/** Rows of a block below its titles, and the unit that the titles give each column, "" where they give none. */
export function titled(rows) {
  const first = Math.max(rows.findIndex((row) => row.some(startsAsNumber)), 0);
  const titles = rows.slice(0, first);
  const wide = Math.max(0, ...rows.map((row) => row.length));
  const given = Array.from({ length: wide }, (_, k) => titles.map((row) => unitIn(row[k] ?? "")).find(Boolean) ?? "");
  return { titles, rows: rows.slice(first), given };
}

/** The unit of a title such as "x [ft]", "y (m)", "x_m", or "ft" alone. */
function unitIn(title) {
  const [, inside] = /[[(]([^\])]+)[\])]\s*$/.exec(title) ?? /_([a-z]+)$/i.exec(title) ?? [];
  if (inside) return inside;
  const known = Object.values(units).flatMap((one) => Object.keys(one));
  return known.map(plain).includes(plain(title)) ? title : "";
}

/** Titles of the two columns of a place. */
const TITLES = [/^(x|station|chainage|distance|offset)\b|^x_/i, /^(y|z|elevation|elev|level|height)\b|^[yz]_/i];

/** A block of places without its other columns, such as the number of a point, where titles say which are x and y. */
export function placesIn(block) {
  const { titles } = titled(block);
  const named = titles.map((row) => TITLES.map((one) => row.flatMap((title, k) => (one.test(title.trim()) ? [k] : []))))
    .find((found) => found.every(({ length }) => length === 1));
  const columns = named?.flat();
  return columns ? block.map((row) => (row.length > 2 ? columns.map((k) => row[k] ?? "") : row)) : block;
}

/**
 * Numbers of a block in the units of its columns, row by row. Throws what cannot be understood.
 *
 * `wanted` are the units; a block that has more columns, or rows of different length, is refused.
 */
export function numbersOf(whole, wanted) {
  const block = wanted.length === 2 ? placesIn(whole) : whole;
  const { rows, given } = titled(block);
  const meant = commas(rows.flat());
  return rows.map((row, i) => {
    if (row.length !== rows[0].length) throw new Error(`row ${i + 1} (${row.join(" | ")}) has ${row.length} ${row.length === 1 ? "number" : "numbers"}, the first one ${rows[0].length}`);
    if (row.length > wanted.length) throw new Error(`${row.length} columns, where ${wanted.length} fit`);
    return row.map((cell, k) => {
      const bare = given[k] && !/[^\d\s.,e+−-]/i.test(cell); // the title has the unit
      return numberOf(bare ? `${cell} ${given[k]}` : cell, wanted[k], meant).value;
    });
  });
}

// --- a box for a number ---

const boxes = new WeakMap(); // box -> { unit, set }
const typed = new Map(); // key of a box -> what was typed into it that its number alone does not show
let tell = () => {};
let together = (words, act) => act();

/** `say(words, bad)` tells of a conversion; `all(words, act)` makes one edit of what `act` does. */
export function setUp(say, all) { tell = say; together = all; }

/** Another case is open: what was typed into the fields of the last one is no more. */
export function forget() { typed.clear(); }

const shownAs = (value) => (Array.isArray(value) ? value.join(", ") : String(value ?? ""));

/** What was typed into a box with this key while it had this value: { text, fault } or { words }. */
export function typedInto(key, value) {
  const one = typed.get(key);
  return one?.value === shownAs(value) ? one : {};
}

/**
 * Make a text box one for a number in `unit`, or for a `list` of them: arrows step it, Escape takes back what is typed.
 *
 * `set(value)` gets the number, null where the box is empty. What is not understood stays there, with `wrong(fault)` saying so.
 */
export function numberBox(box, { key, unit = "", value, step, list = false }, set, wrong) {
  const { text, fault, words } = typedInto(key, value);
  Object.assign(box, { type: "text", inputMode: "decimal", autocomplete: "off", value: text ?? shownAs(value) });
  box.dataset.number = unit;
  if (words) box.title = words;
  const refuse = (message) => {
    typed.set(key, { value: shownAs(value), text: box.value, fault: message });
    box.setAttribute("aria-invalid", "true");
    wrong(message);
  };
  const take = (found) => {
    box.removeAttribute("aria-invalid");
    if (found?.words) typed.set(key, { value: shownAs(found.value), words: found.words }); else typed.delete(key);
    set(found?.value ?? null);
    if (found?.words) tell(found.words);
  };
  boxes.set(box, { unit, take });
  box.addEventListener("change", () => {
    if (box.value.trim() === "") { take(null); return; }
    let found;
    try { found = list ? listOf(box.value, unit) : numberOf(box.value, unit); } catch (error) { refuse(error.message); tell(error.message, true); return; }
    take(found);
  });
  box.addEventListener("keydown", (event) => {
    if (event.key === "Enter" && !box.closest(".slider, form")) { event.preventDefault(); moveOn(box, event.shiftKey ? -1 : 1); return; }
    if (event.key === "Escape") {
      box.value = shownAs(value);
      box.removeAttribute("aria-invalid");
      if (typed.get(key)?.fault) { typed.delete(key); wrong(""); }
      return;
    }
    const way = { ArrowUp: 1, ArrowDown: -1 }[event.key];
    if (!way || list || event.ctrlKey || event.metaKey) return;
    let now;
    try { now = box.value.trim() === "" ? 0 : numberOf(box.value, unit).value; } catch { return; }
    event.preventDefault();
    const by = (event.shiftKey ? 10 : event.altKey ? 0.1 : 1) * (step ?? stepOf(now));
    box.value = Number((now + way * by).toPrecision(12));
    take({ value: Number(box.value) });
  });
  if (fault) { box.setAttribute("aria-invalid", "true"); wrong(fault); }
  return box;
}

/** To the box below in a table, else to the next one, as Enter does in a spreadsheet. */
function moveOn(box, way) {
  const row = box.closest("tr");
  const column = row && [...row.querySelectorAll("[data-number]")].indexOf(box);
  const all = row ? [...row.parentElement.rows].map((one) => one.querySelectorAll("[data-number]")[column])
    : [...box.closest("section").querySelectorAll("[data-number]")].filter((one) => !one.disabled && one.checkVisibility());
  const next = all[all.indexOf(box) + way] ?? box;
  box.blur(); // what is typed counts
  next.focus();
  next.select();
}

const stepOf = (value) => (Math.abs(value) < 1 ? 0.01 : Math.abs(value) < 10 ? 0.1 : 1);

/** A block that is pasted into a box fills those after it, in one edit; all of it, or nothing. */
export function pasteInto(event) {
  const rows = boxes.has(event.target) && !event.defaultPrevented ? blockOf(event.clipboardData.getData("text"), (row) => [row]) : null; // a comma in a column is a decimal sign
  if (!rows) return;
  event.preventDefault();
  const around = event.target.closest("details, #sliders, form, section");
  const all = [...around.querySelectorAll("[data-number]")].filter((box) => !box.disabled && box.checkVisibility());
  const next = all.slice(all.indexOf(event.target));
  try {
    const { rows: below, given } = titled(rows);
    const across = below.length === 1;
    const wide = Math.max(...below.map((row) => row.length));
    if (!across && wide > 1) throw new Error(`${below.length} rows of ${wide} numbers, where one column or one row fits`);
    const count = below.flat().length;
    if (count > next.length) throw new Error(`${count} numbers, where ${next.length} fit from here on`);
    const taken = next.slice(0, count).map((box) => boxes.get(box));
    const meant = commas(below.flat());
    const numbers = below.flat().map((cell, i) => {
      const unit = given[across ? i : 0];
      return numberOf(unit && !/[^\d\s.,e+−-]/i.test(cell) ? `${cell} ${unit}` : cell, taken[i].unit, meant);
    });
    together(`${count} numbers pasted`, () => numbers.forEach((number, i) => taken[i].take(number)));
    tell(`${count} numbers pasted`);
  } catch (error) { tell(`not pasted: ${error.message}`, true); }
}
