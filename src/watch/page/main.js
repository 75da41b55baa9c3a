// The browser view of a cell: hands every line of the stream to what shows it.

import { follow } from "./stream.js";
import { Curves } from "./curves.js";
import { connectButtons, showCommands } from "./commands.js";
import { showGone, showState } from "./state.js";

const byId = (id) => document.getElementById(id);
const curves = new Curves(byId("reward"), byId("success"), byId("timing"));
let scene = null;
let isStarted = false;
let isPaced = true;

connectButtons();

function noScene(text) {
  byId("no-scene").textContent = text;
  byId("no-scene").hidden = false;
  for (const id of ["scene", "key", "reset-view"]) byId(id).hidden = true;
}

/** The curves and the buttons work without WebGL. */
async function startScene(still) {
  if (!still) return noScene("This task has no arm.");
  try {
    const { ArmScene } = await import("./scene.js");
    scene = new ArmScene(byId("scene"), still);
    byId("reset-view").onclick = () => scene.resetView();
  } catch (error) {
    noScene(`The arm cannot be drawn: ${error.message}`);
  }
}

const on = {
  first(line) {
    document.title = `cell ${line.cell} – skillet`;
    byId("cell").textContent = line.cell;
    byId("version").textContent = `skillet ${line.version}`;
    if (!isStarted) startScene(line.scene);
    isStarted = true;
    showCommands(line.allows_commands);
  },
  pose(line) {
    scene?.move(line.scene);
  },
  state(line) {
    isPaced = line.status?.is_paced ?? true;
    showState(line);
  },
  curves(line) {
    curves.show(line, isPaced);
  },
};

follow((line) => on[line.kind]?.(line), showGone);
