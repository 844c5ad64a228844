"use strict";
// What the page holds: traces, decoded from compressed base64. Nothing here touches the document but reading its data.

const NEVER = 65535, GONE = -(2 ** 31);
const STATE_OF = {
  target_new: "new", target_taken: "taken", target_deferred: "deferred",
  target_postponed: "postponed", target_inspected: "inspected", target_abandoned: "abandoned",
};
const WORDS = {
  target_new: "New unknown region", target_taken: "Target taken", target_deferred: "Target deferred",
  target_postponed: "Target postponed", target_inspected: "Target inspected", target_abandoned: "Target abandoned",
  order: "Order", replan: "Plan made", area_explored: "Area explored", area_unreachable: "Area cannot be reached",
  area_added: "Area added", sensing_on: "Sensors on", sensing_off: "Sensors off", link_down: "Link lost",
  link_up: "Link back", yield: "Robot yields", robot_stuck: "Robot stuck", robot_dead: "Robot lost",
  battery_empty: "Battery empty", inspection_gate: "Deferred inspection", mission_end: "Mission ends",
};
const DECISIONS = new Set(["replan", "order", "target_taken", "target_deferred", "target_postponed",
  "target_abandoned", "inspection_gate", "area_unreachable"]);

async function inflate(base64) {
  const bytes = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// Running sums of differences, in units of scale; GONE stays NaN.
function summed(deltas, scale) {
  const values = new Float64Array(deltas.length);
  let sum = 0;
  for (let i = 0; i < deltas.length; i++) {
    sum += deltas[i];
    values[i] = sum === GONE ? NaN : sum * scale;
  }
  return values;
}

async function decode(parts) {
  const told = JSON.parse(new TextDecoder().decode(await inflate(parts.told)));
  const raw = await inflate(parts.known);
  const view = new DataView(raw.buffer);
  const known = new Uint16Array(raw.length / 2);
  for (let i = 0; i < known.length; i++) known[i] = view.getUint16(2 * i, true);
  const trace = { ...told, known, truth: await inflate(parts.truth) };
  const scales = told.scales;
  trace.t = summed(told.t, scales.t);
  trace.coverage = summed(told.coverage, scales.coverage);
  trace.most = summed(told.most, scales.coverage); // what any team can have seen at most; empty where not known
  for (const key of ["x", "y", "yaw", "battery"]) trace[key] = told[key].map((row) => summed(row, scales[key]));
  for (const key of ["sensing", "goal"]) trace[key] = told[key].map((row) => summed(row, 1));
  trace.end = trace.t.length ? trace.t[trace.t.length - 1] : 0;
  for (const event of trace.events) trace.end = Math.max(trace.end, event.t_s);
  return trace;
}

// Index of the last entry of sorted times that is not later than t, -1 before the first.
function indexAt(times, t) {
  let low = 0, high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] <= t + 1e-9) low = middle + 1; else high = middle;
  }
  return low - 1;
}

// Pose of robot k at time t, between the frames around it; null where it is not there.
function poseAt(trace, k, t) {
  const i = Math.max(0, indexAt(trace.t, t));
  if (!trace.t.length || Number.isNaN(trace.x[k][i])) return null;
  const j = Math.min(i + 1, trace.t.length - 1);
  const span = trace.t[j] - trace.t[i];
  const share = span > 0 && !Number.isNaN(trace.x[k][j]) ? Math.min(1, Math.max(0, (t - trace.t[i]) / span)) : 0;
  const mix = (row) => row[i] + share * ((share ? row[j] : row[i]) - row[i]);
  let turn = share ? trace.yaw[k][j] - trace.yaw[k][i] : 0;
  turn -= 2 * Math.PI * Math.round(turn / (2 * Math.PI));
  return { x: mix(trace.x[k]), y: mix(trace.y[k]), yaw: trace.yaw[k][i] + share * turn, frame: i };
}

// What is true at time t by the events so far.
function stateAt(trace, t) {
  const state = { targets: new Map(), places: new Map(), down: new Set(), trouble: new Map(), decision: null, count: 0 };
  const boundFor = new Map();
  for (const event of trace.events) {
    if (event.t_s > t + 1e-9) break;
    state.count++;
    if (event.target !== undefined && event.x_m !== undefined) state.places.set(event.target, [event.x_m, event.y_m]);
    if (event.type in STATE_OF && event.target !== undefined) state.targets.set(event.target, STATE_OF[event.type]);
    if (event.type === "target_taken") { // what its robot was on its way to waits again
      const before = boundFor.get(event.robot);
      if (before !== undefined && before !== event.target && state.targets.get(before) === "taken") state.targets.set(before, "new");
      boundFor.set(event.robot, event.target);
    }
    if (event.type === "link_down") state.down.add(event.robot ?? "*");
    if (event.type === "link_up") event.robot === undefined ? state.down.clear() : state.down.delete(event.robot);
    if (event.type === "robot_dead" || event.type === "battery_empty") state.trouble.set(event.robot, "lost");
    if (event.type === "robot_stuck") state.trouble.set(event.robot, "stuck");
    if (event.type === "target_taken" || event.type === "order") {
      if (state.trouble.get(event.robot) === "stuck") state.trouble.delete(event.robot);
    }
    if (DECISIONS.has(event.type)) state.decision = event;
  }
  return state;
}
