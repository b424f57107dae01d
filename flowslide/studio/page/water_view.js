// Paints the water of a section: what is below the water table, and the table as a line above the zones.

import { bounds, lowest, roomOf } from "./section.js";
import { css } from "./ui.js";
import { waterTableAt } from "./water.js";

/** The water table from end to end of the domain; null: there is no water. */
function waterTable({ scene, level: moved }) {
  const domain = roomOf(scene);
  const level = moved ?? scene.water_level;
  if (level === null || level === undefined) return null;
  const line = waterTableAt(scene, level) ?? [[domain.x_min, level]];
  const within = line.filter(([x]) => x > domain.x_min && x < domain.x_max);
  return [[domain.x_min, heightOn(line, domain.x_min)], ...within, [domain.x_max, heightOn(line, domain.x_max)]];
}

export function paintWater(view, pen) {
  const line = waterTable(view);
  if (!line) return;
  const low = lowest(view.scene);
  pen.fillStyle = css("--water");
  pen.globalAlpha = 0.22;
  view.path(pen, [[line[0][0], low], ...line, [line.at(-1)[0], low]]);
  pen.fill();
  pen.globalAlpha = 1;
}

/** The water table as a line above the zones, with the usual triangle on the pool and in the soil. */
export function paintWaterTable(view, pen) {
  const line = waterTable(view);
  if (!line) return;
  pen.strokeStyle = css("--water-line");
  pen.lineWidth = 1.8;
  const dry = bounds(view.scene)?.low ?? -Infinity;
  for (const [i, end] of line.slice(1).entries()) {
    if (Math.max(line[i][1], end[1]) <= dry) continue; // below the section, where there is no water to be seen
    view.path(pen, [line[i], end]);
    pen.stroke();
  }
  for (const x of triangles(view, line)) paintTriangle(pen, view.pixel([x, heightOn(line, x)]));
}

/** Places x of the triangles: beside the section where water stands on the ground, and where it passes the crest. */
function triangles({ scene, box }, line) {
  if (!scene.zones.length) return [0.5 * (line[0][0] + line.at(-1)[0])];
  const found = bounds(scene);
  const aside = 25 * box[2];
  const foot = found.low + 0.02 * (found.high - found.low);
  const crest = scene.zones.flatMap(({ polygon }) => polygon).reduce((best, place) => (place[1] > best[1] ? place : best));
  return [found.left - aside, crest[0], found.right + aside].filter((x) => heightOn(line, x) > foot);
}

function paintTriangle(pen, [x, y]) {
  pen.beginPath();
  pen.moveTo(x, y);
  pen.lineTo(x - 5, y - 9);
  pen.lineTo(x + 5, y - 9);
  pen.closePath();
  for (const [half, below] of [[5, 3], [2.5, 6]]) { pen.moveTo(x - half, y + below); pen.lineTo(x + half, y + below); }
  pen.stroke();
}

/** Height of a line at x, level beyond its ends. */
function heightOn(line, x) {
  const i = line.findIndex(([end]) => end >= x);
  if (i < 1) return line.at(i)[1];
  const [[a, y], [b, z]] = [line[i - 1], line[i]];
  return y + ((x - a) / (b - a)) * (z - y);
}
