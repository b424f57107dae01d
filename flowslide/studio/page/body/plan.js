// Draws a body from above: hillshade, a map by colours, edges of the soil, what was measured, and the line of the section, which is dragged.

import { css, onSize } from "../ui.js";
import { niceStep } from "../view.js";
import { contour } from "./film.js";

const GRAB = 12; // pixels
const ROOM = { left: 46, right: 14, top: 12, foot: 30 };
export const LINE_COLOUR = [214, 40, 120]; // of the section, here and on the block
const PATH_COLOUR = "#222";

/** Metres between two contours of the surface. */
export const contourStep = (film) => niceStep((film.heights[1] - film.heights[0]) / 12);

export class Plan {
  /** `on` has line(places, isDone) while the line of the section is dragged, and over(place or null). */
  constructor(canvas, on) {
    Object.assign(this, { canvas, on, film: null, layer: null, line: [], box: null, places: {} });
    onSize(canvas, () => { if (this.isFitted) this.fit(); this.draw(); });
    canvas.addEventListener("pointerdown", (event) => this.down(event));
    canvas.addEventListener("pointermove", (event) => { if (this.film && this.box) { this.on.over(this.at(event)); this.hint(event); } });
    canvas.addEventListener("pointerleave", () => this.on.over(null));
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    canvas.addEventListener("keydown", (event) => this.key(event));
  }

  /** `places` has paths, lines and marks, as the server tells them. */
  show(film, layer, line, places) {
    const isOther = !this.film || String(this.film.ends) !== String(film.ends);
    Object.assign(this, { film, layer, line, places });
    if (isOther) this.fit();
    this.draw();
  }

  fit() {
    if (!this.film || !this.canvas.clientWidth) return;
    const [left, right, low, high] = this.film.ends;
    const [wide, tall] = [this.canvas.clientWidth - ROOM.left - ROOM.right, this.canvas.clientHeight - ROOM.top - ROOM.foot];
    const scale = Math.max((right - left) / wide, (high - low) / tall, 1e-6);
    // [x at the left edge, y at the top edge, metres a pixel]
    this.box = [0.5 * (left + right) - scale * (ROOM.left + 0.5 * wide), 0.5 * (low + high) + scale * (ROOM.top + 0.5 * tall), scale];
    this.isFitted = true;
  }

  pixel([x, y]) { return [(x - this.box[0]) / this.box[2], (this.box[1] - y) / this.box[2]]; }

  at(event) {
    const { left, top } = this.canvas.getBoundingClientRect();
    return [this.box[0] + (event.clientX - left) * this.box[2], this.box[1] - (event.clientY - top) * this.box[2]];
  }

  /** What of the section's line is under a pointer: an end (0, 1), the whole ("line"), or nothing. */
  grabbed(event) {
    if (this.line.length !== 2) return null;
    const { left, top } = this.canvas.getBoundingClientRect();
    const [px, py] = [event.clientX - left, event.clientY - top];
    const ends = this.line.map((place) => this.pixel(place));
    const far = ends.map(([x, y]) => Math.hypot(px - x, py - y));
    const nearer = far[0] < far[1] ? 0 : 1;
    if (far[nearer] <= GRAB) return nearer;
    const [[ax, ay], [bx, by]] = ends;
    const length = Math.hypot(bx - ax, by - ay) || 1;
    const along = ((px - ax) * (bx - ax) + (py - ay) * (by - ay)) / length;
    const off = Math.abs((px - ax) * (by - ay) - (py - ay) * (bx - ax)) / length;
    return off <= 0.7 * GRAB && along > 0 && along < length ? "line" : null;
  }

  hint(event) {
    if (event.buttons) return;
    const what = this.grabbed(event);
    this.canvas.style.cursor = what === null ? "" : what === "line" ? "move" : "crosshair";
  }

  down(event) {
    if (!this.film || !this.box) return;
    const what = this.grabbed(event);
    const [from, line, box] = [this.at(event), this.line, this.box];
    const pressed = [event.clientX, event.clientY];
    this.canvas.setPointerCapture(event.pointerId);
    const move = (now) => {
      if (what === null) {
        this.box = [box[0] - (now.clientX - pressed[0]) * box[2], box[1] + (now.clientY - pressed[1]) * box[2], box[2]];
        this.isFitted = false;
        this.draw();
        return;
      }
      const to = this.at(now);
      const by = [to[0] - from[0], to[1] - from[1]];
      this.on.line(line.map(([x, y], k) => (what === "line" || what === k ? this.film.inside([x + by[0], y + by[1]]) : [x, y])));
    };
    const dragged = new AbortController();
    const { signal } = dragged;
    this.canvas.addEventListener("pointermove", move, { signal });
    for (const end of ["pointerup", "pointercancel"]) this.canvas.addEventListener(end, () => dragged.abort(), { signal });
    addEventListener("keydown", (now) => { if (now.key === "Escape" && what !== null) { dragged.abort(); this.on.line(line); } }, { signal });
  }

  wheel(event) {
    event.preventDefault();
    if (!this.box) return;
    const factor = Math.exp(event.deltaY * 0.0015);
    this.scale(this.at(event), factor);
  }

  scale([x, y], factor) {
    const [left, top, scale] = this.box;
    this.box = [x + (left - x) * factor, y + (top - y) * factor, scale * factor];
    this.isFitted = false;
    this.draw();
  }

  key(event) {
    const steps = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (!this.film || !this.box) return;
    const { clientWidth: wide, clientHeight: tall } = this.canvas;
    if (steps) this.on.line(this.line.map(([x, y]) => this.film.inside([x + steps[0] * this.film.cell, y + steps[1] * this.film.cell])));
    else if (event.key === "+" || event.key === "-") this.scale([this.box[0] + 0.5 * wide * this.box[2], this.box[1] - 0.5 * tall * this.box[2]], event.key === "+" ? 0.8 : 1.25);
    else return;
    event.preventDefault();
  }

  draw() {
    if (this.pending) return;
    this.pending = true;
    requestAnimationFrame(() => { this.pending = false; this.paint(); });
  }

  paint() {
    const { canvas, film } = this;
    const { clientWidth: width, clientHeight: height } = canvas;
    if (!film || !width) return;
    if (!this.box) this.fit();
    const ratio = devicePixelRatio || 1;
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.paintMaps(pen);
    this.paintEdges(pen);
    this.paintPlaces(pen);
    this.paintMarks(pen);
    this.paintLine(pen);
    this.paintAxes(pen, width, height);
    canvas.dataset.box = this.box.join(" ");
  }

  /** Hillshade, and the layer over it. */
  paintMaps(pen) {
    const { film, layer } = this;
    const shade = film.now("shade");
    const [ground, over] = [new ImageData(film.nx, film.ny), new ImageData(film.nx, film.ny)];
    for (let i = 0; i < film.nx; i += 1) for (let j = 0; j < film.ny; j += 1) {
      const c = i * film.ny + j;
      const n = 4 * ((film.ny - 1 - j) * film.nx + i);
      const grey = 255 * (0.35 + (0.65 * shade[c]) / 255);
      ground.data.set([grey, grey, grey, 255], n);
      const value = layer.value(c);
      if (!Number.isNaN(value)) { const [r, g, b] = layer.colour(value); over.data.set([r, g, b, 185], n); }
    }
    const [left, right, low, high] = film.ends;
    const [[x0, y0], [x1, y1]] = [this.pixel([left, high]), this.pixel([right, low])];
    [ground, over].forEach((picture, number) => {
      const sheet = Object.assign(document.createElement("canvas"), { width: film.nx, height: film.ny });
      sheet.getContext("2d").putImageData(picture, 0, 0);
      pen.imageSmoothingEnabled = number === 0 || !layer.crisp;
      pen.drawImage(sheet, x0, y0, x1 - x0, y1 - y0);
    });
    pen.imageSmoothingEnabled = true;
  }

  strokes(pen, lines, colour, width, dashes = []) {
    pen.beginPath();
    for (const [ax, ay, bx, by] of lines) {
      pen.moveTo(...this.pixel([ax, ay]));
      pen.lineTo(...this.pixel([bx, by]));
    }
    Object.assign(pen, { strokeStyle: colour, lineWidth: width });
    pen.setLineDash(dashes);
    pen.stroke();
    pen.setLineDash([]);
  }

  /** Contours of the surface, and where the soil ended before (dotted) and ends now. */
  paintEdges(pen) {
    const { film } = this;
    const thickness = film.now("thickness");
    const surface = thickness.map((metres, c) => metres + film.base[c]);
    const [low, high] = film.heights;
    const step = contourStep(film);
    for (let level = Math.ceil(low / step) * step; level < high; level += step) this.strokes(pen, contour(film, surface, level), "rgb(0 0 0 / 32%)", 0.6);
    const { least_m: least } = film.header;
    this.strokes(pen, contour(film, film.before, least), "#222", 1.5, [1, 2.5]);
    if (film.frame > 0) this.strokes(pen, contour(film, thickness, least), "#0b6bb5", 2);
  }

  /** Paths and lines of the scene, with their names. */
  paintPlaces(pen) {
    const { paths = {}, lines = {} } = this.places;
    for (const [name, way] of Object.entries(paths)) this.named(pen, name, way, PATH_COLOUR, [2, 4]);
    for (const [name, way] of Object.entries(lines)) this.named(pen, name, way, "#b3261e", []);
  }

  named(pen, name, way, colour, dashes) {
    this.strokes(pen, way.slice(1).map((place, k) => [...way[k], ...place]), colour, 1.3, dashes);
    const [x, y] = this.pixel(way.at(-1));
    const { clientWidth: wide, clientHeight: tall } = this.canvas;
    this.words(pen, name.replaceAll("_", " "), Math.min(Math.max(x, 30), wide - 30), Math.min(Math.max(y - 5, 14), tall - 34), colour);
  }

  words(pen, text, x, y, colour) {
    pen.font = "11px system-ui, sans-serif";
    pen.textAlign = "center";
    Object.assign(pen, { lineWidth: 3, strokeStyle: "rgb(255 255 255 / 80%)", lineJoin: "round", fillStyle: colour });
    pen.strokeText(text, x, y);
    pen.fillText(text, x, y);
  }

  /** Where it was measured: squares of a surface, places of an edge. */
  paintMarks(pen) {
    for (const mark of this.places.marks ?? []) {
      const half = mark.kind === "squares" ? (0.5 * mark.every_m) / this.box[2] : 3;
      pen.strokeStyle = pen.fillStyle = "#7a3fa0";
      pen.lineWidth = 0.7;
      pen.globalAlpha = mark.kind === "squares" ? 0.45 : 1;
      for (const place of mark.places) {
        const [x, y] = this.pixel(place);
        if (mark.kind === "squares") pen.strokeRect(x - half, y - half, 2 * half, 2 * half);
        else { pen.beginPath(); pen.arc(x, y, half, 0, 7); pen.fill(); }
      }
      pen.globalAlpha = 1;
    }
  }

  paintLine(pen) {
    if (this.line.length !== 2) return;
    const colour = `rgb(${LINE_COLOUR.join(" ")})`;
    const [a, b] = this.line;
    this.strokes(pen, [[...a, ...b]], "rgb(255 255 255 / 85%)", 4.5);
    this.strokes(pen, [[...a, ...b]], colour, 2.2);
    [a, b].forEach((place, k) => {
      const [x, y] = this.pixel(place);
      pen.beginPath();
      pen.arc(x, y, 8, 0, 7);
      Object.assign(pen, { fillStyle: "#fff", strokeStyle: colour, lineWidth: 2 });
      pen.fill();
      pen.stroke();
      Object.assign(pen, { fillStyle: colour, font: "bold 11px system-ui, sans-serif", textAlign: "center" });
      pen.fillText("AB"[k], x, y + 4);
    });
  }

  paintAxes(pen, width, height) {
    const [left, top, scale] = this.box;
    // What lies beyond the map is paper: marks and maps end at the axes.
    pen.clearRect(0, height - ROOM.foot + 6, width, ROOM.foot);
    pen.clearRect(0, 0, ROOM.left - 6, height);
    Object.assign(pen, { font: "11px system-ui, sans-serif", fillStyle: css("--soft"), strokeStyle: css("--soft"), lineWidth: 1 });
    const step = niceStep(60 * scale);
    pen.beginPath();
    pen.textAlign = "center";
    const [foot, side] = [height - ROOM.foot + 6, ROOM.left - 6];
    for (let x = Math.ceil((left + side * scale) / step) * step; x < left + width * scale; x += step) {
      const px = (x - left) / scale;
      pen.moveTo(px, foot);
      pen.lineTo(px, foot + 4);
      if (px < width - 46) pen.fillText(`${+x.toFixed(6)}`, px, foot + 15);
    }
    pen.textAlign = "right";
    for (let y = Math.ceil((top - foot * scale) / step) * step; y < top; y += step) {
      const py = (top - y) / scale;
      pen.moveTo(side, py);
      pen.lineTo(side - 4, py);
      if (py > 22) pen.fillText(`${+y.toFixed(6)}`, side - 7, py + 4);
    }
    pen.stroke();
    pen.fillText("x, m", width - 4, foot + 15);
    pen.fillText("y, m", side - 7, 12);
  }
}
