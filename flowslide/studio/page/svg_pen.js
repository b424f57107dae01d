// A pen that writes SVG in place of painting: the part of a canvas' context that the page uses.

const PRECISION = 2; // digits of a pixel
const px = (value) => Number(value.toFixed(PRECISION));
const safe = (text) => String(text).replace(/[&<>"]/g, (one) => ({ "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;" })[one]);

export class SvgPen {
  /** `measure` is a canvas' context, by which text is measured. */
  constructor(width, height, measure) {
    Object.assign(this, { width, height, measure, parts: [], kept: [], clips: 0, way: "",
      fillStyle: "#000", strokeStyle: "#000", lineWidth: 1, globalAlpha: 1, font: "11px sans-serif", textAlign: "left", dash: [] });
  }

  setTransform() { /* in pixels of the page alone */ }
  beginPath() { this.way = ""; }
  moveTo(x, y) { this.way += `M${px(x)} ${px(y)}`; }
  lineTo(x, y) { this.way += `${this.way ? "L" : "M"}${px(x)} ${px(y)}`; }
  closePath() { this.way += "Z"; }

  /** A whole circle: the page paints no other arcs. */
  arc(x, y, r) { this.way += `M${px(x - r)} ${px(y)}a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0`; }

  rect(x, y, width, height) { this.way += `M${px(x)} ${px(y)}h${px(width)}v${px(height)}h${px(-width)}Z`; }
  fill() { this.add("path", { d: this.way, fill: this.fillStyle, opacity: this.globalAlpha }); }
  stroke() {
    this.add("path", { d: this.way, fill: "none", stroke: this.strokeStyle, "stroke-width": this.lineWidth,
      "stroke-dasharray": this.dash.join(" ") || "none", opacity: this.globalAlpha });
  }

  fillRect(x, y, width, height) { this.add("rect", { x: px(x), y: px(y), width: px(width), height: px(height), fill: this.fillStyle, opacity: this.globalAlpha }); }
  setLineDash(dash) { this.dash = dash; }
  measureText(text) { this.measure.font = this.font; return this.measure.measureText(text); }

  fillText(text, x, y) {
    const [size, ...family] = this.font.split(" ");
    this.add("text", { x: px(x), y: px(y), fill: this.fillStyle, "font-size": size, "font-family": family.join(" "),
      "text-anchor": { center: "middle", right: "end" }[this.textAlign] ?? "start", opacity: this.globalAlpha }, safe(text));
  }

  drawImage(image, x, y, width, height) {
    const copy = Object.assign(document.createElement("canvas"), { width: image.naturalWidth, height: image.naturalHeight });
    copy.getContext("2d").drawImage(image, 0, 0);
    this.add("image", { x: px(x), y: px(y), width: px(width), height: px(height), href: copy.toDataURL("image/png"),
      preserveAspectRatio: "none", opacity: this.globalAlpha });
  }

  save() { this.kept.push({ ...this.state, clips: this.clips }); }
  restore() {
    const { clips, ...state } = this.kept.pop();
    this.parts.push("</g>".repeat(this.clips - clips));
    Object.assign(this, state, { clips });
  }

  clip() {
    const name = `clip${this.parts.length}`;
    this.parts.push(`<clipPath id="${name}"><path d="${this.way}"/></clipPath><g clip-path="url(#${name})">`);
    this.clips += 1;
  }

  get state() {
    const { fillStyle, strokeStyle, lineWidth, globalAlpha, font, textAlign, dash } = this;
    return { fillStyle, strokeStyle, lineWidth, globalAlpha, font, textAlign, dash };
  }

  add(tag, attributes, text = "") {
    const all = Object.entries(attributes).filter(([key, value]) => !(key === "opacity" && value === 1) && value !== "none" || key === "fill");
    this.parts.push(`<${tag} ${all.map(([key, value]) => `${key}="${safe(value)}"`).join(" ")}>${text}</${tag}>`);
  }

  get text() {
    const { width, height } = this;
    return `<svg xmlns="http://www.w3.org/2000/svg" width="${width}" height="${height}" viewBox="0 0 ${width} ${height}">\n${this.parts.join("\n")}\n</svg>\n`;
  }
}
