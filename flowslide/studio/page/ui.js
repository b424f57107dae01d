// Small parts of the page.

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

/** A field with a label; `set` gets its value where it can be one, and null where it is empty. */
export function field({ words, shown = words, key = words, kind = "number", value, unit = "", choices = [], help = "", holder = "" }, set) {
  let input;
  if (kind === "choice") {
    input = el("select", {}, ...(value === undefined ? [new Option("choose ...", "")] : []),
      ...choices.map((one) => new Option(one.replaceAll("_", " "), one, false, one === value)));
    input.addEventListener("change", () => set(input.value || null));
  } else if (kind === "switch") {
    input = el("input", { type: "checkbox", checked: Boolean(value) });
    input.addEventListener("change", () => set(input.checked));
  } else {
    const shown = Array.isArray(value) ? value.join(", ") : value ?? "";
    input = el("input", { type: kind === "number" ? "number" : "text", step: "any", value: shown, placeholder: holder });
    input.addEventListener("change", () => {
      const text = input.value.trim();
      if (text === "") set(null);
      else if (kind === "number") set(Number(text));
      else if (kind === "numbers") set(text.split(/[\s,;]+/).filter(Boolean).map(Number));
      else set(text);
    });
  }
  input.setAttribute("aria-label", unit ? `${words} [${unit}]` : words);
  input.dataset.key = key;
  return el("label", { className: `field ${kind}`, title: help }, el("span", { textContent: shown }),
    el("span", { className: "value" }, input, el("span", { className: "unit", textContent: unit })));
}

/** Unit and words of a key such as youngs_modulus_mpa. */
export function keyWords(key) {
  const units = { _m_per_s: "m/s", _mpa: "MPa", _kpa: "kPa", _deg: "deg", _m: "m", _s: "s" };
  for (const [end, unit] of Object.entries(units)) {
    if (key.endsWith(end)) return [key.slice(0, -end.length).replaceAll("_", " "), unit];
  }
  return [key.replaceAll("_", " "), key.endsWith("density") ? "kg/m3" : ""];
}

/** Fill a panel again; who was typing in it goes on typing, and what was unfolded stays so. */
export function refill(panel, ...children) {
  const active = panel.contains(document.activeElement) ? document.activeElement.dataset.key : undefined;
  const unfolded = new Map([...panel.querySelectorAll("details[data-key]")].map((one) => [one.dataset.key, one.open]));
  panel.replaceChildren(...children.filter((child) => child !== null && child !== undefined));
  for (const one of panel.querySelectorAll("details[data-key]")) one.open = unfolded.get(one.dataset.key) ?? one.open;
  if (active !== undefined) panel.querySelector(`[data-key="${CSS.escape(active)}"]`)?.focus();
}
