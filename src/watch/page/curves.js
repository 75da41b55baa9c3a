// Reward, success and loop timing, with axes and legends below the plots by uPlot.

import uPlot from "./vendor/uplot.js";

const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const color = (name) => () => css(name);
const LATE = 20;
const HEIGHT_PX = 186;
const decimals = (digits) => (_, value) => (value == null ? "–" : value.toFixed(digits));

function axis(more) {
  const font = "12px system-ui, sans-serif";
  const grid = { stroke: color("--line"), width: 1 };
  return { stroke: color("--quiet"), font, labelFont: font, grid, ticks: { ...grid, size: 4 }, labelSize: 16, labelGap: 0, ...more };
}

function points(label, name) {
  const dot = { show: true, size: 5, width: 0, fill: color(name) };
  return { label, stroke: color(name), paths: () => null, points: dot, value: decimals(3) };
}

const line = (label, name, value) => ({ label, stroke: color(name), width: 1.5, points: { show: false }, value });

function plot(parent, series, axes, scales) {
  const size = () => ({ width: parent.clientWidth, height: HEIGHT_PX });
  const options = { ...size(), series, axes, scales, cursor: { drag: { x: false, y: false } }, legend: { live: true } };
  const made = new uPlot(options, series.map(() => []), parent);
  new ResizeObserver(() => made.setSize(size())).observe(parent);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => made.redraw());
  return made;
}

const rollouts = { label: "rollout", value: (_, value) => value ?? "–" };

export class Curves {
  #reward;
  #success;
  #timing;

  constructor(reward, success, timing) {
    const x = { time: false };
    this.#reward = plot(
      reward,
      [rollouts, points("trial", "--quiet"), points("success", "--green"), line("best", "--blue", decimals(3))],
      [axis({ label: "rollout", size: 26 }), axis({ size: 48 })],
      { x },
    );
    this.#success = plot(
      success,
      [rollouts, line("success", "--green", (_, v) => (v == null ? "–" : `${v.toFixed(0)} %`))],
      [axis({ label: "rollout", size: 26 }), axis({ size: 48, values: (_, ticks) => ticks.map((tick) => `${tick} %`) })],
      { x, y: { range: [0, 105] } },
    );
    const time = (t) => (t >= 1000 ? `${t / 1000} ms` : `${t} µs`);
    const us = (_, v) => (v == null ? "–" : `${v.toFixed(0)} µs`);
    this.#timing = plot(
      timing,
      [
        { label: "s", value: decimals(0) },
        line("wake-up p50", "--green", us),
        line("p99", "--blue", us),
        line("max", "--red", us),
        line("tick p99", "--amber", us),
      ],
      [axis({ label: "seconds, 0 is now", size: 26 }), axis({ size: 56, values: (_, ticks) => ticks.map((t) => (t == null ? "" : time(t))) })],
      { x, y: { distr: 3 } },
    );
  }

  show({ trials, timing }, isPaced) {
    const { rollout, reward, success } = trials;
    let top = -Infinity;
    const best = reward.map((value) => (top = Math.max(top, value)));
    const where = (flag) => reward.map((value, i) => (success[i] === flag ? value : null));
    this.#reward.setData([rollout, where(0), where(1), best]);
    this.#success.setData(successOfDraws(trials));
    const now = timing.at_s.at(-1) ?? 0;
    // Logarithmic: what is zero has not been measured.
    const measured = (column) => column.map((value) => (value > 0 ? value : null));
    const wakeUp = (column) => (isPaced ? measured(column) : column.map(() => null));
    this.#timing.setData([
      timing.at_s.map((at) => at - now),
      ...[timing.wakeup_p50_us, timing.wakeup_p99_us, timing.wakeup_max_us].map(wakeUp),
      measured(timing.tick_p99_us),
    ]);
    for (const i of [1, 2, 3]) {
      if (this.#timing.series[i].show !== isPaced) this.#timing.setSeries(i, { show: isPaced });
    }
  }
}

/** Share of successes among the last draws; where the search executes its own mean is no draw. */
function successOfDraws({ rollout, success, is_mean }) {
  const draws = rollout.map((_, i) => i).filter((i) => !is_mean[i]);
  const share = draws.map((_, k) => {
    const late = draws.slice(Math.max(0, k + 1 - LATE), k + 1);
    return (100 * late.filter((i) => success[i]).length) / late.length;
  });
  return [draws.map((i) => rollout[i]), share];
}
