// Questions about a case, the jobs that answer them, and their reports.

import { get, send } from "./api.js";

const $ = (id) => document.getElementById(id);

/**
 * Fills the questions and the list of jobs, and keeps the list up to date.
 * `state` has the workspace, the name of the case and the spacing; `say` shows a line.
 */
export function answers(state, say) {
  buildQuestions(state, say);
  watchJobs(say);
  $("close").addEventListener("click", () => $("report").close());
}

const QUESTIONS = [
  ["back_analyse", "Back-analyse", {}], ["back_analyse", "Quick", { quick: true }],
  ["posterior", "Posterior", {}], ["from_blow_counts", "From blow counts", {}], ["diagnose", "What is missing?", {}],
];

function buildQuestions(state, say) {
  $("ask").replaceChildren(...QUESTIONS.map(([kind, words, options], i) => {
    const button = Object.assign(document.createElement("button"), { textContent: words });
    button.title = `${state.workspace.job_kinds[kind]}, at the spacing chosen on the left`;
    if (i === 0) button.className = "main";
    button.addEventListener("click", async () => {
      try {
        await send("/api/jobs", { kind, case: state.name, options: { ...options, spacing_m: state.spacing } });
        watchJobs(say);
      } catch (error) { say(error.message, true); }
    });
    return button;
  }));
}

let watching = 0;

async function watchJobs(say) {
  clearTimeout(watching);
  let jobs = [];
  try { jobs = await get("/api/jobs"); } catch { /* the server is gone: said elsewhere */ }
  $("jobs").replaceChildren(...jobs.slice(0, 12).map((job) => jobLine(job, say)));
  watching = setTimeout(() => watchJobs(say), jobs.some(({ state: now }) => now === "running") ? 700 : 5000);
}

function jobLine(job, say) {
  const line = document.createElement("li");
  line.dataset.state = job.state;
  const at = job.options.spacing_m ? ` at ${job.options.spacing_m} m` : "";
  line.append(`${job.words}: ${job.case.replaceAll("_", " ")}${at}`);
  const note = Object.assign(document.createElement("div"), { className: "note" });
  const seconds = job.seconds === undefined ? "" : `, ${Math.round(job.seconds)} s`;
  note.textContent = [job.state + seconds, job.message].filter(Boolean).join(": ");
  line.append(note);
  if (job.state === "running") {
    const bar = document.createElement("progress");
    if (job.total) Object.assign(bar, { max: job.total, value: Math.min(job.done, job.total) });
    line.append(bar);
  }
  const buttons = Object.assign(document.createElement("div"), { className: "buttons" });
  const add = (words, act) => {
    const button = Object.assign(document.createElement("button"), { textContent: words });
    button.addEventListener("click", act);
    buttons.append(button);
  };
  const post = (what) => async () => {
    try { await send(`/api/jobs/${job.id}/${what}`, {}); } catch (error) { say(error.message, true); }
    watchJobs(say);
  };
  if (job.state === "running") add("Cancel", post("cancel"));
  if (["cancelled", "interrupted", "failed"].includes(job.state)) add("Go on", post("again"));
  if (job.state === "done" && job.files.includes("report.html")) {
    add("Open the report", () => {
      $("frame").src = `/api/jobs/${job.id}/files/report.html`;
      $("report").showModal();
    });
  }
  line.append(buttons);
  return line;
}
