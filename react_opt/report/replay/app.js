// The page: controls, numbers and the log. Text from files is set as textContent, never as markup.

const $ = (id) => document.getElementById(id);

function make(tag, text, name) {
  const element = document.createElement(tag);
  if (text !== undefined) element.textContent = text;
  if (name) element.className = name;
  return element;
}

function clockText(s) {
  const tenths = Math.round(s * 10), minutes = Math.floor(tenths / 600), rest = (tenths % 600) / 10;
  return `${minutes}:${rest < 10 ? "0" : ""}${rest.toFixed(1)}`;
}

function eventText(event) {
  const who = [event.robot, event.target].filter((part) => part !== undefined).join(" → ");
  const size = event.size_m2 === undefined ? "" : ` (${event.size_m2.toFixed(1)} m²)`;
  return `${WORDS[event.type] ?? event.type}${who ? `: ${who}` : ""}${size}`;
}

function markPicture(kind) { // the mark of a target state, as on the map
  const canvas = make("canvas", undefined, "mark"), ratio = window.devicePixelRatio || 1;
  canvas.width = canvas.height = 18 * ratio;
  const pen = canvas.getContext("2d");
  pen.scale(ratio, ratio);
  drawMark(pen, 9, 9, 5, ...TARGET_LOOK[kind]);
  return canvas;
}

class Replay {
  constructor(traces) {
    this.traces = traces;
    this.stage = new Stage($("canvas"), traces);
    this.end = Math.max(...traces.map((trace) => trace.end));
    this.t = 0;
    this.playing = false;
    this.events = traces.flatMap((trace, k) => trace.events.map((event) => ({ event, k }))).sort((a, b) => a.event.t_s - b.event.t_s);
    this.decisions = [...new Set(this.events.filter((each) => DECISIONS.has(each.event.type)).map((each) => each.event.t_s))];
    this.buildTeams();
    this.buildLog();
    this.bind();
    const asked = /^#t=([0-9.]+)$/.exec(location.hash);
    this.seek(asked ? Number(asked[1]) : 0);
  }

  buildTeams() {
    const [first] = this.traces;
    $("title").textContent = this.traces.map((trace) => trace.name).join(" beside ");
    document.title = `${first.name}: replay`;
    $("subtitle").textContent = this.traces.map((trace) => `${trace.strategy}, seed ${trace.seed}, ` +
      `${trace.robots.length} ${trace.robots.length === 1 ? "robot" : "robots"}${trace.always_on ? ", sensors always on" : ""}` +
      `${trace.status === "finished" ? "" : ", stopped"}`).join("  |  ");
    this.cells = this.traces.map((trace, k) => {
      const team = make("div", undefined, "team");
      if (this.traces.length > 1) team.append(make("h3", `${"AB"[k]}: ${trace.strategy}, ${trace.name}`));
      const known = make("div", undefined, "known"), share = make("span"), most = make("small");
      share.id = `known-${k}`;
      most.id = `most-${k}`;
      known.append(share, make("small", " of the building known"), most);
      const counts = make("div", "", "counts");
      counts.id = `targets-${k}`;
      const table = make("table"), head = table.createTHead().insertRow(), body = table.createTBody();
      for (const name of ["robot", "battery", "sensors", "link", "goes to"]) head.append(make("th", name));
      const rows = trace.robots.map((robot, r) => {
        const row = body.insertRow(), id = row.insertCell(), battery = row.insertCell();
        const swatch = make("span", undefined, "swatch"), bar = make("span", undefined, "bar"), fill = make("i");
        swatch.style.background = robot.colour;
        fill.style.background = robot.colour;
        id.append(swatch, make("span", robot.id));
        id.className = "id";
        id.title = robot.id;
        const joules = make("span");
        joules.id = `battery-${k}-${r}`;
        bar.append(fill);
        battery.append(bar, joules);
        const cells = { fill, joules, sensing: row.insertCell(), link: row.insertCell(), goal: row.insertCell() };
        cells.goal.className = "goal";
        cells.sensing.id = `sensing-${k}-${r}`;
        cells.link.id = `link-${k}-${r}`;
        return cells;
      });
      team.append(known, counts, table);
      $("teams").append(team);
      return { share, most, counts, rows };
    });
  }

  buildLog() {
    this.lines = this.events.map(({ event, k }) => {
      const line = make("li"), text = make("span", (this.traces.length > 1 ? `${"AB"[k]} ` : "") + eventText(event));
      if (event.reason) text.append(make("span", `. ${event.reason}`, "off"));
      line.append(make("time", clockText(event.t_s)), text);
      line.addEventListener("click", () => this.seek(event.t_s));
      $("log").append(line);
      return line;
    });
    this.marked = -1;
  }

  bind() {
    this.scrub = $("scrub");
    this.scrub.max = String(this.end);
    this.scrub.addEventListener("input", () => this.seek(Number(this.scrub.value)));
    $("play").addEventListener("click", () => this.toggle());
    $("previous").addEventListener("click", () => this.step(-1));
    $("next").addEventListener("click", () => this.step(1));
    for (const id of ["walls", "lidar", "trails", "marks"]) $(id).addEventListener("change", () => this.draw());
    $("help").addEventListener("click", () => {
      $("keys").hidden = !$("keys").hidden;
      $("help").setAttribute("aria-expanded", String(!$("keys").hidden));
    });
    $("canvas").addEventListener("click", (click) => {
      const t = this.stage.timeAt(click.offsetX, click.offsetY);
      if (t !== null) this.seek(t);
    });
    document.addEventListener("keydown", (key) => this.pressed(key));
    window.addEventListener("hashchange", () => {
      const asked = /^#t=([0-9.]+)$/.exec(location.hash);
      if (asked) this.seek(Number(asked[1]));
    });
    new ResizeObserver(() => this.draw()).observe($("stage"));
  }

  pressed(key) {
    if (key.ctrlKey || key.metaKey || key.altKey || key.target.tagName === "SELECT") return;
    const check = (id) => () => $(id).click();
    const speed = (by) => () => {
      const select = $("speed");
      select.selectedIndex = Math.min(select.options.length - 1, Math.max(0, select.selectedIndex + by));
    };
    const action = {
      " ": () => this.toggle(), ArrowLeft: () => this.seek(this.t - (key.shiftKey ? 10 : 1)),
      ArrowRight: () => this.seek(this.t + (key.shiftKey ? 10 : 1)), Home: () => this.seek(0), End: () => this.seek(this.end),
      n: () => this.step(1), p: () => this.step(-1), "+": speed(1), "-": speed(-1), w: check("walls"), l: check("lidar"),
      t: check("trails"), m: check("marks"), "?": () => $("help").click(),
    }[key.key.length === 1 ? key.key.toLowerCase() : key.key];
    if (!action) return;
    key.preventDefault();
    action();
  }

  toggle(playing = !this.playing) {
    if (playing && this.t >= this.end) this.seek(0);
    this.playing = playing;
    $("play").textContent = playing ? "Pause" : "Play";
    $("play").setAttribute("aria-label", playing ? "Pause" : "Play");
    if (!playing) return;
    let before = performance.now();
    const tick = (now) => {
      if (!this.playing) return;
      const t = this.t + Math.min(now - before, 250) / 1000 * Number($("speed").value);
      before = now;
      this.seek(t);
      if (t >= this.end) this.toggle(false);
      else requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }

  step(by) {
    this.toggle(false);
    const times = by > 0 ? this.decisions.filter((t) => t > this.t + 1e-6) : this.decisions.filter((t) => t < this.t - 1e-6);
    if (times.length) this.seek(by > 0 ? times[0] : times[times.length - 1]);
  }

  seek(t) {
    this.t = Math.min(Math.max(t, 0), this.end);
    this.draw();
  }

  draw() {
    const states = this.traces.map((trace) => stateAt(trace, this.t));
    const options = Object.fromEntries(["walls", "lidar", "trails", "marks"].map((id) => [id, $(id).checked]));
    this.stage.draw(this.t, options, states);
    this.scrub.value = String(this.t);
    $("clock").textContent = `${clockText(this.t)} / ${clockText(this.end)}`;
    this.traces.forEach((trace, k) => this.showTeam(trace, k, states[k]));
    this.showDecision(states);
    this.showLog();
  }

  showTeam(trace, k, state) {
    const i = Math.max(0, indexAt(trace.t, this.t)), cells = this.cells[k];
    cells.share.textContent = trace.t.length ? `${(100 * trace.coverage[i]).toFixed(1)} %` : "unknown";
    cells.most.textContent = trace.most.length ? `any team: at most ${(100 * trace.most[i]).toFixed(1)} %` : "";
    const count = new Map();
    for (const kind of state.targets.values()) count.set(kind, (count.get(kind) ?? 0) + 1);
    const kinds = Object.keys(TARGET_LOOK).filter((kind) => count.has(kind));
    cells.counts.replaceChildren(...kinds.length ? kinds.flatMap((kind) => [markPicture(kind), make("span", `${count.get(kind)} ${kind}`)])
      : [make("span", "no targets yet")]);
    trace.robots.forEach((robot, r) => {
      const row = cells.rows[r], joules = trace.battery[r][i], full = robot.capacity_j || trace.battery[r][0] || 1;
      const told = Number.isFinite(joules); // whether a frame by now names the robot
      row.joules.textContent = told ? `${Math.round(joules)} J` : "unknown";
      row.fill.style.width = `${Math.min(100, Math.max(0, 100 * (joules || 0) / full))}%`;
      const trouble = state.trouble.get(robot.id), on = trace.sensing[r][i] > 0;
      row.sensing.textContent = trouble ?? (told ? on ? "on" : "off" : "unknown");
      row.sensing.className = trouble ? "bad" : on ? "" : "off";
      const down = state.down.has(robot.id) || state.down.has("*");
      row.link.textContent = down ? "down" : "up";
      row.link.className = down ? "bad" : "";
      const goal = trace.goal[r][i];
      row.goal.textContent = goal >= 0 && trouble !== "lost" ? trace.goals[goal] : "–";
    });
  }

  showDecision(states) {
    let latest = null, team = 0;
    states.forEach((state, k) => {
      if (state.decision && (!latest || state.decision.t_s >= latest.t_s)) [latest, team] = [state.decision, k];
    });
    const tag = this.traces.length > 1 && latest ? `${"AB"[team]}, ` : "";
    $("decision-when").textContent = latest ? `${tag}${clockText(latest.t_s)}` : "none yet";
    $("decision-what").textContent = latest ? eventText(latest) : "";
    $("decision-why").textContent = latest?.reason ?? "";
    const claims = this.events.filter(({ event, k }) => event.claim && event.t_s <= this.t + 1e-9 && k === team);
    const claim = claims.length ? claims[claims.length - 1].event.claim : null;
    const shown = (value) => value === null || value === undefined ? "unknown" : String(Number(value.toPrecision(7)));
    const rows = claim ? [
      ["solver's last word", `${claim.status}${claim.limit === "none" ? "" : `, stopped by ${claim.limit}`}`],
      ["objective", shown(claim.objective)], ["proven bound", shown(claim.bound)],
      ["gap", claim.gap === null ? "unknown" : `${(100 * claim.gap).toFixed(2)} %`],
      ["method", [claim.method, claim.solver].filter(Boolean).join(", ") || "–"],
    ] : [];
    $("claim").replaceChildren(...rows.flatMap(([name, value]) => [make("dt", name), make("dd", value)]));
  }

  showLog() {
    let now = -1;
    this.events.forEach(({ event }, i) => {
      const later = event.t_s > this.t + 1e-9;
      if (!later) now = i;
      this.lines[i].classList.toggle("later", later);
    });
    if (now === this.marked) return;
    if (this.marked >= 0) this.lines[this.marked].classList.remove("now");
    this.marked = now;
    if (now < 0) return;
    this.lines[now].classList.add("now");
    const log = $("log");
    log.scrollTop = this.lines[now].offsetTop - log.offsetTop - log.clientHeight / 2;
  }
}

function fail(message) {
  $("failure").hidden = false;
  $("failure").textContent = message;
}

if (typeof DecompressionStream === "undefined") {
  fail("This browser is too old to unpack the mission: any of 2023 or later will do.");
} else {
  Promise.all(JSON.parse($("data").textContent).map(decode))
    .then((traces) => { window.replay = new Replay(traces); document.body.dataset.ready = "yes"; })
    .catch((error) => { fail(`The mission cannot be shown: ${error.message}`); throw error; });
}
