"use strict";
// Measurements: distances, cuts along a line, point responses, and tables of numbers.
const measured = { mode: null, from: null, group: L.layerGroup().addTo(map), curves: [] };
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

function mode(what) {
  measured.mode = measured.mode === what ? null : what;
  measured.from = null;
  for (const each of ["cut", "point", "region", "doppler"]) $(each).setAttribute("aria-pressed", measured.mode === each);
  map.getContainer().style.cursor = measured.mode ? "crosshair" : "";
  // In this mode, dragging draws a rectangle.
  map.dragging[measured.mode === "region" ? "disable" : "enable"]();
  map.getContainer().style.touchAction = measured.mode === "region" ? "none" : "";
  if (measured.mode === "region") report("drag a rectangle, or select two corners: click, or press Enter at the crosshair");
  if (measured.mode === "cut") report("select the start of the line: click, or press Enter at the crosshair");
  if (measured.mode === "doppler") report("select the centre of the map: click, or press Enter at the crosshair");
  if (measured.mode === "point") report("select a point: click, or press Enter at the crosshair");
}
function report(text, isWrong) { $("message").textContent = text; $("message").classList.toggle("wrong", Boolean(isWrong)); }
function clearAll() {
  measured.group.clearLayers(); measured.curves = []; measured.from = null;
  $("chart").hidden = $("numbers").hidden = true;
  region.abort?.abort();
  report("");
  if (measured.mode) mode(measured.mode);
}
// Close all panels and end all measurements.
function closeAll() { clearAll(); forgetDoppler(); showHelp(false); keepAddress(); }

// Row and column at a map position. Pixel r covers r to r + 1, with its centre at r + 0.5.
const pixelAt = (latlng) => [latlng.lat - 0.5, latlng.lng - 0.5];

// Distance between two pixels: metres in the plane of the grid, or pixels without a grid.
function distance(about, [a, b]) {
  const pixels = Math.hypot(b[0] - a[0], b[1] - a[1]);
  if (!about.steps_m) return [pixels, "px"];
  if (!about.polar) return [Math.hypot((b[0] - a[0]) * about.steps_m[0], (b[1] - a[1]) * about.steps_m[1]), "m"];
  const place = ([r, c]) => { const range = about.rows_axis[0] + r * about.rows_axis[1], angle = about.columns_axis[0] + c * about.columns_axis[1]; return [range * Math.cos(angle), range * Math.sin(angle)]; };
  const [p, q] = [place(a), place(b)];
  return [Math.hypot(q[0] - p[0], q[1] - p[1]), "m"];
}

async function pick(latlng) {
  const about = image(), n = view.shown, at = pixelAt(latlng);
  if (measured.mode === "cut") {
    if (!measured.from) {
      measured.group.clearLayers();
      measured.from = [at, latlng];
      L.circleMarker(latlng, { radius: 4, color: "#e69f00" }).addTo(measured.group);
      report("select the end of the line");
      return;
    }
    const [from, first] = measured.from;
    measured.from = null;
    L.polyline([first, latlng], { color: "#e69f00", weight: 2 }).addTo(measured.group);
    const [length, unit] = distance(about, [from, at]);
    const numbers = [...from, ...at].map((x) => x.toFixed(3));
    report(`${length.toPrecision(5)} ${unit} from row ${Math.round(from[0])}, column ${Math.round(from[1])} to row ${Math.round(at[0])}, column ${Math.round(at[1])}`);
    try {
      const cut = await (await fetch(`cut/${n}/${numbers.join("/")}`)).json(), count = cut.levels_db.length;
      measured.curves = [{ name: "cut", x: cut.levels_db.map((_, i) => i / (count - 1) * length), y: cut.levels_db }];
      $("numbers").hidden = true;
      chart(unit);
      const ends = await Promise.all([from, at].map(async (end) => (await fetch(`value/${n}/${end.map(Math.round).join("/")}`)).json().catch(() => ({}))));
      if (ends.every((end) => end.latitude_deg !== undefined)) report(`${$("message").textContent}: ${ends.map(degrees).join(" to ")}`);
    } catch { report("the cut could not be read", true); }
  } else if (measured.mode === "region") {
    if (!measured.from) {
      measured.group.clearLayers();
      measured.from = [at, latlng];
      L.circleMarker(latlng, { radius: 4, color: "#e69f00" }).addTo(measured.group);
      report("select the opposite corner");
      return;
    }
    const first = measured.from[1];
    measured.from = null;
    statistics(...regionOf(first, latlng));
  } else if (measured.mode === "doppler") {
    lookAt(at.map(Math.round));
  } else if (measured.mode === "point") {
    const [row, column] = at.map(Math.round);
    if (row < 0 || column < 0 || row >= about.rows || column >= about.columns) return;
    // The search radius is 8 screen pixels, at least 3 and at most 64 image pixels.
    const search = Math.min(64, Math.max(3, Math.round(8 / 2 ** map.getZoom())));
    report("measuring");
    const answer = await fetch(`point/${n}/${row}/${column}/${search}`).catch(() => null);
    if (!answer?.ok) { report(answer ? await answer.text() : "no connection to the server", true); $("numbers").hidden = $("chart").hidden = true; return; }
    response(await answer.json());
  }
}

function response(found) {
  measured.group.clearLayers();
  L.circleMarker([found.row + 0.5, found.column + 0.5], { radius: 9, color: "#e69f00", fill: false }).addTo(measured.group);
  report(`row ${found.row.toFixed(2)}, column ${found.column.toFixed(2)}${found.in_pixels ? "" : `: x ${found.position_m[0].toFixed(3)} m, y ${found.position_m[1].toFixed(3)} m`}, ${found.level_db.toFixed(2)} dB${found.latitude_deg === undefined ? "" : `; ${degrees(found)}`}`);
  const axes = found.in_pixels ? { x: "columns", y: "rows" } : found.polar ? { x: "angle", y: "range" } : { x: "x", y: "y" };
  // Cuts along and across the line of sight if it is known, otherwise along the grid axes.
  const sighted = found.cuts.some((cut) => cut.along === "range");
  const cuts = found.cuts.map((cut, i) => ({ ...cut, curve: found.curves[i] })).filter((cut) => !sighted || ["range", "cross-range"].includes(cut.along)).map((cut) => {
    const turning = found.polar && cut.along === "x", unit = found.in_pixels ? "px" : turning ? "°" : "m", factor = turning ? 180 / Math.PI : 1;
    return { ...cut, name: axes[cut.along] ?? cut.along.replace("-", " "), unit, factor };
  });
  const db = (x) => (x === null || x === undefined ? "–" : `${x.toFixed(1)} dB`);
  table("point response", ["along", ...cuts.map((cut) => cut.name)], [
    ["3 dB width", ...cuts.map((cut) => (cut.width_3db === null ? "–" : `${(cut.width_3db * cut.factor).toPrecision(3)} ${cut.unit}`))],
    ["peak sidelobe ratio", ...cuts.map((cut) => db(cut.null_rule.pslr_db))],
    ["integrated sidelobe ratio", ...cuts.map((cut) => db(cut.null_rule.islr_db))]]);
  measured.curves = cuts.map((cut) => ({ name: `${cut.name} (${cut.unit})`, x: cut.curve.offsets.map((x) => x * cut.factor), y: cut.curve.levels_db }));
  chart(cuts[0].unit);
}

// Show a table: a row of headings, and rows that begin with a heading.
function table(caption, headings, rows) {
  const row = (kind, cells) => { const line = document.createElement("tr"); cells.forEach((text, i) => { const cell = document.createElement(i === 0 || kind === "th" ? "th" : "td"); cell.scope = i === 0 && kind !== "th" ? "row" : "col"; cell.textContent = text; line.append(cell); }); return line; };
  const all = $("numbers");
  all.caption.textContent = caption;
  all.tHead.replaceChildren(row("th", headings));
  all.tBodies[0].replaceChildren(...rows.map((cells) => row("td", cells)));
  all.hidden = false;
}

// Axis ticks at round values, about `about` of them.
function ticks(from, to, about) {
  const rough = (to - from) / Math.max(1, about) || 1, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= rough * 0.999), all = [];
  for (let i = Math.ceil(from / step - 1e-9); i * step <= to + 1e-9 * step; i++) all.push(i * step);
  return { all, digits: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) };
}

function chart(unit) {
  const canvas = $("chart");
  canvas.hidden = false;
  const ratio = devicePixelRatio || 1, box = canvas.getBoundingClientRect();
  canvas.width = Math.round(box.width * ratio); canvas.height = Math.round(box.height * ratio);
  const ink = canvas.getContext("2d");
  ink.setTransform(ratio, 0, 0, ratio, 0, 0);
  ink.font = "11px system-ui, sans-serif";
  const values = measured.curves.flatMap((curve) => curve.y.filter((y) => y !== null)), xs = measured.curves.flatMap((curve) => curve.x);
  if (!values.length) { report("no data along the line"); return; }
  const high = values.reduce((a, b) => Math.max(a, b)), low = Math.max(values.reduce((a, b) => Math.min(a, b)), high - 80) - 1, top = high + 1;
  const [first, last] = [xs.reduce((a, b) => Math.min(a, b)), xs.reduce((a, b) => Math.max(a, b))];
  const edge = { left: 34, right: 8, top: 6, bottom: 20 }, wide = box.width - edge.left - edge.right, tall = box.height - edge.top - edge.bottom;
  const x = (v) => edge.left + (v - first) / (last - first || 1) * wide, y = (v) => edge.top + (top - Math.max(low, v)) / (top - low) * tall;
  ink.strokeStyle = css("--line"); ink.fillStyle = css("--faint");
  ink.textAlign = "right"; ink.textBaseline = "middle";
  for (const db of ticks(low, top, tall / 28).all) { ink.beginPath(); ink.moveTo(edge.left, y(db)); ink.lineTo(edge.left + wide, y(db)); ink.stroke(); ink.fillText(db.toFixed(0), edge.left - 4, y(db)); }
  ink.textAlign = "center"; ink.textBaseline = "top";
  const { all, digits } = ticks(first, last, wide / 70);
  all.forEach((v, i) => ink.fillText(v.toFixed(digits) + (i === all.length - 1 && measured.curves.length === 1 ? ` ${unit}` : ""), Math.min(x(v), edge.left + wide - 14), box.height - edge.bottom + 5));
  measured.curves.forEach((curve, n) => {
    ink.strokeStyle = css(n ? "--other" : "--curve"); ink.lineWidth = 1.5; ink.setLineDash(n ? [5, 3] : []); ink.beginPath();
    let down = false;
    curve.y.forEach((level, i) => { if (level === null) { down = false; return; } down ? ink.lineTo(x(curve.x[i]), y(level)) : ink.moveTo(x(curve.x[i]), y(level)); down = true; });
    ink.stroke();
  });
  ink.setLineDash([]); ink.lineWidth = 1;
  if (measured.curves.length > 1) { ink.textAlign = "left"; measured.curves.forEach((curve, n) => { ink.fillStyle = css(n ? "--other" : "--curve"); ink.fillText(`${n ? "- -" : "—"} ${curve.name}`, edge.left + 4, edge.top + 2 + 13 * n); }); }
  canvas.setAttribute("aria-label", `levels along ${measured.curves.map((curve) => curve.name).join(" and ")}, from ${low.toFixed(0)} to ${high.toFixed(1)} dB`);
  document.body.dataset.chart = String(values.length);
}

on("cut", "click", () => mode("cut"));
on("point", "click", () => mode("point"));
on("clear", "click", clearAll);
map.on("click", (event) => measured.mode && !region.dragged && pick(event.latlng));
Object.assign(KEYS, { d: () => mode("cut"), r: () => mode("point"), Escape: closeAll });
map.getContainer().addEventListener("keydown", (event) => { if (event.key === "Enter" && measured.mode) { event.preventDefault(); pick(map.getCenter()); } });
