// The link's token, and the stream of lines from the tool.

/** From the link's fragment, kept for reloads of this tab only. */
function findToken() {
  const given = new URLSearchParams(location.hash.slice(1)).get("token");
  if (given) {
    sessionStorage.setItem("token", given);
    // Not in a screenshot or in what is copied from the address bar.
    history.replaceState(null, "", location.pathname);
  }
  return given ?? sessionStorage.getItem("token") ?? "";
}

const token = findToken();
// A dead connection is replaced: the tool sends something every second.
const SILENT_MS = 5000;
const AGAIN_MS = 1000;

export function headers(more = {}) {
  return { "X-Skillet-Token": token, ...more };
}

/** Calls `onLine` with every object, and `onGone` with a reason whenever the stream ends. */
export async function follow(onLine, onGone) {
  for (;;) {
    const reason = await once(onLine).catch((error) => ({ text: `Disconnected (${error.message}); trying again.` }));
    onGone(reason.text);
    if (reason.final) return;
    await new Promise((resolve) => setTimeout(resolve, AGAIN_MS));
  }
}

async function once(onLine) {
  const abort = new AbortController();
  let watchdog = setTimeout(() => abort.abort(), SILENT_MS);
  try {
    const response = await fetch("stream", { headers: headers(), signal: abort.signal });
    if (response.status === 401) {
      return { text: "This link is not valid: open the one that `skillet watch --web` has printed.", final: true };
    }
    if (!response.ok) return { text: (await response.text()).trim() };
    const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
    for (let rest = "";;) {
      const { done, value } = await reader.read();
      if (done) return { text: "`skillet watch --web` has ended; trying again." };
      clearTimeout(watchdog);
      watchdog = setTimeout(() => abort.abort(), SILENT_MS);
      const lines = (rest + value).split("\n");
      rest = lines.pop();
      for (const line of lines) if (line) onLine(JSON.parse(line));
    }
  } finally {
    clearTimeout(watchdog);
    abort.abort();
  }
}
