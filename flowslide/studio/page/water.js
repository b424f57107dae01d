// The water of a section: a pool on one side or on both, and the water table that follows from it.

import { bounds, edges, rounded, same } from "./section.js";

const AT_POOL = 0.05; // m, as in inversion/problem/scene_changes.py
const LEVEL = 0.02; // of the height of a section: ground that rises by less is level

/** The water table with the pool at another level: what stands at pool level moves with it. Null: it is level. */
export function waterTableAt(scene, level) {
  return scene.phreatic_line?.map(([x, y]) => [x, Math.abs(y - scene.water_level) <= AT_POOL ? level : y]) ?? null;
}

/** The upper outline of the zones, from left to right. */
export function surface(scene) {
  const rims = scene.zones.flatMap(({ polygon }) => edges({ points: polygon, closed: true }));
  const heightAt = (x) => Math.max(...rims.flatMap(({ start, end }) => {
    if (x < Math.min(start[0], end[0]) || x > Math.max(start[0], end[0])) return [];
    return start[0] === end[0] ? [start[1], end[1]] : [between(start, end, (x - start[0]) / (end[0] - start[0]))[1]];
  }));
  const places = new Set(scene.zones.flatMap(({ polygon }) => polygon.map(([x]) => x)));
  return [...places].sort((a, b) => a - b).map((x) => [x, heightAt(x)]);
}

const between = (a, b, share) => [a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])];

/**
 * The water table of a pool on one side: from where the pool meets the slope straight to the toe on the other side.
 *
 * Null: there is none, since the pool stands above the crest, or no toe lies lower than it.
 */
export function tableOfPool(scene, level, side) {
  if (!scene.zones.length) return null;
  const way = side === "left" ? surface(scene) : surface(scene).reverse();
  const wet = way.findIndex(([, y]) => y >= level);
  if (wet < 0) return null;
  const [low, high] = [way[Math.max(wet - 1, 0)], way[wet]];
  const shore = low[1] < level ? between(low, high, (level - low[1]) / (high[1] - low[1])) : [high[0], level];
  const { low: bottom, high: top } = bounds(scene);
  let toe = way.length - 1;
  while (toe > wet && way[toe - 1][1] - way.at(-1)[1] <= LEVEL * (top - bottom)) toe -= 1;
  const line = [rounded(shore), rounded(way[toe])];
  if (line[1][1] >= level || line[0][0] === line[1][0]) return null;
  return side === "left" ? line : line.reverse();
}

/** Where the pool stands: "left", "right", "both", or "drawn", by a water table of its own; null: there is no water. */
export function poolSide(scene) {
  const { water_level: level, phreatic_line: line } = scene;
  if (level === null || level === undefined) return null;
  if (!line) return "both";
  if (line.length !== 2) return "drawn";
  return ["left", "right"].find((side) => {
    const own = tableOfPool(scene, level, side);
    return own && own.every((place, i) => same(place, line[i]));
  }) ?? "drawn";
}

/** Set the pool: its level, and the side on which it stands. */
export function setPool(scene, level, side) {
  const table = { left: () => tableOfPool(scene, level, "left"), right: () => tableOfPool(scene, level, "right"),
    both: () => null, drawn: () => waterTableAt(scene, level) }[side];
  Object.assign(scene, { phreatic_line: level === null ? null : table(), water_level: level });
}

/** A water table that follows from the pool follows the section as well, where an edit has changed that alone. */
export function followSection(before, after) {
  const side = poolSide(before);
  const isSame = (key) => JSON.stringify(before[key]) === JSON.stringify(after[key]);
  if (!["left", "right"].includes(side) || isSame("zones") || !isSame("phreatic_line") || !isSame("water_level")) return;
  after.phreatic_line = tableOfPool(after, after.water_level, side) ?? after.phreatic_line;
}

/** What is assumed of the water, in a sentence. */
export function waterWords(scene) {
  const { water_level: level, phreatic_line: line } = scene;
  const side = poolSide(scene);
  if (side === null) return "";
  if (side === "both") return `Water stands at ${level} m on both sides.`;
  if (side === "drawn") return `The pool stands at ${level} m; the water table is as drawn.`;
  const [x, y] = side === "left" ? line.at(-1) : line[0];
  return `The pool stands at ${level} m on the ${side} side alone; the water table falls straight to the toe at ${x}, ${y}: assumed.`;
}
