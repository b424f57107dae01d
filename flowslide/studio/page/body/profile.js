// Draws the section of a body along a line: ground, soil before and now, what was surveyed, still water.

import { css, onSize } from "../ui.js";
import { niceStep } from "../view.js";

const ROOM = { left: 46, right: 14, top: 22, foot: 30 };
const SAMPLES = 600;
const RISES = [1, 2, 4];

export class Profile {
  /** `on` has over(text or ""). */
  constructor(canvas, on) {
    Object.assign(this, { canvas, on, film: null, line: [] });
    onSize(canvas, () => this.draw());
    canvas.addEventListener("pointermove", (event) => this.over(event));
    canvas.addEventListener("pointerleave", () => this.on.over(""));
  }

  show(film, line) {
    Object.assign(this, { film, line });
    this.draw();
  }

  draw() {
    if (this.pending) return;
    this.pending = true;
    requestAnimationFrame(() => { this.pending = false; this.paint(); });
  }

  /** Distances and elevations [m] along the line. */
  get rows() {
    const { film, line: [[ax, ay], [bx, by]] } = this;
    const length = Math.hypot(bx - ax, by - ay);
    const thickness = film.now("thickness");
    return Array.from({ length: SAMPLES + 1 }, (_, k) => {
      const [x, y] = [ax + ((bx - ax) * k) / SAMPLES, ay + ((by - ay) * k) / SAMPLES];
      const ground = film.at(film.base, x, y);
      return {
        way: (length * k) / SAMPLES, x, y, ground, before: ground + film.at(film.before, x, y), now: ground + film.at(thickness, x, y),
        measured: film.measured ? film.at(film.measured, x, y) : NaN, water: film.water ? film.at(film.water, x, y) : NaN,
      };
    });
  }

  /** The section as numbers, for a file. */
  get csv() {
    const names = ["way_m", "x_m", "y_m", "ground_m", "surface_before_m", "surface_m", ...(this.film.measured ? ["surveyed_m"] : [])];
    const lines = this.rows.map((row) => [row.way, row.x, row.y, row.ground, row.before, row.now, ...(this.film.measured ? [row.measured] : [])].map((value) => value.toFixed(3)).join(","));
    return [names.join(","), ...lines, ""].join("\n");
  }

  paint() {
    const { canvas, film } = this;
    const { clientWidth: width, clientHeight: height } = canvas;
    if (!film || !width || this.line.length !== 2) return;
    const ratio = devicePixelRatio || 1;
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    const rows = this.rows;
    const length = Math.max(rows.at(-1).way, 1e-3);
    const heights = rows.flatMap(({ ground, before, now, measured, water }) => [ground, before, now, measured, water].filter((z) => !Number.isNaN(z)));
    const [low, high] = [Math.min(...heights), Math.max(...heights)];
    const room = 0.06 * Math.max(high - low, 1);
    const [wide, tall] = [width - ROOM.left - ROOM.right, height - ROOM.top - ROOM.foot];
    // As tall as the window allows, at most four times the scale of lengths.
    const fits = tall / (high - low + 2 * room);
    this.across = Math.min(wide / length, fits);
    this.rise = RISES.findLast((rise) => rise * this.across <= fits) ?? 1;
    const up = this.across * this.rise;
    this.place = (way, z) => [ROOM.left + way * this.across, height - ROOM.foot - (z - low + room) * up];
    this.paintSoil(pen, rows, low - room);
    this.paintAxes(pen, { low: low - room, high, length, width, height, up });
    canvas.setAttribute("aria-label", `Section from A to B, ${length.toFixed(0)} m: surface from ${rows[0].now.toFixed(1)} to ${rows.at(-1).now.toFixed(1)} m, heights ${this.rise} times lengths`);
  }

  trace(pen, rows, key) {
    pen.beginPath();
    let isOn = false;
    for (const row of rows) {
      if (Number.isNaN(row[key])) { isOn = false; continue; }
      const [x, y] = this.place(row.way, row[key]);
      if (isOn) pen.lineTo(x, y); else pen.moveTo(x, y);
      isOn = true;
    }
  }

  paintSoil(pen, rows, foot) {
    const between = (upper, lower, colour) => {
      this.trace(pen, rows, upper);
      for (const row of [...rows].reverse()) pen.lineTo(...this.place(row.way, lower(row)));
      pen.closePath();
      pen.fillStyle = colour;
      pen.fill();
    };
    between("ground", () => foot, css("--ground"));
    pen.globalAlpha = 0.32;
    between("now", (row) => row.ground, css("--accent"));
    pen.globalAlpha = 1;
    const drawn = [["before", css("--ink"), 1.2, [5, 4]], ["now", css("--accent"), 2, []], ["measured", css("--survey"), 1.6, []], ["water", css("--water-line"), 1.2, [10, 4, 2, 4]]];
    for (const [key, colour, lineWidth, dashes] of drawn) {
      this.trace(pen, rows, key);
      Object.assign(pen, { strokeStyle: colour, lineWidth });
      pen.setLineDash(dashes);
      pen.stroke();
    }
    pen.setLineDash([]);
  }

  paintAxes(pen, { low, high, length, width, height, up }) {
    Object.assign(pen, { font: "11px system-ui, sans-serif", fillStyle: css("--soft"), strokeStyle: css("--soft"), lineWidth: 1, textAlign: "center" });
    const foot = height - ROOM.foot;
    pen.beginPath();
    const step = niceStep(60 / this.across);
    for (let way = 0; way <= length + 1e-9; way += step) {
      const [x] = this.place(way, low);
      pen.moveTo(x, foot);
      pen.lineTo(x, foot + 4);
      if (x < width - 70) pen.fillText(`${+way.toFixed(6)}`, x, foot + 15);
    }
    pen.textAlign = "right";
    const rise = niceStep(24 / up);
    for (let z = Math.ceil(low / rise) * rise; z <= high; z += rise) {
      const [x, y] = this.place(0, z);
      pen.moveTo(x, y);
      pen.lineTo(x - 4, y);
      if (y > 22) pen.fillText(`${+z.toFixed(6)}`, x - 7, y + 4);
    }
    pen.stroke();
    pen.fillText("from A, m", width - 4, foot + 15);
    pen.fillText("z, m", ROOM.left - 7, 12);
    Object.assign(pen, { textAlign: "left", font: "bold 11px system-ui, sans-serif" });
    pen.fillText("A", ROOM.left, 14);
    pen.textAlign = "center";
    pen.fillText("B", this.place(length, low)[0], 14);
    Object.assign(pen, { textAlign: "left", font: "11px system-ui, sans-serif" });
    const scale = Math.abs(this.rise - 1) < 0.01 ? "heights as lengths" : `heights ${this.rise} times lengths`;
    let x = ROOM.left + 18;
    const key = [["dashed: surface before", "--ink"], [this.film.isRun ? "surface now" : "surface before the slide", "--accent"], ...(this.film.measured ? [["surveyed", "--survey"]] : []), ...(this.film.water ? [["dash-dotted: water before the slide", "--water-line"]] : []), [scale, "--soft"]];
    for (const [text, colour] of key) {
      if (this.film.frame === 0 && text === "dashed: surface before") continue;
      pen.fillStyle = css(colour);
      pen.fillText(text, x, 14);
      x += pen.measureText(text).width + 16;
    }
  }

  over(event) {
    if (!this.film || !this.place) return;
    const rows = this.rows;
    const way = (event.clientX - this.canvas.getBoundingClientRect().left - ROOM.left) / this.across;
    const row = rows[Math.round((SAMPLES * way) / rows.at(-1).way)];
    this.on.over(row ? `${row.way.toFixed(0)} m from A (x ${row.x.toFixed(0)}, y ${row.y.toFixed(0)} m): ground ${row.ground.toFixed(1)} m, surface ${row.now.toFixed(1)} m, before ${row.before.toFixed(1)} m${Number.isNaN(row.measured) ? "" : `, surveyed ${row.measured.toFixed(1)} m`}` : "");
  }
}
