"use strict";
// Live page of a capture: draws the state received as server-sent events. All resources come from this server.
const NONE = -32768, SPANS = [20, 30, 40, 50, 60, 80, 100];
const $ = (id) => document.getElementById(id);
const view = { rows: [], mostRows: 256, last: null, maps: null, map: "viridis", span: 60, paused: false, cursor: null, top: null, image: null, seen: 0 };

const number = new Intl.NumberFormat("en", { useGrouping: true });
const fixed = (x, n) => (x === null || x === undefined ? "–" : x.toFixed(n));
const bytes = (n) => {
  for (const [unit, size] of [["TB", 1e12], ["GB", 1e9], ["MB", 1e6], ["kB", 1e3]]) if (n >= size) return `${(n / size).toPrecision(3)} ${unit}`;
  return `${n} B`;
};
const duration = (s) => (s > 172800 ? `${Math.floor(s / 86400)} days` : s > 7200 ? `${Math.floor(s / 3600)} h` : s > 120 ? `${Math.floor(s / 60)} min` : `${Math.floor(s)} s`);
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

// Resize a canvas to its size on the screen, and return its context scaled to CSS pixels.
function sheet(canvas) {
  const ratio = window.devicePixelRatio || 1, box = canvas.getBoundingClientRect();
  const [width, height] = [Math.max(1, Math.round(box.width * ratio)), Math.max(1, Math.round(box.height * ratio))];
  if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, box.width, box.height);
  context.font = "12px system-ui, sans-serif";
  return { context, width: box.width, height: box.height };
}

// Round steps for an axis of about so many.
function ticks(from, to, about) {
  const rough = (to - from) / Math.max(1, about), power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= rough);
  const all = [];
  for (let i = Math.ceil(from / step - 1e-9); i * step <= to + 1e-9 * step; i++) all.push(i * step);
  return { all, digits: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) };
}

const EDGE = { left: 48, right: 24, top: 6, bottom: 24 };

function axisBelow(s, ranges, colour) {
  const { context, width, height } = s, inner = width - EDGE.left - EDGE.right;
  const { all, digits } = ticks(ranges[0], ranges[1], inner / 90);
  context.fillStyle = css("--faint"); context.textAlign = "center"; context.textBaseline = "top";
  for (const range of all) {
    const x = EDGE.left + (range - ranges[0]) / (ranges[1] - ranges[0]) * inner;
    context.strokeStyle = colour; context.beginPath(); context.moveTo(x, EDGE.top); context.lineTo(x, height - EDGE.bottom); context.stroke();
    context.fillText(range.toFixed(digits) + (range === all[all.length - 1] ? " m" : ""), x, height - EDGE.bottom + 6);
  }
}

const latest = () => view.rows.findLast((row) => row.levels.length > 0);

// Upper level of the display in steps of 5 dB. It rises at once but falls only by 10 dB or more, to avoid flicker.
function scaleTop() {
  let highest = -Infinity;
  for (const row of view.rows.slice(-32)) for (const level of row.levels) if (level > highest) highest = level;
  if (highest === -Infinity) return view.top ?? 0;
  const asked = 5 * Math.ceil(highest / 50 + 0.2);
  if (view.top === null || asked > view.top || asked <= view.top - 10) view.top = asked;
  return view.top;
}

function drawProfile() {
  const s = sheet($("profile")), { context, width, height } = s, row = latest();
  if (!view.last) return;
  const ranges = view.last.ranges_m, high = scaleTop(), low = high - view.span;
  const [inner, tall] = [width - EDGE.left - EDGE.right, height - EDGE.top - EDGE.bottom];
  axisBelow(s, ranges, css("--line"));
  context.textAlign = "right"; context.textBaseline = "middle";
  for (const db of ticks(low, high, tall / 40).all) {
    const y = EDGE.top + (high - db) / view.span * tall;
    context.strokeStyle = css("--line"); context.beginPath(); context.moveTo(EDGE.left, y); context.lineTo(width - EDGE.right, y); context.stroke();
    context.fillStyle = css("--faint"); context.fillText(`${db.toFixed(0)} dB`, EDGE.left - 5, y);
  }
  if (!row) { $("cursor").textContent = ""; return; }
  const count = row.levels.length;
  const at = (i) => [EDGE.left + i / Math.max(1, count - 1) * inner, EDGE.top + Math.min(1, Math.max(0, (high - row.levels[i] / 10) / view.span)) * tall];
  context.strokeStyle = css("--curve"); context.lineWidth = 1.6; context.lineJoin = "round"; context.beginPath();
  for (let i = 0; i < count; i++) { const [x, y] = at(i); i ? context.lineTo(x, y) : context.moveTo(x, y); }
  context.stroke(); context.lineWidth = 1;
  let place = view.cursor === null ? row.levels.indexOf(Math.max(...row.levels)) : Math.round(view.cursor * (count - 1));
  const [x, y] = at(place);
  context.strokeStyle = context.fillStyle = css("--mark");
  context.beginPath(); context.arc(x, y, 4, 0, 7); context.fill();
  context.setLineDash([3, 4]); context.beginPath(); context.moveTo(x, EDGE.top); context.lineTo(x, height - EDGE.bottom); context.stroke(); context.setLineDash([]);
  const range = ranges[0] + place / Math.max(1, count - 1) * (ranges[1] - ranges[0]);
  $("cursor").textContent = `${view.cursor === null ? "strongest: " : ""}${range.toFixed(2)} m, ${(row.levels[place] / 10).toFixed(1)} dB`;
}

// Map levels to colours in the data of an ImageData, top row first.
function paint(data, levels, high, span, map) {
  const bare = matchMedia("(prefers-color-scheme: dark)").matches ? 40 : 220;
  for (let i = 0; i < levels.length; i++) {
    const level = levels[i];
    let colour = [bare, bare, bare];
    if (level !== NONE) colour = map[Math.min(255, Math.max(0, Math.round(255 * (1 - (high - level / 10) / span))))];
    data[4 * i] = colour[0]; data[4 * i + 1] = colour[1]; data[4 * i + 2] = colour[2]; data[4 * i + 3] = 255;
  }
}

const stamp = document.createElement("canvas");
function drawWaterfall() {
  const s = sheet($("waterfall")), { context, width, height } = s;
  const row = latest();
  if (!view.last || !view.maps || !row) return;
  const columns = row.levels.length, rows = view.mostRows, levels = new Int16Array(columns * rows).fill(NONE);
  view.rows.forEach((each, i) => { if (each.levels.length === columns) levels.set(each.levels, (view.rows.length - 1 - i) * columns); });
  stamp.width = columns; stamp.height = rows;
  const ink = stamp.getContext("2d"), pixels = ink.createImageData(columns, rows);
  paint(pixels.data, levels, scaleTop(), view.span, view.maps[view.map]);
  ink.putImageData(pixels, 0, 0);
  const [inner, tall] = [width - EDGE.left - EDGE.right, height - EDGE.top - EDGE.bottom];
  context.imageSmoothingEnabled = false;
  context.drawImage(stamp, EDGE.left, EDGE.top, inner, tall);
  axisBelow(s, view.last.ranges_m, "transparent");
  context.fillStyle = css("--faint"); context.textAlign = "right"; context.textBaseline = "middle";
  const latestSweep = view.rows[view.rows.length - 1].sweep;
  for (const ago of ticks(0, rows, tall / 40).all) {
    if (ago < rows && latestSweep - ago >= 0) context.fillText(`${latestSweep - ago}`, EDGE.left - 5, EDGE.top + (ago + 0.5) / rows * tall);
  }
  $("waterfall-rows").textContent = `latest ${view.rows.length} of at most ${rows} sweeps, newest at the top; ${scaleTop() - view.span} to ${scaleTop()} dB`;
}

const imageStamp = document.createElement("canvas");
function drawImage() {
  const about = view.image;
  $("image-figure").hidden = !about;
  if (!about || !view.maps) return;
  const { context, width, height } = sheet($("image"));
  const { columns, rows, levels, x_m, y_m } = about, turned = new Int16Array(levels.length);
  for (let row = 0; row < rows; row++) turned.set(levels.subarray(row * columns, (row + 1) * columns), (rows - 1 - row) * columns);
  imageStamp.width = columns; imageStamp.height = rows;
  const ink = imageStamp.getContext("2d"), pixels = ink.createImageData(columns, rows);
  paint(pixels.data, turned, about.highest_db ?? 0, Math.min(view.span, 50), view.maps[view.map]);
  ink.putImageData(pixels, 0, 0);
  // Keep the aspect ratio of the scene.
  const [wide, tall] = [Math.abs(x_m[1] - x_m[0]) || 1, Math.abs(y_m[1] - y_m[0]) || 1];
  const [roomX, roomY] = [width - EDGE.left - EDGE.right, height - EDGE.top - EDGE.bottom];
  const scale = Math.min(roomX / wide, roomY / tall), left = EDGE.left + (roomX - scale * wide) / 2;
  context.imageSmoothingEnabled = false;
  context.drawImage(imageStamp, left, EDGE.top, scale * wide, scale * tall);
  context.fillStyle = css("--faint"); context.textAlign = "center"; context.textBaseline = "top";
  const x = ticks(x_m[0], x_m[1], scale * wide / 80);
  for (const at of x.all) context.fillText(`${at.toFixed(x.digits)} m`, left + (at - x_m[0]) * scale, EDGE.top + scale * tall + 5);
  context.textAlign = "right"; context.textBaseline = "middle";
  const y = ticks(y_m[0], y_m[1], scale * tall / 50);
  for (const at of y.all) context.fillText(`${at.toFixed(y.digits)} m`, left - 5, EDGE.top + (y_m[1] - at) * scale);
  $("pulses").textContent = `${number.format(about.pulses)} pulses, ${fixed(about.highest_db, 1)} dB peak`;
}

// Level meter from -90 dBFS to full scale: the bar shows the RMS level, the tick the peak.
function drawLevel(id, level) {
  const { context, width, height } = sheet($(`${id}-bar`)), place = (db) => Math.max(0, Math.min(1, 1 + db / 90)) * width;
  context.fillStyle = css("--line"); context.fillRect(0, 0, width, height);
  if (level.rms_db !== null) { context.fillStyle = css(level.clipped ? "--wrong" : "--bar"); context.fillRect(0, 0, place(level.rms_db), height); }
  if (level.peak_db !== null) { context.fillStyle = css("--peak"); context.fillRect(Math.max(0, place(level.peak_db) - 3), 0, 3, height); }
  const text = $(id);
  text.textContent = `${fixed(level.rms_db, 1)} RMS, ${fixed(level.peak_db, 1)} peak${level.clipped ? `, ${number.format(level.clipped)} clipped` : ""}`;
  text.className = level.clipped ? "wrong" : "";
}

function table(id, lines) {
  $(id).replaceChildren(...lines.map(([name, ...values]) => {
    const line = document.createElement("tr"), head = document.createElement("th");
    head.scope = "row"; head.textContent = name; line.append(head);
    values.forEach((value, i) => {
      const cell = document.createElement("td");
      cell.id = `${id}-${name.replaceAll(" ", "-")}${values.length > 1 && i === 0 ? "-now" : ""}`;
      cell.textContent = number.format(value); cell.className = value ? "wrong" : ""; line.append(cell);
    });
    return line;
  }));
}

function drawNumbers() {
  const m = view.last;
  if (!m) return;
  document.title = `${m.name} – Subaperture`;
  $("name").textContent = m.name;
  $("sweep").textContent = m.sweep === null ? "–" : `${number.format(m.sweep + 1)}${m.sweeps ? ` of ${number.format(m.sweeps)}` : ""}`;
  $("rate").textContent = m.rate_hz === null ? "–" : m.rate_hz.toPrecision(3);
  $("usable").textContent = `${m.usable} of ${m.steps}`;
  $("usable").className = m.sweep !== null && m.usable < m.steps ? "wrong" : "";
  $("disk").textContent = m.free_bytes === null ? "–" : bytes(m.free_bytes) + (m.disk_lasts_s === null ? "" : `, ${duration(m.disk_lasts_s)}`);
  $("disk").className = m.disk_lasts_s !== null && m.disk_lasts_s < 60 ? "wrong" : "";
  $("queue").textContent = `${m.queue} of ${m.queue_holds}`;
  $("queue").className = 2 * m.queue > m.queue_holds ? "wrong" : "";
  $("unit").textContent = m.calibrated ? "dB relative to the calibration reflector" : "dB relative to the reference channel, not calibrated";
  drawLevel("reference", m.reference); drawLevel("echo", m.echo);
  table("flags", ["late", "lost", "unsteady", "clipped", "unlocked"].map((name) => [name, m.flagged[name], m.flagged_ever[name]]));
  const e = m.events;
  table("events", [["overruns", e.overflows], ["underruns", e.underflows], ["late commands", e.late_commands], ["lost packets", e.lost_packets],
    ["disconnections", e.gone], ["samples lost", m.lost_samples], ["late sweeps", m.late_sweeps], ["waits for the disk", m.waits], ["steps not shown", m.not_shown]]);
}

function state(name, text) {
  document.body.dataset.state = name;
  $("state").textContent = text;
}

// Draw at most once per screen frame, and not while the page is hidden.
let drawPending = false;
function draw() {
  if (drawPending) return;
  drawPending = true;
  requestAnimationFrame(() => {
    drawPending = false;
    drawNumbers(); drawProfile(); drawWaterfall(); drawImage();
    document.body.dataset.drawn = view.last && view.last.sweep !== null ? view.last.sweep : "";
  });
}

async function fetchPicture(about) {
  if (view.fetching || !about || about.revision === view.seen) return;
  view.fetching = true;
  let came = false;
  try {
    const answer = await fetch("picture");
    const levels = new Int16Array(await answer.arrayBuffer());
    // The size differs if the image changed in between; the next event announces the new one.
    if (answer.ok && levels.length === about.columns * about.rows) { view.image = { ...about, levels }; view.seen = about.revision; draw(); }
    came = answer.ok;
  } catch { /* Retried at the next event. */ }
  view.fetching = false;
  // Fetch again if the image changed in the meantime.
  const latest = view.last?.picture;
  if (came && latest && latest.revision > about.revision) fetchPicture(latest);
}

function showState(message) {
  state(message.ended ? "ended" : "running", message.ended ? `ended: ${message.ended}` : "running");
}

function take(message) {
  if (view.paused) { view.missed = (view.missed ?? []).concat(message.rows).slice(-message.most_rows); view.held = message; if (message.ended) { showState(message); fetchPicture(message.picture); } return; }
  const before = view.rows.length ? view.rows[view.rows.length - 1].sweep : -1;
  // A lower sweep number means a new capture at the same address.
  if (message.sweep !== null && message.sweep < before) { view.rows = []; view.image = null; view.top = null; }
  view.mostRows = message.most_rows;
  view.rows = view.rows.concat(message.rows.filter((row) => !view.rows.length || row.sweep > view.rows[view.rows.length - 1].sweep)).slice(-view.mostRows);
  view.last = message;
  showState(message);
  fetchPicture(message.picture);
  draw();
}

function connect() {
  const events = new EventSource("events");
  events.onmessage = (event) => take(JSON.parse(event.data));
  events.onerror = () => { if (document.body.dataset.state !== "ended") state("lost", "connection lost; reconnecting"); };
}

const actions = {
  pause() {
    view.paused = !view.paused;
    $("pause").setAttribute("aria-pressed", view.paused);
    $("pause").textContent = view.paused ? "resume" : "pause";
    if (!view.paused && view.held) { const held = { ...view.held, rows: view.missed }; view.held = null; view.missed = null; take(held); }
  },
  colours() { view.map = view.map === "viridis" ? "grey" : "viridis"; $("colours").textContent = view.map; draw(); },
  span(step) {
    view.span = SPANS[Math.min(SPANS.length - 1, Math.max(0, SPANS.indexOf(view.span) + step))];
    $("span").textContent = `${view.span} dB`; draw();
  },
  cursor(step) {
    const row = latest();
    if (!row) return;
    const last = row.levels.length - 1, at = view.cursor === null ? row.levels.indexOf(Math.max(...row.levels)) : Math.round(view.cursor * last);
    view.cursor = Math.min(last, Math.max(0, at + step)) / last; draw();
  },
  keys() { $("help").hidden = !$("help").hidden; $("keys").setAttribute("aria-expanded", !$("help").hidden); },
};
$("pause").onclick = actions.pause; $("colours").onclick = actions.colours; $("keys").onclick = actions.keys;
$("less").onclick = () => actions.span(-1); $("more").onclick = () => actions.span(1);
const point = (event) => {
  const box = $("profile").getBoundingClientRect();
  view.cursor = Math.min(1, Math.max(0, (event.clientX - box.left - EDGE.left) / (box.width - EDGE.left - EDGE.right))); draw();
};
$("profile").onpointermove = point; $("profile").onpointerdown = point;
$("profile").onpointerleave = () => { view.cursor = null; draw(); };
document.onkeydown = (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const key = { " ": actions.pause, c: actions.colours, "+": () => actions.span(1), "=": () => actions.span(1), "-": () => actions.span(-1),
    ArrowLeft: () => actions.cursor(event.shiftKey ? -10 : -1), ArrowRight: () => actions.cursor(event.shiftKey ? 10 : 1),
    Home: () => { view.cursor = null; draw(); }, "?": actions.keys, Escape: () => { if (!$("help").hidden) actions.keys(); } }[event.key];
  if (!key || (event.key === " " && event.target.tagName === "BUTTON")) return;
  event.preventDefault(); key();
};
new ResizeObserver(draw).observe(document.body);
matchMedia("(prefers-color-scheme: dark)").onchange = draw;
fetch("colours").then((answer) => answer.json()).then((maps) => { view.maps = maps; draw(); });
connect();
