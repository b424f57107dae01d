// Drawing on the section: select and move, zones, base, water table, and picking a place.

import { addZone, bounds, distance, footOn, insertVertex, isInside, lines, moveVertex, nearestEdge, nearestVertex,
  removeVertex, rounded, same } from "./section.js";
import { removeZone } from "./question.js";
import { css } from "./ui.js";

const REACH = 9; // pixels within which something is meant
const SLIVER = 3; // pixels: a vertex this close to an edge belongs on it
const DOTS = 6000; // of the grid, at most

export const TOOLS = {
  select: { words: "Select", key: "v", help: "click a zone, a vertex or an edge; drag a vertex (Shift: of this zone alone); double-click an edge: new vertex; Alt: no snapping" },
  zone: { words: "Zone", key: "z", help: "click vertex after vertex; the first one again, or Enter, closes the zone; Alt: no snapping" },
  ground: { words: "Base", key: "b", help: "the rigid base, from left to right; Enter ends it" },
  water: { words: "Water table", key: "w", help: "from left to right; Enter ends it" },
};

const SNAPS = { vertex: ": a vertex", edge: ": on an edge", grid: ": on the grid", free: "" };

export class Editor {
  /** `on` has scene(), edit(words, change), select(selection), drawing() and say(words). */
  constructor(view, on) {
    Object.assign(this, { view, on, tool: "select", step: 0, drawn: [], selection: {}, faults: [], marks: [], active: false,
      draft: null, hover: null, snapped: null, pick: null });
    view.tool = this;
    view.over = (pen) => this.paint(pen);
    view.canvas.addEventListener("pointermove", (event) => this.move(event));
    view.canvas.addEventListener("pointerleave", () => { this.hover = null; view.draw(); });
    view.canvas.addEventListener("dblclick", (event) => this.double(event));
  }

  get scene() { return this.draft ?? this.on.scene(); }
  get isDrawing() { return this.active && this.tool !== "select" && !this.pick; }

  use(tool) {
    this.tool = tool;
    this.drawn = [];
    this.hover = null;
    this.on.drawing();
    this.view.draw();
  }

  /** The section still has what is chosen: files that were changed elsewhere may not. */
  hasSelected() {
    const { zone, vertex } = this.selection;
    const { scene } = this;
    return (zone === undefined || Boolean(scene.zones?.[zone]))
      && (!vertex || lines(scene).some(({ points }) => points.some((point) => same(point, vertex))));
  }

  choose(selection) {
    this.selection = selection;
    this.on.select(selection);
    this.view.draw();
  }

  /** The next click on the section goes to `then([x, y])`. */
  askPlace(then) {
    this.pick = then;
    this.view.canvas.style.cursor = "crosshair";
    this.view.canvas.focus();
  }

  /** A place as it is meant: a vertex, a point of an edge, the grid; Alt: as it is. */
  meant(event) { return this.snap(event).place; }

  /** The place that is meant, and what it is: "vertex", "edge", "grid" or "free". */
  snap(event) {
    const place = this.view.at(event);
    if (event.altKey) return { place: rounded(place), kind: "free" };
    const pixel = this.view.box[2];
    const reach = REACH * pixel;
    const first = this.drawn[0];
    if (first && distance(first, place) < reach) return { place: [...first], kind: "vertex" };
    const vertex = nearestVertex(this.scene, place, reach);
    if (vertex) return { place: [...vertex.point], kind: "vertex" };
    const grid = this.grid();
    const onGrid = place.map((value) => Math.round(value / grid) * grid);
    const edge = nearestEdge(this.scene, place, reach);
    if (edge) {
      // A point of the grid that is nearer is meant, but for one so close to the edge that a sliver would be left.
      const gap = distance(onGrid, footOn(edge, onGrid));
      if (gap < 1e-9) return { place: rounded(onGrid), kind: "edge" };
      if (this.step === "off" || gap < SLIVER * pixel || edge.far <= distance(onGrid, place)) return { place: rounded(edge.point), kind: "edge" };
    }
    return this.step === "off" ? { place: rounded(place), kind: "free" } : { place: rounded(onGrid), kind: "grid" };
  }

  /** Distance of the points of the grid [m]: as chosen, else a round one of about ten pixels. */
  grid() {
    if (typeof this.step === "number" && this.step > 0) return this.step;
    const wanted = 10 * this.view.box[2];
    const power = 10 ** Math.floor(Math.log10(wanted));
    return [0.5, 1, 2, 5, 10].map((m) => m * power).find((one) => one >= wanted);
  }

  /** A press on the canvas; true: it was for the editor, else the view moves. */
  down(event) {
    if (event.button !== 0 || !this.view.box) return false;
    if (this.pick) {
      const then = this.pick;
      this.pick = null;
      this.view.canvas.style.cursor = "";
      then(event.altKey ? rounded(this.view.at(event)) : this.meant(event), this.view.at(event));
      return true;
    }
    if (!this.active) return false;
    if (this.tool !== "select") { this.add(this.meant(event)); return true; }
    const place = this.view.at(event);
    const reach = REACH * this.view.box[2];
    const vertex = nearestVertex(this.scene, place, reach);
    if (vertex) { this.dragVertex(event, vertex.point); return true; }
    const zone = this.scene.zones.findLastIndex(({ polygon }) => isInside(polygon, place));
    this.choose(zone < 0 ? {} : { zone });
    return false;
  }

  dragVertex(event, from) {
    const { canvas } = this.view;
    const zone = this.selection.zone;
    const has = (number) => this.scene.zones[number]?.polygon.some((point) => same(point, from));
    this.choose({ zone: has(zone) ? zone : this.scene.zones.findIndex((_, i) => has(i)), vertex: from });
    const only = event.shiftKey && has(this.selection.zone) ? { kind: "zone", number: this.selection.zone } : null;
    const base = this.on.scene();
    let to = from;
    const escape = (pressed) => {
      if (pressed.key !== "Escape") return;
      pressed.stopImmediatePropagation(); // what is chosen stays chosen
      to = from;
      end();
      this.view.preview(base);
      this.on.say("the vertex stays where it was");
    };
    const move = (now) => {
      const copy = structuredClone(base);
      // It does not snap to itself.
      const others = structuredClone(base);
      moveVertex(others, from, [NaN, NaN], only);
      this.draft = others;
      to = this.meant(now);
      this.draft = copy;
      moveVertex(copy, from, to, only);
      this.selection.vertex = to; // the dot goes along
      this.view.preview(copy);
      this.on.say(`${to[0]}, ${to[1]} m`);
    };
    const end = () => {
      canvas.removeEventListener("pointermove", move);
      canvas.removeEventListener("pointercancel", end);
      canvas.removeEventListener("pointerup", end);
      removeEventListener("keydown", escape, true);
      this.draft = null;
      this.selection.vertex = from;
      if (!same(to, from)) {
        this.on.edit("vertex moved", (documents) => moveVertex(documents.scene, from, to, only));
        this.choose({ ...this.selection, vertex: to });
      } else this.view.draw();
    };
    canvas.setPointerCapture(event.pointerId);
    canvas.addEventListener("pointermove", move);
    canvas.addEventListener("pointerup", end);
    canvas.addEventListener("pointercancel", end);
    addEventListener("keydown", escape, true);
  }

  move(event) {
    if (!this.active || !this.view.box) return;
    const snap = this.isDrawing || this.pick ? this.snap(event) : null;
    this.snapped = snap?.kind;
    this.hover = snap ? snap.place : nearestVertex(this.scene, this.view.at(event), REACH * this.view.box[2])?.point ?? null;
    if (snap) this.on.say(`${this.hover[0]}, ${this.hover[1]} m${SNAPS[snap.kind]}`);
    this.view.canvas.style.cursor = this.isDrawing || this.pick ? "crosshair" : this.hover ? "move" : "";
    this.view.draw();
  }

  double(event) {
    if (!this.active || this.tool !== "select") return;
    const place = this.view.at(event);
    const reach = REACH * this.view.box[2];
    if (nearestVertex(this.scene, place, reach)) return;
    const edge = nearestEdge(this.scene, place, reach);
    if (!edge) return;
    const point = this.meant(event);
    this.on.edit("vertex added", (documents) => insertVertex(documents.scene, point, 2e-3));
    this.choose({ zone: edge.line.number, vertex: point });
  }

  /** A vertex of the line that is drawn; the first again closes a zone. */
  add(place) {
    const { drawn } = this;
    if (drawn.length && same(place, drawn.at(-1))) return;
    if (this.tool === "zone" && drawn.length > 2 && same(place, drawn[0])) { this.close(); return; }
    drawn.push(place);
    this.on.drawing();
    this.view.draw();
  }

  close() {
    const { tool, drawn } = this;
    const fewest = { zone: 3, ground: 1, water: 2 }[tool];
    if (!drawn.length) return;
    if (drawn.length < fewest) { this.on.say(`${TOOLS[tool].words}: needs at least ${fewest} vertices`, true); return; }
    this.drawn = [];
    if (tool === "zone") {
      let number = 0;
      this.on.edit("zone drawn", ({ scene }) => { number = addZone(scene, drawn); });
      this.choose({ zone: number });
    } else {
      const ordered = [...drawn].sort((a, b) => a[0] - b[0]);
      this.on.edit(`${TOOLS[tool].words.toLowerCase()} drawn`, ({ scene }) => {
        if (tool === "ground") scene.ground = { ...(scene.ground ?? {}), points: ordered };
        else {
          const level = ordered.every(([, y]) => y === ordered[0][1]);
          scene.water_level = Math.max(...ordered.map(([, y]) => y));
          scene.phreatic_line = level ? null : ordered;
        }
      });
      this.use("select");
    }
    this.on.drawing();
  }

  /** Take the selected vertex, or else the selected zone, away. */
  remove() {
    const { zone, vertex } = this.selection;
    if (vertex) {
      if (!removeVertex(structuredClone(this.on.scene()), vertex)) { this.on.say("a zone has at least three vertices", true); return; }
      this.on.edit("vertex removed", ({ scene }) => removeVertex(scene, vertex));
      this.choose({ zone });
    } else if (zone !== undefined && zone >= 0) {
      this.on.edit("zone removed", (documents) => removeZone(documents, zone));
      this.choose({});
    }
  }

  key(event) {
    if (!this.active) return false;
    if (event.key === "Escape") {
      if (this.pick) { this.pick = null; this.view.canvas.style.cursor = ""; }
      else if (this.drawn.length) { this.drawn = []; this.on.drawing(); } else if (this.tool !== "select") this.use("select");
      else this.choose({});
    } else if (event.key === "Enter" && this.drawn.length) this.close();
    else if (event.key === "Backspace" && this.drawn.length) { this.drawn.pop(); this.on.drawing(); }
    else if (["Delete", "Backspace"].includes(event.key) && this.tool === "select") this.remove();
    else if (this.nudge(event)) return true;
    else return false;
    this.view.draw();
    return true;
  }

  nudge(event) {
    const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    const { vertex, zone } = this.selection;
    if (!way || !vertex || event.target !== this.view.canvas) return false;
    const grid = event.altKey ? 0.01 : this.grid();
    const to = rounded([vertex[0] + way[0] * grid, vertex[1] + way[1] * grid]);
    this.on.edit("vertex moved", ({ scene }) => moveVertex(scene, vertex, to));
    this.choose({ zone, vertex: to });
    return true;
  }

  // --- painting, in pixels ---

  paint(pen) {
    this.paintMarks(pen);
    if (!this.active) return;
    const { scene, selection } = this;
    if (this.isDrawing && this.step !== "off") this.paintGrid(pen);
    this.paintFaults(pen);
    const zone = scene.zones[selection.zone];
    if (zone) this.path(pen, zone.polygon, true, "--accent", 2.5);
    pen.fillStyle = css("--paper");
    pen.strokeStyle = css("--ink");
    pen.lineWidth = 1;
    for (const { points } of lines(scene)) for (const point of points) this.dot(pen, point, 2.5);
    pen.strokeStyle = css("--accent");
    pen.lineWidth = 2;
    if (this.hover && !this.isDrawing) this.dot(pen, this.hover, 6);
    if (selection.vertex) { pen.fillStyle = css("--accent"); this.dot(pen, selection.vertex, 5); }
    if (this.drawn.length || this.isDrawing) {
      const ahead = this.hover && this.isDrawing ? [...this.drawn, this.hover] : this.drawn;
      this.path(pen, ahead, false, "--accent", 2);
      for (const point of ahead) this.dot(pen, point, 4);
      if (this.hover) this.paintSnap(pen, this.view.pixel(this.hover));
    }
  }

  /** Where vertices snap to: a dot for each point of the grid, as far as they are apart. */
  paintGrid(pen) {
    const { canvas, box: [left, bottom, scale], up } = this.view;
    const grid = this.grid();
    const [across, high] = [(canvas.clientWidth * scale) / grid, (canvas.clientHeight * up) / grid];
    if (grid < 5 * scale || across * high > DOTS) return;
    pen.fillStyle = css("--soft");
    pen.globalAlpha = 0.5;
    for (let i = Math.ceil(left / grid); i * grid < left + canvas.clientWidth * scale; i += 1) {
      for (let j = Math.ceil(bottom / grid); j * grid < bottom + canvas.clientHeight * up; j += 1) {
        const [x, y] = this.view.pixel([i * grid, j * grid]);
        pen.fillRect(x - 0.75, y - 0.75, 1.5, 1.5);
      }
    }
    pen.globalAlpha = 1;
  }

  /** What the next vertex snaps to: a square on a vertex, a diamond on an edge, a cross on the grid. */
  paintSnap(pen, [x, y]) {
    const corners = { vertex: [[-8, -8], [8, -8], [8, 8], [-8, 8]], edge: [[0, -10], [10, 0], [0, 10], [-10, 0]] }[this.snapped];
    pen.beginPath();
    if (corners) { corners.forEach(([dx, dy]) => pen.lineTo(x + dx, y + dy)); pen.closePath(); }
    if (this.snapped === "grid") { pen.moveTo(x - 9, y); pen.lineTo(x + 9, y); pen.moveTo(x, y - 9); pen.lineTo(x, y + 9); }
    pen.strokeStyle = css("--accent");
    pen.lineWidth = 1.5;
    pen.stroke();
  }

  paintFaults(pen) {
    for (const { zones = [], places = [] } of this.faults) {
      const rings = places.length ? places
        : this.scene.zones.filter(({ name }) => zones.includes(name)).map(({ polygon }) => polygon);
      for (const ring of rings) {
        if (ring.length < 3) {
          pen.strokeStyle = css("--bad");
          pen.lineWidth = 2.5;
          for (const point of ring) { const [x, y] = this.view.pixel(point); pen.beginPath(); pen.arc(x, y, 11, 0, 7); pen.stroke(); }
        } else {
          this.path(pen, ring, true, "--bad", 2.5);
          pen.globalAlpha = 0.25;
          pen.fillStyle = css("--bad");
          pen.fill();
          pen.globalAlpha = 1;
        }
      }
    }
  }

  /** What was surveyed: lines, distances from a foot, and heights over the surface before the slide. */
  paintMarks(pen) {
    const low = bounds(this.scene)?.low ?? 0;
    pen.font = "11px system-ui, sans-serif";
    this.marks.forEach((mark) => {
      if (mark.kind === "line") {
        const points = mark.x.map((x, i) => [x, mark.y[i]]);
        pen.setLineDash(mark.constructed ? [3, 4] : []);
        this.path(pen, points, false, "--survey", 2);
        pen.setLineDash([]);
        if (points.length === 1) { pen.fillStyle = css("--survey"); this.dot(pen, points[0], 4); }
        return;
      }
      if (mark.kind === "height") {
        const [x, from] = this.view.pixel([mark.x, mark.surface]);
        const [, to] = this.view.pixel([mark.x, mark.surface + mark.value]);
        pen.strokeStyle = pen.fillStyle = css("--survey");
        pen.lineWidth = 2;
        pen.beginPath(); pen.moveTo(x, from); pen.lineTo(x, to); pen.moveTo(x - 7, to); pen.lineTo(x + 7, to); pen.stroke();
        pen.textAlign = "center";
        pen.fillText(`${mark.name} ${Math.abs(mark.value)} m`, x, to + (mark.value > 0 ? -6 : 14));
        return;
      }
      const end = mark.start + mark.outward * mark.value;
      const [a, y] = this.view.pixel([mark.start, low]);
      const [b] = this.view.pixel([end, low]);
      pen.strokeStyle = pen.fillStyle = css("--survey");
      pen.lineWidth = 2;
      pen.setLineDash(mark.limit ? [5, 4] : []);
      pen.beginPath(); pen.moveTo(a, y + 12); pen.lineTo(b, y + 12); pen.moveTo(b, y + 5); pen.lineTo(b, y + 19); pen.stroke();
      pen.setLineDash([]);
      pen.textAlign = "center";
      pen.fillText(`${mark.name} ${mark.limit ? "< " : ""}${mark.value} m`, 0.5 * (a + b), y + 30);
    });
  }

  path(pen, points, closed, colour, width) {
    this.view.path(pen, points);
    if (closed) pen.closePath();
    pen.strokeStyle = css(colour);
    pen.lineWidth = width;
    pen.stroke();
  }

  dot(pen, point, size) {
    const [x, y] = this.view.pixel(point);
    pen.beginPath();
    pen.arc(x, y, size, 0, 7);
    pen.fill();
    pen.stroke();
  }
}

