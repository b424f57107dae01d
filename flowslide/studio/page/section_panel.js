// The section in tables: zones, materials, base, water, spacing, the picture to draw on; faults and vertices.

import { faultList, fieldAt } from "./faults.js";
import { renameZone } from "./question.js";
import { area, dropUnused, lines, moveVertex, pasteVertices, removeVertex, insertVertex, rounded } from "./section.js";
import { blockOf, numberBox, numbersOf } from "./numbers.js";
import { button, el, field, isRefilling, keyWords, readOnly, refill } from "./ui.js";
import { zoneColours } from "./view.js";
import { poolSide, setPool, tableOfPool, waterWords } from "./water.js";

const FIRST = ["friction_deg", "cohesion_kpa", "strength_ratio", "density"]; // fields of a material that are always shown
const SIDES = { left: "left side alone", right: "right side alone", both: "both sides", drawn: "as drawn" };
const words = (name) => name.replaceAll("_", " ");

/** `page` has documents, editor, faults, materials (forms), derived() (what the server found), underlay and say(words, bad). */
export class SectionPanel {
  constructor(left, right, page) {
    Object.assign(this, { left, right, page, renamed: new Map() });
  }

  get scene() { return this.page.documents.now.scene; }

  at(...keys) { return fieldAt(this.page, "scene", ...keys); }

  edit(what, change) { this.page.documents.edit(what, ({ scene }) => change(scene)); }

  /** A press that leaves the field of a name is on a control that still has the name from before. */
  nameNow(scene, name) {
    let now = name;
    while (!(now in scene.materials) && this.renamed.has(now)) now = this.renamed.get(now);
    return now;
  }

  /** Change a material by the name with which its control was made. */
  editMaterial(what, name, change) {
    this.edit(what, (to) => { const soil = to.materials[this.nameNow(to, name)]; if (soil) change(soil); });
  }

  renameMaterial(scene, old, name) {
    renameMaterial(scene, old, name);
    this.renamed.delete(name);
    this.renamed.set(old, name);
  }

  show() {
    const { scene } = this;
    const children = [
      el("h2", { textContent: "Zones" }), ...this.zones(scene),
      el("h2", { textContent: "Materials" }), ...Object.keys(scene.materials).map((name) => this.material(scene, name)),
      el("h2", { textContent: "Base and water" }), ...this.base(scene), ...this.ends(), ...this.water(scene),
      el("h2", { textContent: "Points" }),
      field({ words: "spacing", value: scene.spacing, unit: "m", holder: "by height", ...this.at("spacing"),
        help: "distance between material points; half of it takes eight times as long; empty: a 25th of the height" },
      (value) => this.edit("spacing", (to) => { to.spacing = value; })),
      el("h2", { textContent: "Notes and sources" }),
      el("textarea", { rows: 3, value: scene.description ?? "", "aria-label": "notes and sources of the section", "data-key": "description",
        on: { change: ({ target }) => this.edit("notes", (to) => { to.description = target.value; }) } }),
      el("h2", { textContent: "Picture to draw on" }), this.page.underlay.panel(),
    ];
    refill(this.left, ...(this.page.documents.shipped ? readOnly(children) : children));
    this.showRight();
  }

  // --- zones and materials ---

  zones(scene) {
    if (!scene.zones.length) {
      return [el("p", { className: "note", textContent: "None yet. Choose the tool Zone (z) and click its vertices, or type them as “x, y” below the sheet." })];
    }
    const colours = zoneColours(scene);
    return scene.zones.map((zone, i) => {
      const row = el("div", { className: "zone" + (this.page.editor.selection.zone === i ? " chosen" : "") },
        swatch(colours[i]),
        el("input", { type: "text", value: zone.name, title: zone.name, "aria-label": `name of zone ${i + 1}`, "data-key": `zone-${i}`,
          on: { change: ({ target }) => this.rename(i, target.value.trim()), focus: () => { if (!isRefilling()) this.choose(i); } } }),
        this.materialOf(scene, zone, i),
        button("✕", () => { this.page.editor.choose({ zone: i }); this.page.editor.remove(); }, { title: `remove ${zone.name}`, className: "small" }));
      row.addEventListener("click", ({ target }) => { if (!/INPUT|SELECT|BUTTON/.test(target.tagName)) this.page.editor.choose({ zone: i }); });
      return row;
    });
  }

  /** Show which zone somebody types in, without a word of what is typed being lost. */
  choose(i) {
    const { editor, view } = this.page;
    if (editor.selection.zone === i) return;
    editor.selection = { zone: i };
    this.left.querySelectorAll(".zone").forEach((row, k) => row.classList.toggle("chosen", k === i));
    this.showRight();
    view.draw();
  }

  rename(i, name) {
    const old = this.scene.zones[i].name;
    if (!name || name === old) { this.show(); return; }
    this.page.documents.edit("zone renamed", (documents) => {
      const { scene } = documents;
      renameZone(documents, i, name);
      // A material of its own goes by the name of its zone.
      if (scene.zones[i].material === old && !(name in scene.materials)) this.renameMaterial(scene, old, name);
    });
  }

  materialOf(scene, zone, i) {
    const choice = el("select", { title: words(zone.material), "aria-label": `material of ${zone.name}`, "data-key": `zone-material-${i}` },
      ...Object.keys(scene.materials).map((name) => new Option(words(name), name, false, name === zone.material)),
      new Option("new material", ""));
    choice.addEventListener("change", () => this.edit("material of a zone", (to) => {
      let name = choice.value && this.nameNow(to, choice.value);
      if (!name) {
        for (let k = 1; !name || name in to.materials; k += 1) name = k === 1 ? to.zones[i].name : `${to.zones[i].name}_${k}`;
        to.materials[name] = {};
      }
      to.zones[i].material = name;
      dropUnused(to);
    }));
    return choice;
  }

  material(scene, name) {
    const soil = scene.materials[name];
    const hasRatio = typeof soil.strength_ratio === "number";
    const hidden = ["liquefied", soil.liquefied ? "friction_deg" : "strength_ratio"];
    const fields = this.page.materials.filter(({ key }) => !hidden.includes(key));
    const one = ({ key, kind, default: usual, meaning }) => {
      let [label, unit] = keyWords(key);
      if (key === "cohesion_kpa" && soil.liquefied) label = hasRatio ? "least S_r" : "S_r, first guess";
      return field({ words: `${label} of ${words(name)}`, shown: label, key: `${name}.${key}`, kind, value: soil[key], unit, help: meaning, holder: usual ?? "",
        ...this.at("materials", name, key) },
        (value) => this.editMaterial(label, name, (now) => { if (value === null) delete now[key]; else now[key] = value; }));
    };
    const first = fields.filter(({ key }) => FIRST.includes(key));
    const rest = fields.filter(({ key }) => !FIRST.includes(key));
    const summary = hasRatio ? `S_r/σ′v0 ${soil.strength_ratio}`
      : soil.liquefied ? `S_r ${soil.cohesion_kpa ?? "?"} kPa`
      : `${soil.friction_deg ?? "?"}°, ${soil.cohesion_kpa ?? "?"} kPa`;
    const missing = soil.cohesion_kpa === undefined || soil.friction_deg === undefined;
    return el("details", { className: "material", "data-key": `material-${name}`, open: missing },
      el("summary", {}, swatch(zoneColours({ ...scene, zones: [{ material: name }] })[0]), ` ${words(name)} `,
        el("span", { className: "note", textContent: summary })),
      field({ words: `name of the material ${words(name)}`, shown: "name", key: `${name}.name`, kind: "text", value: name },
        (value) => { if (value && !(value in this.scene.materials)) this.edit("material renamed", (to) => this.renameMaterial(to, this.nameNow(to, name), value)); else this.show(); }),
      field({ words: `${words(name)} liquefied`, shown: "liquefied", key: `${name}.liquefied`, kind: "switch", value: soil.liquefied,
        help: "its strength is a residual strength S_r: the unknown of a back-analysis" },
      (value) => this.editMaterial("liquefied", name, (now) => {
        if (value) Object.assign(now, { liquefied: true, friction_deg: 0 });
        else { delete now.liquefied; delete now.friction_deg; delete now.strength_ratio; }
      })),
      ...first.map(one),
      el("details", { "data-key": `more-${name}` }, el("summary", { textContent: "stiffness, density under water, source" }), ...rest.map(one)));
  }

  // --- base and water ---

  base(scene) {
    const points = scene.ground?.points;
    const contact = scene.ground?.contact ?? "rough";
    const set = (change) => this.edit("base", (to) => { to.ground = { ...(to.ground ?? {}) }; change(to.ground); });
    const found = [
      el("p", { className: "note", textContent: points ? `The base is a line of ${points.length} points; draw another with the tool Base (b).`
        : "The base will be level, at the lowest vertex; draw another with the tool Base (b)." }),
      field({ words: "contact with the base", kind: "choice", choices: ["rough", "no_slip", "coulomb"], value: contact,
        help: "rough: slip where the soil's own strength is exceeded; no slip: bonded; coulomb: with a coefficient" },
      (value) => set((ground) => { ground.contact = value; if (value !== "coulomb") delete ground.friction_coefficient; })),
    ];
    if (contact === "coulomb") {
      found.push(field({ words: "friction coefficient of the base", value: scene.ground.friction_coefficient, ...this.at("ground", "friction_coefficient") },
        (value) => set((ground) => { ground.friction_coefficient = value; })));
    }
    if (points) {
      found.push(button("Level base", () => set((ground) => { delete ground.points; }), { title: "level, at the lowest vertex" }));
    }
    return found;
  }

  /** What is beyond the ends of a section that holds together. */
  ends() {
    return Object.entries(this.page.derived()?.ends ?? {}).map(([side, end]) =>
      field({ words: `${side} end of the section`, shown: `${side} end`, kind: "choice", choices: ["goes_on", "free"],
        value: end.goes_on ? "goes_on" : "free",
        help: "goes on: ground, held by a smooth wall, along which soil settles; free: soil can run out of it" },
      (value) => this.edit(`${side} end`, (to) => { to.domain[side] = value === "free" ? "free" : "far"; })));
  }

  water(scene) {
    const side = poolSide(scene);
    const upstream = this.page.documents.now.measurements?.upstream ?? "left";
    const level = field({ words: "pool level", value: scene.water_level, unit: "m", holder: "none", ...this.at("water_level"),
      help: "empty: no water; a new pool stands on the upstream side alone" },
    (value) => this.edit("pool level", (to) => setPool(to, value, side ?? (tableOfPool(to, value, upstream) ? upstream : "both"))));
    if (side === null) return [level];
    return [level,
      field({ words: "pool on", kind: "choice", choices: Object.keys(SIDES).filter((one) => one !== "drawn" || side === "drawn"), names: SIDES, value: side,
        help: "on one side the water table falls from the pool to the toe on the other side; draw one that was measured with the tool Water table (w)" },
      (value) => this.setSide(value)),
      el("p", { className: "note", textContent: waterWords(scene) })];
  }

  setSide(side) {
    const { water_level: level } = this.scene;
    if (side !== "both" && !tableOfPool(this.scene, level, side)) {
      this.page.say(`a pool at ${level} m on the ${side} side alone: the section does not hold it back, or has no lower toe`, true);
      this.show();
    } else this.edit("side of the pool", (to) => setPool(to, level, side));
  }

  // --- faults, and the vertices of a line ---

  showRight() {
    const { scene } = this;
    const { selection } = this.page.editor;
    const all = lines(scene);
    const chosen = all.findIndex((line) => (selection.line ?? "zone") === line.kind && (line.kind !== "zone" || line.number === selection.zone));
    const choice = el("select", { "aria-label": "vertices of", "data-key": "vertices-of" }, new Option("choose ...", "-1"),
      ...all.map((line, i) => new Option({ zone: scene.zones[line.number]?.name, ground: "base", water: "water table" }[line.kind], i, false, i === chosen)));
    choice.addEventListener("change", () => {
      const line = all[Number(choice.value)];
      this.page.editor.choose(line ? { zone: line.number, line: line.kind } : {});
    });
    refill(this.right,
      ...faultList(this.page, "section"),
      el("h2", { textContent: "Vertices" }), el("label", { className: "row" }, "of ", choice),
      ...(chosen < 0 ? [] : this.page.documents.shipped ? readOnly([this.vertices(all[chosen])]) : [this.vertices(all[chosen])]));
  }

  /** A block that is pasted at a vertex goes over those from there on; what is left of it is added. */
  paste(event, { kind, number }, i, k) {
    const block = blockOf(event.clipboardData.getData("text"));
    if (!block) return;
    event.preventDefault();
    const { page } = this;
    try {
      const rows = numbersOf(block, k === 0 ? ["m", "m"] : ["m"]);
      const next = structuredClone(this.scene);
      const found = pasteVertices(next, { kind, number }, i, k, rows.map(rounded));
      page.documents.edit("vertices pasted", ({ scene }) => Object.assign(scene, next));
      page.tellTyped(`${rows.length} vertices pasted, ${found}`);
    } catch (error) { page.tellTyped(`not pasted: ${error.message}`, true); }
  }

  vertices({ points, kind, number }) {
    // Asked for when it is used: the cell beside may have moved it since.
    const place = (i) => lines(this.scene).find((line) => line.kind === kind && line.number === number).points[i];
    const told = el("p", { className: "wrong", "aria-live": "polite" });
    const rows = points.map((point, i) => {
      const cell = (k) => {
        const input = el("input", { "aria-label": `${"xy"[k]} of vertex ${i + 1} [m]`, "data-key": `vertex-${i}-${k}` });
        numberBox(input, { key: `${kind}-${number}-${i}-${k}`, unit: "m", value: point[k] }, (value) => {
          const to = [...place(i)];
          if (value === null) { this.showRight(); return; } // a vertex without a place is none
          to[k] = value;
          this.edit("vertex moved", (scene) => moveVertex(scene, place(i), rounded(to)));
        }, (fault) => { input.title = fault; told.textContent = fault && `vertex ${i + 1}, ${"xy"[k]}: ${fault}`; });
        input.addEventListener("paste", (event) => this.paste(event, { kind, number }, i, k));
        if (kind === "zone") {
          const { place: where, wrong } = this.at("zones", number, "polygon", i, k);
          input.dataset.field = where;
          if (wrong) Object.assign(input, { title: wrong, ariaInvalid: "true" });
        }
        input.addEventListener("focus", () => { this.page.editor.selection = { zone: number, line: kind, vertex: place(i) }; this.page.editor.view.draw(); });
        return el("td", {}, input);
      };
      const isLast = kind !== "zone" && i === points.length - 1;
      const add = () => {
        const [one, next] = [place(i), place((i + 1) % points.length)];
        this.edit("vertex added", (scene) => insertVertex(scene, rounded([(one[0] + next[0]) / 2, (one[1] + next[1]) / 2]), 2e-3));
      };
      const remove = () => {
        if (!removeVertex(structuredClone(this.scene), place(i))) this.page.say("a zone has at least three vertices", true);
        else this.edit("vertex removed", (scene) => removeVertex(scene, place(i)));
      };
      // Tab goes from number to number, as in a spreadsheet: the buttons have keys instead.
      const row = el("tr", {}, el("td", { textContent: i + 1 }), cell(0), cell(1), el("td", {},
        button("+", add, { className: "small", title: "a vertex after this one (Insert)", tabIndex: -1, disabled: isLast }),
        button("✕", remove, { className: "small", title: "remove this vertex (Ctrl+Delete)", tabIndex: -1 })));
      row.addEventListener("keydown", (event) => {
        const act = event.key === "Insert" && !isLast ? add : event.key === "Delete" && event.ctrlKey ? remove : null;
        if (!act || this.page.documents.shipped) return;
        event.preventDefault();
        event.stopPropagation();
        event.target.blur(); // what is typed counts
        act();
        const near = this.right.querySelector(`[data-key="vertex-${act === add ? i + 1 : Math.max(i - 1, 0)}-0"]`);
        near?.focus();
        near?.select();
      });
      return row;
    });
    return el("div", {}, told, el("table", { className: "vertices" }, el("thead", {}, el("tr", {}, el("td"), ...["x [m]", "y [m]"].map((text) => el("th", { textContent: text })), el("td"))),
      el("tbody", {}, ...rows), kind === "zone" ? el("caption", { textContent: `${area(points).toFixed(1)} m²` }) : ""));
  }
}

/** Colours are set by script: the page's policy allows no styles in its text. */
function swatch(colour) {
  const found = el("i", { className: "swatch" });
  found.style.background = colour;
  return found;
}

function renameMaterial(scene, old, name) {
  scene.materials = Object.fromEntries(Object.entries(scene.materials).map(([key, soil]) => [key === old ? name : key, soil]));
  for (const zone of scene.zones) if (zone.material === old) zone.material = name;
}
