"use strict";
// Axes at the map's edges, scale bar, and arrows of north and of the line of sight.
const EDGE_LEFT = 52, EDGE_BOTTOM = 20, BAR_PX = 150;
const frame = L.DomUtil.create("canvas", "frame", map.getContainer());
frame.id = "frame"; frame.setAttribute("role", "img");

// Largest of 1, 2 and 5 times a power of ten that is at most `limit`.
function roundBelow(limit) {
  const power = 10 ** Math.floor(Math.log10(limit) + 1e-9);
  return [5, 2, 1].map((m) => m * power).find((length) => length <= limit * (1 + 1e-9));
}
const metres = (length) => (length >= 1000 ? `${length / 1000} km` : length >= 1 ? `${length} m` : `${+(100 * length).toPrecision(3)} cm`);

// Scale bar: its length, width on the screen and text; null if the spacing of pixels is unknown.
function scaleBar(about) {
  if (!about.steps_m) return null;
  const per = about.tile.x / TILE * 2 ** map.getZoom(), range = about.rows_axis[0] + (map.getCenter().lat - 0.5) * about.rows_axis[1];
  // A column of a polar grid is wider at larger range.
  const step = about.polar ? Math.abs(range) * about.columns_axis[1] : about.steps_m[1], length = roundBelow(BAR_PX * step / per);
  if (!length) return null;
  const tilt = about.axes.tilt_deg, where = about.polar ? ` across at ${range.toPrecision(4)} m` : tilt >= 1 ? ` in the slant plane (${tilt.toFixed(0)}° from horizontal)` : "";
  return { length, width: length / step * per, text: metres(length) + where };
}

// Value at a place along rows or columns. Pixel r covers r to r + 1, with its centre at r + 0.5.
const value = (axis, at) => axis.start + (at - 0.5) * axis.step;

// Direction of north or of the line of sight, along ascending rows and columns as the page scales them; null if unknown. On a polar grid at the centre of
// the view, or at the pixel nearest to it.
function direction(about, key) {
  const { rows, columns, north, antenna_m } = about.axes, centre = map.getCenter();
  if (!about.polar) return about.axes[key];
  const near = (at, count) => Math.min(Math.max(at, 0.5), count - 0.5);
  const range = value(rows, near(centre.lat, about.rows)), angle = value(columns, near(centre.lng, about.columns)) * Math.PI / 180;
  const [cos, sin] = [Math.cos(angle), Math.sin(angle)];
  let [y, x] = north ?? [0, 0];
  if (key === "look") {
    if (!antenna_m) return null;
    [x, y] = [range * cos - antenna_m[0], range * sin - antenna_m[1]];
    if (Math.hypot(x, y) < 0.05 * Math.hypot(x, y, antenna_m[2])) return null;
  }
  // The page draws columns as wide as at mid-range.
  return range && (x || y) && [x * cos + y * sin, (y * cos - x * sin) * about.steps_m[1] / (range * about.columns_axis[1])];
}

function drawFrame() {
  const about = image();
  if (!about || !view.placed) return;
  const ratio = devicePixelRatio || 1, { x: wide, y: tall } = map.getSize(), ink = frame.getContext("2d");
  frame.width = Math.round(wide * ratio); frame.height = Math.round(tall * ratio);
  ink.setTransform(ratio, 0, 0, ratio, 0, 0);
  ink.font = "11px system-ui, sans-serif";
  const text = css("--ink"), paper = css("--panel"), { rows, columns } = about.axes, base = tall - EDGE_BOTTOM, said = [];
  ink.fillStyle = paper; ink.fillRect(0, 0, EDGE_LEFT, tall); ink.fillRect(0, base, wide, EDGE_BOTTOM);
  ink.fillStyle = ink.strokeStyle = text; ink.lineWidth = 1;
  const pixel = (axis, v) => (v - axis.start) / axis.step + 0.5;
  const corners = [map.containerPointToLatLng([EDGE_LEFT, base]), map.containerPointToLatLng([wide, 0])];
  const ends = (axis, key) => corners.map((corner) => value(axis, corner[key])).sort((a, b) => a - b);
  const unit = (axis) => (axis.unit ? `${axis.name} (${axis.unit})` : axis.name);
  const across = ends(columns, "lng"), down = ends(rows, "lat"), name = unit(columns), nameFrom = wide - ink.measureText(name).width - 8;
  ink.textBaseline = "middle"; ink.textAlign = "center";
  const right = ticks(...across, (wide - EDGE_LEFT) / 90), up = ticks(...down, base / 60);
  for (const v of right.all) {
    const { x } = map.latLngToContainerPoint([0, pixel(columns, v)]), label = v.toFixed(right.digits), half = ink.measureText(label).width / 2;
    ink.fillRect(Math.round(x), base, 1, 4);
    if (x - half > EDGE_LEFT && x + half < nameFrom - 4) ink.fillText(label, x, tall - 8);
  }
  ink.textAlign = "right";
  for (const v of up.all) {
    const { y } = map.latLngToContainerPoint([pixel(rows, v), 0]);
    ink.fillRect(EDGE_LEFT - 4, Math.round(y), 4, 1);
    if (y > 26 && y < base - 6) ink.fillText(v.toFixed(up.digits), EDGE_LEFT - 6, y);
  }
  ink.textAlign = "left"; ink.fillText(unit(rows), 4, 10); ink.fillText(name, nameFrom, tall - 8);
  said.push(`${unit(rows)} from ${down[0].toFixed(up.digits)} to ${down[1].toFixed(up.digits)}`, `${name} from ${across[0].toFixed(right.digits)} to ${across[1].toFixed(right.digits)}`);
  const bar = scaleBar(about);
  if (bar) {
    const box = Math.max(bar.width, ink.measureText(bar.text).width) + 16, left = wide - box - 8, top = base - 38;
    ink.fillStyle = paper; ink.fillRect(left, top, box, 30);
    ink.fillStyle = text; ink.textAlign = "center"; ink.fillText(bar.text, left + box / 2, top + 10);
    ink.fillRect(left + (box - bar.width) / 2, top + 20, bar.width, 3);
    for (const end of [0, bar.width - 1]) ink.fillRect(left + (box - bar.width) / 2 + end, top + 17, 1, 9);
    said.push(`scale bar of ${bar.text}`);
  }
  frame.dataset.bar = JSON.stringify(bar && [bar.length, bar.width]);
  // Arrows: along ascending rows and columns, as the page shows them.
  let middle = wide - 34;
  for (const [label, key] of [["N", "north"], ["look", "look"]]) {
    const towards = direction(about, key);
    delete frame.dataset[key];
    if (!towards) continue;
    const angle = Math.atan2(about.right * towards[1], about.up * towards[0]);
    ink.save(); ink.translate(middle, 40);
    ink.fillStyle = paper; ink.beginPath(); ink.roundRect(-27, -27, 54, 72, 27); ink.fill();
    ink.rotate(angle);
    ink.fillStyle = ink.strokeStyle = text; ink.lineWidth = 2;
    ink.beginPath(); ink.moveTo(0, 20); ink.lineTo(0, -12); ink.stroke();
    ink.beginPath(); ink.moveTo(0, -22); ink.lineTo(6, -10); ink.lineTo(-6, -10); ink.fill();
    ink.rotate(-angle);
    ink.textAlign = "center"; ink.fillText(label, 0, 35);
    ink.restore();
    const degrees = Math.round((angle * 180 / Math.PI + 360) % 360);
    frame.dataset[key] = degrees;
    said.push(`${label === "N" ? "north" : "look direction"} ${degrees}° clockwise from up`);
    middle -= 66;
  }
  frame.setAttribute("aria-label", said.join("; "));
}
let framing = 0;
function redrawFrame() { cancelAnimationFrame(framing); framing = requestAnimationFrame(drawFrame); }
map.on("move zoom viewreset", redrawFrame);
map.on("resize", drawFrame);
// The map also changes its size with the lines of the header. Its centre stays: Leaflet would move it by a fraction of a pixel.
new ResizeObserver(() => {
  if (!view.placed) { map.invalidateSize({ pan: false }); return; }
  const centre = map.getCenter(), zoom = map.getZoom();
  map.invalidateSize({ pan: false });
  map.setView(centre, zoom, { animate: false, reset: true });
}).observe(map.getContainer());
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redrawFrame);
