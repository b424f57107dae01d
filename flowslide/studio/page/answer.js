// Questions about a case, the jobs that answer them, what they found, and their reports.

import { bytes, get, pauseAfter, send } from "./api.js";
import { draw, historyChart, impliedChart, rankingChart } from "./charts.js";
import { asValues, namedEffects, switches, tellSwitches } from "./effect_switches.js";
import { askStrengths } from "./predict.js";
import { download } from "./saving.js";
import { el } from "./ui.js";

const $ = (id) => document.getElementById(id);

/** [kind of job, words, options], by what is asked. */
const QUESTIONS = [
  ["Which strength?", [
    ["back_analyse", "Back-analyse", {}], ["back_analyse", "Quick", { quick: true }],
    ["posterior", "Posterior", {}], ["classical", "Classical methods", {}],
  ]],
  ["How far would it run?", [
    ["predict", "Predict ...", {}], ["from_blow_counts", "From blow counts", {}], ["simulate", "Simulate", {}],
  ]],
  ["Is the model enough?", [
    ["compare", "Compare", {}], ["explain", "Explain", {}], ["diagnose", "What is missing?", {}],
  ]],
];

const OVERVIEW = "overview.svg"; // the picture of a diagnosis

let state, say, slide, watching, jobs = [], tries = 0;
const lines = new Map(); // number of a job -> { json, line }

/**
 * Fills the questions and the list of jobs, and keeps the list up to date.
 * `page` has the workspace, the case that is open and the spacing; `tell` shows a line; `shown` is the slide,
 * on which an answer is shown and from which it is kept.
 */
export function answers(page, tell, shown) {
  state = page;
  say = tell;
  slide = shown;
  buildQuestions();
  watchJobs();
  document.addEventListener("effects", () => tellSwitches($("jobs"), state));
  $("close").addEventListener("click", () => $("report").close());
  return { refresh: watchJobs, tell: tellRunning, start };
}

/** A job on what is open: a section and a body may have the same name. */
const isOurs = (job) => job.case === state.name && Boolean(job.body) === Boolean(state.body);

// --- questions ---

function buildQuestions() {
  $("ask").replaceChildren(...QUESTIONS.map(([words, group]) => el("div", { "data-words": words },
    el("span", { textContent: words }),
    ...group.map(([kind, label, options]) => {
      const button = el("button", { textContent: label, className: label === "Back-analyse" ? "main" : "" });
      Object.assign(button.dataset, { kind, label, quick: options.quick ?? false });
      button.addEventListener("click", async () => {
        if (kind === "predict") { predict(); return; }
        button.disabled = true; // a second press would ask twice
        await start(kind, options);
        tellRunning();
      });
      return button;
    }))));
  tellRunning();
}

/** A question that is being answered is not asked again, at the same spacing. */
function tellRunning() {
  for (const button of $("ask").querySelectorAll("button")) {
    const { kind, label, quick } = button.dataset;
    const now = kind === "predict" ? null : jobs.find((job) => ["running", "waiting"].includes(job.state) && isOurs(job)
      && job.kind === kind && String(job.options.quick) === quick && (kind === "classical" || job.options.spacing_m === state.spacing));
    const words = now ? `${label}: ${now.state}` : label;
    if (button.textContent !== words) button.textContent = words;
    const lacks = state.body ? state.found?.asks[kind] ?? "not in three dimensions" : state.found?.faults[0]?.message ?? "";
    button.hidden = state.body && !(kind in (state.found?.asks ?? {}));
    button.disabled = Boolean(now || lacks);
    button.title = lacks || state.workspace.job_kinds[kind] + (kind === "classical" ? "" : ", at the spacing chosen on the left");
  }
  for (const group of $("ask").children) {
    const shown = [...group.querySelectorAll("button")].filter(({ hidden }) => !hidden);
    group.hidden = !shown.length;
    // What a body lacks is said where it is asked; what is to be mended in a section, once.
    const lacks = state.body && shown.find(({ dataset }) => state.found.asks[dataset.kind]);
    const fault = state.body || group !== $("ask").firstChild ? "" : state.found?.faults[0]?.message;
    const words = group.dataset.words + (lacks ? ` It ${state.found.asks[lacks.dataset.kind]}.` : fault ? ` First to be mended: ${fault}.` : "");
    if (group.firstChild.textContent !== words) group.firstChild.textContent = words;
  }
}

async function start(kind, options) {
  try {
    const spacing = kind === "classical" ? {} : { spacing_m: state.spacing };
    const own = state.body && kind === "simulate" ? { strengths_kpa: state.changes.strengths_kpa } : {};
    await send("/api/jobs", { kind, case: state.name, body: Boolean(state.body), options: { ...options, ...spacing, ...own } });
    await watchJobs();
    const waits = jobs[0]?.state === "waiting" ? "waits for the job that runs" : "started";
    say(`${state.workspace.job_kinds[kind]}: ${waits}`);
    return "";
  } catch (error) {
    say(error.message, true);
    return error.message;
  }
}

function predict() {
  askStrengths(state, ofThisCase(), (options) => start("predict", options));
}

/** Jobs that are done, on the case as it is now; the newest first. */
function ofThisCase() {
  return jobs.filter((job) => isShown(job));
}

// --- jobs ---

async function watchJobs() {
  clearTimeout(watching);
  const before = jobs;
  try { jobs = await get("/api/jobs"); tries = 0; } catch { tries += 1; /* the server is gone: said elsewhere */ }
  const ended = jobs.find((job) => ["done", "failed"].includes(job.state)
    && before.some((one) => one.id === job.id && one.state === "running"));
  // Those of other cases as long as this one may have to wait for them.
  const shown = jobs.filter((job) => isOurs(job) || ["running", "waiting"].includes(job.state)).slice(0, 12);
  const focused = document.activeElement;
  const held = { job: focused?.closest("#jobs > li")?.dataset.job, words: wordsOf(focused) };
  for (const number of lines.keys()) {
    if (!shown.some((job) => job.id === number)) lines.delete(number);
  }
  for (const job of shown) {
    // What has not changed stays as it is, so that the keyboard keeps its place.
    const json = JSON.stringify([job, isOld(job), isOurs(job), isNewest(job)]);
    const old = lines.get(job.id);
    if (old?.json !== json) lines.set(job.id, { json, line: unfoldedAs(old?.line, jobLine(job)) });
  }
  const wanted = shown.map((job) => lines.get(job.id).line);
  if (wanted.some((line, i) => $("jobs").children[i] !== line) || wanted.length !== $("jobs").children.length) {
    $("jobs").replaceChildren(...wanted);
    if (held.job) {
      const again = lines.get(held.job)?.line.querySelectorAll("button, a, summary") ?? [];
      [...again].find((one) => wordsOf(one) === held.words)?.focus();
    }
  }
  tellRunning();
  showStrengths();
  if (ended && lines.has(ended.id)) tellEnd(ended);
  if (ended && isOurs(ended)) slide.ended(ended);
  const isBusy = jobs.some(({ state: now }) => ["running", "waiting"].includes(now));
  watching = setTimeout(watchJobs, tries ? pauseAfter(tries) : isBusy ? 700 : 5000);
}

/** What a button is known by when its line is made again: a summary counts, and its words change. */
const wordsOf = (one) => one?.closest("summary")?.parentNode.dataset.key ?? one?.ariaLabel ?? one?.textContent;

/** A line that is made again while its job runs: what somebody has folded stays so. */
function unfoldedAs(before, line) {
  for (const one of before?.dataset.state === line.dataset.state ? before.querySelectorAll("details") : []) {
    const same = line.querySelector(`details[data-key="${one.dataset.key}"]`);
    if (same) same.open = one.open;
  }
  return line;
}

/** An answer is said where somebody looks, and brought into sight. */
function tellEnd(job) {
  say(`${job.words}: ${job.answer?.[0] ?? job.message}`, job.state === "failed");
  lines.get(job.id).line.scrollIntoView({ block: "nearest" });
}

/** It is done, on the case as it is and is shown. */
const isShown = (job) => job.state === "done" && isOurs(job) && Boolean(state.found) && !isOld(job);

/** It is on files that are no more; those that differ by an answer that was kept alone are the same to it. */
const isOld = (job) => isOurs(job) && Boolean(state.found) && ![job.revision, ...job.kept].includes(state.found.revision);

/** The newest answer of its kind is unfolded, those before it are not. */
const isNewest = (job) => jobs.find((one) => one.state === "done" && one.kind === job.kind) === job;

function jobLine(job) {
  const line = el("li");
  line.dataset.state = job.state;
  line.dataset.job = job.id;
  const quick = job.options.quick ? ", quick" : "";
  const at = job.options.spacing_m ? ` at ${job.options.spacing_m} m` : "";
  const solid = job.body ? ", three dimensions" : "";
  line.append(`${job.words}${quick}: ${job.case.replaceAll("_", " ")}${solid}${at}${strengthWords(job.options)}`);
  if (job.answer) line.append(el("div", { className: "found" }, ...job.answer.map((text) => el("p", { textContent: text }))));
  const seconds = job.seconds === undefined ? "" : `, ${Math.round(job.seconds)} s`;
  const counted = job.state === "running" && job.total ? `, ${doneWords(job)}${timeLeft(job.left_s)}` : "";
  const note = [job.state + seconds + counted, job.message].filter(Boolean).join(": ");
  line.append(el("div", { className: "note state", textContent: note }));
  if (isOld(job)) line.append(el("div", { className: "note", textContent: "the case has changed since" }));
  if (job.state === "running") {
    const bar = el("progress");
    bar.setAttribute("aria-label", job.words);
    if (job.total) Object.assign(bar, { max: job.total, value: Math.min(job.done, job.total) });
    line.append(bar);
  }
  if (job.state === "done" && job.files.includes(OVERVIEW)) line.append(overview(job));
  if (job.ranking?.length) line.append(rankingChart(job));
  if (job.effects?.each.length && isShown(job)) line.append(switches(job, state, slide));
  line.append(...(job.implied ?? []).map((one) => impliedChart(one, isNewest(job))));
  if (job.history?.length) line.append(historyChart(job.history, job.state));
  line.append(jobButtons(job));
  return line;
}

/** How far a job is: a simulation counts the seconds of its slide. */
function doneWords({ kind, done, total }) {
  return kind === "simulate" ? `${done} of at most ${total} s of motion` : `${done} of about ${total} simulations`;
}

/** Strengths with which a body is simulated, where they are not its own. */
function strengthWords({ strengths_kpa: strengths = {} }) {
  return Object.entries(strengths).map(([name, value]) => `, ${name.replaceAll("_", " ")} ${value} kPa`).join("");
}

function timeLeft(seconds) {
  if (!seconds) return "";
  return seconds < 90 ? `, about ${Math.ceil(seconds / 10) * 10} s left` : `, about ${Math.round(seconds / 60)} min left`;
}

function jobButtons(job) {
  const buttons = el("div", { className: "buttons" });
  const add = (words, act) => {
    const button = el("button", { textContent: words });
    button.addEventListener("click", act);
    buttons.append(button);
  };
  const post = (what) => async () => {
    try { await send(`/api/jobs/${job.id}/${what}`, {}); } catch (error) { say(error.message, true); }
    watchJobs();
  };
  if (["running", "waiting"].includes(job.state)) add("Cancel", post("cancel"));
  if (["cancelled", "interrupted", "failed"].includes(job.state)) add("Go on", post("again"));
  if (job.values?.length && isShown(job)) {
    add("Show it", () => slide.showValues(job.values, job.options.spacing_m));
    if (!state.found.shipped && !state.body) add("Keep it", () => slide.keepAnswer(job.id, job.values));
  }
  if (job.effects && isShown(job)) {
    const [named, values] = [namedEffects(job, state), asValues(job.effects.final, state)];
    // With a part of what was found together the picture would be of nothing: the switches show the parts.
    if (named) add("Show it", () => slide.showEffects(named, values, job.options.spacing_m));
    if (named && job.effects.is_result && !state.found.shipped) add("Keep it", () => slide.keepAnswer(job.id, values, named));
  }
  const maps = job.files.find((file) => file.endsWith(".bin"));
  if (job.state === "done" && maps && isOurs(job) && state.found) add("Show it", () => slide.showMaps(job, maps));
  if (job.state === "done" && job.page) {
    add("Open the report", () => open(job, job.page));
    add("PDF", () => print(job));
  }
  const film = job.files.find((file) => file.endsWith(".gif"));
  if (job.state === "done" && film) add("Watch the film", () => open(job, film));
  return buttons;
}

/** The picture of a diagnosis; a click opens the report, which begins with it. */
function overview(job) {
  const alt = "The diagnosis in one picture: measurements before and after, what explains them, and the strength by each";
  const button = el("button", { className: "overview", title: "Open the report" }, el("img", { src: `/api/jobs/${job.id}/files/${OVERVIEW}`, alt }));
  button.addEventListener("click", () => open(job, job.page));
  return button;
}

function open(job, file) {
  $("frame").src = `/api/jobs/${job.id}/files/${file}`;
  $("report").showModal();
}

async function print(job) {
  say("printing the report ...");
  try {
    const pdf = new Blob([await bytes(`/api/jobs/${job.id}/pdf`)], { type: "application/pdf" });
    say(`${download(pdf, `${job.case}-${job.kind}.pdf`)} is with your downloads`);
  } catch (error) { say(error.message, true); }
}

// --- the table of strengths ---

function rangeWords({ low, high }) {
  if (low === null && high === null) return "";
  return high === null ? `from ${low.toFixed(1)}` : `${(low ?? 0).toFixed(1)} to ${high.toFixed(1)}`;
}

/** The newest strength by every method, on the case as it is. */
function showStrengths() {
  const newest = new Map();
  for (const job of ofThisCase()) {
    for (const one of job.strengths ?? []) {
      const key = `${one.method}, ${one.label}`;
      if (!newest.has(key)) newest.set(key, one);
    }
  }
  const rank = ({ method }) => -["diagnosis", "posterior", "back-analysis"].findIndex((own) => method.startsWith(own));
  const rows = [...newest.values()].sort((a, b) => rank(a) - rank(b));
  const json = JSON.stringify(rows);
  if ($("strengths").dataset.json === json) return;
  $("strengths").dataset.json = json;
  const most = Math.max(...rows.flatMap((one) => [one.value, one.high ?? 0])) * 1.02;
  const several = new Set(rows.map((one) => one.label)).size > 1;
  const body = rows.map((one) => {
    const bar = draw("svg", { viewBox: "0 0 88 12", width: 88, height: 12, "aria-hidden": "true" });
    const at = (value) => 3 + (82 * value) / most;
    const [low, high] = [one.low ?? one.value, one.high ?? (one.low === null ? one.value : most)];
    bar.append(draw("line", { class: "range", x1: at(low), x2: at(high), y1: 6, y2: 6 }));
    bar.append(draw("circle", { class: "value", cx: at(one.value), cy: 6, r: 3 }));
    const row = el("tr", { title: `${one.label}; range: ${one.range}` },
      el("td", { textContent: several ? `${one.method}: ${one.label}` : one.method }),
      el("td", { textContent: (one.high === null && one.low !== null ? "≥ " : "") + one.value.toFixed(1) }),
      el("td", { className: "range" }, bar, rangeWords(one)));
    return row;
  });
  const head = el("thead", {}, el("tr", {}, ...["strength by", "kPa", "range, kPa"].map((text) => el("th", { textContent: text }))));
  $("strengths").replaceChildren(...(rows.length ? [el("table", {}, head, el("tbody", {}, ...body))] : []));
}
