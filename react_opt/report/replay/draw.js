// The canvas: maps side by side above the curves of coverage and batteries.

const INK = "#1a1a1a", GREY = "#5c5c5c", FONT = '12px system-ui, "DejaVu Sans", sans-serif';
const TARGET_LOOK = { // colour, filled, shape
  new: ["#e69f00", false, "circle"], taken: ["#e69f00", true, "circle"], deferred: ["#5c5c5c", false, "diamond"],
  postponed: ["#cc79a7", true, "diamond"], abandoned: ["#d55e00", true, "cross"], inspected: ["#009e73", true, "plus"],
};

class MapPicture { // the pixels of one trace, painted anew only when time or options change
  constructor(trace) {
    this.trace = trace;
    this.canvas = document.createElement("canvas");
    this.canvas.width = trace.grid.cols;
    this.canvas.height = trace.grid.rows;
    this.context = this.canvas.getContext("2d");
    this.image = this.context.createImageData(trace.grid.cols, trace.grid.rows);
    this.pixels = new Uint32Array(this.image.data.buffer);
    this.painted = "";
  }

  paint(t, walls) {
    const { grid, known, truth } = this.trace;
    const now = Math.floor(t / grid.unit_s + 1e-6), fresh = now - Math.round(1.5 / grid.unit_s);
    const key = `${now} ${walls}`;
    if (key === this.painted) return;
    this.painted = key;
    const UNKNOWN = 0xffdcd8d6, HIDDEN = 0xffb4aeac, WALL = 0xff2a2a2a, FREE = 0xffffffff, FRESH = 0xffc8f0ff;
    for (let row = 0; row < grid.rows; row++) {
      let from = row * grid.cols, to = (grid.rows - 1 - row) * grid.cols; // row 0 has the smallest y
      for (let col = 0; col < grid.cols; col++, from++, to++) {
        const wall = (truth[from] & 3) === 1 && truth[from] !== 3;
        if (known[from] !== NEVER && known[from] <= now) {
          this.pixels[to] = wall ? WALL : known[from] > fresh && known[from] > 0 ? FRESH : FREE;
        } else {
          this.pixels[to] = wall && walls ? HIDDEN : UNKNOWN;
        }
      }
    }
    this.context.putImageData(this.image, 0, 0);
  }
}

class Stage {
  constructor(canvas, traces) {
    this.canvas = canvas;
    this.traces = traces;
    this.pictures = traces.map((trace) => new MapPicture(trace));
    this.end = Math.max(...traces.map((trace) => trace.end)) || 1; // of the axis: a single instant has one of 1 s
    this.curves = null;
  }

  draw(t, options, states) {
    const ratio = window.devicePixelRatio || 1;
    const width = this.canvas.clientWidth, height = this.canvas.clientHeight;
    if (this.canvas.width !== Math.round(width * ratio) || this.canvas.height !== Math.round(height * ratio)) {
      this.canvas.width = Math.round(width * ratio);
      this.canvas.height = Math.round(height * ratio);
    }
    const pen = this.canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    pen.font = FONT;
    const { grid } = this.traces[0];
    const aside = grid.rows > 1.2 * grid.cols && width > 560 && this.traces.length === 1; // a tall map: curves beside it
    const split = aside ? Math.min(0.55 * width, (height - 40) * grid.cols / grid.rows + 60) : width;
    const bottom = aside ? height : Math.max(height - Math.min(230, 0.36 * height), 0);
    this.traces.forEach((trace, k) => {
      const share = split / this.traces.length;
      this.drawMap(pen, k, { x: k * share + 10, y: 10, w: share - 20, h: bottom - 20 }, t, options, states[k]);
    });
    const box = aside ? { x: split, y: 0, w: width - split, h: height } : { x: 0, y: bottom, w: width, h: height - bottom };
    this.drawCurves(pen, box, t);
  }

  drawMap(pen, k, box, t, options, state) {
    const trace = this.traces[k], { grid } = trace;
    const title = this.traces.length > 1 ? 20 : 0, foot = 22;
    const wide = grid.cols * grid.resolution_m, high = grid.rows * grid.resolution_m;
    const scale = Math.max(Math.min(box.w / wide, (box.h - title - foot) / high), 1e-6);
    const x0 = box.x + (box.w - wide * scale) / 2, y0 = box.y + title + (box.h - title - foot - high * scale) / 2;
    const X = (x) => x0 + (x - grid.origin_x_m) * scale, Y = (y) => y0 + (high - (y - grid.origin_y_m)) * scale;
    if (title) {
      pen.fillStyle = INK;
      pen.textAlign = "left";
      pen.font = `bold ${FONT}`;
      pen.fillText(`${"AB"[k]}: ${trace.strategy}, ${trace.name}`, x0, y0 - 8, wide * scale);
      pen.font = FONT;
    }
    this.pictures[k].paint(t, options.walls);
    pen.imageSmoothingEnabled = scale * grid.resolution_m < 1;
    pen.drawImage(this.pictures[k].canvas, x0, y0, wide * scale, high * scale);
    pen.save();
    pen.beginPath();
    pen.rect(x0, y0, wide * scale, high * scale);
    pen.clip();
    if (options.trails) trace.robots.forEach((robot, r) => this.drawTrail(pen, trace, r, t, X, Y));
    if (options.marks) this.drawTargets(pen, state, X, Y);
    trace.robots.forEach((robot, r) => this.drawRobot(pen, trace, r, t, X, Y, scale, options, state));
    pen.restore();
    pen.strokeStyle = "#9a9a9a";
    pen.strokeRect(x0, y0, wide * scale, high * scale);
    const length = [1, 2, 5, 10, 20, 50, 100].find((metres) => metres * scale > 50) ?? 200;
    pen.fillStyle = INK;
    pen.fillRect(x0, y0 + high * scale + 8, length * scale, 3);
    pen.textAlign = "left";
    pen.fillText(`${length} m`, x0 + length * scale + 6, y0 + high * scale + 14);
  }

  drawTrail(pen, trace, r, t, X, Y) {
    const last = indexAt(trace.t, t);
    pen.strokeStyle = trace.robots[r].colour;
    for (const on of [false, true]) { // thick where sensors were on
      pen.lineWidth = on ? 2.4 : 1;
      pen.globalAlpha = 0.75;
      pen.beginPath();
      for (let i = 1; i <= last; i++) {
        if ((trace.sensing[r][i] > 0) !== on || Number.isNaN(trace.x[r][i]) || Number.isNaN(trace.x[r][i - 1])) continue;
        pen.moveTo(X(trace.x[r][i - 1]), Y(trace.y[r][i - 1]));
        pen.lineTo(X(trace.x[r][i]), Y(trace.y[r][i]));
      }
      pen.stroke();
    }
    pen.globalAlpha = 1;
    pen.lineWidth = 1;
  }

  drawTargets(pen, state, X, Y) {
    for (const [name, kind] of state.targets) {
      const place = state.places.get(name);
      if (place) drawMark(pen, X(place[0]), Y(place[1]), 5, ...TARGET_LOOK[kind]);
    }
  }

  drawRobot(pen, trace, r, t, X, Y, scale, options, state) {
    const pose = poseAt(trace, r, t), robot = trace.robots[r];
    if (!pose) return;
    const on = trace.sensing[r][pose.frame] > 0, x = X(pose.x), y = Y(pose.y);
    const lost = state.trouble.get(robot.id) === "lost";
    const goal = trace.goal[r][pose.frame];
    const place = goal >= 0 ? state.places.get(trace.goals[goal]) : undefined;
    if (place && options.marks) {
      pen.setLineDash([4, 4]);
      pen.strokeStyle = robot.colour;
      pen.beginPath();
      pen.moveTo(x, y);
      pen.lineTo(X(place[0]), Y(place[1]));
      pen.stroke();
      pen.setLineDash([]);
    }
    if (options.lidar && on && !lost) {
      pen.globalAlpha = 0.13;
      pen.fillStyle = robot.colour;
      pen.beginPath();
      pen.arc(x, y, robot.lidar_range_m * scale, 0, 2 * Math.PI);
      pen.fill();
      pen.globalAlpha = 0.6;
      pen.strokeStyle = robot.colour;
      pen.stroke();
      pen.globalAlpha = 1;
    }
    pen.save();
    pen.translate(x, y);
    pen.rotate(-pose.yaw);
    pen.beginPath();
    pen.moveTo(10, 0);
    pen.lineTo(-7, 7);
    pen.lineTo(-4, 0);
    pen.lineTo(-7, -7);
    pen.closePath();
    pen.fillStyle = lost ? "#8a8a8a" : on ? robot.colour : "#fff";
    pen.strokeStyle = lost ? INK : robot.colour;
    pen.lineWidth = 2;
    pen.fill();
    pen.stroke();
    pen.restore();
    pen.lineWidth = 1;
    const down = state.down.has(robot.id) || state.down.has("*");
    label(pen, shortened(robot.id) + (lost ? " lost" : down ? " no link" : ""), x + 10, y - 9, lost || down ? "#b00020" : INK);
  }

  drawCurves(pen, box, t) {
    const left = box.x + 46, right = box.x + box.w - 14, names = this.traces.length;
    if (box.h < 90 || right - left < 60) {
      this.curves = null;
      return;
    }
    this.curves = { left, right, top: box.y, bottom: box.y + box.h };
    const stacked = box.h > box.w;
    const middle = stacked ? box.y + box.h * 0.5 : box.y;
    const one = stacked ? { x: left, y: box.y + 24, w: right - left, h: middle - box.y - 52 }
      : { x: left, y: box.y + 18, w: (right - left - 60) / 2, h: box.h - 46 };
    const two = stacked ? { x: left, y: middle + 24, w: right - left, h: box.y + box.h - middle - 52 }
      : { x: left + one.w + 60, y: box.y + 18, w: one.w, h: box.h - 46 };
    this.curves.boxes = [one, two];
    this.frame(pen, one, "known (%) over time (s)", 100, t);
    this.traces.forEach((trace, k) => {
      pen.setLineDash([2, 2]);
      this.line(pen, one, trace.t, trace.most.map((share) => 100 * share), 100, k ? "#d55e00" : GREY, 1.2);
      pen.setLineDash(k ? [5, 3] : []);
      this.line(pen, one, trace.t, trace.coverage.map((share) => 100 * share), 100, k ? "#d55e00" : INK, 2);
    });
    pen.setLineDash([]);
    if (this.traces.some((trace) => trace.most.length)) label(pen, "dotted: at most, any team (proven)", Math.max(one.x + 4, one.x + one.w - 216), one.y + one.h - 8, GREY);
    const top = (Math.max(0, ...this.traces.flatMap((trace) => trace.battery.map((row) => row.reduce((a, b) => Math.max(a, b || 0), 0)))) || 1000) / 1000;
    this.frame(pen, two, "battery (kJ) over time (s)", top, t);
    this.traces.forEach((trace, k) => trace.robots.forEach((robot, r) => {
      pen.setLineDash(k ? [5, 3] : []);
      this.line(pen, two, trace.t, trace.battery[r].map((joules) => joules / 1000), top, robot.colour, 1.6);
    }));
    pen.setLineDash([]);
    if (names > 1) {
      pen.textAlign = "right";
      pen.fillStyle = INK;
      pen.fillText("A solid, B dashed", one.x + one.w, one.y - 5);
    }
  }

  frame(pen, box, name, top, t) {
    pen.fillStyle = "#fff";
    pen.fillRect(box.x, box.y, box.w, box.h);
    pen.textAlign = "left";
    pen.fillStyle = INK;
    pen.fillText(name, box.x, box.y - 5);
    pen.textAlign = "right";
    pen.fillStyle = GREY;
    pen.strokeStyle = "#e0e0e0";
    const step = niceStep(top, Math.max(1, Math.floor(box.h / 28)));
    for (let value = 0; value <= top * 1.0001; value += step) {
      const y = box.y + box.h * (1 - value / (top * 1.04));
      pen.beginPath();
      pen.moveTo(box.x, y);
      pen.lineTo(box.x + box.w, y);
      pen.stroke();
      pen.fillText(String(Math.round(value * 100) / 100), box.x - 5, y + 4);
    }
    pen.textAlign = "center";
    const every = niceStep(this.end, Math.max(1, Math.floor(box.w / 60)));
    for (let s = 0; s <= this.end; s += every) pen.fillText(String(Math.round(s * 10) / 10), box.x + box.w * s / this.end, box.y + box.h + 14);
    pen.strokeStyle = "#0072b2";
    pen.beginPath();
    pen.moveTo(box.x + box.w * t / this.end, box.y);
    pen.lineTo(box.x + box.w * t / this.end, box.y + box.h);
    pen.stroke();
  }

  line(pen, box, times, values, top, colour, width) {
    if (!values.length) return;
    pen.strokeStyle = colour;
    pen.lineWidth = width;
    pen.beginPath();
    let drawing = false;
    for (let i = 0; i < times.length; i++) {
      if (Number.isNaN(values[i])) { drawing = false; continue; }
      const x = box.x + box.w * times[i] / this.end, y = box.y + box.h * (1 - values[i] / (top * 1.04));
      drawing ? pen.lineTo(x, y) : pen.moveTo(x, y);
      drawing = true;
    }
    pen.stroke();
    pen.lineWidth = 1;
  }

  timeAt(x, y) { // the time of a click on a curve, null elsewhere
    const box = this.curves?.boxes.find((b) => x >= b.x && x <= b.x + b.w && y >= b.y && y <= b.y + b.h);
    return box ? this.end * (x - box.x) / box.w : null;
  }
}

function niceStep(top, most) {
  const rough = top / most, power = 10 ** Math.floor(Math.log10(rough));
  return [1, 2, 5, 10].map((digit) => digit * power).find((step) => step >= rough * 0.999);
}

function shortened(name) {
  const letters = [...name];
  return letters.length > 24 ? `${letters.slice(0, 23).join("")}…` : name;
}

function label(pen, text, x, y, colour) {
  pen.textAlign = "left";
  pen.lineWidth = 3;
  pen.strokeStyle = "#fff";
  pen.strokeText(text, x, y);
  pen.lineWidth = 1;
  pen.fillStyle = colour;
  pen.fillText(text, x, y);
}

function drawMark(pen, x, y, size, colour, filled, shape) {
  pen.beginPath();
  if (shape === "circle") pen.arc(x, y, size, 0, 2 * Math.PI);
  else if (shape === "diamond") {
    pen.moveTo(x, y - size - 1);
    pen.lineTo(x + size + 1, y);
    pen.lineTo(x, y + size + 1);
    pen.lineTo(x - size - 1, y);
    pen.closePath();
  } else {
    const turn = shape === "cross" ? Math.PI / 4 : 0;
    for (let k = 0; k < 4; k++) {
      pen.moveTo(x, y);
      pen.lineTo(x + (size + 1) * Math.cos(turn + k * Math.PI / 2), y + (size + 1) * Math.sin(turn + k * Math.PI / 2));
    }
    pen.lineWidth = 6;
    pen.strokeStyle = "#fff";
    pen.stroke();
    pen.lineWidth = 3;
    pen.strokeStyle = colour;
    pen.stroke();
    pen.lineWidth = 1;
    return;
  }
  pen.fillStyle = filled ? colour : "#fff";
  pen.fill();
  pen.lineWidth = 2;
  pen.strokeStyle = filled ? "#fff" : colour;
  pen.stroke();
  pen.lineWidth = 1;
}
