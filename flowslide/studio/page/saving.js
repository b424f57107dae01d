// What is seen, as a file: a picture (PNG, SVG) with its legend, or its numbers (CSV).

import { SvgPen } from "./svg_pen.js";
import { css, el } from "./ui.js";

const SHARP = 2; // pixels of a PNG for one of the page
const FOOT = 26; // pixels below the section, for a line of the legend

/** Save what a view shows; `name` is that of the file without its end. Returns the name of the file. */
export async function saveView(kind, view, name) {
  const content = { png: pngOf, svg: svgOf, csv: csvOf }[kind](view);
  return download(await content, `${name}.${kind}`);
}

/** Put something among the downloads; returns the name of the file. */
export function download(content, name) {
  const link = el("a", { href: URL.createObjectURL(content), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  return name;
}

function pngOf(view) {
  const { width, height } = sizeOf(view);
  const sheet = Object.assign(document.createElement("canvas"), { width: SHARP * width, height: SHARP * height });
  paintSheet(view, sheet.getContext("2d"), SHARP);
  return new Promise((resolve) => { sheet.toBlob(resolve, "image/png"); });
}

function svgOf(view) {
  const { width, height } = sizeOf(view);
  const pen = new SvgPen(width, height, view.canvas.getContext("2d"));
  paintSheet(view, pen, 1);
  return new Blob([pen.text], { type: "image/svg+xml" });
}

function sizeOf({ canvas, legend }) {
  return { width: canvas.clientWidth, height: canvas.clientHeight + Math.max(FOOT, legend.clientHeight) };
}

/** The section as it is seen, on paper, with the legend below. */
function paintSheet(view, pen, ratio) {
  const { width, height } = sizeOf(view);
  const { clientHeight: high } = view.canvas;
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.fillStyle = css("--paper");
  pen.fillRect(0, 0, width, height);
  pen.save();
  pen.beginPath();
  pen.rect(0, 0, width, high);
  pen.clip();
  view.paintOn(pen, ratio);
  pen.restore();
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  paintLegend(view, pen, high);
}

/** Where the page has its marks and words, the sheet has them too. */
function paintLegend({ legend }, pen, top) {
  const place = legend.getBoundingClientRect();
  pen.font = "12px system-ui, sans-serif";
  pen.textAlign = "left";
  for (const mark of legend.querySelectorAll("i, .scale")) {
    const { left, top: above, width, height } = mark.getBoundingClientRect();
    const stops = mark.style.backgroundImage.match(/rgb\([^)]*\)/g) ?? [mark.style.backgroundColor];
    stops.forEach((colour, k) => {
      pen.fillStyle = colour;
      pen.fillRect(left - place.left + (k * width) / stops.length, top + above - place.top, width / stops.length, height);
    });
  }
  pen.fillStyle = css("--soft");
  const texts = document.createTreeWalker(legend, NodeFilter.SHOW_TEXT);
  for (let node = texts.nextNode(); node; node = texts.nextNode()) {
    const range = document.createRange();
    range.selectNodeContents(node);
    const { left, bottom } = range.getBoundingClientRect();
    pen.fillText(node.data.trim(), left - place.left, top + bottom - place.top - 4);
  }
}

/** Points of the deposit in the frame that is shown, else the vertices of the zones, as they can be imported. */
function csvOf(view) {
  const { scene, deposit } = view;
  const rows = deposit ? pointRows(view) : vertexRows(scene);
  return new Blob([rows.map((row) => `${row.map(cell).join(",")}\n`).join("")], { type: "text/csv" });
}

const cell = (value) => (/[",\n]/.test(value) ? `"${String(value).replaceAll('"', '""')}"` : value);

function vertexRows({ zones, materials }) {
  const keys = [...new Set(Object.values(materials).flatMap((soil) => Object.keys(soil)))].filter((key) => key !== "pre_failure");
  return [["zone", "x", "y", "material", ...keys], ...zones.flatMap(({ name, material, polygon }) =>
    polygon.map(([x, y]) => [name, x, y, material, ...keys.map((key) => materials[material][key] ?? "")]))];
}

function pointRows(view) {
  const { scene, deposit } = view;
  const n = deposit.header.points;
  const place = view.placesOf(n);
  const speed = deposit.speed.subarray(Math.floor(view.frame) * n);
  const head = ["x_m", "y_m", "zone", "displacement_m", "speed_m_per_s", "plastic_shear_strain"];
  return [head, ...Array.from({ length: n }, (_, i) => {
    const [x, y] = [place(2 * i), place(2 * i + 1)];
    const moved = Math.hypot(x - deposit.initial[2 * i], y - deposit.initial[2 * i + 1]);
    return [x.toFixed(3), y.toFixed(3), scene.zones[deposit.zone[i]].name, moved.toFixed(3), speed[i].toFixed(3), deposit.plastic_strain[i].toFixed(4)];
  })];
}
