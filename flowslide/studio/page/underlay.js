// A picture below the section to digitise from: two clicks with their coordinates set its scale and axes.

import { get, send, upload } from "./api.js";
import { button, el, field } from "./ui.js";

const FILE = "underlay";

/** `page` has view, editor, documents and say(words, bad). */
export class Underlay {
  constructor(page) {
    this.page = page;
    this.image = null;
    this.points = [];
  }

  async open(name) {
    this.image = this.at = null;
    this.points = [];
    this.page.view.under = null;
    const found = await get(`/api/cases/${name}/view`);
    if (found?.underlay) { this.at = found.underlay; await this.load(name); }
  }

  load(name) {
    return new Promise((resolve) => {
      const image = new Image();
      image.onload = () => { this.image = image; this.page.view.under = (pen) => this.paint(pen); this.page.view.draw(); resolve(); };
      image.onerror = () => { this.page.say("the picture cannot be shown", true); resolve(); };
      image.src = `/api/cases/${name}/files/${this.at.file}?${Date.now()}`;
    });
  }

  keep() { return send(`/api/cases/${this.page.documents.name}/view`, { underlay: this.at }, "PUT"); }

  async choose(file) {
    const suffix = { "image/png": "png", "image/jpeg": "jpg" }[file.type];
    if (!suffix) { this.page.say("a picture to draw on is a PNG or a JPEG", true); return; }
    const { name } = this.page.documents;
    try {
      await upload(`/api/cases/${name}/files/${FILE}.${suffix}`, file, "PUT");
      this.at = { file: `${FILE}.${suffix}`, x: 0, y: 0, sx: 1, sy: 1, opacity: 0.6 };
      await this.load(name);
      if (!this.image) return;
      // First as wide as the sheet.
      const { view } = this.page;
      const [left, bottom, scale] = view.box;
      const size = (0.8 * view.canvas.clientWidth * scale) / this.image.naturalWidth;
      Object.assign(this.at, { sx: size, sy: size, x: left + 0.1 * view.canvas.clientWidth * scale,
        y: bottom + 0.9 * view.canvas.clientHeight * view.up });
      this.points = [];
      await this.keep();
      this.page.refresh();
    } catch (error) { this.page.say(error.message, true); }
  }

  async remove() {
    this.image = this.at = null;
    this.page.view.under = null;
    await this.keep();
    this.page.refresh();
  }

  paint(pen) {
    const { x, y, sx, sy, opacity } = this.at;
    const [left, top] = this.page.view.pixel([x, y]);
    const { box: [, , scale], up } = this.page.view;
    pen.globalAlpha = opacity;
    pen.drawImage(this.image, left, top, (this.image.naturalWidth * sx) / scale, (this.image.naturalHeight * sy) / up);
    pen.globalAlpha = 1;
  }

  /** Pixel of the picture at a place of the sheet. */
  pixelAt([x, y]) {
    return [(x - this.at.x) / this.at.sx, (this.at.y - y) / this.at.sy];
  }

  /** Scale and axes from two places whose coordinates are known; heights may be exaggerated. */
  place() {
    const [a, b] = this.points;
    const [du, dv] = [b.pixel[0] - a.pixel[0], b.pixel[1] - a.pixel[1]];
    const [dx, dy] = [b.x - a.x, b.y - a.y];
    const wide = Math.abs(du) > 5 && dx !== 0;
    const high = Math.abs(dv) > 5 && dy !== 0;
    if (!wide && !high) { this.page.say("the two places must be apart, on the picture and in metres", true); return; }
    const sx = wide ? dx / du : Math.abs(dy / dv);
    const sy = high ? -dy / dv : Math.abs(dx / du);
    if (!(sx > 0 && sy > 0)) { this.page.say("x grows to the right and y upwards: the two places are mixed up", true); return; }
    Object.assign(this.at, { sx, sy, x: a.x - sx * a.pixel[0], y: a.y + sy * a.pixel[1] });
    this.page.refresh();
    this.keep().then(() => this.page.say("the picture has its scale"), (error) => this.page.say(error.message, true));
  }

  panel() {
    const file = el("input", { type: "file", accept: "image/png,image/jpeg", "aria-label": "picture to draw on" });
    file.addEventListener("change", () => { if (file.files[0]) this.choose(file.files[0]); });
    if (!this.image) return el("div", {}, el("p", { className: "note", textContent: "A scan of the section; two clicks give it its scale." }), file);
    const ready = this.points.length === 2 && this.points.every(({ x, y }) => Number.isFinite(x) && Number.isFinite(y));
    const rows = this.points.map((point, i) => el("div", { className: "row" },
      ...["x", "y"].map((key) => field({ words: `${key} of place ${i + 1}`, key: `place-${i}-${key}`, value: point[key], unit: "m" },
        (value) => { point[key] = value; this.page.refresh(); }))));
    return el("div", {},
      el("p", { className: "note", textContent: this.points.length < 2 ? "Click two places of the picture whose coordinates you know." : "Coordinates of the two places:" }),
      ...rows,
      this.points.length < 2 ? button(`Click place ${this.points.length + 1}`, () => this.page.editor.askPlace((_, exact) => {
        this.points.push({ pixel: this.pixelAt(exact) });
        this.page.refresh();
      })) : null,
      ready ? button("Set the scale", () => this.place(), { className: "main" }) : null,
      this.points.length ? button("Other places", () => { this.points = []; this.page.refresh(); }) : null,
      el("label", { className: "field" }, "strength of the picture", el("input", { type: "range", min: 0.1, max: 1, step: 0.05, value: this.at.opacity,
        "aria-label": "strength of the picture", on: { input: ({ target }) => { this.at.opacity = Number(target.value); this.page.view.draw(); }, change: () => this.keep() } })),
      button("Remove the picture", () => this.remove()));
  }
}
