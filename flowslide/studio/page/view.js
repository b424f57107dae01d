// Draws the section before the slide and the points of a deposit, with pan and zoom; heights may be exaggerated.

import { hatchOf, paintHatch } from "./hatch.js";
import { bounds, lowest, roomOf } from "./section.js";
import { css, onSize } from "./ui.js";
import { paintWater, paintWaterTable } from "./water_view.js";

const COLOURS = ["#4e79a7", "#d9a441", "#76a06b", "#b6676b", "#8b74a8", "#5fa3a8", "#a98467", "#c17fb0",
  "#6f8f3f", "#7c8794", "#c9785a", "#487d74", "#93793f", "#6977b8", "#a85a83", "#4f9a5e"];
const LIQUEFIED = "#c8553d";
const AXIS = 32; // pixels at the left that have the numbers of the heights
const SCALES = {
  displacement: { words: "displacement", unit: "m" },
  plastic_strain: { words: "plastic shear strain", unit: "" },
  speed: { words: "speed", unit: "m/s" },
};
// Light to dark, one hue after another of even lightness steps; works on both papers.
const RAMP = [[236, 226, 180], [241, 176, 103], [222, 105, 84], [160, 50, 103], [73, 22, 97]];

export function ramp(share) {
  const place = Math.min(Math.max(share, 0), 1) * (RAMP.length - 1);
  const k = Math.min(Math.floor(place), RAMP.length - 2);
  return RAMP[k].map((low, c) => Math.round(low + (place - k) * (RAMP[k + 1][c] - low)));
}

export class View {
  constructor(canvas, legend) {
    this.canvas = canvas;
    this.legend = legend;
    this.scene = null;
    this.deposit = null;
    this.forecast = null; // what comes next, by a learned model
    this.marks = [];
    this.frame = 0; // of the film; also between two of them
    this.colour = "zone";
    this.before = true;
    this.box = null; // [x at the left edge, y at the bottom edge, metres a pixel across]
    this.rise = 1; // pixels a metre upwards, as multiples of those across
    this.wide = this.tall = 0; // pixels, when the box was last right
    this.isFitted = false; // nobody has moved the view since it was fitted
    this.tool = null; // has down(event) and key(event): true where they were for it
    this.under = null; // paints below the section, in pixels
    this.over = null; // and above it
    onSize(canvas, () => this.resized());
    canvas.addEventListener("wheel", (event) => this.zoom(event), { passive: false });
    canvas.addEventListener("pointerdown", (event) => this.drag(event));
    canvas.addEventListener("keydown", (event) => this.key(event));
  }

  show(scene) {
    this.scene = scene;
    this.fit();
    this.draw();
  }

  /** Another state of the same section, such as while a vertex is dragged. */
  preview(scene) {
    this.scene = scene;
    this.draw();
  }

  /** Metres a pixel upwards. */
  get up() { return this.box[2] / this.rise; }

  /** Place [m] of a pointer. */
  at(event) {
    const { left, top } = this.canvas.getBoundingClientRect();
    const [x, y, scale] = this.box;
    // `tall`: as the sheet was painted, which the canvas is not yet where the window has just changed.
    return [x + (event.clientX - left) * scale, y + (top + this.tall - event.clientY) * this.up];
  }

  /** Place in the canvas [pixels] of a place [m]. */
  pixel([x, y]) {
    const [left, bottom, scale] = this.box;
    return [(x - left) / scale, this.tall - (y - bottom) / this.up];
  }

  /** The whole section and its deposit in the window. */
  fit() {
    if (!this.scene || !this.canvas.clientWidth) return;
    const [left, right, low, high] = this.room();
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const scale = Math.max((right - left) / (width - 90), (this.rise * (high - low)) / (height - 70));
    const x = 0.5 * (left + right) - 0.5 * scale * width - 5 * scale;
    this.box = [x, 0.5 * (low + high) - (0.5 * height + 8) * (scale / this.rise), scale];
    [this.wide, this.tall] = [width, height];
    this.isFitted = true;
  }

  /** Ends [m] of what there is to see: the section and its deposit, of a section that is begun a first sheet. */
  room() {
    const found = bounds(this.scene);
    if (!found || !this.scene.domain) {
      const { x_min: left, x_max: right, y_max: high } = roomOf(this.scene);
      return [left, right, lowest(this.scene), high];
    }
    const marked = this.marks.map(({ x }) => x);
    const ends = [Math.min(found.left, ...marked), Math.max(found.right, ...marked), lowest(this.scene), found.high];
    const { positions, header } = this.deposit ?? {};
    for (let i = 2 * (header?.points ?? 0) * Math.floor(this.frame); i < (positions?.length ?? 0); i += 2) {
      ends[0] = Math.min(ends[0], positions[i]);
      ends[1] = Math.max(ends[1], positions[i]);
      ends[3] = Math.max(ends[3], positions[i + 1]);
    }
    return ends;
  }

  /** Nothing that there is to see is beyond the window. */
  get holdsAll() {
    const [left, right, , high] = this.room();
    const [x, y, scale] = this.box;
    return left >= x && right <= x + this.canvas.clientWidth * scale && high <= y + this.canvas.clientHeight * this.up;
  }

  /** Exaggerate heights; the foot of the section stays where it is. */
  stretch(rise) {
    if (rise === this.rise) return;
    if (this.box && this.scene) {
      const foot = bounds(this.scene)?.low ?? 0;
      this.box[1] = foot - ((foot - this.box[1]) * this.rise) / rise;
    }
    this.rise = rise;
    this.draw();
  }

  resized() {
    const ratio = devicePixelRatio || 1;
    this.canvas.width = Math.round(this.canvas.clientWidth * ratio);
    this.canvas.height = Math.round(this.canvas.clientHeight * ratio);
    const { clientWidth: wide, clientHeight: tall } = this.canvas;
    // A note that comes or goes changes the height alone: what somebody looks at stays where it is, from the top.
    if (!this.box || (this.isFitted && wide !== this.wide)) this.fit();
    else this.box[1] -= (tall - this.tall) * this.up;
    [this.wide, this.tall] = [wide, tall];
    this.draw();
  }

  zoom(event) {
    event.preventDefault();
    if (!this.box) return;
    const factor = Math.exp(event.deltaY * 0.0015);
    const { left, top } = this.canvas.getBoundingClientRect();
    this.scaleAt(event.clientX - left, top + this.tall - event.clientY, factor);
  }

  scaleAt(px, py, factor) {
    const [x, y, scale] = this.box;
    this.box = [x + px * scale * (1 - factor), y + py * this.up * (1 - factor), scale * factor];
    this.isFitted = false;
    this.draw();
  }

  drag(event) {
    if (!this.box || this.tool?.down(event)) return;
    const start = [event.clientX, event.clientY, ...this.box];
    this.canvas.setPointerCapture(event.pointerId);
    const move = (now) => {
      this.box = [start[2] - (now.clientX - start[0]) * start[4], start[3] + (now.clientY - start[1]) * this.up, start[4]];
      this.isFitted = false;
      this.draw();
    };
    const end = () => { this.canvas.removeEventListener("pointermove", move); };
    this.canvas.addEventListener("pointermove", move);
    this.canvas.addEventListener("pointerup", end, { once: true });
  }

  key(event) {
    if (!this.box) return;
    if (this.tool?.key(event)) { event.preventDefault(); event.stopPropagation(); return; }
    const way = { ArrowLeft: [-40, 0], ArrowRight: [40, 0], ArrowUp: [0, 40], ArrowDown: [0, -40] }[event.key];
    if (way) {
      this.box[0] += way[0] * this.box[2];
      this.box[1] += way[1] * this.up;
      this.isFitted = false;
      this.draw();
      event.preventDefault();
    }
    if (event.key === "+" || event.key === "-") {
      this.scaleAt(this.canvas.clientWidth / 2, this.canvas.clientHeight / 2, event.key === "+" ? 0.8 : 1.25);
    }
  }

  draw() {
    if (!this.pending) {
      this.pending = true;
      requestAnimationFrame(() => { this.pending = false; this.paint(); });
    }
  }

  paint() {
    const { scene, box, canvas } = this;
    const pen = canvas.getContext("2d");
    pen.setTransform(1, 0, 0, 1, 0, 0);
    pen.clearRect(0, 0, canvas.width, canvas.height);
    if (!scene || !box) return;
    canvas.dataset.box = [...box, this.rise].join(" ");
    this.paintOn(pen, devicePixelRatio || 1);
  }

  /** With a pen whose sheet has `ratio` pixels for one of the page. */
  paintOn(pen, ratio) {
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.under?.(pen);
    paintWater(this, pen);
    if (this.deposit) {
      pen.globalAlpha = this.forecast ? 0.35 : 1; // of the values before
      this.paintPoints(pen, ratio);
      pen.globalAlpha = 1;
    }
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.paintSection(pen);
    this.paintGround(pen);
    this.paintEnds(pen);
    paintWaterTable(this, pen);
    this.paintAxes(pen);
    if (this.forecast) this.paintForecast(pen);
    this.paintMarks(pen);
    this.over?.(pen);
  }

  /** A line through places [m], to be filled or stroked. */
  path(pen, points) {
    pen.beginPath();
    points.forEach((place, i) => { const [x, y] = this.pixel(place); if (i) pen.lineTo(x, y); else pen.moveTo(x, y); });
  }

  /** Points go straight into pixels: thousands of them at the speed of the film. */
  paintPoints(pen, ratio) {
    const { deposit } = this;
    const tall = this.canvas.clientHeight * ratio;
    const [left, bottom, scale] = this.box;
    const k = ratio / scale;
    const up = ratio / this.up;
    const n = deposit.header.points;
    const place = this.placesOf(n);
    const colours = this.coloursOf(n);
    const [wide, high] = [k, up].map((pixels) => Math.max(Math.ceil(deposit.header.spacing_m * pixels * 1.12), 1));
    pen.setTransform(1, 0, 0, 1, 0, 0);
    // One fill style per colour: points are sorted by it once for each frame.
    const groups = new Map();
    for (let i = 0; i < n; i += 1) {
      const colour = colours(i);
      if (!groups.has(colour)) groups.set(colour, []);
      groups.get(colour).push(i);
    }
    for (const [colour, members] of groups) {
      pen.fillStyle = colour;
      for (const i of members) {
        const x = (place(2 * i) - left) * k;
        const y = tall - (place(2 * i + 1) - bottom) * up;
        pen.fillRect(x - wide / 2, y - high / 2, wide, high);
      }
    }
  }

  /** Coordinate number `k` of the points in the frame that is shown; between two frames they move straight. */
  placesOf(n) {
    const { positions } = this.deposit;
    const before = Math.floor(this.frame);
    const [first, share] = [2 * n * before, this.frame - before];
    if (share === 0) return (k) => positions[first + k];
    return (k) => positions[first + k] + share * (positions[first + 2 * n + k] - positions[first + k]);
  }

  coloursOf(n) {
    const { deposit } = this;
    if (this.colour === "zone") {
      const palette = zoneColours(this.scene);
      return (i) => palette[deposit.zone[i]];
    }
    const values = this.values(n);
    const top = this.top();
    return (i) => `rgb(${ramp(Math.round((24 * values(i)) / top) / 24).join(" ")})`;
  }

  values(n) {
    const { deposit } = this;
    const frame = Math.floor(this.frame);
    if (this.colour === "plastic_strain") return (i) => deposit.plastic_strain[i];
    if (this.colour === "speed") return (i) => deposit.speed[frame * n + i];
    const place = this.placesOf(n);
    return (i) => Math.hypot(place(2 * i) - deposit.initial[2 * i], place(2 * i + 1) - deposit.initial[2 * i + 1]);
  }

  /** Upper end of the scale: that of the whole film, so that colours keep their meaning. */
  top() {
    const { deposit } = this;
    deposit.tops ??= {};
    if (!(this.colour in deposit.tops)) {
      const n = deposit.header.points;
      const frames = this.colour === "plastic_strain" ? 1 : deposit.header.times.length;
      const kept = this.frame;
      const all = [];
      for (let t = 0; t < frames; t += 1) {
        this.frame = t;
        const value = this.values(n);
        for (let i = 0; i < n; i += 1) all.push(value(i));
      }
      this.frame = kept;
      all.sort((a, b) => a - b);
      deposit.tops[this.colour] = Math.max(all[Math.floor(0.98 * (all.length - 1))], 1e-6);
    }
    return deposit.tops[this.colour];
  }

  paintSection(pen) {
    const palette = zoneColours(this.scene);
    this.scene.zones.forEach(({ polygon }, number) => {
      if (!this.deposit) {
        this.path(pen, polygon);
        pen.closePath();
        pen.fillStyle = palette[number];
        pen.globalAlpha = this.under ? 0.45 : 1;
        pen.fill();
        this.paintHatch(pen, number);
      }
      if (this.before || !this.deposit) {
        this.path(pen, polygon);
        pen.closePath();
        pen.strokeStyle = css("--ink");
        pen.globalAlpha = this.deposit ? 0.45 : 0.7;
        pen.lineWidth = 1;
        pen.stroke();
      }
      pen.globalAlpha = 1;
    });
  }

  paintHatch(pen, number) {
    const { polygon, material } = this.scene.zones[number];
    const kind = hatchOf(material, materialNumbers(this.scene).get(material));
    const { clientWidth: width, clientHeight: height } = this.canvas;
    pen.strokeStyle = pen.fillStyle = css("--hatch");
    pen.lineWidth = 0.8;
    paintHatch(pen, kind, polygon.map((place) => this.pixel(place)), this.pixel([0, 0]), { width, height });
  }

  /** The surface that a learned model expects, with the band that holds nine of ten slides, and its toes. */
  paintForecast(pen) {
    const { x, low, middle, high, header } = this.forecast;
    const line = (heights) => Array.from(x, (at, i) => [at, heights[i]]);
    pen.strokeStyle = pen.fillStyle = css("--accent");
    pen.globalAlpha = 0.25;
    this.path(pen, [...line(high), ...line(low).reverse()]);
    pen.fill();
    pen.globalAlpha = 1;
    pen.lineWidth = 1.8;
    this.path(pen, line(middle));
    pen.stroke();
    const foot = bounds(this.scene).low;
    header.toes.forEach((toe, k) => {
      const [[left, y], [right]] = [-1, 1].map((way) => this.pixel([toe + way * header.toe_interval[k], foot]));
      pen.fillRect(left, y + 4, Math.max(right - left, 2), 3);
    });
  }

  /** A hatch where the ground goes on beyond the end of the section. */
  paintEnds(pen) {
    for (const [side, { goes_on: goesOn, x_m: x, low_m: low, top_m: top }] of Object.entries(this.ends ?? {})) {
      if (!goesOn) continue;
      const out = side === "left" ? -14 : 14;
      const [[at, foot], [, head]] = [this.pixel([x, low]), this.pixel([x, top])];
      pen.beginPath();
      pen.moveTo(at, foot);
      pen.lineTo(at, head);
      for (let y = foot; y > head; y -= 9) { pen.moveTo(at, y); pen.lineTo(at + out, Math.max(y - 14, head)); }
      pen.strokeStyle = css("--ground");
      pen.lineWidth = 1.2;
      pen.stroke();
    }
  }

  paintGround(pen) {
    const points = this.scene.ground?.points;
    if (!points) return;
    this.path(pen, points);
    pen.strokeStyle = css("--ground");
    pen.lineWidth = 2.5;
    pen.stroke();
  }

  paintAxes(pen) {
    const [left, bottom, scale] = this.box;
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const step = niceStep(90 * scale);
    pen.font = "11px system-ui, sans-serif";
    pen.fillStyle = css("--soft");
    pen.strokeStyle = css("--line");
    pen.lineWidth = 1;
    pen.textAlign = "center";
    for (let x = Math.ceil(left / step) * step; x < left + width * scale; x += step) {
      const px = (x - left) / scale;
      pen.beginPath(); pen.moveTo(px, height - 20); pen.lineTo(px, height - 15); pen.stroke();
      if (px > 36) pen.fillText(`${round(x)}`, px, height - 4);
    }
    pen.textAlign = "left";
    const rise = niceStep(60 * this.up);
    const first = Math.max(bottom + 30 * this.up, lowest(this.scene));
    for (let y = Math.ceil(first / rise) * rise; y < bottom + height * this.up; y += rise) {
      const py = height - (y - bottom) / this.up;
      if (py < 8) break; // half a number would be seen
      pen.beginPath(); pen.moveTo(0, py); pen.lineTo(5, py); pen.stroke();
      pen.fillText(`${round(y)}`, 8, py + 4);
    }
    pen.fillText("m", 8, height - 4);
  }

  paintMarks(pen) {
    const [left, , scale] = this.box;
    const { clientHeight: height } = this.canvas;
    const rows = []; // what stands in each row of words [pixels]
    for (const { x, words, colour, low } of this.marks) {
      const px = (x - left) / scale;
      pen.strokeStyle = css(colour);
      pen.fillStyle = css(colour);
      pen.setLineDash(low ? [2, 3] : [6, 4]);
      pen.beginPath(); pen.moveTo(px, 34); pen.lineTo(px, height - 24); pen.stroke();
      pen.setLineDash([]);
      pen.textAlign = "center";
      const half = 0.5 * pen.measureText(words).width + 4;
      const at = Math.min(Math.max(px, AXIS + half), this.canvas.clientWidth - half);
      const isFree = (row) => !rows[row]?.some(([middle, wide]) => Math.abs(middle - at) < wide + half);
      let row = 0;
      while (!isFree(row)) row += 1;
      (rows[row] ??= []).push([at, half]);
      pen.fillText(words, at, 14 * (row + 1));
    }
  }

  paintLegend() {
    const items = [];
    if (!this.scene) return;
    if (this.colour === "zone" || !this.deposit) {
      const palette = zoneColours(this.scene);
      const shown = new Map();
      this.scene.zones.forEach((zone, i) => shown.set(zone.material, palette[i]));
      for (const [material, colour] of shown) items.push([colour, material.replaceAll("_", " ")]);
      this.legend.replaceChildren(...items.map(([colour, words]) => {
        const item = document.createElement("span");
        const box = document.createElement("i");
        box.style.background = colour;
        item.append(box, words);
        return item;
      }));
    } else {
      const { words, unit } = SCALES[this.colour];
      const bar = document.createElement("span");
      bar.className = "scale";
      const stops = RAMP.map((c, i) => `rgb(${c.join(" ")}) ${(100 * i) / (RAMP.length - 1)}%`);
      bar.style.background = `linear-gradient(90deg, ${stops.join(", ")})`;
      this.legend.replaceChildren(`${words}  0`, bar, `${this.top().toPrecision(3)} ${unit}`);
    }
  }
}

/** A colour for each zone: that of its material, whatever the others are; what liquefied stands out. */
export function zoneColours(scene) {
  const numbers = materialNumbers(scene);
  return scene.zones.map(({ material }) => (scene.materials[material]?.liquefied ? LIQUEFIED : COLOURS[numbers.get(material) % COLOURS.length]));
}

const numbered = new Map(); // case -> material -> its number, also of one that is no longer there

/** A number of each material, which it keeps while others come and go. */
function materialNumbers(scene) {
  const known = numbered.get(scene.name) ?? new Map();
  numbered.set(scene.name, known);
  const taken = new Map();
  for (const name of Object.keys(scene.materials)) if (known.has(name) && !taken.has(known.get(name))) taken.set(known.get(name), name);
  for (const name of Object.keys(scene.materials)) {
    if (taken.get(known.get(name)) === name) continue;
    let number = 0;
    while (taken.has(number)) number += 1;
    taken.set(number, name);
    known.set(name, number);
  }
  return known;
}

export function niceStep(wanted) {
  const power = 10 ** Math.floor(Math.log10(wanted));
  return [1, 2, 5, 10].map((m) => m * power).find((step) => step >= wanted);
}

const round = (value) => Math.round(value * 100) / 100;
