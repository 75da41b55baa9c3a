// Health, learner and policies as text.

import { updateCommands } from "./commands.js";

const byId = (id) => document.getElementById(id);
const HEALTH = { ok: "ok", degraded: "degraded", bad: "bad" };

/** Everything comes from the tool as text and is shown as text, never as HTML. */
function element(name, text) {
  const made = document.createElement(name);
  made.textContent = text;
  return made;
}

function pairs(list, rows) {
  list.replaceChildren(...rows.flatMap(([name, text]) => [element("dt", name), element("dd", text)]));
}

const number = (value, digits = 3) => (value == null ? "none" : value.toFixed(digits));
const ago = (seconds) => (seconds == null ? "" : `, ${seconds.toFixed(1)} s ago`);

export function showState(line) {
  byId("banner").hidden = true;
  showHealth(line);
  pairs(byId("learner"), learner(line));
  pairs(byId("policy"), policy(line));
  byId("measures-card").hidden = line.measures.length === 0;
  pairs(byId("measures"), line.measures.map(({ name, text }) => [name, text]));
  showModes(line.modes);
  updateCommands(line);
}

/** The numbers on the page are old from now on. */
export function showGone(text) {
  byId("banner").textContent = text;
  byId("banner").hidden = false;
  const health = byId("health");
  health.textContent = "disconnected";
  health.className = "chip bad";
}

function showHealth(line) {
  const health = byId("health");
  health.textContent = HEALTH[line.health] ?? "waiting for the controller";
  health.className = `chip ${line.health ?? ""}`;
  const { status } = line;
  const tick = line.tick_age_s >= 1.5 ? `tick ${line.tick}${ago(line.tick_age_s)}` : `tick ${line.tick}`;
  const parts = [`controller ${line.controller}`, line.phase, tick];
  if (line.way) parts.push(line.way);
  if (status) parts.push(status.pace, `${line.deadline_misses} deadlines missed`);
  byId("loop").textContent = parts.join(" · ");
  const findings = [...(line.findings ?? []), ...(status?.notes ?? [])];
  byId("findings-card").hidden = findings.length === 0;
  byId("findings").replaceChildren(...findings.map((text) => element("li", text)));
}

function learner(line) {
  const rows = [["state", line.learner + (line.learner === "absent" ? "" : `, heard${ago(line.learner_age_s).slice(1)}`)]];
  if (line.rollouts > 0) {
    rows.push(["rollout", `${line.rollout} of ${line.rollouts}${ago(line.trial_age_s)}`]);
    rows.push(["best reward", line.best ? `${number(line.best.reward)} at rollout ${line.best.rollout}` : "none"]);
    rows.push(["success", `${(100 * line.success_last20).toFixed(0)} % of the last 20 draws`]);
  }
  return rows;
}

function policy({ status }) {
  if (!status) return [["in the loop", "unknown"]];
  return [
    ["in the loop", status.in_loop],
    ["active", status.active + (status.pinned ? ", pinned" : "")],
    ["last good", status.last_good],
    ["held", status.held ?? "no"],
  ];
}

function showModes(modes) {
  byId("modes-card").hidden = modes.length === 0;
  const row = (name, cells) => {
    const made = document.createElement("tr");
    made.append(...cells.map((cell) => element(name, cell)));
    return made;
  };
  const rows = modes.map((mode, i) => row("td", [
    `${i + 1}${mode.forbidden ? " (forbidden)" : ""}`,
    `${(100 * mode.share).toFixed(0)} %`,
    `${mode.trials}`,
    mode.best_rollout > 0 ? `${number(mode.best_reward)} at ${mode.best_rollout}` : "none",
    number(mode.tolerance),
  ]));
  byId("modes").replaceChildren(row("th", ["mode", "share", "trials", "best", "tolerance"]), ...rows);
}
