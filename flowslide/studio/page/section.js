// Operations on a section's document. Vertices at one place are one vertex: borders that zones share move together.

const NEAR = 1e-6;

export const same = (a, b) => Math.abs(a[0] - b[0]) < NEAR && Math.abs(a[1] - b[1]) < NEAR;
export const rounded = (place) => place.map((value) => Math.round(value * 1000) / 1000);
export const distance = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1]);

/** Every line that can be edited: the zones' outlines, the base and the water table. */
export function lines(scene) {
  const found = scene.zones.map((zone, number) => ({ kind: "zone", number, points: zone.polygon, closed: true, fewest: 3 }));
  if (scene.ground?.points) found.push({ kind: "ground", points: scene.ground.points, closed: false, fewest: 1 });
  if (scene.phreatic_line) found.push({ kind: "water", points: scene.phreatic_line, closed: false, fewest: 2 });
  return found;
}

/** Consecutive vertices of a line, and the place of the second one in it. */
export function edges({ points, closed }) {
  const found = points.slice(1).map((end, i) => ({ start: points[i], end, at: i + 1 }));
  if (closed && points.length > 2) found.push({ start: points.at(-1), end: points[0], at: points.length });
  return found;
}

/** Left, right, lowest and highest of what is drawn; null: nothing is. */
export function bounds(scene) {
  const all = lines(scene).filter(({ kind }) => kind !== "water").flatMap(({ points }) => points);
  const zones = scene.zones.flatMap((zone) => zone.polygon);
  const used = zones.length ? zones : all;
  if (!used.length) return null;
  const pick = (choose, k) => choose(...used.map((place) => place[k]));
  return { left: pick(Math.min, 0), right: pick(Math.max, 0), low: pick(Math.min, 1), high: pick(Math.max, 1) };
}

/** Where the picture of a section ends below [m]. */
export function lowest(scene) {
  const base = scene.ground?.points ?? [];
  return Math.min(bounds(scene)?.low ?? 0, ...base.map(([, y]) => y)) - 1;
}

/** The domain; of a section that is being drawn: what a slide of it would need, or a first sheet. */
export function roomOf(scene) {
  if (scene.domain) return scene.domain;
  const found = bounds(scene);
  if (!found) return { x_min: -20, x_max: 80, y_max: 30 };
  const height = Math.max(found.high - found.low, 0.1 * (found.right - found.left));
  return { x_min: found.left - height, x_max: found.right + height, y_max: found.high + 0.5 * height };
}

export function area(ring) {
  return Math.abs(ring.reduce((sum, [x, y], i) => {
    const [u, v] = ring[(i + 1) % ring.length];
    return sum + 0.5 * (x * v - u * y);
  }, 0));
}

export function isInside(ring, [x, y]) {
  let inside = false;
  for (const { start: [a, b], end: [c, d] } of edges({ points: ring, closed: true })) {
    if ((b > y) !== (d > y) && x < a + ((y - b) / (d - b)) * (c - a)) inside = !inside;
  }
  return inside;
}

export function nearestVertex(scene, place, reach) {
  let found = null;
  for (const line of lines(scene)) {
    for (const point of line.points) {
      const far = distance(point, place);
      if (far <= reach && (!found || far < found.far)) found = { point, far };
    }
  }
  return found;
}

export function nearestEdge(scene, place, reach) {
  let found = null;
  for (const line of lines(scene)) {
    for (const edge of edges(line)) {
      const foot = footOn(edge, place);
      const far = distance(foot, place);
      if (far <= reach && (!found || far < found.far)) found = { ...edge, line, point: foot, far };
    }
  }
  return found;
}

/** The point of an edge that is nearest to a place. */
export function footOn({ start, end }, [x, y]) {
  const way = [end[0] - start[0], end[1] - start[1]];
  const length = way[0] ** 2 + way[1] ** 2;
  if (length === 0) return [...start];
  const share = Math.min(Math.max(((x - start[0]) * way[0] + (y - start[1]) * way[1]) / length, 0), 1);
  return [start[0] + share * way[0], start[1] + share * way[1]];
}

/** Move a vertex in every line that has it, or in one line alone. */
export function moveVertex(scene, from, to, only = null) {
  for (const line of lines(scene)) {
    if (only && !(line.kind === only.kind && line.number === only.number)) continue;
    line.points.forEach((point, i) => { if (same(point, from)) line.points[i] = [...to]; });
  }
}

/**
 * Put rows of numbers over the vertices of a line from number `i` on, in column `k`; more of them than vertices are added.
 *
 * A vertex that others share moves in all. Returns in words what was done; throws where a row has no vertex and is none.
 */
export function pasteVertices(scene, { kind, number }, i, k, rows) {
  const all = lines(scene);
  const own = all.find((line) => line.kind === kind && line.number === number);
  const closes = own.closed && i === 0 && rows.length > 3 && rows[0].length === 2 && same(rows[0], rows.at(-1));
  const fresh = closes ? rows.slice(0, -1) : rows;
  const count = own.points.length;
  if (fresh.length > count - i && fresh[0].length < 2) throw new Error(`${fresh.length} rows, where ${count - i} vertices are from here on`);
  const before = own.points.map((point) => [...point]);
  const after = fresh.map((row, r) => (row.length === 2 ? row : before[i + r].map((value, axis) => (axis === k ? row[0] : value))));
  const moved = after.slice(0, count - i);
  // At once: one of them may go to where another one was.
  for (const line of all) {
    line.points.forEach((point, n) => {
      const old = line === own ? n - i : before.findIndex((one, m) => m >= i && same(one, point)) - i;
      if (moved[old]) line.points[n] = [...moved[old]];
    });
  }
  own.points.splice(count, 0, ...after.slice(count - i).map((place) => [...place]));
  return [`${moved.length} moved`, after.length > moved.length ? `${after.length - moved.length} added` : "",
    count > i + fresh.length ? `${count - i - fresh.length} after them as before` : ""].filter(Boolean).join(", ");
}

/** A vertex in every line that passes a place without one. */
export function insertVertex(scene, place, reach = 1e-3) {
  for (const line of lines(scene)) {
    if (line.points.some((point) => same(point, place))) continue;
    const edge = edges(line).find((one) => distance(footOn(one, place), place) < reach);
    if (edge) line.points.splice(edge.at, 0, [...place]);
  }
}

/** Take a vertex out of every line that can do without; false: a zone would have fewer than three. */
export function removeVertex(scene, place) {
  const with_it = lines(scene).filter(({ points }) => points.some((point) => same(point, place)));
  if (with_it.some(({ points, fewest }) => points.length <= fewest)) return false;
  for (const { points } of with_it) {
    for (let i = points.length - 1; i >= 0; i -= 1) if (same(points[i], place)) points.splice(i, 1);
  }
  return true;
}

/** Add a zone; where it meets others, both get the vertices of both. */
export function addZone(scene, ring) {
  const names = new Set([...scene.zones.map(({ name }) => name), ...Object.keys(scene.materials)]);
  let number = scene.zones.length + 1;
  while (names.has(`zone_${number}`)) number += 1;
  const name = `zone_${number}`;
  scene.zones.push({ name, material: name, polygon: ring.map((place) => [...place]) });
  scene.materials[name] = {};
  for (const place of [...ring, ...scene.zones.flatMap(({ polygon }) => polygon)]) {
    for (const zone of scene.zones) {
      const line = { points: zone.polygon, closed: true };
      if (zone.polygon.some((point) => same(point, place))) continue;
      const edge = edges(line).find((one) => distance(footOn(one, place), place) < 1e-3);
      if (edge) zone.polygon.splice(edge.at, 0, [...place]);
    }
  }
  return scene.zones.length - 1;
}

/** Materials of some zones alone: one that other zones share is copied. */
export function ownMaterials(scene, zones) {
  const copies = {};
  const shared = (material) => scene.zones.some((zone) => zone.material === material && !zones.includes(zone.name));
  for (const zone of scene.zones.filter(({ name }) => zones.includes(name))) {
    const { material } = zone;
    if (!(material in copies)) {
      let copy = material;
      for (let k = 2; shared(material) && copy in scene.materials; k += 1) copy = `${material}_${k}`;
      scene.materials[copy] ??= structuredClone(scene.materials[material]);
      copies[material] = copy;
    }
    zone.material = copies[material];
  }
  return new Set(Object.values(copies));
}

/** Materials that no zone has any more. */
export function dropUnused(scene) {
  const used = new Set(scene.zones.map(({ material }) => material));
  for (const name of Object.keys(scene.materials)) if (!used.has(name)) delete scene.materials[name];
}
