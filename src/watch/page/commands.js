// Buttons. Hold acts at once; what may set the arm in motion is asked for twice or names a policy.

import { headers } from "./stream.js";

const byId = (id) => document.getElementById(id);
const SURE_MS = 4000;
// The tool waits 5 s for the controller.
const PATIENCE_MS = 8000;

function say(text, isBad) {
  byId("said").textContent = text;
  byId("said").className = isBad ? "bad" : "";
}

async function send(command) {
  const abort = new AbortController();
  const timer = setTimeout(() => abort.abort(), PATIENCE_MS);
  say(`${command.action} …`, false);
  try {
    const response = await fetch("command", {
      method: "POST",
      headers: headers({ "Content-Type": "application/json" }),
      body: JSON.stringify(command),
      signal: abort.signal,
    });
    const text = await response.text();
    say(response.ok ? JSON.parse(text).text : text.trim(), !response.ok);
  } catch (error) {
    const advice = command.action === "hold" ? " Run `skillet hold`, or stop the arm itself." : "";
    say(`${command.action} was not sent: ${error.message}.${advice}`, true);
  } finally {
    clearTimeout(timer);
  }
}

/** The first click asks, a second one within some seconds sends. */
function confirmed(button, act) {
  const label = button.textContent;
  let timer = null;
  const calm = () => {
    clearTimeout(timer);
    timer = null;
    button.classList.remove("sure");
    button.textContent = label;
  };
  button.addEventListener("click", () => {
    if (timer !== null) {
      calm();
      act();
      return;
    }
    button.classList.add("sure");
    button.textContent = button.dataset.sure;
    timer = setTimeout(calm, SURE_MS);
  });
}

let isPinned = false;

export function connectButtons() {
  byId("hold").addEventListener("click", () => send({ action: "hold" }));
  confirmed(byId("rearm"), () => send({ action: "rearm" }));
  confirmed(byId("rollback"), () => send({ action: "rollback" }));
  byId("pin").addEventListener("click", () => send({ action: isPinned ? "unpin" : "pin" }));
  byId("activate").addEventListener("click", () => {
    send({ action: "activate", policy_id: Number(byId("policies").value) });
  });
}

let isAllowed = false;

export function showCommands(allowed) {
  isAllowed = allowed;
  byId("may-not").hidden = allowed;
}

export function updateCommands({ status, catalogue }) {
  isPinned = status?.pinned ?? false;
  byId("pin").textContent = isPinned ? "Unpin" : "Pin";
  const { policies, error } = catalogue ?? { policies: [] };
  const list = byId("policies");
  const shown = [...list.options].map((option) => option.value).join();
  // An open list is not rebuilt under the pointer.
  if (shown !== policies.join() || list.options.length === 0) {
    const chosen = list.value;
    const options = policies.map((id) => new Option(`${id}`, id));
    list.replaceChildren(...(options.length ? options : [new Option(error ?? "none imported", "")]));
    if (policies.includes(Number(chosen))) list.value = chosen;
  }
  const may = isAllowed && Boolean(status);
  byId("activate").disabled = list.disabled = !may || policies.length === 0;
  byId("pin").disabled = byId("rollback").disabled = !may;
  byId("rearm").disabled = !may || !status.held;
}
