"use strict";
// Image viewer: draws tiles of levels at any zoom. All resources come from this server.
const TILE = 256, NONE = -32768, MOST_KEPT = 500, MOST_LOOK = 2;
const $ = (id) => document.getElementById(id);
const view = {
  images: [], layers: [], doppler: [], shown: 0, other: -1, blinked: false, swiped: false, maps: null, map: "grey",
  placed: false, top: null, span: null, own: false, phase: false, part: 1, partAt: 0, drawn: 0, wanted: 0, painted: 0,
};
// Cyclic colour map for phases. Lightness alone distinguishes quarters of a turn.
const PHASES = [[226, 217, 226], [112, 148, 194], [79, 40, 122], [24, 18, 36], [110, 26, 64], [188, 92, 78], [226, 217, 226]];
const cyclic = Array.from({ length: 256 }, (_, i) => {
  const at = i / 256 * (PHASES.length - 1), k = Math.floor(at), part = at - k;
  return PHASES[k].map((c, n) => Math.round(c + (PHASES[k + 1][n] - c) * part));
});
const ABOVE = { grey: [255, 150, 30], viridis: [255, 110, 90] };

// Cache of fetched tiles, most recently used last.
const kept = new Map();
async function fetched(path, Kind, signal) {
  if (kept.has(path)) { const there = kept.get(path); kept.delete(path); kept.set(path, there); return there; }
  const answer = await fetch(path, { signal });
  if (!answer.ok) { const why = await answer.text(); if (answer.status >= 500) wrong(why); throw new Error(why); }
  const cells = new Kind(await answer.arrayBuffer());
  kept.set(path, cells);
  if (kept.size > MOST_KEPT) kept.delete(kept.keys().next().value);
  return cells;
}

function wrong(text) { $("state").textContent = text; document.body.dataset.state = "wrong"; }
const image = () => view.images[view.shown];

// Coordinates of the page run right and down; rows and columns run as defined by the image. A tile of the page is a tile of the image, possibly mirrored.
function crsOf(about) {
  const steps = about.steps_m ?? [1, 1], least = Math.min(...steps);
  // Cells have the aspect ratio of the scene, rounded to whole pixels per tile.
  const size = steps.map((s) => Math.max(1, Math.round(TILE * s / least)));
  about.tile = L.point(size[1], size[0]);
  const transformation = L.transformation(about.right * size[1] / TILE, 0, -about.up * size[0] / TILE, 0);
  return L.extend({}, L.CRS.Simple, { transformation, infinite: true });
}
// Leaflet latitude is the row and longitude the column: pixel (r, c) covers r to r + 1 and c to c + 1.
const bounds = (about) => L.latLngBounds([0, 0], [about.rows, about.columns]);

const Levels = L.GridLayer.extend({
  options: { updateWhenZooming: false, keepBuffer: 3, noWrap: true },
  createTile(coords, done) {
    const canvas = L.DomUtil.create("canvas");
    canvas.width = canvas.height = TILE;
    const about = view.images[this.options.image], level = -coords.z;
    const row = about.up < 0 ? coords.y : -1 - coords.y, column = about.right > 0 ? coords.x : -1 - coords.x;
    Object.assign(canvas, { level, at: [row, column], done });
    this.load(canvas);
    return canvas;
  },
  // Only the latest request of a tile counts. Its first response displays the tile.
  load(canvas) {
    canvas.abort?.abort();
    const abort = canvas.abort = new AbortController();
    const ready = (error) => { if (canvas.abort === abort && canvas.done) { canvas.done(error, canvas); canvas.done = null; } };
    view.wanted++;
    this.fill(canvas).then(() => ready(null), ready).finally(() => { view.drawn++; });
  },
  async fill(canvas) {
    const n = this.options.image, about = view.images[n], [row, column] = canvas.at, { signal } = canvas.abort;
    if (row < 0 || column < 0) return;
    const narrow = view.part > 1 && about.aperture && canvas.level <= MOST_LOOK;
    const [from, to] = partOf();
    const tile = narrow ? `look/${n}/${from}/${to}/${canvas.level}/${row}/${column}` : `tile/${n}/${canvas.level}/${row}/${column}`;
    canvas.cells = await fetched(`${tile}?${about.revision}`, Int16Array, signal);
    canvas.phases = view.phase && canvas.level === 0 ? await fetched(`phase/${n}/${row}/${column}?${about.revision}`, Uint8Array, signal) : null;
    this.paint(canvas);
  },
  paint(canvas) {
    if (!canvas.cells || !view.maps || view.top === null ) return;
    const about = view.images[this.options.image], map = view.maps[view.map], above = ABOVE[view.map];
    const ink = canvas.getContext("2d"), pixels = ink.createImageData(TILE, TILE), data = new Uint32Array(pixels.data.buffer);
    const [top, bottom] = [10 * view.top, 10 * (view.top - view.span)];
    const word = ([r, g, b]) => (255 << 24 | b << 16 | g << 8 | r) >>> 0;
    const words = map.map(word), bright = word(above), turning = cyclic.map(word), scale = 255 / (top - bottom);
    const { cells, phases } = canvas, mirrored = about.right < 0, turned = about.up > 0;
    for (let r = 0; r < TILE; r++) {
      const to = (turned ? TILE - 1 - r : r) * TILE;
      for (let c = 0; c < TILE; c++) {
        const i = r * TILE + c, level = cells[i];
        if (level === NONE) continue;
        let colour;
        if (phases) colour = turning[phases[i]];
        else if (level > top) colour = bright;
        else colour = words[Math.max(0, Math.round((level - bottom) * scale))];
        data[to + (mirrored ? TILE - 1 - c : c)] = colour;
      }
    }
    ink.putImageData(pixels, 0, 0);
    if (cells.some((level) => level !== NONE)) view.painted++;
  },
  each(what) { for (const key in this._tiles) what(this._tiles[key].el); },
  // Tiles of the present zoom.
  current(what) { for (const key in this._tiles) if (this._tiles[key].current) what(this._tiles[key].el); },
  repaint() { this.each((canvas) => this.paint(canvas)); },
  // Reload the displayed tiles; the old contents remain until then.
  again() { this.each((canvas) => this.load(canvas)); },
});

const map = L.map("map", { crs: L.CRS.Simple, attributionControl: false, zoomSnap: 0.25, zoomDelta: 1, wheelPxPerZoomLevel: 90, keyboardPanDelta: 120, preferCanvas: true, zoomAnimation: !matchMedia("(prefers-reduced-motion: reduce)").matches });
const crosshair = L.DomUtil.create("div", "crosshair", map.getContainer());
const swipeLine = L.DomUtil.create("div", "swipe-line", map.getContainer());
swipeLine.hidden = true;
const planes = { shown: null, other: null };

function layerOf(n) {
  const about = view.images[n];
  const plane = new Levels({ image: n, tileSize: about.tile, bounds: bounds(about), minNativeZoom: -about.levels, maxNativeZoom: 0, minZoom: -about.levels - 2, maxZoom: 6 });
  plane.on("tileunload", ({ tile }) => tile.abort?.abort());
  return plane;
}
// Whether two images have the same size and orientation, and the same grid if both grids are known.
const alike = (a, b) => ["rows", "columns", "right", "up"].every((key) => a[key] === b[key])
  && (!a.steps_m || !b.steps_m || ["rows_axis", "columns_axis", "steps_m"].every((key) => String(a[key]) === String(b[key])));

// Fit the image between the axes.
function fit(animate = true) { map.fitBounds(bounds(image()), { animate, paddingTopLeft: [EDGE_LEFT, 0], paddingBottomRight: [0, EDGE_BOTTOM] }); }

// Show an image, keeping the view if the previous image has the same grid.
function show(n, from) {
  const about = view.images[n], before = image(), stays = view.placed && from === undefined && alike(about, before);
  view.shown = n;
  for (const key of ["shown", "other"]) { planes[key]?.remove(); planes[key] = null; }
  if (!stays) {
    forgetDoppler();
    map.options.crs = crsOf(about);
    map.options.minZoom = -about.levels - 2; map.options.maxZoom = 6;
    map.setMaxBounds(null);
    if (from) map.setView(from.centre, from.zoom, { animate: false });
    else fit(false);
    map.setMaxBounds(bounds(about).pad(0.6));
    view.placed = true;
  }
  for (const each of view.images) if (!each.tile) crsOf(each);
  planes.shown = layerOf(n).addTo(map);
  beside(view.other);
  $("image").value = String(n);
  $("name").textContent = about.name;
  document.title = `${about.name} – Subaperture`;
  $("aperture-section").hidden = !about.aperture;
  levels(); notes(); drawLayers(); redrawFrame(); keepAddress();
}

function beside(n) {
  planes.other?.remove(); planes.other = null;
  view.other = n; view.blinked = false;
  const fits = n >= 0 && n !== view.shown && alike(view.images[n], image());
  $("compare").hidden = !fits;
  $("unlike").hidden = n < 0 || n === view.shown || fits;
  if (!$("unlike").hidden) $("unlike").textContent = "These images have different grids: form both on the same grid to compare them.";
  $("other").value = String(n);
  if (!fits) { view.swiped = false; swipe(); return; }
  planes.other = layerOf(n).addTo(map);
  planes.other.setOpacity(view.swiped ? 1 : 0);
  swipe();
}

function blink() {
  if (!planes.other) return;
  view.blinked = !view.blinked; view.swiped = false; swipe();
  planes.other.setOpacity(view.blinked ? 1 : 0);
  $("blink").setAttribute("aria-pressed", view.blinked);
  $("name").textContent = (view.blinked ? view.images[view.other] : image()).name;
}
function swipe() {
  $("swipe").setAttribute("aria-pressed", view.swiped);
  $("blink").setAttribute("aria-pressed", view.blinked);
  $("swipe-at").disabled = !view.swiped;
  swipeLine.hidden = !view.swiped;
  const pane = planes.other?.getContainer();
  if (!pane) return;
  if (!view.swiped) { pane.style.clip = ""; if (!view.blinked) planes.other.setOpacity(0); return; }
  view.blinked = false; planes.other.setOpacity(1);
  const at = map.getSize().x * $("swipe-at").value / 100;
  const [corner, end] = [map.containerPointToLayerPoint([at, 0]), map.containerPointToLayerPoint(map.getSize())];
  pane.style.clip = `rect(${corner.y}px, ${end.x}px, ${end.y}px, ${corner.x}px)`;
  swipeLine.style.left = `${at - 1}px`;
}

// Display levels: automatic from the image until set by the user.
function levels() {
  const scale = image().scale;
  if (!view.own && scale) [view.top, view.span] = scale;
  if (view.top === null) return;
  $("top").value = view.top; $("span").value = view.span;
  $("top-text").textContent = `${view.top} dB`; $("span-text").textContent = `${view.span} dB`;
  $("map-name").value = view.map;
  $("phase").setAttribute("aria-pressed", view.phase);
  const strip = $("scale"), ink = strip.getContext("2d"), table = view.phase ? cyclic : view.maps[view.map];
  strip.width = 256;
  table.forEach(([r, g, b], i) => { ink.fillStyle = `rgb(${r},${g},${b})`; ink.fillRect(i, 0, 1, strip.height); });
  planes.shown?.repaint(); planes.other?.repaint();
  drawHistogram();
}
function choose(top, span) {
  view.own = true;
  view.top = Math.min(300, Math.max(-300, top)); view.span = Math.min(120, Math.max(5, span));
  levels(); keepAddress();
}
function again() { planes.shown?.again(); planes.other?.again(); }
function colours() { view.map = view.map === "grey" ? "viridis" : "grey"; levels(); keepAddress(); }
function phase() { view.phase = !view.phase; levels(); again(); notes(); keepAddress(); }

function partOf() {
  const width = 1000 / view.part, from = Math.round((1000 - width) * view.partAt / 100);
  return [from, Math.round(from + width)];
}
function part() {
  $("part").value = String(view.part); $("part-at").value = view.partAt; $("part-at").disabled = view.part === 1;
  const [from, to] = partOf();
  $("part-text").textContent = view.part === 1 ? "full aperture" : `${(from / 10).toFixed(0)} to ${(to / 10).toFixed(0)} %`;
  again(); notes(); keepAddress();
}

// Notes on what is unavailable at this zoom.
function notes() {
  const near = map.getZoom() >= 0.0 - 0.5;
  $("phase-note").textContent = view.phase && !near ? "zoom in: phase needs zoom 1:1 (key 1)" : "";
  const looked = Math.round(-map.getZoom()) <= MOST_LOOK;
  $("part-note").hidden = view.part === 1 || looked;
  $("part-note").textContent = "zoom in: sub-apertures need at most 4 x 4 pixels per cell";
  if (view.part > 1 && looked) { $("part-note").hidden = false; $("part-note").textContent = "Filtered from the image's spectrum: an approximation of the image formed from those pulses alone."; }
}

// The fragment of the address holds the view.
let writing = null;
function keepAddress() {
  if (!view.placed) return;
  const { lat, lng } = map.getCenter();
  const words = { i: view.shown, r: lat.toFixed(2), c: lng.toFixed(2), z: map.getZoom(), m: view.map };
  if (view.own) Object.assign(words, { t: view.top, s: view.span });
  if (view.other >= 0) words.o = view.other;
  if (view.swiped) words.w = $("swipe-at").value;
  if (doppler.at) words.d = [doppler.of, doppler.sub, ...doppler.at].join();
  if (view.phase) words.p = 1;
  if (view.part > 1) Object.assign(words, { l: view.part, la: view.partAt });
  clearTimeout(writing);
  writing = setTimeout(() => history.replaceState(null, "", `#${new URLSearchParams(words)}`), 150);
}
function fromAddress() {
  const words = new URLSearchParams(location.hash.slice(1)), number = (key) => (words.has(key) && Number.isFinite(+words.get(key)) ? +words.get(key) : null);
  const within = (n) => n !== null && Number.isInteger(n) && n >= 0 && n < view.images.length;
  if (["grey", "viridis"].includes(words.get("m"))) view.map = words.get("m");
  if (number("t") !== null && number("s") > 0) { view.own = true; [view.top, view.span] = [number("t"), number("s")]; }
  view.phase = number("p") === 1;
  if ([2, 3, 4, 8].includes(number("l"))) { view.part = number("l"); view.partAt = Math.min(100, Math.max(0, number("la") ?? 0)); }
  if (number("w") !== null) { view.swiped = true; $("swipe-at").value = number("w"); }
  const n = within(number("i")) ? number("i") : 0;
  view.other = within(number("o")) ? number("o") : view.images.findIndex((about, i) => i !== n && alike(about, view.images[n]));
  const [r, c, z] = ["r", "c", "z"].map(number);
  show(n, [r, c, z].includes(null) ? undefined : { centre: [r, c], zoom: Math.min(6, z) });
  $("part").value = String(view.part); part();
  dopplerAt(words.get("d"));
}

// Layers: shapes in rows and columns, fetched once per image.
const shapes = { group: L.layerGroup().addTo(map), off: new Set(), there: new Map(), latest: 0 };
async function drawLayers() {
  const number = ++shapes.latest;
  shapes.group.clearLayers();
  const n = view.shown, ink = ["#56b4e9", "#e69f00", "#009e73", "#f0e442", "#cc79a7"];
  for (let i = 0; i < view.layers.length; i++) {
    if (shapes.off.has(i)) continue;
    const key = `${i}/${n}`;
    if (!shapes.there.has(key)) {
      const answer = await fetch(`layer/${key}`).catch(() => null);
      if (!answer?.ok) continue;
      shapes.there.set(key, await answer.json());
    }
    // Superseded by a later call.
    if (number !== shapes.latest) return;
    const colour = ink[i % ink.length];
    for (const feature of shapes.there.get(key).features) for (const { kind, places } of feature.shapes) {
      const at = places.map(([r, c]) => [r + 0.5, c + 0.5]), style = { color: colour, weight: 2, fillOpacity: 0.1 };
      const drawn = kind === "points" ? at.map((p) => L.circleMarker(p, { ...style, radius: 6 })) : [kind === "line" ? L.polyline(at, style) : L.polygon(at, style)];
      for (const one of drawn) {
        if (feature.properties.length) { const text = document.createElement("span"); text.textContent = feature.properties.map(([a, b]) => `${a}: ${b}`).join("\n"); one.bindTooltip(text, { sticky: true, direction: "top" }); }
        shapes.group.addLayer(one);
      }
    }
  }
  document.body.dataset.layers = shapes.group.getLayers().length;
}

// Readout at the cursor: at once from the tile, then exactly from the pixel.
let asking = false, asked = null, latest = null;
const degrees = (at) => `${Math.abs(at.latitude_deg).toFixed(6)}° ${at.latitude_deg < 0 ? "S" : "N"}, ${Math.abs(at.longitude_deg).toFixed(6)}° ${at.longitude_deg < 0 ? "W" : "E"}`;
const fixed = (x, n) => (x === null || x === undefined ? "–" : x.toFixed(n));
async function readout(latlng) {
  const about = image(), [row, column] = [Math.floor(latlng.lat), Math.floor(latlng.lng)];
  if (row < 0 || column < 0 || row >= about.rows || column >= about.columns) { asked = latest = null; $("where").textContent = " "; $("place").textContent = $("level").textContent = ""; return; }
  $("where").textContent = `row ${row}, column ${column}`;
  asked = latest = [view.blinked ? view.other : view.shown, row, column];
  if (asking) return;
  asking = true;
  while (asked) {
    const now = asked; asked = null;
    try {
      const answer = await fetch(`value/${now.join("/")}`);
      if (!answer.ok) break;
      const pixel = await answer.json();
      // The cursor has moved on.
      if (now !== latest) continue;
      const words = [];
      if (pixel.position_m) words.push(`x ${fixed(pixel.position_m[0], 2)} m, y ${fixed(pixel.position_m[1], 2)} m`);
      if (pixel.range_m !== undefined) words.push(`range ${fixed(pixel.range_m, 2)} m, ${fixed(pixel.angle_deg, 3)}°`);
      if (pixel.latitude_deg !== undefined) words.push(degrees(pixel));
      $("where").textContent = `row ${pixel.row}, column ${pixel.column}`;
      $("place").textContent = words.map((word) => ` · ${word}`).join("");
      $("level").textContent = pixel.level_db === null ? "no data" : `${fixed(pixel.level_db, 1)} dB, ${fixed(pixel.phase_deg, 0)}°`;
    } catch { break; }
  }
  asking = false;
}

// Poll the progress, and reload tiles when their image has changed.
async function poll() {
  let wait = 1000;
  try {
    const state = await (await fetch("state")).json();
    const before = view.images;
    state.images.forEach((about, i) => { about.tile = before[i]?.tile; });
    view.images = state.images; view.layers = state.layers; view.doppler = state.maps;
    if (!before.length) begin();
    const changed = view.images.map((about, i) => before[i] && (about.revision !== before[i].revision));
    const now = image();
    if (before.length && changed[view.shown]) { levels(); planes.shown?.again(); }
    if (view.other >= 0 && changed[view.other]) planes.other?.again();
    const fault = view.images.find((about) => about.fault);
    if (fault) wrong(`${fault.name}: ${fault.fault}`);
    else {
      document.body.dataset.state = now.settled ? "ready" : "reading";
      $("state").textContent = now.settled ? `${now.rows} x ${now.columns} pixels` : `${now.rows} x ${now.columns} pixels, overview ${Math.floor(100 * now.fraction)} % complete`;
    }
    const settled = view.images.every((about) => about.settled);
    wait = now.revision === 0 ? 60 : settled ? 3000 : 400;
  } catch {
    document.body.dataset.state = "lost"; $("state").textContent = "no connection to the server";
  }
  setTimeout(poll, wait);
}

function begin() {
  const option = (text, value) => { const one = document.createElement("option"); one.textContent = text; one.value = String(value); return one; };
  $("other").append(option("none", -1));
  view.images.forEach((about, i) => { $("image").append(option(about.name, i)); $("other").append(option(about.name, i)); });
  if (view.images.length < 2) for (const id of ["other"]) { $(id).hidden = true; document.querySelector(`label[for=${id}]`).hidden = true; }
  if (view.layers.length) {
    $("layers").hidden = false;
    view.layers.forEach((name, i) => {
      const label = document.createElement("label"), box = document.createElement("input");
      box.type = "checkbox"; box.checked = true; label.append(box, ` ${name}`);
      box.addEventListener("change", () => { box.checked ? shapes.off.delete(i) : shapes.off.add(i); drawLayers(); });
      $("layers").append(label);
    });
  }
  beginDoppler();
  fromAddress();
}

const on = (id, event, what) => $(id).addEventListener(event, what);
on("image", "change", () => show(+$("image").value));
on("other", "change", () => { beside(+$("other").value); keepAddress(); });
on("blink", "click", blink);
on("swipe", "click", () => { view.swiped = !view.swiped; swipe(); keepAddress(); });
on("swipe-at", "input", () => { swipe(); keepAddress(); });
on("top", "input", () => choose(+$("top").value, view.span));
on("span", "input", () => choose(view.top, +$("span").value));
on("auto", "click", () => { view.own = false; levels(); keepAddress(); });
on("map-name", "change", () => { view.map = $("map-name").value; levels(); keepAddress(); });
on("phase", "click", phase);
on("part", "change", () => { view.part = +$("part").value; part(); });
on("part-at", "input", () => { view.partAt = +$("part-at").value; part(); });
function showHelp(shown) { $("help").hidden = !shown; $("keys").setAttribute("aria-expanded", shown); }
on("keys", "click", () => showHelp($("help").hidden));
// Whether the crosshair is visible: the map has keyboard focus.
const byKeys = () => map.getContainer().matches(":focus-visible");
map.on("mousemove", (event) => readout(event.latlng));
map.on("move zoom resize", () => { swipe(); if (byKeys()) readout(map.getCenter()); });
map.on("moveend zoomend", () => { notes(); keepAddress(); });
map.getContainer().addEventListener("focus", () => view.placed && byKeys() && readout(map.getCenter()));
addEventListener("hashchange", () => { if (view.images.length) fromAddress(); });

const KEYS = {
  "[": () => choose(view.top - 1, view.span), "]": () => choose(view.top + 1, view.span), "{": () => choose(view.top, view.span - 5), "}": () => choose(view.top, view.span + 5),
  a: () => $("auto").click(), c: colours, p: phase, b: blink, s: () => planes.other && $("swipe").click(), n: () => show((view.shown + 1) % view.images.length),
  0: () => fit(), 1: () => map.setZoom(0), "?": () => $("keys").click(),
  ",": () => { if (view.part > 1) { view.partAt = Math.max(0, view.partAt - 100 / (2 * view.part)); part(); } },
  ".": () => { if (view.part > 1) { view.partAt = Math.min(100, view.partAt + 100 / (2 * view.part)); part(); } },
};
document.addEventListener("keydown", (event) => {
  const typing = event.key !== "Escape" && event.target.matches("select, input:not([type=checkbox])");
  if (event.ctrlKey || event.metaKey || event.altKey || typing || !view.images.length) return;
  const what = KEYS[event.key];
  if (what) { event.preventDefault(); what(); }
});

// Start after the other scripts are loaded.
const loaded = new Promise((done) => addEventListener("DOMContentLoaded", done));
Promise.all([fetch("colours").then((answer) => answer.json()), loaded]).then(([maps]) => { view.maps = maps; poll(); }, () => { document.body.dataset.state = "lost"; });
