// Hatches of soils as sections have them: they tell soils apart in print and to who sees no colours.

const KINDS = {
  sand: /sand|shell/, gravel: /gravel|filter|drain|riprap|rock ?fill/, silt: /silt|slime|tailing/, clay: /clay|core|puddle/,
  rock: /rock|shale|till|bedrock/, fill: /fill|embankment|dike|dam/,
};
const OTHERS = ["stripes", "sand", "fill", "silt", "clay", "gravel"]; // of soils whose name says nothing
const PITCH = 9; // pixels

/** The hatch of a soil: that of its name, else one that others beside it do not have. */
export function hatchOf(material, number) {
  const name = material.replaceAll("_", " ").toLowerCase();
  return Object.keys(KINDS).find((kind) => KINDS[kind].test(name)) ?? OTHERS[number % OTHERS.length];
}

/** What a hatch draws around a place of its grid. */
const MARKS = {
  sand(pen, x, y) { pen.rect(x - 0.7, y - 0.7, 1.4, 1.4); },
  gravel(pen, x, y) { pen.moveTo(x + 2, y); pen.arc(x, y, 2, 0, 7); },
  silt(pen, x, y) { pen.moveTo(x - 2.5, y); pen.lineTo(x + 2.5, y); },
  clay(pen, x, y) { pen.moveTo(x - PITCH / 2, y + PITCH / 2); pen.lineTo(x + PITCH / 2, y - PITCH / 2); },
  fill(pen, x, y) { pen.moveTo(x - 2.5, y - 2.5); pen.lineTo(x + 2.5, y + 2.5); },
  stripes(pen, x, y) { pen.moveTo(x - PITCH / 2, y); pen.lineTo(x + PITCH / 2, y); },
  rock(pen, x, y) { pen.moveTo(x - 2.5, y); pen.lineTo(x + 2.5, y); pen.moveTo(x, y - 2.5); pen.lineTo(x, y + 2.5); },
};

/** Paint the hatch `kind` into a ring of pixels; it is fixed to `origin`, which moves with the section. */
export function paintHatch(pen, kind, ring, origin, { width, height }) {
  const ends = (k, most) => [Math.max(Math.min(...ring.map((one) => one[k])), 0), Math.min(Math.max(...ring.map((one) => one[k])), most)];
  const [[left, right], [top, foot]] = [ends(0, width), ends(1, height)];
  if (left >= right || top >= foot) return;
  pen.save();
  pen.beginPath();
  ring.forEach(([x, y], i) => { if (i) pen.lineTo(x, y); else pen.moveTo(x, y); });
  pen.closePath();
  pen.clip();
  pen.beginPath();
  const [x0, y0] = origin.map((at) => ((at % PITCH) + PITCH) % PITCH);
  const staggered = !["clay", "stripes"].includes(kind);
  for (let j = Math.floor((top - y0) / PITCH); y0 + j * PITCH < foot + PITCH; j += 1) {
    // Every other row by half a step; which one, the section says.
    const odd = staggered && Math.round(j - (origin[1] - y0) / PITCH) % 2 ? PITCH / 2 : 0;
    for (let x = x0 + odd + PITCH * Math.floor((left - x0 - odd) / PITCH); x < right + PITCH; x += PITCH) MARKS[kind](pen, x, y0 + j * PITCH);
  }
  if (kind === "sand") pen.fill(); else pen.stroke();
  pen.restore();
}
