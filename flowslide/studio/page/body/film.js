// A body in plan, frame by frame, as flowslide/studio/body_maps.py sends it; between two frames values are in proportion.

import { frameAt, timeAt } from "../film_times.js";

const NO_ZONE = 255;

export class Film {
  /** `found` is an unpacked message: header and arrays. */
  constructor(found) {
    Object.assign(this, found);
    const { shape: [nx, ny], first, cell_m: cell } = this.header;
    Object.assign(this, { nx, ny, cell, x0: first[0], y0: first[1], cells: nx * ny });
    this.frame = 0;
    this.scratch = new Map(); // name of an array -> its values at the frame that is shown
  }

  get times() { return this.header.times; }
  get last() { return this.times.length - 1; }
  get isRun() { return this.header.type === "slide"; }
  /** Ends [m] of the cells: x, then y. */
  get ends() {
    const half = 0.5 * this.cell;
    return [this.x0 - half, this.x0 + (this.nx - 0.5) * this.cell, this.y0 - half, this.y0 + (this.ny - 0.5) * this.cell];
  }

  /** The place [m] of the map that is nearest to one. */
  inside([x, y]) {
    const [left, right, low, high] = this.ends;
    return [Math.min(Math.max(x, left), right), Math.min(Math.max(y, low), high)];
  }

  get time() { return timeAt(this.times, this.frame); }

  frameAt(time) { return frameAt(this.times, time); }

  /** Thickness or shade of every cell at the frame that is shown. */
  now(name) {
    const known = this.scratch.get(name);
    if (known?.frame === this.frame) return known.values;
    const values = known?.values ?? new Float32Array(this.cells);
    const k = Math.floor(this.frame);
    const share = this.frame - k;
    const [from, to] = [k * this.cells, Math.min(k + 1, this.last) * this.cells];
    for (let c = 0; c < this.cells; c += 1) values[c] = this[name][from + c] * (1 - share) + this[name][to + c] * share;
    this.scratch.set(name, { frame: this.frame, values });
    return values;
  }

  /** Thickness of the first frame. */
  get before() { return this.thickness.subarray(0, this.cells); }

  /** Zone of the soil that lies highest in a cell; -1: there is none. */
  zoneAt(c) {
    const zone = this.zone[Math.round(this.frame) * this.cells + c];
    return zone === NO_ZONE ? -1 : zone;
  }

  /** A map at a place [m], linear between the cells and level beyond the last ones; NaN next to a cell without a value. */
  at(values, x, y) {
    const [i, u] = between((x - this.x0) / this.cell, this.nx);
    const [j, v] = between((y - this.y0) / this.cell, this.ny);
    const [a, b] = [i * this.ny, Math.min(i + 1, this.nx - 1) * this.ny];
    const up = Math.min(j + 1, this.ny - 1);
    return (1 - u) * ((1 - v) * values[a + j] + v * values[a + up]) + u * ((1 - v) * values[b + j] + v * values[b + up]);
  }

  /** Elevations [m] of all there is to see: lowest, highest. */
  get heights() {
    if (!this.known) {
      let [low, high] = [Infinity, -Infinity];
      for (let c = 0; c < this.cells; c += 1) {
        low = Math.min(low, this.base[c]);
        for (let t = 0; t <= this.last; t += 1) high = Math.max(high, this.base[c] + this.thickness[t * this.cells + c]);
      }
      this.known = [low, high];
    }
    return this.known;
  }
}

function between(place, count) {
  const inside = Math.min(Math.max(place, 0), count - 1);
  const first = Math.min(Math.floor(inside), Math.max(count - 2, 0));
  return [first, inside - first];
}

/** Lines on which a map has a level, as pairs of places [m]: [x, y, x, y] each. */
export function contour(film, values, level) {
  const found = [];
  const { nx, ny, cell, x0, y0 } = film;
  for (let i = 0; i + 1 < nx; i += 1) {
    for (let j = 0; j + 1 < ny; j += 1) {
      const corners = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]];
      const heights = corners.map(([a, b]) => values[a * ny + b] - level);
      const cuts = [];
      for (let k = 0; k < 4; k += 1) {
        const [one, other] = [heights[k], heights[(k + 1) % 4]];
        if ((one < 0) === (other < 0)) continue;
        const share = one / (one - other);
        const [[a, b], [c, d]] = [corners[k], corners[(k + 1) % 4]];
        cuts.push(x0 + cell * (a + share * (c - a)), y0 + cell * (b + share * (d - b)));
      }
      for (let k = 0; k + 3 < cuts.length; k += 4) found.push(cuts.slice(k, k + 4));
    }
  }
  return found;
}
