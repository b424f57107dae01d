// What is asked of zones follows them: a zone that is renamed or removed has its new name, or none, there as well.

import { dropUnused } from "./section.js";

const words = (name) => name.replaceAll("_", " ");

/** Whether a measurement, or its reading, takes part in the fit. */
export function isFitted(inversion, { name, held_out: heldOut, confidence }) {
  return Boolean(inversion) && (inversion.fit ? inversion.fit.includes(name) : !heldOut && confidence !== "constructed");
}

/** Give a zone another name, also in what is asked of it. */
export function renameZone(documents, number, name) {
  const zone = documents.scene.zones[number];
  const old = zone.name;
  zone.name = name;
  const whole = new RegExp(`\\b${words(old).replace(/[.*+?^${}()|[\]\\]/g, "\\$&")}\\b`, "g");
  walk(asked(documents), (node) => {
    if (Array.isArray(node.zones)) node.zones = node.zones.map((one) => (one === old ? name : one));
    if (node.zone === old) node.zone = name;
    if (typeof node.label === "string") node.label = node.label.replace(whole, () => words(name));
  });
}

/** Take a zone away, and what is asked of it alone. */
export function removeZone(documents, number) {
  const [{ name }] = documents.scene.zones.splice(number, 1);
  dropUnused(documents.scene);
  walk(asked(documents), (node) => {
    for (const [key, entries] of Object.entries(node)) {
      if (Array.isArray(entries)) node[key] = entries.filter((one) => !(one?.zone === name || (one?.zones?.length && one.zones.every((own) => own === name))));
    }
    if (Array.isArray(node.zones)) node.zones = node.zones.filter((one) => one !== name);
  });
  if (!documents.inversion?.parameters?.length) documents.inversion = null;
  if (!documents.blow_counts?.layers?.length) documents.blow_counts = null;
}

const asked = ({ inversion, diagnosis, blow_counts: counts }) => [inversion, diagnosis, counts];

function walk(node, act) {
  if (Array.isArray(node)) node.forEach((one) => walk(one, act));
  else if (node && typeof node === "object") {
    act(node);
    Object.values(node).forEach((one) => walk(one, act));
  }
}
