"use strict";
// Statistics of a rectangle of the image, and the picture of the view as a file.
const region = { from: null, dragged: false, abort: null };
map.boxZoom.disable();

// First and last row and column (excluded) between two positions, within the image.
function regionOf(a, b) {
  const about = image(), ends = (key, count) => {
    const [low, high] = [Math.min(a[key], b[key]), Math.max(a[key], b[key])].map((at) => Math.min(count, Math.max(0, at)));
    const first = Math.min(count - 1, Math.floor(low));
    return [first, Math.max(first + 1, Math.ceil(high))];
  };
  return [ends("lat", about.rows), ends("lng", about.columns)];
}
function outline([rows, columns]) {
  measured.group.clearLayers();
  L.rectangle([[rows[0], columns[0]], [rows[1], columns[1]]], { color: "#e69f00", weight: 2, fillOpacity: 0.08 }).addTo(measured.group);
}
async function statistics(rows, columns) {
  outline([rows, columns]);
  region.abort?.abort();
  const abort = region.abort = new AbortController();
  $("chart").hidden = $("numbers").hidden = true;
  report("measuring");
  try {
    const answer = await fetch(`statistics/${view.blinked ? view.other : view.shown}/${rows[0]}/${columns[0]}/${rows[1]}/${columns[1]}`, { signal: abort.signal });
    if (!answer.ok) { report(await answer.text(), true); return; }
    const found = await answer.json();
    report(`rows ${rows[0]} to ${rows[1] - 1}, columns ${columns[0]} to ${columns[1] - 1}`);
    const db = (x) => (x === null ? "–" : `${x.toFixed(2)} dB`);
    table(view.part > 1 ? "region, full aperture" : "region", ["", "intensity"], [
      ["pixels", found.num_pixels.toLocaleString("en").replaceAll(",", " ")], ...(found.num_not_finite ? [["pixels left out (not finite)", String(found.num_not_finite)]] : []),
      ["mean", db(found.mean_db)], ["standard deviation", db(found.standard_deviation_db)],
      ["equivalent number of looks", found.looks === null ? "–" : found.looks.toPrecision(4)],
      ["minimum", db(found.minimum_db)], ["median", db(found.median_db)], ["maximum", db(found.maximum_db)], ["mean level", db(found.mean_level_db)]]);
  } catch (error) { if (error.name !== "AbortError") report("no connection to the server", true); }
}

const surface = map.getContainer();
surface.addEventListener("pointerdown", (event) => {
  region.dragged = false;
  if (event.button !== 0 || !event.isPrimary || !(event.shiftKey || measured.mode === "region") || event.target.closest(".leaflet-control")) { region.from = null; return; }
  region.from = { at: map.mouseEventToLatLng(event), x: event.clientX, y: event.clientY };
});
addEventListener("pointermove", (event) => {
  if (!region.from || !event.isPrimary) return;
  // A smaller movement is a click.
  if (!region.dragged && Math.hypot(event.clientX - region.from.x, event.clientY - region.from.y) < 5) return;
  region.dragged = true;
  outline(regionOf(region.from.at, map.mouseEventToLatLng(event)));
});
addEventListener("pointerup", (event) => {
  const { from } = region;
  region.from = null;
  if (from && region.dragged) statistics(...regionOf(from.at, map.mouseEventToLatLng(event)));
});
addEventListener("pointercancel", () => { region.from = null; });

// Name of the picture's file: that of the image, without folders and ending.
const pictureName = (name) => `${name.split(/[\\/]/).filter((part) => part && !/^\.+$/.test(part)).pop()?.replace(/\.(npy|ntf|nitf|json|zarr|tiff?)$/i, "") || "image"}.png`;

// The view as displayed, in pixels of the screen: tiles without smoothing, layers, measurements, axes.
function drawnView() {
  const ratio = devicePixelRatio || 1, canvas = document.createElement("canvas"), ink = canvas.getContext("2d"), corner = surface.getBoundingClientRect();
  [canvas.width, canvas.height] = [corner.width, corner.height].map((side) => Math.round(side * ratio));
  ink.fillStyle = css("--nothing"); ink.fillRect(0, 0, canvas.width, canvas.height);
  ink.imageSmoothingEnabled = false;
  const put = (element) => {
    const box = element.getBoundingClientRect(), [left, right] = [box.left, box.right].map((x) => Math.round((x - corner.left) * ratio)), [top, bottom] = [box.top, box.bottom].map((y) => Math.round((y - corner.top) * ratio));
    if (right > left && bottom > top) ink.drawImage(element, left, top, right - left, bottom - top);
  };
  for (const plane of [planes.shown, planes.other]) {
    if (!plane || (plane === planes.other && !view.blinked && !view.swiped)) continue;
    ink.save();
    if (plane === planes.other && view.swiped) { ink.beginPath(); ink.rect(Math.round(canvas.width * $("swipe-at").value / 100), 0, canvas.width, canvas.height); ink.clip(); }
    plane.current(put);
    ink.restore();
  }
  for (const drawing of surface.querySelectorAll(".leaflet-overlay-pane canvas")) put(drawing);
  put(frame);
  return canvas;
}
function save() {
  if (view.drawn !== view.wanted) { setTimeout(save, 100); return; }
  drawFrame();
  drawnView().toBlob((bytes) => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(bytes); link.download = pictureName(view.blinked ? view.images[view.other].name : image().name);
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  }, "image/png");
}

on("region", "click", () => mode("region"));
on("save", "click", save);
Object.assign(KEYS, { t: () => mode("region"), w: save });
