// Draws a body as a block that can be turned: pixel by pixel, so that a browser without a graphics card has it as well.

import { css, onSize } from "../ui.js";

const BARE = [199, 199, 199];
const SIDE = { ground: [138, 127, 114], soil: [196, 170, 128] };
const MOST_CELLS = 60000; // that are drawn while it moves; at rest all of them are
const REST = 160; // ms without a move, until it is drawn smooth
const LIGHT = [0.35, 0.65]; // brightness in the shadow, and what light adds, as in the plan of a report

export class Relief {
  /** `on` has moved(), after somebody has turned it. */
  constructor(canvas, on) {
    Object.assign(this, { canvas, on, film: null, layer: null, rise: 1, lines: [] });
    this.home();
    onSize(canvas, () => this.draw());
    canvas.addEventListener("pointerdown", (event) => this.drag(event));
    canvas.addEventListener("wheel", (event) => { event.preventDefault(); this.zoom(Math.exp(event.deltaY * 0.0015)); }, { passive: false });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("keydown", (event) => this.key(event));
  }

  /** Seen from downstream and above, with all of it in the window. */
  home(side = this.side ?? "right") {
    const long = this.film ? this.film.nx > 1.5 * this.film.ny : false; // lies across the window
    const aside = long ? 68 : 55;
    Object.assign(this, { side, turn: side === "left" ? aside - 180 : -aside, tilt: 30, far: 1, shift: [0, 0] });
  }

  show(film, layer, rise, lines) {
    Object.assign(this, { film, layer, rise, lines });
    this.draw();
  }

  key(event) {
    const turns = { ArrowLeft: [-8, 0], ArrowRight: [8, 0], ArrowUp: [0, 5], ArrowDown: [0, -5] }[event.key];
    if (turns) this.turnBy(...turns);
    else if (event.key === "+" || event.key === "-") this.zoom(event.key === "+" ? 0.85 : 1.18);
    else return;
    event.preventDefault();
  }

  turnBy(around, up) {
    this.turn = (this.turn + around + 540) % 360 - 180;
    this.tilt = Math.min(Math.max(this.tilt + up, 4), 90);
    this.moved();
  }

  zoom(factor) {
    this.far = Math.min(Math.max(this.far * factor, 0.12), 4);
    this.moved();
  }

  drag(event) {
    let [x, y] = [event.clientX, event.clientY];
    const shifts = event.shiftKey || event.button === 2;
    this.canvas.setPointerCapture(event.pointerId);
    const move = (now) => {
      const [across, down] = [now.clientX - x, now.clientY - y];
      [x, y] = [now.clientX, now.clientY];
      if (!shifts) { this.turnBy(-0.4 * across, 0.3 * down); return; }
      this.shift = [this.shift[0] + across, this.shift[1] + down];
      this.moved();
    };
    this.canvas.addEventListener("pointermove", move);
    for (const end of ["pointerup", "pointercancel"]) this.canvas.addEventListener(end, () => this.canvas.removeEventListener("pointermove", move), { once: true });
  }

  moved() {
    this.on.moved?.();
    this.draw();
  }

  /** At once in few pixels; smooth as soon as nothing has moved for a while. */
  draw() {
    clearTimeout(this.resting);
    this.resting = setTimeout(() => requestAnimationFrame(() => this.paint(true)), REST);
    if (this.pending) return;
    this.pending = true;
    requestAnimationFrame(() => { this.pending = false; this.paint(false); });
  }

  /** Place on the sheet [pixels of the page] and nearness of a place [m]. */
  eye(width, height) {
    const { film } = this;
    const [left, right, low, high] = film.ends;
    const [floor, top] = film.heights;
    const middle = [0.5 * (left + right), 0.5 * (low + high), 0.5 * (floor + top)];
    const [a, b] = [this.turn, this.tilt].map((angle) => (angle * Math.PI) / 180);
    const size = Math.hypot(right - left, high - low, this.rise * (top - floor));
    const away = 1.9 * size;
    const [ca, sa, cb, sb] = [Math.cos(a), Math.sin(a), Math.cos(b), Math.sin(b)];
    const seen = (x, y, z) => {
      const [dx, dy, dz] = [x - middle[0], y - middle[1], this.rise * (z - middle[2])];
      const across = -sa * dx + ca * dy;
      const ahead = ca * dx + sa * dy; // towards the eye
      return [across, cb * dz - sb * ahead, away - (cb * ahead + sb * dz)];
    };
    // As large as the window holds, from this side.
    let [wide, tall, up, down] = [1e-9, 1e-9, -Infinity, Infinity];
    for (const x of [left, right]) for (const y of [low, high]) for (const z of [floor, top]) {
      const [across, rise, depth] = seen(x, y, z);
      wide = Math.max(wide, Math.abs(across) / depth);
      up = Math.max(up, rise / depth);
      down = Math.min(down, rise / depth);
    }
    tall = up - down;
    const scale = Math.min((0.5 * width - 34) / wide, (height - 44) / tall) / this.far;
    const centre = 0.5 * height + 0.5 * (up + down) * scale;
    return (x, y, z, out) => {
      const [across, rise, depth] = seen(x, y, z);
      out[0] = 0.5 * width + this.shift[0] + (scale * across) / depth;
      out[1] = centre + this.shift[1] - (scale * rise) / depth;
      out[2] = depth > 0.02 * size ? 1 / depth : NaN; // behind the eye nothing is drawn
      return out;
    };
  }

  paint(fine) {
    const { canvas, film } = this;
    const { clientWidth: width, clientHeight: height } = canvas;
    if (!film || !width || !height) return;
    const ratio = fine ? Math.min(2 * (devicePixelRatio || 1), 2) : 1;
    const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
    const eye = this.eye(width, height);
    const sheet = new Sheet(w, h);
    this.paintBlock(sheet, (x, y, z, out) => { eye(x, y, z, out); out[0] *= ratio; out[1] *= ratio; return out; }, fine);
    const shown = devicePixelRatio || 1;
    canvas.width = Math.round(width * shown);
    canvas.height = Math.round(height * shown);
    const pen = canvas.getContext("2d");
    const buffer = Object.assign(document.createElement("canvas"), { width: w, height: h });
    buffer.getContext("2d").putImageData(sheet.picture, 0, 0);
    pen.imageSmoothingQuality = "high";
    pen.drawImage(buffer, 0, 0, canvas.width, canvas.height);
    pen.setTransform(shown, 0, 0, shown, 0, 0);
    this.paintWords(pen, eye);
    canvas.dataset.turn = `${this.turn.toFixed(1)} ${this.tilt.toFixed(1)} ${this.far.toFixed(3)}`;
    canvas.dataset.fine = String(fine);
  }

  paintBlock(sheet, eye, fine) {
    const { film, layer } = this;
    const step = fine ? 1 : Math.max(1, Math.ceil(Math.sqrt(film.cells / MOST_CELLS)));
    const every = (count) => { const kept = []; for (let k = 0; k < count - 1; k += step) kept.push(k); return [...kept, count - 1]; };
    const [columns, rows] = [every(film.nx), every(film.ny)];
    const thickness = film.now("thickness");
    const shade = film.now("shade");
    const count = columns.length * rows.length;
    const [places, colours] = [new Float32Array(3 * count), new Float32Array(3 * count)];
    const out = [0, 0, 0];
    columns.forEach((i, a) => rows.forEach((j, b) => {
      const c = i * film.ny + j;
      const n = 3 * (a * rows.length + b);
      eye(film.x0 + i * film.cell, film.y0 + j * film.cell, film.base[c] + thickness[c], out);
      places.set(out, n);
      const value = layer.value(c);
      const light = LIGHT[0] + (LIGHT[1] * shade[c]) / 255;
      const own = Number.isNaN(value) ? BARE : layer.colour(value);
      for (let k = 0; k < 3; k += 1) colours[n + k] = Math.min(1.18 * light, 1.1) * own[k];
    }));
    for (let a = 0; a + 1 < columns.length; a += 1) {
      for (let b = 0; b + 1 < rows.length; b += 1) {
        const n = a * rows.length + b;
        const [one, two, three, four] = [n, n + rows.length, n + rows.length + 1, n + 1];
        sheet.triangle(places, colours, one, two, three);
        sheet.triangle(places, colours, one, three, four);
      }
    }
    this.paintSides(sheet, eye, columns, rows);
    for (const line of this.lines) sheet.polyline(this.drape(line.places, eye), line.colour);
  }

  /** The four sides of the block: ground below, soil above. */
  paintSides(sheet, eye, columns, rows) {
    const { film } = this;
    const thickness = film.now("thickness");
    const [low, high] = film.heights;
    const floor = low - 0.12 * (high - low) - 0.01 * film.cell * Math.max(film.nx, film.ny);
    const corners = [columns[0], columns.at(-1), rows[0], rows.at(-1)];
    const sides = [
      [rows.map((j) => [corners[0], j]), 0.82], [rows.map((j) => [corners[1], j]), 0.9],
      [columns.map((i) => [i, corners[2]]), 0.72], [columns.map((i) => [i, corners[3]]), 1],
    ];
    const out = [0, 0, 0];
    for (const [cells, light] of sides) {
      for (const [part, colour] of Object.entries(SIDE)) {
        const [places, colours] = [new Float32Array(6 * cells.length), new Float32Array(6 * cells.length)];
        cells.forEach(([i, j], k) => {
          const c = i * film.ny + j;
          const ends = part === "ground" ? [floor, film.base[c]] : [film.base[c], film.base[c] + thickness[c]];
          ends.forEach((z, end) => {
            places.set(eye(film.x0 + i * film.cell, film.y0 + j * film.cell, z, out), 3 * (2 * k + end));
            colours.set(colour.map((one) => light * one), 3 * (2 * k + end));
          });
        });
        for (let k = 0; k + 1 < cells.length; k += 1) {
          sheet.triangle(places, colours, 2 * k, 2 * k + 1, 2 * k + 3);
          sheet.triangle(places, colours, 2 * k, 2 * k + 3, 2 * k + 2);
        }
      }
    }
  }

  /** A line in plan as places on the sheet, on the surface. */
  drape(places, eye) {
    const { film } = this;
    const thickness = film.now("thickness");
    const found = [];
    for (let k = 0; k + 1 < places.length; k += 1) {
      const [[ax, ay], [bx, by]] = [places[k], places[k + 1]];
      const parts = Math.max(Math.ceil((2 * Math.hypot(bx - ax, by - ay)) / film.cell), 1);
      for (let n = 0; n <= parts; n += 1) {
        const [x, y] = [ax + ((bx - ax) * n) / parts, ay + ((by - ay) * n) / parts];
        const [left, right, low, high] = film.ends;
        if (x < left || x > right || y < low || y > high) continue;
        found.push(eye(x, y, film.at(film.base, x, y) + film.at(thickness, x, y), [0, 0, 0]));
      }
    }
    return found;
  }

  /** Coordinates of the corners, and heights. */
  paintWords(pen, eye) {
    const { film } = this;
    const [left, right, low, high] = film.ends;
    const [floor, top] = film.heights;
    pen.font = "11px system-ui, sans-serif";
    Object.assign(pen, { fillStyle: css("--ink"), strokeStyle: css("--paper"), lineWidth: 3, lineJoin: "round", textAlign: "center" });
    const write = (text, x, y) => { pen.strokeText(text, x, y); pen.fillText(text, x, y); };
    const corners = [[left, low], [right, low], [right, high], [left, high]].map(([x, y]) => ({ x, y, place: eye(x, y, floor, [0, 0, 0]) }));
    corners.sort((a, b) => b.place[2] - a.place[2]);
    for (const { x, y, place: [px, py, near] } of corners.slice(0, 3)) {
      if (Number.isFinite(near)) write(`x ${Math.round(x)}, y ${Math.round(y)} m`, Math.min(Math.max(px, 52), this.canvas.clientWidth - 52), Math.min(py + 26, this.canvas.clientHeight - 5));
    }
    pen.textAlign = "left";
    const scale = this.rise === 1 ? "heights as lengths" : `heights ${this.rise} times lengths`;
    write(`${Math.round(floor)} to ${Math.round(top)} m above datum; ${scale}`, 10, 15);
  }
}

/** Pixels with their nearness, so that what is in front hides what is behind. */
class Sheet {
  constructor(width, height) {
    Object.assign(this, { width, height, near: new Float32Array(width * height), picture: new ImageData(width, height) });
    this.pixels = new Uint32Array(this.picture.data.buffer);
  }

  /** Three places [pixels, pixels, nearness], with their colours in proportion in between. */
  triangle(places, colours, a, b, c) {
    const [ax, ay, az] = [places[3 * a], places[3 * a + 1], places[3 * a + 2]];
    const [bx, by, bz] = [places[3 * b], places[3 * b + 1], places[3 * b + 2]];
    const [cx, cy, cz] = [places[3 * c], places[3 * c + 1], places[3 * c + 2]];
    const whole = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax);
    if (!(Math.abs(whole) > 1e-9) || !(az + bz + cz > 0)) return;
    const top = Math.max(Math.ceil(Math.min(ay, by, cy) - 0.5), 0);
    const foot = Math.min(Math.floor(Math.max(ay, by, cy) - 0.5), this.height - 1);
    for (let row = top; row <= foot; row += 1) {
      const y = row + 0.5;
      let [left, right] = [Infinity, -Infinity];
      if ((ay > y) !== (by > y)) { const x = ax + ((bx - ax) * (y - ay)) / (by - ay); left = Math.min(left, x); right = Math.max(right, x); }
      if ((by > y) !== (cy > y)) { const x = bx + ((cx - bx) * (y - by)) / (cy - by); left = Math.min(left, x); right = Math.max(right, x); }
      if ((cy > y) !== (ay > y)) { const x = cx + ((ax - cx) * (y - cy)) / (ay - cy); left = Math.min(left, x); right = Math.max(right, x); }
      const [first, last] = [Math.max(Math.ceil(left - 0.5), 0), Math.min(Math.floor(right - 0.5), this.width - 1)];
      for (let column = first; column <= last; column += 1) {
        const x = column + 0.5;
        const v = ((x - ax) * (cy - ay) - (y - ay) * (cx - ax)) / whole;
        const w = ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / whole;
        const u = 1 - v - w;
        const near = u * az + v * bz + w * cz;
        const place = row * this.width + column;
        if (near <= this.near[place]) continue;
        this.near[place] = near;
        const r = Math.min(u * colours[3 * a] + v * colours[3 * b] + w * colours[3 * c], 255);
        const g = Math.min(u * colours[3 * a + 1] + v * colours[3 * b + 1] + w * colours[3 * c + 1], 255);
        const blue = Math.min(u * colours[3 * a + 2] + v * colours[3 * b + 2] + w * colours[3 * c + 2], 255);
        this.pixels[place] = (255 << 24) | (blue << 16) | (g << 8) | r;
      }
    }
  }

  /** A line through places that lie on the surface, a little in front of it. */
  polyline(places, [r, g, b]) {
    const wide = Math.max(Math.round(this.width / 700), 1);
    for (let k = 0; k + 1 < places.length; k += 1) {
      const [[ax, ay, az], [bx, by, bz]] = [places[k], places[k + 1]];
      const parts = Math.ceil(Math.max(Math.abs(bx - ax), Math.abs(by - ay))) || 1;
      if (!(parts < 4000)) continue;
      for (let n = 0; n <= parts; n += 1) {
        const share = n / parts;
        const near = 1.004 * (az + share * (bz - az));
        for (let dy = -wide; dy <= wide; dy += 1) for (let dx = -wide; dx <= wide; dx += 1) {
          const [column, row] = [Math.round(ax + share * (bx - ax)) + dx, Math.round(ay + share * (by - ay)) + dy];
          if (column < 0 || row < 0 || column >= this.width || row >= this.height) continue;
          const place = row * this.width + column;
          if (near > this.near[place]) this.pixels[place] = (255 << 24) | (b << 16) | (g << 8) | r;
        }
      }
    }
  }
}
